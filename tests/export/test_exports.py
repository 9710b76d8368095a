"""Exports of a scene whose points are all known, read back as their consumers read them."""

import configparser
import csv
import json
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import exr_windows
import numpy as np
import OpenEXR
import pycolmap
import pytest
from conftest import SCRIPTS
from oracles.readers import ncore
from oracles.readers.contents import Exported
from oracles.readers.ply import read_vertices
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation
from sphere import (
    BALL,
    BALL_RADIUS,
    CALIBRATED,
    LENSES,
    RADIUS,
    colour_of,
    enlarged,
    look,
    look_at_ball,
    make_transparent,
    write_views,
)

from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.export import disparity
from lightfield.export.points import evenly, one_a_voxel
from lightfield.export.source import SourceDataset
from lightfield.exporters import BESIDE_VIEWS, EXPORTERS, SEQUENCE_EXPORTS, Exports, hci
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses, rigs
from lightfield.geometry.lenses import calibrations
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.products import exports
from lightfield.reading.surface import SeenSurface
from lightfield.stages.exports import ExportViews
from lightfield.validation import files as validation_files

RIG = {"type": "plane", "cameras": [4, 3], "size": 1.2, "center": [0.3, -0.2, 0.1]}
EVEN_PLANE = {"type": "plane", "cameras": [4, 3], "baseline": 0.4}
VIEWS = {"lens": "equidistant", "fov": 180, "resolution": [96, 96]}
THREE_RADIAL = {"coefficients": [-0.2, 0.05, 0.004, -0.003, 0.02]}
OTHERS = {
    "OPENCV": CALIBRATED["OPENCV"],
    "three_radial": CALIBRATED["OPENCV"] | THREE_RADIAL,
    "FULL_OPENCV": CALIBRATED["FULL_OPENCV"],
    "FISHEYE624": CALIBRATED["RAD_TAN_THIN_PRISM_FISHEYE"],
    "f_theta": CALIBRATED["EUCM"]
    | {"lens": "f_theta", "coefficients": [0.02, -0.05, 0.003, 0.001], "focal_length": 10},
}
# It shows rays up to 115° in the image's corners.
TUM_VI = {
    "lens": "kannala_brandt",
    "focal_length": 13.43,
    "coefficients": [0.00348, 0.000715, -0.00205, 0.000203],
    "resolution": [512, 512],
}
WIDE_624 = OTHERS["FISHEYE624"] | {"focal_length": 9}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "dataset"
    write_views(folder, VIEWS, RIG)
    for name, camera in (LENSES | OTHERS).items():
        write_views(folder / name, camera, RIG)
    write_views(folder / "png", LENSES["perspective"], RIG, ".png")
    write_views(folder / "split", LENSES["perspective"], RIG | {"split": "odd"})
    return folder


def exported(dataset, name, source, tmp_path, **options):
    model = EXPORTERS[name]
    settings = TypeAdapter(model).validate_python({"sources": [source], **options})
    suffix = ".png" if source == "png" else ".exr"
    folder = tmp_path / name / source
    views = "" if source == "views" else source
    exports.run(SourceDataset(dataset, views, suffix), settings, folder)
    return folder


def matrices(dataset, source):
    views = LightField.read(dataset / source / "lightfield.json").views
    return {view.name: view.world_from_camera for view in views}


def on_sphere(points, tolerance):
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), RADIUS, rtol=0, atol=tolerance)


def test_each_file_of_an_exporter_is_a_key_of_a_scene_yaml_and_a_format_of_the_program():
    files = {path.stem for path in (SCRIPTS / "lightfield/exporters").glob("*.py")}
    formats = files - {"__init__", "base"}
    assert formats == set(Exports.model_fields)
    assert formats == {*ExportViews.model_fields["format"].json_schema_extra["enum"]}


def nerfstudio_rays(content):
    """Return directions in the camera's frame, as nerfstudio's Cameras.generate_rays does."""
    y, x = np.mgrid[: content["h"], : content["w"]] + 0.5
    x, y = (x - content["cx"]) / content["fl_x"], -(y - content["cy"]) / content["fl_y"]
    if content["camera_model"] in ("OPENCV", "FISHEYE624"):
        # Their rays have length 1 along the axis.
        model, distortion = "RAD_TAN_THIN_PRISM_FISHEYE", content.get("distortion_params")
        if content["camera_model"] == "OPENCV":
            assert not content.get("k4", 0)
            names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
            model, distortion = "FULL_OPENCV", [content.get(name, 0.0) for name in names]
        parameters = [content[key] for key in ("fl_x", "fl_y", "cx", "cy")]
        camera = pycolmap.Camera(
            model=model, width=content["w"], height=content["h"], params=[*parameters, *distortion]
        )
        centres = np.mgrid[: content["h"], : content["w"]][::-1].reshape(2, -1).T + 0.5
        flat = camera.cam_from_img(centres).reshape(*x.shape, 2)
        return np.concatenate([flat, np.ones_like(x)[..., None]], axis=-1) * [1, -1, -1]
    if content["camera_model"] == "OPENCV_FISHEYE":
        assert [content[f"k{i}"] for i in range(1, 5)] == [0, 0, 0, 0]
        theta = np.clip(np.hypot(x, y), 0, math.pi)
        sine = np.sin(theta) / np.hypot(x, y)
        return np.stack([x * sine, y * sine, -np.cos(theta)], axis=-1)
    assert content["camera_model"] == "EQUIRECTANGULAR"
    theta, phi = -math.pi * x, math.pi * (0.5 - y)
    return np.stack(
        [-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)], axis=-1
    )


@pytest.mark.parametrize(
    "source",
    [
        *("perspective", "shifted", "fisheye", "wide", "panorama"),
        *("OPENCV", "three_radial", "FISHEYE624"),
    ],
)
def test_nerfstudio_lifts_its_depth_to_the_scene(dataset, tmp_path, source):
    folder = exported(dataset, "nerfstudio", source, tmp_path, depth=True, points=100)
    content = json.loads((folder / "transforms.json").read_text())
    rays = nerfstudio_rays(content)
    expected = matrices(dataset, source)
    assert len(content["frames"]) == len(expected) == 12
    for frame in content["frames"]:
        matrix = np.array(frame["transform_matrix"])
        np.testing.assert_array_equal(matrix, expected[Path(frame["file_path"]).stem])
        depth = images.read_image(folder / frame["depth_file_path"]).channels["Y"]
        assert depth.dtype == np.uint16
        has_depth = depth > 0
        if "mask_path" in frame:
            mask = images.read_image(folder / frame["mask_path"]).channels["Y"]
            np.testing.assert_array_equal(mask > 0, has_depth)
            assert set(np.unique(mask)) == {0, 255}
        else:
            assert has_depth.all()
        world = rays * (depth / 1000)[..., None] @ matrix[:3, :3].T + matrix[:3, 3]
        on_sphere(world[has_depth], 2e-3)
        picture = images.read_image(folder / frame["file_path"]).channels
        rgb = np.stack([picture[name] for name in "RGB"], axis=-1)
        np.testing.assert_allclose(rgb[has_depth], colour_of(world[has_depth]), atol=1)
    assert ("mask_path" in content["frames"][0]) == (source in ("fisheye", "wide"))
    vertices = read_vertices(folder / content["ply_file_path"])
    on_sphere(np.stack([vertices[name] for name in "xyz"], axis=-1), 1e-5)
    assert np.array_equal(content["applied_transform"], np.eye(4)[:3])


def brush_pixels(content, local):
    """Project points (n, 3), x right, y down and z forward, as Brush does.

    Source: resolve_camera_model in crates/brush-dataset/src/formats/nerfstudio.rs of Brush 1.0.
    """
    fx, fy, cx, cy = (content[key] for key in ("fl_x", "fl_y", "cx", "cy"))
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    still = np.zeros(3)
    model = content.get("camera_model", "PERSPECTIVE")
    if model == "OPENCV_FISHEYE":
        distortion = np.array([content.get(f"k{number}", 0) for number in range(1, 5)])
        points = local[:, None]
        return cv2.fisheye.projectPoints(points, still, still, matrix, distortion)[0][:, 0]
    assert model in ("PERSPECTIVE", "OPENCV"), f"Unsupported nerfstudio camera_model `{model}`"
    distortion = None
    if model == "OPENCV":
        distortion = np.array([content.get(key, 0.0) for key in ("k1", "k2", "p1", "p2")])
    return cv2.projectPoints(local, still, still, matrix, distortion)[0][:, 0]


@pytest.mark.parametrize("source", ["perspective", "shifted", "fisheye", "opencv", "OPENCV"])
def test_brush_reads_the_cameras_of_a_nerfstudio_export(dataset, tmp_path, source):
    folder = exported(dataset, "nerfstudio", source, tmp_path, points=400)
    content = json.loads((folder / "transforms.json").read_text())
    # Brush takes the last .ply for its first splats.
    assert [path.name for path in folder.rglob("*.ply")] == [content["ply_file_path"]]
    vertices = read_vertices(folder / content["ply_file_path"])
    points = np.stack([vertices[name] for name in "xyz"], axis=-1)
    colours = np.stack([vertices[name] for name in ("red", "green", "blue")], axis=-1)
    for frame in content["frames"]:
        camera_from_world = np.linalg.inv(np.array(frame["transform_matrix"]))
        local = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        local *= [1, -1, -1]
        in_front = local[:, 2] > 0.1
        pixels = brush_pixels(content, local[in_front])
        picture = images.read_image(folder / frame["file_path"]).channels
        shown = np.stack([picture[name] for name in "RGB"], axis=-1)
        light = np.full(shown.shape[:2], 255)
        if "mask_path" in frame:
            light = images.read_image(folder / frame["mask_path"]).channels["Y"]
        inside = ((pixels >= 0) & (pixels < [content["w"], content["h"]])).all(axis=1)
        column, row = np.floor(pixels[inside]).astype(int).T
        lit = light[row, column] > 0
        assert lit.sum() > 20
        # A fisheye's pixels are up to 0.3 m wide, and colour changes by 29 levels a metre.
        np.testing.assert_allclose(shown[row, column][lit], colours[in_front][inside][lit], atol=12)
    rays = lenses.from_camera((LENSES | OTHERS)[source]).pixel_rays() * [1, -1, -1]
    row, column = np.nonzero(rays[..., 2] > 0.05)
    projected = brush_pixels(content, rays[row, column])
    np.testing.assert_allclose(projected, np.column_stack([column, row]) + 0.5, atol=1e-4)


def test_splits_have_no_view_in_two_and_follow_the_rig(dataset, tmp_path):
    for source, expected in (("perspective", 2), ("split", 6)):
        folder = exported(dataset, "nerfstudio", source, tmp_path, points=50)
        content = json.loads((folder / "transforms.json").read_text())
        train, test = content["train_filenames"], content["test_filenames"]
        assert content["val_filenames"] == test
        assert len(test) == expected
        assert sorted(train + test) == sorted(f["file_path"] for f in content["frames"])
    assert all(int(Path(name).stem[5:9]) % 2 for name in test)


