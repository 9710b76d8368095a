"""Mattes of objects that have one name in several libraries."""

import json

import numpy as np
import one_shard
import pytest

from lightfield.core.files import read_json
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images

pytestmark = pytest.mark.slow

SAMPLES = 8
CAMERA = {"lens": "rectilinear", "fov": 60, "resolution": [96, 96]}
# Cubes of one name: their full names, and their places from left to right.
CUBES = {"LibCube [lib3.blend]": -1.4, "LibCube": 0, "LibCube [lib4.blend]": 1.4}


def murmur3(name):
    """Return MurmurHash3_x86_32 of a name with seed 0, as its author defines it."""
    data = name.encode()
    whole = len(data) // 4 * 4
    words = [int.from_bytes(data[at : at + 4], "little") for at in range(0, whole, 4)]
    code = 0

    def mixed(word):
        word = word * 0xCC9E2D51 & 0xFFFFFFFF
        word = (word << 15 | word >> 17) & 0xFFFFFFFF
        return word * 0x1B873593 & 0xFFFFFFFF

    for word in words:
        code ^= mixed(word)
        code = (code << 13 | code >> 19) & 0xFFFFFFFF
        code = code * 5 + 0xE6546B64 & 0xFFFFFFFF
    code ^= mixed(int.from_bytes(data[whole:], "little")) if data[whole:] else 0
    code ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        code = (code ^ code >> shift) * factor & 0xFFFFFFFF
    return code ^ code >> 16


def as_float(code):
    """Return a hash as Cryptomatte stores it: an exponent of 0 or 255 has its lowest bit flipped.

    Source: "Cryptomatte Specification" by Psyop, version 1.2.0.
    """
    if code >> 23 & 255 in (0, 255):
        code ^= 1 << 23
    return np.uint32(code).view(np.float32)


def coverage(channels, name):
    """Return which part of each pixel a matte says that an object covers."""
    total = 0
    for rank in range(6):
        ids, parts = ("RG", "BA")[rank % 2]
        layer = f"CryptoObject{rank // 2:02d}"
        is_name = channels[f"{layer}.{ids}"] == as_float(murmur3(name))
        total = total + np.where(is_name, channels[f"{layer}.{parts}"], 0)
    return total


def write_scene(folder, libraries):
    """Save main.blend: three cubes of one name, two of them linked, whose colours are random."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    def add_cube(x):
        bpy.ops.mesh.primitive_cube_add(size=1, location=(x, 0, 0))
        cube = bpy.context.object
        cube.name = "LibCube"
        material = bpy.data.materials.new("LibMaterial")
        nodes = material.node_tree.nodes
        glow = nodes.new("ShaderNodeEmission")
        info = nodes.new("ShaderNodeObjectInfo")
        link = material.node_tree.links.new
        link(info.outputs["Random"], glow.inputs["Strength"])
        link(glow.outputs[0], material.node_tree.get_output_node("CYCLES").inputs["Surface"])
        cube.data.materials.append(material)

    for name in ("lib3", "lib4"):
        blend_file.new_scene()
        add_cube(CUBES[f"LibCube [{name}.blend]"])
        blend_file.save_scene(folder / f"{name}.blend")
    blend_file.new_scene()
    add_cube(CUBES["LibCube"])
    for name in libraries:
        path = str(folder / f"{name}.blend")
        with bpy.data.libraries.load(path, link=True) as (_, wanted):
            wanted.objects = ["LibCube"]
        bpy.context.scene.collection.objects.link(wanted.objects[0])
    blend_file.save_scene(folder / "main.blend")


def rendered(folder, *passes):
    """Render two views of main.blend into a new folder. Return its path."""

    rig = rigs.from_settings(
        {"type": "plane", "cameras": [2, 1], "size": [0.6, 1, 1], "center": [0, -4, 0.3]}
    )
    render = {
        "samples": SAMPLES,
        "seed": 0,
        "adaptive_threshold": 0,
        "denoise": False,
        "depth_precision": "float",
        "passes": list(passes),
    }
    views = LightField.from_rig(rig, lenses.from_camera(CAMERA), frame=1, render=render, depth="z")
    target = folder / "-".join(["made", *passes])
    one_shard.render(views, target, folder / "main.blend")
    return target


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("namesakes")
    write_scene(folder, ("lib3", "lib4"))
    return folder


@pytest.mark.parametrize("view", ["view_0000f", "view_0001f"])
def test_objects_of_one_name_have_entries_of_their_own(view, made):
    dataset = rendered(made, "object", "cryptomatte")
    image = images.read_image(dataset / "cryptomatte" / f"{view}.exr")
    manifest = json.loads(image.attributes["cryptomatte/3ae39a5/manifest"])
    numbers = images.read_image(dataset / "object" / f"{view}.exr").channels["Y"]
    names = read_json(dataset / "object" / "names.json")
    assert set(CUBES) <= set(names)
    places = []
    for name in CUBES:
        assert manifest[name] == f"{murmur3(name):08x}"
        part = coverage(image.channels, name)
        is_object = numbers == names[name]
        assert is_object.sum() > 100
        # Only edges have parts between, which are multiples of a sample.
        assert np.abs(part * SAMPLES - np.rint(part * SAMPLES)).max() < 1e-4
        assert ((part > 0.5) == is_object).mean() > 0.99
        assert abs(part.sum() - is_object.sum()) < 0.02 * is_object.sum()
        places.append((part.sum(axis=0) * np.arange(96)).sum() / part.sum())
    assert places == sorted(places)


def test_telling_names_apart_does_not_change_the_picture(made):
    """The cubes' colours depend on their names."""
    with_mattes, without = rendered(made, "cryptomatte"), rendered(made)
    for view in ("view_0000f", "view_0001f"):
        pictures = [
            images.read_image(each / "exr" / f"{view}.exr") for each in (with_mattes, without)
        ]
        for name in "RGBZ":
            np.testing.assert_array_equal(*(picture.channels[name] for picture in pictures))
        assert len(np.unique(pictures[0].channels["R"])) > 2


def test_a_name_of_one_object_stays_short(tmp_path):
    write_scene(tmp_path, ())
    dataset = rendered(tmp_path, "cryptomatte")
    header = images.read_header(dataset / "cryptomatte/view_0000f.exr").attributes
    assert json.loads(header["cryptomatte/3ae39a5/manifest"]) == {
        "LibCube": f"{murmur3('LibCube'):08x}"
    }
