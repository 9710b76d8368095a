"""Reads the exports with the consumers' own code, and learns a radiance field from them.

The consumers are nerfstudio, NCore and OpenCV. `make consumers` runs this in an environment of its
own, after export.py. The tests read COLMAP's models with pycolmap. Prints the largest error of each
export. An error beyond its limit ends in an AssertionError. published.py reads what is published,
sequences.py the exports with a time, lichtfeld.py those for a program that has no Python package,
each.py every export of the same views, and learning.py those from which a field learns.
"""

import json
import sys
from pathlib import Path

import cv2
import each
import learning
import lichtfeld
import numpy as np
import published
import sequences

RADIUS = 3.0  # The radius of the scene, a sphere around the origin.


def angle(first, second):
    """Return the angle in radians between directions (..., 3)."""
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.arctan2(across, (first * second).sum(axis=-1))


def ours(folder, name):
    """Return the names, the camera-to-world matrices, and the rays of the pixels of a camera."""
    saved = np.load(folder / f"{name}.npz")
    return saved["names"].tolist(), saved["matrices"], saved["rays"]


def nerfstudio_parser(folder):
    """Return nerfstudio's parser of an export. It leaves the poses as they are."""
    from nerfstudio.data.dataparsers.nerfstudio_dataparser import NerfstudioDataParserConfig

    return NerfstudioDataParserConfig(
        data=folder,
        orientation_method="none",
        center_method="none",
        auto_scale_poses=False,
        downscale_factor=1,
        load_3D_points=False,  # would need open3d
    ).setup()


def nerfstudio(folder, name):
    parser = nerfstudio_parser(folder / "nerfstudio" / name)
    names, matrices, rays = ours(folder, name)
    seen = np.isfinite(rays[..., 0])
    radians = metres = 0.0
    parts = [parser.get_dataparser_outputs(part) for part in ("train", "val", "test")]
    for outputs in parts[::2]:
        for index, path in enumerate(outputs.image_filenames):
            matrix = matrices[names.index(path.stem)]
            bundle = outputs.cameras.generate_rays(camera_indices=index)
            directions = bundle.directions.numpy().astype(np.float64)
            expected = rays @ matrix[:3, :3].T
            radians = max(radians, angle(directions, expected)[seen].max())
            np.testing.assert_allclose(
                bundle.origins.numpy(), np.broadcast_to(matrix[:3, 3], rays.shape), atol=1e-6
            )
            depth = cv2.imread(str(outputs.metadata["depth_filenames"][index]), cv2.IMREAD_ANYDEPTH)
            reach = depth * outputs.metadata["depth_unit_scale_factor"]
            # Scale as nerfstudio's datasets do: depth is along the axis, so rays are longer than 1.
            reach = reach * bundle.metadata["directions_norm"].numpy()[..., 0]
            world = matrix[:3, 3] + directions * reach[..., None]
            has_depth = depth > 0
            metres = max(metres, np.abs(np.linalg.norm(world, axis=-1) - RADIUS)[has_depth].max())
            if outputs.mask_filenames:
                mask = cv2.imread(str(outputs.mask_filenames[index]), cv2.IMREAD_GRAYSCALE)
                assert ((mask > 0) == has_depth).all()
    counts = [len(outputs.image_filenames) for outputs in parts]
    print(
        f"nerfstudio, {name}: {counts} views; rays within {radians:.2g} rad, "
        f"depth within {1000 * metres:.2g} mm"
    )
    assert radians < 1e-5
    assert metres < 2e-3


