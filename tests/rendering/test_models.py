"""Scenes of model files: upright, of unit size and textured in six formats, or refused."""

import base64
import json
import os
import shutil
import struct
import subprocess
from pathlib import Path
from types import SimpleNamespace

import forks
import numpy as np
import pytest
from checkouts import checkout, jobs_on, snakemake
from conftest import BLENDER, SCRIPTS
from model_imports import imported

from lightfield.configuration import keys
from lightfield.core.errors import UserError
from lightfield.rendering.models import model_files

# The files of `exported_models`.
FORMATS = ("fbx", "glb", "gltf", "obj", "ply", "stl", "usda", "usdc", "usdz")
TEXTURED = ("fbx", "glb", "gltf", "obj", "usda", "usdc", "usdz")
# The model of 2 × 1 × 3 m in a box of 1 m.
HALF = np.array([2, 1, 3]) / 3 / 2


@pytest.fixture(scope="module")
def renders(tmp_path_factory):
    """The models that Blender exported, and what became of them: folder, records, pictures."""
    folder = tmp_path_factory.mktemp("models")
    program = BLENDER / "exported_models.py"
    environment = os.environ | {"PYTHONPATH": f"{SCRIPTS}{os.pathsep}{program.parent}"}
    result = subprocess.run(
        [forks.python(), program, folder], capture_output=True, text=True, env=environment
    )
    assert result.returncode == 0, result.stderr
    with np.load(folder / "pictures.npz") as pictures:
        records = json.loads((folder / "records.json").read_text())
        return SimpleNamespace(folder=folder, records=records, pictures=dict(pictures))


def silhouette(picture):
    return picture[..., 3] > 0.5


@pytest.mark.parametrize("name", FORMATS)
def test_a_model_fills_the_unit_box_upright(renders, name):
    """The model's slab is below, and its cone above on the right."""
    record = renders.records[f"shape.{name}"]
    np.testing.assert_allclose(record["box"], [-HALF, HALF], atol=1e-5)
    shape = silhouette(renders.pictures[f"shape.{name}"])
    rows = np.flatnonzero(shape.any(axis=1))
    widths = shape.sum(axis=1)
    assert widths[rows[0]] < widths[rows[-1]]
    assert shape[rows[len(rows) // 2]].nonzero()[0].min() > 15


@pytest.mark.parametrize("name", FORMATS)
def test_all_formats_have_the_same_silhouette(renders, name):
    shape = silhouette(renders.pictures[f"shape.{name}"])
    assert 50 < shape.sum() < 500
    assert (shape != silhouette(renders.pictures["shape.glb"])).sum() <= 2


@pytest.mark.parametrize("name", TEXTURED)
def test_the_texture_shows_its_colour_and_is_packed(renders, name):
    picture = renders.pictures[f"shape.{name}"]
    red, green, _ = picture[silhouette(picture)][:, :3].mean(axis=0)
    assert 0.2 < red < 0.9 and green < 0.1 * red
    assert renders.records[f"shape.{name}"]["packed"]


@pytest.mark.parametrize("name", ["ply", "stl"])
def test_a_model_without_a_material_is_grey(renders, name):
    picture = renders.pictures[f"shape.{name}"]
    colour = picture[silhouette(picture)][:, :3].mean(axis=0)
    assert colour.min() > 0.1 and np.ptp(colour) < 0.02


@pytest.mark.parametrize("name", FORMATS)
def test_softboxes_over_expose_nothing(renders, name):
    picture = renders.pictures[f"shape.{name}"]
    assert picture[..., :3].max() < 1


@pytest.mark.parametrize("name", [f"shape.{suffix}" for suffix in FORMATS])
def test_softboxes_do_without_the_light_tree(renders, name):
    """Three lamps cost less without it. An OBJ gives each material an emission, which is black."""
    assert not renders.records[name]["sampling"]["light_tree"]


@pytest.mark.parametrize("name", ["glowing.fbx", "glowing.glb", "glowing.obj", "city"])
def test_models_that_glow_and_environments_keep_the_light_tree(renders, name):
    assert renders.records[name]["sampling"]["light_tree"]


def test_another_light_of_the_softboxes_leaves_models_in_environments_alone(monkeypatch):
    def identities():
        return [keys.model_fingerprint({"light": light}, []) for light in ("softboxes", "city")]

    before = identities()
    monkeypatch.setitem(keys.VERSIONS, "softboxes", keys.VERSIONS["softboxes"] + 1)
    softboxes, city = identities()
    assert softboxes != before[0]
    assert city == before[1]


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("shape.fbx", {"shape.fbx", "red.png"}),
        ("shape.glb", {"shape.glb"}),
        ("shape.gltf", {"shape.gltf", "shape.bin", "red.png"}),
        ("shape.obj", {"shape.obj", "shape.mtl", "red.png"}),
        ("shape.usda", {"shape.usda", "textures/red.png"}),
        ("shape.usdc", {"shape.usdc", "textures/red.png"}),
    ],
)
def test_the_record_lists_the_files_that_were_read(renders, name, files):
    assert {file["path"] for file in renders.records[name]["external_files"]} == files


