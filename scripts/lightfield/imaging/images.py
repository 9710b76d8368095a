"""Reads and writes images. Files are always complete, and equal pixels give equal bytes.

The OpenEXR package handles EXR files of one part in scan lines. It has newer codecs, reads twice as
fast as OpenImageIO, and writes in two thirds of the time. OpenImageIO handles all other images. It
takes 33 MB of memory. Both are imported only for a file that needs them: scene YAMLs are checked
with exporters, which import this module.
"""

import ctypes
import re
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, check_readable, open_file
from lightfield.imaging.alpha import divisor
from lightfield.imaging.primaries import Chromaticities, to_rec_709
from lightfield.settings.types import Compression

Attribute = str | int | float

# Attributes in a view's EXR header.
# The meaning of channel Z.
DEPTH_ATTRIBUTE = "plenoforge:depth"
# The key of the settings that made the pixels.
KEY_ATTRIBUTE = "plenoforge:key"
# The version of bpy that rendered them.
BPY_ATTRIBUTE = "plenoforge:bpy"
# The machine that rendered them.
MACHINE_ATTRIBUTE = "plenoforge:machine"
# How many values were clamped to the half range.
CLAMPED_ATTRIBUTE = "plenoforge:clamped"
# How many values were not a number.
NAN_ATTRIBUTE = "plenoforge:nan"
# In how many pixels the first surface is a shadow catcher that the picture does not show, or may be
# a holdout. Only transparent views of scenes with shadow catchers, and views of scenes with
# holdouts, have it.
UNSHOWN_ATTRIBUTE = "plenoforge:unshown"

# A surface that covers a smaller part of a pixel counts as absent.
LEAST_ALPHA = 1e-3

HALF_MAX = 65504.0

# The largest width or height of a picture, in pixels.
_LARGEST_SIDE = 65536

# OpenEXR's codecs that keep every bit of halves and floats.
CODECS: dict[Compression, str] = {
    "zip": "ZIP_COMPRESSION",
    "zips": "ZIPS_COMPRESSION",
    "piz": "PIZ_COMPRESSION",
    "htj2k": "HTJ2K256_COMPRESSION",
    "zstd": "ZSTD_COMPRESSION",
}

_CHROMATICITIES = "chromaticities"
# The number with which an EXR begins.
_EXR_MAGIC = 20000630
# The bits of an EXR's version that mark tiles, deep pixels and several parts.
_EXR_OTHER_KINDS = 0x1A00
_EXR_TYPES = {"HALF": np.float16, "FLOAT": np.float32, "UINT": np.uint32}


@dataclass(frozen=True)
class Image:
    """An image in memory.

    - ``channels``: arrays (height, width) of the file's dtype, by the names of the channels.
    - ``attributes``: the values in the file's header by their names.
    - ``chromaticities``: x and y of R, G, B and white, from an EXR's header. None for a file
      without them.
    """

    channels: dict[str, np.ndarray[Any, Any]]
    attributes: dict[str, Attribute]
    chromaticities: Chromaticities | None = None

    @property
    def colour(self) -> np.ndarray[Any, Any]:
        """The channels R, G and B as (height, width, 3) float32, in Rec. 709."""
        planes = [self.channels[name] for name in "RGB"]
        colour = np.stack(planes, axis=-1, dtype=np.float32)
        return to_rec_709(colour, self.chromaticities)

    @property
    def covered(self) -> np.ndarray[Any, Any]:
        """Channel A as (height, width, 1) float32, by which an EXR's colour can be divided."""
        return divisor(self.channels["A"][..., np.newaxis].astype(np.float32))

    @property
    def straight(self) -> np.ndarray[Any, Any]:
        """An EXR's `colour` (height, width, 3) float32, divided by `covered`."""
        return np.asarray(self.colour / self.covered)

    @property
    def alpha(self) -> np.ndarray[Any, Any]:
        """Channel A as (height, width) float64, 0 to 1."""
        alpha = self.channels["A"]
        largest = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
        return np.asarray(alpha.astype(np.float64) / largest)

    @property
    def encoded(self) -> np.ndarray[Any, Any]:
        """R, G and B of a picture of whole numbers as (height, width, 3) float64, 0 to 1."""
        pixels = np.stack([self.channels[name] for name in "RGB"], axis=-1)
        return np.asarray(pixels / np.iinfo(pixels.dtype).max)

    @property
    def srgb(self) -> np.ndarray[Any, Any]:
        """R, G and B of an 8-bit or 16-bit picture as (height, width, 3) uint8."""
        return np.asarray(np.rint(self.encoded * 255), np.uint8)


