"""Writes the optical flow from views to their neighbours. Finished files are kept."""

from pathlib import Path

import numpy as np

from lightfield.configuration import keys
from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import FLOW
from lightfield.geometry.flow import flow
from lightfield.imaging import images
from lightfield.stages.views import ComputeFlow
from lightfield.workflow import shard_log


def write_flow(job: ComputeFlow) -> None:
    """Write the flow of the chosen views. Raises `UserError` for a view without a neighbour."""
    lightfield = LightField.read(job.lightfield)
    source = SourceDataset(lightfield.folder, "", ".exr")
    views = lightfield.views[view_slice(job.views, len(lightfield.views))]
    view_of_name = {view.name: view for view in lightfield.views}
    progress = Progress(len(views), f"flow {lightfield.folder} {job.views}".rstrip(": "))
    for view in views:
        neighbour = view_of_name.get(view.others.get("flow", ""))
        if neighbour is None:
            raise UserError(f"{job.lightfield}: frames: {view.name}: flow: must name a view")
        path = job.output / f"{view.flow}.exr"
        sums = [sha256(source.path(view)), sha256(source.path(neighbour))]
        key = keys.flow_key(lightfield, view, neighbour, sums)
        if not shard_log.is_finished(path, key):
            _write(path, source, view, neighbour, key)
            shard_log.add(path, key)
        progress.done()


def _write(path: Path, source: SourceDataset, view: View, neighbour: View, key: str) -> None:
    """Write the flow from a view to its neighbour."""
    neighbour_distance = source.depth(neighbour, "distance")
    neighbour_distance[images.may_hide(source.path(neighbour))] = np.nan
    motion, visible = flow(
        source.lens,
        view.world_from_camera,
        neighbour.world_from_camera,
        source.depth(view, "distance"),
        neighbour_distance,
    )
    planes = [*np.moveaxis(np.nan_to_num(motion), -1, 0), visible]
    channels = {
        name: plane.astype(FLOW.dtype) for name, plane in zip(FLOW.channels, planes, strict=True)
    }
    images.write_exr(path, channels, {images.KEY_ATTRIBUTE: key})
