"""Warns about scenes that Cycles renders incorrectly without an error."""

from collections.abc import Collection, Iterator
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs.sphere import icosphere
from lightfield.rendering.inspection.clearance import REACH
from lightfield.rendering.inspection.inventory import surface_features
from lightfield.rendering.scenes.node_trees import contributing

Floats = NDArray[np.float64]

# A depth must have at least this many decimal digits.
DIGITS = 3
# The rays of at most this many cameras are followed through transparent surfaces.
MOST_CAMERAS = 8


def warnings(positions: Floats, distances: Floats) -> Iterator[str]:
    """Yield a line for each problem of the open scene that the views will show.

    Cycles has problems far from the origin, behind many transparent layers, and with some lights
    behind glass. The cameras are at ``positions`` (n, 3). Their nearest surfaces are ``distances``
    (n,) away, inf beyond `REACH`. The viewport must show what is rendered: see
    `viewport.show_what_is_rendered`.
    """
    # Cycles computes in float32, in world space.
    steps = np.spacing(np.abs(positions).max(axis=1).astype(np.float32)).astype(np.float64)
    digits = -np.log10(steps / np.minimum(distances, REACH))
    worst = int(np.argmin(digits))
    if digits[worst] < DIGITS:
        far = np.abs(positions[worst]).max()
        yield (
            f"cameras are up to {far:.3g} m from the origin, where Cycles' numbers are "
            f"{100 * steps[worst]:.2g} cm apart, and so are shapes and depths; move the scene and "
            "the rig to the origin"
        )
    limit = bpy.context.scene.cycles.transparent_max_bounces
    step = max(1, len(positions) // MOST_CAMERAS)
    clear = _materials("transparency")
    tested_positions = positions[::step][:MOST_CAMERAS]
    if clear and any(_meets_more(limit, position, clear) for position in tested_positions):
        yield (
            f"more than {limit} transparent surfaces lie behind each other, and what is behind "
            f"{limit} may be black: raise Max Bounces: Transparent in the .blend's Light Paths"
        )
    glass = _materials("transmission")
    small = sorted(obj.name_full for obj in bpy.context.scene.objects if _has_no_size(obj))
    # Filter Glossy lets such light through, but dims it.
    if glass and small and not bpy.context.scene.cycles.blur_glossy:
        yield (
            f"{', '.join(small[:8])}: lights without a size, which do not shine through glass "
            f"({', '.join(glass[:8])}): give them an angle or a radius"
        )


def lens_warnings(lens: Lens) -> Iterator[str]:
    """Yield a line if something shown reads Window coordinates, and a shader renders the lens.

    Through a shader of the camera, Cycles gives these coordinates other values.
    """
    names = () if lens.in_cycles else sorted(_readers_of_window())
    if names:
        yield (
            f"{', '.join(names[:8])}: Window texture coordinates are others through the lens "
            f"{lens.name}, which Cycles lacks; give the shaders other coordinates, or give the rig "
            "a lens of Cycles"
        )


def _readers_of_window() -> Iterator[str]:
    """Yield the full names of the shown materials and worlds that read Window coordinates."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    shaders = {bpy.context.scene.world, bpy.context.view_layer.world_override} - {None}
    for instance in depsgraph.object_instances:
        slots = instance.object.material_slots
        shaders |= {slot.material.original for slot in slots if slot.material}
    for shader in shaders:
        output = shader.node_tree.get_output_node("CYCLES") if shader.node_tree else None
        nodes = set(contributing(output)) if output else set()
        links = [
            link
            for node in nodes
            if node.bl_idname == "ShaderNodeTexCoord"
            for link in node.outputs["Window"].links
        ]
        if any(link.to_node in nodes and not link.is_muted for link in links):
            yield str(shader.name_full)


def _meets_more(limit: int, position: Floats, clear: Collection[str]) -> bool:
    """Return whether a ray from a camera meets more than ``limit`` of the ``clear`` materials."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for vertex in icosphere(2):
        place = Vector(position)
        direction = Vector(vertex).normalized()
        for _ in range(limit + 1):
            hit, place, _, index, obj, _ = bpy.context.scene.ray_cast(depsgraph, place, direction)
            if not hit or _material(obj.evaluated_get(depsgraph), index) not in clear:
                break
            # Continue from just behind the surface.
            place = place + direction * 1e-5 * (1 + place.length)
        else:
            return True
    return False


def _material(obj: Any, index: int) -> str | None:
    """Return the full name of the material of an object's face.

    Return None if it has none, or if the face is not in its mesh, as for a text or an instance.
    """
    mesh = obj.data
    if not isinstance(mesh, bpy.types.Mesh) or index >= len(mesh.polygons) or not mesh.materials:
        return None
    # Cycles limits the index in the same way.
    last = len(mesh.materials) - 1
    material = mesh.materials[min(mesh.polygons[index].material_index, last)]
    return str(material.name_full) if material else None


def _materials(feature: str) -> list[str]:
    """Return the full names of the materials that have one of `inventory.FEATURES`."""
    return sorted(
        material.name_full
        for material in bpy.data.materials
        if feature in dict(surface_features(material))
    )


def _has_no_size(obj: Any) -> bool:
    """Return whether an object is a visible light that shines from a point or one direction."""
    if obj.type != "LIGHT" or not obj.visible_get():
        return False
    light = obj.data
    size = {"SUN": "angle", "POINT": "shadow_soft_size", "SPOT": "shadow_soft_size"}.get(light.type)
    return size is not None and getattr(light, size) == 0
