"""Writes a quilt for Looking Glass displays: the views of a row of cameras in one picture.

The view from the left is in the lower left tile. The tiles go on to the right, and then row by row
upwards. The name of the file, such as ``quilt_qs8x6a0.75.png``, says how many columns and rows
there are, and a tile's width / height. All views are moved so that they agree at one distance,
which then lies in the display, and cut to what all of them show. Source: Looking Glass Factory's
documentation, "Quilts" and "Moving the camera".
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.export import camera_grid, cameras
from lightfield.export.camera_grid import CameraGrid
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, Developed, Metres, plane_refusal
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import Rig
from lightfield.geometry.rigs.plane import Plane
from lightfield.imaging import images
from lightfield.settings.base import as_list

_Tiles = Annotated[int, Field(ge=1, le=100)]


@dataclass(frozen=True)
class _Layout:
    """The views from left to right, where each sees the focus, and what is cut out of them.

    ``moves`` (n,) are pixels to the right of the place in the middle's view.
    """

    views: list[int]
    moves: Floats
    columns: int
    left: int
    top: int
    width: int
    height: int

    @property
    def rows(self) -> int:
        return len(self.views) // self.columns


class Quilt(Developed):
    """The views of a row in one picture, for Looking Glass displays."""

    name = "quilt"
    summary = "Quilt of a row of cameras, for Looking Glass displays."
    rank = 21
    loader = "from pathlib import Path\n(quilt,) = Path('{}').glob('quilt_qs*.png')"

    focus: Metres | None = Field(
        None,
        description="Distance from the cameras of what lies in the display. Nearer points are in "
        "front of it. Without this key, the nearest surface is as much in front of it as the "
        "farthest is behind it, in pixels.",
        json_schema_extra={"unit": "m"},
    )
    row: Annotated[int, Field(ge=0)] | None = Field(
        None,
        description="Number of the row of cameras. The highest is 0. Without this key, the middle.",
    )
    tiles: Annotated[tuple[_Tiles, _Tiles], as_list(2)] | None = Field(
        None,
        description="Number of tiles across and up. Cameras are then chosen at equal distances. "
        "Without this key, the quilt has all cameras of the row.",
    )
    aspect: Annotated[float, Field(ge=0.1, le=10)] | None = Field(
        None,
        description="Width / height of the display, to which the views are cut. Without this key, "
        "they keep what all show.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not perspective, as the views of a quilt are; {TO_RECTILINEAR}"
        return NO_DEPTH if self.focus is None and not has_depth else None

    def rig_refusal(self, rig: Rig) -> str | None:
        if refusal := plane_refusal(rig):
            return refusal
        assert isinstance(rig, Plane)
        return self._shape_refusal(*rig.cameras)

    def _shape_refusal(self, columns: int, rows: int) -> str | None:
        """Return why a plane of cameras has not the row or the tiles. None if it has."""
        if self.row is not None and self.row >= rows:
            return f"has {rows} rows of cameras, from 0, but row is {self.row}"
        across, up = self.tiles or (2, 1)
        if columns < max(across * up, 2):
            return f"has {columns} cameras in a row, and the quilt {max(across * up, 2)} tiles"
        return None

    def picture_sizes(self, source: SourceDataset) -> set[tuple[int, int]]:
        layout = self._layout(source)
        return {(layout.columns * layout.width, layout.rows * layout.height)}

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write the quilt into ``folder``."""
        # Only here, because its kernels take long to load.
        from lightfield.export.refocus import MovableView, mean_light

        layout = self._layout(source)
        width, height = layout.width, layout.height
        quilt = np.zeros((layout.rows * height, layout.columns * width, 3), np.uint8)
        progress = Progress(len(layout.views), "quilt", "views")
        for tile, (number, move) in enumerate(zip(layout.views, layout.moves, strict=True)):
            view = source.lightfield.views[number]
            total = np.zeros((source.lens.height, source.lens.width, 5), np.float32)
            MovableView(source.light(view), source.valid(view)).add_to(total, float(move), 0, 1)
            shown = mean_light(total)[layout.top :, layout.left :][:height, :width]
            left = tile % layout.columns * width
            bottom = len(quilt) - tile // layout.columns * height
            # Transparent views are in front of black.
            pixels = source.developed(shown[..., :3])
            quilt[bottom - height : bottom, left : left + width] = pixels
            progress.done()
        name = f"quilt_qs{layout.columns}x{layout.rows}a{self.aspect or width / height:.4g}.png"
        images.write_png(folder / name, quilt)

    def _layout(self, source: SourceDataset) -> _Layout:
        """Return the layout of the quilt. Raises `UserError` if the views do not have it."""
        place = source.lightfield.path
        grid = camera_grid.plane_of(source.lightfield)
        rows, columns = grid.views.shape[1:]
        if reason := self._shape_refusal(columns, rows):
            raise UserError(f"{place}: frames: {reason}")
        across, up = self.tiles or _tiles(columns)
        kept = _evenly(columns, across * up)
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        right = grid.right[kept] - (grid.right[kept[0]] + grid.right[kept[-1]]) / 2
        focus = self.focus or _middle(source, grid)
        moves = -cameras.focal_pixels(lens)[0] * right / focus
        margin = math.ceil(float(np.abs(moves).max()))
        width, height = lens.width - 2 * margin, lens.height
        if width < 1:
            raise UserError(f"{place}: focus: {focus:g} m is so near that no pixel is in all views")
        if self.aspect:
            width, height = (
                min(width, max(1, round(height * self.aspect))),
                min(height, max(1, round(width / self.aspect))),
            )
        views = grid.views[0, rows // 2 if self.row is None else self.row, kept].tolist()
        left, top = (lens.width - width) // 2, (lens.height - height) // 2
        return _Layout(views, moves, across, left, top, width, height)


def _middle(source: SourceDataset, grid: CameraGrid) -> float:
    """Return the distance in metres in the middle of the disparities of the surfaces."""
    from lightfield.export.refocus import surface_range

    near, far = surface_range(source, grid, "focus")
    return 2 / (1 / near + 1 / far)


def _tiles(count: int) -> tuple[int, int]:
    """Return the columns and rows of ``count`` tiles that are most like a square."""
    rows = max(rows for rows in range(1, math.isqrt(count) + 1) if count % rows == 0)
    return count // rows, rows


def _evenly(cameras_in_row: int, count: int) -> list[int]:
    """Return the columns of ``count`` cameras at equal distances, in the middle of the row."""
    step = (cameras_in_row - 1) // (count - 1)
    first = (cameras_in_row - 1 - step * (count - 1)) // 2
    return [first + step * number for number in range(count)]