def test_nerf_synthetic_is_read_with_its_own_formula(dataset, tmp_path):
    folder = exported(dataset, "nerf_synthetic", "perspective", tmp_path)
    names = set()
    for part, count in (("train", 10), ("val", 2), ("test", 2)):
        content = json.loads((folder / f"transforms_{part}.json").read_text())
        assert len(content["frames"]) == count
        focal = 64 / 2 / math.tan(content["camera_angle_x"] / 2)
        for frame in content["frames"]:
            picture = images.read_image(folder / f"{frame['file_path']}.png").channels
            assert (picture["A"] == 255).all()
            names.add(Path(frame["file_path"]).name)
            i, j = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
            matrix = np.array(frame["transform_matrix"])
            rays = np.stack([(i - 32) / focal, -(j - 24) / focal, -np.ones_like(i)], axis=-1)
            rays = rays @ matrix[:3, :3].T
            rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
            along = rays @ matrix[:3, 3]
            reach = -along + np.sqrt(along**2 + RADIUS**2 - matrix[:3, 3] @ matrix[:3, 3])
            rgb = np.stack([picture[name] for name in "RGB"], axis=-1)
            world = matrix[:3, 3] + rays * reach[..., None]
            np.testing.assert_allclose(rgb, colour_of(world), atol=1)
    assert len(names) == 12


def at_depths(*depths):
    """Return what to see for `write_views`: bands of rows from the top, each at one Z."""

    def see(lens, matrix):
        colour, _ = look(lens, matrix)
        z = np.repeat(depths, lens.height // len(depths))[:, None]
        return colour, z / -lens.pixel_rays()[..., 2]

    return see


def test_nerf_synthetic_says_how_many_surfaces_its_readers_do_not_sample(tmp_path, capsys):
    """NeRF's run_nerf.py samples the Z from 2 to 6 of what blender's loader gives."""
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=at_depths(4, 20, 30, 40))
    made = exported(folder, "nerf_synthetic", "views", tmp_path / "metres")
    said = capsys.readouterr().err
    assert f"warning: {made}: 75% of the surfaces are nearer than 2 or farther than 6" in said
    assert "scale: 0.122 leaves 25%" in said
    # A PNG has no depth, but its rendered view does.
    write_views(folder / "png", LENSES["perspective"], RIG, ".png", at_depths(4, 20, 30, 40))
    exported(folder, "nerf_synthetic", "png", tmp_path)
    assert "75% of the surfaces" in capsys.readouterr().err
    # 20, 30 and 40 m become 2.44, 3.66 and 4.88 units, and 4 m becomes 0.49.
    scaled = exported(folder, "nerf_synthetic", "views", tmp_path / "scaled", scale=0.122)
    assert f"{scaled}: 25% of the surfaces are" in capsys.readouterr().err
    for part in ("train", "val", "test"):
        content, small = (
            json.loads((path / f"transforms_{part}.json").read_text()) for path in (made, scaled)
        )
        assert small["camera_angle_x"] == content["camera_angle_x"]
        for frame, small_frame in zip(content["frames"], small["frames"], strict=True):
            assert small_frame["file_path"] == frame["file_path"]
            matrix, small_matrix = (np.array(f["transform_matrix"]) for f in (frame, small_frame))
            np.testing.assert_array_equal(small_matrix[:3, :3], matrix[:3, :3])
            np.testing.assert_allclose(small_matrix[:3, 3], 0.122 * matrix[:3, 3], rtol=1e-15)
    options = [json.loads((path / "export.json").read_text())["options"] for path in (made, scaled)]
    assert options[1] == options[0] | {"scale": 0.122}


@pytest.mark.parametrize("missing", ["lightfield.json", "exr/view_0002f.exr"])
def test_nerf_synthetic_needs_no_rendered_views_for_a_reprojection(dataset, tmp_path, missing):
    shutil.copytree(dataset / "exr", tmp_path / "dataset/exr")
    shutil.copytree(dataset / "png", tmp_path / "dataset/png")
    shutil.copyfile(dataset / "lightfield.json", tmp_path / "dataset/lightfield.json")
    (tmp_path / "dataset" / missing).unlink()
    folder = exported(tmp_path / "dataset", "nerf_synthetic", "png", tmp_path)
    assert len([*folder.glob("*/*.png")]) == 12


def test_nerf_synthetic_does_not_warn_of_surfaces_that_its_readers_sample(tmp_path, capsys):
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG, see=at_depths(2.1, 5.9))
    exported(tmp_path / "dataset", "nerf_synthetic", "views", tmp_path)
    assert "warning" not in capsys.readouterr().err
    exported(tmp_path / "dataset", "nerf_synthetic", "views", tmp_path / "far", scale=10)
    assert "100% of the surfaces" in capsys.readouterr().err


def test_nerfbaselines_finds_its_lists_and_a_mask_of_every_image(dataset, tmp_path):
    """Follows load_colmap_dataset in nerfbaselines' datasets/colmap.py."""
    shutil.copytree(dataset, tmp_path / "dataset")
    path = tmp_path / "dataset" / "split" / "view_0003f.exr"
    image = images.read_image(path)
    depth = image.channels["Z"].copy()
    depth[:5] = np.nan
    images.write_exr(path, image.channels | {"Z": depth}, image.attributes)
    folder = exported(tmp_path / "dataset", "nerfbaselines", "split", tmp_path, points=50)
    info = json.loads((folder / "nb-info.json").read_text())
    assert info == {"loader": "colmap", "id": "plenoforge", "scene": "dataset"}
    model = pycolmap.Reconstruction(folder / "sparse/0")
    names = {image.name for image in model.images.values()}
    train, test = (
        (folder / f"{part}_list.txt").read_text().splitlines() for part in ("train", "test")
    )
    assert sorted(train + test) == sorted(names)
    assert test == [f"view_{number:04d}f.png" for number in range(1, 12, 2)]
    for name in names:
        assert (folder / "images" / name).is_file()
        mask = cv2.imread(str((folder / "masks" / name).with_suffix(".png")), cv2.IMREAD_GRAYSCALE)
        empty = np.zeros((48, 64), bool)
        empty[:5] = name == "view_0003f.png"
        np.testing.assert_array_equal(mask == 0, empty)
    whole = exported(tmp_path / "dataset", "nerfbaselines", "perspective", tmp_path, points=50)
    # With a folder of masks, nerfbaselines would read one for each image.
    assert not (whole / "masks").exists()


def of_disparity(levels, camera, bits):
    near, far = camera["Depth_range"]
    return 1 / (1 / far + levels / (2**bits - 1) * (1 / near - 1 / far))


