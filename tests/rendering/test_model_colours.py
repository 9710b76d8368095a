"""What OBJ, PLY and STL files say of places, colours, textures and opacity is what a view shows.

The models are a square from (0, 0, 0) to (1, 1, 0), seen from above.
"""

import struct
from functools import partial

import model_imports
import numpy as np
import pytest
from model_imports import seen
from PIL import Image

# These tests run Blender.
pytestmark = pytest.mark.slow

imported = partial(model_imports.imported, unit="metres", up="z")
refusal = partial(model_imports.refusal, unit="metres", up="z")

VERTICES = ("0 0 0", "1 0 0", "1 1 0", "0 1 0")
FACES = ("3 0 1 2", "3 0 2 3")
# sRGB 128 of 255, by IEC 61966-2-1.
MIDDLE = 0.21586


def written(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def properties(kind, *names):
    return "".join(f"property {kind} {name}\n" for name in names)


def ply(vertex="", face="", of_vertices=("",) * 4, of_faces=("",) * 2, comment=""):
    """Return a PLY of the square, with more properties of vertices and faces, and their values."""
    head = f"ply\nformat ascii 1.0\n{comment}element vertex 4\n{properties('float', *'xyz')}"
    head += f"{vertex}element face 2\nproperty list uchar int vertex_indices\n{face}end_header\n"
    rows = [*zip(VERTICES, of_vertices, strict=True), *zip(FACES, of_faces, strict=True)]
    return head + "\n".join(" ".join(row) for row in rows) + "\n"


# ---- colours of vertices and faces ----------------------------------------------------------


def test_each_face_of_a_ply_has_its_own_colour(tmp_path):
    """The lower right triangle is red, and the upper left one is blue."""
    face = properties("uchar", "red", "green", "blue")
    text = ply(face=face, of_faces=("255 0 0", "0 0 255"))
    imported(written(tmp_path / "a.ply", text))
    picture = seen(tmp_path)
    np.testing.assert_allclose(picture[6, 6], (1, 0, 0, 1), atol=1e-3)
    np.testing.assert_allclose(picture[1, 1], (0, 0, 1, 1), atol=1e-3)


def stl(head, *attributes):
    """Return a binary STL of the square, with the attributes of its two facets."""
    facets = [(0, 0, 0, 1, 0, 0, 1, 1, 0), (0, 0, 0, 1, 1, 0, 0, 1, 0)]
    rows = [
        struct.pack("<12fH", 0, 0, 1, *places, attribute)
        for places, attribute in zip(facets, attributes, strict=True)
    ]
    return head.ljust(80, b" ") + struct.pack("<I", 2) + b"".join(rows)


# Binary STLs, and the linear colours of their lower right and upper left facets.
STLS = {
    "VisCAM": (stl(b"", 0x8000 | 31 << 10, 0x8000 | 31), (1, 0, 0), (0, 0, 1)),
    "VisCAM, one without": (stl(b"", 0x8000 | 31 << 10, 31), (1, 0, 0), (0.5, 0.5, 0.5)),
    "Magics": (stl(b"COLOR=\xff\x80\x00\xff", 31 << 10, 0x8000), (0, 0, 1), (1, MIDDLE, 0)),
    "none": (stl(b"", 0, 0), (0.5, 0.5, 0.5), (0.5, 0.5, 0.5)),
}


@pytest.mark.parametrize("case", STLS)
def test_the_colours_of_an_stl_are_shown(tmp_path, case):
    content, first, second = STLS[case]
    assert imported(written(tmp_path / "a.stl", content))["left_out"] == []
    picture = seen(tmp_path)
    np.testing.assert_allclose(picture[6, 6, :3], first, atol=1e-3)
    np.testing.assert_allclose(picture[1, 1, :3], second, atol=1e-3)


# ---- textures of PLY ------------------------------------------------------------------------


def texture(path):
    """Write a picture whose upper left quarter is red. The others are black."""
    picture = Image.new("RGB", (8, 8))
    picture.paste((255, 0, 0), (0, 0, 4, 4))
    picture.save(path)


UVS = ("0 0", "1 0", "1 1", "0 1")
CORNER_UVS = ("6 0 0 1 0 1 1", "6 0 0 1 1 0 1")
TEXTURE = "comment TextureFile my tex.png\n"
TEXTURED = {
    "s t": ply(properties("float", "s", "t"), of_vertices=UVS, comment=TEXTURE),
    "texture_u": ply(
        properties("float", "texture_u", "texture_v"), of_vertices=UVS, comment=TEXTURE
    ),
    "texcoord": ply(
        face=properties("list uchar float", "texcoord"), of_faces=CORNER_UVS, comment=TEXTURE
    ),
}


@pytest.mark.parametrize("case", TEXTURED)
def test_the_texture_of_a_ply_is_shown(tmp_path, case):
    texture(tmp_path / "my tex.png")
    record = imported(written(tmp_path / "a.ply", TEXTURED[case]))
    assert record["left_out"] == []
    assert {entry["path"] for entry in record["external_files"]} == {"a.ply", "my tex.png"}
    picture = seen(tmp_path)
    np.testing.assert_allclose(picture[1, 1], (1, 0, 0, 1), atol=1e-3)
    np.testing.assert_allclose(picture[6, 1], (0, 0, 0, 1), atol=1e-3)


def test_each_face_of_a_ply_has_its_own_texture(tmp_path):
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    Image.new("RGB", (4, 4), (0, 0, 255)).save(tmp_path / "blue.png")
    face = properties("list uchar float", "texcoord") + properties("int", "texnumber")
    rows = [f"{uvs} {number}" for number, uvs in enumerate(CORNER_UVS)]
    comment = "comment TextureFile red.png\ncomment TextureFile blue.png\n"
    imported(written(tmp_path / "a.ply", ply(face=face, of_faces=rows, comment=comment)))
    picture = seen(tmp_path)
    np.testing.assert_allclose(picture[6, 6], (1, 0, 0, 1), atol=1e-3)
    np.testing.assert_allclose(picture[1, 1], (0, 0, 1, 1), atol=1e-3)


def test_a_missing_texture_of_a_ply_is_named(tmp_path):
    path = written(tmp_path / "a.ply", TEXTURED["s t"])
    assert "my tex.png" in refusal(path)
    (left_out,) = imported(path, allow_missing=True)["left_out"]
    assert "my tex.png is missing" in left_out


def test_a_texture_without_a_place_is_refused(tmp_path):
    texture(tmp_path / "my tex.png")
    path = written(tmp_path / "a.ply", ply(comment=TEXTURE))
    assert "my tex.png" in refusal(path)
    assert "my tex.png" in imported(path, allow_missing=True)["left_out"][0]


def test_a_texture_of_a_ply_outside_its_folder_is_refused(tmp_path):
    (tmp_path / "own").mkdir()
    texture(tmp_path / "my tex.png")
    text = TEXTURED["s t"].replace("my tex.png", "../my tex.png")
    assert "outside the model's folder" in refusal(written(tmp_path / "own/a.ply", text))


# ---- numbers and faces that are wrong -------------------------------------------------------

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
STL_TEXT = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\n"
    "endfacet\nendsolid a\n"
)


