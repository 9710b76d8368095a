"""The interpolation volume, compared with traced rays, and the table of the rigs."""

import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rig_table
from lightfield.geometry import lenses, rigs
from lightfield.geometry.interpolation_volume import (
    interpolation_volume,
    neighbour_spacing,
    parts_to_edge,
    spacing,
)

FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [256, 256]}
NARROW = {"lens": "equidistant", "fov": 150, "resolution": [256, 256]}
SQUARE = {"lens": "rectilinear", "fov": 140, "resolution": [256, 256]}
PANORAMA = {"lens": "equirectangular", "resolution": [64, 32]}


def volume(rig: Any, camera: Any) -> float:
    result = interpolation_volume(rigs.from_settings(rig), lenses.from_camera(camera))
    assert result is not None
    return result.immersive


def traced_volume(rig: dict[str, Any], sees: Any, count: int) -> tuple[float, float]:
    """Estimate the volume by tracing rays from random points, with its standard error.

    By definition, every ray from the point must cross a triangle of three neighbouring cameras that
    all see the ray's direction. ``sees`` tells whether a camera sees directions, in its own
    coordinates. The rays go to a fine grid on each triangle of the sphere, including its corners.
    """
    views = rigs.from_settings(rig).poses()
    matrices = np.stack([view.matrix()[:3, :3] for view in views])
    positions = np.array([view.position for view in views])
    center = positions.mean(axis=0)
    # Three cameras are neighbours if no camera lies beyond the plane through them.
    nearby = np.argsort(np.linalg.norm(positions[:, None] - positions, axis=-1), axis=1)[:, 1:8]
    triangles = set()
    for a, others in enumerate(nearby):
        for b in others:
            for c in others:
                normal = np.cross(positions[b] - positions[a], positions[c] - positions[a])
                if np.linalg.norm(normal) > 1e-9 and np.all(
                    (positions - positions[a]) @ normal <= 1e-9
                ):
                    triangles.add(tuple(sorted((a, int(b), int(c)))))
    weights = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)], dtype=float) / 4
    radius = np.linalg.norm(positions - center, axis=1).max()
    points = np.random.default_rng(3).uniform(-radius, radius, (count, 3)) + center
    for triangle in triangles:
        corners = positions[list(triangle)]
        outward = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        outward *= np.sign(outward @ (corners[0] - center))
        points = points[(points - corners[0]) @ outward < 0]
        for camera in triangle:
            rays = (weights @ corners)[:, None] - points
            points = points[sees(rays @ matrices[camera]).all(axis=0)]
    share = len(points) / count
    box = (2 * radius) ** 3
    return share * box, math.sqrt(share * (1 - share) / count) * box


@pytest.mark.parametrize(
    ("camera", "sees"),
    [
        (FISHEYE, lambda d: d[..., 2] <= 0),
        (NARROW, lambda d: -d[..., 2] >= math.cos(math.radians(75)) * np.linalg.norm(d, axis=-1)),
        (
            SQUARE,
            lambda d: (
                np.maximum(abs(d[..., 0]), abs(d[..., 1]))
                <= -d[..., 2] * math.tan(math.radians(70))
            ),
        ),
    ],
)
def test_a_coarse_spheres_volume_equals_that_of_traced_rays(camera: Any, sees: Any) -> None:
    rig = {"type": "sphere", "subdivisions": 2, "size": [1, 1, 1.3], "center": [1, 2, 3]}
    traced, error = traced_volume(rig, sees, 20_000)
    assert traced > 20 * error
    assert abs(volume(rig, camera) - traced) < 3.5 * error


@pytest.mark.parametrize(
    ("cameras", "size", "expected"),
    [([10, 30, 10], [1, 3, 1], 3.0), ([21, 21, 16], [4, 4, 3], 48.0), ([2, 2, 2], 1, 1.0)],
)
def test_a_cuboid_of_180_degree_views_interpolates_its_whole_box(
    cameras: list[int], size: Any, expected: float
) -> None:
    rig = {"type": "cuboid", "cameras": cameras, "size": size, "rotation": [10, 20, 30]}
    assert volume(rig, FISHEYE) == pytest.approx(expected, rel=1e-6)


