"""The second readers of model files, beside trimesh, and the comparison with Blender's scene."""

import struct

import numpy as np
import pytest
import trimesh

from lightfield.core.errors import UserError
from lightfield.rendering.models.second_readers import reading
from lightfield.rendering.models.second_readers.facts import Geometry

# A stretched sphere away from the origin, as files in text give it.
SPHERE = trimesh.creation.icosphere(subdivisions=2, radius=0.7)
SPHERE.apply_transform(np.diag([1, 2, 3, 1]))
SPHERE.apply_translation([5, -3, 1])
SHEARED = np.array([[1, 0.5, 0, 2], [0, -2, 0.3, 0], [0.1, 0, 1, -1], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.obj", {}),
        ("a.ply", {}),
        ("a.ply", {"encoding": "ascii"}),
        ("a.stl", {}),
        ("a.stl", {"file_type": "stl_ascii"}),
    ],
)
def test_a_reader_finds_what_trimesh_finds(tmp_path, name, options):
    path = tmp_path / name
    SPHERE.export(path, **options)
    facts = reading.read(path, "z", 1)
    (mesh,) = facts.meshes
    np.testing.assert_allclose(mesh.box, SPHERE.bounds, atol=1e-6)
    assert mesh.triangles == len(SPHERE.faces)
    assert mesh.area == pytest.approx(SPHERE.area, rel=1e-6)
    assert not facts.lost and not facts.unused


def test_a_file_whose_y_points_up_is_turned(tmp_path):
    SPHERE.export(tmp_path / "a.obj")
    turned = SPHERE.copy()
    turned.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    (mesh,) = reading.read(tmp_path / "a.obj", "auto", 1).meshes
    np.testing.assert_allclose(mesh.box, turned.bounds, atol=1e-6)


def test_a_mesh_is_placed_by_any_matrix():
    """Also by one that shears and mirrors."""
    placed = SPHERE.copy()
    placed.apply_transform(SHEARED)
    sizes = np.full(len(SPHERE.faces), 3)
    mesh = Geometry(SPHERE.vertices, SPHERE.faces, sizes).placed("a", SHEARED)
    np.testing.assert_allclose(mesh.box, placed.bounds)
    assert mesh.area == pytest.approx(placed.area)


def test_faces_of_many_corners_have_the_area_of_their_triangles():
    """A square, and a hexagon that is not convex, whose corners lie far from the origin."""
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    arrow = [(0, 0, 1), (4, 0, 1), (4, 4, 1), (3, 4, 1), (3, 1, 1), (0, 1, 1)]
    places = np.array([*square, *arrow]) + 1e5
    mesh = Geometry(places, np.arange(10), [4, 6]).placed("a")
    assert mesh.triangles == 6
    assert mesh.area == pytest.approx(1 + 7)


def test_corners_and_faces_at_one_place_count_once():
    """Whether they are one vertex, or several at the same place."""
    places = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0), (-0.0, 1, 0)]
    corners = [0, 1, 2, 3, 1, 4, 2, 1, 0, 0, 1, 1, 0, 1, 2, 2, 0, 3, 0]
    geometry = Geometry(places, corners, [3, 3, 3, 3, 4, 3])
    assert geometry.faces == 1
    assert geometry.placed("a").area == pytest.approx(0.5)
    assert not Geometry(places, [], [])


def test_lists_of_different_lengths_are_read(tmp_path):
    """In both byte orders, with a property before and after the list."""
    for order, name in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        head = f"ply\nformat {name} 1.0\nelement vertex 5\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz")
        head += "element face 2\nproperty short a\nproperty list int uint vertex_indices\n"
        head += "property double b\nend_header\n"
        places = (0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 2)
        content = struct.pack(f"{order}15f", *places)
        content += struct.pack(f"{order}hi4Id", 7, 4, 0, 1, 2, 3, 0.5)
        content += struct.pack(f"{order}hi3Id", 7, 3, 0, 1, 4, 0.5)
        path = tmp_path / "a.ply"
        path.write_bytes(head.encode() + content)
        (mesh,) = reading.read(path, "auto", 1).meshes
        assert (mesh.triangles, mesh.area) == (3, pytest.approx(2))
        path.write_bytes(head.encode() + content[:-1])
        with pytest.raises(UserError, match="cut short"):
            reading.read(path, "auto", 1)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl"])
def test_long_files_are_read_in_parts(tmp_path, monkeypatch, suffix):
    """A part of a text ends anywhere, also within a continued line."""
    from lightfield.rendering.models.second_readers import text_lines

    path = tmp_path / f"a.{suffix}"
    options = {"obj": {}, "ply": {"encoding": "ascii"}, "stl": {"file_type": "stl_ascii"}}
    SPHERE.export(path, **options[suffix])
    if suffix == "obj":
        path.write_text(path.read_text().replace("f ", "f \\\n"))
    whole = reading.read(path, "z", 1).meshes[0]
    monkeypatch.setattr(text_lines, "_PART", 101)
    (mesh,) = reading.read(path, "z", 1).meshes
    assert (mesh.triangles, mesh.area) == (whole.triangles, pytest.approx(whole.area))
    np.testing.assert_allclose(mesh.box, SPHERE.bounds, atol=1e-6)


def test_a_usd_that_changes_is_read_again(tmp_path):
    """A family reads many models in one process, and a user may change one meanwhile."""
    path = tmp_path / "a.usda"
    for size in (1.0, 5.0):
        points = ", ".join(f"({size * x}, {y}, {z})" for x, y, z in SPHERE.vertices)
        path.write_text(
            '#usda 1.0\n(\nmetersPerUnit = 1\nupAxis = "Z"\n)\ndef Mesh "a" {\n'
            f"int[] faceVertexCounts = {[3] * len(SPHERE.faces)}\n"
            f"int[] faceVertexIndices = {SPHERE.faces.ravel().tolist()}\n"
            f"point3f[] points = [{points}]\n}}\n"
        )
        (mesh,) = reading.read(path, "z", 1).meshes
        np.testing.assert_allclose(mesh.box, SPHERE.bounds * (size, 1, 1), rtol=1e-6)
