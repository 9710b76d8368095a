"""Write the pages of docs/reference/ that are generated from the settings and the programs.

Run this after changing a key of a settings model or a flag of a program, and also
scripts/schema.py.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import write_text

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "reference"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="folder to write (default: %(default)s)"
    )
    folder: Path = parser.parse_args().folder

    # Only now, so that --help need not wait for it.
    from lightfield.report import reference

    for name, text in reference.reference().items():
        write_text(folder / name, text)


if __name__ == "__main__":
    run(main)
