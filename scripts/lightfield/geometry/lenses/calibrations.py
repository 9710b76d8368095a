"""Reads a camera's calibration from the file of the tool that made it.

OpenCV, Kalibr, ROS and EuRoC place the centre of the first pixel at (0, 0). COLMAP, nerfstudio and
the lenses here place it at (0.5, 0.5). Sources: OpenCV's camera_calibration.cpp and
stereo_calib.cpp; ROS's camera_info_manager; Kalibr's wiki and kalibr_common/ConfigReader.py;
EuRoC's sensor.yaml; COLMAP's models.h and format.rst; nerfstudio's nerfstudio_dataparser.py and
camera_utils.py; instant-ngp's nerf_loader.cu.
"""

import math
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, Literal, NamedTuple
from xml.etree import ElementTree

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_bytes, read_error, read_json, read_text, reading
from lightfield.engine import receipts
from lightfield.geometry.lenses.base import LENSES, SENSOR_WIDTH, Lens, Pair

Model = Literal["brown_conrady", "kannala_brandt"]
Size = tuple[int, int]

FORMATS = (
    "a calibration is OpenCV's or ROS's (camera_matrix), Kalibr's or EuRoC's (intrinsics), a "
    "transforms.json (fl_x), or COLMAP's cameras.txt or cameras.bin"
)
# In bytes. OpenCV's files may list all corners of all boards.
_LARGEST_FILE = 2**24
_LARGEST_NUMBER = 1e99
# From the centre of the first pixel to the image's corner.
_HALF = 0.5


class _Calibration(NamedTuple):
    """A camera as a file describes it, in pixels. ``center`` counts from the image's corner."""

    lens: str
    size: Size
    focal_lengths: Pair = (0.0, 0.0)
    center: Pair = (0.0, 0.0)
    coefficients: tuple[float, ...] = ()


class _Hints(NamedTuple):
    """What the user adds to a file that does not say it."""

    model: Model | None
    resolution: Size | None


# Returns a camera of a file. Each camera is read only if it is chosen.
_Reader = Callable[[_Hints], _Calibration]


def read(
    path: Path,
    camera: str | int | None = None,
    *,
    model: Model | None = None,
    resolution: Size | None = None,
    fov: float | None = None,
) -> Lens:
    """Return the lens that a calibration file describes.

    ``camera`` chooses one of several cameras by its name or number. ``model`` says which lens four
    coefficients of OpenCV belong to, and must not contradict the file. ``resolution`` in pixels is
    for a file without it. ``fov`` in radians ends the lens at half of this angle. The lens's sensor
    is 36 mm wide. Raises `UserError` that names the file and the key.
    """
    receipts.note_inputs([path])
    cameras = _cameras(path)
    name = _chosen(path, cameras, camera)
    try:
        calibration = cameras[name](_Hints(model, resolution))
        if model not in (None, calibration.lens):
            raise UserError(
                f"describes the lens {calibration.lens}; leave out the key model, which says "
                f"{model}"
            )
        return _lens(calibration, fov)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _cameras(path: Path) -> Mapping[str, _Reader]:
    """Return the cameras of a file by their names. The name of an only camera may be empty."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise read_error(path, error) from None
    if size > _LARGEST_FILE:
        raise UserError(
            f"{path}: has {units.size(size)}; must be at most {units.size(_LARGEST_FILE)}"
        )
    match path.suffix.lower():
        case ".txt":
            return _colmap_text(path)
        case ".bin":
            return _colmap_binary(path)
        case ".json":
            content = read_json(path)
        case ".xml":
            content = _read_xml(path)
        case ".yaml" | ".yml":
            content = _read_yaml(path)
        case suffix:
            raise UserError(
                f"{path}: ends in {suffix!r}; must end in .yaml, .yml, .xml, .json, .txt or .bin"
            )
    return _cameras_of_mapping(path, content)


def _cameras_of_mapping(path: Path, content: Any) -> Mapping[str, _Reader]:
    if not isinstance(content, Mapping):
        raise UserError(f"{path}: holds no keys; {FORMATS}")
    if cameras := _of_opencv(content):
        return cameras
    if "intrinsics" in content:
        return {"": partial(_kalibr, _Keys("", content))}
    camchain = {
        str(name): partial(_kalibr, _Keys(f"{name}.", entry))
        for name, entry in content.items()
        if isinstance(entry, Mapping) and "intrinsics" in entry
    }
    if camchain:
        return camchain
    if cameras := _of_transforms(content):
        return cameras
    raise UserError(f"{path}: holds no calibration; {FORMATS}")


def _chosen(path: Path, cameras: Mapping[str, _Reader], camera: str | int | None) -> str:
    """Return the name of the camera that the user asks for, or of the only one."""
    names = [*cameras]
    if camera is not None:
        if str(camera) in cameras:
            return str(camera)
        if names == [""]:
            raise UserError(f"{path}: holds one camera without a name; leave out the key camera")
        raise UserError(f"{path}: has no camera {str(camera)!r}; must be one of {_listed(names)}")
    if len(names) == 1:
        return names[0]
    raise UserError(
        f"{path}: holds {len(names)} cameras; choose one with the key camera: {_listed(names)}"
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join([*names[:10], "…"] if len(names) > 10 else names)


def _lens(camera: _Calibration, fov: float | None) -> Lens:
    """Return the lens of a calibration, on a sensor of Blender's width."""
    width, height = camera.size
    if camera.lens == "equirectangular":
        _refuse_fov(fov, "a panorama")
        return LENSES[camera.lens](width=width, height=height)
    fx, fy = camera.focal_lengths
    focal_length = fx * SENSOR_WIDTH / width
    keys: dict[str, Any] = {
        "width": width,
        "height": height,
        "focal_length": focal_length,
        "principal_point": camera.center,
    }
    if fx != fy:
        keys["sensor_size"] = (SENSOR_WIDTH, focal_length * height / fy)
    if camera.lens == "brown_conrady" and not any(camera.coefficients):
        pinhole: Any = LENSES["rectilinear"](**keys)
        # Cycles' perspective pixels are square.
        if pinhole.has_square_pixels:
            _refuse_fov(fov, "a lens without distortion")
            return pinhole  # type: ignore[no-any-return]
    keys["coefficients"] = camera.coefficients
    if fov is not None:
        keys["fov"] = fov
    return LENSES[camera.lens](**keys)


