"""The interpolation volume, compared with traced rays."""

import math
from typing import Any

import numpy as np
import pytest

from lightfield.geometry import lenses, rigs
from lightfield.geometry.interpolation_volume import parts_to_edge

FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [256, 256]}
NARROW = {"lens": "equidistant", "fov": 150, "resolution": [256, 256]}
SQUARE = {"lens": "rectilinear", "fov": 140, "resolution": [256, 256]}
PANORAMA = {"lens": "equirectangular", "resolution": [64, 32]}


def traced_inside(matrices: Any, sees: Any, points: Any) -> Any:
    """Return which points (n, 3) are in the volume, by its definition.

    Every ray from such a point must cross a triangle of three neighbouring cameras that all see the
    ray's direction. ``sees`` tells whether a camera sees directions, in its own coordinates. The
    rays go to a fine grid on each triangle of the sphere, including its corners.
    """
    positions = matrices[:, :3, 3]
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
    is_inside = np.ones(len(points), dtype=bool)
    for triangle in triangles:
        corners = positions[list(triangle)]
        outward = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        outward *= np.sign(outward @ (corners[0] - center))
        is_inside &= (points - corners[0]) @ outward < 0
        for camera in triangle:
            rays = (weights @ corners)[:, None] - points
            is_inside &= sees(rays @ matrices[camera, :3, :3]).all(axis=0)
    return is_inside


@pytest.mark.parametrize("face_inside", [False, True])
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
        (PANORAMA, lambda d: np.ones(d.shape[:-1], dtype=bool)),
    ],
)
def test_a_place_is_within_the_edge_if_traced_rays_reach_it(
    camera: Any, sees: Any, face_inside: bool
) -> None:
    center = np.array([1.0, 2, 3])
    rig = {"type": "sphere", "subdivisions": 2, "size": [1, 1, 1.3], "center": center.tolist()}
    rig |= {"face_inside": face_inside, "camera": camera}
    matrices = np.stack([pose.world_from_camera() for pose in rigs.from_settings(rig).poses()])
    places = center + np.random.default_rng(3).uniform(-0.65, 0.65, (5000, 3))
    parts = parts_to_edge(matrices, lenses.from_camera(camera), places)
    # Cameras that face inside see through the point to the surface behind it.
    traced = traced_inside(matrices, lambda d: sees(-d if face_inside else d), places)
    is_clear = abs(parts - 1) > 1e-3
    assert traced.sum() > 20
    np.testing.assert_array_equal((parts < 1)[is_clear], traced[is_clear])
    halfway = center + (places - center) / 2
    np.testing.assert_allclose(
        parts_to_edge(matrices, lenses.from_camera(camera), halfway), parts / 2, atol=1e-6
    )


@pytest.mark.parametrize("rotation", [[0, 0, 0], [17, 11, 23]])
@pytest.mark.parametrize("lens", ["equidistant", "equirectangular"])
def test_a_plane_has_no_inside(lens: str, rotation: list[float]) -> None:
    # The places of a tilted plane are off it by rounding.
    settings = {"type": "plane", "cameras": [9, 9], "size": 1, "rotation": rotation}
    rig = rigs.from_settings(settings)
    matrices = np.stack([pose.world_from_camera() for pose in rig.poses()])
    camera = FISHEYE if lens == "equidistant" else {"lens": lens, "resolution": [64, 32]}
    parts = parts_to_edge(matrices, lenses.from_camera(camera), np.zeros((2, 3)))
    assert np.isposinf(parts).all()
