"""Write transforms.json for instant-ngp, and the masks and copies of views that it needs.

Frames come in the order and, with --scale and --offset, with the numbers of SILVR's
generate_NERF_transforms.py. instant-ngp reads perspective views, fisheyes and full panoramas.

instant-ngp does not hide the pixels outside a fisheye's image circle by itself. So PNG views with
such pixels get a dynamic_mask_<name>.png beside them. instant-ngp refuses EXR files whose channels
differ in type, as half colour and float depth do. It hides pixels of an EXR only if their colour is
negative. So EXR views are copied to --exr-dir with R, G and B alone.

Give instant-ngp the transforms.json itself. If it gets a folder, it opens every .json in it. It
cannot read lightfield.json.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from lightfield.core.cli import above_zero, check_settings, finite, run


def main(words: Sequence[str] | None = None) -> None:
    """Run the program on ``words``, or on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--input-cfg", type=Path, required=True, help="lightfield.json of the views")
    add("--output", type=Path, required=True, help="transforms.json to write")
    add("--settings", type=Path, metavar="JSON", help="settings file, as for scripts/export.py")
    add("--image-dir", type=Path, help="folder of the views (default: that of --input-cfg)")
    add(
        "--exr-dir",
        type=Path,
        help="folder for the copies of EXR views (default: instant_ngp beside --output)",
    )
    add_settings_flags(parser)
    arguments = parser.parse_args(words)
    check_settings(arguments, add_settings_flags)

    # Only now, so that --help need not wait for it.
    from lightfield.export import instant_ngp

    instant_ngp.export(arguments)


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that replace a settings file."""
    add = parser.add_argument_group("Instead of --settings").add_argument
    add(
        "--image-suffix",
        choices=[".png", ".exr"],
        default=".png",
        help="suffix of the views (default: .png)",
    )
    add(
        "--depth-dir",
        type=Path,
        help="folder for depth maps (16-bit PNG in steps of integer_depth_scale), which are made "
        "from channel Z of the .exr views",
    )
    add(
        "--scale",
        type=above_zero,
        help="scale from metres to unit cubes (default: fitted to the scene)",
    )
    add(
        "--offset",
        type=finite,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="position of the mean camera in the unit cube, with --scale (default: 0.5 0.5 0.5)",
    )
    add(
        "--depth-bounds",
        action="store_true",
        help="fit the unit cube to the cameras and nine tenths of the points in channel Z of the "
        ".exr views (default: the rig fills a fifth of the cube, or all if it looks inward)",
    )
    add(
        "--aabb-scale",
        type=int,
        choices=[1, 2, 4, 8, 16, 32, 64, 128],
        help="side of the training volume in unit cubes (instant-ngp's default: 1)",
    )
    add(
        "--render-aabb",
        type=finite,
        nargs=6,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
        help="two opposite corners of the part of the unit cube that instant-ngp shows",
    )
    add(
        "--placed-as",
        metavar="TRANSFORMS",
        help="take scale and offset from this transforms.json, which lists the training views",
    )


if __name__ == "__main__":
    run(main)