def _refuse_fov(fov: float | None, kind: str) -> None:
    if fov is not None:
        raise UserError(f"describes {kind}, which takes no fov; leave out the key fov")


class _Keys:
    """A mapping in a file. Errors name its keys after ``prefix``, but not the file."""

    def __init__(self, prefix: str, content: Any) -> None:
        self.prefix = prefix
        self.content: Mapping[str, Any] = content

    def error(self, key: str, problem: str) -> UserError:
        return UserError(f"{self.prefix}{key}: {problem}")

    def first(self, names: Iterable[str]) -> str | None:
        """Return the first of the ``names`` that the mapping has."""
        return next((name for name in names if name in self.content), None)

    def value(self, key: str) -> Any:
        if key not in self.content:
            raise self.error(key, "is missing")
        return self.content[key]

    def text(self, key: str, default: str) -> str:
        value = self.content.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; must be a text")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        value = default if default is not None and key not in self.content else self.value(key)
        (number,) = self._finite(key, [value])
        return number

    def numbers(self, key: str, *counts: int) -> tuple[float, ...]:
        """Return the numbers of a list, or of a matrix in row-major order.

        ``counts`` are the allowed numbers of numbers.
        """
        value = self.value(key)
        if isinstance(value, Mapping):
            return _Keys(f"{self.prefix}{key}.", value).numbers("data", *counts)
        numbers = self._finite(key, _flattened(value))
        if counts and len(numbers) not in counts:
            allowed = " or ".join(map(str, counts))
            raise self.error(key, f"has {len(numbers)} numbers; must have {allowed}")
        return numbers

    def _finite(self, key: str, values: Iterable[Any]) -> tuple[float, ...]:
        numbers = []
        for value in values:
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            # Compared without conversion: a whole number may be too large for a float.
            if not is_number or not -_LARGEST_NUMBER < value < _LARGEST_NUMBER:
                raise self.error(key, f"has {shortened(value)}; must be finite numbers")
            numbers.append(float(value))
        return tuple(numbers)

    def size(self, hints: _Hints, pairs: Sequence[str], sides: Sequence[tuple[str, str]]) -> Size:
        """Return the image's size, which a list or two keys give, or the user."""
        if key := self.first(pairs):
            width, height = self.numbers(key, 2)
        else:
            keys = next((keys for keys in sides if keys[0] in self.content), None)
            if keys is None:
                if hints.resolution:
                    return hints.resolution
                names = [*pairs, *(" and ".join(names) for names in sides)]
                raise UserError(
                    f"{self.prefix}{names[0]}: is missing; add the key resolution to the camera"
                )
            key, (width, height) = keys[0], (self.number(keys[0]), self.number(keys[1]))
        if any(side % 1 or not 1 <= side <= 2**16 for side in (width, height)):
            raise self.error(key, f"is {width:g} × {height:g}; must be whole numbers of pixels")
        size = int(width), int(height)
        if hints.resolution and hints.resolution != size:
            raise self.error(
                key,
                f"is {size[0]} × {size[1]}, but the given resolution is {hints.resolution[0]} × "
                f"{hints.resolution[1]}",
            )
        return size

    def focal_lengths(self, key: str, *numbers: float) -> Pair:
        if min(numbers) <= 0:
            raise self.error(key, f"has the focal length {min(numbers):g}; must be above 0")
        return numbers[0], numbers[-1]


