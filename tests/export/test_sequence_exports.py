"""Exports of a sequence, read as their consumers read them: points lie on what each frame shows."""

import json
import shutil

import cv2
import numpy as np
import pycolmap
import pytest
from oracles.readers.ply import read_vertices
from sphere import (
    BALL,
    BALL_RADIUS,
    LENSES,
    RADIUS,
    look,
    look_at_ball,
    make_transparent,
    write_views,
)

from lightfield.core.errors import UserError
from lightfield.export.sequence import SourceSequence
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.products import exports

RIG = {"type": "plane", "cameras": [3, 3], "size": 0.6, "center": [0.1, -0.2, 0.1]}
VIEWS = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
FLAT = LENSES["perspective"]
# The frames of the animation, and what they show: the sphere, later with a ball in it.
FRAMES = {3: look, 5: look_at_ball, 11: look_at_ball}
TIMES = [0, 0.25, 1]


def write_sequence(rig_folder, rig):
    for number, see in FRAMES.items():
        folder = rig_folder / "dataset"
        write_views(folder, VIEWS, rig, see=see)
        write_views(folder / "perspective", FLAT, rig, see=see)
        for file in (folder / "lightfield.json", folder / "perspective/lightfield.json"):
            file.write_text(json.dumps(json.loads(file.read_text()) | {"frame": number}))
        folder.rename(rig_folder / f"f{number:05}")


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """A rig's folder with three frames, each with views and the reprojection perspective."""
    folder = tmp_path_factory.mktemp("sequence")
    for name, rig in (("plain", RIG), ("split", RIG | {"split": "odd"})):
        (folder / name).mkdir()
        write_sequence(folder / name, rig)
    return folder


def source_of(rig_folder, name="perspective"):
    folders = [path.name for path in rig_folder.iterdir()]
    return SourceSequence.of_folders(rig_folder, folders, name, ".exr", {})


def exported(rig_folder, name, folder, **options):
    settings = EXPORTERS[name](sources=["perspective"], **options)
    exports.run(source_of(rig_folder), settings, folder)
    return folder


def pinhole(pixels, focal, width, height):
    """Return the rays (n, 3) of pixels (n, 2), with y up and looking along -z."""
    x, y = (pixels - (width / 2, height / 2)).T / focal
    return np.stack([x, -y, -np.ones_like(x)], axis=-1)


def surface_of(number, position, rays):
    """Return where the rays (n, 3) of a frame meet its scene, by the sphere's and ball's size."""
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    along = unit @ position
    distance = -along + np.sqrt(along**2 + RADIUS**2 - position @ position)
    if FRAMES[number] is look_at_ball:
        to_ball = BALL - position
        middle = unit @ to_ball
        with np.errstate(invalid="ignore"):
            near = middle - np.sqrt(BALL_RADIUS**2 - (to_ball @ to_ball - middle**2))
        distance = np.where(np.isfinite(near), near, distance)
    return position + unit * distance[:, None]


def assert_shows_its_frame(picture, number, matrix, focal):
    """Check that a picture has the colours that the scene of its frame has on the camera's rays."""
    height, width = picture.shape[:2]
    rows, columns = np.indices((height, width)).reshape(2, -1)
    pixels = np.stack([columns, rows], axis=-1) + 0.5
    rays = pinhole(pixels, focal, width, height) @ matrix[:3, :3].T
    points = surface_of(number, matrix[:3, 3], rays)
    on_ball = np.linalg.norm(points - BALL, axis=1) < BALL_RADIUS + 1e-6
    assert on_ball.any() == (FRAMES[number] is look_at_ball)
    colours = picture.reshape(-1, 3).astype(float)
    # The ball is red, and the sphere's colour follows from the place.
    expected = 40 + 175 * (points / RADIUS / 2 + 0.5)
    difference = np.abs(colours - expected).max(axis=1)
    assert np.median(difference[~on_ball]) < 3
    assert (difference[on_ball] > 20).mean() > 0.9 if on_ball.any() else True


