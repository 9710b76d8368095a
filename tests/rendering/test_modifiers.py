"""The faces that modifiers make are estimated before Blender makes them."""

import bpy
import pytest

from lightfield.core import memory
from lightfield.core.errors import UserError
from lightfield.rendering.scenes.modifiers import faces_of, refuse_too_many_faces


@pytest.fixture(params=["cube", "uv_sphere"])
def shape(request):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    getattr(bpy.ops.mesh, f"primitive_{request.param}_add")()
    return bpy.context.object


def subdivide(shape, levels):
    modifier = shape.modifiers.new("fine", "SUBSURF")
    modifier.levels = modifier.render_levels = levels


def test_the_estimate_is_what_blender_makes(shape):
    shape.modifiers.new("row", "ARRAY").count = 3
    mirror = shape.modifiers.new("mirrored", "MIRROR")
    mirror.use_axis = (True, False, True)
    mirror.use_mirror_merge = False
    subdivide(shape, 2)
    subdivide(shape, 1)
    shape.modifiers.new("off", "ARRAY").show_render = False
    shape.modifiers["off"].show_viewport = False
    made = shape.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert faces_of(shape) == len(made.polygons)


def test_an_object_that_fills_the_memory_is_named_before_it_is_made(shape, monkeypatch):
    shape.modifiers.new("row", "ARRAY").count = 1_000_000
    subdivide(shape, 6)
    shape.modifiers["fine"].levels = 0
    monkeypatch.setattr(memory, "available", lambda: 16e9)
    with pytest.raises(UserError, match=rf"the object {shape.name} gets .* \(row, fine\)"):
        refuse_too_many_faces()
    bpy.context.scene.render.use_simplify = True
    bpy.context.scene.render.simplify_subdivision_render = 0
    shape.modifiers["row"].count = 1000
    refuse_too_many_faces()