def _flattened(value: Any) -> Iterable[Any]:
    """Return the values of a list, or of the rows of a matrix."""
    if not isinstance(value, list):
        return [value]
    rows = [part if isinstance(part, list) else [part] for part in value]
    return [number for row in rows for number in row]


# OpenCV and ROS


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
# OpenCV's order is k1, k2, p1, p2, k3 to k6, s1 to s4, τx and τy.
_BROWN_CONRADY = 8


def _of_opencv(content: Mapping[str, Any]) -> dict[str, _Reader]:
    """Return the cameras of a file of OpenCV's FileStorage."""
    keys = _Keys("", content)
    return {
        end: partial(_opencv, keys, matrix, [f"{name}{end}" for name in _COEFFICIENTS])
        for end in ("", "1", "2")
        if (matrix := keys.first(f"{name}{end}" for name in _MATRICES))
    }


def _opencv(keys: _Keys, matrix: str, distortions: Sequence[str], hints: _Hints) -> _Calibration:
    fx, skew, cx, zero, fy, cy, *last = keys.numbers(matrix, 9)
    if skew or zero or last != [0, 0, 1]:
        raise keys.error(matrix, "must be fx, 0, cx, 0, fy, cy, 0, 0, 1: no lens here has skew")
    distortion = keys.first(distortions)
    if distortion is None:
        raise keys.error(
            distortions[0], "is missing; write five zeros if the lens has no distortion"
        )
    coefficients = keys.numbers(distortion)
    lens = _opencv_model(keys, distortion, len(coefficients), hints)
    if lens == "kannala_brandt":
        coefficients = keys.numbers(distortion, 4)
    else:
        coefficients = _brown_conrady(keys, distortion, coefficients)
    size = keys.size(hints, _PAIRS, _SIDES)
    center = cx + _HALF, cy + _HALF
    return _Calibration(lens, size, keys.focal_lengths(matrix, fx, fy), center, coefficients)


def _opencv_model(keys: _Keys, distortion: str, count: int, hints: _Hints) -> Model:
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


def _brown_conrady(keys: _Keys, key: str, coefficients: Sequence[float]) -> tuple[float, ...]:
    """Return OpenCV's eight coefficients. Missing ones are 0."""
    if len(coefficients) not in (4, 5, 8, 12, 14):
        raise keys.error(key, f"has {len(coefficients)} numbers; must have 4, 5, 8, 12 or 14")
    if any(coefficients[_BROWN_CONRADY:]):
        raise keys.error(
            key, "has a thin prism or a tilted sensor, which no lens here has; calibrate without it"
        )
    missing = [0.0] * (_BROWN_CONRADY - len(coefficients))
    return (*coefficients[:_BROWN_CONRADY], *missing)


def _read_yaml(path: Path) -> Any:
    """Read a YAML file, which OpenCV may have written in a dialect of its own."""
    # PyYAML is no package of those who only read datasets.
    from lightfield.settings.yaml_files import parse_yaml

    text = read_text(path)
    first, _, rest = text.partition("\n")
    # YAML has no directive "%YAML:1.0". The tag says what a matrix's other keys say.
    text = f"\n{rest}" if first.startswith("%YAML:") else text
    return parse_yaml(text.replace("!!opencv-matrix", ""), str(path))


def _read_xml(path: Path) -> Any:
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


# Kalibr and EuRoC


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


def _kalibr(keys: _Keys, hints: _Hints) -> _Calibration:
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
        lens, coefficients = _kalibr_pinhole(keys, distortion)
    elif distortion != "none" and any(_kalibr_pinhole(keys, distortion)[1]):
        raise keys.error(
            "distortion_model",
            f"is {distortion!r}, but no lens here has the camera_model {model!r} with a "
            f"distortion; calibrate {model}-none, or pinhole-{distortion}",
        )
    fx, fy, cx, cy = numbers[-4:]
    size = keys.size(hints, ("resolution",), ())
    focal_lengths = keys.focal_lengths("intrinsics", fx, fy)
    return _Calibration(lens, size, focal_lengths, (cx + _HALF, cy + _HALF), coefficients)


