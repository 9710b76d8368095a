"""Images in and out, compared with OpenImageIO, Blender and the files' own bytes."""

import struct
import zlib
from pathlib import Path
from typing import get_args

import bpy
import exr_windows
import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from lightfield.core.errors import UserError
from lightfield.imaging.images import (
    CODECS,
    check_codec,
    is_readable,
    read_header,
    read_image,
    write_exr,
    write_png,
)
from lightfield.settings.types import Compression

ATTRIBUTES = {"plenoforge:depth": "z", "plenoforge:nan": 3, "plenoforge:scale": 0.5}


@pytest.fixture
def channels():
    rng = np.random.default_rng(0)
    halves = {name: rng.uniform(-2, 60000, (37, 53)).astype("f2") for name in "RGB"}
    # Values that a kernel must keep: infinities, NaN, denormals, and the largest half.
    halves["R"][0, :6] = [np.inf, -np.inf, np.nan, 6e-8, 65504, -0.0]
    depth = rng.uniform(0, 1e9, (37, 53)).astype("f4")
    depth[1, :3] = [np.inf, np.nan, 1e-42]
    return halves | {"Z": depth}


def same(pixels, expected):
    return pixels.dtype == expected.dtype and np.array_equal(
        pixels.view(np.uint8), expected.view(np.uint8)
    )


