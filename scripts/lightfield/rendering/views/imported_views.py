"""Imports views that somebody else has rendered: links or copies them, and records them."""

from pathlib import Path

from lightfield.configuration import keys
from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy, sha256
from lightfield.core.progress import Progress
from lightfield.engine import receipts
from lightfield.engine.read_files import changed
from lightfield.formats.lightfield import LightField
from lightfield.stages.views import ImportViews
from lightfield.workflow import shard_log


def import_views(job: ImportViews) -> None:
    """Import the chosen views. Raises `UserError` if one is missing."""
    lightfield = LightField.read(job.lightfield)
    views = lightfield.views[view_slice(job.views, len(lightfield.views))]
    progress = Progress(len(views), "import", "views")
    for view in views:
        name = f"{view.name}.exr"
        _import_view(job.dataset / "exr" / name, job.output / name)
        shard_log.add(job.output / name, keys.render_key(lightfield, view))
        progress.done()


def _import_view(path: Path, imported: Path) -> None:
    """Link or copy a view, and note its source."""
    if not path.is_file():
        raise UserError(f"{path}: no such file, but its lightfield.json has the view")
    link_or_copy(path, imported)
    if receipt := receipts.current():
        # Now, because the link has given the source another time of change.
        receipt.add_input(path)
        if receipt.inputs[receipts.name_of(path)] != sha256(imported):
            raise changed(path)
