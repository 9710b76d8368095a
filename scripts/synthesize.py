"""Synthesise views from anywhere in a dataset, from its nearest views and their depth.

OUTPUT gets lightfield.json, exr/<view>.exr (R, G, B, A, and Z as in a dataset) and png/<view>.png.
A surface that no view of the dataset sees is a hole. Its colour is that of its surroundings and of
what is behind it. In the EXR its alpha is 0, and its Z is NaN.

Examples:

  # the views of the evaluation sphere, from the dataset's views
  synthesize.py results/garden/LFSphere_e100cm_d170cm --output work/walk \\
    --poses results/garden/LFSphere_e100cm_d50cm/lightfield.json
  # a walk: rig.yaml has type: path, count, keys, and a camera, as in a scene YAML
  synthesize.py results/garden/LFSphere_e100cm_d170cm --poses rig.yaml --video --output work/walk
"""

import argparse
from contextlib import nullcontext
from pathlib import Path

from lightfield.core.cli import positive, run, stops
from lightfield.core.errors import UserError
from lightfield.core.files import keep_apart
from lightfield.core.progress import Progress
from lightfield.dataset.config import read_yaml
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images, pictures
from lightfield.imaging.video import video
from lightfield.synthesis.view import BEST, Sources, reader

# isort: split
import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("dataset", type=Path, help="folder of a dataset with depth")
    add("--reprojection", default="", help="of its views, as EXR (default: as rendered)")
    add(
        "--poses",
        type=Path,
        help="a lightfield.json, or a YAML of a rig with its camera (default: the views that the "
        "dataset's split has to test with, from the others)",
    )
    help_text = f"views a picture is made of (default: {BEST})"
    add("--best", type=positive, default=BEST, metavar="K", help=help_text)
    add("--exposure", type=stops, help="of the PNGs, in stops (default: by the first picture)")
    add("--video", action="store_true", help="write walk.mp4, too, with ffmpeg")
    add("--rate", type=positive, default=25, help="pictures a second of the video (default: 25)")
    add("--output", type=Path, required=True, metavar="FOLDER", help="folder to write")
    arguments = parser.parse_args()

    keep_apart("--output", arguments.output / NAME, arguments.dataset / NAME, arguments.poses)
    source = SourceDataset(arguments.dataset, arguments.reprojection, ".exr")
    views = source.lightfield.views
    targets = poses(arguments.poses)
    if targets is None:
        parts = splits(source.lightfield)
        views = parts.train
        targets = source.lightfield.changed(views=parts.test)
    sources = Sources(
        source.lens,
        views,
        reader(source),
        fills_holes=not source.lightfield.transparent,
        most=4 * arguments.best,
    )
    lens = targets.lens
    depth = targets.lens.usual_depth
    targets.changed(depth=depth).write(arguments.output / NAME)
    rays = lens.pixel_rays()
    exposure = arguments.exposure
    holes = []
    path = arguments.output / "walk.mp4"
    progress = Progress(len(targets.views), "synthesize", "views")
    size = (lens.width, lens.height)
    with video(path, size, arguments.rate) if arguments.video else nullcontext() as add_to_video:
        for view in targets.views:
            made = sources.synthesise(view.matrix, lens, arguments.best)
            if exposure is None:
                exposure = pictures.exposure_for(made.colour[~made.holes])
            images.write_exr(
                arguments.output / "exr" / f"{view.name}.exr", made.channels(depth, rays)
            )
            picture = pictures.develop(np.nan_to_num(made.colour), exposure)
            opaque = np.where(np.isfinite(made.colour[..., 0]), 255, 0).astype(np.uint8)
            images.write_png(
                arguments.output / "png" / f"{view.name}.png", np.dstack([picture, opaque])
            )
            if add_to_video:
                add_to_video(picture)
            holes.append(made.hole_fraction(rays))
            progress.done()
    print(
        f"{len(holes)} views of {arguments.best} each; holes: {np.mean(holes):.3%} of their "
        f"pixels, at most {max(holes):.3%} of one"
    )


def poses(path: Path | None) -> LightField | None:
    """Return the cameras of a lightfield.json or of a rig's YAML; None without a file."""
    if path is None:
        return None
    if path.suffix == ".json":
        return LightField.read(path)
    rig = rigs.from_settings(read_yaml(path, str(path)), str(path))
    if rig.camera is None:
        raise UserError(f"{path}: camera: is missing; it is what the views are seen through")
    return LightField.from_rig(rig, lenses.from_camera(rig.camera))


if __name__ == "__main__":
    run(main)
