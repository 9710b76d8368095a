"""Camera rigs, compared with Blender's own icosphere, normals, cross products and mathutils."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from lightfield.configuration.scene_yaml import load_scene
from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.geometry.rigs import from_settings
from lightfield.geometry.rigs.sphere import icosphere, nested

# Every dataset of SILVR: the published number of views, and the rig.
SILVR: dict[str, tuple[int, dict[str, Any]]] = {
    "barbershop cuboid": (
        1400,
        {"type": "cuboid", "cameras": [10, 30, 10], "size": [1, 3, 1], "center": [0.2, -0.4, 1.05]},
    ),
    "lone_monk cuboid": (2226, {"type": "cuboid", "cameras": [21, 21, 16], "size": [4, 4, 3]}),
    "garden cuboid": (1806, {"type": "cuboid", "cameras": [21, 21, 11], "size": [2, 2, 1]}),
    "barbershop sphere": (
        642,
        {"type": "sphere", "subdivisions": 4, "size": 1.45, "center": [0.2, -0.4, 1.05]},
    ),
    "lone_monk sphere": (642, {"type": "sphere", "subdivisions": 4, "size": 4.0}),
    "garden sphere": (642, {"type": "sphere", "subdivisions": 4, "size": 1.7}),
    "evaluation sphere": (42, {"type": "sphere", "subdivisions": 2, "size": 0.5}),
}

# The paper's table of camera setups: the scene, the views, and the mean distance from a camera to
# the nearest other one, in centimetres.
PRINTED = {
    "LFCuboid_1mx3mx1m": ("barbershop", 1400, 11),
    "LFSphere_e105cm_d145cm": ("barbershop", 642, 9),
    "LFCuboid_4mx4mx3m": ("lone_monk", 2226, 20),
    "LFSphere_e220cm_d400cm": ("lone_monk", 642, 31),
    "LFCuboid_2x2x1": ("garden", 1806, 10),
    "LFSphere_e100cm_d170cm": ("garden", 642, 13),
}

# Further options of the addon, and the keys that a scene may add.
OTHERS: dict[str, tuple[int, dict[str, Any]]] = {
    "plane": (35, {"type": "plane", "cameras": [7, 5], "size": [2, 1, 1]}),
    "cylinder": (60, {"type": "cylinder", "cameras": [12, 5], "size": [1, 1, 2]}),
    "cylinder inside": (36, {"type": "cylinder", "cameras": [12, 3], "face_inside": True}),
    "sphere inside": (162, {"type": "sphere", "subdivisions": 3, "face_inside": True}),
    "twelve": (12, {"type": "sphere", "subdivisions": 1}),
    "turned cuboid": (
        94,
        {
            "type": "cuboid",
            "cameras": [3, 4, 5],
            "size": [1, 2, 3],
            "rotation": [20, -35, 110],
            "center": [3, -2, 1],
        },
    ),
    "turned sphere": (
        162,
        {"type": "sphere", "subdivisions": 3, "rotation": [90, 45, -60], "center": [0, 0, 2]},
    ),
}

RIGS = {label: (count, from_settings(rig)) for label, (count, rig) in (SILVR | OTHERS).items()}

# One rig of each type in the registry. Rigs of files have tests of their own.
KEYS = [{"position": [0, 0, 0]}, {"position": [3, 0, 0]}, {"position": [3, 4, 1]}]
EACH: dict[str, dict[str, Any]] = {
    "plane": {"cameras": [3, 2]},
    "cuboid": {"cameras": [3, 2, 4]},
    "cylinder": {"cameras": [5, 2]},
    "sphere": {"subdivisions": 2},
    "lattice": {"cameras": [2, 3, 1]},
    "hemisphere": {"count": 7},
    "ring": {"count": 5},
    "spiral": {"count": 9, "turns": 2},
    "path": {"count": 6, "keys": KEYS},
    "random": {"count": 8},
}
OF_FILES = {"poses", "blend_camera"}
# The same rigs with more cameras.
MORE: dict[str, dict[str, Any]] = {
    "plane": {"cameras": [3, 3]},
    "cuboid": {"cameras": [3, 2, 5]},
    "cylinder": {"cameras": [5, 3]},
    "sphere": {"subdivisions": 3},
    "lattice": {"cameras": [2, 3, 2]},
    "hemisphere": {"count": 15},
    "ring": {"count": 13},
    "spiral": {"count": 17},
    "path": {"count": 14},
    "random": {"count": 16},
}

# The addon's method by Blender's own means. This imports nothing of the project.
BLENDER = r"""
import json, math, sys
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector


def grid(columns, rows):
    for row in range(rows):
        for column in range(columns):
            yield row * columns + column, column / (columns - 1), row / (rows - 1)


