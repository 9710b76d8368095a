"""Images in and out, through OpenImageIO: always whole, and equal pixels give equal bytes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from lightfield.errors import UserError
from lightfield.files import atomic_path

Attribute = str | int | float

# In a view's EXR header: what channel Z means, the key of the settings that made the pixels, and
# how many values had to be clamped to the half range or were not a number.
DEPTH_ATTRIBUTE = "plenoforge:depth"
KEY_ATTRIBUTE = "plenoforge:key"
CLAMPED_ATTRIBUTE = "plenoforge:clamped"
NAN_ATTRIBUTE = "plenoforge:nan"

HALF_MAX = 65504.0

_TYPES = {
    np.dtype(np.float16): "half",
    np.dtype(np.float32): "float",
    np.dtype(np.uint8): "uint8",
    np.dtype(np.uint16): "uint16",
}


@dataclass(frozen=True)
class Image:
    """An image in memory: ``channels`` maps names to (height, width) arrays of the file's dtype."""

    channels: dict[str, np.ndarray[Any, Any]]
    attributes: dict[str, Attribute]


def read_attributes(path: Path | str) -> dict[str, Attribute]:
    """Read the header's attributes alone; raises `UserError` for a file that is no image."""
    file = _open(path)
    attributes = _attributes(file.spec())
    file.close()
    return attributes


def read_image(path: Path | str, channels: Sequence[str] | None = None) -> Image:
    """Read an image whole: every subimage's channels by name, or only the ``channels`` named.

    A multi-part EXR's channels come together under their own names. An alpha channel stays
    unassociated in files that store it so. Raises `UserError` for a file that is missing, no
    image, cut short, or without one of the ``channels``.
    """
    file = _open(path)
    found: dict[str, np.ndarray[Any, Any]] = {}
    attributes: dict[str, Attribute] = {}
    subimage = 0
    while file.seek_subimage(subimage, 0):
        spec = file.spec()
        attributes = _attributes(spec) | attributes
        wanted = [
            index
            for index, name in enumerate(spec.channelnames)
            if channels is None or name in channels
        ]
        for first, last, kind in _runs(spec, wanted):
            pixels = file.read_image(subimage, 0, first, last, kind)
            if pixels is None:
                raise UserError(f"{path}: cannot be read whole: {file.geterror()}")
            pixels = np.asarray(pixels).reshape(spec.height, spec.width, last - first)
            for index in range(first, last):
                found[spec.channelnames[index]] = pixels[:, :, index - first]
        subimage += 1
    file.close()
    missing = [name for name in channels or () if name not in found]
    if missing:
        raise UserError(f"{path}: has no channel {missing[0]}; it has {', '.join(found)}")
    return Image(found, attributes)


def is_finished(path: Path, key: str) -> bool:
    """Tell whether a file is there, whole, and made by the settings that ``key`` stands for."""
    try:
        return path.exists() and read_image(path).attributes.get(KEY_ATTRIBUTE) == key
    except UserError:
        return False


def write_exr(
    path: Path | str,
    channels: Mapping[str, np.ndarray[Any, Any]],
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write (height, width) arrays as one EXR part: float16 as half, float32 as float.

    Lossless (ZIP), atomic, and without time stamp or host name, so that equal input gives equal
    bytes. Raises `UserError` if the file cannot be written.
    """
    kinds = [_TYPES[array.dtype] for array in channels.values()]
    pixels = np.stack(
        list(channels.values()), axis=-1, dtype=np.float32 if len(set(kinds)) > 1 else None
    )
    spec = _spec(pixels, list(channels), attributes)
    spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in kinds)
    spec.attribute("compression", "zip")
    # Left unset, OpenImageIO would write the time of day.
    spec.attribute("DateTime", "")
    _write(path, spec, pixels)


def write_png(
    path: Path | str,
    pixels: np.ndarray[Any, Any],
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write uint8 or uint16 pixels, (height, width) or (height, width, 1 to 4), atomically.

    The values are written as they are: alpha is unassociated and colour already encoded.
    """
    pixels = pixels if pixels.ndim == 3 else pixels[:, :, np.newaxis]
    names = {1: ["Y"], 2: ["Y", "A"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}
    spec = _spec(pixels, names[pixels.shape[2]], attributes)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    _write(path, spec, pixels)


def _open(path: Path | str) -> Any:
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file")
    configuration = oiio.ImageSpec()
    configuration.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), configuration)
    if file is None:
        raise UserError(f"{path}: is no image that can be read: {oiio.geterror()}")
    return file


def _runs(spec: Any, wanted: Sequence[int]) -> list[tuple[int, int, str]]:
    """Group channel indices into runs (first, end, type) that one call can read."""
    runs: list[tuple[int, int, str]] = []
    for index in wanted:
        kind = str(spec.channelformat(index))
        if runs and runs[-1][1] == index and runs[-1][2] == kind:
            runs[-1] = (runs[-1][0], index + 1, kind)
        else:
            runs.append((index, index + 1, kind))
    return runs


def _attributes(spec: Any) -> dict[str, Attribute]:
    return {
        parameter.name: parameter.value
        for parameter in spec.extra_attribs
        if isinstance(parameter.value, str | int | float)
    }


def _spec(
    pixels: np.ndarray[Any, Any], names: list[str], attributes: Mapping[str, Attribute] | None
) -> Any:
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, _TYPES[pixels.dtype])
    spec.channelnames = tuple(names)
    for name, value in (attributes or {}).items():
        spec.attribute(name, value)
    return spec


def _write(path: Path | str, spec: Any, pixels: np.ndarray[Any, Any]) -> None:
    with atomic_path(path) as temporary:
        file = oiio.ImageOutput.create(str(temporary))
        if file is None:
            raise UserError(f"{path}: no such image format: {oiio.geterror()}")
        if not (file.open(str(temporary), spec) and file.write_image(pixels) and file.close()):
            raise UserError(f"{path}: cannot be written: {file.geterror()}")
