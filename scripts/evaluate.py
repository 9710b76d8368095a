"""Compare renders of a dataset's test views with the truth: errors as CSV, and a page of both.

RENDERS holds <view>.png or <view>.exr for each view that the dataset's split has to test with
(without a split every eighth), and may hold normal/<view>.exr. See docs/evaluation.md.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.cli import run, stops, white
from lightfield.core.errors import UserError
from lightfield.core.files import whole, write_csv
from lightfield.core.progress import Progress
from lightfield.dataset.exports import VIEWS
from lightfield.dataset.lightfield import View
from lightfield.export.source import Source
from lightfield.export.splits import splits
from lightfield.imaging import images
from lightfield.measurement import evaluation, metrics
from lightfield.report import page

# More views than this are in the table alone.
SHOWN_VIEWS = 24
WIDEST = 1500


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("renders", type=Path, metavar="RENDERS", help="folder of the renders")
    add("--dataset", type=Path, required=True, help="the dataset's folder")
    add("--source", default=VIEWS, help=f"a reprojection's name (default: {VIEWS}, as rendered)")
    add("--suffix", choices=[".png", ".exr"], default=".exr", help="of the dataset's views")
    add("--exposure", type=stops, default=0.0, help="of EXR views, in stops, as in the export")
    add("--reinhard", type=white, default=1.0, help="of EXR views: what becomes white; 1 is none")
    add("--masks", type=Path, help="folder of <view>.png: where they are 0, nothing is compared")
    add("--output", type=Path, required=True, help="folder to write")
    arguments = parser.parse_args()

    name = "" if arguments.source == VIEWS else arguments.source
    development = {"exposure": arguments.exposure, "reinhard": arguments.reinhard}
    source = Source(arguments.dataset, name, arguments.suffix, **development)
    views = source.lightfield.views
    tests = [view for view in views if view.split == "test"] or splits(source.lightfield).test
    paths = {view.name: find(arguments.renders, view) for view in tests}
    rows = []
    progress = Progress(len(tests), "evaluate", "views")
    for view in tests:
        shown = evaluation.rendered(paths[view.name], source)
        true = evaluation.truth(source, view, paths[view.name])
        counted = np.ones(shown.colour.shape[:2], bool)
        if arguments.masks:
            counted = mask(arguments.masks / f"{view.name}.png", counted.shape)
        parts = evaluation.regions(source, view, counted, true.depth)
        if not parts:
            raise UserError(f"{paths[view.name]}: its mask leaves no pixel that the lens sees")
        for region, errors in evaluation.errors(shown, true, parts):
            rows.append({"view": view.name, "region": region, **errors})
        flip = metrics.flip_map(true.colour, shown.colour)[..., np.newaxis].repeat(3, axis=-1)
        strip = np.concatenate([true.colour, shown.colour, flip], axis=1).clip(0, 1)
        images.write_png(
            arguments.output / "pictures" / f"{view.name}.png",
            np.round(strip * 255).astype(np.uint8),
        )
        progress.done()
    means = evaluation.means(rows)
    write_csv(arguments.output / "evaluation.csv", [*rows, *means])
    page.write(
        arguments.output / "index.html",
        "evaluation.html.j2",
        name="/".join(whole(arguments.dataset).parts[-2:]),
        renders=whole(arguments.renders).name,
        means=means,
        rows=rows,
        pictures={
            view.name: page.photo(arguments.output / "pictures" / f"{view.name}.png", WIDEST)
            for view in tests[:SHOWN_VIEWS]
        },
    )
    overall = means[0]
    psnr = "inf" if math.isinf(overall["psnr"]) else f"{overall['psnr']:.2f}"
    print(
        f"{len(tests)} views: PSNR {psnr} dB, SSIM {overall['ssim']:.4f}, FLIP "
        f"{overall['flip']:.4f}; LPIPS is left out: no installed package has its weights"
    )


def find(folder: Path, view: View) -> Path:
    """Return the render of a view; raises `UserError` where there is none."""
    for suffix in (".exr", ".png"):
        path = folder / f"{view.name}{suffix}"
        if path.is_file():
            return path
    raise UserError(f"{folder}: has no {view.name}.png or .exr, which is a view to test with")


def mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return where a grey picture is not 0; raises `UserError` for one of another size or kind."""
    pixels = images.read_image(path, ["Y"]).channels["Y"]
    if pixels.shape != shape:
        sizes = (f"{width} × {height}" for height, width in (pixels.shape, shape))
        raise UserError(f"{path}: is {', but its view is '.join(sizes)}")
    return np.asarray(pixels > 0)


if __name__ == "__main__":
    run(main)
