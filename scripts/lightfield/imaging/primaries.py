"""The colour spaces of EXR files: their primaries and white points, and the way between them.

All light here is scene-linear Rec. 709. An EXR names another space by its attribute
``chromaticities``. Without it, a file has Rec. 709 (OpenEXR's Technical Introduction).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Chromaticities = tuple[float, ...]
"""CIE x and y of red, green, blue and white."""

# Rec. ITU-R BT.709, and AP1 of the Academy's S-2014-004.
REC_709: Chromaticities = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
ACESCG: Chromaticities = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
PRIMARIES = {"rec709": REC_709, "acescg": ACESCG}

# Chromaticities that differ by less are the same: files hold them in 32 bits.
_SAME = 1e-4
# From XYZ to the cones' responses. Source: Lam, Metamerism and Colour Constancy, 1985 (Bradford).
_CONES = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def are_rec_709(chromaticities: Chromaticities | None) -> bool:
    """Return whether a file has Rec. 709. None stands for a file without the attribute."""
    return chromaticities is None or np.allclose(chromaticities, REC_709, rtol=0, atol=_SAME)


def xyz_matrix(chromaticities: Chromaticities) -> Floats:
    """Return the matrix (3, 3) from linear R, G, B to CIE XYZ, in which white has Y = 1.

    Source: SMPTE RP 177-1993.
    """
    *primaries, white = [_xyz(x, y) for x, y in np.reshape(chromaticities, (4, 2))]
    columns = np.stack(primaries, axis=-1)
    return np.asarray(columns * np.linalg.solve(columns, white))


def conversion(source: Chromaticities, target: Chromaticities) -> Floats:
    """Return the matrix (3, 3) that converts linear colours from one space to another.

    White stays white: the adaptation between the white points is Bradford's.
    """
    source_white = _xyz(*source[6:])
    target_white = _xyz(*target[6:])
    scale = (_CONES @ target_white) / (_CONES @ source_white)
    adaptation = np.linalg.inv(_CONES) @ np.diag(scale) @ _CONES
    to_target = np.linalg.inv(xyz_matrix(target))
    return np.asarray(to_target @ adaptation @ xyz_matrix(source))


def white_balance(white: Sequence[float], space: Chromaticities) -> Floats:
    """Return the matrix (3, 3) that makes the colour ``white`` (3,) of a space its white.

    The adaptation is Bradford's.
    """
    to_xyz = xyz_matrix(space)
    scale = (_CONES @ to_xyz @ np.ones(3)) / (_CONES @ to_xyz @ np.array(white, np.float64))
    adaptation = np.linalg.inv(_CONES) @ np.diag(scale) @ _CONES
    return np.asarray(np.linalg.inv(to_xyz) @ adaptation @ to_xyz)


def to_rec_709(
    colour: NDArray[np.float32], chromaticities: Chromaticities | None
) -> NDArray[np.float32]:
    """Return colour (…, 3) of a file as Rec. 709. The same array if it is that already."""
    if chromaticities is None or are_rec_709(chromaticities):
        return colour
    return _converted(colour, conversion(chromaticities, REC_709))


def from_rec_709(colour: NDArray[np.float32], primaries: str) -> NDArray[np.float32]:
    """Return Rec. 709 colour (…, 3) in one of `PRIMARIES`. The same array for Rec. 709."""
    if primaries == "rec709":
        return colour
    return _converted(colour, conversion(REC_709, PRIMARIES[primaries]))


def _converted(colour: NDArray[np.float32], matrix: Floats) -> NDArray[np.float32]:
    return np.asarray(colour @ matrix.T.astype(np.float32), np.float32)


def _xyz(x: float, y: float) -> Floats:
    return np.array([x / y, 1, (1 - x - y) / y])
