"""The inertial sensor of a path: its motion is the views', and it measures what physics says."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.core.errors import UserError
from lightfield.geometry import rigs
from lightfield.geometry.inertia import measured, world_from_body
from lightfield.geometry.rigs.mount import Mount

BEND = [[0, 0, 1], [1, 0.4, 1.2], [1.5, 1.6, 0.9], [0.3, 2.0, 1.1]]
TURNED = [
    {"position": place, "rotation": turn}
    for place, turn in zip(
        BEND, [[80, 5, 0], [95, -8, 40], [70, 0, 95], [100, 12, 150]], strict=True
    )
]
AHEAD = [{"position": place} for place in BEND]
RIG = {"type": "path", "count": 9, "imu": {"seconds": 4, "rate": 1000}}
VARIANTS = {
    "ahead": {"keys": AHEAD},
    "turned": {"keys": TURNED},
    "closed": {"keys": AHEAD, "closed": True},
    "turned, closed": {"keys": TURNED, "closed": True},
    "placed": {"keys": AHEAD, "size": [1, 2, 0.5], "rotation": [10, -25, 70], "center": [3, 1, 2]},
    "turned, placed": {"keys": TURNED, "rotation": [10, -25, 70], "center": [3, 1, 2]},
    "backward": {"keys": AHEAD, "face_inside": True},
    "looking": {"keys": AHEAD, "look_at": [0.5, 5, 0.2], "rotation": [0, 20, 0]},
}


def path(**keys):
    return rigs.from_settings(RIG | keys)


@pytest.fixture(params=VARIANTS)
def rig(request):
    return path(**VARIANTS[request.param])


def still(seconds, **keys):
    """Return a level path on a straight line, which takes so long that it is nearly still."""
    imu = {"seconds": seconds, **keys}
    return path(keys=[{"position": [0, 0, 1]}, {"position": [0, 1, 1]}], imu=imu)


def sampled(rig):
    motion = rig.motion(np.arange(rig.imu.samples) / rig.imu.rate)
    return motion, measured(motion, rig.imu)


def test_at_the_times_of_the_views_the_motion_has_their_poses(rig):
    motion = rig.motion(rig.view_times())
    poses = np.array([pose.world_from_camera() for pose in rig.poses()])
    np.testing.assert_allclose(motion.positions, poses[:, :3, 3], atol=1e-11)
    np.testing.assert_allclose(motion.world_from_camera, poses[:, :3, :3], atol=1e-11)


def test_velocity_acceleration_and_rates_are_differences_of_the_poses(rig):
    # Not at a key, where the angular rate of a path with rotations jumps.
    times, step = np.array([0.31, 0.77, 1.61, 2.05, 3.37]), 1e-4
    before, now, after = (rig.motion(times + shift) for shift in (-step, 0, step))
    np.testing.assert_allclose(
        now.velocities, (after.positions - before.positions) / (2 * step), atol=1e-6
    )
    np.testing.assert_allclose(
        now.accelerations, (after.velocities - before.velocities) / (2 * step), atol=1e-6
    )
    turned = Rotation.from_matrix(before.world_from_camera).inv() * Rotation.from_matrix(
        after.world_from_camera
    )
    np.testing.assert_allclose(now.rates, turned.as_rotvec() / (2 * step), atol=1e-6)


def test_a_level_camera_at_rest_measures_gravity_upward():
    _, found = sampled(still(1e6, rate=0.001))
    # The body's y points down.
    np.testing.assert_allclose(found.forces, np.full((1001, 3), [0, -9.81, 0]), atol=1e-9)
    np.testing.assert_allclose(found.rates, 0, atol=1e-9)


def test_a_camera_on_a_circle_measures_its_centripetal_acceleration():
    angles = np.radians(np.arange(0, 360, 3))
    keys = [{"position": [2 * math.cos(a), 2 * math.sin(a), 1]} for a in angles.tolist()]
    _, found = sampled(path(keys=keys, closed=True, imu={"seconds": 5}))
    speed = 2 * math.pi * 2 / 5
    # It looks ahead and goes round to its left: the centre is at −x.
    np.testing.assert_allclose(found.forces[:, 0], -(speed**2) / 2, rtol=1e-3)
    np.testing.assert_allclose(found.forces[:, 1:], np.full((1001, 2), [-9.81, 0]), atol=1e-6)
    # A turn to the left is one about −y, which points up.
    np.testing.assert_allclose(found.rates[:, 1], -2 * math.pi / 5, rtol=1e-3)


def test_noise_has_the_deviations_that_were_asked():
    asked = {
        "gyroscope_noise_density": 1.7e-4,
        "accelerometer_noise_density": 2e-3,
        "gyroscope_random_walk": 1.9e-5,
        "accelerometer_random_walk": 3e-3,
    }
    white = {key: value for key, value in asked.items() if "noise" in key}
    _, found = sampled(still(400, rate=200, **white))
    _, clean = sampled(still(400, rate=200))
    for noisy, true, density in (
        (found.rates, clean.rates, 1.7e-4),
        (found.forces, clean.forces, 2e-3),
    ):
        noise = noisy - true
        assert noise.std() == pytest.approx(density * math.sqrt(200), rel=0.01)
        # Allan's deviation of white noise at one second is its density.
        seconds = noise[:80_000].reshape(400, 200, 3).mean(axis=1)
        allan = np.sqrt(np.mean(np.diff(seconds, axis=0) ** 2) / 2)
        assert allan == pytest.approx(density, rel=0.08)
    _, walked = sampled(still(400, rate=200, **asked))
    for biases, walk in ((walked.rate_biases, 1.9e-5), (walked.force_biases, 3e-3)):
        assert (biases[0] == 0).all()
        assert np.diff(biases[::200], axis=0).std() == pytest.approx(walk, rel=0.05)
    np.testing.assert_allclose(walked.rates - walked.rate_biases, found.rates, atol=1e-15)


def test_equal_seeds_give_equal_noise_and_a_longer_path_keeps_it():
    noise = {"rate": 100, "gyroscope_noise_density": 0.01}
    first, again, longer, other = (
        sampled(still(seconds, **noise, seed=seed))[1].rates
        for seconds, seed in ((100, 3), (100, 3), (200, 3), (100, 4))
    )
    np.testing.assert_array_equal(first, again)
    np.testing.assert_allclose(longer[:10_001], first, atol=1e-15)
    assert np.abs(other - first).max() > 0.1


def test_the_pair_of_a_stereo_rig_lies_beside_the_body():
    rig = path(keys=AHEAD, stereo={"distance": 0.2})
    motion = rig.motion(rig.view_times())
    left, right = (np.array([pose.position for pose in rig.poses()[eye::2]]) for eye in (0, 1))
    np.testing.assert_allclose((left + right) / 2, motion.positions, atol=1e-11)
    across = np.einsum("nij,ni->nj", world_from_body(motion), right - left)
    np.testing.assert_allclose(across, np.full((9, 3), [0.2, 0, 0]), atol=1e-11)


def test_the_cameras_of_a_head_lie_on_the_body():
    rig = path(keys=AHEAD)
    mount = Mount(head="pair", name="back", position=(0.1, 0, 0.2), rotation=(0, 180, 0))
    mounted = rig.model_copy(update={"mount": mount})
    motion = mounted.motion(mounted.view_times())
    poses = np.array([pose.world_from_camera() for pose in mounted.poses()])
    apart = np.einsum("nij,ni->nj", world_from_body(motion), poses[:, :3, 3] - motion.positions)
    np.testing.assert_allclose(apart, np.full((9, 3), [0.1, 0, -0.2]), atol=1e-11)
    np.testing.assert_allclose(poses[:, :3, 2], -motion.world_from_camera[..., 2], atol=1e-11)


def test_the_motion_does_not_depend_on_the_number_of_views():
    few, many = (path(keys=AHEAD, count=count).motion(np.array([1.3])) for count in (3, 30))
    np.testing.assert_array_equal(few.positions, many.positions)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"imu": {}}, "seconds"),
        ({"imu": {"seconds": 1e5}}, "1,000,000"),
        ({"imu": {"seconds": 0}}, "seconds"),
        ({"frames": {"first": 1, "last": 2}}, "imu: does not go with frames"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(keys, message):
    with pytest.raises(UserError, match=message):
        path(keys=AHEAD, **keys)


def test_a_camera_that_looks_straight_up_has_no_upright_axes():
    rig = path(keys=[{"position": [0, 0, 0]}, {"position": [0, 0, 2]}])
    with pytest.raises(UserError, match=r"straight up or down.*give each key a rotation"):
        rig.motion(rig.view_times())
