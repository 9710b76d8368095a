"""Exports of heads: several cameras with fixed poses on one body, as their consumers read them.

The scene is the inside of a sphere, so all its points are known.
"""

import json
from itertools import pairwise

import cv2
import numpy as np
import pycolmap
import pytest
import yaml
from oracles.readers import ncore
from oracles.readers.contents import Exported
from oracles.readers.ply import read_vertices
from pydantic import TypeAdapter
from sphere import CALIBRATED as COLMAPS
from sphere import LENSES, colour_of, write_views
from test_exports import ncore_pixels, on_sphere, wai_points, wai_shares

from lightfield.configuration.heads import with_cameras
from lightfield.core.errors import UserError
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.geometry.lenses import calibrations
from lightfield.imaging import images
from lightfield.products import exports

# COLMAP's cameras look along +Z, with Y down.
FLIP = np.diag([1.0, -1, -1, 1])
BODY = {"type": "ring", "count": 4, "size": 1.6, "center": [0.1, -0.3, 0.2], "look_at": [0, 0, 3]}
# Three cameras, with lenses, sizes and places of their own.
HEAD = {
    "left": {"camera": LENSES["perspective"], "position": [-0.1, 0, 0.02], "rotation": [0, 3, 0]},
    "right": {"camera": LENSES["opencv"], "position": [0.12, 0.01, 0], "rotation": [2, -5, 1]},
    "rear": {"camera": LENSES["fisheye"], "position": [0, 0, 0.2], "rotation": [-10, 170, 4]},
}
BACK_TO_BACK = {
    "front": {"camera": LENSES["wide"], "position": [0, 0, -0.02]},
    "back": {"camera": LENSES["wide"], "position": [0, 0, 0.02], "rotation": [0, 180, 0]},
}


def datasets(folder, head, name="car", **rig):
    """Write the datasets of a head's cameras. Return their folders by the names of their rigs."""
    body = rigs.from_settings({**BODY, "head": head, **rig})
    folders = {}
    for rig_name, camera_rig in with_cameras({name: body}).items():
        folders[rig_name] = folder / rig_name / "dataset"
        write_views(folders[rig_name], head[camera_rig.mount.name]["camera"], camera_rig)
    return folders


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    return datasets(tmp_path_factory.mktemp("heads"), HEAD)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return datasets(tmp_path_factory.mktemp("heads"), BACK_TO_BACK, "dual")


def exported(folders, name, folder, **options):
    """Export the views of all rigs together, as the workflow does."""
    (first, *_) = folders.values()
    together = {"together": [*folders]} if len(folders) > 1 else {}
    options = {"sources": ["views"], **together, **options}
    settings = TypeAdapter(EXPORTERS[name]).validate_python(options)
    others = dict([*folders.items()][1:])
    exports.run(SourceDataset(first, "", ".exr", others), settings, folder)
    return folder


def views_of(folders, head):
    """Return the views of a head's cameras by the names of their files in an export."""
    return {
        f"{camera}/{view.name}.png": view
        for camera, folder in zip(head, folders.values(), strict=True)
        for view in LightField.read(folder / "lightfield.json").views
    }


@pytest.mark.parametrize("form", ["text", "binary"])
def test_colmap_reads_one_rig_whose_frames_have_all_cameras(three, tmp_path, form):
    folder = exported(three, "colmap", tmp_path / "colmap", format=form, points=300)
    model = pycolmap.Reconstruction(folder / "sparse/0")
    assert (model.num_rigs(), model.num_cameras(), model.num_frames()) == (1, 3, 4)
    assert [model.cameras[number].model_name for number in (1, 2, 3)] == [
        "PINHOLE",
        "OPENCV_FISHEYE",
        "OPENCV_FISHEYE",
    ]
    (rig,) = model.rigs.values()
    assert rig.num_sensors() == 3
    views = views_of(three, HEAD)
    assert {image.name for image in model.images.values()} == views.keys()
    for frame in model.frames.values():
        names = [model.images[data.id].name for data in frame.data_ids]
        # All images of a frame have one name, in the folders of the three cameras.
        assert len(names) == 3
        assert len({name.partition("/")[2] for name in names}) == 1
    for image in model.images.values():
        # The image's pose follows from the frame's and from the rig's.
        world_from_camera = np.vstack([image.cam_from_world().inverse().matrix(), [0, 0, 0, 1]])
        np.testing.assert_allclose(
            world_from_camera @ FLIP, views[image.name].world_from_camera, atol=2e-12
        )
        assert (folder / "images" / image.name).is_file()
        seen = [point for point in image.points2D if point.has_point3D()]
        assert seen
        for point in seen:
            place = model.points3D[point.point3D_id].xyz
            np.testing.assert_allclose(image.project_point(place), point.xy, atol=1e-6)
    on_sphere(np.array([point.xyz for point in model.points3D.values()]), 1e-5)