def local(rig):
    kind = rig["type"]
    if kind == "plane":
        for i, u, v in grid(*rig["cameras"]):
            yield f"view_{i:04d}f", (u - 0.5, 0, 0.5 - v), Euler((math.pi / 2, 0, 0))
    elif kind == "cuboid":
        nx, ny, nz = rig["cameras"]
        for i, u, v in grid(nx, nz):
            yield f"view_f{i:04d}f", (u - 0.5, 0.5, 0.5 - v), Euler((math.pi / 2, 0, 0))
        for i, u, v in grid(nx, nz):
            yield f"view_b{i:04d}f", (0.5 - u, -0.5, 0.5 - v), Euler((math.pi / 2, 0, math.pi))
        for i, u, v in grid(ny, nz):
            yield f"view_l{i:04d}f", (-0.5, u - 0.5, 0.5 - v), Euler((math.pi / 2, 0, math.pi / 2))
        for i, u, v in grid(ny, nz):
            yield f"view_r{i:04d}f", (0.5, 0.5 - u, 0.5 - v), Euler((math.pi / 2, 0, -math.pi / 2))
        for i, u, v in grid(nx, ny):
            yield f"view_u{i:04d}f", (0.5 - u, v - 0.5, 0.5), Euler((math.pi, 0, 0))
        for i, u, v in grid(nx, ny):
            yield f"view_d{i:04d}f", (u - 0.5, 0.5 - v, -0.5), Euler((0, 0, 0))
    elif kind == "cylinder":
        columns, rows = rig["cameras"]
        for row in range(rows):
            for column in range(columns):
                a = column * 2 * math.pi / columns
                turned = -a + (math.pi if rig.get("face_inside") else 0)
                place = (0.5 * math.sin(a), 0.5 * math.cos(a), 0.5 - row / (rows - 1))
                yield f"view_{row * columns + column:04d}f", place, Euler((math.pi / 2, 0, turned))
    elif kind == "sphere":
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=rig["subdivisions"], radius=0.5)
        bpy.ops.object.editmode_toggle()
        bpy.ops.mesh.delete(type="EDGE_FACE")
        bpy.ops.object.editmode_toggle()
        inside = rig.get("face_inside")
        for i, vertex in enumerate(bpy.context.active_object.data.vertices):
            normal = vertex.normal
            side = Vector((0, 0, 1)).cross(normal)
            if side.length <= 0.0001:
                side = Vector((0, 1, 0)).cross(normal)
            up = side.cross(normal)
            basis = Matrix.Identity(3)
            basis.col[0] = side if inside else -side
            basis.col[1] = -up
            basis.col[2] = normal if inside else -normal
            yield f"view_{i:04d}f", vertex.co, basis.to_euler()


out = {}
for label, rig in json.load(sys.stdin).items():
    size = rig.get("size", 1)
    size = Matrix.Diagonal(size if isinstance(size, list) else [size] * 3)
    turn = Euler([math.radians(a) for a in rig.get("rotation", (0, 0, 0))]).to_matrix()
    center = Vector(rig.get("center", (0, 0, 0)))
    views = list(local(rig))
    out[label + " names"] = [name for name, _, _ in views]
    out[label + " positions"] = [turn @ (size @ Vector(place)) + center for _, place, _ in views]
    turned = [turn @ euler.to_matrix() for _, _, euler in views]
    out[label + " matrices"] = [np.array(matrix) for matrix in turned]
    out[label + " eulers"] = [matrix.to_euler() for matrix in turned]
for n in range(1, 8):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=n, radius=1.0)
    vertices = bpy.context.active_object.data.vertices
    points = np.empty(3 * len(vertices), np.float32)
    vertices.foreach_get("co", points)
    out[f"icosphere {n}"] = points.reshape(-1, 3)
