"""Models in FBX, as text and as bytes: pixels of the original, the files that they name, faults."""

import os
import re
import struct
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from model_imports import imported, refusal

from lightfield.imaging.images import write_png

pytestmark = pytest.mark.slow


# ---- the same pixels as the original --------------------------------------------------------

VIEWS = ((0, 20), (75, -10), (140, 45), (260, 10))


def pictures(folder):
    """Render the open scene from around. Returns the pixels (4, 48, 48, 4)."""
    import bpy

    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("view", bpy.data.cameras.new("view"))
    scene.camera.data.lens = 50
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.render.resolution_x = scene.render.resolution_y = 48
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    taken = []
    for azimuth, elevation in np.radians(VIEWS):
        flat = np.cos(elevation)
        place = 7 * np.array([flat * np.sin(azimuth), -flat * np.cos(azimuth), np.sin(elevation)])
        scene.camera.location = place + np.array([0, 0, 0.8])
        scene.camera.rotation_euler = (np.pi / 2 - elevation, 0, azimuth)
        scene.render.filepath = str(folder / "view.exr")
        bpy.ops.render.render(write_still=True)
        taken.append(oiio.ImageBuf(scene.render.filepath).get_pixels())
    return np.array(taken)


def original(folder):
    """Fill the open scene with a textured slab, a turned metal cone on it, and a mirrored arrow."""
    import bpy

    from lightfield.rendering import blend_file

    blend_file.new_scene()
    checks = np.indices((8, 8)).sum(0) % 2
    picture = np.stack([checks * 255, 255 - checks * 200, np.full((8, 8), 40)], -1)
    write_png(folder / "checks.png", picture.astype(np.uint8))
    metal, paint = (bpy.data.materials.new(name) for name in ("metal", "paint"))
    shader = metal.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.8, 0.5, 0.2, 1)
    shader.inputs["Metallic"].default_value = 1
    shader.inputs["Roughness"].default_value = 0.4
    texture = paint.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(folder / "checks.png"))
    shader = paint.node_tree.nodes["Principled BSDF"]
    paint.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0.3, 0, 0.25))
    bpy.context.object.scale = (2.4, 1.6, 0.5)
    bpy.context.object.data.materials.append(paint)
    slab = bpy.context.object
    bpy.ops.mesh.primitive_cone_add(radius1=0.5, depth=1.2, location=(0.2, 0.1, 1.0))
    bpy.context.object.rotation_euler = (0.2, 0.4, 0.9)
    bpy.context.object.data.materials.append(metal)
    bpy.ops.mesh.primitive_monkey_add(size=0.8, location=(-0.9, 0.5, 0.9))
    bpy.context.object.scale = (-1, 1, 1.5)
    bpy.context.object.data.materials.append(metal)
    bpy.context.object.parent = slab
    bpy.ops.object.light_add(location=(9, 0, 9))
    bpy.ops.object.camera_add(location=(9, 0, 3))


@pytest.mark.parametrize("axes", [("-Z", "Y"), ("Y", "Z")], ids=["y is up", "z is up"])
def test_an_fbx_has_the_pixels_of_the_scene_from_which_blender_exported_it(tmp_path, axes):
    import bpy

    from lightfield.rendering import model_light

    original(tmp_path)
    path = tmp_path / "model.fbx"
    forward, up = axes
    bpy.ops.export_scene.fbx(
        filepath=str(path), path_mode="RELATIVE", axis_forward=forward, axis_up=up
    )
    for lamp in [obj for obj in bpy.data.objects if obj.type == "LIGHT"]:
        bpy.data.objects.remove(lamp)
    model_light.add("city", np.array([[-2.0, -2, 0], [2, 2, 2]]))
    expected = pictures(tmp_path)
    bpy.context.scene.cycles.seed = 1
    noise = np.abs(pictures(tmp_path) - expected).mean()
    record = imported(path, light="city", unit="metres")
    assert {obj.type for obj in bpy.data.objects} <= {"MESH", "EMPTY"}
    assert {file["path"] for file in record["external_files"]} == {"model.fbx", "checks.png"}
    shown = pictures(tmp_path)
    assert (expected[..., 3] > 0.5).mean() > 0.05
    assert np.abs(shown[..., 3] - expected[..., 3]).mean() < 1e-3
    assert np.abs(shown - expected).mean() < noise


# ---- files that it names ------------------------------------------------------------------------


