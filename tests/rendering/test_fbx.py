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

    from lightfield.rendering.scenes import blend_file

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

    from lightfield.rendering.imports import model_light

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
                    is_long = max(value) > 2**31
                    number = (b"l", "q") if is_long else (b"i", "i")
                    kind, form = (b"d", "d") if isinstance(value[0], float) else number
                    data = struct.pack(f"<{len(value)}{form}", *value)
                    encoded += kind + struct.pack("<3I", len(value), 0, len(data)) + data
                case bytes():
                    encoded += b"R" + struct.pack("<I", len(value)) + value
                case str():
                    text = value.encode()
                    encoded += b"S" + struct.pack("<I", len(text)) + text
                case int():
                    encoded += b"L" + struct.pack("<q", value)
                case float():
                    encoded += b"D" + struct.pack("<d", value)
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


# ---- what the file says is what the scene holds ---------------------------------------------

SECOND = 46186158000
PLACES = [0.0, 0, 0, 100, 0, 0, 0, 100, 0]


def properties(**values):
    """Return the properties of an object by name. _ stands for a blank."""
    rows = []
    for name, value in values.items():
        numbers = [*value] if isinstance(value, tuple) else [value]
        rows.append(("P", [name.replace("_", " "), "", "", "A", *numbers], []))
    return ("Properties70", [], rows)


def triangle(*objects, joins=(), model=(), geometry=()):
    """Return the nodes of a triangle of 1 m, with more objects and connections."""
    shape = [("Vertices", [PLACES], []), ("PolygonVertexIndex", [[0, 1, -3]], []), *geometry]
    own = [
        ("Geometry", [1, "a\0\1Geometry", "Mesh"], shape),
        ("Model", [2, "triangle\0\1Model", "Mesh"], [properties(**dict(model))]),
    ]
    connections = [("OO", 2, 0), ("OO", 1, 2), *joins]
    axes = properties(UpAxis=1, FrontAxis=2, CoordAxis=0, UnitScaleFactor=1.0)
    return [
        ("FBXHeaderExtension", [], [("FBXVersion", [7400], [])]),
        ("GlobalSettings", [], [axes]),
        ("Objects", [], [*own, *objects]),
        ("Connections", [], [("C", [*join], []) for join in connections]),
    ]


def moving(times, values, model=(), layers=1):
    """Return a triangle that turns about z, in one or more layers of an animation."""
    objects = [("AnimationStack", [10, "walk\0\1AnimStack", ""], [])]
    joins = []
    for number in range(layers):
        layer, node, curve = (20 + 10 * number + each for each in range(3))
        keys = [("KeyTime", [[int(time * SECOND) for time in times]], [])]
        keys += [
            ("KeyValueFloat", [[float(value) for value in values]], []),
            # All keys are linear.
            ("KeyAttrFlags", [[4]], []),
            ("KeyAttrDataFloat", [[0.0, 0.0, 0.0, 0.0]], []),
            ("KeyAttrRefCount", [[len(times)]], []),
        ]
        objects += [
            ("AnimationLayer", [layer, f"layer{number}\0\1AnimLayer", ""], []),
            ("AnimationCurveNode", [node, "R\0\1AnimCurveNode", ""], []),
            ("AnimationCurve", [curve, "\0\1AnimCurve", ""], keys),
        ]
        joins += [("OO", layer, 10), ("OO", node, layer), ("OP", node, 2, "Lcl Rotation")]
        joins.append(("OP", curve, node, "d|Z"))
    return triangle(*objects, joins=joins, model=model)


def morphing(shapes):
    """Return a triangle with a channel of ``shapes`` shapes."""
    objects = [
        ("Deformer", [30, "d\0\1Deformer", "BlendShape"], []),
        ("Deformer", [31, "smile\0\1SubDeformer", "BlendShapeChannel"], []),
    ]
    joins = [("OO", 30, 1), ("OO", 31, 30)]
    for number in range(shapes):
        content = [("Indexes", [[0]], []), ("Vertices", [[0.0, 0, 9]], [])]
        objects.append(("Geometry", [40 + number, "s\0\1Geometry", "Shape"], content))
        joins.append(("OO", 40 + number, 31))
    weights = [50.0 * (number + 1) for number in range(shapes)]
    objects[1][2].append(("FullWeights", [weights], []))
    return triangle(*objects, joins=joins)