np.savez(sys.argv[1], **out)
"""


@pytest.fixture(scope="module")
def blender(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("blender") / "poses.npz"
    subprocess.run(
        [sys.executable, "-c", BLENDER, str(path)],
        input=json.dumps({label: rig for label, (_, rig) in {**SILVR, **OTHERS}.items()}),
        text=True,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return dict(np.load(path))


def registered() -> set[str]:
    """Return the names of all types of rigs."""
    kinds = get_args(get_args(rigs.AnyRig)[0])
    return {get_args(kind.model_fields["type"].annotation)[0] for kind in kinds}


@pytest.mark.parametrize("name", sorted(registered() - OF_FILES))
def test_each_type_of_rig_has_its_declared_number_of_named_views(name: str) -> None:
    rig = from_settings({"type": name, **EACH[name]})
    poses = rig.poses()
    assert len(poses) == rig.view_count == len({pose.name for pose in poses})
    for pose in poses:
        turn = pose.world_from_camera()[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(turn) > 0


@pytest.mark.parametrize("label", [*SILVR, *OTHERS])
def test_every_camera_is_at_blenders_place(label: str, blender: dict[str, Any]) -> None:
    count, rig = RIGS[label]
    views = rig.poses()
    assert len(views) == count == rig.view_count
    assert [view.name for view in views] == blender[f"{label} names"].tolist()
    matrices = np.stack([view.world_from_camera() for view in views])
    np.testing.assert_allclose(
        [view.position for view in views], blender[f"{label} positions"], rtol=0, atol=1e-6
    )
    np.testing.assert_allclose(matrices[:, :3, :3], blender[f"{label} matrices"], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(matrices[:, :3, 3], [view.position for view in views])


def test_the_silvr_rigs_have_7358_cameras() -> None:
    assert sum([RIGS[label][1].view_count for label in SILVR][:6]) == 7358


@pytest.mark.parametrize("label", ["garden sphere", "turned sphere", "turned cuboid"])
def test_euler_angles_are_blenders_choice(label: str, blender: dict[str, Any]) -> None:
    """Two sets of angles are possible. If their sums are equal, rounding decides in Blender."""
    ours = np.array([view.rotation for view in RIGS[label][1].poses()])
    theirs = blender[f"{label} eulers"].astype(float)
    other = np.array([1, -1, 1]) * ours + math.pi
    other = (other + math.pi) % (2 * math.pi) - math.pi
    tie = np.abs(np.abs(ours).sum(1) - np.abs(other).sum(1)) < 1e-5
    off = np.abs((ours - theirs + math.pi) % (2 * math.pi) - math.pi)
    assert tie.mean() < 0.15
    # Towards gimbal lock, angles lose precision in proportion to cos(ry).
    assert (off * np.abs(np.cos(theirs[:, 1:2])))[~tie].max() < 2e-6


@pytest.mark.parametrize("subdivisions", range(1, 8))
def test_the_icosphere_is_blenders(subdivisions: int, blender: dict[str, Any]) -> None:
    theirs = blender[f"icosphere {subdivisions}"]
    np.testing.assert_allclose(icosphere(subdivisions), theirs, rtol=0, atol=1e-6)
    rig = from_settings({"type": "sphere", "subdivisions": subdivisions})
    assert rig.view_count == len(theirs)


@pytest.mark.parametrize("subdivisions", [2, 3, 4])
def test_a_sphere_is_symmetric_under_a_fifth_of_a_turn_without_repeated_places(
    subdivisions: int,
) -> None:
    places = icosphere(subdivisions)
    turned = places @ Rotation.from_euler("z", 72, degrees=True).as_matrix().T
    tree = KDTree(places)
    assert tree.query(turned)[0].max() < 1e-4
    assert tree.query(places, 2)[0][:, 1].min() > 0.5 / 2 ** (subdivisions - 1)


def test_spheres_contain_the_coarser_ones() -> None:
    coarser = nested(642)
    assert [len(numbers) for numbers in coarser] == [162, 42, 12]
    for subdivisions, numbers in zip((3, 2), coarser, strict=False):
        coarse = icosphere(subdivisions)
        away = np.linalg.norm(icosphere(4)[numbers][:, None] - coarse, axis=-1)
        assert sorted(away.argmin(axis=1)) == list(range(len(coarse)))
        assert away.min(axis=1).max() < 1e-5
    assert nested(36) == nested(12) == []


def test_sphere_cameras_look_outward_and_upright_and_at_the_poles_up_and_down() -> None:
    views = from_settings({"type": "sphere", "subdivisions": 3, "size": 2}).poses()
    for view in views:
        matrix = view.world_from_camera()
        np.testing.assert_allclose(-matrix[:3, 2], view.position, atol=1e-7)
        assert abs(np.linalg.det(matrix) - 1) < 1e-9
        assert matrix[2, 1] >= -1e-9
    bottom, top = views[0], views[11]
    np.testing.assert_allclose(bottom.world_from_camera()[:3, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(top.world_from_camera()[:3, :3], np.diag([-1, 1, -1]), atol=1e-9)


@pytest.mark.parametrize(
    ("rig", "expected"),
    [
        ({"type": "plane", "cameras": [1, 3]}, {0.0}),
        ({"type": "cuboid", "cameras": [1, 3, 2]}, {-0.5, 0.0, 0.5}),
        ({"type": "lattice", "cameras": [1, 2, 2]}, {0.0}),
    ],
)
def test_a_single_camera_along_an_axis_sits_in_the_middle(rig: Any, expected: set[float]) -> None:
    assert {view.position[0] for view in from_settings(rig).poses()} == expected


def test_a_lattice_has_level_cameras_at_the_corners_of_a_cube() -> None:
    lattice = {"type": "lattice", "cameras": [2, 2, 2], "size": 2, "center": [1, 2, 3]}
    views = from_settings(lattice).poses()
    corners = {(x, y, z) for x in (0, 2) for y in (1, 3) for z in (2, 4)}
    assert {view.position for view in views} == corners
    assert [view.name for view in views] == [f"view_{i:04d}f" for i in range(8)]
    for view in views:
        np.testing.assert_allclose(view.world_from_camera()[:3, 2], [0, -1, 0], atol=1e-9)


def test_face_inside_turns_cameras_half_way_about_their_up_axis() -> None:
    rig = from_settings({"type": "cuboid", "cameras": [2, 2, 2]})
    turned = rig.model_copy(update={"face_inside": True})
    for out, inside in zip(rig.poses(), turned.poses(), strict=True):
        flipped = out.world_from_camera() @ np.diag([-1, 1, -1, 1])
        np.testing.assert_allclose(inside.world_from_camera(), flipped, atol=1e-9)


def test_cube_map_faces_look_along_six_axes_of_the_camera() -> None:
    rig = from_settings({"type": "plane", "cameras": [2, 1], "cube_map": True})
    views = rig.poses()
    assert rig.view_count == len(views) == 12
    assert [view.name for view in views[6:]] == [f"view_0001f_{face}" for face in "fblrud"]
    # The plane's camera looks along +Y with +Z up. These are each face's directions by hand.
    expected = {
        "f": ([0, 1, 0], [0, 0, 1]),
        "b": ([0, -1, 0], [0, 0, 1]),
        "l": ([-1, 0, 0], [0, 0, 1]),
        "r": ([1, 0, 0], [0, 0, 1]),
        "u": ([0, 0, 1], [0, -1, 0]),
        "d": ([0, 0, -1], [0, 1, 0]),
    }
    for view in views:
        look, up = expected[view.name[-1]]
        matrix = view.world_from_camera()
        np.testing.assert_allclose(-matrix[:3, 2], look, atol=1e-9)
        np.testing.assert_allclose(matrix[:3, 1], up, atol=1e-9)
        assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize(
    ("kind", "cameras", "expected"),
    [
        ("plane", [7, 5], [(x, 0, 0) for x in np.linspace(-1, 1, 7)]),
        ("cuboid", [5, 2, 5], [(x, 1, 0) for x in np.linspace(-1, 1, 5)]),
        ("cuboid", [2, 5, 5], [(-1, y, 0) for y in np.linspace(-1, 1, 5)]),
        ("cuboid", [3, 3, 2], [(x, 1, -1) for x in (-1, 0, 1)]),
        ("cylinder", [4, 3], [(0, 1, 0), (1, 0, 0), (0, -1, 0), (-1, 0, 0)]),
        ("lattice", [3, 5, 7], [(x, 0, 0) for x in (-1, 0, 1)]),
    ],
)
def test_the_row_in_the_middle(kind: str, cameras: list[int], expected: Any) -> None:
    rig = from_settings({"type": kind, "cameras": cameras, "size": 2})
    places = np.array([pose.position for pose in rig.poses()])
    np.testing.assert_allclose(places[rig.middle_row(places)], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("subdivisions", "count", "height"), [(1, 5, -0.447), (2, 10, 0), (3, 20, 0)]
)
def test_the_row_of_a_sphere_is_its_ring_nearest_the_equator(
    subdivisions: int, count: int, height: float
) -> None:
    rig = from_settings({"type": "sphere", "subdivisions": subdivisions, "size": 2})
    places = np.array([pose.position for pose in rig.poses()])
    row = rig.middle_row(places)
    assert row == sorted(set(row)) and len(row) == count
    np.testing.assert_allclose(places[row, 2], height, atol=1e-3)
    # Two rings of one camera each do not count.
    assert rig.middle_row(places[[0, 11]]) == []


@pytest.mark.parametrize(
    ("kind", "keys", "area"),
    [
        ("plane", {"cameras": [4, 3]}, 2 * 6),
        ("cuboid", {"cameras": [4, 3, 2]}, 2 * (2 * 4 + 4 * 6 + 6 * 2)),
        ("lattice", {"cameras": [4, 3, 2]}, 2 * (2 * 4 + 4 * 6 + 6 * 2)),
        # A prism on a square inside the ellipse of the box.
        ("cylinder", {"cameras": [4, 3]}, 4 * math.hypot(1, 2) * 6),
    ],
)
def test_cells_cover_the_cameras_surface(kind: str, keys: Any, area: float) -> None:
    rig = from_settings({"type": kind, "size": [2, 4, 6], **keys})
    places = np.array([pose.position for pose in rig.poses()])
    cells = rig.cells()
    assert cells is not None
    corners = places[np.array(cells)]
    # If a parallelogram's corners are in order, either diagonal halves it.
    halves = [
        np.cross(corners[:, i] - corners[:, 0], corners[:, 2] - corners[:, 0]) for i in (1, 3)
    ]
    first, second = (np.linalg.norm(half, axis=1) / 2 for half in halves)
    np.testing.assert_allclose(first, second)
    assert (first + second).sum() == pytest.approx(area)


def test_the_cells_of_a_sphere_are_triangles_that_close_it() -> None:
    rig = from_settings({"type": "sphere", "subdivisions": 3})
    cells = rig.cells()
    assert cells is not None and rig.cells() == cells
    edges = {frozenset(pair) for a, b, c in cells for pair in ((a, b), (b, c), (c, a))}
    # Euler's formula.
    assert 162 - len(edges) + len(cells) == 2
    assert from_settings({"type": "ring", "count": 5}).cells() is None


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("plane", {"cameras": [3, 3]}),
        ("cuboid", {"cameras": [3, 3, 3]}),
        ("lattice", {"cameras": [3, 3, 3]}),
        ("cylinder", {"cameras": [4, 3]}),
        ("sphere", {"subdivisions": 4}),
        ("hemisphere", {"count": 400, "elevation": [-90, 90]}),
        ("ring", {"count": 4, "elevation": 0}),
        ("random", {"count": 2000}),
        (
            "path",
            {"count": 401, "keys": [{"position": at} for at in ((0, 0, 0), (1, 3, 0), (2, 0, 1))]},
        ),
    ],
)
def test_an_outline_reaches_as_far_as_the_rig(kind: str, keys: Any) -> None:
    round_ones = ("sphere", "hemisphere", "ring")
    size = 2 if kind in round_ones else [2, 4, 6]
    rig = from_settings({"type": kind, "size": size, "center": [1, 1, 1], **keys})
    corners = np.concatenate(rig.outline())
    places = np.array([pose.position for pose in rig.poses()])
    assert rig.is_round == (kind in ("cylinder", *round_ones))
    # A sphere's or a random rig's cameras need not be at its outermost points.
    tolerance = {"sphere": 0.03, "hemisphere": 0.06, "random": 0.02, "path": 0.02}.get(kind, 1e-9)
    np.testing.assert_allclose(corners.min(0), places.min(0), atol=tolerance)
    np.testing.assert_allclose(corners.max(0), places.max(0), atol=tolerance)
    if kind != "path":
        once = np.unique(corners.round(9), axis=0)
        np.testing.assert_allclose(once.mean(0), 1, atol=1e-6)
    if kind in round_ones:
        np.testing.assert_allclose(np.linalg.norm(corners - 1, axis=1), 1)


@pytest.mark.parametrize(
    ("kind", "elevation", "lowest", "highest"),
    [
        ("hemisphere", [0, 90], 0.0, 1.0),
        ("hemisphere", [-30, 45], -0.5, math.sqrt(0.5)),
        ("spiral", [30, 60], 0.5, math.sqrt(0.75)),
        ("ring", 30, 0.5, 0.5),
    ],
)
def test_a_dome_has_the_outline_of_a_dome(
    kind: str, elevation: Any, lowest: float, highest: float
) -> None:
    rig = from_settings({"type": kind, "count": 200, "size": 2, "elevation": elevation})
    corners = np.concatenate(rig.outline())
    assert corners[:, 2].min() == pytest.approx(lowest, abs=1e-9)
    assert corners[:, 2].max() == pytest.approx(highest, abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 1)
    # Its outline has the widest circle on which cameras are.
    widest = max(np.hypot(pose.position[0], pose.position[1]) for pose in rig.poses())
    assert np.hypot(*corners[:, :2].T).max() == pytest.approx(widest, abs=0.03)


@pytest.mark.parametrize("name", PRINTED)
def test_the_shipped_rigs_are_those_of_the_papers_table(name: str) -> None:
    scene, views, centimetres = PRINTED[name]
    poses = load_scene(scene).rigs[name].poses()
    assert len(poses) == views
    places = np.unique(np.round([pose.position for pose in poses], 9), axis=0)
    nearest = KDTree(places).query(places, k=2)[0][:, 1].mean()
    # The paper's spheres are up to 14 % off: 9 cm for one whose cameras are 10.3 cm apart.
    assert 100 * nearest == pytest.approx(centimetres, rel=0.15)


def test_more_than_9999_views_have_different_names() -> None:
    rig = from_settings({"type": "plane", "cameras": [101, 101]})
    names = [view.name for view in rig.poses()]
    assert names[9999:10001] == ["view_9999f", "view_10000f"]
    assert len(set(names)) == 10201


def test_poses_from_csv_and_lightfield_json_agree(tmp_path: Path) -> None:
    rig = {"type": "sphere", "subdivisions": 1, "size": 3, "rotation": [10, 20, 30]}
    lens = lenses.from_camera({"lens": "equidistant", "resolution": [64, 64], "fov": 180})
    content = LightField.from_rig(rig, lens).to_json()
    (tmp_path / "lightfield.json").write_text(json.dumps(content))
    rows = [[f["name"], *f["position"], *f["rotation"]] for f in content["frames"]]
    lines = ["name,x,y,z,rx,ry,rz", *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "poses.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "spreadsheet.csv").write_text("\n".join(lines), encoding="utf-8-sig")
    files = {"lightfield.json": "SPHERE", "poses.csv": "PLANE", "spreadsheet.csv": "PLANE"}
    for file, lf_type in files.items():
        again = {"type": "poses", "file": str(tmp_path / file)}
        assert from_settings(again).view_count == 12
        assert from_settings(again).poses() == from_settings(rig).poses()
        assert from_settings(again).lf_type == lf_type


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("p.csv", "name,x,y\n", "row 1: must be name,x,y,z,rx,ry,rz"),
        ("p.csv", "name,x,y,z,rx,ry,rz\na,1,2,3,4,5\n", "row 2: has 6 values, not 7"),
        ("p.csv", "name,x,y,z,rx,ry,rz\na,1,2,3,4,5,6\nb,1,2,3,4,x,6\n", "row 3: ry: .*'x'"),
        ("p.csv", "name,x,y,z,rx,ry,rz\na,1,2,3,4,5,nan\n", "row 2: rz: .*finite"),
        ("p.csv", "name,x,y,z,rx,ry,rz\n../a,1,2,3,4,5,6\n", "row 2: name: .*file name"),
        ("p.csv", "name,x,y,z,rx,ry,rz\na,1,2,3,4,5,6\na,1,2,3,4,5,6\n", "row 3: name: .*twice"),
        ("p.csv", "name,x,y,z,rx,ry,rz\n", "holds no pose"),
        ("p.json", "{", "is not JSON"),
        ("p.json", "{}", "frames: must be a list"),
        ("p.json", '{"frames": [{"name": "a"}]}', r"frames\[0\]: world_matrix: is missing"),
        (
            "p.json",
            '{"frames": [{"name": "a", "position": [0, 0, true], "rotation": [0, 0, 0]}]}',
            r"frames\[0\]: position\[2\]: .*True",
        ),
        ("p.json", '{"frames": [], "lf_type": "CONE"}', "lf_type: must be one of PLANE"),
        ("missing.json", None, "cannot be read"),
        ("missing.csv", None, "cannot be read"),
    ],
)
def test_a_malformed_pose_file_is_named_with_row_and_key(
    file: str, text: str | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / file
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError, match=message) as error:
        from_settings({"type": "poses", "file": str(path)}).poses()
    assert str(path) in str(error.value)


@pytest.mark.parametrize("label", [*SILVR, "plane", "cylinder"])
@pytest.mark.parametrize("limit", [12, 20, 42, 100, 500, 10_000])
def test_a_thinned_rig_is_of_the_same_kind_within_the_limit(label: str, limit: int) -> None:
    rig = RIGS[label][1]
    thinner = rig.thinned(limit)
    assert thinner.view_count == len(thinner.poses()) <= limit
    counts = {"cameras", "subdivisions", "camera"}
    assert thinner.model_dump(exclude=counts) == rig.model_dump(exclude=counts)
    if rig.view_count <= limit:
        assert thinner == rig
        return
    # No denser rig of the same kind fits.
    if isinstance(thinner, rigs.Grid) and isinstance(rig, rigs.Grid):
        denser = [
            {"cameras": tuple(n + (i == axis) for i, n in enumerate(thinner.cameras))}
            for axis, full in enumerate(rig.cameras)
            if thinner.cameras[axis] < full
        ]
    else:
        assert isinstance(thinner, rigs.Sphere)
        denser = [{"subdivisions": thinner.subdivisions + 1}]
    assert all(thinner.model_copy(update=more).view_count > limit for more in denser)


def cameras(rig: dict[str, Any], limit: int) -> tuple[int, ...]:
    """Return a grid's cameras along each axis after thinning."""
    thinner = from_settings(rig).thinned(limit)
    assert isinstance(thinner, rigs.Grid)
    return thinner.cameras


