"""Rigs whose size and place follow from a scene's box: each camera sees it, or stands in it."""

import itertools

import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.geometry import rigs
from lightfield.geometry.rigs import from_settings

CAMERAS = {
    "perspective": {"lens": "rectilinear", "fov": 40, "resolution": [64, 48]},
    "upright": {"lens": "rectilinear", "fov": 70, "resolution": [30, 90]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [64, 64]},
}
BOXES = {
    "unit": [[-0.5, -0.2, -0.4], [0.5, 0.2, 0.4]],
    "far away": [[100, 20, -3], [104, 21, 30]],
    "flat": [[-1, -2, 0], [1, 2, 0]],
}
INWARD = {
    "hemisphere": {"count": 30},
    "ring": {"count": 9, "elevation": 20},
    "spiral": {"count": 20},
    "sphere": {"subdivisions": 2, "face_inside": True},
}
AHEAD = {"plane": {"cameras": [4, 3]}, "lattice": {"cameras": [2, 2, 3]}}
OUTWARD = {
    "cuboid": {"cameras": [3, 3, 3]},
    "cylinder": {"cameras": [8, 3]},
    "sphere": {"subdivisions": 2},
    "random": {"count": 20},
}
FIT = {"size": "fit", "center": "fit"}


def placed(kind, keys, camera, box, **more):
    rig = from_settings({"type": kind, **keys, "camera": camera, **FIT, **more})
    fitting = rigs.fitted(rig, np.array(box, float))
    assert not fitting.is_fitted
    return fitting, [pose.world_from_camera() for pose in fitting.poses()]


def share_in_frame(rig, world_from_cameras, box):
    """Return the part of the box's corners that each camera has in its image."""
    lens = rig.camera.make()
    corners = np.array(list(itertools.product(*np.transpose(box))), float)
    shares = []
    for pose in world_from_cameras:
        local = (corners - pose[:3, 3]) @ pose[:3, :3]
        shares.append(lens.in_frame(lens.pixels(local)).mean())
    return np.array(shares)


@pytest.mark.parametrize("turn", [(0, 0, 0), (10, -20, 70)])
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("kind", [*INWARD, *AHEAD])
def test_each_camera_sees_the_whole_box_and_none_is_in_it(kind, box, camera, turn):
    keys = (INWARD | AHEAD)[kind]
    rig, cameras = placed(kind, keys, CAMERAS[camera], BOXES[box], rotation=turn)
    assert share_in_frame(rig, cameras, BOXES[box]) == pytest.approx(1)
    low, high = BOXES[box]
    places = np.array(cameras)[:, :3, 3]
    assert ((places < low) | (places > high)).any(axis=1).all()
    # A camera that is much too far away sees the box small.
    reach = np.linalg.norm(np.subtract(high, low))
    assert np.linalg.norm(places - np.mean([low, high], axis=0), axis=1).max() < 6 * reach


@pytest.mark.parametrize("kind", OUTWARD)
def test_cameras_that_look_outward_are_in_the_inner_half_of_the_box(kind):
    low, high = np.array(BOXES["far away"], float)
    rig, cameras = placed(kind, OUTWARD[kind], CAMERAS["fisheye"], BOXES["far away"])
    places = np.array(cameras)[:, :3, 3]
    quarter = (high - low) / 4
    assert ((places >= low + quarter - 1e-4) & (places <= high - quarter + 1e-4)).all()
    if kind in ("sphere", "cylinder"):
        assert rig.size == 0.5
    else:
        assert np.allclose(rig.size, 2 * quarter)


def test_a_flat_box_has_no_room_for_cameras_within_it():
    with pytest.raises(UserError, match="size: fit: the scene's box is flat, 2 × 4 × 0 m"):
        placed("cuboid", OUTWARD["cuboid"], CAMERAS["fisheye"], BOXES["flat"])


def test_a_size_alone_fits_the_place_that_is_given():
    keys = {"count": 12}
    rig, cameras = placed(
        "hemisphere", keys, CAMERAS["perspective"], BOXES["unit"], center=[1, 0, 0]
    )
    assert rig.center == (1, 0, 0)
    assert (share_in_frame(rig, cameras, BOXES["unit"]) == 1).all()


def test_a_center_alone_fits_the_size_that_is_given():
    plane = {"cameras": [3, 3], "baseline": 2}
    rig = from_settings({"type": "plane", **plane, "center": "fit", "camera": CAMERAS["upright"]})
    fitting = rigs.fitted(rig, np.array(BOXES["unit"]))
    cameras = [pose.world_from_camera() for pose in fitting.poses()]
    assert (share_in_frame(fitting, cameras, BOXES["unit"]) == 1).all()
    assert fitting.extent == (4, 0, 4)
    ring = from_settings(
        {"type": "ring", "count": 3, "size": 7, "center": "fit", "camera": CAMERAS["upright"]}
    )
    assert rigs.fitted(ring, np.array(BOXES["far away"])).center == (102, 20.5, 13.5)


@pytest.mark.parametrize("key", ["size", "center"])
@pytest.mark.parametrize(
    "rig",
    [
        {"type": "path", "count": 2, "keys": [{"position": [0, 0, 0]}, {"position": [1, 0, 0]}]},
        {"type": "poses", "file": "poses.csv"},
        {"type": "blend_camera"},
    ],
    ids=lambda rig: rig["type"],
)
def test_places_that_are_given_do_not_fit(rig, key):
    with pytest.raises(UserError, match=f"{key}: fit does not go with type {rig['type']}"):
        from_settings({**rig, key: "fit", "camera": CAMERAS["upright"]})


def test_numbers_stay_as_they_are():
    rig = from_settings({"type": "ring", "count": 3, "size": 7, "camera": CAMERAS["upright"]})
    assert rigs.fitted(rig, np.array(BOXES["unit"])) is rig


def test_another_word_is_refused_by_what_is_allowed():
    with pytest.raises(UserError, match=r'size: is "fits"; must be .* or fit$'):
        from_settings({"type": "ring", "count": 3, "size": "fits"})