def tree(absolute, relative, content=None):
    """Return the nodes of a triangle with a texture: name, properties, children."""
    relative_names = [("RelativeFilename", [relative], [])] if relative else []
    video = [("Filename", [absolute], []), *relative_names]
    if content:
        video.append(("Content", [content], []))
    names = [("FileName", [absolute], []), *relative_names]
    objects = [
        (
            "Geometry",
            [1, "a\0\1Geometry", "Mesh"],
            [
                ("Vertices", [[0.0, 0, 0, 1, 0, 0, 0, 1, 0]], []),
                ("PolygonVertexIndex", [[0, 1, -3]], []),
            ],
        ),
        ("Model", [2, "a\0\1Model", "Mesh"], []),
        ("Material", [3, "m\0\1Material", ""], [("ShadingModel", ["phong"], [])]),
        ("Texture", [4, "t\0\1Texture", ""], names),
        ("Video", [5, "v\0\1Video", "Clip"], video),
    ]
    joins = [("OO", 2, 0), ("OO", 1, 2), ("OO", 3, 2), ("OP", 4, 3, "DiffuseColor"), ("OO", 5, 4)]
    return [
        ("FBXHeaderExtension", [], [("FBXVersion", [7400], [])]),
        ("Objects", [], objects),
        ("Connections", [], [("C", [*join], []) for join in joins]),
    ]


def as_text(nodes):
    """Return nodes as an FBX of text."""
    lines = []
    for name, properties, children in nodes:
        shown = []
        for value in properties:
            if isinstance(value, list):
                numbers = ",".join(map(str, value))
                shown.append(f"*{len(value)} {{\na: {numbers}\n}}")
            elif isinstance(value, bytes):
                # A text has its data in base 64, on a line of its own.
                import base64

                shown.append(f',\n"{base64.b64encode(value).decode()}"')
            elif isinstance(value, str):
                label, _, kind = value.partition("\0\1")
                shown.append(f'"{kind}::{label}"' if kind else f'"{value}"')
            else:
                shown.append(str(value))
        body = f" {{\n{as_text(children)}}}" if children or name == "Model" else ""
        lines.append(f"{name}: {', '.join(shown)}{body}\n")
    return "".join(lines)


def as_bytes(nodes, start=27):
    """Return nodes as in an FBX of bytes, which begin at a place in the file."""
    content = b""
    for name, properties, children in nodes:
        encoded = b""
        for value in properties:
            match value:
                case list():
                    kind, form = (b"d", "d") if isinstance(value[0], float) else (b"i", "i")
                    data = struct.pack(f"<{len(value)}{form}", *value)
                    encoded += kind + struct.pack("<3I", len(value), 0, len(data)) + data
                case bytes():
                    encoded += b"R" + struct.pack("<I", len(value)) + value
                case str():
                    text = value.encode()
                    encoded += b"S" + struct.pack("<I", len(text)) + text
                case int():
                    encoded += b"L" + struct.pack("<q", value)
        head = 13 + len(name)
        inner = start + len(content) + head + len(encoded)
        body = as_bytes(children, inner) + bytes(13) if children else b""
        end = inner + len(body)
        content += struct.pack("<3IB", end, len(properties), len(encoded), len(name))
        content += name.encode() + encoded + body
    return content


def written(path, nodes, kind):
    path.parent.mkdir(parents=True, exist_ok=True)
    if kind == "text":
        path.write_text("; FBX 7.4.0 project file\n" + as_text(nodes))
    else:
        head = b"Kaydara FBX Binary  \x00\x1a\x00" + struct.pack("<I", 7400)
        path.write_bytes(head + as_bytes(nodes) + bytes(13))
    return path


def red(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, np.full((4, 4, 3), (200, 10, 10), np.uint8))
    return path


KINDS = pytest.mark.parametrize("kind", ["text", "bytes"])


@KINDS
@pytest.mark.parametrize(
    ("absolute", "relative", "place"),
    [
        ("/no/such/folder/red.png", "textures/red.png", "textures/red.png"),
        ("C:\\art\\chair\\red.png", "textures\\red.png", "textures/red.png"),
        ("/art/chair/red.png", "..\\..\\none.png", "chair/red.png"),
        ("/art/chair/red.png", "/art/chair/red.png", "red.png"),
    ],
)
def test_a_texture_is_found_where_blender_finds_it(tmp_path, kind, absolute, relative, place):
    import bpy

    path = written(tmp_path / "own/a.fbx", tree(absolute, relative), kind)
    red(tmp_path / "own" / place)
    record = imported(path)
    assert {file["path"] for file in record["external_files"]} == {"a.fbx", place}
    (image,) = [image for image in bpy.data.images if image.source == "FILE"]
    assert image.packed_files and tuple(image.size) == (4, 4)