def test_thinning_keeps_proportions_and_two_cameras_an_axis() -> None:
    _, rig = SILVR["lone_monk cuboid"]
    shares = np.array(cameras(rig, 600)) / rig["cameras"]
    assert np.ptp(shares) < 0.1
    assert min(cameras(SILVR["barbershop cuboid"][1], 42)) >= 2
    assert cameras({"type": "plane", "cameras": [9, 1]}, 4) == (4, 1)
    lattice = {"type": "lattice", "cameras": [2, 2, 2]}
    assert cameras(lattice, 8) == (2, 2, 2)
    assert cameras({**lattice, "cube_map": True}, 24) == (2, 2, 1)


def test_thin_takes_an_even_subset_of_a_pose_file(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    rows = [f"v{i},{i},0,0,0,0,0" for i in range(101)]
    path.write_text("\n".join(["name,x,y,z,rx,ry,rz", *rows]))
    thinner = from_settings({"type": "poses", "file": str(path)}).thinned(5)
    assert thinner.view_count == 5
    assert [view.name for view in thinner.poses()] == ["v0", "v25", "v50", "v75", "v100"]


def test_a_rig_of_pairs_or_cubes_keeps_at_least_one_of_them() -> None:
    ring = {"type": "ring", "count": 3}
    for more, views in (({"stereo": {"distance": 0.1}}, 2), ({"cube_map": True}, 6)):
        rig = from_settings(ring | more)
        assert rig.thinned(2 * views + 1).view_count == 2 * views
        with pytest.raises(UserError, match=f"a rig of type ring .* as few as {views - 1} views"):
            rig.thinned(views - 1)


def test_the_path_of_a_blends_camera_is_thinned_from_end_to_end() -> None:
    frames = {"first": 10, "last": 30, "step": 5}
    rig = from_settings({"type": "blend_camera", "frames": frames})
    assert isinstance(rig, rigs.BlendCamera)
    assert rig.path == [10, 15, 20, 25, 30] and rig.view_count == 5 and rig.sequence is None
    for views, path in ((4, [10, 15, 25, 30]), (3, [10, 20, 30]), (2, [10, 30]), (1, [10])):
        thinner = rig.thinned(views)
        assert thinner.path == path and thinner.view_count == views
    assert from_settings({"type": "blend_camera"}).placed("inventory.json", 7).path == [7]
    with pytest.raises(UserError, match="place is unknown until"):
        rig.poses()


@pytest.mark.parametrize("label", ["garden sphere", "garden cuboid"])
def test_thinning_says_if_no_such_rig_is_small_enough(label: str) -> None:
    with pytest.raises(UserError, match="cannot have as few as 5 views"):
        RIGS[label][1].thinned(5)


ORBITS = {
    "hemisphere": {"type": "hemisphere", "count": 100, "elevation": [10, 80]},
    "rings": {"type": "hemisphere", "count": 100, "elevation": [10, 80], "pattern": "rings"},
    "ring": {"type": "ring", "count": 12, "elevation": -20},
    "spiral": {"type": "spiral", "count": 50, "turns": 3, "elevation": [5, 75]},
}


@pytest.mark.parametrize("name", ORBITS)
def test_orbits_look_at_the_middle_from_the_given_places(name):
    settings = {**ORBITS[name], "size": 4, "center": [1, -2, 0.5]}
    rig = rigs.from_settings(settings)
    matrices = np.array([pose.world_from_camera() for pose in rig.poses()])
    assert len(matrices) == rig.view_count == settings["count"]
    places = matrices[:, :3, 3] - (1, -2, 0.5)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 2, atol=1e-9)
    np.testing.assert_allclose(-matrices[:, :3, 2] * 2, -places, atol=1e-9)
    # Upright: +X is level, and +Y points up.
    np.testing.assert_allclose(matrices[:, 2, 0], 0, atol=1e-9)
    assert (matrices[:, 2, 1] > 0).all()
    elevation = np.degrees(np.arcsin(places[:, 2] / 2))
    low, high = np.broadcast_to(settings["elevation"], 2)
    assert elevation.min() >= low - 1e-9 and elevation.max() <= high + 1e-9
    thinner = rig.thinned(7)
    assert len(thinner.poses()) == thinner.view_count == 7