def test_nerfstudio_says_how_many_depths_are_too_far_for_its_millimetres(tmp_path, capsys):
    """nerfstudio's unit is an option of its parser, so no file can give another."""

    def with_far_half(lens, matrix):
        colour, distance = look(lens, matrix)
        distance[: lens.height // 2] = 200
        distance[:3] = np.inf
        return colour, distance

    for name, see in (("near", look), ("far", with_far_half)):
        write_views(tmp_path / name / "dataset", LENSES["panorama"], RIG, see=see)
        folder = tmp_path / name / "dataset"
        made = exported(folder, "nerfstudio", "views", tmp_path / name, depth=True, points=50)
        said = capsys.readouterr().out
        if name == "near":
            assert "depths are 0" not in said
            continue
        maps = [images.read_image(path).channels["Y"] for path in (made / "depths").iterdir()]
        unknown = np.array(maps) == 0
        lost = unknown.sum() - 3 * 64 * len(maps)
        assert f"note: {made}: {lost} of {unknown.size} depths are 0, unknown" in said
        assert unknown.sum() == 16 * 64 * len(maps)


@pytest.mark.parametrize("name", ["opendibr", "miv"])
def test_disparity_says_how_many_depths_are_moved_to_its_farthest(tmp_path, name, capsys):
    def with_far_half(lens, matrix):
        colour, distance = look(lens, matrix)
        distance[: lens.height // 2] = 2000
        distance[:3] = np.inf
        return colour, distance

    write_views(tmp_path / "dataset", LENSES["panorama"], RIG, see=with_far_half)
    folder = exported(tmp_path / "dataset", name, "views", tmp_path)
    moved, pixels = 12 * 13 * 64, 12 * 32 * 64
    note = f"note: {folder}: {moved} of {pixels} depths are farther than 999.9 m"
    assert note in capsys.readouterr().out


def opengl_points(camera, depth):
    """Return the points of all pixels in OpenGL's world, as OpenDIBR's vertex shader does."""
    width, height = camera["Resolution"]
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    if camera["Projection"] == "Perspective":
        (fx, fy), (cx, cy) = camera["Focal"], camera["Principle_point"]
        x, y, z = (u * width - cx) / fx, (cy - v * height) / fy, -np.ones_like(u)
    elif camera["Projection"] == "Equirectangular":
        across, down = np.radians(camera["Hor_range"]), np.radians(camera["Ver_range"])
        phi, theta = across[1] - np.ptp(across) * u, down[1] - np.ptp(down) * v
        x, y, z = -np.cos(theta) * np.sin(phi), np.sin(theta), -np.cos(theta) * np.cos(phi)
    else:
        assert camera["Projection"] == "Fisheye_Equidistant"
        x, y = 2 * u - 1, 2 * v - 1
        r = np.hypot(x, y)
        theta = r * math.radians(camera["Fov"]) / 2
        x, y, z = np.sin(theta) * x / r, -np.sin(theta) * y / r, -np.cos(theta)
        depth = np.where(r < 1, depth, np.nan)
    turn = Rotation.from_euler("xyz", camera["Rotation"], degrees=True).as_matrix()
    return np.stack([x, y, z], axis=-1) * depth[..., None] @ turn.T + camera["Position"]


@pytest.mark.parametrize(
    "source", ["perspective", "shifted", "fisheye", "wide", "panorama", "left"]
)
def test_opendibr_lifts_its_disparity_to_the_scene(dataset, tmp_path, source):
    folder = exported(dataset, "opendibr", source, tmp_path)
    content = json.loads((folder / "cameras.json").read_text())
    viewport, *views = content["cameras"]
    assert content["Axial_system"] == "OPENGL"
    assert viewport["NameColor"] == "viewport"
    np.testing.assert_allclose(viewport["Position"], [0.3, 0.1, 0.2], atol=1e-9)
    assert len(views) == 12
    for camera in views:
        levels = images.read_image(folder / camera["NameDepth"]).channels["Y"]
        assert (levels.dtype, camera["BitDepthDepth"], camera["BitDepthColor"]) == ("u2", 16, 8)
        points = opengl_points(camera, of_disparity(levels, camera, 16))
        seen = np.isfinite(points[..., 0])
        assert seen.mean() > 0.7
        on_sphere(points[seen], 1e-3)
        ours = points[..., 0], -points[..., 2], points[..., 1]
        picture = images.read_image(folder / camera["NameColor"]).channels
        rgb = np.stack([picture[name] for name in "RGB"], axis=-1)
        expected = colour_of(np.stack(ours, axis=-1))
        np.testing.assert_allclose(rgb[seen], expected[seen], atol=1)


def omaf_points(camera, depth):
    """Return the world points of all pixels, as TMIV unprojects them in OMAF's axes."""
    width, height = camera["Resolution"]
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    if camera["Projection"] == "Perspective":
        (fx, fy), (cx, cy) = camera["Focal"], camera["Principle_point"]
        x, y, z = np.ones_like(u), (cx - u * width) / fx, (cy - v * height) / fy
    else:
        across, down = np.radians(camera["Hor_range"]), np.radians(camera["Ver_range"])
        phi, theta = across[1] - np.ptp(across) * u, down[1] - np.ptp(down) * v
        x, y, z = np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)
    turn = Rotation.from_euler("ZYX", camera["Rotation"], degrees=True).as_matrix()
    return np.stack([x, y, z], axis=-1) @ turn.T * depth[..., None] + camera["Position"]


@pytest.mark.parametrize("source", ["perspective", "shifted", "panorama", "half", "left"])
def test_miv_lifts_its_disparity_to_the_scene(dataset, tmp_path, source):
    folder = exported(dataset, "miv", source, tmp_path)
    content = json.loads((folder / "sequence.json").read_text())
    assert content["sourceCameraNames"] == [camera["Name"] for camera in content["cameras"]]
    for camera in content["cameras"]:
        width, height = camera["Resolution"]
        size = f"{width}x{height}"
        frame = np.fromfile(folder / f"{camera['Name']}_depth_{size}_yuv420p16le.yuv", "<u2")
        assert frame.size == width * height * 3 // 2
        levels = frame[: width * height].reshape(height, width)
        assert (levels > 0).all()
        points = omaf_points(camera, of_disparity(levels, camera, 16))
        on_sphere(points, 1e-3)
        frame = np.fromfile(folder / f"{camera['Name']}_texture_{size}_yuv420p10le.yuv", "<u2")
        luma = frame[: width * height].reshape(height, width)
        expected = colour_of(points) / 255 @ [0.2126, 0.7152, 0.0722]
        np.testing.assert_allclose((luma / 4 - 16) / 219, expected, atol=2e-3)
        red = frame[width * height * 5 // 4 :].reshape(height // 2, width // 2) / 4 - 128
        apart = colour_of(points)[..., 0] / 255 - expected
        apart = apart.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
        np.testing.assert_allclose(red / 224 * 1.5748, apart, atol=3e-3)


def test_miv_has_no_depth_for_empty_pixels_and_the_farthest_for_misses():
    depth = np.array([[1.0, 2.0], [np.inf, np.nan]])
    assert disparity.depth_range(depth) == (1, disparity.FARTHEST)
    assert disparity.levels(depth, (1, 1000), 16, 1).tolist() == [[65535, 32735], [1, 0]]


@pytest.mark.slow
@pytest.mark.parametrize("depths", [[[np.inf, np.inf]], [[2.0, np.inf]], [[5000.0, 3000.0]]])
def test_no_far_limit_is_read_as_infinity(depths):
    # MPEG's Reference View Synthesizer reads 1000 m and more as infinity.
    near, far = disparity.depth_range(np.array(depths))
    assert 0 < near < far < 1000


def test_opendibr_takes_lossless_h265_if_ffmpeg_is_installed(dataset, tmp_path, monkeypatch):
    lens = LightField.read(dataset / "perspective" / "lightfield.json").lens
    settings = EXPORTERS["opendibr"].model_validate({"sources": ["views"], "format": "h265"})
    assert settings.refusal(lens, True) is None
    folder = exported(dataset, "opendibr", "perspective", tmp_path, format="h265")
    camera = json.loads((folder / "cameras.json").read_text())["cameras"][1]
    command = ["ffmpeg", "-v", "error", "-i", folder / camera["NameDepth"], "-f", "rawvideo"]
    raw = subprocess.run([*command, "-"], capture_output=True, check=True).stdout
    levels = np.frombuffer(raw, "<u2")[: 64 * 48].reshape(48, 64)
    assert camera["BitDepthDepth"] == 12
    on_sphere(opengl_points(camera, of_disparity(levels, camera, 12)), 0.01)
    monkeypatch.setenv("PATH", "")
    assert "ffmpeg must be installed" in settings.refusal(lens, True)
    with pytest.raises(UserError, match=r"lightfield.json: .* ffmpeg must be installed"):
        exported(dataset, "opendibr", "perspective", tmp_path, format="h265")


def test_hci_disparity_leads_from_view_to_view(tmp_path):
    rig = {"type": "plane", "cameras": [3, 4], "size": [0.4, 1, 0.6], "rotation": [10, 20, 30]}
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], rig)
    disparity_folder = exported(folder, "hci", "views", tmp_path)
    config = configparser.ConfigParser()
    config.read(disparity_folder / "parameters.cfg")
    extrinsics, intrinsics = config["extrinsics"], config["intrinsics"]
    columns, rows = (extrinsics.getint(f"num_cams_{axis}") for axis in "xy")
    assert (columns, rows) == (3, 4)
    assert extrinsics.getfloat("baseline_mm") == pytest.approx(200)
    focal = intrinsics.getfloat("focal_length_mm") / intrinsics.getfloat("sensor_size_mm") * 64
    center = [extrinsics.getfloat(f"center_cam_{axis}_m") for axis in "xyz"]
    angles = [extrinsics.getfloat(f"center_cam_r{axis}_rad") for axis in "xyz"]
    turn = Rotation.from_euler("xyz", angles).as_matrix()
    disparities = []
    for number in range(12):
        name = f"Cam{number:03}.pfm"
        z = cv2.imread(disparity_folder / f"gt_depth_lowres_{name}", cv2.IMREAD_UNCHANGED)
        disparity = cv2.imread(disparity_folder / f"gt_disp_lowres_{name}", cv2.IMREAD_UNCHANGED)
        np.testing.assert_allclose(disparity, 0.2 * focal / z, rtol=1e-6)
        disparities.append(disparity)
        # Each camera is the middle one, moved right and down by whole baselines.
        right, down = number % columns - columns // 2, number // columns - rows // 2
        y, x = np.mgrid[:48, :64] + 0.5
        local = [(x - 32) / focal * z + 0.2 * right, -(y - 24) / focal * z - 0.2 * down, -z]
        on_sphere(np.stack(local, axis=-1) @ turn.T + center, 1e-5)
    low, high = (config["meta"].getfloat(f"disp_{end}") for end in ("min", "max"))
    assert low == pytest.approx(np.min(disparities))
    assert high == pytest.approx(np.max(disparities))
    pictures = [
        np.stack(
            [
                images.read_image(disparity_folder / f"input_Cam{n:03}.png").channels[c]
                for c in "RGB"
            ],
            -1,
        )
        for n in range(12)
    ]
    # A point moves left in the next camera, and up in the lower one, by its disparity.
    y, x = np.mgrid[10:38, 20:44]
    for number, step, shift in ((4, 1, (1, 0)), (4, 3, (0, 1)), (7, -3, (0, -1))):
        apart = disparities[number][y, x]
        at = [np.float32(x - shift[0] * apart), np.float32(y - shift[1] * apart)]
        moved = cv2.remap(pictures[number + step], *at, cv2.INTER_LINEAR)
        assert np.abs(moved.astype(float) - pictures[number][y, x]).max() <= 1.5
    middle = disparity_folder / "gt_disp_lowres.pfm"
    assert middle.read_bytes() == (disparity_folder / "gt_disp_lowres_Cam007.pfm").read_bytes()
    names = {tuple(np.round(m[:3, 3], 9)): name for name, m in matrices(folder, ".").items()}
    assert names[tuple(np.round(center, 9))] == "view_0007f"


