"""Reads exports back as their consumers do: one module for each format.

A reader shares no code with the writer of its format in `lightfield.export`. It has
``read(path, size, options)``:

- ``path``: the file that lists the export (transforms.json or export.json).
- ``size``: the views' width and height in pixels.
- ``options``: the options that the export says it was made with.

It returns `contents.Exported`, in the axes and metres of lightfield.json. It raises `UserError` for
a file that its consumer could not open.

A reader of an export of a sequence also takes the frames: the numbers of the animation's frames by
the names of their folders. It returns `contents.Exported` for each frame.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, reading
from lightfield.formats.export_lists import MANIFEST
from oracles.readers import (
    coco,
    colmap,
    colmap_frames,
    dnerf,
    dust3r,
    epipolar_volumes,
    focal_stack,
    hci,
    instant_ngp,
    lichtfeld,
    mesh,
    miv,
    miv_frames,
    multipleview,
    ncore,
    ncore_frames,
    nerf_synthetic,
    nerfbaselines,
    nerfstudio,
    neural_3d_video,
    opendibr,
    opendibr_frames,
    point_cloud,
    poses_csv,
    quilt,
    scannetpp,
    scene_flow,
    splat,
    wai,
)
from oracles.readers.contents import Exported

READERS = {
    "coco": coco.read,
    "colmap": colmap.read,
    "dust3r": dust3r.read,
    "epipolar_volumes": epipolar_volumes.read,
    "focal_stack": focal_stack.read,
    "hci": hci.read,
    "lichtfeld": lichtfeld.read,
    "mesh": mesh.read,
    "miv": miv.read,
    "ncore": ncore.read,
    "nerf_synthetic": nerf_synthetic.read,
    "nerfbaselines": nerfbaselines.read,
    "nerfstudio": nerfstudio.read,
    "opendibr": opendibr.read,
    "point_cloud": point_cloud.read,
    "poses_csv": poses_csv.read,
    "quilt": quilt.read,
    "scannetpp": scannetpp.read,
    "splat": splat.read,
    "wai": wai.read,
}

WITHOUT_VIEWS = (
    "coco",
    "epipolar_volumes",
    "focal_stack",
    "mesh",
    "point_cloud",
    "quilt",
    "splat",
)
"""The exports that have no poses of views."""

SEQUENCE_READERS = {
    "colmap_frames": colmap_frames.read,
    "dnerf": dnerf.read,
    "miv_frames": miv_frames.read,
    "multipleview": multipleview.read,
    "ncore_frames": ncore_frames.read,
    "neural_3d_video": neural_3d_video.read,
    "opendibr_frames": opendibr_frames.read,
    "scene_flow": scene_flow.read,
}


def read(path: Path, size: tuple[int, int]) -> Exported:
    """Read the export that a transforms.json or an export.json lists.

    ``size`` is the views' width and height in pixels. Raises `UserError` for an export that its
    consumer could not open.
    """
    if path.name != MANIFEST:
        name = "instant_ngp"
        exported = instant_ngp.read(path)
    else:
        name, options = _format_and_options(path, READERS)
        with reading(path, f"list of an export for {name}"):
            exported = READERS[name](path, size, options)
    if not exported.views and name not in WITHOUT_VIEWS:
        exported.faults.append(f"{path}: this export for {name} has no view")
    return exported


def read_sequence(
    path: Path, size: tuple[int, int], frames: Mapping[str, int]
) -> tuple[str, list[Exported]]:
    """Read the export of a sequence that an export.json lists. Return its format and its frames.

    ``frames`` are the numbers of the animation's frames by the names of their folders, in order.
    Raises `UserError` for an export that its consumer could not open.
    """
    name, options = _format_and_options(path, SEQUENCE_READERS)
    with reading(path, f"list of an export for {name}"):
        return name, SEQUENCE_READERS[name](path, size, options, frames)


def _format_and_options(path: Path, readers: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    with reading(path, "list of an export"):
        content = read_json(path)
        name = str(content["format"])
        options = dict(content["options"])
    if name not in readers:
        raise UserError(f"{path}: format: is {name!r}; must be of {', '.join(readers)}")
    return name, options
