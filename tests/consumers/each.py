"""Reads every export of the same views, and compares the places of their pixels with the truth.

A consumer's own package reads an export if there is one. Else a reader stands here, typed from the
consumer's source. Prints a table: the export, who reads it, what was run, and the largest error of
points in millimetres. Pixels with depth are lifted. Without depth, a pixel's point is where its ray
meets the sphere around the origin. Clouds are compared with that sphere. A focal stack
and a quilt have no such points: the tests compare their pixels.
"""

import configparser
import csv
import json
from importlib.metadata import version

import cv2
import numpy as np
import yaml
from scipy.spatial.transform import Rotation

RADIUS = 3.0
MOVES = np.array([0.05, -0.02, 0.03])
# From OpenCV's axes of a camera (x right, y down, z forward) to Blender's.
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
# The part of a view whose pixels show a place, at least.
MOST = 0.75


def hit(matrix, directions):
    """Return where rays (h, w, 3) of a camera at ``matrix`` (4, 4) meet the sphere."""
    rays = directions / np.linalg.norm(directions, axis=-1, keepdims=True) @ matrix[:3, :3].T
    along = rays @ matrix[:3, 3]
    distance = -along + np.sqrt(along**2 + RADIUS**2 - matrix[:3, 3] @ matrix[:3, 3])
    return matrix[:3, 3], matrix[:3, 3] + rays * distance[..., None]


def lift(matrix, directions, z):
    """Return where pixels with depth (h, w) are. ``directions`` reach one metre along the axis."""
    known = np.where((z > 0) & np.isfinite(z), z, np.nan)
    return matrix[:3, 3], directions * known[..., None] @ matrix[:3, :3].T + matrix[:3, 3]


def pinhole(width, height, fx, fy, cx, cy):
    """Return directions (h, w, 3) with x right, y down, z 1. The first pixel's centre is 0.5."""
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones_like(rows)], axis=-1)


def exr(path):
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


# ---- read by nerfstudio ---------------------------------------------------------------------


def of_parser(config, parts=("train", "test"), turn=None):
    """Yield the points of the cameras of one of nerfstudio's parsers."""
    turn = np.eye(4) if turn is None else turn
    parser = config.setup()
    for part in parts:
        outputs = parser.get_dataparser_outputs(part)
        for index in range(len(outputs.cameras)):
            bundle = outputs.cameras.generate_rays(camera_indices=index)
            matrix = np.eye(4)
            matrix[:3, 3] = turn[:3, :3] @ bundle.origins[0, 0].numpy().astype(float)
            directions = bundle.directions.numpy().astype(float) @ turn[:3, :3].T
            if "depth_filenames" not in outputs.metadata:
                yield hit(matrix, directions)
                continue
            depth = cv2.imread(str(outputs.metadata["depth_filenames"][index]), -1)
            z = depth * outputs.metadata["depth_unit_scale_factor"]
            yield lift(matrix, directions * bundle.metadata["directions_norm"].numpy(), z)


def nerfstudio(folder):
    from nerfstudio.data.dataparsers.nerfstudio_dataparser import NerfstudioDataParserConfig

    options = {"orientation_method": "none", "center_method": "none", "auto_scale_poses": False}
    options |= {"downscale_factor": 1, "load_3D_points": False}
    return of_parser(NerfstudioDataParserConfig(data=folder, **options))


def nerf_synthetic(folder):
    from nerfstudio.data.dataparsers.blender_dataparser import BlenderDataParserConfig

    return of_parser(BlenderDataParserConfig(data=folder))


def dnerf(folder):
    from nerfstudio.data.dataparsers.dnerf_dataparser import DNeRFDataParserConfig

    return of_parser(DNeRFDataParserConfig(data=folder))


def instant_ngp(folder):
    from nerfstudio.data.dataparsers.instant_ngp_dataparser import InstantNGPDataParserConfig

    # instant-ngp's (x, y, z) is (−y, x, z) here.
    turn = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    views = folder.parent / "dataset"
    config = InstantNGPDataParserConfig(data=views, scene_scale=1.0, eval_mode="all")
    return of_parser(config, ("train",), turn)


# ---- read by pycolmap -----------------------------------------------------------------------


