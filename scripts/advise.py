"""Print which changes of a scene's settings reach the same error in less time.

Reads what scripts/try_changes.py measured, and writes a table for each scene beside its file.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "measured",
        nargs="*",
        type=Path,
        help="JSON files that scripts/try_changes.py wrote, each named like its scene",
    )
    paths = parser.parse_args().measured

    # Only now, so that --help need not wait for these.
    from lightfield.measurement import advice

    if not paths:
        raise UserError("the views of all chosen scenes exist already: nothing is rendered")
    for path in paths:
        text = advice.table(path.stem, read_keys(path, "try_changes.py", *advice.SHOWN))
        write_text(path.with_suffix(".md"), text)
        print(text)


if __name__ == "__main__":
    run(main)
