"""Start points: as many as asked for, spread by what the views resolve."""

import numpy as np
import pytest
from sphere import LENSES, RADIUS, colour_of, write_views

from lightfield.export.points import evenly_seen, lift
from lightfield.export.source import SourceDataset

RIG = {"type": "plane", "cameras": [3, 3], "size": 0.02}
PANORAMA = {"lens": "equirectangular", "resolution": [192, 96]}
NEAR, FAR = 1.0, 40.0


def on_shell(radius, rays, position):
    """Return the distance along ``rays`` from a position inside a sphere around the origin."""
    along = rays @ position
    return -along + np.sqrt(along**2 + radius**2 - position @ position)


def look_at_halves(lens, matrix):
    """Return colour and distance of a near half of a sphere, y > 0, before a far sphere."""
    rays, position = lens.pixel_rays() @ matrix[:3, :3].T, matrix[:3, 3]
    near = on_shell(NEAR, rays, position)
    is_near = position[1] + rays[..., 1] * near > 0
    distance = np.where(is_near, near, on_shell(FAR, rays, position))
    colour = np.where(is_near[..., None], (0.8, 0.1, 0.1), (0.1, 0.1, 0.8))
    return colour, distance


def look_at_sky(lens, matrix):
    rays = lens.pixel_rays()
    return np.zeros_like(rays), np.full(rays.shape[:2], np.inf)


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    folder = tmp_path_factory.mktemp("points") / "dataset"
    write_views(folder, PANORAMA, RIG, see=look_at_halves)
    write_views(folder / "perspective", LENSES["perspective"], RIG, see=look_at_halves)
    return folder


def counts_in_equal_parts(directions, bands=6, sectors=10):
    """Return how many directions (n, 3) are in each of many parts of the sphere of equal area."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    turn = np.arctan2(unit[:, 2], unit[:, 0])
    sides = ((-1, 1), (-np.pi, np.pi))
    return np.histogram2d(unit[:, 1], turn, bins=(bands, sectors), range=sides)[0]


def test_a_near_and_a_far_surface_get_equally_many_points_for_the_angle_they_take(halves):
    points = lift(SourceDataset(halves, "", ".exr"), count=6000)
    distance = np.linalg.norm(points.positions, axis=1)
    is_near = points.positions[:, 1] > 0
    np.testing.assert_allclose(distance, np.where(is_near, NEAR, FAR), rtol=1e-5)
    np.testing.assert_array_equal(points.colours[:, 0] > points.colours[:, 2], is_near)
    # Each takes half of all directions. Evenly in metres, the near one had 1 of 1,600 points.
    assert 1 / 2 < is_near.sum() / (~is_near).sum() < 2
    counts = counts_in_equal_parts(points.positions)
    assert counts.max() < 3 * counts.min()


def test_points_at_any_distance_are_equally_dense_within_a_factor_of_three():
    radii = np.geomspace(0.5, 500, 25)
    directions = np.random.default_rng(3).normal(size=(10000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    part = np.arange(len(directions)) % len(radii)
    # Each radius has a part of the directions, beside one another, as a scene in steps has.
    part[np.argsort(np.arctan2(directions[:, 1], directions[:, 0]))] = np.sort(part)
    positions = directions * radii[part, None]
    kept = evenly_seen(positions, np.zeros((1, 3)), 2000)
    counts = np.bincount(part[kept], minlength=len(radii))
    assert counts.max() < 3 * counts.min()


@pytest.mark.parametrize("name", ["", "perspective"])
@pytest.mark.parametrize("count", [1, 7, 500, 5000, 9000])
def test_as_many_points_are_lifted_as_asked(halves, name, count):
    # The panoramas have 9,576 pixels in the frame of the perspective views, and 165,888 in all.
    points = lift(SourceDataset(halves, name, ".exr"), count=count)
    assert len(points.positions) == count
    assert len(np.unique(points.positions, axis=0)) == count


def test_all_points_are_kept_if_the_views_hold_fewer_than_asked(tmp_path):
    rig = {"type": "plane", "cameras": [2, 1], "size": 0.02}
    write_views(tmp_path / "dataset", LENSES["panorama"], rig)
    points = lift(SourceDataset(tmp_path / "dataset", "", ".exr"), count=10**6)
    assert len(points.positions) == 2 * 64 * 32
    np.testing.assert_allclose(np.linalg.norm(points.positions, axis=1), RADIUS, rtol=1e-5)
    np.testing.assert_allclose(points.colours, colour_of(points.positions), atol=3)


def test_a_point_that_several_views_see_alike_is_kept_once():
    points = np.random.default_rng(1).normal(size=(50, 3))
    fourfold = np.repeat(points, 4, axis=0)
    for count in (40, 50, 100, 300):
        kept = evenly_seen(fourfold, np.zeros((1, 3)), count)
        assert len(np.unique(fourfold[kept], axis=0)) == len(kept) == min(count, 50)


def test_the_nearest_camera_decides_how_dense_points_are():
    line = np.linspace(0, 100, 100_001)
    positions = np.stack([line, np.full_like(line, 1.0), np.zeros_like(line)], axis=1)
    cameras = np.array([(0.0, 0, 0), (100, 0, 0)])
    kept = line[evenly_seen(positions, cameras, 400)]
    near, middle = (kept < 5).sum(), ((kept > 45) & (kept < 50)).sum()
    assert near == pytest.approx((kept > 95).sum(), rel=0.1)
    assert near > 8 * middle


def test_a_point_at_a_camera_itself_is_kept():
    positions = np.array([(0.0, 0, 0), (0, 0, 1), (0, 0, 1.5), (0, 5, 0)])
    assert 0 in evenly_seen(positions, np.zeros((1, 3)), 3)


def test_equal_views_give_equal_points(halves):
    first, second = (lift(SourceDataset(halves, "", ".exr"), count=900) for _ in range(2))
    for name in ("positions", "colours", "normals"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_views_that_see_no_surface_have_no_points(tmp_path):
    write_views(tmp_path / "dataset", LENSES["panorama"], RIG, see=look_at_sky)
    points = lift(SourceDataset(tmp_path / "dataset", "", ".exr"), count=10)
    assert points.positions.shape == points.normals.shape == points.colours.shape == (0, 3)