def test_metres_keep_size_and_place(renders):
    record = renders.records["metres"]
    np.testing.assert_allclose(record["box"], [[-1, -0.5, 0], [1, 0.5, 3]], atol=1e-5)


@pytest.mark.parametrize("name", ["fbx", "glb", "obj", "stl", "usdc"])
def test_the_record_says_how_a_model_comes_into_the_unit_box(renders, name):
    """Points of the model in metres, shifted and then scaled, are its points in the scene."""
    placement = renders.records[f"shape.{name}"]["placement"]
    corners = np.array(renders.records["metres"]["box"])
    placed = (corners + placement["shift"]) * placement["scale"]
    np.testing.assert_allclose(placed, renders.records[f"shape.{name}"]["box"], atol=1e-5)
    assert "placement" not in renders.records["metres"]


@pytest.mark.slow
@pytest.mark.parametrize("side, is_plausible", [(0.002, False), (0.02, True), (90, True), (500, 0)])
def test_a_model_of_a_plausible_size_in_metres_is_told_of(tmp_path, capsys, side, is_plausible):
    from lightfield.rendering.imports import model
    from lightfield.stages.scene import ImportModel, ImportSettings

    path = written(tmp_path / "a.obj", TRIANGLE.replace("1", str(side), 2))
    for unit in ("box", "metres"):
        settings = ImportSettings(model=str(path), unit=unit)
        output, record = tmp_path / "a.blend", tmp_path / "a.json"
        model.import_model(ImportModel(settings=settings, output=output, record=record))
        said = capsys.readouterr().out
        scaled = f"note: {path}: unit: box: moved by (-"
        assert (scaled in said, f"scaled by {1 / side:.4g}" in said) == (unit == "box",) * 2
        assert ("unit: metres keeps" in said) == (unit == "box" and bool(is_plausible))


def test_another_axis_points_up(renders):
    """The model's longest side, along the file's z, becomes the depth."""
    low, high = np.array(renders.records["turned"]["box"])
    np.testing.assert_allclose(high - low, 2 * HALF[[0, 2, 1]], atol=1e-5)


def test_cameras_and_lamps_of_the_file_are_left_out(renders):
    assert renders.records["city"]["kinds"] == ["EMPTY", "MESH"]


def test_the_ground_catches_the_shadow_of_the_model(renders):
    """The floor is visible only where a shadow lies: partly opaque, and black."""
    alone = renders.pictures["from above"]
    grounded = renders.pictures["from above, with ground"]
    beside = alone[..., 3] == 0
    shadow = beside & (grounded[..., 3] > 0.05)
    assert 20 < shadow.sum() < 0.9 * beside.sum()
    assert grounded[shadow][:, :3].max() < 0.05
    assert silhouette(grounded)[silhouette(alone)].all()
    # The floor is no part of the model's box.
    box = renders.records["from above, with ground"]["box"]
    np.testing.assert_allclose(box, [-HALF, HALF], atol=1e-5)


