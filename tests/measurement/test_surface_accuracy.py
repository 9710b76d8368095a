"""Surfaces compared with the truth: planes and spheres whose distances are known."""

import json

import numpy as np
import pytest
import trimesh

from lightfield.core.errors import UserError
from lightfield.measurement import surface_accuracy

DISTANCE = 0.05


def plane(height, width=1.0):
    """Return a mesh of a rectangle, one metre in y, at a height in metres."""
    vertices = [[0, 0, height], [width, 0, height], [width, 1, height], [0, 1, height]]
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False)


def sphere(radius):
    return trimesh.creation.icosphere(subdivisions=5, radius=radius)


@pytest.fixture
def surface(tmp_path):
    """Return a function that writes a mesh or cloud of trimesh, and reads it as a surface."""
    count = iter(range(100))

    def write(geometry, suffix=".ply"):
        path = tmp_path / f"{next(count)}{suffix}"
        geometry.export(path)
        return surface_accuracy.read_surface(path)

    return write


def test_two_planes_are_their_distance_apart_by_every_definition(surface):
    shown, true = surface(plane(DISTANCE)), surface(plane(0))
    dtu = surface_accuracy.dtu(shown, true, spacing=0.02, most_distance=0.1)
    # The nearest point is a sample beside the foot of the perpendicular.
    assert 1 < dtu["chamfer"] / DISTANCE < 1.2
    nerf = surface_accuracy.nerf_synthetic(shown, true, 50_000)
    assert nerf["chamfer"] == pytest.approx(2 * DISTANCE, rel=0.02)
    assert surface_accuracy.tanks_and_temples(shown, true, 1.5 * DISTANCE)["f_score"] == 1
    assert surface_accuracy.tanks_and_temples(shown, true, 0.9 * DISTANCE)["f_score"] == 0


def test_two_spheres_are_the_difference_of_their_radii_apart(surface):
    shown, true = surface(sphere(0.1 + DISTANCE)), surface(sphere(0.1))
    dtu = surface_accuracy.dtu(shown, true, spacing=0.01, most_distance=0.1)
    nerf = surface_accuracy.nerf_synthetic(shown, true, 50_000)
    for figures in (dtu, nerf):
        assert figures["accuracy"] == pytest.approx(DISTANCE, rel=0.03)
        assert figures["completeness"] == pytest.approx(DISTANCE, rel=0.03)


def test_half_a_surface_is_precise_but_half_complete(surface):
    shown, true = surface(plane(0, width=0.5)), surface(plane(0))
    figures = surface_accuracy.tanks_and_temples(shown, true, 0.02)
    assert figures["precision"] == 1
    # The margin of tau counts as complete.
    assert figures["recall"] == pytest.approx(0.52, abs=0.01)
    assert figures["f_score"] == pytest.approx(2 * 0.52 / 1.52, abs=0.01)


def test_dtu_leaves_out_what_is_too_far(surface):
    true = surface(plane(0))
    shown = surface(trimesh.util.concatenate([plane(DISTANCE), plane(5)]))
    figures = surface_accuracy.dtu(shown, true, spacing=0.02, most_distance=0.1)
    assert 1 < figures["accuracy"] / DISTANCE < 1.5
    with pytest.raises(UserError, match=r"0\.1 m or more from the reference everywhere"):
        surface_accuracy.dtu(surface(plane(5)), true, spacing=0.02, most_distance=0.1)


def test_the_points_of_dtu_are_its_spacing_apart_and_leave_no_gap(surface):
    points = surface_accuracy.thinned(
        np.random.default_rng(1).random((20_000, 3)) * [1, 1, 0], 0.02
    )
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
    assert distances[~np.eye(len(points), dtype=bool)].min() > 0.02
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0, 1, 50)]), axis=-1).reshape(-1, 2)
    gaps = np.linalg.norm(grid[:, None] - points[None, :, :2], axis=-1).min(axis=1)
    assert gaps.max() < 0.04


