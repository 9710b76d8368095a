"""What a scene contains, what pruning leaves out, and that this changes no pixel."""

import json
import os
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from checkouts import checkout, planned
from conftest import BLENDER

from lightfield.core.files import sha256
from lightfield.engine.bundles import VARIABLE
from lightfield.rendering.setup import pruning

NOTHING = {
    "hidden": [],
    "animated": [],
    "simulated": [],
    "uses_visibility": [],
    "motion_blur": False,
}


@pytest.mark.parametrize(
    ("contains", "expected"),
    [
        ({}, ["viewport"]),
        ({"hidden": ["cutter"]}, ["viewport", "hidden_objects"]),
        ({"motion_blur": True}, ["viewport", "motion_blur"]),
        ({"animated": ["Water"]}, ["viewport", "animation"]),
        ({"animated": ["Water"], "motion_blur": True}, ["viewport"]),
        ({"simulated": ["Cloth"], "motion_blur": True}, ["viewport"]),
        ({"simulated": ["Cloth"], "animated": ["Wind"]}, ["viewport"]),
        ({"animated": ["Door"], "uses_visibility": ["Door"]}, ["animation"]),
    ],
)
def test_the_content_decides_what_is_left_out(contains, expected):
    assert pruning.left_out(NOTHING | contains) == expected


