"""Renders a light field by one shard on the processor, as the workflow does."""

from lightfield.stages.views import RenderShard


def render(lightfield, folder, blend, **options):
    """Write a light field into ``folder``, and its views into exr/ there.

    ``options`` are other fields of the stage.
    """
    path = folder / "lightfield.json"
    lightfield.write(path)
    options = {"device": "cpu", "threads": 1} | options
    RenderShard(lightfield=path, output=folder / "exr", blend=blend, **options).run()
