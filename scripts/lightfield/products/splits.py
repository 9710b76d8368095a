"""Writes the splits.json of a scene: which views are for training, validation and testing."""

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_json
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.stages.views import ListSplits


def write_splits(job: ListSplits) -> None:
    """Write the splits of the rigs. Raises `UserError` for a rig outside the scene's folder."""
    scene = absolute_path(job.output).parent
    lightfields: dict[str, LightField] = {}
    for path in job.lightfields:
        lightfield = LightField.read(path)
        folder = absolute_path(path).parent
        if not folder.is_relative_to(scene):
            raise UserError(f"{lightfield.path}: must be in {scene}, where --output is")
        lightfields[folder.relative_to(scene).as_posix()] = lightfield
    content = splits_content(lightfields)
    write_json(job.output, content)
    print(", ".join(f"{len(views)} views for {part}" for part, views in content.items()))
