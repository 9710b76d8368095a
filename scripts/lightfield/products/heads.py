"""Writes the heads.json of a scene: which views the cameras of a head take at the same place."""

from typing import Any

import numpy as np

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.layout import IMAGES
from lightfield.formats.lightfield import LightField
from lightfield.products.scene_list import read_lightfields
from lightfield.stages.views import ListHeads


def write_heads(job: ListHeads) -> None:
    """Write the heads of the rigs. Raises `UserError` for a rig outside the scene's folder."""
    heads: dict[str, Any] = {}
    for folder, lightfield in read_lightfields(job.lightfields, job.output).items():
        _add(heads, lightfield, folder)
    for head in heads.values():
        head["frames"] = [*head["frames"].values()]
    write_json(job.output, heads)
    counts = {name: units.count(len(head["cameras"]), "camera") for name, head in heads.items()}
    print(", ".join(f"{name}: {count}" for name, count in counts.items()))


def _add(heads: dict[str, Any], lightfield: LightField, folder: str) -> None:
    """Add the camera of a light field to its head. ``folder`` is its dataset's, in the scene's."""
    camera = lightfield.head
    if camera is None:
        raise UserError(f"{lightfield.path}: head: is missing; its rig has none in the scene YAML")
    head = heads.setdefault(camera.head, {"cameras": {}, "frames": {}})
    # In a sequence the frame's folder follows the rig's.
    rig = folder.partition("/")[0]
    head["cameras"][camera.name] = {
        "rig": rig,
        "body_from_camera": camera.body_from_camera.tolist(),
    }
    for view in lightfield.views:
        body = np.round(camera.body_of(view.world_from_camera), 12) + 0.0
        frame = {
            "name": view.name,
            "frame": lightfield.frame,
            "world_from_body": body.tolist(),
            "views": {},
        }
        entry = head["frames"].setdefault((lightfield.frame, view.name), frame)
        entry["views"][camera.name] = f"{folder}/{IMAGES}/{view.name}.exr"
