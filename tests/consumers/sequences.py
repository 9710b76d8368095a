"""Reads the exports of a sequence: D-NeRF with nerfstudio, videos with OpenCV, NCore by itself."""

import json

import cv2
import numpy as np

RADIUS = 3.0
BALL, BALL_RADIUS = np.array([0, 1.8, 0]), 0.5


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
    frames = sorted(folder.glob("f[0-9]*"))
    times = sorted(int(path.name[1:]) for path in frames)
    ncore(folder / "exports/ncore_frames", frames, times)
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


def ncore(folder, frames, numbers):
    """Check times, poses, rays and points of each frame, which NCore's loader gives."""
    import torch
    from ncore.data.v4 import SequenceComponentGroupsReader, SequenceLoaderV4
    from ncore.sensors import CameraModel

    rate = json.loads((folder / "export.json").read_text())["options"]["rate"]
    seconds = (np.array(numbers) - numbers[0]) / rate
    loader = SequenceLoaderV4(SequenceComponentGroupsReader([folder / "views.json"]))
    (lidar,) = map(loader.get_lidar_sensor, loader.lidar_ids)
    metres = moved = radians = levels = 0.0
    for index, _ in enumerate(frames):
        cloud = lidar.get_frame_point_cloud(index, motion_compensation=True, with_start_points=True)
        points = cloud.xyz_m_end.astype(float)
        to_sphere = np.abs(np.linalg.norm(points, axis=1) - RADIUS)
        to_ball = np.abs(np.linalg.norm(points - BALL, axis=1) - BALL_RADIUS)
        # The first frame has no ball.
        metres = max(metres, (np.minimum(to_sphere, to_ball) if index else to_sphere).max())
        assert (to_ball < 1e-4).any() == (index > 0)
    times = lidar.frames_timestamps_us[:, 1] / 1e6
    assert np.abs(times - seconds).max() < 1e-6
    for name in loader.camera_ids:
        camera = loader.get_camera_sensor(name)
        assert np.abs(camera.frames_timestamps_us[:, 1] / 1e6 - seconds).max() < 1e-6
        model = CameraModel.from_parameters(
            camera.model_parameters, device="cpu", dtype=torch.float32
        )
        width, height = model.resolution.tolist()
        for index, frame in enumerate(frames):
            assert camera.get_frame_generic_meta_data(index)["name"] == name
            matrix, lens = view_of(frame, name)
            pose = camera.get_frames_T_source_target(name, "world", np.array(index))
            pose = pose.reshape(4, 4).astype(float)
            moved = max(moved, np.abs(pose @ np.diag([1, -1, -1, 1]) - matrix).max())
            focal = lens["focal_length"] * width / lens["sensor_size"][0]
            picture = camera.get_frame_image_array(index).astype(float)
            error = shows(picture, index, matrix[:3, :3], matrix[:3, 3], focal)
            levels = max(levels, error)
            columns, rows = (axis.ravel() for axis in np.meshgrid(range(width), range(height)))
            rays = model.pixels_to_camera_rays(np.column_stack([columns, rows])).numpy()
            expected = [(columns + 0.5 - width / 2) / focal, (rows + 0.5 - height / 2) / focal]
            expected = np.column_stack([*expected, np.ones(len(rows))])
            expected /= np.linalg.norm(expected, axis=1, keepdims=True)
            radians = max(radians, np.linalg.norm(rays - expected, axis=1).max())
    print(
        f"NCore, ncore_frames: {len(loader.camera_ids)} cameras of {len(frames)} frames at "
        f"{np.round(seconds, 3).tolist()} s; poses within {moved:.2g}, rays within {radians:.2g} "
        f"rad, points within {1000 * metres:.2g} mm, colours within {levels:.1f} levels"
    )
    assert moved < 1e-6
    assert radians < 1e-5
    assert metres < 1e-4
    assert levels < 3


def view_of(frame, name):
    """Return the camera-to-world matrix (4, 4) of a view at a frame, and its camera's settings."""
    content = json.loads((frame / "lightfield.json").read_text())
    (matrix,) = [view["world_matrix"] for view in content["frames"] if view["name"] == name]
    return np.array(matrix), content["camera"] | {"sensor_size": content["sensor_size"]}
