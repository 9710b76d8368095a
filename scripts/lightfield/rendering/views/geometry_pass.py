"""Renders the geometry of a view: the first surface on the ray through each pixel's centre.

This is one render with one sample. Cycles takes a pixel's first sample from the middle of the pixel
filter. With the narrowest filter that is the pixel's centre. Glass counts as a surface. Parts that
transparency cuts out do not count, as in the colour. Neither do fog, smoke and other volumes.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from lightfield.formats import passes
from lightfield.geometry.lenses import Lens
from lightfield.imaging.images import LEAST_ALPHA
from lightfield.rendering.scenes import instances, volumes
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.scenes.render_graph import changed
from lightfield.rendering.setup.cycles import pass_property, view_layer
from lightfield.rendering.views.view import Array, render_view

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
# The channels of Cycles' passes.
_CHANNELS = {"Normal": "XYZ", "Object Index": "X", "Material Index": "X", "Vector": "XYZW"}
# Cycles negates the motion to the next frame, and its y points up.
_MOTION_SIGNS = np.array([1, -1, -1, 1], np.float32)


@dataclass(frozen=True)
class ViewGeometry:
    """The surface that each pixel of a view sees at its centre.

    - ``depth`` (height, width): float32 in metres, inf for a miss. Z-depth for a perspective
      camera, distance for any other.
    - ``passes``: the requested passes by name, each 0 for a miss. ``normal`` (height, width, 3):
      float32, the shading normal in world space, towards the camera. ``object`` and ``material``
      (height, width): uint16, their numbers of `lightfield.rendering.scenes.ids`. ``instance``
      (height, width): uint32, the numbers of `lightfield.rendering.scenes.instances`. ``motion``
      (height, width, 4): float32, the offsets x, y to the surface's places in the previous and
      in the next frame, in pixels to the right and down.
    - ``alpha`` (height, width): float32, how much of the surface the picture shows, by one sample.
      None if not requested.
    - ``render_seconds``, ``synchronization_seconds``: as Cycles measured them.
    """

    depth: Array
    passes: Mapping[str, Array]
    alpha: Array | None
    render_seconds: float
    synchronization_seconds: float

    def without(self, where: Array) -> "ViewGeometry":
        """Return a copy with a miss at each of the pixels ``where`` (height, width)."""
        return replace(
            self,
            depth=np.where(where, np.float32(np.inf), self.depth),
            passes={name: cleared(pixels, where) for name, pixels in self.passes.items()},
        )


def cleared(pixels: Array, where: Array) -> Array:
    """Return a copy of ``pixels`` (height, width, …) that is 0 at the pixels ``where``."""
    copy = pixels.copy()
    copy[where] = 0
    return copy


def render_geometry(
    opened: OpenScene, world_from_camera: Array, names: Collection[str] = (), alpha: bool = False
) -> ViewGeometry:
    """Render the geometry that a camera at ``world_from_camera``, (4, 4) camera-to-world, sees.

    ``names`` are the passes that it has beside its depth. ``alpha`` adds this field. The scene must
    be set up for them.
    """
    built_in = {"Depth": "Z"} | {
        cycles_pass: _CHANNELS[cycles_pass]
        for name in names
        for cycles_pass in passes.by_name(name).cycles
    }
    needed = built_in | (instances.CYCLES_PASSES if "instance" in names else {})
    if alpha:
        needed = needed | {"Combined": "RGBA"}
    with _geometry_settings(opened, built_in):
        rendered = render_view(opened, world_from_camera, 0, needed)
    depth = rendered.passes["Depth"]
    # Cycles leaves NaN where the lens sees nothing.
    hit = depth < MISS
    return ViewGeometry(
        np.where(hit, depth, np.float32(np.inf))[..., 0],
        {name: _pass(opened, name, rendered.passes, hit) for name in names},
        rendered.passes["Combined"][..., 3] if alpha else None,
        rendered.render_seconds,
        rendered.synchronization_seconds,
    )


def _pass(opened: OpenScene, name: str, cycles_passes: Mapping[str, Array], hit: Array) -> Array:
    """Return a pass as `ViewGeometry` has it. ``hit`` (height, width, 1) is False for a miss."""
    if name == "instance":
        assert opened.instances
        objects = _pass(opened, "object", cycles_passes, hit)
        return opened.instances.decoded(cycles_passes, objects.astype(int))
    (cycles_name,) = passes.by_name(name).cycles
    pixels = cycles_passes[cycles_name]
    if name == "motion":
        pixels = pixels * _MOTION_SIGNS
        if opened.shader_lens:
            pixels = _motion_in_pixels(pixels, opened.shader_lens)
    pixels = np.where(hit, pixels, np.float32(0))
    if name in ("object", "material"):
        return opened.numbers[name].of_index[pixels[..., 0].astype(np.uint16)]
    return pixels


def _motion_in_pixels(motion: Array, lens: Lens) -> Array:
    """Return the motion (height, width, 4) that Cycles has of a shader's lens, in pixels.

    Through a shader, Cycles has the differences of unit rays in x and y. It does not tell on which
    side of the camera's plane a surface was, so this takes the side of the pixel. 0 where the lens
    does not see the place.
    """
    rays = lens.pixel_rays()
    pixels = lens.pixels(rays)
    places = []
    for offset in (motion[..., :2], motion[..., 2:]):
        x = rays[..., 0] + offset[..., 0]
        y = rays[..., 1] - offset[..., 1]
        depth = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
        z = np.copysign(depth, rays[..., 2])
        places.append(lens.pixels(np.stack([x, y, z], axis=-1)) - pixels)
    return np.asarray(np.nan_to_num(np.concatenate(places, axis=-1), nan=0), np.float32)


@contextmanager
def _geometry_settings(opened: OpenScene, cycles_passes: Iterable[str]) -> Iterator[None]:
    """Set Cycles up for geometry with these passes. Restore all settings afterwards."""
    scene = bpy.context.scene
    layer = view_layer(scene)
    with ExitStack() as stack:
        for name, value in _SAMPLING.items():
            stack.enter_context(changed(scene.cycles, name, value))
        # Drawings would change all depths a little, and they are in no other pass.
        stack.enter_context(changed(layer, "use_grease_pencil", False))
        stack.enter_context(changed(scene.render, "use_motion_blur", False))
        stack.enter_context(changed(scene.camera.data.dof, "use_dof", False))
        for name in cycles_passes:
            stack.enter_context(changed(*pass_property(layer, name), True))
        # A surface with less opacity than this is cut out by transparency.
        stack.enter_context(changed(layer, "pass_alpha_threshold", LEAST_ALPHA))
        stack.enter_context(changed(layer.cycles, "pass_debug_sample_count", False))
        for obj in bpy.data.objects:
            if obj.visible_camera and obj.name_full in opened.volumes:
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