def test_dnerf_has_a_time_for_each_picture_and_begins_each_list_at_0(sequence, tmp_path):
    folder = exported(sequence / "split", "dnerf", tmp_path, points=300)
    pictures = set()
    for part in ("train", "val", "test"):
        content = json.loads((folder / f"transforms_{part}.json").read_text())
        times = [frame["time"] for frame in content["frames"]]
        assert times[0] == 0
        assert times == sorted(times)
        assert set(times) == set(TIMES)
        focal = 0.5 * FLAT["resolution"][0] / np.tan(0.5 * content["camera_angle_x"])
        for frame in content["frames"]:
            pixels = images.read_image(folder / f"{frame['file_path']}.png")
            rgba = np.dstack([pixels.channels[name] for name in "RGBA"])
            assert (rgba[..., 3] == 255).all()
            number = list(FRAMES)[TIMES.index(frame["time"])]
            matrix = np.array(frame["transform_matrix"])
            assert_shows_its_frame(rgba[..., :3], number, matrix, focal)
            pictures.add((part, frame["file_path"]))
    trained = {path for part, path in pictures if part == "train"}
    assert trained.isdisjoint(path for part, path in pictures if part != "train")
    assert len({path for _, path in pictures}) == len(FRAMES) * 9


def test_dnerf_starts_from_points_of_the_first_frame(sequence, tmp_path):
    folder = exported(sequence / "plain", "dnerf", tmp_path, points=300)
    vertices = read_vertices(folder / "fused.ply")
    points = np.stack([vertices[axis] for axis in "xyz"], axis=-1)
    assert len(points) == 300
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), RADIUS, atol=1e-4)


def test_neural_3d_video_has_a_video_and_a_pose_for_each_camera(sequence, tmp_path):
    folder = exported(sequence / "split", "neural_3d_video", tmp_path / "first", points=300)
    rows = np.load(folder / "poses_bounds.npy")
    videos = sorted(folder.glob("cam*.mp4"))
    assert len(videos) == len(rows)
    views = {view.name: view for view in source_of(sequence / "split").lightfield.views}
    positions = {tuple(view.position): view.split for view in views.values()}
    for number, (row, path) in enumerate(zip(rows, videos, strict=True)):
        poses = row[:-2].reshape(3, 5)
        height, width, focal = poses[:, 4]
        assert [width, height] == FLAT["resolution"]
        # Readers turn LLFF's columns down, right, back into right, up, back.
        matrix = np.column_stack([poses[:, 1], -poses[:, 0], poses[:, 2], poses[:, 3]])
        assert positions[tuple(matrix[:, 3])] == ("test" if number == 0 else "train")
        reader = cv2.VideoCapture(str(path))
        for frame in FRAMES:
            is_read, picture = reader.read()
            assert is_read
            assert_shows_its_frame(picture[..., ::-1], frame, matrix, focal)
        assert not reader.read()[0]
        near, far = row[-2:]
        assert 0.5 < near < far < 2 * RADIUS
    again = exported(sequence / "split", "neural_3d_video", tmp_path / "again", points=300)
    for path in videos:
        assert (again / path.name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("name", "picture"),
    [("neural_3d_video", "cam00.mp4"), ("multipleview", "cam01/frame_00001.jpg")],
)
def test_pictures_without_alpha_show_transparent_views_in_front_of_black(tmp_path, name, picture):
    """Light that is multiplied by alpha is that in front of black."""
    shown = []
    for kind in ("transparent", "black"):
        (tmp_path / kind).mkdir()
        write_sequence(tmp_path / kind, RIG)
        if kind == "transparent":
            for frame in (tmp_path / kind).iterdir():
                make_transparent(frame, 0.25)
                make_transparent(frame / "perspective", 0.25)
        folder = exported(tmp_path / kind, name, tmp_path / f"{kind}_export")
        shown.append(cv2.VideoCapture(str(folder / picture)).read()[1])
    # Videos and JPEGs round.
    assert np.abs(np.subtract(*np.array(shown, int))).max() <= 4