def test_nerfbaselines_lists_the_images_of_all_cameras_of_a_head(tmp_path):
    head = {name: HEAD["left"] | {"position": [x, 0, 0]} for name, x in (("l", -0.1), ("r", 0.1))}
    head["r"] |= {"camera": LENSES["shifted"]}
    folders = datasets(tmp_path, head)
    folder = exported(folders, "nerfbaselines", tmp_path / "out", points=50)
    train, test = (
        (folder / f"{part}_list.txt").read_text().splitlines() for part in ("train", "test")
    )
    assert test
    assert sorted(train + test) == sorted(views_of(folders, head))
    model = pycolmap.Reconstruction(folder / "sparse/0")
    for image in model.images.values():
        picture = cv2.imread(str(folder / "images" / image.name))
        camera = lenses.from_camera(head[image.name[0]]["camera"])
        assert picture.shape[:2] == (camera.height, camera.width)
        center = (image.camera.principal_point_x, image.camera.principal_point_y)
        assert center == pytest.approx(camera.center)


def test_colmap_writes_the_rig_as_colmap_itself_does(three, tmp_path):
    ours = exported(three, "colmap", tmp_path / "ours", points=50) / "sparse/0"
    model = pycolmap.Reconstruction(ours)
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    model.write_binary(theirs)
    assert (theirs / "rigs.bin").read_bytes() == (ours / "rigs.bin").read_bytes()
    again = pycolmap.Reconstruction(theirs)
    assert {*again.frames} == {*model.frames}


def test_one_camera_of_a_head_is_exported_as_any_rig(three, tmp_path):
    folder = exported({"car_left": three["car_left"]}, "colmap", tmp_path / "one")
    assert {path.name for path in (folder / "images").iterdir()} == {
        f"view_{number:04d}f.png" for number in range(4)
    }
    assert not (folder / "sparse/0/rigs.bin").exists()


def opencv_pixels(camera, points):
    """Project points (n, 3), in OpenCV's axes, as the distortion model of a camchain says."""
    fx, fy, cx, cy = camera["intrinsics"]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    distortion = np.array(camera["distortion_coeffs"])
    still = np.zeros(3)
    if camera["distortion_model"] == "equidistant":
        pixels, _ = cv2.fisheye.projectPoints(points[:, None], still, still, matrix, distortion)
    else:
        pixels, _ = cv2.projectPoints(points, still, still, matrix, distortion)
    return pixels.reshape(-1, 2)


def test_opencv_projects_through_a_camchain_as_the_views_do(three, tmp_path):
    folder = exported(three, "kalibr", tmp_path / "kalibr")
    chain = yaml.safe_load((folder / "camchain.yaml").read_text())
    assert [*chain] == ["cam0", "cam1", "cam2"]
    assert [camera["rostopic"] for camera in chain.values()] == [
        "/left/image_raw",
        "/right/image_raw",
        "/rear/image_raw",
    ]
    views = views_of(three, HEAD)
    for number, settings in enumerate(HEAD.values()):
        camera = chain[f"cam{number}"]
        lens = lenses.from_camera(settings["camera"])
        assert camera["resolution"] == [lens.width, lens.height]
        rays = lens.rays(*np.random.default_rng(number).uniform(10, 40, (2, 50)))
        # Kalibr's first pixel has its centre at (0, 0), and ours at (½, ½).
        ours = lens.pixels(rays) - 0.5
        np.testing.assert_allclose(opencv_pixels(camera, rays * [1, -1, -1]), ours, atol=1e-6)
    poses = [views[f"{name}/view_0000f.png"].world_from_camera @ FLIP for name in HEAD]
    for number, (last, this) in enumerate(pairwise(poses), 1):
        expected = np.linalg.inv(this) @ last
        np.testing.assert_allclose(chain[f"cam{number}"]["T_cn_cnm1"], expected, atol=2e-12)


