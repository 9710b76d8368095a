"""Models that name files outside their folder, and models of which Blender leaves out parts."""

import base64
import hashlib
import json
import os
import re
import struct
import subprocess
import zipfile
import zlib
from functools import partial
from pathlib import Path

import forks
import model_imports
import numpy as np
import pytest
from conftest import SCRIPTS

from lightfield.configuration.scene_source import SceneSource
from lightfield.stages.scene import ImportSettings


def chunk(kind, content):
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)


# Most of these tests run Blender.
pytestmark = pytest.mark.slow

# A picture of one red pixel.
PNG = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", 1, 1, 8, 2, 0, 0, 0))
PNG += chunk(b"IDAT", zlib.compress(b"\0\xff\0\0")) + chunk(b"IEND", b"")
# A triangle that reaches to x = 7.
TRIANGLE = struct.pack("<9f", 0, 0, 0, 7, 0, 0, 0, 1, 0)


def written(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


imported = partial(model_imports.imported, unit="metres")
refusal = partial(model_imports.refusal, unit="metres")


def as_address(kind, content):
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def gltf(buffer=None, image=None):
    """Return a glTF of one triangle, with the addresses of its buffer and of its texture."""
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
            | {"min": [0, 0, 0], "max": [7, 1, 0]}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": buffer or as_address("a/b", TRIANGLE)}],
    }
    if image is not None:
        document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        document["textures"] = [{"source": 0}]
        document["images"] = [{"uri": image}]
    return json.dumps(document)


def glb(text):
    """Return a glTF document as a binary glTF."""
    text += " " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
    return head + text.encode()


def usd(body="", head=""):
    """Return a USD with a mesh, four faces up to x = 1, and more prims."""
    return f"""#usda 1.0
(
    defaultPrim = "shape"
    metersPerUnit = 1
    {head}
)
def Mesh "shape" {{
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
}}
{body}
"""


def prim(metadata, body=""):
    """Return a prim in USD with some metadata, such as a reference."""
    return f'def "part" (\n{metadata}\n) {{\n{body}\n}}\n'


# The mesh of another file, which reaches to x = 7.
PART = usd().replace("(1, 0, 0)", "(7, 0, 0)")
TEXTURED = """def Material "red" {
    token outputs:surface.connect = </red/shader.outputs:surface>
    def Shader "shader" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </red/texture.outputs:rgb>
        token outputs:surface
    }
    def Shader "texture" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @NAME@
        float3 outputs:rgb
    }
}
def Mesh "textured" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </red>
}
"""
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
MTL = "newmtl red\nKd 1 0 0\n"


# ---- files outside the folder ---------------------------------------------------------------


