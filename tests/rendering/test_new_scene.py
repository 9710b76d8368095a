"""A user's own file gets a scene YAML, which is checked, commented, and builds."""

import json
import subprocess
import sys
from contextlib import chdir

import numpy as np
import pytest
import yaml
from checkouts import checkout, snakemake

from lightfield.configuration.scene_yaml import check_scene
from lightfield.formats.lightfield import LightField

pytestmark = pytest.mark.slow

# A box of 1.2 × 0.8 × 0.5 m, open above.
OBJ = """v 0 0 0
v 1.2 0 0
v 1.2 0 0.8
v 0 0 0.8
v 0 0.5 0
v 1.2 0.5 0
v 1.2 0.5 0.8
v 0 0.5 0.8
f 1 2 3 4
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A checkout with a model file, a .blend with a camera, and one without."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    folder = checkout(tmp_path_factory.mktemp("new") / "plenoforge")
    (folder / "my desk.obj").write_text(OBJ)
    blend_file.new_scene()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(2, 3, 0.5))
    bpy.ops.object.light_add(type="SUN")
    blend_file.save_scene(folder / "alone.blend")
    bpy.ops.object.camera_add(location=(2, -2, 1), rotation=(np.radians(80), 0, 0))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = 300, 200
    blend_file.save_scene(folder / "shot.blend")
    return folder


def new_scene(folder, *arguments):
    program = [sys.executable, "scripts/new_scene.py", *map(str, arguments)]
    return subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)


def written(folder, name, *arguments):
    """Run the program. Return its output, and the YAML's content, which passes the check."""
    result = new_scene(folder, *arguments)
    assert result.returncode == 0, result.stderr
    text = (folder / f"configs/scenes/{name}.yaml").read_text()
    assert text.count("#") >= 5
    with chdir(folder):
        check_scene(text, name)
    return result.stdout, yaml.safe_load(text)


def built(folder, said, rig):
    """Run the first command that the program printed. Return the views of a valid dataset."""
    command, planned = [line.strip() for line in said.splitlines() if "snakemake " in line]
    words = command.removeprefix("snakemake ").split()
    assert "preset=tiny" in words and "-n" in planned.split()
    result = snakemake(folder, *words)
    assert result.returncode == 0, result.stdout + result.stderr
    (scene,) = [word.removeprefix("scenes=") for word in words if word.startswith("scenes=")]
    path = folder / f"results/{scene}_tiny/{rig}/validation.json"
    assert json.loads(path.read_text())["valid"]
    return LightField.read(path.parent / "lightfield.json"), result.stdout + result.stderr


def test_a_model_file(project):
    said, content = written(project, "my_desk", "my desk.obj", "--export", "colmap")
    assert "1.2 × 0.8 × 0.5" in said
    assert content["scene"]["model"] == "my desk.obj"
    assert [*content["exports"]] == ["colmap"]
    lightfield, printed = built(project, said, "around")
    assert "cut the model" not in printed
    assert {view.split for view in lightfield.views} == {"train", "test"}
    assert any((project / "results/my_desk_tiny/around/exports").glob("colmap*"))


def test_a_blend_with_a_camera(project):
    """The wall of cameras is around the camera, looks as it does, and sees what it sees."""
    said, content = written(project, "shot", "shot.blend", "--export", "nerfstudio")
    rig = content["rigs"]["front"]
    assert rig["camera"]["resolution"] == [800, 534]
    lightfield, _ = built(project, said, "front")
    places = lightfield.world_from_cameras
    np.testing.assert_allclose(places[:, :3, 3].mean(axis=0), [2, -2, 1], atol=1e-5)
    ahead = [0, np.sin(np.radians(80)), -np.cos(np.radians(80))]
    np.testing.assert_allclose(-places[:, :3, 2], np.tile(ahead, (len(places), 1)), atol=1e-5)
    assert rig["camera"]["focal_length"] == 50
    assert rig["camera"]["sensor_size"] == pytest.approx([36, 24.03], abs=0.02)


def test_a_blend_without_a_camera(project):
    said, content = written(project, "alone", "alone.blend")
    assert "exports" not in content
    lightfield, _ = built(project, said, "around")
    distances = np.linalg.norm(lightfield.world_from_cameras[:, :3, 3] - (2, 3, 0.5), axis=1)
    np.testing.assert_allclose(distances, distances[0], rtol=1e-5)


def test_a_model_without_its_texture_gets_a_yaml_that_builds(project):
    """The YAML renders without the texture, and the program names it."""
    points = np.float32([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1]).tobytes()
    views = [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}]
    accessor = {"componentType": 5126, "count": 3}
    content = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "lost.png"}],
        "buffers": [{"uri": "points.bin", "byteLength": 60}],
        "bufferViews": views,
        "accessors": [
            {**accessor, "bufferView": 0, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {**accessor, "bufferView": 1, "type": "VEC2"},
        ],
    }
    (project / "points.bin").write_bytes(points)
    (project / "bare.gltf").write_text(json.dumps(content))
    said, content = written(project, "bare", "bare.gltf")
    (note,) = [line for line in said.splitlines() if line.startswith("note: ")]
    assert "bare.gltf: " in note and "lost.png" in note
    assert content["scene"]["allow_missing"] is True
    built(project, said, "around")