def test_colmap_frames_have_the_same_names_and_the_points_of_their_frames(sequence, tmp_path):
    folder = exported(sequence / "split", "colmap_frames", tmp_path, points=400)
    assert sorted(path.name for path in folder.glob("colmap_*")) == [
        "colmap_0",
        "colmap_1",
        "colmap_2",
    ]
    names = set()
    for place, number in enumerate(FRAMES):
        model = folder / f"colmap_{place}"
        names.add(tuple(sorted(path.name for path in (model / "images").iterdir())))
        read = pycolmap.Reconstruction(model / "sparse/0")
        assert [camera.model_name for camera in read.cameras.values()] == ["PINHOLE"]
        points = np.array([point.xyz for point in read.points3D.values()])
        on_sphere = np.abs(np.linalg.norm(points, axis=1) - RADIUS) < 1e-4
        on_ball = np.abs(np.linalg.norm(points - BALL, axis=1) - BALL_RADIUS) < 1e-4
        assert (on_sphere | on_ball).all()
        assert on_ball.any() == (FRAMES[number] is look_at_ball)
        for image in read.images.values():
            for seen in image.points2D:
                projected = image.project_point(read.points3D[seen.point3D_id].xyz)
                np.testing.assert_allclose(projected, seen.xy, atol=1e-6)
            picture = cv2.imread(str(model / "images" / image.name))[..., ::-1]
            matrix = image.cam_from_world().inverse().matrix() * [1, -1, -1, 1]
            (camera,) = read.cameras.values()
            assert_shows_its_frame(picture, number, matrix, camera.focal_length_x)
        first = read.find_image_with_name("cam00.png")
        views = source_of(sequence / "split").lightfield.views
        nearest = min(views, key=lambda v: np.linalg.norm(v.position - first.projection_center()))
        assert nearest.split == "test"
        found = first.cam_from_world().inverse().matrix() * [1, -1, -1, 1]
        np.testing.assert_allclose(found, nearest.world_from_camera[:3], atol=1e-12)
    assert len(names) == 1


@pytest.mark.parametrize("name", ["plain", "split"])
def test_multipleview_has_the_frames_of_each_training_camera(sequence, tmp_path, name):
    folder = exported(sequence / name, "multipleview", tmp_path, points=300)
    model = pycolmap.Reconstruction(folder / "sparse_")
    (camera,) = model.cameras.values()
    assert [camera.width, camera.height] == FLAT["resolution"]
    # 4DGaussians takes the first of the layouts that it knows, and this is the last one.
    for other in ("sparse", "transforms_train.json", "poses_bounds.npy", "dataset.json"):
        assert not (folder / other).exists()
    views = {tuple(v.position.round(9)): v for v in source_of(sequence / name).lightfield.views}
    # 4DGaussians takes a camera's number from between "image" and a suffix of four characters.
    seen = set()
    for image in model.images.values():
        pictures = folder / f"cam{image.name[5:-4].zfill(2)}"
        matrix = image.cam_from_world().inverse().matrix() * [1, -1, -1, 1]
        seen.add(views[tuple(matrix[:, 3].round(9))].split)
        assert len([*pictures.iterdir()]) == len(FRAMES)
        for number, frame in enumerate(FRAMES, 1):
            picture = cv2.imread(str(pictures / f"frame_{number:05}.jpg"))[..., ::-1]
            assert_shows_its_frame(picture, frame, matrix, camera.focal_length_x)
    assert len(model.images) == (9 if name == "plain" else 5)
    assert seen == ({None} if name == "plain" else {"train"})
    rows = np.load(folder / "poses_bounds_multipleview.npy")
    assert rows.shape == (len(model.images), 17)
    assert (rows[:, 15] < rows[:, 16]).all()
    assert (folder / "points3D_multipleview.ply").is_file()


def test_without_a_split_the_first_camera_tests_and_all_others_train(sequence):
    views = source_of(sequence / "plain").numbered().lightfield.views
    originals = LightField.read(sequence / "plain/f00003/perspective/lightfield.json").views
    assert [view.name for view in views] == [f"cam{number:02}" for number in range(9)]
    assert [tuple(view.position) for view in views] == [tuple(v.position) for v in originals]


def test_a_frame_with_other_views_and_a_moving_camera_are_refused(sequence, tmp_path):
    shutil.copytree(sequence / "plain", tmp_path / "rig")
    file = tmp_path / "rig/f00005/perspective/lightfield.json"
    content = json.loads(file.read_text())
    for key in ("position", "rotation"):
        content["frames"][0].pop(key, None)
    content["frames"][0]["world_matrix"][0][3] += 1
    file.write_text(json.dumps(content))
    with pytest.raises(UserError, match=r"f00005.*not where they were at the first frame"):
        exported(tmp_path / "rig", "colmap_frames", tmp_path / "out", points=10)
    assert not (tmp_path / "out").exists()
    content["frames"][0]["name"] = "other"
    file.write_text(json.dumps(content))
    with pytest.raises(UserError, match=r"f00005.*has another lens or other views"):
        source_of(tmp_path / "rig")


# ---- scene flow -----------------------------------------------------------------------------

MOVES = np.array([0.3, -0.2, 0.12])
CAMERAS = {
    "pinhole": {"lens": "rectilinear", "fov": 70, "resolution": [96, 72]},
    "panorama": {"lens": "equirectangular", "resolution": [192, 96]},
}