def at(folder, *files):
    """Write models and what they name below a folder. ABSOLUTE is the folder's own path."""
    for name, content in files:
        if isinstance(content, str):
            content = content.replace("ABSOLUTE", str(folder))
        written(folder / name, content)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.gltf", gltf("place")),
        ("a.gltf", gltf(image="place")),
        ("a.usda", usd(TEXTURED.replace("NAME", "./place.png"))),
        ("a.obj", f"mtllib place\n{OBJ}"),
        ("a.obj", f"mtllib a.mtl\n{OBJ}"),
    ],
)
def test_no_importer_opens_a_fifo(tmp_path, name, content):
    """To open one waits for ever."""
    written(tmp_path / "a.mtl", f"{MTL}map_Kd -o 1 0 0 place\n")
    for place in ("place", "place.png"):
        os.mkfifo(tmp_path / place)
    model = written(tmp_path / name, content)
    for allow_missing in (False, True):
        message = refusal(model, allow_missing=allow_missing)
        assert re.search(r"names .*place(\.png)?, which is a FIFO", message)


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl", "usda", "usdz"])
def test_no_importer_opens_a_model_that_is_a_fifo(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    os.mkfifo(path)
    assert "it is a FIFO, not a file" in refusal(path)


# Models in `own` that name a file outside: the files, what names it, and what it shows.
OUTSIDE = {
    "gltf buffer": ([("own/a.gltf", gltf("../far/b.bin")), ("far/b.bin", TRIANGLE)], "a.gltf"),
    "gltf percent": ([("own/a.gltf", gltf("%2e%2e/far/b.bin")), ("far/b.bin", TRIANGLE)], "a.gltf"),
    "gltf backslash": ([("own/a.gltf", gltf("..\\far\\b.bin")), ("far/b.bin", TRIANGLE)], "a.gltf"),
    "gltf absolute": (
        [("own/a.gltf", gltf("ABSOLUTE/far/b.bin")), ("far/b.bin", TRIANGLE)],
        "a.gltf",
    ),
    "gltf data": (
        [
            ("own/a.gltf", gltf("data:/../../far/b.bin")),
            ("own/data:/x", "x"),
            ("far/b.bin", TRIANGLE),
        ],
        "a.gltf",
    ),
    "gltf image": ([("own/a.gltf", gltf(image="../far/b.png")), ("far/b.png", PNG)], "a.gltf"),
    "glb image": ([("own/a.glb", glb(gltf(image="../far/b.png"))), ("far/b.png", PNG)], "a.glb"),
    "obj library": ([("own/a.obj", f"mtllib ../far/b.mtl\n{OBJ}"), ("far/b.mtl", MTL)], "a.obj"),
    "obj continued": (
        [("own/a.obj", f" mtllib \\\n ../far/b.mtl\n{OBJ}"), ("far/b.mtl", MTL)],
        "a.obj",
    ),
    "obj texture": (
        [
            ("own/a.obj", f"mtllib m/c.mtl\n{OBJ}"),
            ("own/m/c.mtl", f"{MTL}map_Kd -s 2 2 2 ../../far/b.png\n"),
            ("far/b.png", PNG),
        ],
        "m/c.mtl",
    ),
    "obj absolute": (
        [
            ("own/a.obj", OBJ),
            ("own/a.mtl", f"{MTL}map_Kd ABSOLUTE/far/b.png\n"),
            ("far/b.png", PNG),
        ],
        "a.mtl",
    ),
    "obj working folder": (
        [("own/a.obj", OBJ), ("own/a.mtl", f"{MTL}map_Kd far/b.png\n"), ("far/b.png", PNG)],
        "a.mtl",
    ),
    "usd reference": (
        [("own/a.usda", usd(prim("references = @../far/b.usda@"))), ("far/b.usda", PART)],
        "a.usda",
    ),
    "usd payload": (
        [("own/a.usda", usd(prim("payload = @ABSOLUTE/far/b.usda@"))), ("far/b.usda", PART)],
        "a.usda",
    ),
    "usd sublayer": (
        [
            ("own/a.usda", usd(head="subLayers = [@../far/b.usda@]")),
            ("far/b.usda", PART.replace('"shape"', '"other"')),
        ],
        "a.usda",
    ),
    "usd second layer": (
        [
            ("own/a.usda", usd(prim("references = @deep/c.usda@</part>"))),
            ("own/deep/c.usda", usd(prim("references = @../../far/b.usda@"))),
            ("far/b.usda", PART),
        ],
        "deep/c.usda",
    ),
    "usd expression": (
        [
            (
                "own/a.usda",
                usd(
                    prim('references = @`"../far/${NAME}.usda"`@'),
                    'expressionVariables = {\nstring NAME = "b"\n}',
                ),
            ),
            ("far/b.usda", PART),
        ],
        "a.usda",
    ),
    "usd texture": (
        [("own/a.usda", usd(TEXTURED.replace("NAME", "../far/b.png"))), ("far/b.png", PNG)],
        "a.usda",
    ),
    "usd tiles": (
        [
            ("own/a.usda", usd(TEXTURED.replace("NAME", "../far/b.<UDIM>.png"))),
            ("far/b.1001.png", PNG),
        ],
        "a.usda",
    ),
    "usd clips": (
        [
            (
                "own/a.usda",
                usd(
                    prim(
                        "references = @part.usda@\nclips = {\ndictionary default = {\n"
                        'string templateAssetPath = "../far/b.##.usda"\n'
                        "double templateStartTime = 1\ndouble templateEndTime = 1\n"
                        'double templateStride = 1\nstring primPath = "/shape"\n}\n}'
                    )
                ),
            ),
            ("own/part.usda", PART),
            ("far/b.01.usda", PART),
        ],
        "a.usda",
    ),
    "usd volume": (
        [
            (
                "own/a.usda",
                usd(
                    'def Volume "fog" {\nrel field:density = </fog/d>\ndef OpenVDBAsset "d" {\n'
                    'asset filePath = @../far/b.vdb@\ntoken fieldName = "density"\n}\n}'
                ),
            ),
            ("far/b.vdb", b"no volume"),
        ],
        "a.usda",
    ),
}


@pytest.mark.parametrize("case", OUTSIDE)
def test_a_file_outside_the_models_folder_is_refused(tmp_path, monkeypatch, case):
    files, named_by = OUTSIDE[case]
    at(tmp_path, *files)
    monkeypatch.chdir(tmp_path)
    model = Path(files[0][0])
    message = refusal(model)
    assert Path(files[-1][0]).name.partition(".")[0] in message
    assert "which is outside the model's folder" in message
    assert (f"own/{named_by} names " in message) == (named_by != model.name)
    assert "scene: {shared_folder: far}" in message
    # Nor is it read if missing files are allowed.
    assert "which is outside" in refusal(model, allow_missing=True)


@pytest.mark.parametrize("case", OUTSIDE)
def test_a_file_in_the_shared_folder_is_read_and_recorded(tmp_path, monkeypatch, case):
    """The file has arrived in the scene: the model reaches to x = 7, or shows a pixel or a red."""
    import bpy

    files, _ = OUTSIDE[case]
    at(tmp_path, *files)
    monkeypatch.chdir(tmp_path)
    name, content = files[-1]
    record = imported(Path(files[0][0]), shared_folder="far")
    sums = {entry["path"]: entry["sha256"] for entry in record["external_files"]}
    assert sums[f"../{name}"] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
    if content == PNG:
        (image,) = [image for image in bpy.data.images if image.packed_files]
        assert image.packed_file.data == PNG
    elif content == MTL:
        assert bpy.data.materials["red"].node_tree.nodes["Principled BSDF"].inputs[0].default_value[
            :3
        ] == pytest.approx((1, 0, 0))
    elif content == b"no volume":
        assert bpy.data.volumes
    else:
        assert record["box"][1][0] == pytest.approx(7)


DOME = 'def DomeLight "sky" {\n    asset inputs:texture:file = @./place.png@\n}\n'


def test_the_picture_of_a_light_may_be_missing_unless_a_texture_names_it_too(tmp_path):
    """Lights of a model are not imported."""
    model = written(tmp_path / "a.usda", usd(DOME))
    assert [entry["path"] for entry in imported(model)["external_files"]] == ["a.usda"]
    textured = written(tmp_path / "b.usda", usd(DOME + TEXTURED.replace("NAME", "./place.png")))
    assert "place.png" in refusal(textured)


@pytest.mark.parametrize("suffix", ["usdc", "usdz"])
@pytest.mark.parametrize("case", ["usd reference", "usd sublayer", "usd texture"])
def test_binary_usd_and_archives_obey_the_same_rule(tmp_path, monkeypatch, case, suffix):
    """An archive can only name absolute paths outside of itself."""
    files, _ = OUTSIDE[case]
    name, text = files[0]
    at(tmp_path, (name, text.replace("../far", f"{tmp_path}/far")), *files[1:])
    monkeypatch.chdir(tmp_path)
    model = converted(Path(name), suffix)
    assert "which is outside the model's folder" in refusal(model)
    record = imported(model, shared_folder="far")
    assert f"../{files[-1][0]}" in {entry["path"] for entry in record["external_files"]}


def converted(path, suffix):
    """Return a USD text as a binary USD, or as an archive of that."""
    from lightfield.rendering.models.usd_files import openusd

    layer = openusd().Sdf.Layer.FindOrOpen(str(path))
    binary = path.with_suffix(".usdc")
    layer.Export(str(binary))
    path.unlink()
    if suffix == "usdc":
        return binary
    archive = path.with_suffix(".usdz")
    with zipfile.ZipFile(archive, "w") as file:
        file.write(binary, binary.name)
    binary.unlink()
    return archive


def test_a_link_in_the_folder_must_not_lead_outside(tmp_path, monkeypatch):
    at(tmp_path, ("own/a.gltf", gltf(image="tex/b.png")), ("far/b.png", PNG), ("own/c.obj", OBJ))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own/tex").symlink_to("../far")
    assert "names tex/b.png, which is outside" in refusal(Path("own/a.gltf"))
    assert imported(Path("own/a.gltf"), shared_folder="far")
    at(tmp_path, ("far/c.mtl", MTL))
    (tmp_path / "own/c.mtl").symlink_to("../far/c.mtl")
    assert "names c.mtl, which is outside" in refusal(Path("own/c.obj"))


def test_a_linked_model_has_two_folders_of_its_own(tmp_path, monkeypatch):
    """As in a cache of downloads, where the model and its files are links into another folder."""
    at(tmp_path, ("far/1", gltf("b.bin")), ("far/2", TRIANGLE))
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path)
    for name, target in (("a.gltf", "1"), ("b.bin", "2")):
        (tmp_path / "own" / name).symlink_to(f"../far/{target}")
    assert imported(Path("own/a.gltf"))["box"][1][0] == pytest.approx(7)