@pytest.mark.parametrize("name", ORBITS)
@pytest.mark.parametrize("rotation", [[0, 0, 0], [20, 30, 40]])
def test_orbits_of_an_ellipsoid_look_at_the_middle(name, rotation):
    center = np.array([1, -2, 0.5])
    shape = {"size": [4, 6, 1], "center": center.tolist(), "rotation": rotation}
    poses = rigs.from_settings(ORBITS[name] | shape).poses()
    matrices = np.array([pose.world_from_camera() for pose in poses])
    ahead = center - matrices[:, :3, 3]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    np.testing.assert_allclose(-matrices[:, :3, 2], ahead, atol=1e-9)


@pytest.mark.parametrize("name", ORBITS)
def test_an_orbit_of_no_size_turns_on_the_spot(name):
    ball, point = (rigs.from_settings(ORBITS[name] | {"size": size}).poses() for size in (3, 0))
    assert [pose.rotation for pose in point] == [pose.rotation for pose in ball]
    assert {pose.position for pose in point} == {(0, 0, 0)}


def test_orbits_begin_in_front_of_the_object_and_turn_like_a_cylinder():
    ring = rigs.from_settings({"type": "ring", "count": 4, "size": 2}).poses()
    expected = [(0, 1, 0), (1, 0, 0), (0, -1, 0), (-1, 0, 0)]
    np.testing.assert_allclose([pose.position for pose in ring], expected, atol=1e-9)
    golden = math.pi * (3 - math.sqrt(5))
    for name, turn in (("hemisphere", golden), ("spiral", 2 * math.pi * 3 / 49), ("rings", None)):
        places = np.array([p.position for p in rigs.from_settings(ORBITS[name]).poses()])
        azimuth = np.arctan2(places[:2, 0], places[:2, 1])
        assert azimuth[0] == pytest.approx(0, abs=1e-9)
        assert azimuth[1] == pytest.approx(turn or azimuth[1].clip(0.1, 1), abs=1e-9)


