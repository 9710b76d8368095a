"""Writes the splits.json of a scene: which views are for training, validation and testing."""

from lightfield.core.files import write_json
from lightfield.formats.splits_file import splits_content
from lightfield.products.scene_list import read_lightfields
from lightfield.stages.views import ListSplits


def write_splits(job: ListSplits) -> None:
    """Write the splits of the rigs. Raises `UserError` for a rig outside the scene's folder."""
    content = splits_content(read_lightfields(job.lightfields, job.output))
    write_json(job.output, content)
    print(", ".join(f"{len(views)} views for {part}" for part, views in content.items()))