def test_hci_disparity_as_exr_has_the_values_of_the_benchmarks_maps(tmp_path):
    rig = {"type": "plane", "cameras": [3, 2], "baseline": 0.2}
    write_views(tmp_path / "dataset", LENSES["perspective"], rig)
    folder = exported(tmp_path / "dataset", "hci", "views", tmp_path, disparity="exr")
    paths = sorted(folder.glob("*.exr"))
    assert [path.stem for path in paths] == [f"gt_disp_lowres_Cam{n:03}" for n in range(6)]
    for path in paths:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            ((name, channel),) = file.channels().items()
        assert (name, channel.pixels.dtype) == ("Y", np.float32)
        as_pfm = cv2.imread(path.with_suffix(".pfm"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(channel.pixels, as_pfm)


def test_a_plane_with_a_baseline_suits_hci_at_every_number_of_views():
    for name, keys in (("baseline", {"baseline": 0.2}), ("size", {"size": [1.6, 0, 0.8]})):
        rig = rigs.from_settings({"type": "plane", "cameras": [9, 5], **keys})
        lens = lenses.from_camera(LENSES["perspective"])
        grids = [LightField.from_rig(rig.thinned(views), lens) for views in (45, 20, 6)]
        # Only the full rig of a size has equal distances.
        for lightfield in grids if name == "baseline" else grids[:1]:
            assert hci.grid(lightfield)[2] == pytest.approx(0.2)
    with pytest.raises(UserError, match="give the plane a baseline"):
        hci.grid(grids[1])


def test_hci_is_for_regular_grids(dataset, tmp_path):
    with pytest.raises(UserError, match="frames: are not a grid of cameras that look in parallel"):
        exported(dataset, "hci", "perspective", tmp_path)  # Rows are farther apart.


def test_scannetpp_is_a_text_model_beside_fisheyes_with_masks(dataset, tmp_path):
    folder = exported(dataset, "scannetpp", "fisheye", tmp_path, points=200)
    model = pycolmap.Reconstruction(folder / "colmap")
    (camera,) = model.cameras.values()
    assert camera.params[4:].tolist() == [0, 0, 0, 0]
    for image in model.images.values():
        for seen in image.points2D:
            place = model.points3D[seen.point3D_id].xyz
            on_sphere(place, 1e-5)
            np.testing.assert_allclose(image.project_point(place), seen.xy, atol=1e-6)
    lists = json.loads((folder / "train_test_lists.json").read_text())
    assert lists.pop("has_masks") is True
    assert {part: len(names) for part, names in lists.items()} == {"train": 10, "test": 2}
    for name in lists["train"] + lists["test"]:
        path = folder / "image_undistorted_fisheye" / name
        mask = images.read_image(path.with_name(f"{path.stem}_mask.png")).channels["Y"]
        assert set(np.unique(mask)) == {0, 255}
        assert not images.read_image(path).channels["R"][mask == 0].any()


def ncore_matrix(lens):
    (fx, fy), (cx, cy) = lens["focal_length"], lens["principal_point"]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def ncore_pixels(attributes, local):
    """Project directions (n, 3), x right, y down and z forward, as NCore's documentation does."""
    lens = attributes["camera_model_parameters"]
    x, y, z = local.T
    still = np.zeros(3)
    if attributes["camera_model_type"] == "opencv-pinhole":
        k1, k2, *others = lens["radial_coeffs"]
        distortion = np.array([k1, k2, *lens["tangential_coeffs"], *others])
        pixels, _ = cv2.projectPoints(local, still, still, ncore_matrix(lens), distortion)
        return np.where(z[:, None] > 0, pixels[:, 0], np.nan)
    if attributes["camera_model_type"] == "opencv-fisheye":
        angle = np.arctan2(np.hypot(x, y), z)
        pixels = np.full((len(local), 2), np.nan)
        seen = angle < lens["max_angle"]
        pixels[seen] = cv2.fisheye.projectPoints(
            local[seen][:, None], still, still, ncore_matrix(lens), np.array(lens["radial_coeffs"])
        )[0][:, 0]
        return pixels
    assert lens["reference_poly"] == "ANGLE_TO_PIXELDIST"
    angle = np.arctan2(np.hypot(x, y), z)
    radius = np.polynomial.Polynomial(lens["angle_to_pixeldist_poly"])(angle)
    scaled = (radius / np.hypot(x, y))[:, None] * local[:, :2]
    c, d, e = lens["linear_cde"]
    pixels = scaled @ np.array([[c, d], [e, 1]]).T + lens["principal_point"] + 0.5
    return np.where(angle[:, None] <= lens["max_angle"], pixels, np.nan)


@pytest.mark.parametrize(
    "source",
    ["perspective", "shifted", "fisheye", "wide", "opencv", "OPENCV", "FULL_OPENCV", "f_theta"],
)
def test_an_ncore_sequence_shows_its_points_where_the_views_see_them(dataset, tmp_path, source):
    folder = exported(dataset, "ncore", source, tmp_path, points=400)
    sequence = json.loads((folder / "views.json").read_text())
    (entry,) = sequence["component_stores"]
    store = ncore.Store(folder / entry["path"], Exported())
    frame = "lidars/points/frames/0"
    directions = store.array(f"{frame}/ray_bundle/direction").astype(float)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    points = directions * store.array(f"{frame}/ray_bundle_returns/distance_m")[0][:, None]
    assert len(points) == 400
    on_sphere(points, 1e-5)
    np.testing.assert_allclose(store.array(f"{frame}/generic_data/rgb"), colour_of(points), atol=6)
    poses = store.attributes("poses/default/dynamic_poses")["('camera', 'world')"]
    frames = store.attributes("cameras/camera/frames")["frames_timestamps_us"]
    assert [end for _, end in frames] == poses["timestamps_us"] == [10**6 * i for i in range(12)]
    assert sequence["sequence_timestamp_interval_us"] == {"start": 0, "stop": 11 * 10**6 + 1}
    expected = matrices(dataset, source)
    names = []
    for (_, end), pose in zip(frames, np.array(poses["poses"]), strict=True):
        view = f"cameras/camera/frames/{end}"
        names.append(store.attributes(f"{view}/generic_data")["name"])
        np.testing.assert_array_equal(pose @ np.diag([1, -1, -1, 1]), expected[names[-1]])
        png = store.array(f"{view}/image").tobytes()
        (tmp_path / "view.png").write_bytes(png)
        channels = images.read_image(tmp_path / "view.png").channels
        assert set(channels) == {*"RGB"}
        height, width = channels["R"].shape
        mask = np.full((height, width), 255)
        if source in ("fisheye", "wide", "opencv"):
            mask = store.array(f"{view}/generic_data/mask")
            assert set(np.unique(mask)) == {0, 255}
        lens = store.attributes("intrinsics/default/cameras/camera")
        pixels = ncore_pixels(lens, (points - pose[:3, 3]) @ pose[:3, :3])
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= 0) & (pixels < [width, height])).all(axis=1)
        column, row = np.floor(pixels[inside]).astype(int).T
        has_light = mask[row, column] > 0
        seen = np.stack([channels[name] for name in "RGB"], axis=-1)[row, column][has_light]
        assert len(seen) > 50
        np.testing.assert_allclose(seen, colour_of(points[inside][has_light]), atol=6)
    assert names == sorted(expected)


def moving(folder, camera="wide", **motion):
    """Write views of a camera that moves while its shutter is open."""
    write_views(folder, LENSES[camera], RIG | {"cameras": [2, 1]})
    path = folder / "lightfield.json"
    content = LightField.read(path).changed(render={"camera_motion": motion})
    content.with_exposure().write(path)


def ncore_poses(folder):
    """Return each frame's start and end, its exposure, and the poses by their times."""
    store = ncore.Store(folder / "views.ncore4.zarr", Exported())
    poses = store.attributes("poses/default/dynamic_poses")["('camera', 'world')"]
    frames = store.attributes("cameras/camera/frames")["frames_timestamps_us"]
    data = [
        store.attributes(f"cameras/camera/frames/{end}/generic_data")["exposure_us"]
        for _, end in frames
    ]
    flipped = np.array(poses["poses"]) @ np.diag([1, -1, -1, 1])
    return frames, data, dict(zip(poses["timestamps_us"], flipped, strict=True))


MOTION = {"travel": [0.2, 0, 0.1], "turn": [0, 20, 5]}


def test_ncore_shows_a_transparent_view_in_front_of_black(tmp_path):
    """Light that is multiplied by alpha is that in front of black. NCore has no alpha."""
    pictures = []
    for name in ("transparent", "black"):
        folder = tmp_path / name / "dataset"
        write_views(folder, LENSES["perspective"], RIG)
        if name == "transparent":
            make_transparent(folder, 0.25)
        made = exported(folder, "ncore", "views", tmp_path / name, points=50)
        views = sorted(made.glob("**/frames/*/image/0"))
        pictures.append([cv2.imdecode(np.fromfile(view, np.uint8), -1) for view in views])
    assert len(pictures[0]) == 12
    assert np.abs(np.subtract(*np.array(pictures, int))).max() <= 1


def test_an_ncore_frame_of_a_blurred_view_is_the_middle_of_its_exposure(tmp_path):
    moving(tmp_path / "dataset", **MOTION)
    folder = exported(tmp_path / "dataset", "ncore", "views", tmp_path, points=100)
    frames, exposures, poses = ncore_poses(folder)
    for view, (start, end), exposure in zip(
        LightField.read(tmp_path / "dataset/lightfield.json").views, frames, exposures, strict=True
    ):
        assert start == end == sum(exposure) / 2
        np.testing.assert_allclose(poses[start], view.world_from_camera, atol=1e-9)
        for time, pose in zip(exposure, view.exposure, strict=True):
            np.testing.assert_allclose(poses[time], pose, atol=1e-9)


@pytest.mark.parametrize("rolling", [0.01, 0.5])
def test_an_ncore_frame_of_a_rolling_shutter_lasts_from_the_first_row_to_the_last(
    rolling, tmp_path
):
    moving(tmp_path / "dataset", **MOTION, rolling=rolling)
    folder = exported(tmp_path / "dataset", "ncore", "views", tmp_path, points=100)
    frames, exposures, poses = ncore_poses(folder)
    content = LightField.read(tmp_path / "dataset/lightfield.json")
    height = content.lens.height
    store = ncore.Store(folder / "views.ncore4.zarr", Exported())
    lens = store.attributes("intrinsics/default/cameras/camera")["camera_model_parameters"]
    assert lens["shutter_type"] == "ROLLING_TOP_TO_BOTTOM"
    for view, (start, end), (begin, finish) in zip(content.views, frames, exposures, strict=True):
        assert begin < start < end < finish
        # Cycles' row r of H sees light around ½ + ((r + 1) / H − ½)(1 − rolling) of the exposure.
        for time, row in ((start, 0), (end, height - 1)):
            part = 0.5 + ((row + 1) / height - 0.5) * (1 - rolling)
            assert abs((time - begin) / (finish - begin) - part) < 1e-5
            turn = Rotation.from_rotvec(np.radians(MOTION["turn"]) * (part - 0.5)).as_matrix()
            rotation = view.world_from_camera[:3, :3] @ turn
            np.testing.assert_allclose(poses[time][:3, :3], rotation, atol=1e-5)
            travel = view.world_from_camera[:3, :3] @ MOTION["travel"] * (part - 0.5)
            np.testing.assert_allclose(poses[time][:3, 3], view.position + travel, atol=1e-5)


def test_ncore_refuses_resampled_rows_of_a_rolling_shutter(tmp_path):
    moving(tmp_path / "dataset", **MOTION, rolling=0.1)
    moving(tmp_path / "dataset/perspective", "perspective", **MOTION, rolling=0.1)
    with pytest.raises(UserError, match="mixes the rows of a rolling shutter") as error:
        exported(tmp_path / "dataset", "ncore", "perspective", tmp_path)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "ncore").exists()


def test_a_scene_yaml_with_such_an_export_is_refused():
    camera = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
    content = {
        "scene": {"builder": "room"},
        "render": {"samples": 1, "camera_motion": MOTION},
        "rigs": {"one": {"type": "lattice", "cameras": [2, 1, 1], "size": 1, "camera": camera}},
        "reprojections": {"flat": {"camera": camera | {"fov": 90}}},
        "exports": {"ncore": {"sources": ["flat"]}},
    }
    Scene.model_validate(content)
    content["render"]["camera_motion"] = MOTION | {"rolling": 0.5}
    with pytest.raises(ValidationError, match=r"exports\.ncore\.sources: flat mixes the rows"):
        Scene.model_validate(content)
    content["exports"]["ncore"]["sources"] = ["views"]
    Scene.model_validate(content)


def lichtfeld_cameras(content):
    """Return world-to-camera matrices by image, as LichtFeld's transforms.cpp computes them.

    Its cameras look along z with y down. Its world is (x, −y, −z), for cameras and points alike.
    """
    flip = np.diag([1.0, -1, -1, 1])
    return {
        Path(frame["file_path"]): np.linalg.inv(np.array(frame["transform_matrix"]) @ flip) @ flip
        for frame in content["frames"]
    }


def lichtfeld_pixels(content, local):
    """Project points (n, 3), x right, y down and z forward, to pixels (n, 2)."""
    x, y, z = local.T
    if content["camera_model"] == "EQUIRECTANGULAR":
        longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
        turns = np.column_stack([longitude / (2 * math.pi), latitude / math.pi])
        return (turns + 0.5) * [content["w"], content["h"]]
    scale = np.column_stack([x, y]) / z[:, None]
    if content["camera_model"] == "OPENCV_FISHEYE":
        angle = np.arctan2(np.hypot(x, y), z)
        radius = angle + sum(content[f"k{i}"] * angle ** (2 * i + 1) for i in (1, 2, 3))
        scale = np.column_stack([x, y]) * (radius / np.hypot(x, y))[:, None]
    else:
        assert content["camera_model"] == "PINHOLE"
    pixels = scale * [content["fl_x"], content["fl_y"]] + [content["cx"], content["cy"]]
    return np.where(z[:, None] > 0, pixels, np.nan)


THREE_TERMS = LENSES["opencv"] | {"coefficients": [0.02, -0.01, 0.003, 0]}


