"""Switches that artists leave on or off in a .blend do not change what the scene YAML asks for."""

import numpy as np
import pytest

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

pytestmark = pytest.mark.slow

RENDER = {"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0}
MOTION = {"travel": [0.5, 0, 0], "turn": [0, 0, 0]}
# The camera's place: it looks along y at the cube.
POSE = np.array([[1, 0, 0, 0], [0, 0, -1, -4], [0, 1, 0, 0], [0, 0, 0, 1]], float)


@pytest.fixture
def set_up(tmp_path):
    """Return a function that opens a scene with some change, and a cube which moves along x."""
    import bpy

    from lightfield.rendering.inspection import inventory
    from lightfield.rendering.scenes import blend_file
    from lightfield.rendering.setup import cycles, pruning

    def set_up(change=None, prunes=False, **settings):
        blend_file.new_scene()
        scene = bpy.context.scene
        scene.world = bpy.data.worlds.new("grey")
        bpy.ops.object.light_add(type="SUN", rotation=(1, 0, 0.5))
        bpy.ops.mesh.primitive_cube_add()
        cube = bpy.context.object
        for frame, x in ((0, -2), (2, 2)):
            cube.location.x = x
            cube.keyframe_insert("location", frame=frame)
        if change:
            change(scene, scene.view_layers[0])
        path = tmp_path / "scene.blend"
        blend_file.save_scene(path)
        content = None
        if prunes:
            blend_file.open_scene(path)
            content = inventory.inventory([1])
            content["left_out"] = pruning.left_out(content)
        lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [40, 30]})
        rig = {"type": "lattice", "cameras": [1, 1, 1], "size": 0}
        views = LightField.from_rig(rig, lens, depth="z", frame=1, render=RENDER | settings)
        return cycles.set_up(path, content, views, "cpu", 1)

    return set_up


@pytest.fixture
def render(set_up):
    """Return a function that renders what `set_up` opens."""
    from lightfield.rendering.views.colour_pass import render_colour

    return lambda *change, **settings: render_colour(set_up(*change, **settings), POSE, 0).pixels


def leave_out_blur(scene, layer):
    scene.render.use_motion_blur = True
    layer.use_motion_blur = False


def test_a_layer_without_blur_stays_sharp_unless_the_yaml_asks_for_blur(render):
    sharp = render(leave_out_blur, prunes=True)
    np.testing.assert_array_equal(sharp, render())
    assert np.abs(sharp - render(motion_blur=True)).max() > 0.01


def test_a_moving_camera_is_blurred_although_the_layer_is_not(render):
    blurred = render(leave_out_blur, camera_motion=MOTION)
    np.testing.assert_array_equal(blurred, render(camera_motion=MOTION))
    assert np.abs(blurred - render()).max() > 0.01


def test_an_empty_in_place_of_a_camera_is_none(render):
    import bpy

    from lightfield.rendering.inspection import blend_facts

    render()
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("empty", None)
    scene.collection.objects.link(scene.camera)
    assert blend_facts.facts([1])["camera"] is None


@pytest.mark.parametrize("size", [(22, 23), (29, 37), (97, 61)])
def test_a_window_of_a_view_of_any_size_has_the_pixels_of_the_whole(set_up, size):
    import bpy

    from lightfield.rendering.setup import cycles
    from lightfield.rendering.views.colour_pass import render_colour

    opened = set_up()
    width, height = size
    bpy.context.scene.render.resolution_x = width
    bpy.context.scene.render.resolution_y = height
    full_view = render_colour(opened, POSE, 0).pixels
    assert full_view.shape == (height, width, 3)
    for x, y in ((13, 3), (3, 9), (15, 14), (width - 7, height - 6), (0, 0)):
        cycles.set_window(x, y, 7, 6)
        window = render_colour(opened, POSE, 0).pixels
        np.testing.assert_array_equal(window, full_view[y : y + 6, x : x + 7])


def add_fog(shader):
    """Give a material or a world a thick volume. Return the link to its output."""
    tree = shader.node_tree
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    output = tree.get_output_node("CYCLES")
    return tree.links.new(volume.outputs[0], output.inputs["Volume"])


def cover_with_muted_fog(scene, layer):
    """Put a clear cube before the camera. The artist has muted its volume."""
    import bpy

    bpy.ops.mesh.primitive_cube_add(location=(0, -2, 0), size=1.5)
    material = bpy.data.materials.new("muted")
    bpy.context.object.data.materials.append(material)
    tree = material.node_tree
    clear = tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(clear.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    add_fog(material).is_muted = True


def test_a_muted_volume_stays_muted_in_all_views(set_up):
    from lightfield.rendering.views.colour_pass import render_colour
    from lightfield.rendering.views.geometry_pass import render_geometry

    opened = set_up(cover_with_muted_fog)
    first = render_colour(opened, POSE, 0).pixels
    render_geometry(opened, POSE)
    np.testing.assert_array_equal(render_colour(opened, POSE, 0).pixels, first)


def test_depth_sees_through_fog_with_a_muted_surface(set_up):
    from lightfield.rendering.views.geometry_pass import render_geometry

    def mute_the_surface(scene, layer):
        import bpy

        cover_with_muted_fog(scene, layer)
        output = bpy.data.materials["muted"].node_tree.get_output_node("CYCLES")
        output.inputs["Volume"].links[0].is_muted = False
        output.inputs["Surface"].links[0].is_muted = True

    expected = render_geometry(set_up(), POSE).depth
    opened = set_up(mute_the_surface)
    np.testing.assert_array_equal(render_geometry(opened, POSE).depth, expected)


def test_depth_sees_through_the_fog_of_a_layers_world(set_up):
    import bpy

    from lightfield.rendering.views.geometry_pass import render_geometry

    def override(scene, layer):
        layer.world_override = bpy.data.worlds.new("fog")
        add_fog(layer.world_override)

    expected = render_geometry(set_up(), POSE).depth
    opened = set_up(override)
    np.testing.assert_array_equal(render_geometry(opened, POSE).depth, expected)


@pytest.mark.parametrize("kind", ["world", "material"])
def test_a_missing_texture_of_a_layers_override_is_found(render, tmp_path, kind):
    import bpy

    from lightfield.rendering.inspection import inventory
    from lightfield.rendering.scenes import blend_file

    def override(scene, layer):
        image = bpy.data.images.new("sky", 4, 4)
        image.source = "FILE"
        image.filepath = "//gone.png"
        shader = getattr(bpy.data, f"{kind}s").new("override")
        tree = shader.node_tree
        texture = "Environment" if kind == "world" else "Image"
        node = tree.nodes.new(f"ShaderNodeTex{texture}")
        node.image = image
        tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
        setattr(layer, f"{kind}_override", shader)

    render(override)
    blend_file.open_scene(tmp_path / "scene.blend")
    assert [entry["path"] for entry in inventory.inventory([1])["missing"]] == ["gone.png"]