# The square with a material, and with one place in a texture for all corners.
RED = OBJ.partition("f ")[0] + "vt 0.5 0.5\nusemtl red\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "abc", "1e999"])
@pytest.mark.parametrize(
    ("name", "content"), [("a.obj", OBJ), ("a.ply", ply()), ("a.stl", STL_TEXT)]
)
def test_a_place_that_is_no_number_is_refused(tmp_path, name, content, number):
    text = content.replace("1 1 0", f"1 1 {number}")
    for allow_missing in (False, True):
        message = refusal(written(tmp_path / name, text), allow_missing=allow_missing)
        assert "number" in message


@pytest.mark.parametrize("face", ["2 3 99", "0 3 4", "1 2 -5", "1 2 x", "1 2 3.5"])
def test_a_face_of_an_obj_whose_corners_do_not_exist_is_refused(tmp_path, face):
    message = refusal(written(tmp_path / "a.obj", f"{OBJ}f {face}\n"))
    assert "line 7" in message


def test_a_face_of_a_ply_that_blender_drops_is_refused(tmp_path):
    """Blender removes a quadrangle that repeats a corner, although it is a triangle."""
    text = ply().replace("3 0 2 3", "4 0 2 3 3")
    assert "2 triangles, of which Blender shows 1" in refusal(written(tmp_path / "a.ply", text))


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_a_model_that_is_too_far_for_32_bits_is_refused(tmp_path, suffix):
    """As scans have it that are placed on a map."""
    content = (OBJ if suffix == "obj" else ply()).replace("1 1 0", "500000.33 5000000.77 0")
    content = content.replace("0 0 0", "500000.03 5000000.07 0")
    content = content.replace("1 0 0", "500000.63 5000000.07 0")
    content = content.replace("0 1 0", "500000.03 5000000.77 0")
    message = refusal(written(tmp_path / f"a.{suffix}", content), unit="box")
    assert "move it to the origin" in message


