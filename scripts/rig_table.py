"""Tabulate the camera setups of scenes like Table 2 of the SILVR paper, beside its figures.

Columns: views, cameras along each axis, size, mean distance to the nearest camera at another place,
mean distance between neighbours of the camera grid. The last column is the immersive interpolation
volume (see lightfield/geometry/interpolation_volume.py).
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import write_csv, write_text


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+", type=Path, help="scene YAML files")
    parser.add_argument("--markdown", type=Path, required=True, help="Markdown table to write")
    parser.add_argument(
        "--csv", type=Path, required=True, help="CSV to write: the same figures, unrounded"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.report import rig_table

    setups = rig_table.read_setups(arguments.scenes)
    text = rig_table.markdown(setups)
    print(text, end="")
    write_text(arguments.markdown, text)
    write_csv(arguments.csv, [setup.figures() for setup in setups])


if __name__ == "__main__":
    run(main)
