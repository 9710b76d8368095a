"""Imports views that somebody else has rendered: links or copies them, and records them."""

from pathlib import Path

from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy
from lightfield.core.progress import Progress
from lightfield.formats.lightfield import LightField
from lightfield.stages.views import ImportViews
from lightfield.workflow.records import ShardRecord


def import_views(job: ImportViews) -> None:
    """Import the chosen views. Raises `UserError` if one is missing."""
    views = LightField.read(job.lightfield).views
    names = [f"{view.name}.exr" for view in views[view_slice(job.views, len(views))]]
    record = ShardRecord(job.record, job.output)
    progress = Progress(len(names), "import", "views")
    for name in names:
        _import_view(job.dataset / "exr" / name, job.output / name, record)
        progress.done()
    record.write(job.output / name for name in names)


def _import_view(path: Path, imported: Path, record: ShardRecord) -> None:
    """Link or copy a view, and record it."""
    if not path.is_file():
        raise UserError(f"{path}: no such file, but its lightfield.json has the view")
    link_or_copy(path, imported)
    # A view that its owner renders again is another file. So a change of this file is damage.
    key = f"inode-{path.stat().st_ino}"
    if imported.samefile(path):
        record.refuse_changed(imported, key)
    record.add(imported, key)
