"""The video of a dataset: how the eye moves, and what the pictures of the file show."""

import itertools
import subprocess

import numpy as np
import pytest
from oracles.readers.mp4 import read_mp4
from PIL import Image
from scipy.spatial import Delaunay
from sphere import BALL, look_at_ball, look_at_ball_alone, make_transparent, write_views

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256
from lightfield.geometry import rigs
from lightfield.report import video_path, walk
from lightfield.report.video_path import Standpoint
from lightfield.stages.report import MakeVideo, VideoSettings

CAMERA = {"lens": "rectilinear", "fov": 90, "resolution": [48, 48]}
AROUND = {"type": "ring", "count": 12, "size": 2.2, "center": BALL.tolist(), "camera": CAMERA}
BEFORE = {"type": "plane", "cameras": [3, 3], "size": 0.8, "camera": CAMERA}
HEIGHT = WIDTH = 36
COUNT = 40


def video_of(folder, rig, output, see=look_at_ball, **settings):
    """Write the views of a rig, and their video. Return its folder."""
    if not folder.exists():
        write_views(folder, rig["camera"], rigs.from_settings(rig), see=see)
    chosen = {"path": "turntable", "format": "webp", "seconds": 1, "height": HEIGHT} | settings
    settings = VideoSettings(rig=rigs.from_settings(rig), **chosen)
    MakeVideo(settings=settings, dataset=folder, output=output).run()
    return output


def pictures_of(path):
    """Return the pictures (n, h, w, 3) of an animation, 0 to 255."""
    with Image.open(path) as animation:
        shown = []
        for number in range(animation.n_frames):
            animation.seek(number)
            shown.append(np.asarray(animation.convert("RGB"), float))
        return np.array(shown)


