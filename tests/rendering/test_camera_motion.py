"""Cameras that move while their shutters are open: blur, rolling shutter, and the poses."""

import numpy as np
import pytest
from conftest import BLENDER
from pydantic import ValidationError

from lightfield.configuration.scene_yaml import Scene
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.exposure import pose_at, row_times

SIZE = 64
# Pixels for a metre on a wall 2 m ahead, of a perspective of 60°.
PIXELS_PER_METRE = SIZE / 2 / np.tan(np.radians(30)) / 2
TRAVEL = 0.3


@pytest.fixture(scope="module")
def pictures(tmp_path_factory, run_program):
    """Pictures of a bright wall, which fills the right half of a still picture."""
    folder = tmp_path_factory.mktemp("motion")
    run_program(BLENDER / "motion_renders.py", folder)
    return np.load(folder / "results.npz")


def edges(picture):
    """Return the place of the wall's left edge in each row, in pixels."""
    return SIZE - picture.sum(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["travel", "turn"])
def test_blur_is_the_mean_of_sub_frames(pictures, name):
    blurred = pictures[name]
    mean = pictures[f"{name}_sub_frames"]
    still = pictures["still"]
    assert np.abs(blurred - still).mean() > 0.02
    # One of 16 steps, and the standard deviation of 64 samples of 0 or 1.
    assert np.abs(blurred - mean).max() < 1 / 16 + 0.5 / 8
    # The same for the mean of 64 rows.
    assert np.abs(blurred.mean(axis=0) - mean.mean(axis=0)).max() < (1 / 16 + 0.5 / 8) / 8
    assert abs(edges(blurred).mean() - edges(mean).mean()) < 0.05


@pytest.mark.slow
def test_blur_is_as_wide_as_the_travel_on_the_wall(pictures):
    profile = pictures["travel"].mean(axis=0)
    width = TRAVEL * PIXELS_PER_METRE
    columns = np.arange(SIZE) + 0.5
    # A box of this width, with the mean of a pixel: 0 to its left, 1 to its right.
    expected = np.clip((columns - SIZE / 2) / width + 0.5, 0, 1)
    inside = np.abs(columns - SIZE / 2) < width / 2 - 0.5
    error = 0.5 / np.sqrt(64 * SIZE)
    assert np.abs(profile - expected)[inside].max() < 5 * error


@pytest.mark.slow
@pytest.mark.parametrize("rolling", [0.01, 0.5])
def test_rows_see_the_edge_at_their_times(pictures, rolling):
    places = edges(pictures[f"rolling_{rolling}"])
    # The camera moves to the right, so the edge moves to the left.
    expected = SIZE / 2 - TRAVEL * PIXELS_PER_METRE * row_times(SIZE, rolling)
    # A row has as many samples as its blurred pixels: their mean varies by this.
    blurred = TRAVEL * PIXELS_PER_METRE * rolling + 1
    assert np.abs(places - expected).max() < 5 * 0.5 * np.sqrt(blurred) / 8
    slope = np.polyfit(row_times(SIZE, rolling), places, 1)[0]
    assert abs(slope + TRAVEL * PIXELS_PER_METRE) < 0.02 * TRAVEL * PIXELS_PER_METRE


@pytest.mark.slow
@pytest.mark.parametrize("lens", ["fisheye", "panorama"])
def test_wide_lenses_blur_and_roll_as_well(pictures, lens):
    blurred = pictures[lens]
    mean = pictures[f"{lens}_sub_frames"]
    still = pictures[f"{lens}_still"]
    # A pixel at the edge differs by one of 16 steps, and by the noise of 64 samples.
    assert np.abs(blurred - mean).max() < 1 / 16 + 4 * 0.5 / 8
    assert np.abs(blurred - still).max() > 0.25
    for axis, count in enumerate(blurred.shape):
        difference = (blurred - mean).mean(axis=axis)
        assert np.abs(difference).max() < (1 / 16 + 0.5 / 8) / np.sqrt(count)
    # Each row is that of the camera standing still where it is at the row's time.
    rows = pictures[f"{lens}_rows"]
    assert np.abs(rows - still).sum(axis=1).max() > 1
    assert np.abs(pictures[f"{lens}_rolling"] - rows).sum(axis=1).max() < 0.2


@pytest.mark.slow
def test_a_window_of_a_rolling_shutter_has_the_rows_of_the_view(pictures):
    window = pictures["trial_window"]
    np.testing.assert_array_equal(window, pictures["trial"][40:60, 8:56])
    expected = SIZE / 2 - TRAVEL * PIXELS_PER_METRE * row_times(SIZE, 0.5)[40:60]
    assert np.abs(56 - window.sum(axis=1) - expected).max() < 0.5


@pytest.mark.slow
def test_depth_is_that_of_the_middle_of_the_exposure(pictures):
    moving = pictures["depth"]
    np.testing.assert_array_equal(np.isinf(moving), np.isinf(pictures["depth_still"]))
    hit = np.isfinite(moving)
    np.testing.assert_allclose(moving[hit], pictures["depth_still"][hit], rtol=1e-6)


@pytest.mark.slow
def test_a_views_pixels_do_not_depend_on_the_view_before(pictures):
    np.testing.assert_array_equal(pictures["turn"], pictures["turn_again"])


def test_lightfield_json_has_the_poses_at_start_and_end(tmp_path):
    rig = {"type": "sphere", "subdivisions": 1, "size": 1.0}
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    render = {"camera_motion": {"travel": [0.2, 0, 0], "turn": [0, 90, 0]}}
    content = LightField.from_rig(rig, lenses.from_camera(camera), depth=None, render=render)
    content.with_exposure().write(tmp_path / "lightfield.json")
    for view in LightField.read(tmp_path / "lightfield.json").views:
        start, end = view.exposure
        right, _, back = view.world_from_camera[:3, :3].T
        np.testing.assert_allclose(end[:3, 3] - start[:3, 3], 0.2 * right, atol=1e-11)
        np.testing.assert_allclose((start + end)[:3, 3] / 2, view.position, atol=1e-11)
        # 45° about the camera's up: the end looks to the left, the start to the right.
        np.testing.assert_allclose(end[:3, 2], (right + back) / np.sqrt(2), atol=1e-11)
        np.testing.assert_allclose(start[:3, 2], (back - right) / np.sqrt(2), atol=1e-11)


def test_a_turn_has_constant_speed():
    turn = (10, -20, 30)
    poses = [pose_at(np.eye(4), (0, 0, 0), turn, time)[:3, :3] for time in (-0.5, 0, 0.25, 0.5)]
    np.testing.assert_allclose(poses[2] @ poses[2], poses[3], atol=1e-12)
    np.testing.assert_allclose(poses[0] @ poses[3], np.eye(3), atol=1e-12)
    angle = np.degrees(np.arccos((np.trace(poses[3]) - 1) / 2))
    assert abs(angle - np.linalg.norm(turn) / 2) < 1e-9


def test_a_moving_camera_is_refused_with_cube_maps_whose_faces_have_their_own_axes():
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [8, 8]}
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 1, "cube_map": True, "camera": camera}
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 1, "camera_motion": {"travel": [0.1, 0, 0]}},
        "rigs": {"cubes": rig},
    }
    with pytest.raises(ValidationError, match=r"render\.camera_motion: .*rigs\.cubes\.cube_map"):
        Scene.model_validate(content)
    content["rigs"]["cubes"]["cube_map"] = False
    Scene.model_validate(content)