def test_a_hemisphere_is_evenly_covered():
    for name in ("hemisphere", "rings"):
        places = np.array([p.position for p in rigs.from_settings(ORBITS[name]).poses()]) * 2
        apart = np.linalg.norm(places[:, None] - places, axis=-1)
        np.fill_diagonal(apart, np.inf)
        nearest = apart.min(axis=1)
        area = 2 * math.pi * (math.sin(math.radians(80)) - math.sin(math.radians(10)))
        even = math.sqrt(area / 100)
        assert nearest.min() > 0.5 * even and nearest.max() < 1.6 * even, name


def test_each_camera_of_a_hemisphere_is_in_the_middle_of_its_share_of_the_area():
    """The area of a zone is proportional to its height, so cameras have the zone's mean height."""
    low, high = (math.sin(math.radians(angle)) for angle in (10, 80))
    places = rigs.from_settings(ORBITS["hemisphere"] | {"size": 2}).poses()
    heights = np.array([pose.position[2] for pose in places])
    assert heights.mean() == pytest.approx((low + high) / 2, abs=1e-9)
    assert heights.min() - low == pytest.approx(high - heights.max(), abs=1e-9)


def test_a_spiral_rises_evenly():
    places = np.array([p.position for p in rigs.from_settings(ORBITS["spiral"]).poses()]) * 2
    azimuth = np.unwrap(np.arctan2(places[:, 0], places[:, 1]))
    np.testing.assert_allclose(np.diff(azimuth), 2 * math.pi * 3 / 49, atol=1e-9)
    elevation = np.degrees(np.arcsin(places[:, 2]))
    np.testing.assert_allclose(elevation, np.linspace(5, 75, 50), atol=1e-6)