@pytest.mark.parametrize(
    ("source", "form"),
    [
        ("perspective", "png"),
        ("shifted", "exr"),
        ("fisheye", "png"),
        ("three_terms", "png"),
        ("panorama", "exr"),
    ],
)
def test_lichtfeld_shows_its_points_and_depth_where_they_are(dataset, tmp_path, source, form):
    if source == "three_terms":
        write_views(tmp_path / "dataset", THREE_TERMS, RIG)
        dataset, source = tmp_path / "dataset", "views"
    options = {"points": 400, "format": form, "depth": source != "panorama"}
    folder = exported(dataset, "lichtfeld", source, tmp_path, **options)
    content = json.loads((folder / "transforms.json").read_text())
    vertices = read_vertices(folder / content["ply_file_path"])
    points = np.stack([vertices[name] for name in "xyz"], axis=-1) * np.array([1, -1, -1])
    on_sphere(points, 1e-5)
    world_to_camera = lichtfeld_cameras(content)
    assert len(world_to_camera) == 12
    for path, matrix in world_to_camera.items():
        assert path.suffix == f".{form}"
        channels = images.read_image(folder / path).channels
        picture = np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float64)
        if form == "exr":
            picture = 255 * encode_srgb(picture.astype(np.float32))
        mask = np.full(picture.shape[:2], 255)
        if (folder / "masks" / f"{path.stem}.png").exists():
            mask = images.read_image(folder / "masks" / f"{path.stem}.png").channels["Y"]
        pixels = lichtfeld_pixels(content, points @ matrix[:3, :3].T + matrix[:3, 3])
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= 0) & (pixels < [content["w"], content["h"]])).all(axis=1)
        column, row = np.floor(pixels[inside]).astype(int).T
        has_light = mask[row, column] > 0
        colours = np.stack([vertices[name] for name in ("red", "green", "blue")], axis=-1)
        assert has_light.sum() > 50
        shown = picture[row, column][has_light]
        # The panorama's pixels are up to 0.4 m wide, and colour changes by 29 levels a metre.
        np.testing.assert_allclose(shown, colours[inside][has_light], atol=12)
        if source == "panorama":
            continue
        depth = images.read_image(folder / "depth" / f"{path.stem}.png").channels["Y"]
        assert depth.dtype == np.uint16
        assert depth.max() == 65535
        assert ((depth > 0) == (mask > 0)).all()
        row, column = np.nonzero(depth)
        centres = np.column_stack([column, row]) + 0.5
        # The axis of the fisheye is no pixel's centre.
        steps = depth[row, column].astype(float)
        rays = lenses.from_camera(THREE_TERMS if source == "views" else LENSES[source]).rays(
            *centres.T
        )
        np.testing.assert_allclose(
            lichtfeld_pixels(content, rays * [1, -1, -1]), centres, atol=1e-6
        )
        to_world = np.linalg.inv(matrix)
        reach = steps[:, None] * rays * [1, -1, -1] / -rays[:, 2:] @ to_world[:3, :3].T
        on_sphere(to_world[:3, 3] + lichtfeld_scale(reach, to_world[:3, 3]) * reach, 1e-3)


def test_lichtfeld_gets_the_pixels_that_an_exr_shows(tmp_path):
    """LichtFeld takes all pixels that an EXR stores for its picture, as tinyexr does."""
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG)
    view, other = sorted((tmp_path / "dataset" / "exr").iterdir())[:2]
    shown = OpenEXR.File(str(view)).channels()["RGB"].pixels
    exr_windows.widen(view)
    folder = exported(tmp_path / "dataset", "lichtfeld", "views", tmp_path, points=9, format="exr")
    exported_view = OpenEXR.File(str(folder / "images" / view.name))
    header = exported_view.header()
    for corner in (0, 1):
        assert np.array_equal(header["dataWindow"][corner], header["displayWindow"][corner])
    np.testing.assert_array_equal(exported_view.channels()["RGB"].pixels, shown)
    assert (folder / "images" / other.name).samefile(other)


def lichtfeld_scale(reach, place):
    """Return the metres of a step of depth. The farthest of the points place + reach fits it."""
    farthest = reach[np.argmax(np.linalg.norm(reach, axis=1))]
    a, b, c = farthest @ farthest, farthest @ place, place @ place - RADIUS**2
    return (-b + math.sqrt(b * b - a * c)) / a


def write_normals(dataset):
    """Write the pass normal of views that see the sphere from within. Return them by view."""
    lightfield = LightField.read(dataset / "lightfield.json")
    rays = lightfield.lens.pixel_rays()
    true_normals = {}
    for view in lightfield.views:
        distance = look(lightfield.lens, view.world_from_camera)[1][..., None]
        places = view.world_from_camera[:3, 3] + rays @ view.world_from_camera[:3, :3].T * distance
        true_normals[view.name] = np.nan_to_num(-places / RADIUS)
        planes = np.moveaxis(true_normals[view.name].astype(np.float32), -1, 0)
        path = dataset / "normal" / f"{view.name}.exr"
        path.parent.mkdir(exist_ok=True)
        images.write_exr(path, dict(zip("RGB", planes, strict=True)))
    lightfield.changed(passes=["normal"]).write(lightfield.path)
    return true_normals


def test_lichtfeld_has_normals_in_the_axes_of_its_cameras(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, LENSES["fisheye"], RIG | {"rotation": [10, 20, 30]})
    with pytest.raises(UserError, match=r"normal/view_0000f.exr: is missing; normals need passes"):
        exported(dataset, "lichtfeld", "views", tmp_path, normals=True)
    true_normals = write_normals(dataset)
    rays = LightField.read(dataset / "lightfield.json").lens.pixel_rays()
    folder = exported(dataset, "lichtfeld", "views", tmp_path, normals=True)
    content = json.loads((folder / "transforms.json").read_text())
    for path, matrix in lichtfeld_cameras(content).items():
        channels = images.read_image(folder / "normals" / f"{path.stem}.png").channels
        colours = np.stack([channels[name] for name in "RGB"], axis=-1)
        world = (colours / 255 * 2 - 1) @ matrix[:3, :3] * [1, -1, -1]
        np.testing.assert_allclose(world, true_normals[path.stem], atol=0.011)
        assert (colours[~np.isfinite(rays[..., 0])] == 128).all()


def test_dn_splatter_reads_a_nerfstudio_export_s_normals(tmp_path):
    """Its parser pairs sorted images with sorted normals. Its dataset turns them to OpenGL's axes.

    Source: normal_nerfstudio.py, and get_normal_image_from_path of dn_dataset.py, whose comments
    have the two systems the wrong way round. dn_model.py compares with OpenGL's axes.
    """
    dataset = tmp_path / "dataset"
    write_views(dataset, LENSES["perspective"], RIG | {"rotation": [10, 20, 30]})
    true_normals = write_normals(dataset)
    folder = exported(dataset, "nerfstudio", "views", tmp_path, points=50, normals=True)
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    frames.sort(key=lambda frame: frame["file_path"])
    paths = sorted((folder / "normals_from_pretrain").glob("*.png"))
    assert len(paths) == len(frames) == 12
    for frame, path in zip(frames, paths, strict=True):
        channels = images.read_image(path).channels
        colours = np.stack([channels[name] for name in "RGB"], axis=-1)
        in_camera = (colours / 255 * 2 - 1) @ np.diag([1, -1, -1])
        assert (in_camera[..., 2] > 0).all()  # Towards the camera, which looks along −z.
        world = in_camera @ np.array(frame["transform_matrix"])[:3, :3].T
        np.testing.assert_allclose(world, true_normals[path.stem], atol=0.011)


@pytest.mark.parametrize("source", ["fisheye", "panorama", "OPENCV"])
def test_normals_of_lenses_that_dn_splatter_takes_for_pinholes_are_refused(
    dataset, tmp_path, source
):
    with pytest.raises(UserError, match="has normals for dn-splatter, which takes it for a pinh"):
        exported(dataset, "nerfstudio", source, tmp_path, normals=True)


def test_normals_that_dn_splatter_would_mix_up_are_refused(tmp_path):
    folders = {name: tmp_path / name / "dataset" for name in ("a9", "a10", "a11")}
    for folder in folders.values():
        write_views(folder, LENSES["perspective"], RIG)
        write_normals(folder)
    settings = EXPORTERS["nerfstudio"](sources=["views"], normals=True, points=50)
    source = SourceDataset(folders.pop("a11"), "", ".exr", folders)
    with pytest.raises(UserError, match="frames: have names with numbers of different lengths"):
        exports.run(source, settings, tmp_path / "export")
    assert not (tmp_path / "export").exists()
    exports.run(replace(source, beside={"a10": folders["a10"]}), settings, tmp_path / "export")
    assert len(list((tmp_path / "export/normals_from_pretrain").iterdir())) == 24


def write_objects(dataset, source=""):
    """Write a pass of objects: a ball and a cup before a wall. Return their numbers (h, w)."""
    lightfield = LightField.read(dataset / source / "lightfield.json")
    numbers = np.ones((lightfield.lens.height, lightfield.lens.width), np.uint32)
    numbers[10:30, 12:24], numbers[5:8, 40:50], numbers[:4] = 2, 3, 0
    for view in lightfield.views:
        images.write_exr(dataset / source / "object" / f"{view.name}.exr", {"Y": numbers})
    lightfield.changed(passes=["object"]).write(lightfield.path)
    (dataset / "object").mkdir(exist_ok=True)
    (dataset / "object/names.json").write_text('{"Wall": 1, "Ball": 2, "Cup.001": 3, "Sun": 4}')
    return numbers


@pytest.mark.parametrize("source", ["views", "flat"])
def test_nerfstudio_masks_all_but_the_chosen_objects(tmp_path, source):
    dataset = tmp_path / "dataset"
    write_views(dataset, VIEWS, RIG)
    write_views(dataset / "flat", LENSES["perspective"], RIG)
    place = "" if source == "views" else source
    numbers = write_objects(dataset, place)
    options = {"points": 50, "objects": ["Cup.001", "Wall"]}
    folder = exported(dataset, "nerfstudio", source, tmp_path, **options)
    lens = LightField.read(dataset / place / "lightfield.json").lens
    is_seen = np.isfinite(lens.pixel_rays()[..., 0])
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    assert len(frames) == 12
    for frame in frames:
        mask = images.read_image(folder / frame["mask_path"]).channels["Y"]
        expected = is_seen & ((numbers == 1) | (numbers == 3))
        np.testing.assert_array_equal(mask, np.where(expected, 255, 0))


def test_objects_that_no_view_shows_are_refused(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, VIEWS, RIG)
    write_objects(dataset)
    for objects, problem in (
        (["Wall", "Bal"], r"lightfield.json: its pass object has no 'Bal'.*did you mean Ball\?"),
        (["Sun"], "lightfield.json: no view shows any of exports.nerfstudio.objects: Sun"),
    ):
        with pytest.raises(UserError, match=problem):
            exported(dataset, "nerfstudio", "views", tmp_path, objects=objects)
        assert not (tmp_path / "nerfstudio/views").exists()