def _kalibr_pinhole(keys: _Keys, distortion: str) -> tuple[str, tuple[float, ...]]:
    """Return the lens of a pinhole camera with a distortion, and its coefficients."""
    lens, count = _DISTORTIONS[distortion]
    key = keys.first(("distortion_coeffs", "distortion_coefficients")) or "distortion_coeffs"
    coefficients = keys.numbers(key, count) if count else ()
    if lens == "brown_conrady":
        return lens, (*coefficients, *[0.0] * (_BROWN_CONRADY - count))
    return lens, coefficients


# transforms.json


def _of_transforms(content: Mapping[str, Any]) -> dict[str, _Reader]:
    """Return the cameras of a transforms.json: one, or one for each of its frames."""
    if any(key in content for key in ("fl_x", "camera_angle_x")):
        return {"": partial(_transforms, _Keys("", content))}
    frames = content.get("frames")
    if not isinstance(frames, list):
        return {}
    return {
        str(frame.get("file_path", index)): partial(
            _transforms, _Keys(f"frames[{index}].", {**content, **frame})
        )
        for index, frame in enumerate(frames)
        if isinstance(frame, Mapping) and "fl_x" in frame
    }


def _transforms(keys: _Keys, hints: _Hints) -> _Calibration:
    size = keys.size(hints, (), (("w", "h"),))
    name = keys.text("camera_model", _usual_model(keys))
    if name == "EQUIRECTANGULAR":
        return _Calibration("equirectangular", size)
    focal_lengths = _transforms_focal_lengths(keys, size)
    center = keys.number("cx", size[0] / 2), keys.number("cy", size[1] / 2)
    if name == "FISHEYE624":
        coefficients = keys.numbers("distortion_params", 12)
        return _Calibration("fisheye624", size, focal_lengths, center, coefficients)
    k1, k2, k3, k4, p1, p2 = (keys.number(key, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if name in ("OPENCV_FISHEYE", "FISHEYE"):
        if p1 or p2:
            raise keys.error("p1", f"must be 0, as p2: {name} has k1 to k4 alone")
        return _Calibration("kannala_brandt", size, focal_lengths, center, (k1, k2, k3, k4))
    if name not in ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "RADIAL", "FULL_OPENCV"):
        raise keys.error("camera_model", f"is {name!r}, which is no lens of this program")
    if k4 or name == "FULL_OPENCV":
        # nerfstudio multiplies it by r⁸, and OpenCV has it in a denominator.
        raise keys.error("k4", "means different lenses in nerfstudio and in OpenCV; must be 0")
    coefficients = (k1, k2, p1, p2, k3, 0.0, 0.0, 0.0)
    return _Calibration("brown_conrady", size, focal_lengths, center, coefficients)


def _usual_model(keys: _Keys) -> str:
    """Return the camera model of a file that names none."""
    if key := keys.first(("ftheta_p0", "latlong", "equirectangular", "orthographic")):
        raise keys.error(key, "is a lens of instant-ngp that is not read here")
    return "OPENCV_FISHEYE" if keys.content.get("is_fisheye") is True else "OPENCV"


def _transforms_focal_lengths(keys: _Keys, size: Size) -> Pair:
    if "fl_x" in keys.content:
        fx = keys.number("fl_x")
        return keys.focal_lengths("fl_x", fx, keys.number("fl_y", fx))
    angle = keys.number("camera_angle_x")
    if not 0 < angle < math.pi:
        raise keys.error("camera_angle_x", f"is {angle:g}; must be an angle of 0 to π in radians")
    fx = size[0] / 2 / math.tan(angle / 2)
    return fx, fx


# COLMAP


class _ColmapModel(NamedTuple):
    """A camera model of COLMAP's.

    ``number`` is its number in binary files. ``focals`` are its focal lengths, and ``parameters``
    its parameters after the principal point. Fewer than the lens's are filled up with zeros.
    """

    number: int
    lens: str
    focals: int
    parameters: int
    coefficients: int


_COLMAP_MODELS = {
    "SIMPLE_PINHOLE": _ColmapModel(0, "brown_conrady", 1, 0, 8),
    "PINHOLE": _ColmapModel(1, "brown_conrady", 2, 0, 8),
    "SIMPLE_RADIAL": _ColmapModel(2, "brown_conrady", 1, 1, 8),
    "RADIAL": _ColmapModel(3, "brown_conrady", 1, 2, 8),
    "OPENCV": _ColmapModel(4, "brown_conrady", 2, 4, 8),
    "OPENCV_FISHEYE": _ColmapModel(5, "kannala_brandt", 2, 4, 4),
    "FULL_OPENCV": _ColmapModel(6, "brown_conrady", 2, 8, 8),
    "FOV": _ColmapModel(7, "fov_model", 2, 1, 1),
    "SIMPLE_RADIAL_FISHEYE": _ColmapModel(8, "kannala_brandt", 1, 1, 4),
    "RADIAL_FISHEYE": _ColmapModel(9, "kannala_brandt", 1, 2, 4),
    "THIN_PRISM_FISHEYE": _ColmapModel(10, "thin_prism_fisheye", 2, 8, 8),
    "RAD_TAN_THIN_PRISM_FISHEYE": _ColmapModel(11, "fisheye624", 2, 12, 12),
    "SIMPLE_DIVISION": _ColmapModel(12, "division", 1, 1, 1),
    "DIVISION": _ColmapModel(13, "division", 2, 1, 1),
    "SIMPLE_FISHEYE": _ColmapModel(14, "kannala_brandt", 1, 0, 4),
    "FISHEYE": _ColmapModel(15, "kannala_brandt", 2, 0, 4),
    "EUCM": _ColmapModel(16, "extended_unified", 2, 2, 2),
    # Its two parameters, the image's sides, count as focal lengths here.
    "EQUIRECTANGULAR": _ColmapModel(17, "equirectangular", 2, 0, 0),
}
_COLMAP_NUMBERS = {model.number: name for name, model in _COLMAP_MODELS.items()}


def _colmap_count(model: _ColmapModel) -> int:
    """Return how many parameters a camera of COLMAP's has."""
    center = 0 if model.lens == "equirectangular" else 2
    return model.focals + center + model.parameters


def _colmap_text(path: Path) -> dict[str, _Reader]:
    """Return the cameras of a cameras.txt by their numbers."""
    cameras: dict[str, _Reader] = {}
    for line in read_text(path).splitlines():
        words = line.split()
        if not words or line.startswith("#"):
            continue
        if len(words) < 5 or not words[0].isdecimal():
            raise UserError(
                f"{path}: {words[0]}: must be CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]; {FORMATS}"
            )
        number, name, *values = words
        cameras[number] = partial(_colmap, number, name, [_as_number(value) for value in values])
    if not cameras:
        raise UserError(f"{path}: holds no camera; {FORMATS}")
    return cameras


def _as_number(word: str) -> Any:
    """Return a word as a number, or the word itself."""
    try:
        return float(word)
    except ValueError:
        return word


def _colmap_binary(path: Path) -> dict[str, _Reader]:
    """Return the cameras of a cameras.bin by their numbers."""
    with reading(path, "cameras.bin"):
        content = read_bytes(path)
        (count,), start = struct.unpack_from("<Q", content), 8
        cameras: dict[str, _Reader] = {}
        for _ in range(count):
            number, model, *size = struct.unpack_from("<iiQQ", content, start)
            start += struct.calcsize("<iiQQ")
            name = _COLMAP_NUMBERS.get(model)
            if name is None:
                # The length of its parameters is unknown, so no camera after it can be read.
                raise ValueError(f"camera {number} has the model {model}")
            parameters = f"<{_colmap_count(_COLMAP_MODELS[name])}d"
            values = [*size, *struct.unpack_from(parameters, content, start)]
            start += struct.calcsize(parameters)
            cameras[str(number)] = partial(_colmap, str(number), name, values)
    if not cameras:
        raise UserError(f"{path}: holds no camera")
    return cameras


def _colmap(number: str, name: str, values: Sequence[Any], hints: _Hints) -> _Calibration:
    keys = _Keys(f"camera {number}: ", {"size": [*values[:2]], name: [*values[2:]]})
    if name not in _COLMAP_MODELS:
        raise keys.error("MODEL", f"is {name}; must be one of {', '.join(_COLMAP_MODELS)}")
    model = _COLMAP_MODELS[name]
    size = keys.size(hints, ("size",), ())
    numbers = keys.numbers(name, _colmap_count(model))
    if model.lens == "equirectangular":
        return _Calibration(model.lens, size)
    focal_lengths = keys.focal_lengths(name, *numbers[: model.focals])
    cx, cy, *parameters = numbers[model.focals :]
    missing = [0.0] * (model.coefficients - model.parameters)
    coefficients = (*parameters, *missing)
    return _Calibration(model.lens, size, focal_lengths, (cx, cy), coefficients)
