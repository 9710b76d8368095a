"""A file that a .blend reads, and that is damaged, is refused by its name. Whole ones are taken."""

import json
import shutil
from pathlib import Path

import pytest
from conftest import BLENDER

from lightfield.core.errors import UserError
from lightfield.stages.scene import InventorySettings

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(run_program, tmp_path_factory):
    """A folder with a .blend for each kind of file."""
    folder = tmp_path_factory.mktemp("made")
    run_program(BLENDER / "file_scenes.py", folder)
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """A copy for each test, because Blender keeps what it has read by its path."""
    return Path(shutil.copytree(made, tmp_path / "scenes"))


@pytest.fixture
def listed(folder, tmp_path):
    """Return a function that makes the inventory of a .blend. It returns it, or the error."""
    from lightfield.rendering.inspection import inventory_file

    def listed(name):
        output = tmp_path / "inventory.json"
        output.unlink(missing_ok=True)
        blend = folder / f"{name}.blend"
        try:
            inventory_file.write(blend, InventorySettings(), [], output, measures_memory=False)
        except UserError as error:
            assert not output.exists()
            return str(error)
        return json.loads(output.read_text())

    return listed


def cut(content):
    return content[: int(len(content) * 0.6)]


def cut_in_a_row(content):
    return content[: content.index(b"\n50,") + 3]


def text(content):
    return b"This is a text.\n"


FILES = {
    "mp4": ("mp4.mp4", "texture", "is cut short"),
    "mkv": ("mkv.mkv", "texture", "is cut short"),
    "avi": ("avi.avi", "texture", "is cut short"),
    "pictures": ("flip_003.png", "texture", "cannot be read"),
    "abc": ("abc.abc", "cache", "is cut short"),
    "usdc": ("usdc.usdc", "cache", "is cut short"),
    "mdd": ("mdd.mdd", "modifier's file", "is cut short"),
    "pc2": ("pc2.pc2", "modifier's file", "is cut short"),
    "stl": ("stl.stl", "geometry", "is cut short"),
    "ply": ("ply.ply", "geometry", "may be cut short"),
    "obj": ("obj.obj", "geometry", "is cut short"),
    "csv": ("csv.csv", "geometry", "row 52 has 1 values of 2"),
    "import_vdb": ("import_vdb.vdb", "geometry", "may be cut short"),
    "vdb": ("vdb.vdb", "volume", "may be cut short"),
    "sequence": ("smoke_003.vdb", "volume", "may be cut short"),
    "ies": ("ies.ies", "light profile", "is cut short"),
    "osl": ("osl.osl", "shader", "cannot be compiled"),
    "external": ("blendcache_cloth/7361696C_000001_00.bphys", "simulation", "is cut short"),
    "cloth": ("blendcache_cloth/7361696C_000001_00.bphys", "simulation", "is cut short"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_whole_file_is_taken(name, listed):
    assert listed(name)["missing"] == []


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("damage", [cut, text])
def test_a_damaged_file_is_refused_by_its_name(name, damage, folder, listed):
    name_of_file, kind, problem = FILES[name]
    file = folder / name_of_file
    damage = cut_in_a_row if name == "csv" and damage == cut else damage
    file.write_bytes(damage(file.read_bytes()))
    error = listed(name)
    assert f"the {kind} " in error
    assert f" at {file} (" in error
    assert damage == text or problem in error


@pytest.mark.parametrize("name", ["mdd", "pc2", "external"])
def test_a_file_that_lacks_its_last_byte_is_refused(name, folder, listed):
    file = folder / FILES[name][0]
    file.write_bytes(file.read_bytes()[:-1])
    assert "is cut short" in listed(name)


def test_a_damaged_file_of_a_library_in_another_folder_is_refused(folder, listed):
    """The library names it by its own place, and its suffix does not tell what it is."""
    import bpy

    (folder / "library").mkdir()
    content = (folder / "ies.ies").read_bytes()
    (folder / "library/lamp.profile").write_bytes(cut(content))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "ies.blend"))
    (spot,) = (obj for obj in bpy.data.objects if obj.type == "LIGHT" and obj.data.type == "SPOT")
    name, lamp = spot.name, spot.data
    (node,) = (each for each in lamp.node_tree.nodes if each.bl_idname == "ShaderNodeTexIES")
    node.filepath = "//lamp.profile"
    library = str(folder / "library/lamps.blend")
    bpy.data.libraries.write(library, {spot})
    bpy.data.objects.remove(spot)
    bpy.data.lights.remove(lamp)
    with bpy.data.libraries.load(library, link=True, relative=True) as (_, wanted):
        wanted.objects = [name]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "main.blend"))
    error = listed("main")
    assert "the light profile " in error
    assert "is cut short" in error


@pytest.mark.parametrize(
    ("name", "shown", "other"),
    [
        ("pictures", "flip_003.png", "flip_005.png"),
        ("sequence", "smoke_003.vdb", "smoke_005.vdb"),
        (
            "cloth",
            "blendcache_cloth/7361696C_000001_00.bphys",
            "blendcache_cloth/7361696C_000004_00.bphys",
        ),
    ],
)
def test_only_the_frames_that_are_shown_must_exist(name, shown, other, folder, listed):
    (folder / other).unlink()
    assert listed(name)["missing"] == []
    (folder / shown).unlink()
    assert f" at {folder / shown} (missing)" in listed(name)


@pytest.mark.parametrize("name", ["cloth", "external"])
def test_the_missing_folder_of_a_simulation_is_named_once(name, folder, listed):
    shutil.rmtree(folder / "blendcache_cloth")
    assert listed(name).count(f"{folder / 'blendcache_cloth'} (missing)") == 1


def test_a_file_that_no_pixel_needs_may_be_missing(folder, listed):
    assert listed("unneeded")["missing"] == []
    error = listed("needed")
    names = ("squash.mdd", "bumps.png", "muted_node.png", "muted_link.png")
    for name in (*names, "hidden.stl", "muted.ply", "loose.ies"):
        assert f" at {folder / name} (missing)" in error
    assert error.count(" (missing)") == 7
