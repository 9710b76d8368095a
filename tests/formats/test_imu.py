"""The files of an inertial sensor: integrated, they give back the poses in lightfield.json."""

import csv
import itertools
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.formats import imu
from lightfield.formats.lightfield import LightField
from lightfield.formats.render_block import CameraMotion
from lightfield.geometry import lenses, rigs

CAMERA = {"lens": "rectilinear", "fov": 70, "resolution": [64, 48]}
PLACES = [[0, 0, 1], [1, 0.4, 1.2], [1.5, 1.6, 0.9], [0.3, 2.0, 1.1]]
TURNS = [[80, 5, 0], [95, -8, 40], [70, 0, 95], [100, 12, 150]]
AHEAD = [{"position": place} for place in PLACES]
TURNED = [{"position": p, "rotation": t} for p, t in zip(PLACES, TURNS, strict=True)]
GRAVITY = np.array([0, 0, -9.81])


def written(folder, keys, render=None, **sensor):
    """Write a path's files, and return its lightfield.json and the tables by their names."""
    settings = {"seconds": 4, "rate": 1000, **sensor}
    rig = rigs.from_settings({"type": "path", "count": 9, "keys": keys, "imu": settings})
    content = {"render": render} if render else {}
    lightfield = LightField.from_rig(rig, lenses.from_camera(CAMERA), **content)
    imu.write(folder, rig, lightfield)
    tables = {path.stem: [*csv.reader(path.open())] for path in (folder / "imu").iterdir()}
    return json.loads(json.dumps(lightfield.to_json())), tables


def numbers(table):
    return np.array(table[1:], float)


def integrated(samples, place, velocity, rotation):
    """Return body poses at all times of an imu.csv, by the mean of neighbouring samples.

    The body's axes are x right, y down, z forward.
    """
    places, rotations = [place], [rotation]
    for before, after in itertools.pairwise(samples):
        step = (after[0] - before[0]) / 1e9
        rate, force = (before[1:4] + after[1:4]) / 2, (before[4:] + after[4:]) / 2
        middle = rotation * Rotation.from_rotvec(rate * step / 2)
        acceleration = middle.apply(force) + GRAVITY
        place = place + velocity * step + acceleration * step**2 / 2
        velocity = velocity + acceleration * step
        rotation = rotation * Rotation.from_rotvec(rate * step)
        places.append(place)
        rotations.append(rotation)
    return np.array(places), Rotation.concatenate(rotations).as_matrix()


@pytest.mark.parametrize(
    ("keys", "metres", "radians"),
    # The angular rate of a path with rotations jumps at its keys: a sample's time of it is lost.
    [(AHEAD, 1e-5, 1e-6), (TURNED, 3e-3, 4e-4)],
)
def test_integrated_measurements_give_back_the_poses_in_lightfield_json(
    tmp_path, keys, metres, radians
):
    lightfield, tables = written(tmp_path, keys)
    samples = numbers(tables["imu"])
    true = np.array([frame["world_matrix"] for frame in lightfield["frames"]])
    body = true[:, :3, :3] * [1, -1, -1]
    start = numbers(tables["groundtruth"])[0]
    places, rotations = integrated(
        samples, true[0, :3, 3], start[8:11], Rotation.from_matrix(body[0])
    )
    at_views = [
        int(np.flatnonzero(samples[:, 0] == int(time))[0]) for time, _ in tables["views"][1:]
    ]
    assert len(at_views) == 9
    np.testing.assert_allclose(places[at_views], true[:, :3, 3], atol=metres)
    apart = Rotation.from_matrix(rotations[at_views]).inv() * Rotation.from_matrix(body)
    assert apart.magnitude().max() < radians


def test_the_tables_have_the_columns_and_times_of_euroc(tmp_path):
    lightfield, tables = written(tmp_path, AHEAD, seconds=3, rate=300)
    assert ",".join(tables["imu"][0]) == (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    )
    assert ",".join(tables["groundtruth"][0]) == (
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
        "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], "
        "b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], "
        "b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
    )
    times = [row[0] for row in tables["imu"][1:]]
    assert times[:3] == ["0", "3333333", "6666667"] and times[-1] == "3000000000"
    assert times == [row[0] for row in tables["groundtruth"][1:]] and len(times) == 901
    assert tables["views"] == [
        ["#timestamp [ns]", "filename"],
        *([str(375_000_000 * n), f"exr/view_{n:04d}f.exr"] for n in range(9)),
    ]
    true = numbers(tables["groundtruth"])
    frame = np.array(lightfield["frames"][8]["world_matrix"])
    np.testing.assert_allclose(true[-1, 1:4], frame[:3, 3], atol=1e-11)
    body = Rotation.from_quat(true[-1, [5, 6, 7, 4]]).as_matrix()
    np.testing.assert_allclose(body, frame[:3, :3] * [1, -1, -1], atol=1e-11)


def test_a_rolling_shutter_has_the_times_of_its_rows(tmp_path):
    motion = {"travel": [0, 0, -0.01], "rolling": 0.2}
    _, tables = written(tmp_path, AHEAD, {"camera_motion": motion}, exposure=0.03)
    assert tables["views"][0] == ["#timestamp [ns]", "filename", "first_row [ns]", "last_row [ns]"]
    for time, _, first, last in tables["views"][1:]:
        # Each row is exposed for 6 ms. The first of 48 rows ends its exposure after a 48th of the
        # 24 ms in which the others begin theirs, and the last one ends with the whole exposure.
        assert int(first) == int(time) - 12_000_000 + 500_000
        assert int(last) == int(time) + 12_000_000


def test_equal_settings_give_equal_bytes(tmp_path):
    noise = {"gyroscope_noise_density": 1e-3, "accelerometer_random_walk": 1e-2, "rate": 100}
    first, again = (written(tmp_path / name, AHEAD, **noise)[1] for name in ("first", "again"))
    assert first == again
    biases = numbers(first["groundtruth"])[:, 11:]
    assert (biases[:, :3] == 0).all() and (biases[1:, 3:] != 0).all()


def test_a_note_says_how_far_the_blur_is_from_the_paths_own_motion():
    sensor = {"seconds": 2, "exposure": 0.1}
    keys = [{"position": [0, 0, 1]}, {"position": [0, 3, 1]}]
    rig = rigs.from_settings({"type": "path", "count": 5, "keys": keys, "imu": sensor})
    # It moves 0.15 m ahead in an exposure.
    same = CameraMotion(travel=(0, 0, -0.15))
    assert float(imu.exposure_note(rig, same).split()[-5]) < 1e-6
    other = CameraMotion(travel=(0, 0, -0.05), turn=(0, 2, 0))
    assert imu.exposure_note(rig, other).endswith("by up to 0.1 m and 2 degrees")