@pytest.fixture(scope="module")
def scenes(run_program, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pruned")
    run_program(BLENDER / "pruned_renders.py", folder)
    return json.loads((folder / "results.json").read_text())


@pytest.mark.parametrize("name", ["plain", "left_behind", "animated", "blurred", "features"])
def test_a_pruned_render_equals_the_unpruned_one(name, scenes):
    assert scenes[name]["same"]


def test_leftovers_of_artists_are_found_and_left_out(scenes):
    result = scenes["left_behind"]
    assert result["left_out"] == ["viewport", "hidden_objects", "motion_blur"]
    # Objects that a modifier or an instancer needs stay, although no ray hits them directly.
    assert result["inventory"]["hidden"] == ["hidden", "in excluded", "in off", "unseen"]
    assert "only hidden" not in result["materials"]
    # The room's seven, the modifier's cutter, the instanced object, its instancer, our camera, and
    # an object for each kind of ray that hits nothing else.
    assert result["objects"] == 11 + 6


def test_an_animation_is_frozen_at_the_frame_of_the_dataset(scenes):
    result = scenes["animated"]
    assert result["left_out"] == ["viewport", "animation"]
    assert set(result["inventory"]["animated"]) == {"cone", "sphere", "Key", "pillar", "torus"}
    # Objects hidden in the viewport are not evaluated, so their values are unknown. They stay.
    assert result["animated"] == ["torus"]


def test_objects_under_motion_blur_are_not_frozen(scenes):
    result = scenes["blurred"]
    assert result["left_out"] == ["viewport"]
    assert result["animated"] == ["cone"]


def test_features_are_listed_with_their_materials(scenes):
    scene_inventory = scenes["features"]["inventory"]
    assert {
        name: scene_inventory[name] for name in ("transmission", "subsurface", "transparency")
    } == {
        "transmission": ["sphere"],
        "subsurface": ["cone"],
        "transparency": ["box"],
    }
    assert scene_inventory["volumes"] == ["torus"]
    assert scene_inventory["displacement"] == ["pillar"]
    assert scene_inventory["emission"] == ["walls"]
    plain = scenes["plain"]["inventory"]
    names = ("transmission", "subsurface", "transparency", "volumes", "displacement", "emission")
    assert not any(plain[name] for name in names)
    assert plain["objects"] == 6
    assert len(plain["lights"]) == 1
    assert plain["sampling"].keys() == {"max_bounces", "clamp_indirect", "light_tree", "guiding"}


MISSING = """
import sys
sys.path.insert(0, sys.argv[2])
import bpy
from scenes import room

folder = sys.argv[1]
bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
image = bpy.data.images.new("bark", 4, 4)
image.filepath_raw, image.file_format = folder + "/bark.png", "PNG"
image.save()
image.source = "FILE"
tree = bpy.data.materials["cone"].node_tree
texture = tree.nodes.new("ShaderNodeTexImage")
texture.image = image
tree.links.new(texture.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
from pathlib import Path
font = next(Path(bpy.utils.system_resource("DATAFILES"), "fonts").glob("DejaVuSansMono*"))
Path(folder, "font.woff2").write_bytes(font.read_bytes())
text = bpy.data.curves.new("sign", "FONT")
text.font = bpy.data.fonts.load(folder + "/font.woff2")
bpy.context.scene.collection.objects.link(bpy.data.objects.new("sign", text))
unused = image.copy()
unused.name, unused.filepath_raw, unused.use_fake_user = "unused", folder + "/never.png", True
tree = bpy.data.node_groups.new("baked", "GeometryNodeTree")
tree.nodes.new("GeometryNodeBake")
bpy.data.objects["cone"].modifiers.new("baked", "NODES").node_group = tree
Path(folder, "blendcache_textured").mkdir()
Path(folder, "blendcache_textured/leaves.json").write_text("{}")
bpy.ops.wm.save_as_mainfile(filepath=folder + "/textured.blend", relative_remap=False)

bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
bpy.data.libraries.write(folder + "/library.blend", {bpy.data.objects["cone"]})
bpy.ops.wm.read_factory_settings(use_empty=True)
with bpy.data.libraries.load(folder + "/library.blend", link=True) as (_, wanted):
    wanted.objects = ["cone"]
bpy.context.scene.collection.objects.link(wanted.objects[0])
bpy.ops.wm.save_as_mainfile(filepath=folder + "/linked.blend", relative_remap=False)

tree = bpy.data.node_groups.new("tree", "GeometryNodeTree")
tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
leaf = tree.nodes.new("GeometryNodeImportSTL")
leaf.inputs[0].default_value = folder + "/leaf.stl"
tree.links.new(leaf.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
room.build({})
bpy.data.objects["cone"].modifiers.new("tree", "NODES").node_group = tree
tree = bpy.data.node_groups.new("any tree", "GeometryNodeTree")
socket = tree.interface.new_socket("Path", in_out="INPUT", socket_type="NodeSocketString")
socket.subtype = "FILE_PATH"
given = bpy.data.objects["sphere"].modifiers.new("given", "NODES")
given.node_group = tree
if bpy.app.version < (5, 2):
    given[socket.identifier] = folder + "/bough.stl"
else:
    getattr(given.properties.inputs, socket.identifier).value = folder + "/bough.stl"
tiles = bpy.data.images.new("tiles", 4, 4, tiled=True)
tiles.filepath, tiles.source = folder + "/tile.<UVTILE>.png", "TILED"
tiles.tiles.new(1012)
texture = bpy.data.materials["cone"].node_tree.nodes.new("ShaderNodeTexImage")
texture.image = tiles
shader = bpy.data.materials["cone"].node_tree.nodes["Principled BSDF"]
bpy.data.materials["cone"].node_tree.links.new(texture.outputs[0], shader.inputs["Base Color"])
bpy.ops.mesh.primitive_cube_add()
bpy.context.object.modifiers.new("fine", "MULTIRES")
bpy.ops.object.multires_subdivide(modifier="fine")
bpy.ops.wm.save_as_mainfile(filepath=folder + "/imports.blend", relative_remap=False)
bpy.ops.object.multires_external_save(modifier="fine", filepath=folder + "/fine.btx")
bpy.ops.wm.save_as_mainfile(filepath=folder + "/imports.blend", relative_remap=False)
"""


def test_missing_or_unreadable_files_are_an_error(run_program, tmp_path, monkeypatch):
    (tmp_path / "make.py").write_text(MISSING)
    scripts = Path(pruning.__file__).parents[2]
    run_program(tmp_path / "make.py", tmp_path, scripts)
    output = tmp_path / "inventory.json"

    def listed(name):
        arguments = ("--blend", tmp_path / f"{name}.blend", "--output", output)
        result = run_program("inventory.py", *arguments, check=False)
        return result.returncode, (result.stderr.splitlines() or [""])[-1]

    assert listed("textured")[0] == 0
    external_files = json.loads(output.read_text())["external_files"]
    names = ["bark.png", "leaves.json", "font.woff2", "never.png"]
    assert [Path(file["path"]).name for file in external_files] == names
    assert external_files[0]["sha256"] == sha256(tmp_path / "bark.png")
    assert external_files[3]["sha256"] is None
    output.unlink()

    monkeypatch.setenv(VARIABLE, str(tmp_path / "store"))
    code, errors = listed("textured")
    assert code == 1
    assert errors.startswith(f"error: {tmp_path}/textured.blend: reads {tmp_path}/")
    assert "; with a storage, what a .blend reads must lie in this folder" in errors
    monkeypatch.delenv(VARIABLE)

    bark, font = tmp_path / "bark.png", tmp_path / "font.woff2"
    texture = f"the texture bark at {bark}"
    letters = f"the font DejaVu Sans Mono Book at {font}"
    # Cycles would show a part of a photograph that was copied incompletely.
    photograph = tmp_path / "photograph.jpg"
    oiio.ImageBuf(np.zeros((64, 64, 3), np.uint8)).write(str(photograph))
    bark.write_bytes(photograph.read_bytes()[:-100])
    font.write_text("no letters")
    start = (
        f"error: {tmp_path}/{{}}.blend: {{}} of the files that it shows are missing or cannot be"
    )
    for problem in ("cannot be read", "missing"):
        code, errors = listed("textured")
        assert code == 1
        assert errors.startswith(
            f"{start.format('textured', 2)} read: {letters} ({problem}); {texture} ({problem}); "
        )
        assert "scene: {allow_missing: true}" in errors
        bark.unlink(missing_ok=True)
        font.unlink(missing_ok=True)
    written = bark.with_name("Bark.PNG")
    written.touch()
    assert f"; {texture} (missing) ({written} differs only in case); " in listed("textured")[1]
    (tmp_path / "library.blend").unlink()
    code, errors = listed("linked")
    assert code == 1
    assert errors.startswith(
        f"{start.format('linked', 1)} read: the library library.blend at {tmp_path}/library.blend "
    )
    (tmp_path / "fine.btx").unlink()
    code, errors = listed("imports")
    assert code == 1
    assert f" read: the geometry tree at {tmp_path}/leaf.stl (missing); " in errors
    assert f"; the modifier's file sphere at {tmp_path}/bough.stl (missing); " in errors
    assert f"; the texture tiles at {tmp_path}/tile.u2_v2.png (missing)" in errors
    assert f"; the sculpted detail Cube at {tmp_path}/fine.btx (missing); " in errors
    assert not output.exists()


PACKED = """
import sys
import bpy

folder, sources = sys.argv[1:]
sys.path.insert(0, sources)
from scenes import room

def link(name, pack):
    with bpy.data.libraries.load(folder + "/library.blend", link=True, pack=pack) as (_, wanted):
        wanted.objects = [name]
    bpy.context.scene.collection.objects.link(wanted.objects[0])

bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
shapes = {bpy.data.objects[name] for name in ("cone", "sphere")}
bpy.data.libraries.write(folder + "/library.blend", shapes)
for shape in shapes:
    bpy.data.objects.remove(shape)
link("cone", pack=True)
bpy.ops.wm.save_as_mainfile(filepath=folder + "/packed.blend")
link("sphere", pack=False)
bpy.ops.wm.save_as_mainfile(filepath=folder + "/also_linked.blend")
"""


def test_the_library_of_packed_objects_is_not_read(run_program, tmp_path):
    (tmp_path / "make.py").write_text(PACKED)
    run_program(tmp_path / "make.py", tmp_path, Path(pruning.__file__).parents[2])
    (tmp_path / "library.blend").unlink()
    output = tmp_path / "inventory.json"
    arguments = ("--blend", tmp_path / "packed.blend", "--output", output)
    run_program("inventory.py", *arguments)
    inventory = json.loads(output.read_text())
    assert inventory["external_files"] == inventory["missing"] == []
    assert inventory["objects"] == 5
    # An object that is only linked still needs it.
    arguments = ("--blend", tmp_path / "also_linked.blend", "--output", output)
    result = run_program("inventory.py", *arguments, check=False)
    assert f"the library library.blend at {tmp_path}/library.blend (missing)" in result.stderr


SPECIAL = """
import sys
import bpy

blend, sources, kind, path = sys.argv[1:]
sys.path.insert(0, sources)
from scenes import room

bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
if kind == "geometry":
    tree = bpy.data.node_groups.new("part", "GeometryNodeTree")
    tree.nodes.new("GeometryNodeImportSTL").inputs[0].default_value = path
    bpy.data.objects["cone"].modifiers.new("part", "NODES").node_group = tree
else:
    tree = bpy.data.materials["cone"].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("part", 4, 4)
    texture.image.source, texture.image.filepath_raw = "FILE", path
    tree.links.new(texture.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
bpy.ops.wm.save_as_mainfile(filepath=blend)
"""


@pytest.mark.parametrize(
    ("kind", "path", "problem"),
    [
        ("geometry", "FOLDER/fifo", "the geometry part is at FOLDER/fifo, which is a FIFO"),
        ("texture", "FOLDER/fifo", "the texture part is at FOLDER/fifo, which is a FIFO"),
        ("texture", "/dev/zero", "dev/zero, which is a device"),
        # All files of the disk lie below it.
        ("texture", "/", "the texture part at / (is a folder)"),
    ],
)
def test_no_texture_or_geometry_is_read_without_end(run_program, tmp_path, kind, path, problem):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "make.py").write_text(SPECIAL)
    blend = tmp_path / "a.blend"
    sources = Path(pruning.__file__).parents[2]
    path = path.replace("FOLDER", str(tmp_path))
    run_program(tmp_path / "make.py", blend, sources, kind, path)
    arguments = ("--blend", blend, "--output", tmp_path / "inventory.json")
    result = run_program("inventory.py", *arguments, check=False)
    assert result.returncode == 1
    assert problem.replace("FOLDER", str(tmp_path)) in result.stderr.splitlines()[-1]


MINIMAL = """
scene: {builder: room}
render: {samples: 1, depth: none}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
exports: {instant_ngp: {sources: [views]}}
"""


@pytest.mark.slow
def test_a_minimal_scene_plans_only_its_own_stages(tmp_path):
    folder = checkout(tmp_path, minimal=MINIMAL)
    jobs = planned(folder, "--config", "scenes=[minimal]", "rigs=all", "preset=full")
    assert {"build_scene", "render", "validate"} <= jobs.keys()
    assert jobs["export_to_instant_ngp"] == 1
    absent = ("lens_map", "reproject", "reprojected_lightfield", "check_blend")
    assert not any(name in jobs for name in absent)
