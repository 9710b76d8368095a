"""Writes the optical flow from views to their neighbours. Finished files are kept."""

from pathlib import Path

import numpy as np

from lightfield.configuration import keys
from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import FLOW
from lightfield.geometry.flow import flow
from lightfield.imaging import images
from lightfield.reading.dataset import OpenDataset, OpenView
from lightfield.stages.views import ComputeFlow
from lightfield.workflow import shard_log


def write_flow(job: ComputeFlow) -> None:
    """Write the flow of the chosen views. Raises `UserError` for a view without a neighbour."""
    lightfield = LightField.read(job.lightfield)
    opened = OpenDataset.in_folder(lightfield.folder).views
    views = lightfield.views[view_slice(job.views, len(lightfield.views))]
    view_of_name = {view.name: view for view in lightfield.views}
    progress = Progress(len(views), f"flow {lightfield.folder} {job.views}".rstrip(": "))
    for view in views:
        neighbour = view_of_name.get(view.others.get("flow", ""))
        if neighbour is None:
            raise UserError(f"{job.lightfield}: frames: {view.name}: flow: must name a view")
        path = job.output / f"{view.flow}.exr"
        pair = opened[view.name], opened[neighbour.name]
        sums = [sha256(each.path) for each in pair]
        key = keys.flow_key(lightfield, view, neighbour, sums)
        if not shard_log.is_finished(path, key):
            _write(path, *pair, key)
            shard_log.add(path, key)
        progress.done()


def _write(path: Path, view: OpenView, neighbour: OpenView, key: str) -> None:
    """Write the flow from a view to its neighbour."""
    neighbour_distance = neighbour.depth_as("distance")
    neighbour_distance[images.may_hide(neighbour.path)] = np.nan
    motion, visible = flow(
        view.lens,
        view.world_from_camera,
        neighbour.world_from_camera,
        view.depth_as("distance"),
        neighbour_distance,
    )
    planes = [*np.moveaxis(np.nan_to_num(motion), -1, 0), visible]
    channels = {
        name: plane.astype(FLOW.dtype) for name, plane in zip(FLOW.channels, planes, strict=True)
    }
    images.write_exr(path, channels, {images.KEY_ATTRIBUTE: key})