def ncore_frame(camera, index, matrix, seen, model, points):
    """Check a frame of an NCore camera. Return its colours' largest error, in levels of 255.

    ``matrix`` (4, 4) is the view's camera-to-world, and ``seen`` (h, w) says which pixels have a
    ray. The ``points`` (n, 3) have the colours that the views show.
    """
    from ncore.data import FrameTimepoint

    for moment in (FrameTimepoint.START, FrameTimepoint.END):
        pose = camera.get_frames_T_source_target(
            camera.sensor_id, "world", np.array(index), moment
        ).reshape(4, 4)
        np.testing.assert_allclose(pose @ np.diag([1, -1, -1, 1]), matrix, atol=1e-6)
    picture = camera.get_frame_image_array(index)
    mask = np.ones(seen.shape, bool)
    if camera.has_frame_generic_data(index, "mask"):
        mask = camera.get_frame_generic_data(index, "mask") > 0
    assert (mask == seen).all()
    toward = (points - pose[:3, 3]) @ pose[:3, :3]
    shown = model.camera_rays_to_image_points(toward.astype(np.float32))
    valid = shown.valid_flag.numpy()
    x, y = np.floor(shown.image_points.numpy()[valid]).astype(int).T
    colours = 40 + 175 * (points[valid] / RADIUS / 2 + 0.5)
    inside = mask[y, x]
    assert inside.sum() > 1000
    return np.abs(picture[y, x] - colours)[inside].max()


def ncore(folder, name):
    """Check an NCore sequence through its loader, its pose graph and its camera class."""
    import torch
    from ncore.data.v4 import SequenceComponentGroupsReader, SequenceLoaderV4
    from ncore.sensors import CameraModel

    reader = SequenceComponentGroupsReader([folder / "ncore" / name / "views.json"])
    assert (
        reader.get_sequence_meta().component_stores[0].md5
        == json.loads((folder / "ncore" / name / "views.json").read_text())["component_stores"][0][
            "md5"
        ]
    )
    loader = SequenceLoaderV4(reader)
    names, matrices, rays = ours(folder, name)
    (camera,) = map(loader.get_camera_sensor, loader.camera_ids)
    model = CameraModel.from_parameters(camera.model_parameters, device="cpu", dtype=torch.float32)
    seen = np.isfinite(rays[..., 0])
    row, column = np.nonzero(seen)
    local = rays[seen] * [1, -1, -1]
    centres = np.column_stack([column, row]) + 0.5
    projected = model.camera_rays_to_image_points(local)
    assert projected.valid_flag.all()
    pixels = np.abs(projected.image_points.numpy() - centres).max()
    back = model.pixels_to_camera_rays(np.column_stack([column, row])).numpy()
    radians = angle(back.astype(np.float64), local).max()
    (lidar,) = map(loader.get_lidar_sensor, loader.lidar_ids)
    cloud = lidar.get_frame_point_cloud(0, motion_compensation=True, with_start_points=True)
    points = cloud.xyz_m_end.astype(np.float64)
    metres = np.abs(np.linalg.norm(points, axis=1) - RADIUS).max()
    # gsplat's newer reader takes points from here, and their colours.
    source = loader.get_point_clouds_source(lidar.sensor_id)
    cloud = source.get_pc(0).transform("world", 0, loader.pose_graph)
    np.testing.assert_allclose(cloud.xyz, points, atol=1e-6)
    assert source.get_pc_generic_data(0, "rgb").shape == points.shape
    assert (np.diff(camera.frames_timestamps_us[:, 1].astype(int)) > 0).all()
    levels = 0.0
    for index in range(camera.frames_count):
        matrix = matrices[names.index(camera.get_frame_generic_meta_data(index)["name"])]
        levels = max(levels, ncore_frame(camera, index, matrix, seen, model, points))
    print(
        f"NCore, {name}, {type(model).__name__}: {camera.frames_count} views, rays up to "
        f"{np.degrees(np.arccos(local[:, 2]).max()):.1f} degrees from the axis within {pixels:.2g} "
        f"pixels, and back within {radians:.2g} rad; {len(points)} points within "
        f"{1000 * metres:.2g} mm, their colours within {levels:.1f} levels"
    )
    assert pixels < 1e-3
    assert radians < 1e-5
    assert metres < 1e-2
    assert levels < 10


