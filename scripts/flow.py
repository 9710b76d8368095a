"""Compute the optical flow from each view of a dataset to the view whose camera is nearest.

FOLDER/<view>_to_<other>.exr has channels X and Y, in pixels to the right and down, and V, 1 where
the other view sees the same point. X and Y are NaN where it has no ray for it.
"""

import argparse
from pathlib import Path

import numpy as np

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.dataset.lightfield import NAME
from lightfield.export.source import Source
from lightfield.geometry.flow import flow
from lightfield.imaging import images


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path, help="folder of a dataset with depth")
    parser.add_argument("--reprojection", default="", help="of its views (default: as rendered)")
    parser.add_argument("--output", required=True, type=Path, metavar="FOLDER")
    arguments = parser.parse_args()
    source = Source(arguments.dataset, arguments.reprojection, ".exr")
    views = source.lightfield.views
    if len(views) < 2:
        raise UserError(f"{arguments.dataset / arguments.reprojection / NAME}: has one view alone")
    progress = Progress(len(views), "flow", "views")
    places = source.lightfield.matrices[:, :3, 3]
    for index, view in enumerate(views):
        away = np.linalg.norm(places - places[index], axis=1)
        away[index] = np.inf
        other = views[int(away.argmin())]
        depths = [source.depth(each, "distance") for each in (view, other)]
        found, visible = flow(source.lens, view.matrix, other.matrix, *depths)
        x, y = np.moveaxis(found.astype(np.float32), -1, 0)
        path = arguments.output / f"{view.name}_to_{other.name}.exr"
        images.write_exr(path, {"X": x, "Y": y, "V": visible.astype(np.float16)})
        progress.done()


if __name__ == "__main__":
    run(main)
