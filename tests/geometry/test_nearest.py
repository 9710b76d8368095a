"""The nearest cameras: the same as from comparing every camera with every other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.core.errors import UserError
from lightfield.geometry.flow import neighbours
from lightfield.geometry.nearest import Cameras

AXIS = np.arange(7) * 0.1
GRID = np.stack(np.meshgrid(AXIS, AXIS, AXIS), axis=-1).reshape(-1, 3)


def turned(positions):
    return positions @ Rotation.from_euler("xyz", [40, 20, -70], degrees=True).as_matrix()


def scattered(count, scale=1.0, seed=1):
    return np.random.default_rng(seed).normal(size=(count, 3)) * scale


PLACES = {
    # Many cameras are equally far, except for rounding.
    "a grid": GRID,
    "a turned grid": turned(GRID),
    "a grid far away": GRID + 1e5,
    "anywhere": scattered(300),
    # Six views at each place, as of a cube.
    "six at each": np.repeat(scattered(40), 6, axis=0),
    # There are more at each place than a query asks for.
    "two places": np.tile([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], (60, 1)),
    "clusters": np.repeat(scattered(20), 10, axis=0) + scattered(200, 1e-6, seed=2),
}


@pytest.mark.parametrize("name", PLACES)
def test_no_other_camera_is_nearer(name):
    positions, count, tie = PLACES[name], 12, 1e-6
    cameras = Cameras(positions)
    for camera, position in enumerate(positions):
        nearest = cameras.nearest(camera, count, tie)
        away = np.linalg.norm(positions - position, axis=1)
        # By rounded distance. Equally far ones keep their order.
        order = np.lexsort([np.arange(len(positions)), np.round(away, 6)])
        expected = order[order != camera][:count]
        assert camera not in nearest
        assert set(expected) <= set(nearest)
        assert list(nearest) == sorted(nearest)


@pytest.mark.parametrize("name", PLACES)
def test_flow_leads_to_the_nearest_view_elsewhere_with_the_most_similar_direction(name):
    positions = PLACES[name]
    matrices = np.tile(np.eye(4), (len(positions), 1, 1))
    matrices[:, :3, :3] = Rotation.random(len(positions), random_state=1).as_matrix()
    matrices[:, :3, 3] = positions
    for view, other in enumerate(neighbours(matrices)):
        away = np.linalg.norm(positions - positions[view], axis=1)
        elsewhere = away >= 1e-6
        equally_near = elsewhere & (away <= away[elsewhere].min() * (1 + 1e-6))
        alike = matrices[:, :3, 2] @ matrices[view, :3, 2]
        assert equally_near[other]
        assert alike[other] == pytest.approx(alike[equally_near].max(), abs=1e-5)


def test_a_single_camera_has_no_others():
    assert list(Cameras(np.zeros((1, 3))).nearest(0, 12, 1e-6)) == []
    assert list(Cameras(np.zeros((3, 3))).nearest(1, 12, 1e-6)) == [0, 2]


def test_views_from_one_place_have_no_flow():
    matrices = np.tile(np.eye(4), (100, 1, 1))
    with pytest.raises(UserError, match="all views are from one place"):
        neighbours(matrices)
