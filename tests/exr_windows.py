"""EXRs whose data window is not their display window."""

import numpy as np
import OpenEXR

from lightfield.imaging import images


def write(path, channels, data, display, storage="lines", attributes=None):
    """Write channels into an EXR with these windows, in scan lines, tiles or parts.

    A window is its first and its last pixel, each across and down.
    """
    windows = {"dataWindow": data, "displayWindow": display}
    header = {
        name: tuple(np.array(corner, np.int32) for corner in window)
        for name, window in windows.items()
    }
    header |= attributes or {}
    if storage == "tiles":
        tiles = OpenEXR.TileDescription()
        tiles.xSize = tiles.ySize = 16
        header |= {"type": OpenEXR.tiledimage, "tiles": tiles}
    else:
        header["type"] = OpenEXR.scanlineimage
    if storage == "parts":
        parts = [OpenEXR.Part(dict(header), {name: channels[name]}, name) for name in channels]
        OpenEXR.File(parts).write(str(path))
    else:
        OpenEXR.File(header, dict(channels)).write(str(path))


def widen(path, left=3, top=2, right=5, bottom=4):
    """Add pixels of overscan, which no viewer shows, to each side of an EXR."""
    image = images.read_image(path)
    sides = ((top, bottom), (left, right))
    channels = {
        name: np.pad(plane, sides, constant_values=7) for name, plane in image.channels.items()
    }
    height, width = next(iter(image.channels.values())).shape
    data = ((-left, -top), (width - 1 + right, height - 1 + bottom))
    depth = {images.DEPTH_ATTRIBUTE: image.attributes.get(images.DEPTH_ATTRIBUTE, "z")}
    write(path, channels, data, ((0, 0), (width - 1, height - 1)), attributes=depth)


def crop(path, rows, columns):
    """Store only some rows and columns of an EXR: slices with a start and a stop."""
    image = images.read_image(path)
    channels = {
        name: np.ascontiguousarray(plane[rows, columns]) for name, plane in image.channels.items()
    }
    height, width = next(iter(image.channels.values())).shape
    data = ((columns.start, rows.start), (columns.stop - 1, rows.stop - 1))
    depth = {images.DEPTH_ATTRIBUTE: image.attributes.get(images.DEPTH_ATTRIBUTE, "z")}
    write(path, channels, data, ((0, 0), (width - 1, height - 1)), attributes=depth)
