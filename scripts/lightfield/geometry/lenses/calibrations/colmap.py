"""Reads the cameras.txt and the cameras.bin of COLMAP.

The centre of the first pixel is at (0.5, 0.5), as here. Sources: COLMAP's models.h and format.rst.
"""

import struct
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from lightfield.core.errors import UserError
from lightfield.core.files import read_bytes, read_text, reading
from lightfield.geometry.lenses.calibrations.base import FORMATS, Calibration, Hints, Keys, Reader


class _CameraModel(NamedTuple):
    """A camera model of COLMAP's.

    ``number`` is its number in binary files. ``focals`` are its focal lengths, and ``parameters``
    its parameters after the principal point. Fewer than the lens's are filled up with zeros.
    """

    number: int
    lens: str
    focals: int
    parameters: int
    coefficients: int


_MODELS = {
    "SIMPLE_PINHOLE": _CameraModel(0, "brown_conrady", 1, 0, 8),
    "PINHOLE": _CameraModel(1, "brown_conrady", 2, 0, 8),
    "SIMPLE_RADIAL": _CameraModel(2, "brown_conrady", 1, 1, 8),
    "RADIAL": _CameraModel(3, "brown_conrady", 1, 2, 8),
    "OPENCV": _CameraModel(4, "brown_conrady", 2, 4, 8),
    "OPENCV_FISHEYE": _CameraModel(5, "kannala_brandt", 2, 4, 4),
    "FULL_OPENCV": _CameraModel(6, "brown_conrady", 2, 8, 8),
    "FOV": _CameraModel(7, "fov_model", 2, 1, 1),
    "SIMPLE_RADIAL_FISHEYE": _CameraModel(8, "kannala_brandt", 1, 1, 4),
    "RADIAL_FISHEYE": _CameraModel(9, "kannala_brandt", 1, 2, 4),
    "THIN_PRISM_FISHEYE": _CameraModel(10, "thin_prism_fisheye", 2, 8, 8),
    "RAD_TAN_THIN_PRISM_FISHEYE": _CameraModel(11, "fisheye624", 2, 12, 12),
    "SIMPLE_DIVISION": _CameraModel(12, "division", 1, 1, 1),
    "DIVISION": _CameraModel(13, "division", 2, 1, 1),
    "SIMPLE_FISHEYE": _CameraModel(14, "kannala_brandt", 1, 0, 4),
    "FISHEYE": _CameraModel(15, "kannala_brandt", 2, 0, 4),
    "EUCM": _CameraModel(16, "extended_unified", 2, 2, 2),
    # Its two parameters, the image's sides, count as focal lengths here.
    "EQUIRECTANGULAR": _CameraModel(17, "equirectangular", 2, 0, 0),
}
_NUMBERS = {model.number: name for name, model in _MODELS.items()}


def _parameter_count(model: _CameraModel) -> int:
    """Return how many parameters a camera of COLMAP's has."""
    center = 0 if model.lens == "equirectangular" else 2
    return model.focals + center + model.parameters


def of_text(path: Path) -> dict[str, Reader]:
    """Return the cameras of a cameras.txt by their numbers."""
    cameras: dict[str, Reader] = {}
    for line in read_text(path).splitlines():
        words = line.split()
        if not words or line.startswith("#"):
            continue
        if len(words) < 5 or not words[0].isdecimal():
            raise UserError(
                f"{path}: {words[0]}: must be CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]; {FORMATS}"
            )
        number, name, *values = words
        cameras[number] = partial(_camera, number, name, [_as_number(value) for value in values])
    if not cameras:
        raise UserError(f"{path}: holds no camera; {FORMATS}")
    return cameras


def _as_number(word: str) -> Any:
    """Return a word as a number, or the word itself."""
    try:
        return float(word)
    except ValueError:
        return word


def of_binary(path: Path) -> dict[str, Reader]:
    """Return the cameras of a cameras.bin by their numbers."""
    with reading(path, "cameras.bin"):
        content = read_bytes(path)
        (count,), start = struct.unpack_from("<Q", content), 8
        cameras: dict[str, Reader] = {}
        for _ in range(count):
            number, model, *size = struct.unpack_from("<iiQQ", content, start)
            start += struct.calcsize("<iiQQ")
            name = _NUMBERS.get(model)
            if name is None:
                # The length of its parameters is unknown, so no camera after it can be read.
                raise ValueError(f"camera {number} has the model {model}")
            parameters = f"<{_parameter_count(_MODELS[name])}d"
            values = [*size, *struct.unpack_from(parameters, content, start)]
            start += struct.calcsize(parameters)
            cameras[str(number)] = partial(_camera, str(number), name, values)
    if not cameras:
        raise UserError(f"{path}: holds no camera")
    return cameras


def _camera(number: str, name: str, values: Sequence[Any], hints: Hints) -> Calibration:
    keys = Keys(f"camera {number}: ", {"size": [*values[:2]], name: [*values[2:]]})
    if name not in _MODELS:
        raise keys.error("MODEL", f"is {name}; must be one of {', '.join(_MODELS)}")
    model = _MODELS[name]
    size = keys.size(hints, ("size",), ())
    numbers = keys.numbers(name, _parameter_count(model))
    if model.lens == "equirectangular":
        return Calibration(model.lens, size)
    focal_lengths = keys.focal_lengths(name, *numbers[: model.focals])
    cx, cy, *parameters = numbers[model.focals :]
    missing = [0.0] * (model.coefficients - model.parameters)
    coefficients = (*parameters, *missing)
    return Calibration(model.lens, size, focal_lengths, (cx, cy), coefficients)
