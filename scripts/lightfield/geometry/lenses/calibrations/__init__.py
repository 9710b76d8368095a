"""Reads a camera's calibration from the file of the tool that made it.

Each tool has a file of its own here.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_error, read_json
from lightfield.engine import receipts
from lightfield.geometry.lenses.base import LENSES, SENSOR_WIDTH, Lens
from lightfield.geometry.lenses.calibrations import colmap, kalibr, opencv, transforms
from lightfield.geometry.lenses.calibrations.base import (
    FORMATS,
    Calibration,
    Hints,
    Model,
    Reader,
    Size,
)

__all__ = ["Model", "read"]

# In bytes. OpenCV's files may list all corners of all boards.
_LARGEST_FILE = 2**24


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
        calibration = cameras[name](Hints(model, resolution))
        if model not in (None, calibration.lens):
            raise UserError(
                f"describes the lens {calibration.lens}; leave out the key model, which says "
                f"{model}"
            )
        return _lens(calibration, fov)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _cameras(path: Path) -> Mapping[str, Reader]:
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
            return colmap.of_text(path)
        case ".bin":
            return colmap.of_binary(path)
        case ".json":
            content = read_json(path)
        case ".xml":
            content = opencv.read_xml(path)
        case ".yaml" | ".yml":
            content = opencv.read_yaml(path)
        case suffix:
            raise UserError(
                f"{path}: ends in {suffix!r}; must end in .yaml, .yml, .xml, .json, .txt or .bin"
            )
    return _cameras_of_mapping(path, content)


def _cameras_of_mapping(path: Path, content: Any) -> Mapping[str, Reader]:
    if not isinstance(content, Mapping):
        raise UserError(f"{path}: holds no keys; {FORMATS}")
    for cameras_of in (opencv.cameras, kalibr.cameras, transforms.cameras):
        if cameras := cameras_of(content):
            return cameras
    raise UserError(f"{path}: holds no calibration; {FORMATS}")


def _chosen(path: Path, cameras: Mapping[str, Reader], camera: str | int | None) -> str:
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


def _lens(camera: Calibration, fov: float | None) -> Lens:
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