@pytest.mark.parametrize("name", ["last frame", "moving.fbx", "moving.usdc"])
def test_an_animated_model_is_measured_at_its_frame(renders, name):
    """The cone moves 4 m to the left. So the model is 5 m wide, and the slab at its right end."""
    low, high = np.array(renders.records[name]["box"])
    np.testing.assert_allclose(high - low, [1, 0.2, 0.6], atol=1e-5)
    first_width = np.diff(np.array(renders.records["first frame"]["box"])[:, 0])
    np.testing.assert_allclose(first_width, 2 * HALF[0], atol=1e-5)
    shape = silhouette(renders.pictures[name])
    assert (shape != silhouette(renders.pictures["last frame"])).sum() <= 2
    assert shape[:, :8].any() and shape[:, 24:].any()


# A tetrahedron of 1 m, and two ways to place it at x = 0 and x = 10.
TETRAHEDRON = """def Mesh "shape" {
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
}
"""
POINT_INSTANCER = f"""#usda 1.0
(upAxis = "Z")
def PointInstancer "points" {{
    point3f[] positions = [(0, 0, 0), (10, 0, 0)]
    int[] protoIndices = [0, 0]
    rel prototypes = </points/shape>
    {TETRAHEDRON}
}}
"""
INSTANCES = f"""#usda 1.0
(upAxis = "Z")
def Xform "prototype" {{
    {TETRAHEDRON}
}}
def "here" (
    instanceable = true
    references = </prototype>
) {{
}}
def "there" (
    instanceable = true
    references = </prototype>
) {{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("content", [POINT_INSTANCER, INSTANCES], ids=["points", "instanceable"])
def test_instances_are_scaled_once(tmp_path, content):
    record = imported(written(tmp_path / "a.usda", content))
    half = np.array([11, 1, 1]) / 11 / 2
    np.testing.assert_allclose(record["box"], [-half, half], atol=1e-5)


@pytest.mark.slow
def test_curves_and_points_are_left_out(tmp_path):
    import bpy

    curve = """def BasisCurves "curve" {
    uniform token type = "linear"
    int[] curveVertexCounts = [2]
    point3f[] points = [(0, 0, 0), (5, 0, 0)]
    float[] widths = [0.1, 0.1]
}
"""
    points = (
        'def Points "points" {\n    point3f[] points = [(0, 5, 0)]\n    float[] widths = [1]\n}\n'
    )
    path = written(tmp_path / "a.usda", f"#usda 1.0\n{TETRAHEDRON}{curve}{points}")
    np.testing.assert_allclose(imported(path)["box"], [[-0.5] * 3, [0.5] * 3], atol=1e-5)
    assert {obj.type for obj in bpy.data.objects} <= {"EMPTY", "LIGHT", "MESH"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_ply_may_have_the_line_ends_of_windows(tmp_path, kind):
    head = (HEAD + FACE).replace("ascii", kind).replace("\n", "\r\n").encode()
    text = b"0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 2\r\n"
    numbers = struct.pack("<9fB3i", 0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2)
    path = written(tmp_path / "a.ply", head + (text if kind == "ascii" else numbers))
    box = imported(path)["box"]
    np.testing.assert_allclose(box, [[-0.5, -0.5, 0], [0.5, 0.5, 0]], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("change", [(" ", "\t"), (" ", "   "), ("\n", " \n")])
def test_a_plys_header_may_have_tabs_and_more_blanks(tmp_path, change):
    head = (HEAD + FACE).removeprefix("ply\n").replace(*change)
    text = f"ply\n{head}" + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    box = imported(written(tmp_path / "a.ply", text))["box"]
    np.testing.assert_allclose(box, [[-0.5, -0.5, 0], [0.5, 0.5, 0]], atol=1e-5)


@pytest.mark.slow
def test_a_ply_whose_faces_repeat_corners_is_imported_without_them(tmp_path):
    head = (HEAD + FACE).replace("face 1", "face 4")
    faces = "3 0 1 2\n3 0 0 1\n3 0 1 2\n3 1 1 1\n"
    record = imported(written(tmp_path / "a.ply", f"{head}0 0 0\n1 0 0\n0 1 0\n{faces}"))
    assert record["left_out"] == ["3 of 4 faces, which repeat a corner or another face"]
    np.testing.assert_allclose(record["box"], [[-0.5, -0.5, 0], [0.5, 0.5, 0]], atol=1e-5)


@pytest.mark.slow
def test_several_solids_of_an_stl_are_one_model(tmp_path):
    second = STL.replace("solid a", "solid b").replace("0 1 0", "0 4 0")
    box = imported(written(tmp_path / "a.stl", STL + second))["box"]
    np.testing.assert_allclose(box, [[-0.125, -0.5, 0], [0.125, 0.5, 0]], atol=1e-5)


# ---- files that a model names ---------------------------------------------------------------


def written(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


GLTF = {"asset": {"version": "2.0"}}
GLTF["buffers"] = [{"uri": "data:;base64,"}, {"uri": "a%20b.bin"}]
GLTF["images"] = [{"uri": "c.png"}, {"bufferView": 0}]
GLTF_TEXT = json.dumps(GLTF)
LENGTHS = struct.pack("<III", 0x46546C67, 2, 20 + len(GLTF_TEXT))
GLB = LENGTHS + struct.pack("<I4s", len(GLTF_TEXT), b"JSON") + GLTF_TEXT.encode()
USDA = """#usda 1.0
( subLayers = [@./deeper/layer.usda@] )
def "a" (
    references = [@other.usd@</b>, @https://a.org/c.usd@]
) {
    asset inputs:file = @tex/wood.png@
    asset inputs:tiles = @tex/wood.<UDIM>.png@
}
"""


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.gltf", GLTF_TEXT, {"a b.bin", "c.png"}),
        ("a.glb", GLB, {"a b.bin", "c.png"}),
        ("a.obj", "# a\nmtllib my own.mtl\nv 0 0 0\n", {"my own.mtl"}),
        ("a.usda", USDA, {"deeper/layer.usda", "deeper/bark.jpg", "other.usd", "tex/wood.png"}),
        ("a.ply", "ply\ncomment TextureFile my tex.png\nend_header\n", {"my tex.png"}),
    ],
)
def test_a_model_names_other_files(tmp_path, name, content, expected):
    written(tmp_path / "deeper/layer.usda", '#usda 1.0\ndef "c" {\n    asset a = @bark.jpg@\n}\n')
    references, _ = model_files.survey(written(tmp_path / name, content))
    assert {each.path for each in references} == {tmp_path / file for file in expected}


def test_layers_that_name_each_other_are_read_once(tmp_path):
    first = written(tmp_path / "a.usda", "#usda 1.0\n(subLayers = [@b.usda@])\n")
    second = written(tmp_path / "b.usda", "#usda 1.0\n(subLayers = [@a.usda@])\n")
    references, _ = model_files.survey(first)
    assert [each.path for each in references] == [second]


# ---- refusals -------------------------------------------------------------------------------

HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
HEAD += "property float z\n"
FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
# Blender's other importers replace what is not a number by 0.
NOT_A_NUMBER = """#usda 1.0
def Mesh "a" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (nan, 0, 0), (0, 1, 0)]
}
"""
# A file may declare any type, and Blender leaves out what it cannot read.
INT_POINTS = NOT_A_NUMBER.replace(
    "point3f[] points = [(0, 0, 0), (nan, 0, 0), (0, 1, 0)]", "int points = 3"
)
TEXT_CORNERS = NOT_A_NUMBER.replace(
    "int[] faceVertexIndices = [0, 1, 2]", 'string faceVertexIndices = "a"'
)
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
STL = """solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""
# A texture in a format that is an extension of glTF.
UNREAD_TEXTURE = json.dumps(
    {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_texture_basisu"],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        "images": [{"uri": "data:image/ktx2;base64,q0tUWCAyMLs="}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
            | {"min": [0, 0, 0], "max": [1, 1, 0]}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [
            {
                "byteLength": 36,
                "uri": "data:application/octet-stream;base64,"
                + base64.b64encode(struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)).decode(),
            }
        ],
    }
)
HIDDEN_NODE = json.dumps(
    {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_node_visibility"],
        "nodes": [
            {"name": "shown"},
            {"name": "spare", "extensions": {"KHR_node_visibility": {"visible": False}}},
        ],
    }
)
# Broken models: the file, its content, and what the message says.
BROKEN = [
    *((f"a.{name}", b"", "is empty") for name in FORMATS),
    *((f"a.{name}", "<html>404 not found</html>\n", "") for name in FORMATS),
    *((f"a.{name}", bytes(5000), "") for name in FORMATS),
    ("a.obj", "v 0 0 0\nv 1 0 0\n", "has no faces"),
    ("a.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "at one place"),
    ("a.obj", TRIANGLE.replace("v 1", "v 1e30"), "1e+30"),
    ("a.obj", "mtllib gone.mtl\n" + TRIANGLE, "gone.mtl"),
    ("a.obj", b"mtllib \xe4.mtl\n" + TRIANGLE.encode(), "missing"),
    ("a.ply", HEAD + "end_header\n0 0 0\n1 0 0\n0 1 0\n", "has no faces"),
    ("a.ply", HEAD + FACE + "0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", "corners that do not exist"),
    ("a.ply", HEAD + f"comment {'x' * 70000}\n" + FACE, "line 7 of its header"),
    ("a.usda", NOT_A_NUMBER, "not numbers"),
    ("a.usda", INT_POINTS, "points of another type than point3f[]"),
    ("a.usda", TEXT_CORNERS, "faceVertexIndices of another type than int[]"),
    ("a.stl", STL + STL.replace("solid a", "solid b")[:-20], "cut short"),
    ("a.gltf", UNREAD_TEXTURE, "does not read"),
    ("a.gltf", json.dumps({"asset": {"version": "2.0"}}), "has no faces"),
    ("a.gltf", HIDDEN_NODE, "hides the node spare"),
    ("a.gltf", GLTF_TEXT, "missing"),
    ("a.gltf", json.dumps({"asset": {"version": "9.0"}}), "cannot import it"),
    ("a.gltf", json.dumps({"asset": {"version": "2.0"}, "nodes": 7}), "cannot import it"),
    ("a.usda", "#usda 1.0\n( subLayers = [@gone.usda@] )\n", "gone.usda"),
]


def refusal(path, folder, **settings):
    """Return the message with which the import of a model is refused."""
    # Blender has one global state, so it is not imported with the module.
    from lightfield.rendering.imports import model
    from lightfield.stages.scene import ImportSettings

    with pytest.raises(UserError) as caught:
        model.make_scene(ImportSettings(model=str(path), **settings), folder)
    return str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "content", "said"), BROKEN)