def test_distances_are_those_of_trimesh(surface):
    # trimesh measures to the triangles themselves, not to samples on them.
    true, shown = sphere(0.1), trimesh.creation.box((0.15, 0.15, 0.15))
    figures = surface_accuracy.nerf_synthetic(surface(shown), surface(true), 50_000)
    points, _ = trimesh.sample.sample_surface(shown, 20_000, seed=1)
    expected = np.abs(np.linalg.norm(points, axis=-1) - 0.1).mean()
    assert figures["accuracy"] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb", ".stl"])
def test_a_mesh_is_the_same_in_every_format(surface, suffix):
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    box.apply_translation([1, 2, 3])
    # glTF has Y up. Its files have (x, z, -y) for the dataset's (x, y, z).
    turned = box.copy()
    if suffix == ".glb":
        turned.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    read = surface(turned, suffix)
    np.testing.assert_allclose(read.points.min(axis=0), [0.95, 1.9, 2.85], atol=1e-6)
    np.testing.assert_allclose(read.points.max(axis=0), [1.05, 2.1, 3.15], atol=1e-6)
    assert read.area == pytest.approx(0.22)


def test_the_objects_of_a_gltf_are_where_its_nodes_place_them(tmp_path):
    scene = trimesh.Scene()
    moved = trimesh.transformations.translation_matrix([0, 5, 0])
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), transform=moved)
    scene.export(tmp_path / "scene.glb")
    read = surface_accuracy.read_surface(tmp_path / "scene.glb")
    np.testing.assert_allclose(read.points.mean(axis=0), [0, 0, 5], atol=1e-6)


def test_a_cloud_may_be_a_surface(surface):
    points, _ = trimesh.sample.sample_surface(plane(DISTANCE), 50_000, seed=1)
    cloud = surface(trimesh.PointCloud(points))
    assert cloud.triangles is None
    figures = surface_accuracy.nerf_synthetic(cloud, surface(plane(0)), 50_000)
    assert figures["chamfer"] == pytest.approx(2 * DISTANCE, rel=0.03)


def test_a_spacing_that_is_too_fine_for_the_surface_is_refused(surface):
    with pytest.raises(UserError, match=r"has 1 square metres, too many .* give one of"):
        surface_accuracy.dtu(surface(plane(0)), surface(plane(0)))


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.txt", "x", "a.txt: is not a surface file; its name must end in .ply"),
        ("a.ply", "no ply", "a.ply: is not a valid surface"),
        ("a.obj", "", "a.obj: "),
        ("a.glb", "glTF", "a.glb: is not a valid surface"),
    ],
)
def test_what_is_no_surface_is_refused(tmp_path, name, content, problem):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(UserError) as caught:
        surface_accuracy.read_surface(path)
    assert str(caught.value).startswith(f"{tmp_path}/{problem}")
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_program_writes_the_figures(tmp_path, run_program):
    plane(DISTANCE).export(tmp_path / "shown.ply")
    plane(0).export(tmp_path / "true.ply")
    surfaces_given = [tmp_path / "shown.ply", "--reference", tmp_path / "true.ply"]
    output = tmp_path / "figures.json"
    arguments = ["--protocol", "tanks_and_temples", "--tau", "0.1", "--output", output]
    said = run_program("evaluate_surface.py", *surfaces_given, *arguments).stdout
    assert said == "precision 1, recall 1, f_score 1\n"
    expected = {"protocol": "tanks_and_temples", "tau": 0.1}
    expected |= {"precision": 1.0, "recall": 1.0, "f_score": 1.0}
    assert json.loads(output.read_text()) == expected
    for wrong, problem in (
        (["--protocol", "dtu", "--tau", "1"], "--tau: is only for --protocol tanks_and_temples"),
        (["--protocol", "tanks_and_temples"], "--tau: is missing"),
    ):
        result = run_program("evaluate_surface.py", *surfaces_given, *wrong, check=False)
        assert result.returncode != 0
        assert problem in result.stderr