@KINDS
def test_a_missing_texture_is_named_or_allowed(tmp_path, kind):
    path = written(tmp_path / "a.fbx", tree("C:\\art\\red.png", "textures\\red.png"), kind)
    message = refusal(path)
    assert "red.png" in message and "allow_missing: true" in message
    record = imported(path, allow_missing=True)
    assert any("red.png is missing" in each for each in record["left_out"])
    (missing,) = [file for file in record["external_files"] if file["sha256"] is None]
    assert missing["path"] == "textures/red.png"
    # At this place the file is found.
    red(tmp_path / missing["path"])
    assert imported(path)["fingerprint"] != record["fingerprint"]


@KINDS
def test_a_texture_without_a_relative_path_is_refused(tmp_path, kind):
    """Blender takes the folder for the texture."""
    red(tmp_path / "red.png")
    path = written(tmp_path / "a.fbx", tree("C:\\art\\red.png", ""), kind)
    assert "has a texture without a relative path" in refusal(path)
    assert imported(path, allow_missing=True)["left_out"]


@KINDS
def test_a_texture_inside_the_file_needs_no_other(tmp_path, kind):
    import bpy

    content = red(tmp_path / "elsewhere/red.png").read_bytes()
    path = written(tmp_path / "own/a.fbx", tree("C:\\red.png", "red.png", content), kind)
    record = imported(path)
    assert [file["path"] for file in record["external_files"]] == ["a.fbx"]
    (image,) = [image for image in bpy.data.images if image.source == "FILE"]
    assert image.packed_files and tuple(image.size) == (4, 4)


@KINDS
@pytest.mark.parametrize("relative", ["../far/red.png", "none.png"])
def test_a_texture_outside_the_folder_is_refused(tmp_path, kind, relative):
    far = red(tmp_path / "far/red.png")
    path = written(tmp_path / "own/a.fbx", tree(str(far), relative), kind)
    assert "which is outside the model's folder" in refusal(path)
    record = imported(path, shared_folder=str(far.parent))
    assert {file["path"] for file in record["external_files"]} == {"a.fbx", "../far/red.png"}


@KINDS
@pytest.mark.parametrize("name", ["red.png", "chair/red.png"])
def test_no_fifo_is_opened(tmp_path, kind, name):
    (tmp_path / "chair").mkdir()
    os.mkfifo(tmp_path / name)
    path = written(tmp_path / "a.fbx", tree("/art/chair/red.png", "x/red.png"), kind)
    assert re.search(r"names .*red\.png, which is a FIFO", refusal(path))


# ---- broken files -------------------------------------------------------------------------------


@KINDS
def test_a_file_that_is_cut_anywhere_is_refused(tmp_path, kind):
    red(tmp_path / "red.png")
    path = written(tmp_path / "a.fbx", tree("red.png", "red.png"), kind)
    assert imported(path)["box"]
    content = path.read_bytes().rstrip(b"\n")
    for part in (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99):
        path.write_bytes(content[: int(len(content) * part)])
        assert refusal(path)


def test_a_surface_that_blender_does_not_import_is_named(tmp_path):
    for kind in ("text", "bytes"):
        nodes = tree("red.png", "red.png")
        nodes[1][2].append(("Geometry", [9, "n\0\1Geometry", "NurbsSurface"], []))
        red(tmp_path / "red.png")
        path = written(Path(tmp_path, f"{kind}.fbx"), nodes, kind)
        assert "Blender does not import a NurbsSurface" in refusal(path)


def test_a_deep_tree_of_objects_is_imported(tmp_path):
    nodes = tree("red.png", "red.png")
    red(tmp_path / "red.png")
    for depth in range(1000):
        nodes[1][2].append(("Model", [100 + depth, f"e{depth}\0\1Model", "Null"], []))
        nodes[2][2].append(("C", ["OO", 100 + depth, 99 + depth if depth else 0], []))
    nodes[2][2][0] = ("C", ["OO", 2, 1099], [])
    record = imported(written(tmp_path / "a.fbx", nodes, "bytes"))
    np.testing.assert_allclose(np.ptp(record["box"], axis=0).max(), 1, atol=1e-5)
