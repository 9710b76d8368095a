"""Letters as shapes, for signs and prints."""

from functools import cache

import bpy

from scenes.library.objects import mesh_shape
from scenes.library.shapes import Shape


@cache
def lettering(text: str, depth: float) -> Shape:
    """Flat letters, 1 m high and centred, in Blender's own font, `depth` metres thick."""
    curve = bpy.data.curves.new("lettering", "FONT")
    curve.body, curve.align_x, curve.align_y = text, "CENTER", "CENTER"
    curve.resolution_u, curve.extrude = 3, depth / 2
    thing = bpy.data.objects.new("lettering", curve)
    data = bpy.data.meshes.new_from_object(thing)
    shape = mesh_shape(data)
    bpy.data.objects.remove(thing)
    bpy.data.curves.remove(curve)
    bpy.data.meshes.remove(data)
    return shape