def test_nerfstudio_gives_each_frame_its_own_intrinsics(three, tmp_path):
    fisheyes = {name: three[name] for name in ("car_right", "car_rear")}
    folder = exported(fisheyes, "nerfstudio", tmp_path / "nerfstudio", points=100)
    content = json.loads((folder / "transforms.json").read_text())
    assert content["camera_model"] == "OPENCV_FISHEYE"
    assert "fl_x" not in content
    head = {name: HEAD[name] for name in ("right", "rear")}
    views = {f"images/{name}": view for name, view in views_of(fisheyes, head).items()}
    assert {frame["file_path"] for frame in content["frames"]} == views.keys()
    for frame in content["frames"]:
        camera = frame["file_path"].split("/")[1]
        lens = lenses.from_camera(HEAD[camera]["camera"])
        assert (frame["w"], frame["h"]) == (lens.width, lens.height)
        assert (frame["cx"], frame["cy"]) == lens.center
        rays = lens.rays(*np.random.default_rng(1).uniform(10, 40, (2, 50)))
        matrix = np.array([[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]]])
        distortion = np.array([frame[f"k{n}"] for n in range(1, 5)])
        still = np.zeros(3)
        found, _ = cv2.fisheye.projectPoints(
            (rays * [1, -1, -1])[:, None],
            still,
            still,
            np.vstack([matrix, [0, 0, 1]]),
            distortion,
        )
        np.testing.assert_allclose(found.reshape(-1, 2), lens.pixels(rays), atol=1e-6)
        np.testing.assert_array_equal(
            frame["transform_matrix"], views[frame["file_path"]].world_from_camera
        )
    vertices = read_vertices(folder / "points.ply")
    on_sphere(np.stack([vertices[name] for name in "xyz"], axis=-1), 1e-5)


def test_wai_has_the_lens_of_each_camera_of_a_head(tmp_path):
    shifted = {"camera": LENSES["shifted"], "position": [0.12, 0, 0]}
    head = {"left": HEAD["left"], "right": shifted}
    folders = datasets(tmp_path, head)
    folder = exported(folders, "wai", tmp_path / "wai")
    content = json.loads((folder / "scene_meta.json").read_text())
    assert content["shared_intrinsics"] is False
    views = views_of(folders, head)
    frames = {f"{frame['frame_name']}.png": frame for frame in content["frames"]}
    assert frames.keys() == views.keys()
    for name, frame in frames.items():
        on_sphere(wai_points(folder, frame), 1e-5)
        matrix = np.array(frame["transform_matrix"]) @ FLIP
        np.testing.assert_allclose(matrix, views[name].world_from_camera, atol=1e-12)
    # The cameras of a head stand beside each other.
    order = [*frames]
    shares = wai_shares(folder, content)
    left, right = (order.index(f"{camera}/view_0000f.png") for camera in head)
    assert shares[left, right] > 0.5
    assert shares[right, left] > 0.5


def test_points_of_both_sides_lie_on_the_same_surface(two, tmp_path):
    """The cameras see past 180°, so they share a band of the sphere."""
    folder = exported(two, "nerfstudio", tmp_path / "nerfstudio", points=2000)
    vertices = read_vertices(folder / "points.ply")
    points = np.stack([vertices[name] for name in "xyz"], axis=-1)
    on_sphere(points, 1e-5)
    assert len(points) > 1000


def test_lenses_that_a_consumer_cannot_mix_are_refused(three, tmp_path):
    for name in ("nerf_synthetic", "lichtfeld", "nerfstudio"):
        with pytest.raises(UserError, match="camera: must be the same as in"):
            exported(three, name, tmp_path / name)


@pytest.mark.parametrize(
    ("name", "first", "misread", "problem"),
    [
        ("colmap", LENSES["perspective"], COLMAPS["FOV"], "is COLMAP's FOV, which gsplat"),
        (
            "nerfstudio",
            COLMAPS["OPENCV"],
            COLMAPS["OPENCV"] | {"coefficients": [-0.2, 0.05, 0.004, -0.003, 0.01]},
            "has k3, which Brush leaves out",
        ),
    ],
)
def test_a_lens_that_is_misread_is_warned_of_by_its_own_file(
    name, first, misread, problem, tmp_path, capsys
):
    folders = datasets(tmp_path, {"first": {"camera": first}, "other": {"camera": misread}})
    exported(folders, name, tmp_path / name)
    path = folders["car_other"] / "lightfield.json"
    (warning,) = (line for line in capsys.readouterr().err.splitlines() if "warning: " in line)
    assert warning.startswith(f"warning: {path}: camera: {problem}")