def test_equal_ncore_sequences_have_equal_bytes(dataset, tmp_path):
    first_export = exported(dataset, "ncore", "wide", tmp_path / "one", points=50)
    second_export = exported(dataset, "ncore", "wide", tmp_path / "two", points=50)
    assert (first_export / "export.json").read_bytes() == (
        second_export / "export.json"
    ).read_bytes()


@pytest.mark.parametrize("beside", ["lightfield.json", "exr/view_0000f.exr"])
def test_the_surface_of_a_dataset_without_its_list_may_be_replaced(beside, tmp_path):
    folder = tmp_path / "mesh"
    folder.mkdir()
    (folder / "objects.json").write_text("{}")
    assert not exports.is_of_dataset(folder, "mesh")
    (tmp_path / beside).parent.mkdir(exist_ok=True)
    (tmp_path / beside).write_text("")
    assert exports.is_of_dataset(folder, "mesh")
    assert not exports.is_of_dataset(tmp_path / "other", "mesh")


def test_an_ncore_sequence_needs_two_views(tmp_path):
    rig = RIG | {"cameras": [1, 1]}
    write_views(tmp_path / "dataset", LENSES["wide"], rig)
    with pytest.raises(UserError, match=r"frames: has one view; NCore needs two or more"):
        exported(tmp_path / "dataset", "ncore", "views", tmp_path)
    assert not (tmp_path / "ncore").exists()


def test_a_point_cloud_has_a_coloured_point_per_voxel_and_normals_to_the_cameras(dataset, tmp_path):
    folder = exported(dataset, "point_cloud", "views", tmp_path, voxel=0.1)
    vertices = read_vertices(folder / "points.ply")
    places = np.stack([vertices[name] for name in "xyz"], axis=-1).astype(float)
    on_sphere(places, 1e-5)
    assert len(np.unique(np.floor(places / 0.1), axis=0)) == len(places) > 2000
    colours = np.stack([vertices[name] for name in ("red", "green", "blue")], axis=-1)
    np.testing.assert_allclose(colours, colour_of(places), atol=1)
    normals = np.stack([vertices[f"n{name}"] for name in "xyz"], axis=-1)
    has_normal = np.linalg.norm(normals, axis=-1) > 0.5
    assert has_normal.mean() > 0.9
    inward = -places[has_normal] / RADIUS
    assert np.degrees(np.arccos((normals[has_normal] * inward).sum(axis=-1).clip(-1, 1))).max() < 5


def wai_camera(frame):
    """Return the intrinsic matrix of a frame, as MapAnything's load_frame gives it."""
    fx, fy, cx, cy = (frame[key] for key in ("fl_x", "fl_y", "cx", "cy"))
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def wai_depth(folder, frame):
    """Return the one channel of a frame's depth. OpenCV's EXR reader takes Y for a plane."""
    (channels,) = (part.channels for part in OpenEXR.File(str(folder / frame["depth"])).parts)
    assert [*channels] == ["Y"]
    return channels["Y"].pixels


def wai_points(folder, frame):
    """Return the world points (h, w, 3) of a frame, as MapAnything lifts them from its depth."""
    depth = wai_depth(folder, frame)
    assert depth.dtype == np.float32
    assert depth.shape == (frame["h"], frame["w"])
    v, u = np.mgrid[: frame["h"], : frame["w"]]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(wai_camera(frame)).T
    matrix = np.array(frame["transform_matrix"])
    points = rays * depth[..., None] @ matrix[:3, :3].T + matrix[:3, 3]
    return np.where(depth[..., None] > 0, points, np.nan)


def wai_shares(folder, content):
    """Return the shares of pixels that views see of each other, as MapAnything reads them."""
    modality = content["scene_modalities"]["pairwise_covisibility"]
    count = len(content["frames"])
    assert modality["format"] == "mmap"
    assert modality["scene_key"].endswith(f"--{count}x{count}.npy")
    path = folder / modality["scene_key"]
    np.testing.assert_array_equal(
        np.load(path), np.fromfile(path, "<f4", offset=128).reshape(count, count)
    )
    return np.load(path)


@pytest.mark.parametrize("source", ["perspective", "shifted"])
def test_wai_lifts_depth_to_points_with_the_colours_of_its_images(dataset, tmp_path, source):
    folder = exported(dataset, "wai", source, tmp_path)
    content = json.loads((folder / "scene_meta.json").read_text())
    assert (content["camera_model"], content["camera_convention"]) == ("PINHOLE", "opencv")
    assert len(content["frames"]) == 12
    for frame in content["frames"]:
        points = wai_points(folder, frame)
        on_sphere(points, 1e-5)
        picture = cv2.imread(str(folder / frame["image"]), cv2.IMREAD_UNCHANGED)[..., ::-1]
        np.testing.assert_allclose(picture, colour_of(points), atol=0.6)


def test_wai_counts_the_pixels_whose_surface_another_view_sees(dataset, tmp_path):
    """Nothing hides the inside of a sphere, so a view sees all of it that is in its frame."""
    folder = exported(dataset, "wai", "shifted", tmp_path)
    content = json.loads((folder / "scene_meta.json").read_text())
    shares = wai_shares(folder, content)
    for row, first in enumerate(content["frames"]):
        points = wai_points(folder, first)
        for column, second in enumerate(content["frames"]):
            local = (points - np.array(second["transform_matrix"])[:3, 3]) @ np.array(
                second["transform_matrix"]
            )[:3, :3]
            pixels = local @ wai_camera(second).T
            with np.errstate(invalid="ignore"):
                pixels = np.rint(pixels[..., :2] / pixels[..., 2:])
            in_frame = (pixels >= 0) & (pixels < [second["w"], second["h"]])
            share = (in_frame.all(axis=-1) & (local[..., 2] > 0)).mean()
            assert shares[row, column] == pytest.approx(share, abs=2e-3)
    assert shares.min() < 0.9


def test_wai_does_not_count_a_surface_that_another_one_hides(tmp_path):
    """A ball hides a part of the sphere from each view."""
    rig = {"type": "plane", "cameras": [3, 1], "size": 1.2}
    camera = enlarged(LENSES["perspective"], 4)
    write_views(tmp_path / "dataset", camera, rig, see=look_at_ball)
    folder = exported(tmp_path / "dataset", "wai", "views", tmp_path)
    content = json.loads((folder / "scene_meta.json").read_text())
    shares = wai_shares(folder, content)
    _, _, right = (np.array(frame["transform_matrix"]) for frame in content["frames"])
    points = wai_points(folder, content["frames"][0])
    local = (points - right[:3, 3]) @ right[:3, :3]
    pixels = local @ wai_camera(content["frames"][2]).T
    pixels = np.rint(pixels[..., :2] / pixels[..., 2:])
    in_frame = ((pixels >= 0) & (pixels < camera["resolution"])).all(axis=-1)
    to_points = points - right[:3, 3]
    along = np.clip(((BALL - right[:3, 3]) * to_points).sum(-1) / (to_points**2).sum(-1), 0, 1)
    nearest = np.linalg.norm(right[:3, 3] + along[..., None] * to_points - BALL, axis=-1)
    hidden = nearest < BALL_RADIUS - 1e-3
    assert (in_frame & hidden).mean() > 0.05
    assert shares[0, 2] == pytest.approx((in_frame & ~hidden).mean(), abs=0.01)


def test_wai_has_masks_of_pixels_that_show_nothing_and_no_depth_there(tmp_path):
    write_views(tmp_path / "dataset", VIEWS, RIG)
    write_views(tmp_path / "dataset/flat", LENSES["perspective"], RIG)
    view = next(iter(sorted((tmp_path / "dataset/flat").glob("*.exr"))))
    image = images.read_image(view)
    channels = {name: plane.copy() for name, plane in image.channels.items()}
    channels["Z"][:5] = np.nan
    images.write_exr(view, channels, image.attributes)
    folder = exported(tmp_path / "dataset", "wai", "flat", tmp_path)
    content = json.loads((folder / "scene_meta.json").read_text())
    (masked,) = (frame for frame in content["frames"] if "mask_path" in frame)
    assert masked["frame_name"] == view.stem
    assert content["frame_modalities"]["mask"] == {"frame_key": "mask_path", "format": "binary"}
    mask = cv2.imread(str(folder / masked["mask_path"]), cv2.IMREAD_UNCHANGED)
    depth = wai_depth(folder, masked)
    assert (mask[:5] == 0).all()
    assert (mask[5:] == 255).all()
    np.testing.assert_array_equal(depth > 0, mask > 0)
    assert wai_shares(folder, content)[0, 0] == pytest.approx(43 / 48)


def test_wai_shows_transparent_views_in_front_of_black(tmp_path):
    write_views(tmp_path / "dataset", LENSES["perspective"], RIG)
    opaque = exported(tmp_path / "dataset", "wai", "views", tmp_path / "opaque")
    make_transparent(tmp_path / "dataset", 0.25)
    folder = exported(tmp_path / "dataset", "wai", "views", tmp_path)
    for path in sorted((opaque / "images").iterdir()):
        # The light is premultiplied already.
        expected = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        shown = cv2.imread(str(folder / "images" / path.name), cv2.IMREAD_UNCHANGED)
        assert shown.shape == (48, 64, 3)
        np.testing.assert_allclose(shown, expected, atol=1)


def test_poses_csv_can_be_read_as_a_rig(dataset, tmp_path):
    folder = exported(dataset, "poses_csv", "perspective", tmp_path)
    with (folder / "poses.csv").open() as file:
        assert next(csv.reader(file)) == ["name", "x", "y", "z", "rx", "ry", "rz"]
    rig = {"type": "poses", "file": str(folder / "poses.csv")}
    again = LightField.from_rig(rig, lenses.from_camera(LENSES["perspective"]))
    for name, matrix in matrices(dataset, "perspective").items():
        same_view = next(view for view in again.views if view.name == name)
        np.testing.assert_allclose(same_view.world_from_camera, matrix, atol=1e-11)
    assert rigs.from_settings(rig).view_count == 12


def test_a_surface_in_front_hides_points_behind_it(dataset, tmp_path):
    shutil.copytree(dataset, tmp_path / "dataset")
    # The first view looks at a near wall, so it sees nothing of the sphere.
    path = tmp_path / "dataset" / "exr" / "view_0000f.exr"
    image = images.read_image(path)
    wall = {**image.channels, "Z": np.full_like(image.channels["Z"], 0.01)}
    images.write_exr(path, wall, {images.DEPTH_ATTRIBUTE: "z"})
    folder = exported(tmp_path / "dataset", "colmap", "perspective", tmp_path)
    model = pycolmap.Reconstruction(folder / "sparse" / "0")
    (blocked,) = (image for image in model.images.values() if image.name == "view_0000f.png")
    # No other view sees the wall, so its points stay.
    assert len(blocked.points2D) > 10
    for seen in blocked.points2D:
        point = model.points3D[seen.point3D_id]
        assert [element.image_id for element in point.track.elements] == [blocked.image_id]
        assert (blocked.cam_from_world() * point.xyz)[2] == pytest.approx(0.01, rel=1e-3)
    assert all(image.num_points3D for image in model.images.values())


