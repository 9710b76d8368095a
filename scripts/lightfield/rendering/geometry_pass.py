"""Renders the geometry of a view: the first surface on the ray through each pixel's centre.

This is one render with one sample. Cycles takes a pixel's first sample from the middle of the pixel
filter. With the narrowest filter that is the pixel's centre. Glass counts as a surface. Parts that
transparency cuts out do not count, as in the colour. Neither do fog, smoke and other volumes.
"""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from lightfield.imaging.images import LEAST_ALPHA
from lightfield.rendering import ids, instances, volumes
from lightfield.rendering.cycles import GEOMETRY_PASSES, pass_property, view_layer
from lightfield.rendering.render_graph import changed
from lightfield.rendering.view import Array, render_view

# Cycles gives this depth to a ray that hits nothing.
MISS = 1e10

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
# Cycles negates the motion to the next frame, and its y points up.
_MOTION_SIGNS = np.array([1, -1, -1, 1], np.float32)


@dataclass(frozen=True)
class ViewGeometry:
    """The surface that each pixel of a view sees at its centre.

    - ``depth`` (height, width): float32 in metres, inf for a miss. Z-depth for a perspective
      camera, distance for any other.
    - ``normal`` (height, width, 3): float32, the shading normal in world space, towards the camera.
    - ``objects``, ``materials`` (height, width): uint16, their numbers of
      `lightfield.rendering.ids`. Only if Cycles was set up for a pass of numbers.
    - ``instances`` (height, width): uint32, the numbers of `lightfield.rendering.instances`. None
      if not requested.
    - ``motion`` (height, width, 4): float32, the offsets x, y to the surface's places in the
      previous and in the next frame. In pixels, to the right and down. None if not requested.
    - ``alpha`` (height, width): float32, how much of the surface the picture shows, by one sample.
      None if not requested.
    - ``render_seconds``, ``synchronization_seconds``: as Cycles measured them.

    All but the depth are 0 for a miss.
    """

    depth: Array
    normal: Array
    objects: Array
    materials: Array
    instances: Array | None
    motion: Array | None
    alpha: Array | None
    render_seconds: float
    synchronization_seconds: float

    def without(self, where: Array) -> "ViewGeometry":
        """Return a copy with a miss at each of the pixels ``where`` (height, width)."""
        return replace(
            self,
            depth=np.where(where, np.float32(np.inf), self.depth),
            normal=cleared(self.normal, where),
            objects=cleared(self.objects, where),
            materials=cleared(self.materials, where),
            instances=None if self.instances is None else cleared(self.instances, where),
            motion=None if self.motion is None else cleared(self.motion, where),
        )


def cleared(pixels: Array, where: Array) -> Array:
    """Return a copy of ``pixels`` (height, width, …) that is 0 at the pixels ``where``."""
    copy = pixels.copy()
    copy[where] = 0
    return copy


def render_geometry(
    world_from_camera: Array,
    motion: bool = False,
    instance_numbers: bool = False,
    alpha: bool = False,
) -> ViewGeometry:
    """Render the geometry that a camera at ``world_from_camera``, (4, 4) camera-to-world, sees.

    ``motion``, ``instance_numbers`` and ``alpha`` add these fields. Cycles must be set up for them.
    """
    geometry_passes = dict(GEOMETRY_PASSES)
    if motion:
        geometry_passes |= _MOTION
    with _geometry_settings(geometry_passes):
        cycles_passes = geometry_passes | (instances.CYCLES_PASSES if instance_numbers else {})
        if alpha:
            cycles_passes = cycles_passes | {"Combined": "RGBA"}
        rendered = render_view(world_from_camera, 0, cycles_passes)
    depth = rendered.passes["Depth"]
    # Cycles leaves NaN where the lens sees nothing.
    hit = depth < MISS
    normal, object_indices, material_indices = (
        np.where(hit, rendered.passes[name], np.float32(0))
        for name in ("Normal", "Object Index", "Material Index")
    )
    objects = ids.numbers("object")[object_indices[..., 0].astype(np.uint16)]
    materials = ids.numbers("material")[material_indices[..., 0].astype(np.uint16)]
    return ViewGeometry(
        np.where(hit, depth, np.float32(np.inf))[..., 0],
        normal,
        objects,
        materials,
        instances.decoded(rendered.passes, objects.astype(int)) if instance_numbers else None,
        np.where(hit, rendered.passes["Vector"] * _MOTION_SIGNS, np.float32(0)) if motion else None,
        rendered.passes["Combined"][..., 3] if alpha else None,
        rendered.render_seconds,
        rendered.synchronization_seconds,
    )


@contextmanager
def _geometry_settings(passes: Iterable[str]) -> Iterator[None]:
    """Set Cycles up for geometry with these ``passes``. Restore all settings afterwards."""
    scene = bpy.context.scene
    layer = view_layer(scene)
    with ExitStack() as stack:
        for name, value in _SAMPLING.items():
            stack.enter_context(changed(scene.cycles, name, value))
        # Drawings would change all depths a little, and they are in no other pass.
        stack.enter_context(changed(layer, "use_grease_pencil", False))
        stack.enter_context(changed(scene.render, "use_motion_blur", False))
        stack.enter_context(changed(scene.camera.data.dof, "use_dof", False))
        for name in passes:
            stack.enter_context(changed(*pass_property(layer, name), True))
        # A surface with less opacity than this is cut out by transparency.
        stack.enter_context(changed(layer, "pass_alpha_threshold", LEAST_ALPHA))
        stack.enter_context(changed(layer.cycles, "pass_debug_sample_count", False))
        for obj in bpy.data.objects:
            if obj.visible_camera and obj.name_full in volumes.alone():
                stack.enter_context(changed(obj, "visible_camera", False))
        worlds = {scene.world, layer.world_override}
        for shader in (*bpy.data.materials, *worlds):
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
