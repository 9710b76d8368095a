"""The index of all datasets: a page that links the page of each, and of each corpus."""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, reading
from lightfield.core.names import CORPUS
from lightfield.core.paths import files_below, inside
from lightfield.engine import receipts
from lightfield.formats.layout import REPORT
from lightfield.formats.lightfield import NAME, LightField
from lightfield.report import page, tables
from lightfield.stages.report import ReportIndex

THUMBNAIL = 480
_PAGE = (REPORT, "index.html")


def write(job: ReportIndex) -> None:
    """Write the index of the datasets below a folder.

    Leaves out, with a warning, a dataset that cannot be read. Raises `UserError` for a damaged
    corpus.json, or if there is no such folder.
    """
    results = job.results
    if not results.is_dir():
        raise UserError(f"{results}: no such folder")
    corpora = sorted(path.parent for path in results.glob(f"*/{CORPUS}"))
    datasets = []
    receipts.note_shared_inputs(folder / CORPUS for folder in corpora)
    for path in _pages(results, corpora):
        receipts.note_shared_inputs([path])
        try:
            datasets.append(_entry(results, path))
        except UserError as error:
            # One broken dataset must not hide the others.
            print(f"warning: left out: {error}", file=sys.stderr)
    families = [_family(results, folder) for folder in corpora]
    page.write(job.output, "index.html.j2", datasets=datasets, families=families)


def _pages(results: Path, corpora: Iterable[Path]) -> Iterator[Path]:
    """Yield the pages of datasets, but of members of families: a family's own page has them."""
    for path in files_below(results, strict=False):
        if path.parts[-2:] == _PAGE and not any(path.is_relative_to(each) for each in corpora):
            yield path


def _family(results: Path, folder: Path) -> dict[str, Any]:
    """Return the index's entry for the corpus in a family's folder."""
    content = read_json(folder / CORPUS)
    with reading(folder / CORPUS, "corpus"):
        numbers = content["statistics"]
        pictures = (each["thumbnail"] for each in content["members"] if "thumbnail" in each)
        picture = next(pictures, None)
        thumbnail = inside(folder, picture, f"{folder / CORPUS}: thumbnail") if picture else None
        return {
            "name": content["name"],
            "link": quote(f"{folder.relative_to(results).as_posix()}/index.html"),
            "members": numbers["members"],
            "views": numbers["views"],
            "state": f"{numbers['failed']} failed" if numbers["failed"] else "valid",
            "picture": page.photo(thumbnail, THUMBNAIL) if thumbnail else None,
        }


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
