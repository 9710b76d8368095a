"""Make the page with links to the pages of all datasets in a results folder.

It is one file with thumbnails. It has every dataset that has a page. It warns about datasets whose
files cannot be read.
"""

import argparse
import sys
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.report import page
from lightfield.report import tables as report_tables
from lightfield.validation.files import REPORT

THUMBNAIL = 480


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument("--output", required=True, type=Path, help="HTML file to write in it")
    arguments = parser.parse_args()
    if not arguments.results.is_dir():
        raise UserError(f"{arguments.results}: no such folder")
    pages = sorted(arguments.results.glob(f"*/**/{REPORT}/index.html"))
    datasets = []
    for path in pages:
        try:
            datasets.append(entry(arguments.results, path))
        except UserError as error:
            # One broken dataset must not hide the others.
            print(f"warning: left out: {error}", file=sys.stderr)
    page.write(arguments.output, "index.html.j2", datasets=datasets)


def entry(results: Path, path: Path) -> dict[str, Any]:
    """Return the index's entry for the dataset whose page is at ``path``."""
    folder = path.parents[1]
    lightfield = LightField.read(folder / NAME)
    scene, *rig = folder.relative_to(results).parts
    validation = report_tables.validation(folder / "validation.json")
    state = "not validated"
    if validation:
        state = "valid" if validation["valid"] else "not valid"
    return {
        "scene": scene,
        "rig": "/".join(rig),
        "link": quote(path.relative_to(results).as_posix()),
        "views": len(lightfield.views),
        "resolution": f"{lightfield.lens.width} × {lightfield.lens.height}",
        "lens": lightfield.lens.description,
        "projection": lightfield.lens.title,
        "state": state,
        "picture": page.photo(path.parent / "overview.png", THUMBNAIL),
    }


if __name__ == "__main__":
    run(main)
