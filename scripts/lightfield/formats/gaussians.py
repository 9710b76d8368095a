"""Gaussian splats, and the PLY file that 3D Gaussian splatting keeps them in.

The file has one vertex for each Gaussian: its centre, the coefficients of its colour, the logit of
its opacity, the logarithms of its standard deviations, and its rotation as w, x, y, z. Source:
graphdeco-inria/gaussian-splatting, scene/gaussian_model.py.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import write_bytes

Floats = NDArray[np.float64]

# The constant spherical harmonic. A colour is the sum of its harmonics, and this much more.
HARMONIC_0 = 0.28209479177387814
GREY = 0.5
# Opacities stay this far from 0 and 1, where the logit is infinite.
_LEAST_OPACITY = 1e-6
# Numbers of harmonics of the degrees 0 to 3.
_HARMONICS = (1, 4, 9, 16)
_END = b"end_header\n"
_LONGEST_HEADER = 65536


@dataclass(frozen=True)
class Gaussians:
    """Gaussians in the world, in metres.

    - ``positions`` (n, 3).
    - ``scales`` (n, 3): standard deviations along each Gaussian's own axes.
    - ``rotations`` (n, 4): unit quaternions w, x, y, z that turn its axes into the world's.
    - ``harmonics`` (n, k, 3): coefficients of the sRGB-encoded colour, k = 1, 4, 9 or 16.
    - ``opacities`` (n,): 0 to 1.
    """

    positions: Floats
    scales: Floats
    rotations: Floats
    harmonics: Floats
    opacities: Floats

    def __len__(self) -> int:
        return len(self.positions)


def harmonics_of(colours: Floats) -> Floats:
    """Return the harmonics (n, 1, 3) of sRGB-encoded ``colours`` (n, 3), 0 to 1."""
    harmonics: Floats = (colours - GREY) / HARMONIC_0
    return harmonics[:, np.newaxis]


def _names(harmonics: int) -> list[str]:
    """Return the properties of a vertex in the file's order."""
    rest = [f"f_rest_{i}" for i in range(3 * (harmonics - 1))]
    return [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *rest,
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]


def write(path: Path, gaussians: Gaussians) -> None:
    """Write a PLY of ``gaussians``. All values are 32-bit floats."""
    count = len(gaussians)
    opacity = gaussians.opacities.clip(_LEAST_OPACITY, 1 - _LEAST_OPACITY)
    # The file has all coefficients of red, then of green, then of blue.
    rest = gaussians.harmonics[:, 1:].transpose(0, 2, 1).reshape(count, -1)
    columns = np.hstack(
        [
            gaussians.positions,
            np.zeros((count, 3)),
            gaussians.harmonics[:, 0],
            rest,
            np.log(opacity / (1 - opacity))[:, np.newaxis],
            np.log(gaussians.scales),
            gaussians.rotations,
        ]
    )
    names = _names(gaussians.harmonics.shape[1])
    properties = "".join(f"property float {name}\n" for name in names)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}"
    write_bytes(path, header.encode() + _END + columns.astype("<f4").tobytes())


def read(path: Path) -> Gaussians:
    """Read a PLY of Gaussians. Raises `UserError` for any other file."""
    with path.open("rb") as file:
        start = file.read(_LONGEST_HEADER)
        header, end, _ = start.partition(_END)
        lines = header.decode("ascii", "replace").splitlines()
        count, names = _vertices(lines)
        if not end or count is None:
            raise UserError(
                f"{path}: is not a splat's PLY: it must be binary_little_endian, with vertices of "
                "floats alone; export it as 3D Gaussian splatting writes it"
            )
        file.seek(len(header) + len(end))
        values = file.read(4 * count * len(names))
    missing = [name for name in _names(1) if name not in names and not name.startswith("n")]
    if missing:
        raise UserError(f"{path}: has no {missing[0]}; a splat's PLY must have it")
    if len(values) != 4 * count * len(names):
        raise UserError(f"{path}: is cut off: it must have {count} vertices")
    columns = np.frombuffer(values, "<f4").reshape(count, -1).T.astype(np.float64)
    by_name = dict(zip(names, columns, strict=True))
    harmonics = 1 + sum(name.startswith("f_rest_") for name in names) // 3
    if harmonics not in _HARMONICS:
        raise UserError(f"{path}: has {harmonics - 1} f_rest a colour; must be 0, 3, 8 or 15")
    return Gaussians(
        _stacked(by_name, "x", "y", "z"),
        np.exp(_stacked(by_name, *(f"scale_{i}" for i in range(3)))),
        _unit(_stacked(by_name, *(f"rot_{i}" for i in range(4)))),
        _harmonics(by_name, harmonics),
        1 / (1 + np.exp(-by_name["opacity"])),
    )


def _vertices(lines: list[str]) -> tuple[int | None, list[str]]:
    """Return how many vertices a header has, and their properties. None for another kind of PLY."""
    if lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        return None, []
    words = [line.split() for line in lines[2:] if not line.startswith(("comment", "obj_info"))]
    if not words or words[0][:2] != ["element", "vertex"] or not words[0][2:3]:
        return None, []
    properties = [
        line[2] for line in words[1:] if len(line) == 3 and line[:2] == ["property", "float"]
    ]
    count = words[0][2]
    if len(properties) != len(words) - 1 or not count.isdecimal():
        return None, []
    return int(count), properties


def _harmonics(by_name: dict[str, Floats], count: int) -> Floats:
    constant = _stacked(by_name, *(f"f_dc_{i}" for i in range(3)))[:, np.newaxis]
    if count == 1:
        return constant
    rest = _stacked(by_name, *(f"f_rest_{i}" for i in range(3 * (count - 1))))
    return np.concatenate([constant, rest.reshape(-1, 3, count - 1).transpose(0, 2, 1)], axis=1)


def _stacked(by_name: dict[str, Floats], *names: str) -> Floats:
    return np.stack([by_name[name] for name in names], axis=1)


def _unit(vectors: Floats) -> Floats:
    """Return vectors (n, k) of length 1. Trainers do not normalise their quaternions."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-12))
