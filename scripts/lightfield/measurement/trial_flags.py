"""The flags of the programs that render windows. `trials` would load slowly for their --help."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive
from lightfield.measurement.sampling import WINDOW_SIZE


def add_arguments(parser: argparse.ArgumentParser, lightfield: str) -> None:
    """Add the arguments of a program that renders windows. ``lightfield`` is a help text."""
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--inventory", required=True, type=Path, help="what the scene contains")
    parser.add_argument("--lightfield", required=True, type=Path, help=lightfield)
    parser.add_argument(
        "--size",
        type=positive,
        default=WINDOW_SIZE,
        help="pixels of a window's sides (default: %(default)s)",
    )
    parser.add_argument("--device", default="auto", help="what Cycles renders on (default: auto)")
    parser.add_argument("--threads", type=positive, default=1, help="CPU threads (default: 1)")
    parser.add_argument("--cache", required=True, type=Path, help="folder that keeps the renders")


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """Add the argument that `trials.read_arguments` reads beside those of `add_arguments`."""
    parser.add_argument(
        "--calibration", type=Path, help="the file of scripts/calibrate.py for a target error"
    )