def test_every_rig_can_look_at_a_point():
    target = np.array([0.2, 3.0, -1.0])
    plane = {"type": "plane", "cameras": [3, 2], "size": 2, "look_at": target.tolist()}
    for pose in rigs.from_settings(plane).poses():
        matrix = pose.world_from_camera()
        toward = target - matrix[:3, 3]
        np.testing.assert_allclose(-matrix[:3, 2], toward / np.linalg.norm(toward), atol=1e-9)
    # Straight above and below, "up" is undefined: +X stays the world's.
    for height, up in ((5.0, 1.0), (-5.0, -1.0)):
        single = {
            "type": "plane",
            "cameras": [1, 1],
            "center": [0, 0, height],
            "look_at": [0, 0, 0],
        }
        (pose,) = rigs.from_settings(single).poses()
        np.testing.assert_allclose(pose.world_from_camera()[:3, 0], (1, 0, 0), atol=1e-9)
        np.testing.assert_allclose(pose.world_from_camera()[:3, 1], (0, up, 0), atol=1e-9)
    with pytest.raises(UserError, match="a camera is at"):
        rigs.from_settings({**single, "look_at": single["center"]}).poses()
    with pytest.raises(UserError, match="look_at: does not go with face_inside"):
        rigs.from_settings({**plane, "face_inside": True})