def of_model(folder, depth_maps=None):
    """Yield the points of the images of a COLMAP model."""
    import pycolmap

    model = pycolmap.Reconstruction(folder)
    for image in model.images.values():
        camera = model.cameras[image.camera_id]
        columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        centres = np.column_stack([columns.ravel(), rows.ravel()])
        if camera.model.name == "PINHOLE":
            flat = camera.cam_from_img(centres)
            rays = np.column_stack([flat, np.ones(len(flat))])
        else:
            rays = np.array([camera.cam_ray_from_img(centre) for centre in centres], float)
            rays = rays.reshape(-1, 3)
        rays = rays.reshape(camera.height, camera.width, 3)
        matrix = np.eye(4)
        matrix[:3] = image.cam_from_world().inverse().matrix()
        if depth_maps is None:
            yield hit(matrix, rays)
            continue
        depth = pycolmap.DepthMap()
        depth.read(depth_maps / f"{image.name}.geometric.bin")
        yield lift(matrix, rays, depth.to_array())


def colmap(folder):
    return of_model(folder / "sparse/0", folder / "stereo/depth_maps")


def colmap_frames(folder):
    for frame in sorted(folder.glob("colmap_*")):
        yield from of_model(frame / "sparse/0")


def multipleview(folder):
    return of_model(folder / "sparse_")


def scannetpp(folder):
    return of_model(folder / "colmap")


# ---- read by other packages -----------------------------------------------------------------


def nerfbaselines(folder):
    from nerfbaselines.datasets import load_dataset

    for split in ("train", "test"):
        cameras = load_dataset(folder, split, load_features=False)["cameras"]
        for pose, values, size in zip(
            cameras.poses, cameras.intrinsics, cameras.image_sizes, strict=True
        ):
            yield hit(np.vstack([pose, [0, 0, 0, 1]]).astype(float), pinhole(*size, *values))


def ncore(folder):
    """Yield the points of the first frame of each of NCore's cameras, or of all of a single one."""
    import torch
    from ncore.data import FrameTimepoint
    from ncore.data.v4 import SequenceComponentGroupsReader, SequenceLoaderV4
    from ncore.sensors import CameraModel

    loader = SequenceLoaderV4(SequenceComponentGroupsReader([folder / "views.json"]))
    cameras = [loader.get_camera_sensor(name) for name in loader.camera_ids]
    for camera in cameras:
        parameters = camera.model_parameters
        model = CameraModel.from_parameters(parameters, device="cpu", dtype=torch.float32)
        width, height = (int(side) for side in model.resolution)
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        rays = model.pixels_to_camera_rays(np.column_stack([columns.ravel(), rows.ravel()]))
        directions = rays.numpy().astype(float).reshape(height, width, 3)
        for index in range(camera.frames_count if len(cameras) == 1 else 1):
            matrix = camera.get_frames_T_source_target(
                camera.sensor_id, "world", np.array(index), FrameTimepoint.END
            )
            yield hit(matrix.reshape(4, 4), directions)