PIVOT = [("RotationPivot", (50.0, 0.0, 0.0))]
MISREAD = {
    "vertex cache": (
        triangle(
            ("Deformer", [30, "waves\0\1Deformer", "VertexCacheDeformer"], []),
            joins=[("OO", 30, 1)],
        ),
        "the vertex cache waves",
    ),
    "in-between": (morphing(2), "the shapes between the ends of smile"),
    "layers": (
        moving((0, 1), (0, 90), layers=2),
        "the layers layer0, layer1 of the animation walk",
    ),
    "pivot": (
        moving((0, 1), (0, 90), model=PIVOT),
        "the pivot of triangle between the keys of its animation",
    ),
    "subdivision": (
        triangle(
            geometry=[
                ("Smoothness", [2], []),
                ("PreviewDivisionLevels", [2], []),
                ("RenderDivisionLevels", [2], []),
            ]
        ),
        "the subdivision of the mesh triangle",
    ),
}


@KINDS
@pytest.mark.parametrize("case", MISREAD)
def test_what_blender_misreads_is_named(tmp_path, kind, case):
    nodes, named = MISREAD[case]
    path = written(tmp_path / "a.fbx", nodes, kind)
    message = refusal(path)
    assert f"left out: {named}; " in message and "allow_missing: true" in message
    assert imported(path, allow_missing=True)["left_out"] == [named]


@KINDS
def test_what_blender_reads_is_not_refused(tmp_path, kind):
    """One layer, one shape of a channel, and a pivot whose keys stand at each frame."""
    for name, nodes in {
        "still": triangle(model=PIVOT),
        "one layer": moving((0, 1), (0, 90)),
        "one shape": morphing(1),
        "close keys": moving([i / 30 for i in range(31)], range(31), model=PIVOT),
    }.items():
        record = imported(written(tmp_path / f"{name}.fbx", nodes, kind))
        assert record["left_out"] == []
        assert ("unjudged" in record) == (name in ("one layer", "close keys"))


def test_a_place_that_is_no_number_is_refused(tmp_path):
    text = written(tmp_path / "a.fbx", triangle(), "text").read_text()
    path = tmp_path / "b.fbx"
    path.write_text(text.replace(",100,", ",1.#INF,", 1))
    assert "places are not numbers" in refusal(path)


@KINDS
def test_connections_of_properties_are_passed_over(tmp_path, kind):
    nodes = triangle(joins=[("PP", 2, "Lcl Translation", 2, "Lcl Scaling")])
    assert imported(written(tmp_path / "a.fbx", nodes, kind))["left_out"] == []


@KINDS
def test_further_animations_are_noted(tmp_path, kind):
    nodes = moving((0, 1), (0, 90))
    nodes[2][2].append(("AnimationStack", [11, "run\0\1AnimStack", ""], []))
    (noted,) = imported(written(tmp_path / "a.fbx", nodes, kind))["left_out"]
    assert noted == "the animations run: only one moves the model"


@KINDS
def test_pivots_and_places_of_an_object_at_rest_are_shown(tmp_path, kind):
    """A quarter turn about (0.5, 0, 0), and a scale of 2 in x."""
    model = [*PIVOT, ("Lcl_Rotation", (0.0, 0.0, 90.0)), ("Lcl_Scaling", (2.0, 1.0, 1.0))]
    path = written(tmp_path / "a.fbx", triangle(model=model), kind)
    record = imported(path, unit="metres")
    # y is up: (2 x - 0.5, y) becomes (0.5 - y, 2 x - 0.5), which is x and z here.
    np.testing.assert_allclose(record["box"], [[-0.5, 0, -0.5], [0.5, 0, 1.5]], atol=1e-5)
    assert record["left_out"] == [] and "unjudged" not in record
