"""Reads Kalibr's camchain.yaml, and EuRoC's sensor.yaml.

The centre of the first pixel is at (0, 0). Sources: Kalibr's wiki and its
kalibr_common/ConfigReader.py; EuRoC's sensor.yaml.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from lightfield.geometry.lenses.calibrations.base import (
    BROWN_CONRADY,
    HALF,
    Calibration,
    Hints,
    Keys,
    Reader,
)


class _Projection(NamedTuple):
    """A camera model of Kalibr's: the lens, and the first intrinsics, which are its own."""

    lens: str
    parameters: int


_PROJECTIONS = {
    "pinhole": _Projection("brown_conrady", 0),
    "omni": _Projection("unified", 1),
    "ds": _Projection("double_sphere", 2),
    "eucm": _Projection("extended_unified", 2),
}
# The lens of a pinhole camera with a distortion, and the number of its coefficients.
_DISTORTIONS = {
    "none": ("brown_conrady", 0),
    "radtan": ("brown_conrady", 4),
    "radial-tangential": ("brown_conrady", 4),
    "equidistant": ("kannala_brandt", 4),
    "fov": ("fov_model", 1),
}


def cameras(content: Mapping[str, Any]) -> dict[str, Reader]:
    """Return the camera of a sensor.yaml, or the cameras of a camchain.yaml by their names."""
    if "intrinsics" in content:
        return {"": partial(_camera, Keys("", content))}
    return {
        str(name): partial(_camera, Keys(f"{name}.", entry))
        for name, entry in content.items()
        if isinstance(entry, Mapping) and "intrinsics" in entry
    }


def _camera(keys: Keys, hints: Hints) -> Calibration:
    model = keys.text("camera_model", "pinhole")
    if model not in _PROJECTIONS:
        raise keys.error("camera_model", f"is {model!r}; must be one of {', '.join(_PROJECTIONS)}")
    projection = _PROJECTIONS[model]
    numbers = keys.numbers("intrinsics", projection.parameters + 4)
    lens, coefficients = projection.lens, numbers[: projection.parameters]
    distortion = keys.text("distortion_model", "none")
    if distortion not in _DISTORTIONS:
        allowed = ", ".join(_DISTORTIONS)
        raise keys.error("distortion_model", f"is {distortion!r}; must be one of {allowed}")
    if model == "pinhole":
        lens, coefficients = _pinhole(keys, distortion)
    elif distortion != "none" and any(_pinhole(keys, distortion)[1]):
        raise keys.error(
            "distortion_model",
            f"is {distortion!r}, but no lens here has the camera_model {model!r} with a "
            f"distortion; calibrate {model}-none, or pinhole-{distortion}",
        )
    fx, fy, cx, cy = numbers[-4:]
    size = keys.size(hints, ("resolution",), ())
    focal_lengths = keys.focal_lengths("intrinsics", fx, fy)
    return Calibration(lens, size, focal_lengths, (cx + HALF, cy + HALF), coefficients)


def _pinhole(keys: Keys, distortion: str) -> tuple[str, tuple[float, ...]]:
    """Return the lens of a pinhole camera with a distortion, and its coefficients."""
    lens, count = _DISTORTIONS[distortion]
    key = keys.first(("distortion_coeffs", "distortion_coefficients")) or "distortion_coeffs"
    coefficients = keys.numbers(key, count) if count else ()
    if lens == "brown_conrady":
        return lens, (*coefficients, *[0.0] * (BROWN_CONRADY - count))
    return lens, coefficients