def middle_of(pictures):
    return pictures[:, HEIGHT // 2, WIDTH // 2]


def is_red(pixels):
    return (pixels[..., 0] > 2.5 * pixels[..., 1]) & (pixels[..., 0] > 2.5 * pixels[..., 2])


def test_a_turntable_shows_the_object_from_all_sides(tmp_path):
    folder = video_of(tmp_path / "dataset", AROUND, tmp_path / "dataset/video")
    shown = pictures_of(folder / "turntable.webp")
    assert shown.shape == (25, HEIGHT, WIDTH, 3)
    assert is_red(middle_of(shown)).all()
    assert all(np.any(one != other) for one, other in itertools.pairwise(shown))
    # More of the wall's red is at larger x, and more of its green at larger y. The wall behind the
    # ball goes around once: red and green are highest a quarter of the circle apart.
    wall = shown[:, :, [0, -1]].mean(axis=(1, 2))
    wave = np.fft.rfft(wall - wall.mean(axis=0), axis=0)
    assert (np.abs(wave[1, :2]) > 5 * np.abs(wave[2:, :2]).max(axis=0)).all()
    quarter = np.angle(wave[1, 0] / wave[1, 1])
    assert abs(quarter) == pytest.approx(np.pi / 2, abs=0.3)


def test_cameras_that_do_not_surround_the_object_give_a_sway(tmp_path):
    folder = video_of(tmp_path / "dataset", BEFORE, tmp_path / "dataset/video")
    shown = pictures_of(folder / "turntable.webp")
    assert is_red(middle_of(shown)).all()
    red = shown[:, :, [0, -1], 0].mean(axis=(1, 2))
    first, one_side, other_side = red[[0, 6, 19]]
    assert min(abs(one_side - first), abs(other_side - first)) > 1
    assert (one_side - first) * (other_side - first) < 0


def test_a_walk_comes_nearer_and_back(tmp_path):
    folder = video_of(tmp_path / "dataset", AROUND, tmp_path / "dataset/video", path="walk")
    shown = pictures_of(folder / "walk.webp")
    size = is_red(shown).sum(axis=(1, 2))
    assert size.argmax() in range(10, 16)
    assert size.max() > 1.2 * size[0]


def test_an_mp4_has_the_size_and_the_length_that_were_asked_for(tmp_path):
    options = {"format": "mp4", "seconds": 1.2}
    folder = video_of(tmp_path / "dataset", AROUND, tmp_path / "dataset/video", **options)
    path = folder / "turntable.mp4"
    facts = read_mp4(path)
    assert (facts.width, facts.height, facts.pictures, facts.rate) == (WIDTH, HEIGHT, 30, 25)
    command = ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    shown = np.frombuffer(raw, np.uint8).reshape(30, HEIGHT, WIDTH, 3).astype(float)
    assert is_red(middle_of(shown)).all()


@pytest.mark.parametrize("kind", ["mp4", "webp"])
def test_equal_settings_give_equal_bytes_and_the_list_names_them(tmp_path, kind):
    sums = []
    for name in ("video", "again"):
        folder = video_of(tmp_path / "dataset", AROUND, tmp_path / name, format=kind)
        listed = read_json(folder / "export.json")
        assert listed["format"] == "video"
        assert listed["options"]["path"] == "turntable"
        assert listed["files"] == {f"turntable.{kind}": sha256(folder / f"turntable.{kind}")}
        sums.append(listed["files"])
    assert sums[0] == sums[1]


def test_a_video_of_a_transparent_object_is_black_around_it(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, rigs.from_settings(AROUND), see=look_at_ball_alone)
    make_transparent(tmp_path / "dataset", 1)
    folder = video_of(tmp_path / "dataset", AROUND, tmp_path / "dataset/video")
    shown = pictures_of(folder / "turntable.webp")
    assert is_red(middle_of(shown)).all()
    assert shown[:, [0, -1]][:, :, [0, -1]].max() < 10


def test_views_without_depth_are_refused_and_leave_nothing(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, CAMERA, rigs.from_settings(AROUND))
    path = dataset / "lightfield.json"
    path.write_text(path.read_text().replace('"depth": "z"', '"depth": null'))
    with pytest.raises(UserError, match=r"lightfield\.json: depth: is null"):
        video_of(dataset, AROUND, dataset / "video")
    assert not (dataset / "video").exists()


# ---- the eye's path ---------------------------------------------------------------------------


def places_of(poses):
    return poses[:, :3, 3]


def cosine_to(poses, target):
    """Return the cosine between each eye's axis and its way to the target."""
    way = target - places_of(poses)
    return -(poses[:, :3, 2] * way).sum(axis=1) / np.linalg.norm(way, axis=1)


def cameras_of(rig):
    return np.array([pose.world_from_camera() for pose in rigs.from_settings(rig).poses()])


def test_a_full_circle_keeps_its_distance_and_its_height():
    cameras = cameras_of(AROUND | {"elevation": 20})
    target = video_path.common_target(cameras)
    np.testing.assert_allclose(target, BALL, atol=1e-9)
    places = places_of(cameras)
    standpoint = Standpoint(places[0], target)
    poses = video_path.turntable(standpoint, places, walk.bounds(places), COUNT)
    np.testing.assert_allclose(cosine_to(poses, target), 1)
    np.testing.assert_allclose(np.linalg.norm(places_of(poses) - target, axis=1), 1.1)
    np.testing.assert_allclose(places_of(poses)[:, 2], places[0, 2])
    angles = np.unwrap(np.arctan2(*(places_of(poses) - target)[:, 1::-1].T))
    np.testing.assert_allclose(np.abs(np.diff(angles)), 2 * np.pi / COUNT)
    # No picture is tilted.
    np.testing.assert_allclose(poses[:, 2, 0], 0, atol=1e-12)


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("path", ["turntable", "walk"])
def test_the_eye_stays_between_the_cameras_of_a_volume(path, down):
    box = {"type": "lattice", "cameras": [3, 3, 3], "size": [2, 1, 1], "camera": CAMERA}
    places = places_of(cameras_of(box))
    target = np.array([0.0, 0.0, -5.0] if down else [0.0, 5.0, 0.0])
    standpoint = Standpoint(np.zeros(3), target)
    planes = walk.bounds(places)
    if path == "turntable":
        poses = video_path.turntable(standpoint, places, planes, COUNT)
        assert np.ptp(places_of(poses)[:, 0]) == pytest.approx(1, abs=0.05)
    else:
        poses = video_path.walk(standpoint, planes, COUNT)
        assert np.ptp(places_of(poses)[:, 0]) == pytest.approx(1, abs=0.01)
    assert (Delaunay(places * 1.000001).find_simplex(places_of(poses)) >= 0).all()
    np.testing.assert_allclose(cosine_to(poses, target), 1)
    np.testing.assert_allclose(places_of(poses)[0], 0, atol=1e-9)
    # Pictures follow each other smoothly, and the first follows the last.
    turns = np.einsum("nij,nij->n", poses[:, :3, :3], np.roll(poses, 1, axis=0)[:, :3, :3])
    assert turns.min() > 3 - 0.01
