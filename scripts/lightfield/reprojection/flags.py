"""The flags of scripts/reproject.py and scripts/lens_map.py, as SILVR's tool has them.

Lengths are in mm. Angles of lenses are in radians, or in degrees as in 120deg. A rotation is in
degrees. `flag_settings` reads them.
"""

import argparse
from pathlib import Path
from typing import Any

from lightfield.core.cli import above_zero, positive, stops, white
from lightfield.geometry.lenses import LENSES
from lightfield.reprojection.filters import DEFAULT_FILTER, FILTERS


def add_file_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that name files, and those that say how the program runs."""
    files = parser.add_argument_group("Input and output")
    source = files.add_mutually_exclusive_group(required=True)
    source.add_argument("-i", "--input-dir", type=Path, help="folder of the images")
    source.add_argument(
        "--single", type=Path, metavar="FILE", help="one image, instead of a folder"
    )
    files.add_argument("-o", "--output-dir", type=Path, required=True, help="folder to write to")
    files.add_argument("--output-cfg", type=Path, metavar="JSON", help="lightfield.json to write")
    files.add_argument(
        "--record", type=Path, metavar="JSON", help="JSON to write last: a list of the files"
    )
    files.add_argument(
        "--source-record",
        type=Path,
        metavar="JSON",
        help="record whose sizes and checksums the images must match",
    )
    files.add_argument(
        "--lens-map", type=Path, metavar="FILE", help="lens map that lens_map.py computed"
    )
    choice = parser.add_argument_group("Choice of files")
    choice.add_argument(
        "--filter-prefix", default="", help="only images whose names start with this"
    )
    choice.add_argument(
        "--filter-suffix",
        default="",
        help="only images whose names end with this, with or without .png or .exr",
    )
    choice.add_argument(
        "--views",
        metavar="FIRST:END",
        help="only these frames of --input-cfg, as a slice from 0, END excluded",
    )
    runtime = parser.add_argument_group("Runtime")
    runtime.add_argument("--skip-if-exists", action="store_true", help="keep existing output files")
    runtime.add_argument(
        "-j",
        "--parallel",
        type=positive,
        default=1,
        help="how many images are processed at the same time",
    )
    runtime.add_argument(
        "--dry-run", action="store_true", help="write only --output-cfg, and no images"
    )


def add_configuration_flags(parser: argparse.ArgumentParser) -> None:
    """Add --settings, and the flags that `flag_settings.read_source` reads."""
    files = parser.add_argument_group("Configuration")
    files.add_argument(
        "--settings",
        type=Path,
        metavar="JSON",
        help="settings file, which replaces the flags for output lens, sampling, files and colour",
    )
    files.add_argument(
        "--input-cfg", type=Path, metavar="JSON", help="lightfield.json of the images"
    )
    files.add_argument(
        "--no-configs",
        metavar="WIDTH,HEIGHT",
        help="size of images that have no lightfield.json; a flag --i-… then gives their lens",
    )
    choice = _add_lens_flags(parser, "i-", "Input lens, with --no-configs")
    choice.add_argument(
        "--i-cubemap",
        action="store_true",
        help="six faces of a cube, <name>_f, _b, _l, _r, _u and _d; the size of the images is 6 × "
        "N, N",
    )


def add_lens_map_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for the settings of a lens map."""
    choice = _add_lens_flags(parser, "", "Output lens")
    choice.add_argument(
        "--cubemap",
        type=int,
        metavar="SIZE",
        help="six perspective faces of 90°, each SIZE × SIZE pixels",
    )
    optics = parser.add_argument_group("Output optics")
    optics.add_argument("--no-reproject", action="store_true", help="keep the input lens")
    optics.add_argument(
        "--rotation",
        default="0,0,0",
        metavar="PAN,PITCH,ROLL",
        help="turn the camera to the left, down and clockwise, in degrees",
    )
    optics.add_argument(
        "--scale",
        type=above_zero,
        default=1.0,
        help="size of the output, relative to that of the input (default: 1)",
    )
    optics.add_argument(
        "--output-resolution",
        metavar="WIDTH,HEIGHT",
        help="size of the output in pixels, instead of --scale",
    )
    sampling = parser.add_argument_group("Sampling")
    sampling.add_argument(
        "-s", "--samples", type=int, default=1, help="n × n samples per pixel (default: 1)"
    )
    kind = sampling.add_mutually_exclusive_group()
    kind.add_argument(
        "--nn", action="store_const", dest="filter", const="nearest", help="--filter nearest"
    )
    kind.add_argument(
        "--bl", action="store_const", dest="filter", const="bilinear", help="--filter bilinear"
    )
    kind.add_argument(
        "--bc", action="store_const", dest="filter", const="bicubic", help="--filter bicubic"
    )
    kind.add_argument(
        "--filter",
        choices=FILTERS,
        help=f"filter (default: {DEFAULT_FILTER}, or bicubic with --samples)",
    )


def add_reproject_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for the settings of a reprojection."""
    add_lens_map_flags(parser)
    files = parser.add_argument_group("Files of each view")
    files.add_argument("--exr", action="store_true", help="write EXR images with colour and depth")
    files.add_argument("--png", action="store_true", help="write PNG images with colour in sRGB")
    files.add_argument(
        "--bits",
        type=int,
        choices=[8, 16],
        default=8,
        help="bits per channel of a PNG (default: 8)",
    )
    files.add_argument(
        "--depth-png",
        type=above_zero,
        metavar="SCALE",
        help="write 16-bit depth maps, <name>_depth.png: depth in metres × SCALE, and 0 where "
        "there is no depth, or more than 65535 steps",
    )
    files.add_argument(
        "--mask",
        action="store_true",
        help="write masks, dynamic_mask_<name>.png: 255 where the input does not see the pixel",
    )
    files.add_argument(
        "--passes",
        type=lambda text: text.split(","),
        default=[],
        metavar="NAME,…",
        help="also reproject these passes, from the folders beside --input-cfg to "
        "--output-dir/<pass>/",
    )
    colour = parser.add_argument_group("Colour")
    colour.add_argument(
        "--exposure", type=stops, default=0.0, help="exposure in stops (default: 0)"
    )
    colour.add_argument(
        "--reinhard",
        type=white,
        default=1.0,
        help="Reinhard tone mapping: the value that becomes white (default: 1, no tone mapping)",
    )


def _add_lens_flags(parser: argparse.ArgumentParser, prefix: str, title: str) -> Any:
    """Add a flag for each lens. Return their group, in which each flag excludes the others."""
    group = parser.add_argument_group(
        title, "Lengths in mm, angles in radians, or in degrees as in 120deg."
    )
    choice = group.add_mutually_exclusive_group()
    for lens in LENSES.values():
        if lens.form:
            choice.add_argument(f"--{prefix}{lens.flag()}", metavar=lens.form, help=lens.title)
    return choice