@dataclass(frozen=True)
class Window:
    """The size of a picture in pixels, and which of its pixels a file stores.

    They differ only in an EXR whose data window is not its display window. ``left`` and ``top`` are
    the place of the first stored pixel in the picture, which may be outside.
    """

    width: int
    height: int
    left: int
    top: int
    stored_width: int
    stored_height: int

    @property
    def is_stored_whole(self) -> bool:
        """Whether the file stores exactly the pixels of the picture."""
        return self == Window(self.width, self.height, 0, 0, self.width, self.height)

    def stored_rows(self, rows: tuple[int, int] | None) -> tuple[int, int]:
        """Return which stored rows (first, end) the ``rows`` of the picture contain. None: all."""
        first, end = rows or (0, self.height)
        return (
            min(max(first - self.top, 0), self.stored_height),
            min(max(end - self.top, 0), self.stored_height),
        )

    def placed(
        self, name: str, stored: np.ndarray[Any, Any], rows: tuple[int, int] | None
    ) -> np.ndarray[Any, Any]:
        """Return ``rows`` of the picture's channel ``name``, from its `stored_rows`.

        What the file does not store is 0, as viewers show it. In Z, it is inf, a miss.
        """
        if self.is_stored_whole:
            return stored
        first, end = rows or (0, self.height)
        missing = np.inf if name == "Z" and stored.dtype.kind == "f" else 0
        plane = np.full((end - first, self.width), missing, stored.dtype)
        top = max(self.top - first, 0)
        left = max(self.left, 0)
        part = stored[:, max(-self.left, 0) :][:, : max(self.width - left, 0)]
        plane[top : top + part.shape[0], left : left + part.shape[1]] = part
        return plane


@dataclass(frozen=True)
class Header:
    """The header of a file's first subimage."""

    window: Window
    channels: list[str]
    attributes: dict[str, Attribute]
    chromaticities: Chromaticities | None = None

    @property
    def width(self) -> int:
        """The width of the picture in pixels."""
        return self.window.width

    @property
    def height(self) -> int:
        """The height of the picture in pixels."""
        return self.window.height


# The quality of a JPEG, of 100. Most values are off by one level at most.
_JPEG_QUALITY = 98
# As a texture, a square of this side takes 4 GB or more.
_LARGEST_TEXTURE = 32768
# Warnings of libjpeg about complete pictures.
_HARMLESS_WARNINGS = re.compile("unknown JFIF revision|Unknown Adobe color|extraneous bytes")


def is_readable(path: Path | str) -> bool:
    """Return whether a picture of any format can be read to its end.

    Raises `UserError` for one that would take many gigabytes. A small file may hold such a picture.
    If a JPEG or TIFF ends too soon, its decoder fills the rest with grey or black, and warns.
    """
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    if not file:
        # Fetch the error, or OpenImageIO prints it when the process ends.
        oiio.geterror()
        return False
    spec = file.spec()
    if spec.width * spec.height > _LARGEST_TEXTURE**2:
        file.close()
        raise UserError(
            f"{path}: has {spec.width} × {spec.height} pixels, and a texture may have as many as "
            f"{_LARGEST_TEXTURE} × {_LARGEST_TEXTURE}; make it smaller"
        )
    pixels = file.read_image(oiio.UNKNOWN)
    warnings = file.geterror().splitlines()
    file.close()
    return pixels is not None and all(_HARMLESS_WARNINGS.search(line) for line in warnings)


def is_transparent(path: Path | str) -> bool:
    """Return whether a picture of any format has an alpha below 1. False for no picture."""
    import OpenImageIO as oiio

    file = oiio.ImageInput.open(str(path))
    if not file:
        oiio.geterror()
        return False
    channel = file.spec().alpha_channel
    alphas = None if channel < 0 else file.read_image(0, 0, channel, channel + 1, oiio.FLOAT)
    file.geterror()
    file.close()
    return alphas is not None and bool((alphas < 1).any())


def read_header(path: Path | str) -> Header:
    """Read only the header. Raises `UserError` for a file that is not an image."""
    if header := _plain_exr_header(path):
        return header
    file = _open(path)
    spec = file.spec()
    window = _window(path, file)
    file.close()
    names = _channel_names(path, spec)
    return Header(window, names, _attributes(spec), _chromaticities(spec))