def test_a_spheres_volume_grows_towards_the_ball_with_its_cameras() -> None:
    shares = [
        volume({"type": "sphere", "subdivisions": n, "size": 2}, FISHEYE) / (4 / 3 * math.pi)
        for n in range(1, 6)
    ]
    assert shares == sorted(shares)
    # A cell's far corner at an angle δ cuts the volume off at cos δ of the radius.
    delta = math.radians(63.435 / 16)
    assert math.cos(1.3 * delta) ** 3 < shares[-1] < 1


def test_facing_inside_gives_the_same_volume_through_the_rays_behind() -> None:
    rig = {"type": "sphere", "subdivisions": 2}
    assert volume({**rig, "face_inside": True}, FISHEYE) == pytest.approx(volume(rig, FISHEYE))


def test_panoramas_and_cube_maps_interpolate_everything_between_them() -> None:
    lattice = {"type": "lattice", "cameras": [2, 2, 2], "size": [1, 2, 3]}
    assert volume(lattice, PANORAMA) == pytest.approx(6)
    assert volume({**lattice, "cube_map": True}, {**SQUARE, "fov": 90}) == pytest.approx(6)
    # Level 180° views see nothing behind them.
    assert volume(lattice, FISHEYE) == 0


@pytest.mark.parametrize(
    "rig",
    [
        {"type": "plane", "cameras": [5, 5]},
        {"type": "cylinder", "cameras": [12, 5]},
        {"type": "cylinder", "cameras": [1, 5]},
        {"type": "cylinder", "cameras": [2, 2]},
        {"type": "cuboid", "cameras": [1, 1, 1]},
        {"type": "lattice", "cameras": [1, 2, 2]},
        {"type": "sphere", "subdivisions": 2, "size": [1, 1, 0]},
    ],
)
def test_an_open_or_flat_surface_has_no_immersive_volume(rig: Any) -> None:
    assert volume(rig, FISHEYE) == 0


