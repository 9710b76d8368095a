"""A .blend whose settings point to nothing, as many do, renders as Blender itself renders it."""

import blend_scenes
import numpy as np
import pytest
from test_blend_settings import EQUAL, difference, of_blender, of_plenoforge, save

pytestmark = pytest.mark.slow

# Without a file, these modifiers read a folder. A shader of a render engine's own has no type.
NEEDS_A_FILE = {"MESH_CACHE", "OCEAN"}
NO_NODE = {"ShaderNode", "ShaderNodeCustomGroup", "ShaderNodeTree"}


def made_by_the_menu():
    """Move the studio into a scene that File, New Scene makes: it has no curves of light."""
    import bpy

    blend_scenes.studio()
    old = bpy.context.scene
    bpy.ops.scene.new(type="NEW")
    new = bpy.context.scene
    assert new.view_settings.curve_mapping is None
    for obj in old.objects:
        new.collection.objects.link(obj)
    new.world = old.world
    new.camera = old.camera
    new.render.engine = "CYCLES"
    new.render.resolution_x, new.render.resolution_y = blend_scenes.SIZE
    new.cycles.samples, new.cycles.seed = old.cycles.samples, old.cycles.seed
    new.cycles.use_adaptive_sampling = new.cycles.use_denoising = False
    bpy.data.scenes.remove(old)


def test_a_scene_of_blenders_menu_shows_what_blender_shows(tmp_path):
    path = tmp_path / "new.blend"
    save(path, made_by_the_menu)
    developed = {"reprojections": {"png": {"look": "file", "bits": 16}}}
    pixels, _, said = of_plenoforge(path, developed)
    assert "curves" not in said
    assert difference(pixels, of_blender(path, "OPEN_EXR")) < EQUAL


def without_targets():
    """Add each modifier, constraint and shader that Blender has, each with nothing to point to."""
    import bpy

    made_by_the_menu()
    bpy.ops.rigidbody.world_add()
    empty = added("empty", None)
    empty.instance_type = "COLLECTION"
    for kind in kinds(bpy.types.Constraint):
        empty.constraints.new(kind)
    mesh = bpy.data.objects["Cube"].data
    for kind in sorted(kinds(bpy.types.Modifier) - NEEDS_A_FILE):
        obj = added(kind, mesh.copy())
        obj.location.z = -50
        obj.modifiers.new(kind, kind)
    material = bpy.data.materials.new("all")
    for name in sorted(set(dir(bpy.types)) - NO_NODE):
        if name.startswith("ShaderNode"):
            material.node_tree.nodes.new(name)
    unseen = added("unseen", mesh.copy())
    unseen.location.z = -50
    unseen.data.materials.append(None)
    unseen.data.materials.append(material)
    unseen.driver_add("location", 0).driver.variables.new()
    unseen.animation_data.action = None


def kinds(base):
    """Return the types of modifiers or constraints that Blender can add."""
    return {item.identifier for item in base.bl_rna.properties["type"].enum_items}


def added(name, data):
    import bpy

    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def test_what_points_to_nothing_is_no_error(tmp_path):
    path = tmp_path / "bare.blend"
    save(path, without_targets)
    pixels, _, _ = of_plenoforge(path, {})
    expected = of_blender(path, "OPEN_EXR")
    assert np.isfinite(pixels).all()
    assert difference(pixels, expected) < EQUAL