def read_image(
    path: Path | str,
    channels: Sequence[str] | None = None,
    rows: tuple[int, int] | None = None,
) -> Image:
    """Read every subimage's channels by name, or only the ``channels`` named, or only some rows.

    ``rows`` are the first row and the row after the last. The channels of a multi-part EXR keep
    their own names. An alpha channel stays unassociated in files that store it so. The arrays may
    be read-only. Raises `UserError` for a file that is missing, no image, cut short, or without one
    of the ``channels``.
    """
    header = _plain_exr_header(path)
    if header:
        image, names = _read_plain_exr(header, path, channels, rows)
    else:
        image, names = _read_other(path, channels, rows)
    missing_channels = [name for name in channels or () if name not in image.channels]
    if missing_channels:
        raise UserError(f"{path}: has no channel {missing_channels[0]}; it has {', '.join(names)}")
    return image


def may_hide(path: Path) -> np.ndarray[Any, Any]:
    """Return where (height, width) a view shows nothing, and may hide what other views see.

    Shadow catchers and holdouts hide what is behind them, although the picture does not show them.
    In a view without alpha, what has no depth may be a holdout.
    """
    header = read_header(path)
    if not header.attributes.get(UNSHOWN_ATTRIBUTE):
        return np.zeros((header.height, header.width), bool)
    channels = read_image(path).channels
    hides = channels["A"] < LEAST_ALPHA if "A" in channels else np.isposinf(channels["Z"])
    return np.asarray(hides)


def attribute(path: Path, name: str) -> Attribute | None:
    """Return an attribute of a file's header. None if the file lacks it, or is not an image."""
    try:
        return read_header(path).attributes.get(name)
    except UserError:
        return None


def is_finished(path: Path, key: str) -> bool:
    """Return whether a file exists, is complete, and was made with the settings of ``key``."""
    try:
        return path.exists() and read_image(path).attributes.get(KEY_ATTRIBUTE) == key
    except UserError:
        return False


def check_codec(key: str, compression: Compression) -> None:
    """Raise `UserError`, which names the ``key``, if this version of OpenEXR lacks a codec."""
    import OpenEXR

    if not hasattr(OpenEXR, CODECS[compression]):
        writable = ", ".join(name for name, codec in CODECS.items() if hasattr(OpenEXR, codec))
        raise UserError(
            f"{key}: is {compression!r}, which OpenEXR {OpenEXR.__version__} cannot write; "
            f"must be one of {writable}"
        )


def write_exr(
    path: Path | str,
    channels: Mapping[str, np.ndarray[Any, Any]],
    attributes: Mapping[str, Attribute] | None = None,
    compression: Compression = "zip",
    chromaticities: Chromaticities | None = None,
    level: int = 4,
) -> None:
    """Write (height, width) arrays as one EXR part: float16 as half, float32 as float.

    ``chromaticities`` name the colour space. Without them, readers take it for Rec. 709. ``level``
    is the effort of zip and zips, 1 to 9. All threads of a process must use the same.

    Lossless (one of `CODECS`), atomic, and without time stamp or host name, so that equal input
    gives equal bytes. Raises `UserError` if the file cannot be written.
    """
    import OpenEXR

    # The package cannot set a file's own level.
    ctypes.CDLL(OpenEXR.__file__).exr_set_default_zip_compression_level(level)
    header = {"compression": getattr(OpenEXR, CODECS[compression]), "type": OpenEXR.scanlineimage}
    if chromaticities:
        header[_CHROMATICITIES] = chromaticities
    # OpenEXR writes strided arrays as if they were contiguous.
    planes = {name: np.ascontiguousarray(array) for name, array in channels.items()}
    with atomic_path(path) as temporary:
        try:
            OpenEXR.File(header | dict(attributes or {}), planes).write(str(temporary))
        except RuntimeError as error:
            raise OSError(error) from None
        _check_exr(temporary)