def coco(folder):
    """Yield nothing, but check the boxes and the masks of both objects in each image."""
    from pycocotools.coco import COCO

    lists = COCO(folder / "instances.json")
    saved = np.load(folder.parent / "views.npz")
    for image in lists.loadImgs(lists.getImgIds()):
        name = image["file_name"].split("/")[-1].partition(".")[0]
        height = saved["points"][saved["names"].tolist().index(name)][..., 2]
        for annotation in lists.loadAnns(lists.getAnnIds(image["id"])):
            (category,) = lists.loadCats(annotation["category_id"])
            shown = (height > 0) == (category["name"] == "Upper")
            mask = lists.annToMask(annotation) > 0
            assert (mask == shown).all()
            assert annotation["area"] == shown.sum()
            rows, columns = np.nonzero(shown)
            sides = [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
            assert annotation["bbox"] == sides
    yield from ()


def point_cloud(folder):
    import trimesh

    yield None, np.asarray(trimesh.load(folder / "points.ply").vertices)


def splat(folder):
    from plyfile import PlyData

    vertices = PlyData.read(folder / "splat.ply")["vertex"]
    # As gaussian-splatting's load_ply, which asserts the number of f_rest.
    names = {each.name for each in vertices.properties}
    rest = [name for name in names if name.startswith("f_rest_")]
    assert len(rest) in (0, 9, 24, 45)
    wanted = [f"scale_{axis}" for axis in range(3)] + [f"rot_{axis}" for axis in range(4)]
    assert {"opacity", *wanted, *(f"f_dc_{channel}" for channel in range(3))} <= names
    yield None, np.stack([vertices[axis] for axis in "xyz"], axis=-1)


# ---- typed from the source of a consumer without a package ----------------------------------


def wai(folder):
    content = json.loads((folder / "scene_meta.json").read_text())
    for frame in content["frames"]:
        values = [frame[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")]
        rays = pinhole(*values) - [0.5 / frame["fl_x"], 0.5 / frame["fl_y"], 0]
        yield lift(np.array(frame["transform_matrix"]), rays, exr(folder / frame["depth"])["Y"])


def dust3r(folder):
    data = np.load(folder / "waymo_pairs.npz")
    for name in data["frames"]:
        place = folder / data["scenes"][0] / str(name)
        camera = np.load(place.with_suffix(".npz"))
        z = exr(place.with_suffix(".exr"))["Y"]
        (fx, _, cx), (_, fy, cy), _ = camera["intrinsics"]
        yield lift(camera["cam2world"], pinhole(*z.shape[::-1], fx, fy, cx + 0.5, cy + 0.5), z)


def hci(folder):
    config = configparser.ConfigParser()
    config.read(folder / "parameters.cfg")
    value = {key: text for section in config.values() for key, text in section.items()}
    width, height = (int(value[f"image_resolution_{axis}_px"]) for axis in "xy")
    focal = float(value["focal_length_mm"]) / float(value["sensor_size_mm"]) * max(width, height)
    middle = np.eye(4)
    angles = [float(value[f"center_cam_r{axis}_rad"]) for axis in "xyz"]
    middle[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    middle[:3, 3] = [float(value[f"center_cam_{axis}_m"]) for axis in "xyz"]
    across, down = (int(value[f"num_cams_{axis}"]) for axis in "xy")
    for index in range(across * down):
        matrix = middle @ FLIP
        steps = np.array([index % across - across // 2, index // across - down // 2, 0])
        matrix[:3, 3] += float(value["baseline_mm"]) / 1000 * matrix[:3, :3] @ steps
        # OpenCV turns the rows of a PFM, the lowest of which comes first.
        z = cv2.imread(str(folder / f"gt_depth_lowres_Cam{index:03}.pfm"), -1)
        yield lift(matrix, pinhole(width, height, focal, focal, width / 2, height / 2), z)


def of_disparity(camera, levels, matrix):
    """Return the points of a camera of OpenDIBR or MIV, whose depth is normalised disparity."""
    near, far = camera["Depth_range"]
    disparity = levels / 65535 * (1 / near - 1 / far) + 1 / far
    rays = pinhole(*camera["Resolution"], *camera["Focal"], *camera["Principle_point"])
    return lift(matrix, rays, np.where(levels > 0, 1 / disparity, np.nan))


def opendibr(folder):
    """Yield the points of OpenDIBR's views. Of videos, only rays: OpenCV reads no 12 bits."""
    world = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    for camera in json.loads((folder / "cameras.json").read_text())["cameras"][1:]:
        matrix = np.eye(4)
        turn = Rotation.from_euler("xyz", camera["Rotation"], degrees=True).as_matrix()
        matrix[:3, :3] = world @ turn
        matrix[:3, 3] = world @ camera["Position"]
        if camera["NameDepth"].endswith(".mp4"):
            rays = pinhole(*camera["Resolution"], *camera["Focal"], *camera["Principle_point"])
            yield hit(matrix @ FLIP, rays)
            continue
        yield of_disparity(camera, cv2.imread(str(folder / camera["NameDepth"]), -1), matrix @ FLIP)


def miv(folder):
    """Yield the points of TMIV's views: of the first frame by view, of later ones as clouds."""
    # Columns: the axes of OpenCV's camera in OMAF's, x forward, y left and z up.
    axes = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    content = json.loads((folder / "sequence.json").read_text())
    for camera in content["cameras"]:
        matrix = np.eye(4)
        turn = Rotation.from_euler("ZYX", camera["Rotation"], degrees=True)
        matrix[:3, :3] = turn.as_matrix() @ axes
        matrix[:3, 3] = camera["Position"]
        width, height = camera["Resolution"]
        path = folder / f"{camera['Name']}_depth_{width}x{height}_yuv420p16le.yuv"
        frames = np.fromfile(path, "<u2").reshape(content["Frames_number"], -1)
        for number, frame in enumerate(frames):
            levels = frame[: width * height].reshape(height, width).astype(float)
            position, points = of_disparity(camera, levels, matrix)
            yield (None, points - number * MOVES) if number else (position, points)


def epipolar_volumes(folder):
    saved = np.load(folder.parent / "views.npz")
    names = saved["names"].tolist()
    # An array of views has no lens.
    directions = saved["rays"] / -saved["rays"][..., 2:]
    for volume in json.loads((folder / "epipolar_volumes.json").read_text())["volumes"]:
        depths = np.load(folder / volume["depth"])
        for place in np.ndindex(depths.shape[:2]):
            name, position = (np.array(volume[key])[place] for key in ("views", "positions"))
            matrix = saved["matrices"][names.index(name)]
            np.testing.assert_allclose(position, matrix[:3, 3], atol=1e-9)
            yield lift(matrix, directions, depths[place])


def lichtfeld_views(folder):
    import lichtfeld

    content = json.loads((folder / "transforms.json").read_text())
    for frame in content["frames"]:
        matrix = np.array(frame["transform_matrix"])
        yield hit(matrix @ FLIP, lichtfeld.rays_of(content))


def poses_csv(folder):
    saved = np.load(folder.parent / "views.npz")
    with (folder / "poses.csv").open() as file:
        for row in csv.DictReader(file):
            matrix = np.eye(4)
            angles = [float(row[f"r{axis}"]) for axis in "xyz"]
            matrix[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
            matrix[:3, 3] = [float(row[axis]) for axis in "xyz"]
            # A table of poses has no lens.
            yield hit(matrix, saved["rays"])


def kalibr(folder):
    (camera,) = yaml.safe_load((folder / "camchain.yaml").read_text()).values()
    assert (camera["camera_model"], camera["distortion_model"]) == ("pinhole", "radtan")
    fx, fy, cx, cy = camera["intrinsics"]
    rays = pinhole(*camera["resolution"], fx, fy, cx + 0.5, cy + 0.5)
    assert not any(camera["distortion_coeffs"])
    # A calibration of one camera has no pose.
    for matrix in np.load(folder.parent / "views.npz")["matrices"]:
        yield hit(matrix @ FLIP, rays)


def neural_3d_video(folder):
    """Read poses_bounds.npy as LLFF's loader does: columns are down, right, back."""
    for row in np.load(folder / "poses_bounds.npy"):
        down, right, back, position, (height, width, focal) = row[:15].reshape(3, 5).T
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, down, -back, position], axis=-1)
        size = (int(width), int(height))
        yield hit(matrix, pinhole(*size, focal, focal, width / 2, height / 2))


def scene_flow(folder):
    """Yield the places of the pixels, moved by the flow and back by the true movement."""
    saved = np.load(folder.parent / "views.npz")
    for name, matrix, points in zip(
        saved["names"], saved["matrices"], saved["points"], strict=True
    ):
        channels = exr(folder / "f00001" / f"{name}.exr")
        flow = np.stack([channels[axis] for axis in "XYZ"], axis=-1)
        moved = points + np.where(channels["V"][..., None] > 0, flow, np.nan) - MOVES
        yield matrix[:3, 3], moved


# ---- the table ------------------------------------------------------------------------------

NERFSTUDIO, COLMAP, TYPED = "nerfstudio", "pycolmap", ""
# export.py writes these only with ffmpeg.
VIDEOS = ("neural_3d_video", "opendibr_frames")
# Each export: its reader, the package or "" for a typed one, what runs, and the largest error in
# millimetres.
ROWS = [
    ("coco", coco, "pycocotools", "COCO, annToMask: boxes and masks", 0),
    ("colmap", colmap, COLMAP, "Reconstruction, cam_from_img, DepthMap", 0.01),
    ("colmap_frames", colmap_frames, COLMAP, "Reconstruction of each frame, cam_from_img", 0.01),
    ("dnerf", dnerf, NERFSTUDIO, "DNeRF parser, Cameras.generate_rays", 0.01),
    ("dust3r", dust3r, TYPED, "as DUSt3R's datasets/waymo.py: depth lifted", 0.01),
    ("epipolar_volumes", epipolar_volumes, "numpy", "load: depth lifted", 0.01),
    ("hci", hci, TYPED, "as the benchmark's parameters.cfg: depth lifted", 0.01),
    ("instant_ngp", instant_ngp, NERFSTUDIO, "InstantNGP parser, Cameras.generate_rays", 0.01),
    ("kalibr", kalibr, TYPED, "as Kalibr's YAML formats: rays", 0.01),
    ("lichtfeld", lichtfeld_views, TYPED, "as LichtFeld's transforms.cpp: rays", 0.01),
    ("miv", miv, TYPED, "as TMIV's sequence configuration: depth lifted", 0.1),
    ("miv_frames", miv, TYPED, "as TMIV's sequence configuration: depth of each frame lifted", 0.1),
    ("multipleview", multipleview, COLMAP, "Reconstruction, cam_from_img", 0.01),
    ("ncore", ncore, "nvidia-ncore", "SequenceLoaderV4, CameraModel.pixels_to_camera_rays", 0.01),
    (
        "ncore_frames",
        ncore,
        "nvidia-ncore",
        "SequenceLoaderV4, CameraModel.pixels_to_camera_rays",
        0.01,
    ),
    ("nerf_synthetic", nerf_synthetic, NERFSTUDIO, "Blender parser, Cameras.generate_rays", 0.01),
    ("nerfbaselines", nerfbaselines, "nerfbaselines", "load_dataset: cameras", 0.01),
    (
        "nerfstudio",
        nerfstudio,
        NERFSTUDIO,
        "Nerfstudio parser: depth in whole millimetres lifted",
        1,
    ),
    ("neural_3d_video", neural_3d_video, TYPED, "as LLFF's poses_bounds.npy: rays", 0.01),
    ("opendibr", opendibr, TYPED, "as OpenDIBR's ioHelper.h: depth lifted", 0.1),
    ("opendibr_frames", opendibr, TYPED, "as OpenDIBR's ioHelper.h: rays", 0.01),
    ("point_cloud", point_cloud, "trimesh", "load", 0.01),
    ("poses_csv", poses_csv, TYPED, "csv, SciPy's Rotation: rays", 0.01),
    ("scannetpp", scannetpp, COLMAP, "Reconstruction, cam_ray_from_img", 0.01),
    ("scene_flow", scene_flow, "OpenEXR", "File: places moved by the flow", 0.1),
    ("splat", splat, "plyfile", "PlyData, as gaussian-splatting's load_ply", 0.01),
    ("wai", wai, TYPED, "as MapAnything's load_frame: depth lifted", 0.01),
]


def error(reader, folder, name):
    """Return the largest error in metres of the points that a reader yields, and their number."""
    saved = np.load(folder / ("fisheye.npz" if name == "scannetpp" else "views.npz"))
    worst, count = 0.0, 0
    for position, points in reader(folder / name):
        if position is None:
            errors = np.abs(np.linalg.norm(points, axis=-1) - RADIUS)
        else:
            away = np.linalg.norm(saved["matrices"][:, :3, 3] - position, axis=-1)
            assert away.min() < 1e-5
            errors = np.linalg.norm(points - saved["points"][away.argmin()], axis=-1)
            assert np.isfinite(errors).mean() >= MOST
        worst = max(worst, float(np.nanmax(errors)))
        count += int(np.isfinite(errors).sum())
    return worst, count


def check(folder):
    print("| export | read by | what ran | error of points, mm |\n| --- | --- | --- | ---: |")
    for name, reader, package, ran, most in ROWS:
        if name in VIDEOS and not (folder / name).exists():
            continue
        worst, count = error(reader, folder, name)
        by = f"{package} {version(package)}" if package else "typed reader"
        shown = f"{1000 * worst:.1g}" if worst > 1e-9 else "below 1e-6"
        print(f"| `{name}` | {by} | {ran} | {shown if count else '–'} |")
        assert 1000 * worst <= most
        assert count > 1000 or name == "coco"
