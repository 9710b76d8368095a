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
from pathlib import Path

from lightfield.core.cli import positive, run, stops
from lightfield.synthesis.defaults import BEST


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("dataset", type=Path, help="folder of a dataset with depth")
    add(
        "--reprojection",
        default="",
        help="name of an EXR reprojection to use (default: the views as rendered)",
    )
    add(
        "--poses",
        type=Path,
        help="cameras to synthesise: a lightfield.json, or a YAML with a rig and its camera "
        "(default: the test views of the dataset's split, from its other views)",
    )
    help_text = f"views a picture is made of (default: {BEST})"
    add("--best", type=positive, default=BEST, metavar="K", help=help_text)
    add(
        "--exposure",
        type=stops,
        help="exposure of the PNGs, in stops (default: chosen from the first picture)",
    )
    add("--video", action="store_true", help="also write the video walk.mp4, with ffmpeg")
    add("--rate", type=positive, default=25, help="pictures per second of the video (default: 25)")
    add("--output", type=Path, required=True, metavar="FOLDER", help="folder to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for it.
    from lightfield.synthesis import job

    job.run(arguments)


if __name__ == "__main__":
    run(main)