def write_png(
    path: Path | str,
    pixels: np.ndarray[Any, Any],
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write uint8 or uint16 pixels, (height, width) or (height, width, 1 to 4), atomically.

    The values are written as they are: alpha is unassociated and colour already encoded.
    """
    import OpenImageIO as oiio

    pixels = pixels if pixels.ndim == 3 else pixels[:, :, np.newaxis]
    names = {1: ("Y",), 2: ("Y", "A"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, pixels.dtype.name)
    spec.channelnames = names[count]
    spec.attribute("oiio:UnassociatedAlpha", 1)
    for name, value in (attributes or {}).items():
        spec.attribute(name, value)
    with atomic_path(path) as temporary:
        file = oiio.ImageOutput.create(str(temporary))
        if not (file.open(str(temporary), spec) and file.write_image(pixels) and file.close()):
            raise OSError(file.geterror())
        _check_png(temporary)


def write_jpeg(path: Path | str, pixels: np.ndarray[Any, Any]) -> None:
    """Write sRGB pixels, (height, width, 3) uint8, atomically. Chroma has the full resolution."""
    import OpenImageIO as oiio

    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, "uint8")
    spec.attribute("Compression", f"jpeg:{_JPEG_QUALITY}")
    spec.attribute("jpeg:subsampling", "4:4:4")
    with atomic_path(path) as temporary:
        file = oiio.ImageOutput.create(str(temporary))
        if not (file.open(str(temporary), spec) and file.write_image(pixels) and file.close()):
            raise OSError(file.geterror())


def _check_exr(path: Path) -> None:
    """Raise an OSError for an EXR in scan lines that is cut short.

    OpenEXR reports no error when it writes the last pixels and the table of chunks.
    """
    import OpenEXR

    try:
        file = OpenEXR.InputFile(str(path))
        is_complete = file.isComplete()
        if is_complete:
            header = file.header()
            last = header["dataWindow"].max.y
            file.channels(list(header["channels"]), scanLine1=last, scanLine2=last)
    except OSError:
        is_complete = False
    if not is_complete:
        raise OSError("the file is cut short")


def _check_png(path: Path) -> None:
    """Raise an OSError for a PNG with missing chunks, or chunks that differ from their checksums.

    OpenImageIO reports no error when it writes the end: files may be empty or cut short.
    """
    content = memoryview(path.read_bytes())
    place = 8
    kind = b""
    try:
        while kind != b"IEND":
            length, kind = struct.unpack_from(">I4s", content, place)
            (checksum,) = struct.unpack_from(">I", content, place + 8 + length)
            if zlib.crc32(content[place + 4 : place + 8 + length]) != checksum:
                raise OSError("the file is damaged: a chunk differs from its checksum")
            place += 12 + length
    except struct.error:
        raise OSError("the file is cut short") from None


def _open(path: Path | str) -> Any:
    import OpenImageIO as oiio

    if not Path(path).is_file():
        raise UserError(f"{path}: no such file")
    check_readable(path)
    configuration = oiio.ImageSpec()
    configuration.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(str(path), configuration)
    if file is None:
        raise UserError(f"{path}: is not an image that can be read: {oiio.geterror()}")
    return file


def _plain_exr_header(path: Path | str) -> Header | None:
    """Return the header of an EXR of one part, without tiles or deep pixels. None for other files.

    Also None for a header with text that is not UTF-8: OpenEXR's InputFile may crash on it.
    """
    import OpenEXR

    try:
        with open_file(path) as file:
            magic, version = struct.unpack("<II", file.read(8))
        if magic != _EXR_MAGIC or version & _EXR_OTHER_KINDS:
            return None
        header = OpenEXR.File(str(path), header_only=True).header()
        names = [channel.name for channel in header["channels"]]
    except (OSError, struct.error, UnicodeDecodeError):
        return None
    except (RuntimeError, ValueError) as error:
        raise UserError(f"{path}: is not an image that can be read: {error}") from None
    data, display = (_box(header[key]) for key in ("dataWindow", "displayWindow"))
    attributes = {k: v for k, v in header.items() if isinstance(v, str | int | float)}
    chromaticities = header.get(_CHROMATICITIES)
    window = _placed_window(path, data, display)
    return Header(window, _colour_first(names), attributes, chromaticities)


def _box(corners: Sequence[np.ndarray[Any, Any]]) -> tuple[int, int, int, int]:
    """Return x, y, width and height of a box of an EXR's header."""
    (left, top), (right, bottom) = (corner.tolist() for corner in corners)
    return left, top, right - left + 1, bottom - top + 1


def _placed_window(path: Path | str, data: Sequence[int], display: Sequence[int]) -> Window:
    """Return the window of a file with boxes (x, y, width, height) of ``data`` and ``display``.

    Raises `UserError` for a display window that is too large to fill.
    """
    x, y, width, height = display
    window = Window(width, height, data[0] - x, data[1] - y, *data[2:])
    if not window.is_stored_whole and max(width, height) > _LARGEST_SIDE:
        raise UserError(
            f"{path}: displayWindow: is {width} × {height}; must have at most {_LARGEST_SIDE} "
            "pixels a side"
        )
    return window


def _colour_first(names: Iterable[str]) -> list[str]:
    """Return an EXR's channels in the order R, G, B, A and others. The file sorts them by name."""
    return sorted(names, key=lambda name: ("RGBA".find(name) % 5, name))


def _read_plain_exr(
    header: Header,
    path: Path | str,
    channels: Sequence[str] | None,
    rows: tuple[int, int] | None,
) -> tuple[Image, list[str]]:
    """Return an EXR's image with the ``channels`` or all, and the names of all its channels."""
    import OpenEXR

    names = [name for name in header.channels if channels is None or name in channels]
    window = header.window
    first, end = window.stored_rows(rows)
    try:
        # OpenEXR.File, which will replace InputFile, can only read all rows.
        file = OpenEXR.InputFile(str(path))
        raw_header = file.header()
        top = raw_header["dataWindow"].min.y
        planes: Sequence[bytes] = [b""] * len(names)
        if first < end:
            planes = file.channels(names, scanLine1=top + first, scanLine2=top + end - 1)
    except OSError as error:
        raise UserError(f"{path}: cannot be read whole: {error}") from None
    plane_by_name = {}
    for name, plane in zip(names, planes, strict=True):
        dtype = np.dtype(_EXR_TYPES[str(raw_header["channels"][name].type)])
        stored = np.frombuffer(plane, dtype).reshape(end - first, window.stored_width)
        plane_by_name[name] = window.placed(name, stored, rows)
    image = Image(plane_by_name, header.attributes, header.chromaticities)
    return image, header.channels


def _read_other(
    path: Path | str, channels: Sequence[str] | None, rows: tuple[int, int] | None
) -> tuple[Image, list[str]]:
    """Return any image with the ``channels`` or all, and the names of all its channels."""
    file = _open(path)
    plane_by_name: dict[str, np.ndarray[Any, Any]] = {}
    attributes: dict[str, Attribute] = {}
    names: list[str] = []
    chromaticities = _chromaticities(file.spec())
    subimage = 0
    while file.seek_subimage(subimage, 0):
        spec = file.spec()
        attributes = _attributes(spec) | attributes
        channel_names = _channel_names(path, spec)
        window = _window(path, file)
        stored_rows = slice(*window.stored_rows(rows))
        indices = [
            index
            for index, name in enumerate(channel_names)
            if channels is None or name in channels
        ]
        for first, end, kind in _runs(spec, indices):
            pixels = file.read_image(subimage, 0, first, end, kind)
            if pixels is None:
                raise UserError(f"{path}: cannot be read whole: {file.geterror()}")
            pixels = np.asarray(pixels).reshape(spec.height, spec.width, end - first)
            planes = np.moveaxis(pixels[stored_rows], -1, 0)
            for name, plane in zip(channel_names[first:end], planes, strict=True):
                plane_by_name[name] = window.placed(name, plane, rows)
        names += channel_names
        subimage += 1
    file.close()
    return Image(plane_by_name, attributes, chromaticities), names


def _window(path: Path | str, file: Any) -> Window:
    """Return the window of an open file's current subimage."""
    spec = file.spec()
    data = (spec.x, spec.y, spec.width, spec.height)
    display = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    return _placed_window(path, data, display if file.format_name() == "openexr" else data)


def _channel_names(path: Path | str, spec: Any) -> list[str]:
    try:
        return list(spec.channelnames)
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: is not an image that can be read: {error}") from None


def _runs(spec: Any, indices: Sequence[int]) -> list[tuple[int, int, str]]:
    """Group channel indices into runs (first, end, type) that one call can read."""
    runs: list[tuple[int, int, str]] = []
    for index in indices:
        kind = str(spec.channelformat(index))
        if runs and runs[-1][1] == index and runs[-1][2] == kind:
            runs[-1] = (runs[-1][0], index + 1, kind)
        else:
            runs.append((index, index + 1, kind))
    return runs


def _chromaticities(spec: Any) -> Chromaticities | None:
    """Return the chromaticities of an EXR's header. None for a file without them."""
    value = spec.getattribute(_CHROMATICITIES)
    return tuple(map(float, value)) if isinstance(value, tuple) else None


def _attributes(spec: Any) -> dict[str, Attribute]:
    attributes: dict[str, Attribute] = {}
    for parameter in spec.extra_attribs:
        try:
            name = parameter.name
            value = parameter.value
        except UnicodeDecodeError:
            continue  # It is damaged. Plenoforge's own attributes are ASCII.
        if isinstance(value, str | int | float):
            attributes[name] = value
    return attributes