def moving(folder):
    """Check the rays of a moving camera that NCore's camera gives at each row's time."""
    import torch
    from ncore.data import FrameTimepoint
    from ncore.data.v4 import SequenceComponentGroupsReader, SequenceLoaderV4
    from ncore.sensors import CameraModel

    saved = np.load(folder / "views.npz")
    loader = SequenceLoaderV4(SequenceComponentGroupsReader([folder / "ncore" / "views.json"]))
    (camera,) = map(loader.get_camera_sensor, loader.camera_ids)
    model = CameraModel.from_parameters(camera.model_parameters, device="cpu", dtype=torch.float32)
    row, column = np.nonzero(np.isfinite(saved["rays"][..., 0]))
    height = len(saved["rays"])
    # Blender's rows see light one after the other. Without a rolling shutter, the middle counts.
    times = np.zeros(len(row))
    if "rolling" in saved:
        times = ((row + 1) / height - 0.5) * (1 - saved["rolling"])
    turns = [cv2.Rodrigues(np.radians(saved["turn"]) * time)[0] for time in times]
    rays = saved["rays"][row, column]
    local = np.einsum("nij,nj->ni", turns, rays)
    radians = metres = 0.0
    names = saved["names"].tolist()
    for index in range(camera.frames_count):
        name = camera.get_frame_generic_meta_data(index)["name"]
        matrix = saved["matrices"][names.index(name)]
        start, end = (
            camera.get_frames_T_source_target(
                camera.sensor_id, "world", np.array(index), moment
            ).reshape(4, 4)
            for moment in (FrameTimepoint.START, FrameTimepoint.END)
        )
        world = model.pixels_to_world_rays_shutter_pose(
            np.column_stack([column, row]), start.astype(np.float32), end.astype(np.float32)
        ).world_rays.numpy()
        radians = max(radians, angle(world[:, 3:].astype(float), local @ matrix[:3, :3].T).max())
        places = matrix[:3, 3] + times[:, None] * (matrix[:3, :3] @ saved["travel"])
        metres = max(metres, np.abs(world[:, :3] - places).max())
    print(
        f"NCore, {folder.name}, {model.shutter_type.name}: rays of each row's time within "
        f"{radians:.2g} rad and {1000 * metres:.2g} mm"
    )
    assert ("rolling" in saved) == (model.shutter_type.name == "ROLLING_TOP_TO_BOTTOM")
    assert radians < 1e-5
    assert metres < 1e-5


def opencv(folder, name):
    transforms = folder / "nerfstudio" / name / "transforms.json"
    if transforms.exists():
        lens = json.loads(transforms.read_text())
        values = [lens["fl_x"], lens["fl_y"], lens["cx"], lens["cy"]]
        distortion = [lens[f"k{number}"] for number in range(1, 5)]
    else:
        import pycolmap

        model = pycolmap.Reconstruction(folder / "colmap" / name / "sparse" / "0")
        (camera,) = model.cameras.values()
        values, distortion = camera.params[:4], camera.params[4:]
    fx, fy, cx, cy = values
    rays = ours(folder, name)[2]
    # cv2.fisheye undistorts no rays beyond 90 degrees, and projects none behind the camera.
    local = rays[rays[..., 2] < -0.05] * [1, -1, -1]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    projected = cv2.fisheye.projectPoints(
        local[:, None], np.zeros(3), np.zeros(3), matrix, np.array(distortion)
    )[0][:, 0]
    row, column = np.nonzero(rays[..., 2] < -0.05)
    pixels = np.abs(projected - np.column_stack([column, row]) - 0.5).max()
    print(f"OpenCV {cv2.__version__}, {name}: {len(local)} rays within {pixels:.2g} pixels")
    assert pixels < 1e-3


def main():
    folder = Path(sys.argv[1])
    published.check(folder / "publish" / "sphere")
    for check in (nerfstudio, ncore):
        for path in sorted((folder / check.__name__).iterdir()):
            check(folder, path.name)
    for path in sorted((folder / "moving").iterdir()):
        moving(path)
    for path in sorted((folder / "lichtfeld").iterdir()):
        lichtfeld.check(path, *ours(folder, path.name))
    sequences.check(folder / "sequence")
    for name in ("fisheye", "opencv"):
        opencv(folder, name)
    each.check(folder / "each")
    learning.check(nerfstudio_parser(folder / "learn" / "export"))


if __name__ == "__main__":
    main()
