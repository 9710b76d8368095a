"""Models in glTF: what the file says is what the scene holds, or it is refused or noted."""

import base64
import json
import struct

import numpy as np
import pytest
from model_imports import imported, refusal

pytestmark = pytest.mark.slow

CUBE = np.indices((2, 2, 2)).reshape(3, -1).T.astype("<f4")
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CORNERS = np.array([(a, b, c, a, c, d) for a, b, c, d in SIDES], "<u2").ravel()
# x grows with y. The columns of a glTF's matrix follow each other.
SHEAR = [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def address(data):
    return f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"


def cube(*, places=CUBE, material=None, **nodes_and_more):
    """Return the document of a cube from 0 to 1, with one node unless others are given."""
    arrays = [(places.astype("<f4"), "VEC3", 5126), (CORNERS, "SCALAR", 5123)]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0, "name": "cube"}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [],
        "bufferViews": [],
        "buffers": [],
    }
    for array, kind, component in arrays:
        added(document, array, kind, component)
    document["accessors"][0] |= {"min": places.min(0).tolist(), "max": places.max(0).tolist()}
    if material:
        document["materials"] = [material]
        primitive["material"] = 0
    return document | nodes_and_more


def added(document, values, kind, component=5126):
    """Add an accessor of values, and return its number."""
    data = np.asarray(values).astype("<f4" if component == 5126 else "<u2").tobytes()
    document["buffers"].append({"byteLength": len(data), "uri": address(data)})
    view = {"buffer": len(document["buffers"]) - 1, "byteLength": len(data)}
    document["bufferViews"].append(view)
    document["accessors"].append(
        {"bufferView": len(document["bufferViews"]) - 1, "componentType": component}
        | {"count": len(values), "type": kind}
    )
    return len(document["accessors"]) - 1


def written(path, document):
    text = json.dumps(document)
    if path.suffix == ".gltf":
        path.write_text(text)
    else:
        text += " " * (-len(text) % 4)
        head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
        path.write_bytes(head + text.encode())
    return path


# ---- places ---------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["gltf", "glb"])
@pytest.mark.parametrize("mirrored", [1, -1])
def test_a_shear_in_a_nodes_matrix_is_shown(tmp_path, suffix, mirrored):
    matrix = [*SHEAR[:10], mirrored, *SHEAR[11:]]
    document = cube(nodes=[{"mesh": 0, "matrix": matrix}])
    record = imported(written(tmp_path / f"a.{suffix}", document), unit="metres")
    back = sorted((0, -mirrored))
    np.testing.assert_allclose(record["box"], [[0, back[0], 0], [2, back[1], 1]], atol=1e-5)
    assert record["left_out"] == []