def test_files_below_the_folder_need_no_key(tmp_path, monkeypatch):
    """However they are named: by an absolute path, by a way round, or with backslashes."""
    import bpy

    at(
        tmp_path,
        ("own/a.gltf", gltf("ABSOLUTE/own/deep/b.bin", image="x/../deep/b.png")),
        ("own/b.usda", usd(prim("references = @ABSOLUTE/own/deep/b.usda@"))),
        ("own/c.obj", OBJ),
        ("own/c.mtl", f"{MTL}map_Kd deep\\b.png\n"),
        ("own/deep/b.bin", TRIANGLE),
        ("own/deep/b.png", PNG),
        ("own/deep/b.usda", PART),
    )
    monkeypatch.chdir(tmp_path)
    for name, expected in (("a.gltf", 7), ("b.usda", 7), ("c.obj", 1)):
        record = imported(Path("own", name))
        assert record["box"][1][0] == pytest.approx(expected)
    assert [image.packed_file.data for image in bpy.data.images if image.packed_files] == [PNG]
    assert {entry["path"] for entry in record["external_files"]} == {
        "c.obj",
        "c.mtl",
        "deep/b.png",
    }


def test_members_of_a_family_obey_the_same_rule():
    """Their import has the settings of the family's scene YAML."""
    alone = SceneSource(model="models/a.obj")
    shared = SceneSource(model="models/a.obj", shared_folder="textures")
    assert ImportSettings.of_source(alone).shared_folder is None
    assert ImportSettings.of_source(shared).shared_folder == "textures"


