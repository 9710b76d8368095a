"""Draws many views on one sheet: small, in their order, at one exposure."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
import OpenImageIO as oiio

from lightfield.core.errors import UserError
from lightfield.geometry.rigs import Cylinder, Plane, Rig
from lightfield.imaging import images, pictures
from lightfield.imaging.look import Look
from lightfield.imaging.pictures import Array

_SHEET_WIDTH = 1600
# Narrower cells have no room for a view's name.
_LEAST_CELL = 96
_MOST_COLUMNS = 16
GAP = 4
_CAPTION = 14
_BACKGROUND = 24
INK = (0.8, 0.8, 0.8)
# The font comes with Matplotlib, so that captions look the same on every machine.
FONT = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")


class Layout(NamedTuple):
    """The numbers of the ``views`` on a sheet, and its number of ``columns``, or None for any."""

    views: list[int]
    columns: int | None


def layout(rig: Rig, count: int, most: int = pictures.MOST_VIEWS) -> Layout:
    """Return which of the ``count`` views of a ``rig`` a sheet of at most ``most`` views shows.

    A plane or a cylinder keeps its rows and columns. Every n-th of them is left if there are many.
    """
    is_whole = count == rig.view_count
    if not (isinstance(rig, Plane | Cylinder) and rig.cameras[1] > 1 and is_whole):
        return Layout([*range(0, count, math.ceil(count / most))], None)
    across, down = rig.cameras
    each = rig.views_a_position
    step = 1
    while True:
        rows = len(range(0, down, step))
        columns = each * len(range(0, across, step))
        if step >= across or (columns <= _MOST_COLUMNS and rows * columns <= most):
            break
        step += 1
    numbers = np.arange(count).reshape(down, across, each)[::step, ::step]
    return Layout(numbers.ravel().tolist(), columns)


def sheet(
    views: Sequence[Path],
    width: int,
    height: int,
    look: Look | None = None,
    columns: int | None = None,
) -> Array:
    """Return the sheet's 8-bit pixels (height, width, 3). Each view has its name beneath.

    The views are EXRs, which are developed here, with a ``look`` if there is one, or PNGs. Their
    size is ``width`` × ``height``. Without ``columns``, the sheet is about as wide as a page.
    """
    if columns is None:
        columns = max(1, min(len(views), round(math.sqrt(len(views) * 1.6 * height / width))))
    rows = math.ceil(len(views) / columns)
    cell_width = min(max(width, _LEAST_CELL), (_SHEET_WIDTH - GAP) // columns - GAP)
    # Limit the height too: a single tall view would exceed the largest WebP.
    cell_width = max(1, min(cell_width, _SHEET_WIDTH * width // height))
    cell_height = max(1, round(cell_width * height / width))
    cells = [small_view(path, cell_width, cell_height) for path in views]
    exposure = pictures.exposure_for(np.stack(cells), look)

    step_x = cell_width + GAP
    step_y = cell_height + GAP + _CAPTION
    page = np.full((GAP + rows * step_y, GAP + columns * step_x, 3), _BACKGROUND, dtype=np.uint8)
    corners = [(GAP + n % columns * step_x, GAP + n // columns * step_y) for n in range(len(views))]
    for path, cell, (left, top) in zip(views, cells, corners, strict=True):
        developed = cell if path.suffix == ".png" else pictures.develop(cell, exposure, look)
        page[top : top + cell_height, left : left + cell_width] = developed
    buffer = oiio.ImageBuf(page)
    for path, (left, top) in zip(views, corners, strict=True):
        oiio.ImageBufAlgo.render_text(
            buffer,
            left + cell_width // 2,
            top + cell_height + _CAPTION // 2 + 1,
            path.stem,
            fontsize=10,
            fontname=str(FONT),
            textcolor=INK,
            alignx="center",
            aligny="center",
        )
    return np.asarray(buffer.get_pixels(oiio.UINT8))


def small_view(path: Path, width: int, height: int) -> Array:
    """Return a view's colour (height, width, 3) at a cell's size.

    An unreadable view is black: validation reports it. Pixels that are not numbers are black.
    """
    try:
        image = images.read_image(path, "RGB")
    except UserError as error:
        print(f"warning: {error}", file=sys.stderr)
        return np.zeros((height, width, 3), dtype=np.float32)
    if path.suffix == ".png":
        return pictures.shrunk_8_bit(image.srgb, width, height)
    return pictures.shrunk(np.where(np.isfinite(image.colour), image.colour, 0), width, height)
