"""Put a dataset's views on one sheet, small, in their order and at one exposure."""

import argparse
import math
import sys
from pathlib import Path

import matplotlib
import numpy as np
import OpenImageIO as oiio

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField
from lightfield.imaging import images, pictures

SHEET_WIDTH = 1600
GAP = 4
CAPTION = 14
BACKGROUND = 24
INK = (0.8, 0.8, 0.8)
# Matplotlib brings its font along, so that captions look alike on every machine.
FONT = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument("--views", required=True, type=Path, help="folder of the views")
    parser.add_argument("--output", required=True, type=Path, help="PNG to write")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    names = [view.name for view in lightfield.views]
    step = math.ceil(len(names) / pictures.MOST_VIEWS)
    lens = lightfield.lens
    images.write_png(
        arguments.output, sheet(arguments.views, names[::step], lens.width, lens.height)
    )


def sheet(folder: Path, names: list[str], width: int, height: int) -> np.ndarray:
    """Return the sheet's 8-bit pixels; each view has its name beneath."""
    columns = max(1, round(math.sqrt(len(names) * 1.6 * height / width)))
    rows = math.ceil(len(names) / columns)
    cell_width = min(width, (SHEET_WIDTH - GAP) // columns - GAP)
    cell_height = max(1, round(cell_width * height / width))
    views = [small_view(folder / f"{name}.exr", cell_width, cell_height) for name in names]
    exposure = pictures.exposure_for(np.stack(views))

    step_x, step_y = cell_width + GAP, cell_height + GAP + CAPTION
    page = np.full((GAP + rows * step_y, GAP + columns * step_x, 3), BACKGROUND, dtype=np.uint8)
    for number, view in enumerate(views):
        top = GAP + number // columns * step_y
        left = GAP + number % columns * step_x
        page[top : top + cell_height, left : left + cell_width] = pictures.develop(view, exposure)
    buffer = oiio.ImageBuf(page)
    for number, name in enumerate(names):
        oiio.ImageBufAlgo.render_text(
            buffer,
            GAP + number % columns * step_x + cell_width // 2,
            GAP + number // columns * step_y + cell_height + CAPTION // 2 + 1,
            name,
            fontsize=10,
            fontname=str(FONT),
            textcolor=INK,
            alignx="center",
            aligny="center",
        )
    return buffer.get_pixels(oiio.UINT8)


def small_view(path: Path, width: int, height: int) -> np.ndarray:
    """Return a view's colour at a cell's size; black where there is none, as validation will say.

    Pixels that hold no number are black too.
    """
    try:
        colour = pictures.read_colour(path)
    except UserError as error:
        print(f"warning: {error}", file=sys.stderr)
        return np.zeros((height, width, 3), dtype=np.float32)
    return pictures.shrunk(np.where(np.isfinite(colour), colour, 0), width, height)


if __name__ == "__main__":
    run(main)