def test_elevations_must_grow():
    flat = rigs.from_settings({"type": "spiral", "count": 5, "elevation": [30, 30], "size": 2})
    np.testing.assert_allclose([pose.position[2] for pose in flat.poses()], 0.5)
    with pytest.raises(UserError, match="must have the smaller value first"):
        rigs.from_settings({"type": "spiral", "count": 5, "elevation": [50, 10]})


def documented_to_keep_cameras():
    """Return the types of rigs of which the reference says that more cameras keep the earlier."""
    page = Path(__file__).parents[2] / "docs/reference/rigs.md"
    rows = [
        [cell.strip() for cell in line.strip("| \n").split(" | ")]
        for line in page.read_text().splitlines()
        if line.startswith("| `") and line.count(" | ") == 3
    ]
    return {row[0].strip("`"): row[-1].startswith("yes") for row in rows}


def few_and_more(name, folder):
    """Return a rig of a type, and the same rig with more cameras."""
    if name == "blend_camera":
        matrices = {str(n): np.eye(4).tolist() for n in range(1, 20)}
        inventory = folder / "inventory.json"
        inventory.write_text(json.dumps({"blend": {"frame": 1, "camera": {"matrices": matrices}}}))
        frames = [{"first": 3, "last": last, "step": 2} for last in (9, 17)]
        return [
            from_settings({"type": name, "frames": each}).placed(inventory, 1) for each in frames
        ]
    if name == "poses":
        lines = ["name,x,y,z,rx,ry,rz", *(f"cam{n},{n},{n * n},1,0,0,{n / 9}" for n in range(9))]
        made = []
        for count in (4, 9):
            file = folder / f"{count}.csv"
            file.write_text("\n".join(lines[: count + 1]) + "\n")
            made.append(from_settings({"type": name, "file": str(file)}))
        return made
    few = {"type": name, **EACH[name]}
    return [from_settings(few), from_settings(few | MORE[name])]


@pytest.mark.parametrize("name", [*EACH, *sorted(OF_FILES)])
def test_more_cameras_keep_the_earlier_ones_of_the_types_that_the_reference_names(name, tmp_path):
    few, more = (rig.poses() for rig in few_and_more(name, tmp_path))
    assert len(more) > len(few)
    assert (more[: len(few)] == few) == documented_to_keep_cameras()[name]
