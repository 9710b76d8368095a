"""Writes the views of a rig as arrays in which each slice is an epipolar-plane image.

- ``volume_0.npy`` and so on: an array for each grid of cameras that look in parallel, such as a
  plane or a side of a cuboid: row, column, y, x, channel. Cameras in rings are row, column, too.
  All other views are one array: view, y, x, channel.
- ``depth_0.npy`` and so on, if the settings ask for it: the same without channels, in metres, 32
  bits. NaN for none, inf for a miss.
- ``epipolar_volumes.json``: the axes of each array, and the names and positions of its views.

Numbers are as in the views: linear light of EXR, or the sRGB pixels of PNG.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.core.files import atomic_path, write_json
from lightfield.core.progress import Progress
from lightfield.export import camera_grid
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, Export
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs import Rig
from lightfield.imaging import images


@dataclass(frozen=True, eq=False)
class Volume:
    """The numbers of the ``views`` in an array with an axis for each name in ``axes``."""

    axes: tuple[str, ...]
    views: NDArray[np.int64]


class EpipolarVolumes(Export):
    """The views of a rig as arrays."""

    name = "epipolar_volumes"
    summary = "Views as NumPy arrays by row and column, whose slices are epipolar-plane images."
    rank = 22
    loader = "import numpy\nvolume = numpy.load('{}/volume_0.npy', mmap_mode='r')"

    depth: bool = Field(False, description="Also write the depth as arrays.")

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return NO_DEPTH if self.depth and not has_depth else None

    def rig_refusal(self, rig: Rig) -> str | None:
        return "has only one view" if rig.view_count == 1 else None

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write the arrays and ``epipolar_volumes.json`` into ``folder``."""
        lightfield = source.lightfield
        views = lightfield.views
        channels = _channels(source)
        meaning = lightfield.depth if self.depth else None
        entries = []
        progress = Progress(len(views), "epipolar_volumes", "views")
        for number, volume in enumerate(volumes_of(lightfield.world_from_cameras)):
            chosen = [views[index] for index in volume.views.ravel().tolist()]
            name = f"volume_{number}.npy"
            pages = (_pixels(source, view, channels, progress) for view in chosen)
            _write_array(folder / name, volume.views.shape, pages)
            entry = {"file": name, "axes": [*volume.axes, "y", "x", "channel"]}
            if meaning:
                entry["depth"] = f"depth_{number}.npy"
                depths = (source.depth(view, meaning).astype(np.float32) for view in chosen)
                _write_array(folder / f"depth_{number}.npy", volume.views.shape, depths)
            names = np.array([view.name for view in views])[volume.views]
            positions = lightfield.world_from_cameras[volume.views, :3, 3]
            entry |= {"views": names.tolist(), "positions": positions.tolist()}
            entries.append(entry)
        content = {
            "volumes": entries,
            "channels": channels,
            "colour": "sRGB" if source.suffix == ".png" else "linear Rec. 709",
            "depth": meaning,
        }
        write_json(folder / "epipolar_volumes.json", content)


def volumes_of(world_from_cameras: Floats) -> list[Volume]:
    """Return the arrays of the cameras (n, 4, 4) of a rig, each camera in one of them.

    Cameras that look in parallel are a grid if all directions have one, and one of the grids has
    several columns. Otherwise, upright cameras with equally many at each height are rings.
    """
    volumes = [_grid(world_from_cameras, numbers) for numbers in _parallel(world_from_cameras)]
    found = [volume for volume in volumes if volume is not None]
    if len(found) == len(volumes) and any(volume.views.shape[-1] > 1 for volume in found):
        return found
    numbers = np.arange(len(world_from_cameras))
    return [_rings(world_from_cameras) or Volume(("view",), numbers)]


def _parallel(world_from_cameras: Floats) -> list[NDArray[np.int64]]:
    """Return the numbers of the cameras with equal rotations, in the order of the first ones."""
    rotations = np.round(world_from_cameras[:, :3, :3].reshape(-1, 9), 5) + 0.0
    _, first, group = np.unique(rotations, axis=0, return_index=True, return_inverse=True)
    return [np.flatnonzero(group.ravel() == each) for each in np.argsort(first)]


def _grid(world_from_cameras: Floats, numbers: NDArray[np.int64]) -> Volume | None:
    """Return the array of cameras that look in parallel. None if they are in no grid."""
    grid = camera_grid.find(world_from_cameras[numbers])
    if grid is None:
        return None
    views = numbers[grid.views]
    return Volume(("row", "column"), views[0]) if grid.is_flat else Volume(_LAYERS, views)


_LAYERS = ("layer", "row", "column")


def _rings(world_from_cameras: Floats) -> Volume | None:
    """Return the array of upright cameras in rings above each other, in their own order."""
    up = world_from_cameras[:, :3, 1]
    if not np.allclose(up, up[0], atol=1e-6):
        return None
    heights = np.round(world_from_cameras[:, :3, 3] @ up[0], 9)
    rows = len(np.unique(heights))
    if len(heights) % rows:
        return None
    by_row = heights.reshape(rows, -1)
    if rows == 1 or np.ptp(by_row, axis=1).any():
        return None
    return Volume(("row", "column"), np.arange(len(heights)).reshape(rows, -1))


def _channels(source: SourceDataset) -> str:
    """Return the channels of the views: with alpha if one of them has it."""
    headers = (images.read_header(source.path(view)) for view in source.lightfield.views)
    return "RGBA" if any("A" in header.channels for header in headers) else "RGB"


def _pixels(source: SourceDataset, view: View, channels: str, progress: Progress) -> NDArray[Any]:
    """Return a view's pixels (height, width, channels), as the file has them."""
    image = source.view(view).image()
    planes = image.channels
    dtype = planes["R"].dtype
    colour = image.colour if dtype.kind == "f" else np.stack([planes[name] for name in "RGB"], -1)
    progress.done()
    if channels == "RGB":
        return colour.astype(dtype)
    opaque = np.full(colour.shape[:2], 1 if dtype.kind == "f" else np.iinfo(dtype).max, dtype)
    return np.dstack([colour, planes.get("A", opaque)]).astype(dtype)


def _write_array(path: Path, shape: tuple[int, ...], pages: Iterator[NDArray[Any]]) -> None:
    """Write ``pages`` as an array of NumPy, one after the other: it need not fit in memory.

    ``shape`` is the array's without its pages. The first page has their type.
    """
    first = next(pages)
    kind = first.dtype.newbyteorder("<")
    header = {"descr": kind.str, "fortran_order": False, "shape": (*shape, *first.shape)}
    npy: Any = np.lib.format  # without types in older versions of NumPy
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        npy.write_array_header_1_0(file, header)
        for page in chain([first], pages):
            file.write(np.ascontiguousarray(page, kind).tobytes())