def test_an_obj_has_all_that_its_objects_hold(tmp_path):
    """Negative numbers, comments, continued lines, slashes, and faces with many corners."""
    text = (
        "o first # a comment\nv 0 0 0\nv 1 0 0 # a corner\nv 1 1 0\nvt 0 0\nvn 0 0 1\n"
        "f -3/1/1 -2/1/1 \\\n -1/1/1\no second part\n\tv 0 0 1 1.0\nv 2 0 1\nv 2 2 1\nv 1 3 1\n"
        "v 0 2 1\ng group\nf 4//1 5//1 6//1 7//1 8//1\nl 1 2\n"
    )
    record = imported(written(tmp_path / "a.obj", text))
    assert record["left_out"] == ["lines (l)"]
    np.testing.assert_allclose(record["box"], [[0, 0, 0], [2, 3, 1]])


@pytest.mark.parametrize("keyword", ["surf 0 1 0 1 1 2 3 4", "call b.obj", "bzp 1 2 3 4"])
def test_a_surface_that_an_obj_does_not_show_is_refused(tmp_path, keyword):
    path = written(tmp_path / "a.obj", f"{OBJ}{keyword}\n")
    assert keyword.split()[0] in refusal(path)
    assert len(imported(path, allow_missing=True)["left_out"]) == 1


# ---- opacity --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lines", "alpha"),
    [
        ("Tr 0.25", 0.75),
        ("d 0.25\nTr 0.75", 0.25),
        ("Tr 0.75\nd 0.25", 0.25),
        ("d 0.4", 0.4),
        ("map_d grey.png", 128 / 255),
        ("map_d black.png", 0),
        ("map_d rgb.png", 0.2126),
        ("map_d opaque.png", 128 / 255),
        ("map_d clear.png", 64 / 255),
        ("map_Kd grey.png\nmap_d grey.png", 128 / 255),
    ],
)
def test_the_opacity_of_an_obj_is_shown(tmp_path, lines, alpha):
    """A texture of opacity is luminance, or the alpha of a picture that has one."""
    Image.new("L", (4, 4), 128).save(tmp_path / "grey.png")
    Image.new("L", (4, 4), 0).save(tmp_path / "black.png")
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "rgb.png")
    Image.new("RGBA", (4, 4), (128, 128, 128, 255)).save(tmp_path / "opaque.png")
    Image.new("RGBA", (4, 4), (128, 128, 128, 64)).save(tmp_path / "clear.png")
    written(tmp_path / "a.mtl", f"newmtl red\nKd 1 0 0\n{lines}\n")
    record = imported(written(tmp_path / "a.obj", RED))
    assert record["left_out"] == []
    # Each of 64 samples of a pixel passes the surface or not.
    assert seen(tmp_path)[..., 3].mean() == pytest.approx(alpha, abs=0.02)


def test_one_number_of_a_colour_is_grey(tmp_path):
    written(tmp_path / "a.mtl", "newmtl grey\nKd 0.25\n")
    path = written(tmp_path / "a.obj", OBJ.replace("f ", "usemtl grey\nf ", 1))
    message = refusal(path)
    assert "the base colour (0.25, 0.25, 0.25) of the material grey" in message