def test_equal_exports_have_equal_bytes_and_a_manifest_that_validation_checks(dataset, tmp_path):
    first_export = exported(dataset, "colmap", "fisheye", tmp_path / "one", points=50)
    two = exported(dataset, "colmap", "fisheye", tmp_path / "two", points=50)
    files = json.loads((first_export / "export.json").read_text())["files"]
    assert files == {
        path.relative_to(two).as_posix(): sha256(path)
        for path in two.rglob("*")
        if path.is_file() and path.name != "export.json"
    }
    assert (first_export / "export.json").read_bytes() == (two / "export.json").read_bytes()
    shutil.copytree(dataset, tmp_path / "dataset")
    target = tmp_path / "dataset" / "fisheye" / "exports" / "colmap"
    shutil.copytree(first_export, target)
    sets, _ = validation_files.read_sets(tmp_path / "dataset", ["fisheye"])

    def checked():
        return validation_files.of_exports(tmp_path / "dataset", sets, [])

    exports_check, others, check = checked()
    assert check.passed
    assert {*others, *(file.path for file in exports_check)} >= {
        f"fisheye/exports/colmap/{name}" for name in (*files, "export.json")
    }
    points = target / "sparse" / "0" / "points3D.bin"
    content = bytearray(points.read_bytes())
    content[100] ^= 1
    points.write_bytes(content)
    assert not checked()[2].passed
    points.unlink()
    assert "is not a file of the dataset" in checked()[2].problems[0]
    outside = tmp_path / "outside.txt"
    outside.touch()
    listed = {"files": {"../../../../outside.txt": sha256(outside)}}
    (target / "export.json").write_text(json.dumps(listed))
    assert "outside.txt is not a file of the dataset" in checked()[2].problems[0]


def test_depth_of_views_without_it_is_an_error_that_says_how_to_get_it(dataset):
    source = SourceDataset(dataset, "png", ".png")
    with pytest.raises(
        UserError, match=r"view_0000f.png: has no depth; reproject with format: exr"
    ):
        source.depth(source.lightfield.views[0], "z")


def test_a_fisheye_with_no_pixel_on_its_axis_is_exported_for_nerfstudio():
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": {"LF": EVEN_PLANE | {"camera": VIEWS | {"resolution": [65, 64]}}},
        "exports": {"nerfstudio": {"sources": ["views"]}},
    }
    assert TypeAdapter(Scene).validate_python(content).exports.nerfstudio


def test_a_failed_export_leaves_nothing(dataset, tmp_path):
    shutil.copytree(dataset / "perspective", tmp_path / "perspective")
    source = SourceDataset(tmp_path, "perspective", ".exr")
    last = source.path(source.lightfield.views[-1])
    settings = EXPORTERS["nerf_synthetic"](sources=["perspective"])
    last.unlink()
    for problem in ("no such file", "is 9 × 8, but .* says 64 × 48"):
        with pytest.raises(UserError, match=f"{last.name}: {problem}"):
            exports.run(source, settings, tmp_path / "made")
        assert not (tmp_path / "made").exists()
        images.write_exr(last, dict.fromkeys("RGB", np.zeros((8, 9), np.float32)))


@pytest.mark.parametrize(
    ("name", "source", "camera", "options", "problem"),
    [
        ("colmap", "views", VIEWS, {}, "sees 180 degrees"),
        ("colmap", "views", LENSES["half"], {}, "is a part of a panorama; COLMAP takes whole"),
        ("colmap", "views", LENSES["panorama"], {"depth": True}, "leave out depth: true"),
        (
            "colmap",
            "views",
            {"lens": "equisolid", "focal_length": 10, "fov": 120, "resolution": [64, 64]},
            {},
            "has a lens that COLMAP lacks; reproject",
        ),
        (
            "colmap",
            "again",
            VIEWS,
            {"depth": True},
            "holds no depth; give reprojections.again format: exr",
        ),
        ("nerfstudio", "views", VIEWS | {"resolution": [65, 65]}, {}, "use even sizes"),
        (
            "nerfstudio",
            "views",
            LENSES["panorama"] | {"latitude": [0, 90]},
            {},
            "is a part of a panorama",
        ),
        ("nerfstudio", "views", VIEWS, {"splatfacto": True}, "taken for a pinhole by splatfacto"),
        ("nerfbaselines", "views", LENSES["fisheye"], {}, "nerfbaselines does not find; reproject"),
        ("nerfbaselines", "views", OTHERS["three_radial"], {}, "has k3 to k6"),
        ("nerf_synthetic", "views", VIEWS, {}, "is not a pinhole camera"),
        ("nerf_synthetic", "views", LENSES["shifted"] | {"sensor_size": 36}, {}, "off centre"),
        ("opendibr", "views", VIEWS | {"principal_point": [40, 48]}, {}, "axis off centre"),
        ("opendibr", "again", VIEWS, {}, "holds no depth; give reprojections.again format: exr"),
        ("miv", "views", VIEWS, {}, "a fisheye of 180 degrees with longitude: .-90, 90."),
        ("miv", "views", LENSES["perspective"] | {"resolution": [64, 47]}, {}, "use even sizes"),
        ("hci", "views", VIEWS, {}, "is not a pinhole camera"),
        ("hci", "sensor", LENSES["perspective"], {}, "holds no depth; export the sensor's source"),
        (
            "colmap",
            "sensor",
            LENSES["perspective"],
            {"look": "AgX"},
            "look: is for EXR sources; give look to sensor",
        ),
        ("hci", "again", VIEWS, {}, "holds no depth; give reprojections.again format: exr"),
        ("scannetpp", "views", VIEWS, {}, "sees 180 degrees, but this layout ends below"),
        ("ncore", "views", LENSES["panorama"], {}, "has a lens that NCore lacks"),
        ("lichtfeld", "views", VIEWS | {"fov": 200}, {}, "sees 200 degrees, but LichtFeld's fish"),
        ("lichtfeld", "views", LENSES["half"], {}, "is a part of a panorama"),
        ("lichtfeld", "views", LENSES["panorama"], {"depth": True}, "leave out depth: true"),
        (
            "lichtfeld",
            "again",
            VIEWS,
            {"format": "exr"},
            "is not in EXR; give reprojections.again format: exr",
        ),
        (
            "lichtfeld",
            "again",
            VIEWS,
            {"depth": True},
            "holds no depth; give reprojections.again format: exr",
        ),
        ("lichtfeld", "again", VIEWS, {"normals": True}, "lacks the pass normal; add it to"),
        ("nerfstudio", "again", VIEWS, {"normals": True}, "lacks the pass normal; add it to"),
        ("nerfstudio", "again", VIEWS, {"objects": ["a"]}, "lacks the pass object; add it to"),
        ("wai", "views", VIEWS, {}, "is not perspective, but MapAnything takes only such views"),
        ("wai", "again", VIEWS, {}, "holds no depth; give reprojections.again format: exr"),
        ("poses_csv", "elsewhere", VIEWS, {}, "is 'elsewhere'; must be of views, again"),
    ],
)
def test_yaml_that_a_consumer_cannot_take_is_refused(name, source, camera, options, problem):
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": {"LF": EVEN_PLANE | {"camera": camera}},
        "reprojections": {"again": {"camera": LENSES["perspective"]}},
        "exports": {name: {"sources": [source], **options}},
    }
    if source == "sensor":
        content["sensor"] = {}
    with pytest.raises(ValidationError, match=problem) as caught:
        TypeAdapter(Scene).validate_python(content)
    assert f"exports.{name}." in str(caught.value)


def yaml_without_depth(name, camera, **keys):
    return {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1, "depth": "none", "passes": ["normal", "object", "motion"]},
        "rigs": {"LF": EVEN_PLANE | {"camera": camera} | keys},
        "exports": {name: {"sources": ["views"]}},
    }


@pytest.mark.parametrize(
    "name", [name for name in EXPORTERS if name not in {*SEQUENCE_EXPORTS, *BESIDE_VIEWS}]
)
def test_yaml_refuses_the_exports_that_fail_without_depth(name, tmp_path):
    """An export that works on views without depth is accepted. One that fails is refused."""
    camera = LENSES["fisheye"] if name == "scannetpp" else LENSES["perspective"]
    write_views(tmp_path / "dataset", camera, EVEN_PLANE)
    path = tmp_path / "dataset/lightfield.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"depth": None}))
    content = yaml_without_depth(name, camera)
    try:
        exported(tmp_path / "dataset", name, "views", tmp_path)
    except UserError as error:
        # The sphere's views have no passes.
        if "depth" in str(error):
            with pytest.raises(
                ValidationError, match=r"holds no depth; leave out render\.depth: none"
            ):
                TypeAdapter(Scene).validate_python(content)
            return
    assert TypeAdapter(Scene).validate_python(content).exports.selected


def test_yaml_refuses_points_of_imported_views_without_depth(dataset, tmp_path):
    shutil.copytree(dataset / "exr", tmp_path / "LF/exr")
    content = json.loads((dataset / "lightfield.json").read_text())
    scene = {
        "scene": {"dataset": str(tmp_path)},
        "reprojections": {"flat": {"camera": LENSES["perspective"], "format": "exr"}},
        "exports": {"colmap": {"sources": ["flat"]}},
    }
    path = tmp_path / "LF/lightfield.json"
    path.write_text(json.dumps(content))
    assert TypeAdapter(Scene).validate_python(scene).exports.colmap
    path.write_text(json.dumps(content | {"depth": None}))
    problem = "flat: the rig LF holds no depth; its lightfield.json says so; leave out the export"
    with pytest.raises(ValidationError, match=problem):
        TypeAdapter(Scene).validate_python(scene)


def test_a_blend_camera_with_frames_is_refused_for_what_it_is():
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": {
            "Own": {
                "type": "blend_camera",
                "frames": {"first": 1, "last": 9},
                "camera": LENSES["perspective"],
            }
        },
        "exports": {"dnerf": {"sources": ["views"]}},
    }
    with pytest.raises(
        ValidationError, match="the rig Own is of type blend_camera, whose"
    ) as caught:
        TypeAdapter(Scene).validate_python(content)
    assert "fewer than two frames" not in str(caught.value)


def test_a_sensor_s_pictures_without_a_pass_are_refused_in_yaml():
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": {"LF": EVEN_PLANE | {"camera": LENSES["perspective"]}},
        "sensor": {},
        "exports": {"lichtfeld": {"sources": ["sensor"], "normals": True}},
    }
    problem = "sensor lacks the pass normal; export the sensor's source"
    with pytest.raises(ValidationError, match=problem):
        TypeAdapter(Scene).validate_python(content)