def test_a_blend_without_its_texture_gets_a_yaml_that_builds(project):
    """What is hidden needs no texture."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    blend_file.open_scene(project / "alone.blend")
    (cube,) = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    hidden = cube.copy()
    hidden.data = cube.data.copy()
    hidden.hide_render = True
    bpy.context.collection.objects.link(hidden)
    for obj, name in ((cube, "lost.png"), (hidden, "unused.png")):
        image = bpy.data.images.new(name, 4, 4)
        image.source = "FILE"
        image.filepath = f"//{name}"
        material = bpy.data.materials.new(name)
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        shader = material.node_tree.nodes["Principled BSDF"]
        material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        obj.data.materials.append(material)
    blend_file.save_scene(project / "bare.blend")
    said, content = written(project, "torn", "bare.blend", "--scene", "torn")
    (note,) = [line for line in said.splitlines() if line.startswith("note: ")]
    assert "bare.blend: 1 of the files" in note and "lost.png" in note and "unused" not in note
    assert content["scene"]["allow_missing"] is True
    built(project, said, "around")


@pytest.mark.parametrize(
    ("view", "look", "title"),
    [
        ("AgX", "AgX - Punchy", "AgX - Punchy"),
        ("Filmic", "None", "Filmic"),
        ("Standard", "None", None),
    ],
)
def test_the_look_of_a_blend_is_offered(project, view, look, title):
    """Without its comment signs, the offer is a reprojection with this look."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    blend_file.open_scene(project / "alone.blend")
    settings = bpy.context.scene.view_settings
    settings.view_transform, settings.look = view, look
    name = f"shown_{view}"
    blend_file.save_scene(project / f"{name}.blend")
    _, content = written(project, name, f"{name}.blend")
    assert "reprojections" not in content and "allow_missing" not in content["scene"]
    text = (project / f"configs/scenes/{name}.yaml").read_text()
    lines = text.splitlines()
    if title is None:
        assert "look" not in text.partition("rigs:")[2].replace("look at", "")
        return
    start = lines.index("# reprojections:")
    assert lines[start + 1].endswith(f": {title}")
    for number in (start, start + 1):
        lines[number] = lines[number].removeprefix("# ")
    with chdir(project):
        scene = check_scene("\n".join(lines), name)
    assert scene.reprojections["pictures"].look == "file"


def test_a_folder_of_views(project):
    """The views are SILVR's: fisheyes, which an export needs through a perspective lens."""
    (project / "configs/scenes/wide.yaml").write_text(
        "scene: {builder: room}\nrender: {samples: 1}\nrigs:\n  around: {type: sphere, "
        "subdivisions: 1, size: 0.5, center: [0, 0, 1.2], camera: {lens: equidistant, fov: 180, "
        "resolution: [32, 32]}}\n"
    )
    result = snakemake(project, "--config", "scenes=wide", "preset=full")
    assert result.returncode == 0, result.stderr
    arguments = ("results/wide", "--scene", "theirs", "--export", "instant_ngp")
    said, content = written(project, "theirs", *arguments)
    assert content["scene"] == {"dataset": "results/wide"}
    assert content["exports"]["instant_ngp"]["sources"] == ["perspective"]
    built(project, said, "around")


def refusal(folder, *arguments):
    before = sorted((folder / "configs/scenes").iterdir())
    result = new_scene(folder, *arguments)
    assert result.returncode == 1
    assert sorted((folder / "configs/scenes").iterdir()) == before
    (line,) = result.stderr.splitlines()
    return line


def test_an_existing_yaml_is_never_overwritten(project):
    path = project / "configs/scenes/mine.yaml"
    path.write_text("scene: {builder: room}\n")
    said = refusal(project, "my desk.obj", "--scene", "mine")
    assert "configs/scenes/mine.yaml: exists" in said and "--scene" in said
    assert path.read_text() == "scene: {builder: room}\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.glb"], "missing.glb: does not exist"),
        (["config.yaml"], "config.yaml: must be a .blend, a model file"),
        (["scripts"], "scripts: has no lightfield.json"),
        (["poses"], "poses: has poses in transforms.json, but no lightfield.json"),
        (["my desk.obj", "--scene", "a/b"], '--scene: is "a/b"; must be a name of letters'),
        (["my desk.obj", "--scene", "n", "--export", "dnerf"], "exports.dnerf"),
        (["cut.glb"], "cut.glb: "),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, list) else None,
)
def test_what_gets_no_yaml_is_said_in_one_line(project, arguments, said):
    (project / "poses").mkdir(exist_ok=True)
    (project / "poses" / "transforms.json").write_text("{}")
    (project / "cut.glb").write_bytes(b"glTF\2\0\0\0")
    assert said in refusal(project, *arguments)
