"""Make the page with links to the pages of all datasets in a results folder.

The page is one file with thumbnails. It lists every dataset that has a page. The program warns
about datasets whose files cannot be read.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument(
        "--output", required=True, type=Path, help="HTML file to write, in that folder"
    )
    arguments = parser.parse_args()
    if not arguments.results.is_dir():
        raise UserError(f"{arguments.results}: no such folder")

    # Only now, so that --help need not wait for it.
    from lightfield.report import index_page

    index_page.write(arguments.output, arguments.results)


if __name__ == "__main__":
    run(main)