# ---- libraries and textures of an OBJ -------------------------------------------------------


# What an OBJ says after mtllib, and the libraries in its folder.
LIBRARIES = {
    "one": ("a.mtl", {"a.mtl": MTL}),
    "two": ("b.mtl a.mtl", {"a.mtl": MTL, "b.mtl": "newmtl blue\nKd 0 0 1\n"}),
    "two, one a line": ("b.mtl\nmtllib\ta.mtl", {"a.mtl": MTL, "b.mtl": ""}),
    "blank": ("a b.mtl", {"a b.mtl": MTL}),
    "escaped blank": (r"a\ b.mtl", {"a b.mtl": MTL}),
    "two with blanks": (r"a\ b.mtl sub/c d.mtl", {"a b.mtl": "", "sub/c d.mtl": MTL}),
    "name of two": ("a.mtl b.mtl", {"a.mtl b.mtl": MTL}),
    "quotes": ('"a b.mtl"', {"a b.mtl": MTL}),
}


@pytest.mark.parametrize("case", LIBRARIES)
def test_the_libraries_of_an_obj_are_read_and_recorded(tmp_path, monkeypatch, case):
    import bpy

    named, libraries = LIBRARIES[case]
    at(
        tmp_path,
        ("own/m.obj", f"mtllib {named}\n{OBJ}"),
        *((f"own/{n}", t) for n, t in libraries.items()),
    )
    monkeypatch.chdir(tmp_path)
    record = imported(Path("own/m.obj"))
    assert {entry["path"] for entry in record["external_files"]} == {"m.obj", *libraries}
    (red,) = bpy.data.materials
    assert colour(red) == pytest.approx((1, 0, 0))


def colour(material):
    return tuple(material.node_tree.nodes["Principled BSDF"].inputs[0].default_value[:3])