@pytest.mark.parametrize("suffix", ["jpg", "tif", "png", "exr", "hdr", "webp", "bmp", "tga"])
def test_a_picture_that_ends_too_soon_is_not_finished(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    pixels = np.random.default_rng(0).integers(0, 255, (64, 48, 3), dtype=np.uint8)
    assert oiio.ImageBuf(pixels).write(str(path))
    assert is_readable(path)
    content = path.read_bytes()
    for size in (0, len(content) // 2, len(content) * 9 // 10):
        path.write_bytes(content[:size])
        assert not is_readable(path)


def test_a_picture_that_would_fill_the_memory_is_refused_by_its_header(tmp_path):
    path = tmp_path / "a.png"
    oiio.ImageBuf(np.zeros((8, 8, 3), np.uint8)).write(str(path))
    content = bytearray(path.read_bytes())
    content[16:24] = struct.pack(">2I", 60000, 60000)
    content[29:33] = struct.pack(">I", zlib.crc32(content[12:29]))
    path.write_bytes(content)
    with pytest.raises(UserError, match=rf"^{path}: has 60000 × 60000 pixels"):
        is_readable(path)


def test_a_picture_with_only_a_decoders_warning_is_finished(tmp_path):
    path = tmp_path / "a.jpg"
    oiio.ImageBuf(np.zeros((8, 8, 3), np.uint8)).write(str(path))
    content = bytearray(path.read_bytes())
    content[content.index(b"JFIF\0") + 5] = 3
    path.write_bytes(content + b"what a camera adds")
    assert is_readable(path)


def test_written_channels_are_read_back(tmp_path, channels):
    write_exr(tmp_path / "a.exr", channels, ATTRIBUTES)
    image = read_image(tmp_path / "a.exr")
    assert image.channels.keys() == channels.keys()
    assert all(same(image.channels[name], channels[name]) for name in channels)
    assert image.attributes.items() >= ATTRIBUTES.items()
    header = read_header(tmp_path / "a.exr")
    assert (header.width, header.height) == (53, 37)
    assert set(header.channels) == set("RGBZ") and header.attributes == image.attributes


def test_arrays_of_any_layout_are_written_as_they_are(tmp_path, channels):
    turned = {name: np.asfortranarray(array) for name, array in channels.items()}
    stacked = np.dstack([channels[name] for name in "RGB"])
    sliced = {name: stacked[:, :, i] for i, name in enumerate("RGB")} | {"Z": channels["Z"]}
    files = []
    for index, layout in enumerate((channels, turned, sliced)):
        write_exr(tmp_path / f"{index}.exr", layout)
        files.append((tmp_path / f"{index}.exr").read_bytes())
    # Equal input also gives equal bytes: no time, host or path in the file.
    assert files[0] == files[1] == files[2]


def test_other_libraries_read_our_files(tmp_path, channels):
    path = tmp_path / "view.exr"
    write_exr(path, channels, ATTRIBUTES)
    theirs = oiio.ImageBuf(str(path))
    spec = theirs.spec()
    assert spec.channelnames == tuple("RGBZ")
    assert [str(spec.channelformat(i)) for i in range(4)] == ["half"] * 3 + ["float"]
    assert spec.get_string_attribute("compression") == "zip"
    assert spec.get_int_attribute("plenoforge:nan") == 3 and not spec.tile_width
    pixels = np.asarray(theirs.get_pixels(oiio.FLOAT))
    assert np.array_equal(pixels[:, :, 3], channels["Z"], equal_nan=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Linear Rec.709"
    assert tuple(image.size) == (53, 37)
    rows = np.array(image.pixels, np.float32).reshape(37, 53, -1)[::-1]
    assert np.array_equal(rows[2:, :, 1], channels["G"][2:].astype("f4"))


@pytest.mark.parametrize("codec", get_args(Compression))
def test_every_codec_keeps_every_bit(tmp_path, channels, codec):
    write_exr(tmp_path / "a.exr", channels, ATTRIBUTES, codec)
    image = read_image(tmp_path / "a.exr")
    assert list(image.channels) == list("RGBZ")
    assert all(same(image.channels[name], channels[name]) for name in channels)
    assert image.attributes.items() >= ATTRIBUTES.items()
    header = OpenEXR.File(str(tmp_path / "a.exr"), header_only=True).header()
    assert header["compression"] == getattr(OpenEXR, CODECS[codec])


def test_a_codec_that_openexr_does_not_have_is_refused(monkeypatch):
    monkeypatch.delattr(OpenEXR, CODECS["zstd"])
    check_codec("render.compression", "zip")
    message = r"^render.compression: is 'zstd', which OpenEXR .* zip, .*htj2k$"
    with pytest.raises(UserError, match=message):
        check_codec("render.compression", "zstd")


def test_some_rows_of_some_channels(tmp_path, channels):
    write_exr(tmp_path / "a.exr", channels)
    read_channels = read_image(tmp_path / "a.exr", ["Z", "G"], (17, 20)).channels
    assert read_channels.keys() == {"Z", "G"}
    assert all(same(read_channels[name], channels[name][17:20]) for name in read_channels)
    pixels = np.arange(37 * 53 * 3, dtype=np.uint8).reshape(37, 53, 3)
    write_png(tmp_path / "a.png", pixels)
    read_channels = read_image(tmp_path / "a.png", ["B"], (17, 20)).channels
    assert read_channels.keys() == {"B"} and np.array_equal(read_channels["B"], pixels[17:20, :, 2])


@pytest.mark.parametrize("storage", ["parts", "tiles"])
def test_exr_files_of_other_kinds(tmp_path, channels, storage):
    path = str(tmp_path / "a.exr")
    colors = {name: channels[name] for name in "RGB"}
    kind = {"type": OpenEXR.scanlineimage}
    match storage:
        case "parts":
            color = OpenEXR.Part(dict(kind), colors, name="color")
            depth = OpenEXR.Part(dict(kind), {"Z": channels["Z"]}, name="depth")
            OpenEXR.File([color, depth]).write(path)
        case "tiles":
            tiles = OpenEXR.TileDescription()
            tiles.xSize = tiles.ySize = 16
            OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, dict(channels)).write(path)
    read_channels = read_image(path).channels
    assert read_channels.keys() == channels.keys()
    assert all(
        same(np.ascontiguousarray(read_channels[name]), channels[name]) for name in read_channels
    )
    some_rows = read_image(path, ["Z"], (3, 9)).channels["Z"]
    assert np.array_equal(some_rows, channels["Z"][3:9], equal_nan=True)


# The first and the last pixel, across and down, of what a file stores. The file has 53 × 37 pixels.
DATA_WINDOWS = {
    "displaced": ((7, -5), (59, 31)),
    "overscan": ((-4, -3), (48, 33)),
    "beside": ((100, 100), (152, 136)),
}
DISPLAY_WINDOWS = {
    "as large": ((0, 0), (52, 36)),
    "smaller": ((0, 0), (39, 29)),
    "from a negative origin": ((-10, -8), (60, 40)),
    "larger": ((0, 0), (79, 49)),
}


@pytest.mark.parametrize("storage", ["lines", "tiles", "parts"])
@pytest.mark.parametrize("display", DISPLAY_WINDOWS)
@pytest.mark.parametrize("data", DATA_WINDOWS)
def test_what_an_exr_stores_is_placed_in_its_display_window(
    tmp_path, channels, data, display, storage
):
    """OpenImageIO pads pixels outside the data window with 0."""
    path = tmp_path / "a.exr"
    channels["A"] = np.ones((37, 53), np.float16)
    exr_windows.write(path, channels, DATA_WINDOWS[data], DISPLAY_WINDOWS[display], storage)
    (left, top), (right, bottom) = DISPLAY_WINDOWS[display]
    size = (right - left + 1, bottom - top + 1)
    header = read_header(path)
    assert (header.width, header.height) == size
    shown = {}
    for subimage in range(len(channels) if storage == "parts" else 1):
        pixels = oiio.ImageBuf(str(path), subimage, 0)
        planes = np.moveaxis(pixels.get_pixels(oiio.FLOAT, pixels.roi_full), -1, 0)
        shown |= dict(zip(pixels.spec().channelnames, planes, strict=True))
    shown["Z"][shown["A"] == 0] = np.inf
    read_channels = read_image(path).channels
    assert read_channels.keys() == shown.keys()
    for name, plane in read_channels.items():
        assert plane.dtype == channels[name].dtype
        assert np.array_equal(plane, shown[name].astype(plane.dtype), equal_nan=True), name
    for rows in ((0, 3), (3, 20), (size[1] - 2, size[1])):
        part = read_image(path, ["Z"], rows).channels["Z"]
        assert np.array_equal(part, read_channels["Z"][slice(*rows)], equal_nan=True)


def test_a_display_window_that_no_picture_fills_is_refused(tmp_path, channels):
    path = tmp_path / "a.exr"
    exr_windows.write(path, channels, ((0, 0), (52, 36)), ((0, 0), (999999, 9)))
    for read in (read_header, read_image):
        with pytest.raises(UserError, match=r"a\.exr: displayWindow: is 1000000 × 10; must"):
            read(path)


def test_a_header_with_damaged_text_is_read_or_named(tmp_path, channels):
    path = tmp_path / "a.exr"
    write_exr(path, channels, ATTRIBUTES)
    content = path.read_bytes()
    # For both, OpenEXR itself ends with an error of Python or of the system.
    path.write_bytes(content.replace(b"plenoforge:nan", b"\xf0lenoforge:nan"))
    assert read_header(path).attributes["plenoforge:scale"] == 0.5
    assert same(np.ascontiguousarray(read_image(path).channels["Z"]), channels["Z"])
    path.write_bytes(content.replace(b"\0Z\0", b"\0\xda\0"))
    with pytest.raises(UserError, match=r"a\.exr: is not an image that can be read: .*utf-8"):
        read_header(path)


@pytest.mark.parametrize("part", [0, 3, 100, 0.5, 0.99])
def test_a_file_cut_short_is_named(tmp_path, channels, part):
    path = tmp_path / "cut.exr"
    write_exr(path, channels)
    content = path.read_bytes()
    path.write_bytes(content[: part if isinstance(part, int) else int(part * len(content))])
    with pytest.raises(UserError, match=r"cut\.exr"):
        read_image(path)


def test_a_missing_file_or_channel_is_named(tmp_path, channels):
    with pytest.raises(UserError, match=r"none\.exr: no such file"):
        read_image(tmp_path / "none.exr")
    write_exr(tmp_path / "a.exr", channels)
    with pytest.raises(UserError, match=r"a\.exr: has no channel A; it has R, G, B, Z"):
        read_image(tmp_path / "a.exr", ["R", "A"])
    (tmp_path / "text.exr").write_text("no image")
    with pytest.raises(UserError, match=r"text\.exr: is not an image that can be read"):
        read_header(tmp_path / "text.exr")


def test_16_bits_are_shown_as_the_nearest_8(tmp_path):
    values = np.linspace(0, 65535, 37 * 53 * 3).astype(np.uint16).reshape(37, 53, 3)
    write_png(tmp_path / "a.png", values)
    image = read_image(tmp_path / "a.png")
    assert np.abs(image.srgb - values / 65535 * 255).max() < 0.5
    np.testing.assert_array_equal(image.encoded * 65535, values)


class DamagingWriter:
    """OpenImageIO's writer on a disk that changes a bit of the data."""

    def __init__(self, path, writer):
        self.path = path
        self.writer = writer
        self.open, self.write_image = writer.open, writer.write_image

    def close(self):
        closed = self.writer.close()
        with Path(self.path).open("r+b") as file:
            content = bytearray(file.read())
            content[content.index(b"IDAT") + 10] ^= 1
            file.seek(0)
            file.write(content)
        return closed


def test_a_png_damaged_by_the_disk_replaces_no_other(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    pixels = np.random.default_rng(0).integers(0, 255, (37, 53, 3), np.uint8)
    write_png(path, pixels)
    create = oiio.ImageOutput.create

    class Output:
        @staticmethod
        def create(name):
            return DamagingWriter(name, create(name))

    monkeypatch.setattr(oiio, "ImageOutput", Output)
    with pytest.raises(UserError, match=r"a\.png: cannot be written: .*damaged"):
        write_png(path, 255 - pixels)
    image = read_image(path)
    assert np.array_equal(np.dstack([image.channels[name] for name in "RGB"]), pixels)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_failed_write_leaves_the_old_file(tmp_path, channels):
    path = tmp_path / "a.exr"
    write_exr(path, channels)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="shapes differ"):
        write_exr(path, channels | {"Z": channels["Z"][:5]})
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.exr"]
