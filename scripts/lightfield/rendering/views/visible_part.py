"""Finds the part of a transparent view that can show a model, so that Cycles renders only this.

All other pixels are empty. Cycles would take all samples of each of them, and denoise them, too.
Without denoising, the pixels are the same as in a render of the whole view.
"""

import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.rendering.scenes import volumes
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.setup import motion_blur
from lightfield.rendering.setup.cycles import set_window

# If a mesh has more vertices, the corners of its box stand for them.
MOST_VERTICES = 100_000
# Cycles does not show these types. It shows a lamp only if cameras can see it.
_UNSEEN = {"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER"}

Array = NDArray[Any]


@dataclass(frozen=True)
class Part:
    """A part of a view: its top left pixel and its size, and the size of the whole view."""

    x: int
    y: int
    width: int
    height: int
    whole: tuple[int, int]

    def in_whole(self, pixels: Array, value: float) -> Array:
        """Return ``pixels`` (height, width, …) in a whole view that has ``value`` elsewhere."""
        view_width, view_height = self.whole
        view = np.full((view_height, view_width, *pixels.shape[2:]), value, pixels.dtype)
        view[self.y : self.y + self.height, self.x : self.x + self.width] = pixels
        return view


def places() -> NDArray[np.float64] | None:
    """Return places (n, 3) in metres, between which all of the open scene lies that can be seen.

    Return None if something else may be visible, such as blurred or displaced surfaces.
    """
    scene = bpy.context.scene
    is_blurred = motion_blur.is_on() or scene.camera.data.dof.use_dof
    is_displaced = any(m.displacement_method != "BUMP" for m in bpy.data.materials)
    if is_blurred or is_displaced or (scene.world and volumes.has_volume(scene.world)):
        return None
    return in_render(_places)


def _places(depsgraph: Any) -> NDArray[np.float64] | None:
    """Return the result of `places`, from a render's dependency graph."""
    groups = [np.empty((0, 3))]
    for instance in depsgraph.object_instances:
        obj = instance.object
        is_seen_lamp = obj.type == "LIGHT" and obj.visible_camera
        if obj.type in _UNSEEN and not is_seen_lamp:
            continue
        if obj.type != "MESH" or obj.particle_systems:
            return None
        mesh = obj.data
        if len(mesh.vertices) > MOST_VERTICES:
            vertices = np.array(obj.bound_box, np.float32)
        else:
            vertices = np.empty((len(mesh.vertices), 3), np.float32)
            mesh.vertices.foreach_get("co", vertices.ravel())
        matrix = np.array(instance.matrix_world, np.float64)
        groups.append(vertices @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(groups)


def choose(
    visible: NDArray[np.float64] | None, world_from_camera: Array, lens: Lens
) -> Part | None:
    """Limit the next renders to the part that shows something.

    ``world_from_camera`` (4, 4) is the renders' pose, and ``visible`` are the `places`. Return the
    part. Return None for the whole view.
    """
    if visible is None:
        return None
    part = _part(visible, world_from_camera, lens)
    if part:
        set_window(part.x, part.y, part.width, part.height)
    else:
        bpy.context.scene.render.use_border = False
    return part


def _part(visible: NDArray[np.float64], world_from_camera: Array, lens: Lens) -> Part | None:
    """Return the smallest part of a perspective view that has all ``visible`` places.

    Return None if there is none, or if a place is not in front of the camera.
    """
    in_camera = (visible - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    if not len(visible) or not (in_camera[:, 2] < 0).all():
        return None
    # The rows and columns of a perspective view follow from these slopes.
    slopes = in_camera[:, :2] / in_camera[:, 2:]
    outermost = np.concatenate([slopes.argmin(0), slopes.argmax(0)])
    pixels = lens.pixels(in_camera[outermost])
    if not np.isfinite(pixels).all():
        return None
    # The pixel filter reaches beyond a pixel. One pixel more is for rounding.
    margin = math.ceil(bpy.context.scene.cycles.filter_width / 2) + 1
    size = np.array([lens.width, lens.height])
    first = np.clip(np.floor(pixels.min(0)) - margin, 0, size).astype(int)
    end = np.clip(np.ceil(pixels.max(0)) + margin, 0, size).astype(int)
    width, height = (int(side) for side in end - first)
    if width < 1 or height < 1:
        return None
    return Part(int(first[0]), int(first[1]), width, height, (lens.width, lens.height))