def test_each_missing_library_of_an_obj_is_named(tmp_path):
    at(tmp_path, ("m.obj", f"mtllib a.mtl b.mtl my own.mtl\n{OBJ}"), ("b.mtl", MTL))
    message = refusal(tmp_path / "m.obj")
    assert "a.mtl, " in message and "my own.mtl; put" in message and "b.mtl" not in message


# What follows map_Kd, with the texture's name in place of NAME, and where the texture then lies.
TEXTURES = {
    "plain": ("NAME", (0, 0, 0)),
    "offset": ("-o 0.25 NAME", (0.25, 0, 0)),
    "colour space": ("-colorspace sRGB NAME", (0, 0, 0)),
    "colour space and offset": ("-colorspace sRGB -o 0.25 0.5 NAME", (0.25, 0.5, 0)),
    "turbulence": ("-t 1 NAME", (0, 0, 0)),
    "gain": ("-mm 0.5 -clamp on\t-o 0.25 NAME", (0.25, 0, 0)),
}


@pytest.mark.parametrize("name", ["b.png", r"tex/b\ c.png", "tex/b c.png"])
@pytest.mark.parametrize("case", TEXTURES)
def test_options_of_an_objs_texture_are_no_part_of_its_name(tmp_path, monkeypatch, case, name):
    import bpy

    text, offset = TEXTURES[case]
    file = name.replace("\\", "")
    at(
        tmp_path,
        ("own/m.obj", "mtllib m/c.mtl\nvt 0 0\n" + OBJ.replace("f 1 2 3", "f 1/1 2/1 3/1")),
        ("own/m/c.mtl", f"{MTL}map_Kd {text.replace('NAME', name)}\n"),
        (f"own/m/{file}", PNG),
    )
    monkeypatch.chdir(tmp_path)
    record = imported(Path("own/m.obj"))
    assert {entry["path"] for entry in record["external_files"]} == {
        "m.obj",
        "m/c.mtl",
        f"m/{file}",
    }
    (image,) = [image for image in bpy.data.images if image.packed_files]
    assert image.packed_file.data == PNG
    nodes = bpy.data.materials["red"].node_tree.nodes
    places = [tuple(n.inputs["Location"].default_value) for n in nodes if n.type == "MAPPING"]
    assert places == ([] if offset == (0, 0, 0) else [pytest.approx(offset)])


def test_a_colour_space_that_blender_leaves_out_is_named(tmp_path):
    at(tmp_path, ("m.obj", OBJ), ("m.mtl", f"{MTL}map_Kd -colorspace acescg b.png\n"))
    at(tmp_path, ("b.png", PNG))
    assert "left out: the colour space acescg of b.png; " in refusal(tmp_path / "m.obj")
    assert imported(tmp_path / "m.obj", allow_missing=True)["left_out"] == [
        "the colour space acescg of b.png"
    ]


@pytest.mark.parametrize("name", ["Tex/red.png", "tex/Red.PNG"])
def test_a_file_whose_name_differs_only_in_case_is_named(tmp_path, monkeypatch, name):
    at(
        tmp_path,
        ("own/m.obj", OBJ),
        ("own/m.mtl", f"{MTL}map_Kd {name}\n"),
        ("own/tex/red.png", PNG),
    )
    monkeypatch.chdir(tmp_path)
    message = refusal(Path("own/m.obj"))
    assert f"missing: own/{name} (own/tex/red.png differs only in case); " in message


# ---- parts that Blender leaves out ----------------------------------------------------------

# References to what Blender cannot read: as written, and what the message names.
VANISHING = {
    "server": ("@https://example.org/part.usd@", "https://example.org/part.usd"),
    "omniverse": ("@omniverse://host/part.usd@", "omniverse://host/part.usd"),
    "alembic": ("@part.abc@", "part.abc"),
    "fbx": ("@part.fbx@", "part.fbx"),
    "unknown": ("@part.xyz@", "part.xyz"),
    "no prim": ("@whole.usda@</nothing>", "</nothing>"),
}