def pixels_of_ball(lens, matrix, place):
    """Return the distance (h, w) to the sphere with a ball at a place, and where the ball is."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    position = matrix[:3, 3]
    along = rays @ position
    distance = -along + np.sqrt(along**2 + RADIUS**2 - position @ position)
    to_ball = place - position
    middle = rays @ to_ball
    with np.errstate(invalid="ignore"):
        near = middle - np.sqrt(BALL_RADIUS**2 - (to_ball @ to_ball - middle**2))
    on_ball = np.isfinite(near) & (near > 0)
    return np.where(on_ball, near, distance), on_ball


def write_moving_ball(folder, camera):
    """Write two frames in which the ball moves. Return the distance and where the ball is."""
    lens = lenses.from_camera(camera)
    rig = {"type": "plane", "cameras": [1, 1], "center": [0.1, -0.2, 0.1]}
    seen = []
    for number, way in enumerate((MOVES, -MOVES), 1):
        keys = {"depth": "distance", "frame": number, "passes": ["motion"]}
        lightfield = LightField.from_rig(rig, lens, **keys)
        (view,) = lightfield.views
        frame = folder / f"f{number:05}"
        lightfield.write(frame / "lightfield.json")
        distance, on_ball = pixels_of_ball(
            lens, view.world_from_camera, BALL + MOVES * (number - 1)
        )
        local = lens.pixel_rays() * distance[..., None]
        moved = lens.pixels(
            local + np.where(on_ball[..., None], way @ view.world_from_camera[:3, :3], 0)
        )
        centres = np.indices(distance.shape)[::-1].transpose(1, 2, 0) + 0.5
        motion = np.where(on_ball[..., None], moved - centres, 0).astype(np.float32)
        attributes = {images.DEPTH_ATTRIBUTE: "distance"}
        colour = {name: np.zeros(distance.shape, np.float16) for name in "RGB"}
        channels = colour | {"Z": distance.astype(np.float32)}
        images.write_exr(frame / f"exr/{view.name}.exr", channels, attributes)
        direction, other = ("next", "previous") if number == 1 else ("previous", "next")
        planes = {f"{direction}.{axis}": motion[..., place] for place, axis in enumerate("XY")}
        planes |= {f"{other}.{axis}": np.zeros(distance.shape, np.float32) for axis in "XY"}
        images.write_exr(frame / f"motion/{view.name}.exr", planes)
        seen.append((distance, on_ball))
    return view, seen


@pytest.mark.parametrize("camera", CAMERAS)
def test_scene_flow_is_the_motion_of_the_ball_and_0_around_it(camera, tmp_path):
    rig = tmp_path / "rig"
    view, ((_, on_ball), (_, ball_later)) = write_moving_ball(rig, CAMERAS[camera])
    settings = EXPORTERS["scene_flow"](sources=["views"])
    source = SourceSequence.of_folders(rig, ["f00001", "f00002"], "", ".exr", {})
    exports.run(source, settings, tmp_path / "flow")
    assert not (tmp_path / "flow/f00002").exists()
    image = images.read_image(tmp_path / f"flow/f00001/{view.name}.exr")
    flow = np.stack([image.channels[axis] for axis in "XYZ"], axis=-1)
    is_known = image.channels["V"] > 0
    assert (flow[~is_known] == 0).all()
    # The ball's edge is hidden by nothing, but its pixels are next to the sphere.
    assert is_known[on_ball].mean() > 0.6
    # The distance is interpolated between pixels on a curved surface.
    off = np.linalg.norm(flow - MOVES, axis=-1)[is_known & on_ball]
    assert np.median(off) < 2e-3
    assert off.max() < 0.06
    around = ~on_ball & ~ball_later
    assert is_known[around].mean() > 0.99
    assert np.abs(flow[around]).max() < 1e-5
    # The ball hides this part of the sphere in the next frame.
    assert not is_known[~on_ball & ball_later].any()


def test_scene_flow_needs_every_frame(tmp_path):
    write_moving_ball(tmp_path, CAMERAS["pinhole"])
    file = tmp_path / "f00002/lightfield.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"frame": 4}))
    source = SourceSequence.of_folders(tmp_path, ["f00001", "f00002"], "", ".exr", {})
    settings = EXPORTERS["scene_flow"](sources=["views"])
    with pytest.raises(UserError, match="frame 1 is followed by 4"):
        exports.run(source, settings, tmp_path / "flow")