def test_a_broken_model_is_refused_in_one_line(tmp_path, name, content, said):
    message = refusal(written(tmp_path / name, content), tmp_path)
    assert message.startswith(f"{tmp_path / name}: ")
    assert said in message and message.isprintable()


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
@pytest.mark.parametrize(
    "content",
    [
        b"\xff" * 80 + struct.pack("<I", 1) + bytes(50),
        b"ply\nformat ascii 1.0\n",
        b"<html>404 not found</html>\n",
    ],
    ids=["STL", "PLY", "HTML"],
)
def test_a_file_of_another_format_is_said_not_to_be_gltf(tmp_path, name, content):
    path = written(tmp_path / name, content)
    with pytest.raises(UserError) as caught:
        model_files.check(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: is not a glTF file")
    assert "codec" not in message and message.isprintable()


@pytest.mark.parametrize("name", ["fbx", "glb", "gltf", "ply", "stl", "usda", "usdc", "usdz"])
def test_half_a_model_is_refused_in_one_line(renders, tmp_path, monkeypatch, name):
    """Half of an OBJ is a smaller OBJ: nothing in it says how much is missing."""
    content = (renders.folder / f"shape.{name}").read_bytes()
    written(tmp_path / f"half.{name}", content[: len(content) // 2])
    monkeypatch.chdir(tmp_path)
    message = refusal(Path(f"half.{name}"), tmp_path)
    assert message.startswith(f"half.{name}: ") and message.isprintable()
    # The message is the same in every folder.
    assert str(tmp_path) not in message


@pytest.mark.parametrize("name", ["shape.gltf", "shape.obj", "shape.usda", "shape.usdc"])
def test_a_missing_texture_is_named(renders, tmp_path, name):
    for file in renders.folder.glob("shape.*"):
        shutil.copy(file, tmp_path)
    message = refusal(tmp_path / name, tmp_path)
    assert message.startswith(f"{tmp_path / name}: ")
    assert "red.png" in message and "allow_missing: true" in message


def test_a_missing_texture_may_be_allowed(renders, tmp_path):
    from lightfield.rendering.imports import model
    from lightfield.stages.scene import ImportSettings

    shutil.copy(renders.folder / "shape.obj", tmp_path)
    settings = ImportSettings(model=str(tmp_path / "shape.obj"), allow_missing=True)
    record = model.make_scene(settings, tmp_path)
    np.testing.assert_allclose(record["box"], [-HALF, HALF], atol=1e-5)
    assert {"path": "shape.mtl", "bytes": None, "mtime_ns": None, "sha256": None} in record[
        "external_files"
    ]


@pytest.mark.slow
def test_metres_beyond_blenders_precision_are_refused(tmp_path):
    path = written(tmp_path / "far.obj", TRIANGLE.replace("1", "1e9", 1))
    assert "unit: box" in refusal(path, tmp_path, unit="metres")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["a b'c.obj", "stühle—椅.obj", "$(id).OBJ", "-rf.obj", "a" * 200 + ".obj"]
)
def test_odd_names_of_files_are_imported(tmp_path, name):
    from lightfield.rendering.imports import model
    from lightfield.stages.scene import ImportSettings

    settings = ImportSettings(model=str(written(tmp_path / name, TRIANGLE)))
    assert model.make_scene(settings, tmp_path)["external_files"][0]["path"] == name


# ---- the workflow ---------------------------------------------------------------------------

SCENE = """
scene: {model: models/shape.obj, ground: true}
render: {samples: 1, transparent: true}
rigs:
  ring:
    type: ring
    count: 2
    size: 2.5
    elevation: 20
    camera: {lens: rectilinear, fov: 40, resolution: [32, 32]}
"""


def test_a_dataset_of_a_model_follows_its_files(renders, tmp_path):
    folder = checkout(tmp_path / "plenoforge", chair=SCENE)
    shutil.copytree(renders.folder, folder / "models")
    target = "results/chair/ring/validation.json"
    choice = ("--config", "scenes=chair", "preset=full", "--", target)
    result = snakemake(folder, *choice)
    assert result.returncode == 0, result.stdout + result.stderr
    validation = json.loads((folder / target).read_text())
    assert validation["valid"]
    placement = json.loads((folder / "work/chair/model.json").read_text())["placement"]
    lightfield = json.loads((folder / "results/chair/ring/lightfield.json").read_text())
    assert lightfield["model_placement"] == placement
    assert "note: models/shape.obj: unit: box: moved by" in result.stdout + result.stderr

    def planned():
        result = snakemake(folder, "--dry-run", "--logger", "jobs", *choice)
        return {job["rule"] for job in jobs_on(result.stderr) if job["output"]}

    assert not planned()
    texture = folder / "models/red.png"
    texture.write_bytes(texture.read_bytes() + b"\0")
    assert {"import_model", "inventory", "lightfield", "render"} <= planned()
    texture.unlink()
    result = snakemake(folder, *choice)
    assert result.returncode != 0
    assert "import_model failed: error: models/shape.obj: files that it names are missing" in (
        result.stderr
    )


@pytest.mark.slow
def test_a_missing_model_is_named_before_the_first_job(tmp_path):
    folder = checkout(tmp_path / "plenoforge", chair=SCENE)
    no_file = "error: configs/scenes/chair.yaml:2: scene.model: there is no file models/shape.obj"
    result = snakemake(folder, "--config", "scenes=chair")
    assert result.returncode != 0
    assert f"{no_file}; put it there" in result.stderr
    written(folder / "models/Shape.OBJ", TRIANGLE)
    result = snakemake(folder, "--config", "scenes=chair")
    assert f"{no_file} (models/Shape.OBJ differs only in case); put it there" in result.stderr
