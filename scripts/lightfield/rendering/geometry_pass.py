"""The geometry of a view: the first surface that the ray through each pixel's centre meets.

One render of one sample. Cycles takes a pixel's first sample from the middle of the pixel filter,
and with the narrowest filter that is the pixel's centre. What transparency cuts out is no surface,
as in the colour; glass is one, and fog, smoke and every other volume is none.
"""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from lightfield.rendering import instances, volumes
from lightfield.rendering.cycles import GEOMETRY_PASSES, pass_property, view_layer
from lightfield.rendering.render_graph import changed
from lightfield.rendering.view import Array, render_view

# Cycles gives this depth to a ray that hits nothing.
MISS = 1e10

# A surface of less opacity than this is none: it is what transparency has cut out.
OPACITY = 1e-3

_SAMPLING = {
    "samples": 1,
    "use_adaptive_sampling": False,
    "use_denoising": False,
    "use_sample_subset": False,
    "pixel_filter_type": "BLACKMAN_HARRIS",
    "filter_width": 0.01,
    "max_bounces": 0,
}
_MOTION = {"Vector": "XYZW"}
# Cycles has the next place with the other sign, and y upwards.
_MOTION_SIGNS = np.array([1, -1, -1, 1], np.float32)


@dataclass(frozen=True)
class Geometry:
    """What a view's pixels see at their centres; all of it is of the same surface.

    ``depth``, (height, width) float32 in metres, is inf where nothing is hit: Z-depth for a
    perspective camera and distance for any other. ``normal``, (height, width, 3) float32, is the
    shading normal in world space on the camera's side. ``objects`` and ``materials``,
    (height, width) uint16, are their pass indices. Of what may be asked for, ``instances``,
    (height, width) uint32, are the numbers of `lightfield.rendering.instances`, and ``motion``,
    (height, width, 4) float32, is where the surface is in the previous and in the next frame: x and
    y of both in pixels from here, to the right and down. These are 0 where nothing is hit.
    ``render_seconds`` and ``synchronization_seconds`` are Cycles' own.
    """

    depth: Array
    normal: Array
    objects: Array
    materials: Array
    instances: Array | None
    motion: Array | None
    render_seconds: float
    synchronization_seconds: float


def render_geometry(world_matrix: Array, motion: bool = False, apart: bool = False) -> Geometry:
    """Render the geometry that a camera at ``world_matrix``, (4, 4) camera-to-world, sees.

    With ``motion``, and with instances ``apart``, for which Cycles has been set up.
    """
    wanted = GEOMETRY_PASSES | (_MOTION if motion else {})
    with _geometry_settings(wanted):
        cycles_passes = wanted | (instances.CYCLES_PASSES if apart else {})
        rendered = render_view(world_matrix, 0, cycles_passes)
    depth = rendered.passes["Depth"]
    # Cycles leaves values that are not a number where the lens sees nothing.
    hit = depth < MISS
    normal, objects, materials = (
        np.where(hit, rendered.passes[name], np.float32(0))
        for name in ("Normal", "Object Index", "Material Index")
    )
    return Geometry(
        np.where(hit, depth, np.float32(np.inf))[..., 0],
        normal,
        objects[..., 0].astype(np.uint16),
        materials[..., 0].astype(np.uint16),
        instances.decoded(rendered.passes, objects[..., 0].astype(int)) if apart else None,
        np.where(hit, rendered.passes["Vector"] * _MOTION_SIGNS, np.float32(0)) if motion else None,
        rendered.render_seconds,
        rendered.synchronization_seconds,
    )


@contextmanager
def _geometry_settings(wanted: Iterable[str]) -> Iterator[None]:
    """Let Cycles render the passes ``wanted``, and then what it was set up for."""
    scene = bpy.context.scene
    layer = view_layer(scene)
    with ExitStack() as stack:
        for name, value in _SAMPLING.items():
            stack.enter_context(changed(scene.cycles, name, value))
        # Blender's drawings would change all depths a little, and have none of the other passes.
        stack.enter_context(changed(layer, "use_grease_pencil", False))
        stack.enter_context(changed(scene.render, "use_motion_blur", False))
        stack.enter_context(changed(scene.camera.data.dof, "use_dof", False))
        for name in wanted:
            stack.enter_context(changed(*pass_property(layer, name), True))
        stack.enter_context(changed(layer, "pass_alpha_threshold", OPACITY))
        stack.enter_context(changed(layer.cycles, "pass_debug_sample_count", False))
        for thing in bpy.data.objects:
            if thing.visible_camera and thing.name_full in volumes.alone():
                stack.enter_context(changed(thing, "visible_camera", False))
        for shader in (*bpy.data.materials, scene.world):
            if shader and volumes.has_volume(shader) and volumes.has_surface(shader):
                stack.enter_context(_without_volume(shader.node_tree))
        yield


@contextmanager
def _without_volume(tree: Any) -> Iterator[None]:
    """Take the volume out of a material's or world's nodes for a while."""
    socket = tree.get_output_node("CYCLES").inputs["Volume"]
    (link,) = socket.links
    source = link.from_socket
    tree.links.remove(link)
    try:
        yield
    finally:
        tree.links.new(source, socket)
