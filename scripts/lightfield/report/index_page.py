"""The index of all datasets: a page that links the page of each."""

import sys
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.report import page, tables
from lightfield.validation.files import REPORT

THUMBNAIL = 480


def write(output: Path, results: Path) -> None:
    """Write the index of the datasets below ``results``.

    Leaves out, with a warning, a dataset that cannot be read.
    """
    pages = sorted(results.glob(f"*/**/{REPORT}/index.html"))
    datasets = []
    for path in pages:
        try:
            datasets.append(_entry(results, path))
        except UserError as error:
            # One broken dataset must not hide the others.
            print(f"warning: left out: {error}", file=sys.stderr)
    page.write(output, "index.html.j2", datasets=datasets)


def _entry(results: Path, path: Path) -> dict[str, Any]:
    """Return the index's entry for the dataset whose page is at ``path``."""
    folder = path.parents[1]
    lightfield = LightField.read(folder / NAME)
    scene, *rig = folder.relative_to(results).parts
    validation = tables.validation(folder / "validation.json")
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
