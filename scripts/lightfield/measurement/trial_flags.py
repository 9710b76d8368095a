"""The flags of the programs that render windows. `trials` would load slowly for their --help."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive
from lightfield.planning.sampling import WINDOW_SIZE


def add_arguments(parser: argparse.ArgumentParser, lightfield: str) -> None:
    """Add the arguments of a program that renders windows. ``lightfield`` is a help text."""
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--inventory",
        required=True,
        type=Path,
        help="JSON that scripts/inventory.py wrote for the scene",
    )
    parser.add_argument("--lightfield", required=True, type=Path, help=lightfield)
    parser.add_argument(
        "--device", default="auto", help="device on which Cycles renders (default: auto)"
    )
    parser.add_argument("--threads", type=positive, default=1, help="CPU threads (default: 1)")
    parser.add_argument(
        "--cache",
        required=True,
        type=Path,
        help="folder that keeps finished renders, so that an interrupted run can continue",
    )


def add_size(parser: argparse.ArgumentParser) -> None:
    """Add the argument for the size of the windows, for a program that renders no whole views."""
    parser.add_argument(
        "--size",
        type=positive,
        default=WINDOW_SIZE,
        help="width and height of each rendered window, in pixels (default: %(default)s)",
    )


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """Add the argument that `trials.read_arguments` reads beside those of `add_arguments`."""
    parser.add_argument(
        "--calibration",
        type=Path,
        help="JSON that scripts/calibrate.py wrote, for a scene with target_error",
    )
