"""Reads the exports of a sequence: D-NeRF with nerfstudio, and videos with OpenCV."""

import json

import cv2
import numpy as np

RADIUS = 3.0


def shows(picture, frame, rotation, position, focal):
    """Check that a picture is what a frame's scene shows to a pinhole. Return its largest error.

    From the second frame on, a red ball hides a part of the sphere. ``rotation`` (3, 3) is
    camera-to-world, in OpenGL's axes.
    """
    height, width = picture.shape[:2]
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack(
        [(columns - width / 2) / focal, (height / 2 - rows) / focal, -np.ones(rows.shape)], axis=-1
    )
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ rotation.T
    along = rays @ position
    distance = -along + np.sqrt(along**2 + RADIUS**2 - position @ position)
    expected = 40 + 175 * ((position + rays * distance[..., None]) / RADIUS / 2 + 0.5)
    errors = np.abs(picture - expected).max(axis=-1)
    on_ball = picture[..., 0] > 150
    on_ball &= picture[..., 1] < 100
    assert on_ball.any() == (frame > 0)
    # Video mixes colours around the ball's edge.
    near_ball = cv2.dilate(on_ball.astype(np.uint8), np.ones((7, 7))) > 0
    return errors[~near_ball].max()


def check(folder):
    times = sorted(int(path.name[1:]) for path in folder.glob("f[0-9]*"))
    times = [(time - times[0]) / (times[-1] - times[0]) for time in times]
    dnerf(folder / "exports/dnerf", times)
    if (folder / "exports/neural_3d_video").exists():
        neural_3d_video(folder / "exports/neural_3d_video", len(times))


def dnerf(folder, times):
    from nerfstudio.data.dataparsers.dnerf_dataparser import DNeRFDataParserConfig

    parser = DNeRFDataParserConfig(data=folder).setup()
    counts, levels = [], 0.0
    for part in ("train", "val", "test"):
        outputs = parser.get_dataparser_outputs(part)
        cameras = outputs.cameras
        assert cameras.times[0] == 0
        for index, path in enumerate(outputs.image_filenames):
            time = float(cameras.times[index])
            frame = int(np.abs(np.array(times) - time).argmin())
            assert abs(times[frame] - time) < 1e-6
            matrix = cameras.camera_to_worlds[index].numpy().astype(float)
            picture = cv2.imread(str(path))[..., ::-1].astype(float)
            focal = float(cameras.fx[index])
            levels = max(levels, shows(picture, frame, matrix[:, :3], matrix[:, 3], focal))
        counts.append(len(outputs.image_filenames))
    print(f"nerfstudio, dnerf: {counts} pictures, colours within {levels:.1f} levels")
    assert levels < 3


def neural_3d_video(folder, count):
    rows = np.load(folder / "poses_bounds.npy")
    videos = sorted(folder.glob("cam*.mp4"))
    assert len(rows) == len(videos)
    levels = 0.0
    for row, path in zip(rows, videos, strict=True):
        poses = row[:15].reshape(3, 5)
        rotation = np.stack([poses[:, 1], -poses[:, 0], poses[:, 2]], axis=-1)
        height, width, focal = poses[:, 4]
        reader = cv2.VideoCapture(str(path))
        for frame in range(count):
            is_read, picture = reader.read()
            assert is_read
            assert picture.shape[:2] == (height, width)
            error = shows(picture[..., ::-1].astype(float), frame, rotation, poses[:, 3], focal)
            levels = max(levels, error)
        assert not reader.read()[0]
    listed = json.loads((folder / "export.json").read_text())["format"]
    print(
        f"OpenCV {cv2.__version__}, {listed}: {len(videos)} videos of {count} pictures, colours "
        f"within {levels:.1f} levels"
    )
    assert levels < 16