def test_a_shear_above_other_nodes_and_instances_is_shown(tmp_path):
    document = cube()
    extension = {"TRANSLATION": added(document, [(0, 0, 0), (0, 2, 0)], "VEC3")}
    document["nodes"] = [
        {"matrix": SHEAR, "children": [1]},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": extension}}},
    ]
    document["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    record = imported(written(tmp_path / "a.gltf", document), unit="metres")
    np.testing.assert_allclose(record["box"], [[0, -1, 0], [4, 0, 3]], atol=1e-5)


def test_a_sheared_bone_is_refused_by_its_mesh(tmp_path):
    document = cube()
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = added(document, np.zeros((8, 4), "<u2"), "VEC4", 5123)
    attributes["WEIGHTS_0"] = added(document, np.tile((1.0, 0, 0, 0), (8, 1)), "VEC4")
    document["skins"] = [{"joints": [1]}]
    document["nodes"] = [{"mesh": 0, "skin": 0, "name": "skinned"}, {"matrix": SHEAR}]
    document["scenes"] = [{"nodes": [0, 1]}]
    path = written(tmp_path / "a.gltf", document)
    assert "the mesh skinned: it reaches from (0, -1, 0) to (2, 0, 1)" in refusal(path)
    (left_out,) = imported(path, allow_missing=True)["left_out"]
    assert "skinned" in left_out


def turning(interpolation, values):
    """Return a cube that turns about its edge, the y axis, for a second."""
    document = cube()
    sampler = {
        "input": added(document, [0.0, 1.0], "SCALAR"),
        "output": added(document, values, "VEC4"),
        "interpolation": interpolation,
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": "rotation"}}
    document["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    return document


def test_a_wide_rotation_is_even_between_its_keys(tmp_path):
    """A quarter of 160° is 40°, and not what is on the way between the quaternions."""
    half = np.radians(80)
    document = turning("LINEAR", [(0, 0, 0, 1), (0, np.sin(half), 0, np.cos(half))])
    record = imported(written(tmp_path / "a.gltf", document), unit="metres", frame=6)
    side = np.cos(np.radians(40)) + np.sin(np.radians(40))
    assert record["box"][1][0] == pytest.approx(side, abs=1e-4)


def test_a_cubic_spline_has_its_tangents(tmp_path):
    """With tangents of 0, a quarter of the time is 5/32 of the way."""
    document = cube()
    rows = [(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0), (8, 0, 0), (0, 0, 0)]
    rows[2] = (16, 0, 0)
    sampler = {
        "input": added(document, [0.0, 1.0], "SCALAR"),
        "output": added(document, rows, "VEC3"),
        "interpolation": "CUBICSPLINE",
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    document["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    record = imported(written(tmp_path / "a.gltf", document), unit="metres", frame=6)
    # 8 · 5/32 by the end's value, and 16 · 9/64 by the tangent of the start.
    assert record["box"][0][0] == pytest.approx(8 * 5 / 32 + 16 * 9 / 64, abs=1e-4)


def test_a_node_that_no_scene_has_is_not_shown(tmp_path):
    document = cube(nodes=[{"mesh": 0, "name": "in"}, {"mesh": 0, "name": "out", "scale": [9] * 3}])
    record = imported(written(tmp_path / "a.gltf", document), unit="metres")
    np.testing.assert_allclose(record["box"], [[0, -1, 0], [1, 0, 1]], atol=1e-6)


# ---- what no view shows ---------------------------------------------------------------------

IGNORED = {
    "KHR_materials_iridescence": {"iridescenceFactor": 1},
    "KHR_materials_dispersion": {"dispersion": 1},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5},
    "KHR_materials_volume_scatter": {"multiscatterColor": [1, 0, 0]},
}


@pytest.mark.parametrize("name", IGNORED)
def test_an_optional_extension_that_no_view_shows_is_noted(tmp_path, name):
    document = cube(material={"name": "m", "extensions": {name: IGNORED[name]}})
    path = written(tmp_path / "a.gltf", document | {"extensionsUsed": [name]})
    assert imported(path)["left_out"] == [f"the extension {name}"]


def test_animations_after_the_first_are_noted(tmp_path):
    document = turning("LINEAR", [(0, 0, 0, 1), (0, 0, 0, 1)])
    (first,) = document["animations"]
    document["animations"] = [first | {"name": name} for name in ("walk", "run", "jump")]
    (noted,) = imported(written(tmp_path / "a.gltf", document))["left_out"]
    assert noted == "the animations run, jump: only the first, walk, moves the model"


# ---- lengths of materials -------------------------------------------------------------------


def seen_through():
    """Render the middle of the open scene before a world of white. Returns red, green and blue."""
    import bpy

    scene = bpy.context.scene
    world = bpy.data.worlds.new("white")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.world = world
    for obj in [obj for obj in bpy.data.objects if obj.type == "LIGHT"]:
        bpy.data.objects.remove(obj)
    camera = bpy.data.cameras.new("front")
    camera.type = "ORTHO"
    camera.ortho_scale = 0.01
    camera.clip_start = 0.001
    scene.camera = bpy.data.objects.new("front", camera)
    scene.collection.objects.link(scene.camera)
    low, high = (np.array(corner) for corner in box())
    scene.camera.location = ((low + high) / 2) * (1, 0, 1) - (0, 3, 0)
    scene.camera.rotation_euler = (np.pi / 2, 0, 0)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(bpy.app.tempdir) + "glass.exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    return np.array(image.pixels[:]).reshape(-1, 4)[:, :3].mean(0)


def box():
    from lightfield.rendering.models.second_readers import compare
    from lightfield.rendering.scenes.render_graph import in_render

    (mesh,) = in_render(compare.shown_meshes)
    return mesh.box


@pytest.mark.parametrize("unit", ["metres", "box"])
def test_glass_has_its_colour_whatever_the_scale(tmp_path, unit):
    """Light goes through 10 cm of glass, of which 20 cm let 0.366 of the red through."""
    glass = {
        "name": "glass",
        "pbrMetallicRoughness": {"roughnessFactor": 0, "metallicFactor": 0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_ior": {"ior": 1},
            "KHR_materials_volume": {
                "thicknessFactor": 1,
                "attenuationDistance": 0.2,
                "attenuationColor": [0.366, 0.9, 0.5],
            },
        },
    }
    document = cube(places=CUBE * np.float32(0.1), material=glass)
    document["extensionsUsed"] = list(glass["extensions"])
    assert imported(written(tmp_path / "a.gltf", document), unit=unit)["left_out"] == []
    np.testing.assert_allclose(seen_through(), np.sqrt([0.366, 0.9, 0.5]), atol=0.02)