def meshes_in_blender(path):
    """Return how many meshes Blender itself imports, without a word of an error."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert "FINISHED" in bpy.ops.wm.usd_import(filepath=str(path))
    return sum(obj.type == "MESH" for obj in bpy.data.objects)


def with_arc(arc, target):
    """Return a USD that names a target by one of the arcs of composition."""
    if arc == "subLayers":
        return usd(head=f"subLayers = [{target}]")
    return usd(prim(f"{arc} = {target}"))


ARCS = [("references", case, suffix) for case in VANISHING for suffix in ("usda", "usdc", "usdz")]
ARCS += [("payload", case, "usda") for case in VANISHING]
ARCS += [("subLayers", case, "usda") for case in VANISHING if case != "no prim"]


@pytest.mark.parametrize(("arc", "case", "suffix"), ARCS)
def test_a_part_that_vanishes_is_refused(tmp_path, arc, case, suffix):
    target, named = VANISHING[case]
    path = written(tmp_path / "a.usda", with_arc(arc, target))
    for name in ("part.abc", "part.fbx", "part.xyz"):
        written(tmp_path / name, "not a USD")
    written(tmp_path / "whole.usda", PART)
    if suffix != "usda":
        path = converted(path, suffix)
    assert meshes_in_blender(path) == 1
    assert named in refusal(path)
    record = imported(path, allow_missing=True)
    assert len(record["left_out"]) == 1
    assert named in record["left_out"][0]


@pytest.mark.parametrize("arc", ["references", "payload", "subLayers"])
def test_a_part_that_can_be_read_is_imported(tmp_path, arc):
    path = written(tmp_path / "a.usda", with_arc(arc, "@whole.usda@"))
    written(tmp_path / "whole.usda", PART.replace("shape", "other"))
    assert meshes_in_blender(path) == 2
    assert imported(path)["left_out"] == []


@pytest.mark.parametrize(
    "files",
    [
        {"a.usda": usd(prim("references = </part/c>", 'def "c" (\nreferences = </part>\n) {\n}'))},
        {
            "a.usda": usd(prim("references = @b.usda@</part>")),
            "b.usda": usd(prim("references = @a.usda@</part>")),
        },
        {"a.usda": usd(head="subLayers = [@a.usda@]")},
        {
            "a.usda": usd(head="subLayers = [@b.usda@]"),
            "b.usda": usd(head="subLayers = [@a.usda@]"),
        },
    ],
    ids=["itself", "two files", "sublayer", "two sublayers"],
)
def test_a_cycle_is_refused(tmp_path, files):
    for name, content in files.items():
        written(tmp_path / name, content)
    message = refusal(tmp_path / "a.usda")
    assert "ycle" in message and "a.usda" in message
    # The message is the same in every folder, and in every process.
    assert str(tmp_path) not in message.removeprefix(str(tmp_path))
    assert "anon" not in message
    assert imported(tmp_path / "a.usda", allow_missing=True)["left_out"]


@pytest.mark.parametrize(
    "body",
    [
        prim("references = @b.usda@"),
        prim("", prim("instanceable = true\nreferences = @b.usda@</holder>")),
        prim("active = false\nreferences = @https://example.org/part.usd@"),
        prim(
            'variants = {\nstring way = "near"\n}\nprepend variantSets = "way"',
            'variantSet "way" = {\n"near" {\ndef "b" (\nreferences = @b.usda@\n) {\n}\n}\n'
            '"far" {\ndef "b" (\nreferences = @https://example.org/part.usd@\n) {\n}\n}\n}',
        ),
    ],
    ids=["reference", "instance", "inactive", "variant"],
)
def test_a_usd_without_a_lost_part_is_imported(tmp_path, body):
    """What the file does not show is not lost: prims that are switched off, and other variants."""
    mesh = PART.partition("def Mesh")[2]
    written(tmp_path / "b.usda", f'{PART}def Xform "holder" {{\ndef Mesh{mesh}}}\n')
    record = imported(written(tmp_path / "a.usda", usd(body)))
    assert record["left_out"] == []
    assert record["box"][1][0] == pytest.approx(1 if "active" in body else 7)


FACE = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n"
PLACES = "point3f[] points = [(0, 0, 0), (7, 0, 0), (0, 1, 0)]\n"
LOST_SURFACES = {
    "TetMesh": 'def TetMesh "lost" {\nint4[] tetVertexIndices = [(0, 1, 2, 3)]\n'
    "int3[] surfaceFaceVertexIndices = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]\n"
    "point3f[] points = [(0, 0, 0), (7, 0, 0), (0, 1, 0), (0, 0, 1)]\n}",
    "NurbsPatch": 'def NurbsPatch "lost" {\nint uVertexCount = 2\nint vVertexCount = 2\n'
    "int uOrder = 2\nint vOrder = 2\ndouble[] uKnots = [0, 0, 1, 1]\n"
    "double[] vKnots = [0, 0, 1, 1]\n"
    "point3f[] points = [(0, 0, 0), (7, 0, 0), (0, 1, 0), (7, 1, 0)]\n}",
    "corners": f'def Mesh "lost" {{\n{FACE.replace("2]", "9]")}{PLACES}}}',
    "counts": f'def Mesh "lost" {{\n{FACE.replace("[3]", "[4]")}{PLACES}}}',
    "instance": 'def Mesh "lost" (\ninstanceable = true\nreferences = </shape>\n) {\n}',
    "places": f'def Mesh "lost" {{\n{FACE}}}',
}


@pytest.mark.parametrize("case", LOST_SURFACES)
def test_a_surface_that_blender_does_not_import_is_refused(tmp_path, case):
    path = written(tmp_path / "a.usda", usd(LOST_SURFACES[case]))
    assert "lost" in refusal(path)
    hidden = LOST_SURFACES[case].replace("{\n", '{\ntoken visibility = "invisible"\n', 1)
    if case in ("TetMesh", "NurbsPatch"):
        assert imported(written(path, usd(hidden)))["left_out"] == []


def test_every_shape_of_usd_is_imported(tmp_path):
    """What is declared equals what Blender imports."""
    import bpy

    kinds = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")
    path = written(
        tmp_path / "a.usda", usd("\n".join(f'def {kind} "{kind}" {{\n}}' for kind in kinds))
    )
    assert imported(path)["left_out"] == []
    shown = {obj.name for obj in bpy.data.objects if obj.type == "MESH" and obj.data.polygons}
    assert shown == {"shape", *kinds}


def test_what_is_left_out_is_said_in_a_note(tmp_path):
    path = written(tmp_path / "a.usda", usd(prim("references = @https://example.org/part.usd@")))
    program = SCRIPTS / "import_model.py"
    output = ["--output", tmp_path / "a.blend", "--record", tmp_path / "a.json"]
    result = subprocess.run(
        [forks.python(), program, "--model", path, "--allow-missing", *output],
        capture_output=True,
        text=True,
        env=os.environ,
    )
    assert result.returncode == 0, result.stderr
    (note,) = [line for line in result.stdout.splitlines() if ": left out: " in line]
    assert note.startswith(f"note: {path}: left out: ") and "https://example.org/part.usd" in note
    assert json.loads((tmp_path / "a.json").read_text())["left_out"]


# A second triangle, whose data no Blender decodes.
COMPRESSED = {
    "nodes": [{"mesh": 0}, {"mesh": 1, "translation": [5, 0, 0]}],
    "scenes": [{"nodes": [0, 1]}],
}
GARBAGE = as_address("application/octet-stream", b"\xaa" * 72)


def draco():
    document = json.loads(gltf())
    document |= COMPRESSED
    document["buffers"].append({"byteLength": 72, "uri": GARBAGE})
    document["bufferViews"].append({"buffer": 1, "byteLength": 72})
    place = {"componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [7, 1, 0]}
    document["accessors"] += [place, {"componentType": 5123, "count": 3, "type": "SCALAR"}]
    extension = {"bufferView": 1, "attributes": {"POSITION": 0}}
    primitive = {"attributes": {"POSITION": 1}, "indices": 2}
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    document["meshes"].append({"primitives": [primitive]})
    names = ["KHR_draco_mesh_compression"]
    return document | {"extensionsUsed": names, "extensionsRequired": names}


def meshopt(name):
    document = json.loads(gltf())
    document |= COMPRESSED
    document["buffers"].append({"byteLength": 72, "uri": GARBAGE})
    extension = {"buffer": 1, "byteLength": 72, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}
    document["bufferViews"].append(
        {"buffer": 0, "byteLength": 36, "byteStride": 12, "extensions": {name: extension}}
    )
    document["accessors"].append(document["accessors"][0] | {"bufferView": 1})
    document["meshes"].append({"primitives": [{"attributes": {"POSITION": 1}}]})
    return document | {"extensionsUsed": [name], "extensionsRequired": [name]}


@pytest.mark.parametrize("suffix", ["gltf", "glb"])
@pytest.mark.parametrize(
    ("document", "said"),
    [
        (draco(), "raco"),
        (meshopt("EXT_meshopt_compression"), "meshopt"),
        (meshopt("KHR_meshopt_compression"), "meshopt"),
        (json.loads(gltf()) | {"extensionsUsed": ["X_y"], "extensionsRequired": ["X_y"]}, "X_y"),
    ],
    ids=["Draco", "meshopt", "meshopt of Khronos", "unknown"],
)
def test_a_primitive_that_cannot_be_decoded_is_refused(tmp_path, document, said, suffix):
    text = json.dumps(document)
    path = written(tmp_path / f"a.{suffix}", glb(text) if suffix == "glb" else text)
    message = refusal(path)
    assert said in message
    # The message names no path of this machine.
    assert "site-packages" not in message


def test_quantised_places_are_imported(tmp_path):
    """KHR_mesh_quantization needs no decoder."""
    places = struct.pack("<12H", 0, 0, 0, 0, 7, 0, 0, 0, 0, 1, 0, 0)
    document = json.loads(gltf(as_address("application/octet-stream", places)))
    document["accessors"][0]["componentType"] = 5123
    document["bufferViews"][0] |= {"byteLength": 24, "byteStride": 8}
    document["buffers"][0]["byteLength"] = 24
    names = ["KHR_mesh_quantization"]
    document |= {"extensionsUsed": names, "extensionsRequired": names}
    record = imported(written(tmp_path / "a.gltf", json.dumps(document)))
    np.testing.assert_allclose(record["box"], [[0, -0.0, 0], [7, 0, 1]], atol=1e-6)


KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(80)


@pytest.mark.parametrize("content", [KTX2, PNG[:40], b"no picture"], ids=["KTX2", "cut", "text"])
@pytest.mark.parametrize("place", ["inside", "beside", "usd"])
def test_a_texture_that_cannot_be_read_is_refused(tmp_path, content, place):
    """Blender imports such a texture without a word, and renders it magenta."""
    written(tmp_path / "b.png", content)
    if place == "usd":
        path = written(tmp_path / "a.usda", usd(TEXTURED.replace("NAME", "b.png")))
    else:
        image = "b.png" if place == "beside" else as_address("image/png", content)
        path = written(tmp_path / "a.gltf", gltf(image=image))
    assert "does not read" in refusal(path)
    (left_out,) = imported(path, allow_missing=True)["left_out"]
    assert "texture" in left_out


def test_a_texture_on_a_server_is_refused(tmp_path):
    body = TEXTURED.replace("NAME", "https://example.org/b.png")
    path = written(tmp_path / "a.usda", usd(body))
    assert "texture" in refusal(path)
    (left_out,) = imported(path, allow_missing=True)["left_out"]
    assert "red" in left_out


# ---- materials that Blender does not read ---------------------------------------------------

MATERIALX = """def Material "oak" {
    token outputs:mtlx:surface.connect = </oak/shader.outputs:surface>
    def Shader "shader" {
        uniform token info:id = "ND_standard_surface_surfaceshader"
        color3f inputs:base_color = (1, 0, 0)
        token outputs:surface
    }
    PREVIEW
}
def Mesh "board" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </oak>
}
"""
PREVIEW = """token outputs:surface.connect = </oak/preview.outputs:surface>
    def Shader "preview" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 1)
        token outputs:surface
    }"""


def test_a_material_of_materialx_is_named_and_grey_if_allowed(tmp_path):
    import bpy

    path = written(tmp_path / "a.usda", usd(MATERIALX.replace("PREVIEW", "")))
    message = refusal(path)
    assert "left out: the shader of the material oak, which is no UsdPreviewSurface" in message
    assert "scene: {allow_missing: true}" in message
    record = imported(path, allow_missing=True)
    assert len(record["left_out"]) == 1 and "oak" in record["left_out"][0]
    assert colour(bpy.data.materials["oak"]) == pytest.approx((0.5, 0.5, 0.5))


def test_a_material_of_materialx_with_a_preview_shows_the_preview(tmp_path):
    import bpy

    path = written(tmp_path / "a.usda", usd(MATERIALX.replace("PREVIEW", PREVIEW)))
    assert not imported(path)["left_out"]
    assert colour(bpy.data.materials["oak"]) == pytest.approx((0, 0, 1))
