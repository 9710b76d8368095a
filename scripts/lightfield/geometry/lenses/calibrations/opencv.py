"""Reads the files of OpenCV's FileStorage, which ROS's camera_info resembles.

The centre of the first pixel is at (0, 0). Sources: OpenCV's camera_calibration.cpp and
stereo_calib.cpp; ROS's camera_info_manager.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from lightfield.core.errors import UserError
from lightfield.core.files import read_bytes, read_error, read_text
from lightfield.geometry.lenses.calibrations.base import (
    BROWN_CONRADY,
    HALF,
    Calibration,
    Hints,
    Keys,
    Model,
    Reader,
)

# Names of the camera matrix and of the coefficients. OpenCV's own programs write the first ones,
# with 1 and 2 at their ends for a stereo pair.
_MATRICES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "mtx", "K", "M")
_COEFFICIENTS = (
    *("distortion_coefficients", "Distortion_Coefficients", "distortionCoefficients"),
    *("distCoeffs", "dist_coeffs", "dist_coeff", "dist", "D"),
)
_SIDES = (("image_width", "image_height"), ("image_Width", "image_Height"), ("width", "height"))
_PAIRS = ("image_size", "imageSize", "img_size", "resolution")
# What keys of files call the lenses.
_MODELS: dict[str, Model] = {
    "plumb_bob": "brown_conrady",
    "rational_polynomial": "brown_conrady",
    "radtan": "brown_conrady",
    "radial-tangential": "brown_conrady",
    "equidistant": "kannala_brandt",
    "fisheye": "kannala_brandt",
}


def cameras(content: Mapping[str, Any]) -> dict[str, Reader]:
    """Return the cameras of a file of OpenCV's FileStorage."""
    keys = Keys("", content)
    return {
        end: partial(_camera, keys, matrix, [f"{name}{end}" for name in _COEFFICIENTS])
        for end in ("", "1", "2")
        if (matrix := keys.first(f"{name}{end}" for name in _MATRICES))
    }


def _camera(keys: Keys, matrix: str, distortions: Sequence[str], hints: Hints) -> Calibration:
    fx, skew, cx, zero, fy, cy, *last = keys.numbers(matrix, 9)
    if skew or zero or last != [0, 0, 1]:
        raise keys.error(matrix, "must be fx, 0, cx, 0, fy, cy, 0, 0, 1: no lens here has skew")
    distortion = keys.first(distortions)
    if distortion is None:
        raise keys.error(
            distortions[0], "is missing; write five zeros if the lens has no distortion"
        )
    coefficients = keys.numbers(distortion)
    lens = _model(keys, distortion, len(coefficients), hints)
    if lens == "kannala_brandt":
        coefficients = keys.numbers(distortion, 4)
    else:
        coefficients = _brown_conrady(keys, distortion, coefficients)
    size = keys.size(hints, _PAIRS, _SIDES)
    center = cx + HALF, cy + HALF
    return Calibration(lens, size, keys.focal_lengths(matrix, fx, fy), center, coefficients)


def _model(keys: Keys, distortion: str, count: int, hints: Hints) -> Model:
    """Return the lens of OpenCV's coefficients. Four of them may belong to either."""
    said: Model | None = None
    if key := keys.first(("fisheye_model", "fisheye")):
        said = "kannala_brandt" if keys.number(key) else "brown_conrady"
    elif key := keys.first(("distortion_model", "model")):
        name = keys.text(key, "")
        if name not in _MODELS:
            raise keys.error(key, f"is {name!r}; must be one of {', '.join(_MODELS)}")
        said = _MODELS[name]
    if said and hints.model not in (None, said):
        raise keys.error(
            str(key), f"means {said}; leave out the key model, which says {hints.model}"
        )
    model = said or hints.model
    if model is None and count == 4:
        raise keys.error(
            distortion,
            "has 4 numbers, which OpenCV's usual lens and its fisheye have; add the key model: "
            "brown_conrady or model: kannala_brandt",
        )
    return model or "brown_conrady"


def _brown_conrady(keys: Keys, key: str, coefficients: Sequence[float]) -> tuple[float, ...]:
    """Return OpenCV's eight coefficients. Missing ones are 0."""
    if len(coefficients) not in (4, 5, 8, 12, 14):
        raise keys.error(key, f"has {len(coefficients)} numbers; must have 4, 5, 8, 12 or 14")
    if any(coefficients[BROWN_CONRADY:]):
        raise keys.error(
            key, "has a thin prism or a tilted sensor, which no lens here has; calibrate without it"
        )
    missing = [0.0] * (BROWN_CONRADY - len(coefficients))
    return (*coefficients[:BROWN_CONRADY], *missing)


def read_yaml(path: Path) -> Any:
    """Read a YAML file, which OpenCV may have written in a dialect of its own."""
    # PyYAML is no package of those who only read datasets.
    from lightfield.settings.yaml_files import parse_yaml

    text = read_text(path)
    first, _, rest = text.partition("\n")
    # YAML has no directive "%YAML:1.0". The tag says what a matrix's other keys say.
    text = f"\n{rest}" if first.startswith("%YAML:") else text
    return parse_yaml(text.replace("!!opencv-matrix", ""), str(path))


def read_xml(path: Path) -> Any:
    """Read an XML file of OpenCV's FileStorage."""
    try:
        root = ElementTree.fromstring(read_bytes(path))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise UserError(f"{path}: is not XML: {error}") from None
    except OSError as error:
        raise read_error(path, error) from None
    return _xml_value(root)


def _xml_value(element: ElementTree.Element) -> Any:
    """Return an element's children by name, or its numbers, or its text."""
    if len(element):
        return {child.tag: _xml_value(child) for child in element}
    text = (element.text or "").strip()
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return text
    return numbers[0] if len(numbers) == 1 else numbers