def test_ncore_has_each_camera_at_the_same_times(two, tmp_path):
    folder = exported(two, "ncore", tmp_path / "ncore", points=400)
    (entry,) = json.loads((folder / "views.json").read_text())["component_stores"]
    assert [*entry["components"]["cameras"]] == ["front", "back"]
    store = ncore.Store(folder / entry["path"], Exported())
    frame = "lidars/points/frames/0"
    directions = store.array(f"{frame}/ray_bundle/direction").astype(float)
    points = directions * store.array(f"{frame}/ray_bundle_returns/distance_m")[0][:, None]
    on_sphere(points, 1e-5)
    poses = store.attributes("poses/default/dynamic_poses")
    assert {*poses} == {"('front', 'world')", "('back', 'world')"}
    views = views_of(two, BACK_TO_BACK)
    for name in BACK_TO_BACK:
        frames = store.attributes(f"cameras/{name}/frames")["frames_timestamps_us"]
        of_camera = poses[f"('{name}', 'world')"]
        assert (
            [end for _, end in frames]
            == of_camera["timestamps_us"]
            == [0, 10**6, 2 * 10**6, 3 * 10**6]
        )
        lens = store.attributes(f"intrinsics/default/cameras/{name}")
        for (_, end), pose in zip(frames, np.array(of_camera["poses"]), strict=True):
            place = f"cameras/{name}/frames/{end}"
            view = views[store.attributes(f"{place}/generic_data")["name"] + ".png"]
            np.testing.assert_array_equal(pose @ FLIP, view.world_from_camera)
            (tmp_path / "view.png").write_bytes(store.array(f"{place}/image").tobytes())
            picture = images.read_image(tmp_path / "view.png").srgb
            mask = store.array(f"{place}/generic_data/mask")
            pixels = ncore_pixels(lens, (points - pose[:3, 3]) @ pose[:3, :3])
            with np.errstate(invalid="ignore"):
                inside = ((pixels >= 0) & (pixels < 64)).all(axis=1)
            column, row = np.floor(pixels[inside]).astype(int).T
            has_light = mask[row, column] > 0
            assert has_light.sum() > 50
            expected = colour_of(points[inside][has_light])
            np.testing.assert_allclose(picture[row, column][has_light], expected, atol=6)


def test_a_camera_with_a_name_of_ncores_is_refused(tmp_path):
    head = dict.fromkeys(("front", "points"), BACK_TO_BACK["front"])
    with pytest.raises(UserError, match="head: NCore has a points itself"):
        exported(datasets(tmp_path, head), "ncore", tmp_path / "ncore")


CALIBRATED = {
    "brown_conrady": {"coefficients": [-0.28, 0.07, 0.0002, -0.0001]},
    "fov_model": {"coefficients": [0.9]},
    "double_sphere": {"coefficients": [-0.2, 0.59]},
    "extended_unified": {"coefficients": [0.62, 1.1]},
    "unified": {"coefficients": [0.9]},
}


# The file of an export that has its cameras, and the second one's name there.
CALIBRATIONS = {"kalibr": ("camchain.yaml", "cam1"), "colmap": ("sparse/0/cameras.bin", 2)}


@pytest.mark.parametrize(
    ("name", "lens"),
    [
        *(("kalibr", lens) for lens in CALIBRATED),
        *(("colmap", lens) for lens in CALIBRATED if lens != "double_sphere"),
    ],
)
def test_an_exports_camera_is_read_back_as_the_same_lens(name, lens, tmp_path):
    camera = {
        "lens": lens,
        "fov": 80,
        "focal_length": 30,
        "sensor_size": [36, 27],
        "principal_point": [31, 25.5],
        "resolution": [64, 48],
        **CALIBRATED[lens],
    }
    head = {"left": {"camera": camera}, "right": {"camera": camera, "position": [0.1, 0, 0]}}
    folder = exported(datasets(tmp_path, head), name, tmp_path / name)
    expected = lenses.from_camera(camera)
    file, number = CALIBRATIONS[name]
    found = calibrations.read(folder / file, number, fov=np.radians(80))
    points = np.random.default_rng(3).normal(size=(200, 3)) * [0.5, 0.5, 0.1] - [0, 0, 2]
    pixels = expected.pixels(points)
    assert expected.in_frame(pixels).sum() > 50
    np.testing.assert_allclose(found.pixels(points), pixels, atol=1e-9)


def test_more_radial_terms_than_kalibrs_are_refused():
    camera = {"lens": "brown_conrady", "focal_length": 30, "resolution": [64, 48]}
    settings = TypeAdapter(EXPORTERS["kalibr"]).validate_python({"sources": ["views"]})
    lens = lenses.from_camera(camera | {"coefficients": [-0.28, 0.07, 0, 0, 0.01]})
    assert "k3" in settings.refusal(lens, has_depth=True)