def test_a_rig_that_a_consumer_cannot_take_is_refused_in_yaml():
    camera = LENSES["perspective"]
    rigs = {
        "Plane": EVEN_PLANE | {"camera": camera},
        "Ball": {"type": "sphere", "subdivisions": 1, "camera": camera},
    }
    again = {"rigs": ["Plane"], "camera": camera, "format": "exr"}
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": rigs,
        "reprojections": {"again": again},
        "exports": {"hci": {"sources": ["again"]}},
    }
    assert TypeAdapter(Scene).validate_python(content).exports.hci
    content["exports"] = {"hci": {"sources": ["views"]}}
    problem = r"views: the rig Ball is not .* type plane.*; or export without it: rigs: \[Plane\]"
    with pytest.raises(ValidationError, match=problem):
        TypeAdapter(Scene).validate_python(content)
    content["exports"] = {"hci": {"sources": ["views"], "rigs": ["Plane"]}}
    assert TypeAdapter(Scene).validate_python(content).exports.hci
    content["rigs"] = {"Plane": RIG | {"camera": camera}}
    content["exports"] = {"hci": {"sources": ["views"]}}
    problem = "the rig Plane has cameras 0.4 m apart across and 0.6 m apart down"
    with pytest.raises(ValidationError, match=problem):
        TypeAdapter(Scene).validate_python(content)
    content["rigs"] = {"One": RIG | {"camera": camera, "cameras": [1, 1]}}
    content["reprojections"] = {}
    for name, why in (("instant_ngp", "cameras at one place"), ("colmap", "only one view")):
        content["exports"] = {name: {"sources": ["views"]}}
        with pytest.raises(ValidationError, match=f"views: the rig One has {why}"):
            TypeAdapter(Scene).validate_python(content)
    content["exports"] = {"instant_ngp": {"sources": ["views"], "bounds": "depth"}}
    assert TypeAdapter(Scene).validate_python(content).exports.instant_ngp


def test_only_an_earlier_export_is_replaced(dataset, tmp_path):
    folder = exported(dataset, "poses_csv", "perspective", tmp_path)
    (folder / "export.json").unlink()
    with pytest.raises(UserError, match=r"perspective: holds poses.csv, which no export wrote"):
        exported(dataset, "poses_csv", "perspective", tmp_path)
    assert (folder / "poses.csv").is_file()


def test_other_files_in_an_earlier_exports_folder_are_kept(dataset, tmp_path):
    folder = exported(dataset, "poses_csv", "perspective", tmp_path / "exports")
    (folder / "thesis.txt").write_text("years of work")
    with pytest.raises(UserError, match=r"perspective: holds thesis.txt, which no export wrote"):
        exported(dataset, "poses_csv", "perspective", tmp_path / "exports")
    assert (folder / "thesis.txt").is_file()
    (folder / "thesis.txt").unlink()
    link = tmp_path / "link"
    link.symlink_to(folder)
    source = SourceDataset(dataset, "perspective", ".png")
    exports.run(source, EXPORTERS["poses_csv"](sources=["perspective"]), link)
    assert link.is_symlink()
    assert (folder / "poses.csv").is_file()


@pytest.mark.parametrize(
    ("name", "source", "why"),
    [
        ("nerf_synthetic", "fisheye", "is not a pinhole camera"),
        ("miv", "fisheye", "has a lens that MIV lacks"),
        ("scannetpp", "perspective", "is not an equidistant fisheye"),
        ("colmap", "views", "sees 180 degrees, but COLMAP's fisheye ends below 180"),
        ("ncore", "panorama", "has a lens that NCore lacks"),
        ("lichtfeld", "opencv", "has a fourth coefficient, which LichtFeld drops; reproject"),
    ],
)
def test_views_that_a_consumer_cannot_take_are_refused_by_hand_too(
    dataset, tmp_path, name, source, why
):
    with pytest.raises(UserError, match=rf"lightfield.json: {why}"):
        exported(dataset, name, source, tmp_path)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("lens", "coefficients", "fov"),
    [
        ("brown_conrady", [-0.2, 0.05, 0.004, -0.003], 100),
        ("kannala_brandt", [0.02, -0.01, 0.003, -0.001], 160),
        ("fov_model", [0.9], 160),
        ("unified", [0.9], 200),
        ("double_sphere", [-0.17, 0.59], 200),
        ("extended_unified", [0.63, 1.04], 200),
    ],
)
def test_kalibr_gets_the_lens_of_the_views(tmp_path, lens, coefficients, fov):
    camera = CALIBRATED["FOV"] | {"lens": lens, "coefficients": coefficients, "fov": fov}
    write_views(tmp_path / "dataset", camera, RIG)
    folder = exported(tmp_path / "dataset", "kalibr", "views", tmp_path)
    angles, azimuths = np.radians(
        np.meshgrid(np.linspace(0, fov / 2 - 1, 9), np.arange(0, 360, 40))
    )
    sin = np.sin(angles)
    rays = np.stack([sin * np.cos(azimuths), sin * np.sin(azimuths), -np.cos(angles)], axis=-1)
    found = calibrations.read(folder / "camchain.yaml")
    expected = lenses.from_camera(camera).pixels(rays)
    np.testing.assert_allclose(found.pixels(rays), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "camera", "why"),
    [
        ("ncore", CALIBRATED["EUCM"], "has a lens that NCore lacks; reproject to"),
        ("colmap", OTHERS["f_theta"], "has a lens that COLMAP lacks; reproject to"),
        ("colmap", WIDE_624, "sees 90 degrees from its axis, where COLMAP's"),
        ("nerfstudio", WIDE_624, "sees 90 degrees from its axis, where nerfstudio's"),
        ("nerfstudio", OTHERS["FULL_OPENCV"], "has k4 to k6, which nerfstudio lacks"),
        ("nerfstudio", CALIBRATED["FOV"], "has a lens that nerfstudio lacks"),
        ("instant_ngp", OTHERS["FISHEYE624"], "cannot follow: it has a thin prism"),
        ("lichtfeld", OTHERS["OPENCV"], "has a lens that LichtFeld lacks"),
        ("kalibr", OTHERS["FULL_OPENCV"], "has k3 to k6, which Kalibr lacks"),
        ("kalibr", CALIBRATED["DIVISION"], "has a lens that Kalibr lacks"),
    ],
)
def test_calibrated_views_that_a_consumer_cannot_take_are_refused(tmp_path, name, camera, why):
    write_views(tmp_path / "dataset", camera, RIG)
    with pytest.raises(UserError, match=rf"lightfield.json: .*{why}"):
        exported(tmp_path / "dataset", name, "views", tmp_path / "exports")


def test_ncore_refuses_a_fisheye_whose_rays_its_three_steps_miss():
    """Three steps of Newton's method, from an angle proportional to the radius."""
    refusals = {}
    for fov in (360, 190):
        lens = lenses.from_camera(TUM_VI | {"fov": fov})
        refusals[fov] = EXPORTERS["ncore"](sources=["views"]).refusal(lens, True)
    assert "NCore's inverse misses by 0.73 pixels" in refusals[360]
    assert refusals[190] is None


def by_hand(run_program, dataset, folder, *arguments):
    """Export a table of poses with the program. Return the names of its views."""
    arguments = ["poses_csv", "--dataset", dataset, "--output", folder, *arguments]
    run_program("export.py", *arguments)
    rows = (folder / "poses.csv").read_text().splitlines()[1:]
    return [row.split(",")[0] for row in rows]


def test_a_settings_file_gives_source_and_rigs_that_test(run_program, dataset, tmp_path):
    arguments = ["--source", "perspective", "--suffix", ".exr"]
    names = by_hand(run_program, dataset, tmp_path / "flags", *arguments)
    settings = tmp_path / "settings.json"
    content = {"options": {"sources": ["perspective"]}, "suffix": ".exr"}
    settings.write_text(json.dumps(content))
    assert by_hand(run_program, dataset, tmp_path / "file", "--settings", settings) == names
    settings.write_text(json.dumps(content | {"tested_by": {"other": str(dataset)}}))
    both = by_hand(run_program, dataset, tmp_path / "both", "--settings", settings)
    assert both == [*names, *(f"other_{name}" for name in names)]


def test_a_mistake_in_a_settings_file_is_named_and_nothing_made(run_program, dataset, tmp_path):
    content = {"options": {"sources": ["views"], "point": 5}}
    settings = tmp_path / "settings.json"
    settings.write_text(json.dumps(content))
    arguments = ["--dataset", dataset, "--output", tmp_path / "made", "--settings", settings]
    refused = run_program("export.py", "colmap", *arguments, check=False)
    assert refused.stderr.startswith(f"error: {settings}: options.point: unknown key")
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    refused = run_program("export.py", "colmap", *arguments, "--suffix", ".png", check=False)
    assert "--settings: excludes --suffix" in refused.stderr
    assert not (tmp_path / "made").exists()


def test_points_come_from_views_with_sky_too():
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [8, 8]})
    rays = lens.pixel_rays()
    distance = np.full(rays.shape[:2], np.inf)
    distance[2:6, 2:6] = 3
    surface = SeenSurface(lens, View.placed("one", np.eye(4)), rays, distance)
    with np.errstate(invalid="raise"):
        points, normals = surface.points(1)
    assert points.shape == normals.shape == (16, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 3)


def test_points_are_as_dense_at_the_origin_as_elsewhere():
    line = np.linspace(-1, 1, 2001)
    for axis in range(3):
        positions = np.full((len(line), 3), 0.5)
        positions[:, axis] = line
        gaps = np.diff(line[evenly(positions, 40)])
        assert gaps.max() < 1.5 * np.median(gaps)


def test_a_point_that_several_views_see_alike_is_kept_once():
    points = np.random.default_rng(1).normal(size=(50, 3))
    assert evenly(np.repeat(points, 4, axis=0), 100).tolist() == list(range(0, 200, 4))


@pytest.mark.parametrize("size", [1, 1e9])
def test_the_first_point_in_each_voxel_is_kept(size):
    # Many of the points share a voxel, however far apart the others are.
    positions = np.random.default_rng(2).normal(size=(500, 3)).round(1)
    positions[0] = 5 * size
    first = {}
    for index, cell in enumerate(np.floor(positions / 0.25).tolist()):
        first.setdefault(tuple(cell), index)
    assert one_a_voxel(positions, 0.25).tolist() == list(first.values())


def test_a_point_cloud_may_have_views_that_see_no_surface(dataset, tmp_path):
    shutil.copytree(dataset, tmp_path / "sky")
    path = tmp_path / "sky/exr/view_0000f.exr"
    image = images.read_image(path)
    miss = np.full_like(image.channels["Z"], np.inf)
    images.write_exr(path, image.channels | {"Z": miss}, image.attributes)
    folder = exported(tmp_path / "sky", "point_cloud", "views", tmp_path / "export", voxel=0.1)
    assert len(read_vertices(folder / "points.ply")) > 2000


def test_views_of_another_lens_do_not_test(dataset, tmp_path):
    source = SourceDataset(dataset / "perspective", "", ".exr", {"other": dataset / "shifted"})
    settings = TypeAdapter(EXPORTERS["nerf_synthetic"]).validate_python({"sources": ["views"]})
    with pytest.raises(UserError, match="camera: must be the same as in"):
        exports.run(source, settings, tmp_path / "export")