def test_loose_poses_span_no_surface(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("name,x,y,z,rx,ry,rz\na,0,0,0,0,0,0\n")
    rig = {"type": "poses", "file": str(path)}
    assert interpolation_volume(rigs.from_settings(rig), lenses.from_camera(FISHEYE)) is None


@pytest.mark.parametrize("camera", [FISHEYE, NARROW, PANORAMA])
@pytest.mark.parametrize("face_inside", [False, True])
def test_places_within_the_edge_make_up_the_volume(camera: Any, face_inside: bool) -> None:
    center = np.array([3.0, -2, 1])
    rig = {"type": "sphere", "subdivisions": 2, "size": 2, "center": center.tolist()}
    rig |= {"face_inside": face_inside, "camera": camera}
    matrices = np.stack([pose.matrix() for pose in rigs.from_settings(rig).poses()])
    places = center + np.random.default_rng(1).uniform(-1, 1, (2000, 3))
    parts = parts_to_edge(matrices, lenses.from_camera(camera), places)
    assert 8 * (parts <= 1).mean() == pytest.approx(volume(rig, camera), abs=0.25)
    halfway = center + (places - center) / 2
    np.testing.assert_allclose(
        parts_to_edge(matrices, lenses.from_camera(camera), halfway), parts / 2, atol=1e-6
    )


def test_a_plane_has_no_inside() -> None:
    rig = rigs.from_settings({"type": "plane", "cameras": [3, 3], "size": 1})
    matrices = np.stack([pose.matrix() for pose in rig.poses()])
    parts = parts_to_edge(matrices, lenses.from_camera(FISHEYE), np.zeros((2, 3)))
    assert np.isposinf(parts).all()


def test_spacing_leaves_out_cameras_at_the_same_place() -> None:
    square = np.array([[0, 0, 0], [0, 0, 0], [3, 0, 0], [3, 4, 0]], dtype=float)
    assert spacing(square) == pytest.approx((3 + 3 + 3 + 4) / 4)
    assert math.isnan(spacing(square[:2]))
    assert neighbour_spacing([(0, 2, 3)], square) == pytest.approx((3 + 4 + 5) / 3)
    assert neighbour_spacing([(2, 2, 3, 3)], square) == pytest.approx(4)


SCENE = """
scene: {blend: FILE}
render: {samples: 1}
rigs:
  LFCuboid_2x2x1:
    {type: cuboid, cameras: [21, 21, 11], size: [2, 2, 1], camera: &eye {CAMERA}}
  LFSphere_e100cm_d170cm: {type: sphere, subdivisions: 4, size: 1.7, camera: *eye}
  LFCuboid_1mx3mx1m: {type: cuboid, cameras: [10, 30, 10], size: [1, 3, 1], camera: *eye}
  LFPlane: {type: plane, cameras: [3, 1], camera: *eye}
  path: {type: path, count: 3, keys: [{position: [0, 1, 0]}, {position: [0, 4, 0]}], camera: *eye}
  own: {type: blend_camera, frames: {first: 1, last: 4}, camera: *eye}
""".replace("CAMERA", "lens: equidistant, fov: 180, resolution: [64, 64]")


def test_a_single_camera_with_a_published_name_differs_from_the_print(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, table = tmp_path / "silvr.yaml", tmp_path / "rigs.md"
    (tmp_path / "own.blend").touch()
    head, _, _ = SCENE.replace("FILE", str(tmp_path / "own.blend")).partition("  LFCuboid_2x2x1")
    camera = "{lens: equidistant, fov: 180, resolution: [64, 64]}"
    rig = f"  LFSphere_e100cm_d170cm: {{type: plane, cameras: [1, 1], camera: {camera}}}\n"
    scene.write_text(head + rig)
    arguments = ["rig_table.py", scene, "--markdown", table, "--csv", tmp_path / "rigs.csv"]
    monkeypatch.setattr(sys, "argv", list(map(str, arguments)))
    rig_table.main()
    text = table.read_text(encoding="utf-8")
    assert "LFSphere_e100cm_d170cm: 1 view, printed 642." in text
    assert "its camera has no neighbour, printed 13 cm." in text


def test_the_table_has_computed_figures_beside_the_printed_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, table, figures = (tmp_path / name for name in ("silvr.yaml", "rigs.md", "rigs.csv"))
    own_blend = tmp_path / "own.blend"
    own_blend.touch()
    scene.write_text(SCENE.replace("FILE", str(own_blend)))
    arguments = ["rig_table.py", scene, "--markdown", table, "--csv", figures]
    monkeypatch.setattr(sys, "argv", list(map(str, arguments)))
    rig_table.main()

    rows = {row["rig"]: row for row in csv.DictReader(figures.open(encoding="utf-8"))}
    cuboid = rows["LFCuboid_2x2x1"]
    assert (cuboid["views"], cuboid["printed_views"]) == ("1806", "1806")
    assert float(cuboid["nearest_m"]) == pytest.approx(0.1)
    assert float(cuboid["printed_m"]) == pytest.approx(0.1)
    assert float(cuboid["immersive_interpolation_volume_m3"]) == pytest.approx(4)
    sphere = rows["LFSphere_e100cm_d170cm"]
    assert sphere["views"] == sphere["printed_views"] == "642"
    inside = float(sphere["immersive_interpolation_volume_m3"])
    ball = 4 / 3 * math.pi * 0.85**3
    assert 0.95 * ball < inside < float(sphere["enclosed_m3"]) < ball
    assert float(sphere["box_or_ball_m3"]) == pytest.approx(ball)
    assert rows["LFPlane"]["printed_m"] == ""
    assert rows["path"]["size"] == "0 × 3 × 0 m"
    assert (rows["own"]["views"], rows["own"]["nearest_m"]) == ("4", "nan")

    text = table.read_text(encoding="utf-8")
    assert (
        "| silvr | LFCuboid_2x2x1 | 1806 (1806) | 21, 21, 11 | 2 × 2 × 1 m | 10.0 cm | 10.0 cm "
        "| 10 cm | 4 m³ | 4 m³ | 4 m³ |"
    ) in text
    said = text.split("## Differences")[1]
    assert "LFCuboid_2x2x1" not in said
    # The paper says 11 cm. The nearest camera is 3 m / 29 or 1 m / 9 away, mostly the former.
    assert "LFCuboid_1mx3mx1m: the nearest camera is 10.4 cm" in said
    assert "10.8 cm, agrees with the print" in said
