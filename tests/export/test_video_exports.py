"""Exports of light-field video show a ball that moves, at its place in every frame.

Points are lifted through the consumers' cameras. They must lie on the ball or on the sphere around
it.
"""

import json
import shutil
import subprocess
from functools import partial

import cv2
import numpy as np
import pytest
from oracles import sequence as oracle
from oracles.readers import ncore
from oracles.readers.contents import Exported
from pydantic import TypeAdapter, ValidationError
from sphere import BALL, BALL_RADIUS, LENSES, RADIUS, RED, colour_of, look_at_ball, write_views
from test_exports import ncore_pixels, of_disparity, omaf_points, opengl_points

from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.export.sequence import SourceSequence
from lightfield.exporters import EXPORTERS
from lightfield.formats.layout import frame_folders
from lightfield.formats.lightfield import LightField
from lightfield.imaging.tonemap import encode_srgb
from lightfield.products import exports
from lightfield.validation.sequence import export_lists, validate_sequence

RIG = {"type": "plane", "cameras": [2, 1], "size": 0.6, "center": [0.1, -0.2, 0.1]}
# Every second frame of the animation. With 24 of them a second, 12 are left.
NUMBERS = [3, 5, 7, 9, 11, 13]
RATE = {"rate": 24}
MOVE = np.array([0.12, -0.15, 0.05])
# The exports of a sequence, and their options.
VIDEOS = {
    "miv_frames": RATE,
    "opendibr_frames": RATE,
    "ncore_frames": RATE | {"points": 200},
}
LUMA = [0.2126, 0.7152, 0.0722]


def ball_at(index):
    """Return where the ball is in a frame of the sequence."""
    return BALL + index * MOVE


def write_sequence(folder, lens, numbers=NUMBERS, travel=(0, 0, 0), **changes):
    """Write a sequence. Return it. The rig's middle moves by ``travel`` from frame to frame."""
    for index, number in enumerate(numbers):
        center = np.add(RIG["center"], np.multiply(index, travel)).tolist()
        see = partial(look_at_ball, place=ball_at(index))
        write_views(folder / "dataset", lens, RIG | {"center": center}, see=see)
        path = folder / "dataset/lightfield.json"
        content = LightField.read(path).changed(frame=number, **changes)
        (content.with_exposure() if "render" in changes else content).write(path)
        (folder / "dataset").rename(folder / f"f{number:05}")
    return SourceSequence.of_folders(folder, frame_folders(folder), "", ".exr", {})


@pytest.fixture(scope="module")
def sequences(tmp_path_factory):
    """Sequences of still cameras, by the names of their lenses."""
    folder = tmp_path_factory.mktemp("video")
    names = ("perspective", "shifted", "panorama", "wide")
    return {name: write_sequence(folder / name, LENSES[name]) for name in names}


def exported(source, name, folder, **options):
    settings = EXPORTERS[name].model_validate({"sources": ["views"], **options})
    exports.run(source, settings, folder / name)
    return folder / name


def assert_shows(points, index, tolerance):
    """Check that points (n, 3) are on the ball of a frame, or on the sphere around it.

    Return which are on the ball.
    """
    on_ball = np.abs(np.linalg.norm(points - ball_at(index), axis=-1) - BALL_RADIUS) < tolerance
    on_sphere = np.abs(np.linalg.norm(points, axis=-1) - RADIUS) < tolerance
    assert (on_ball | on_sphere).all()
    assert 0 < on_ball.mean() < 0.8
    return on_ball


def assert_shows_luma(luma, points, on_ball, tolerance):
    """Check the luma (h, w), 0 to 1, at the points of all pixels."""
    expected = np.where(on_ball, encode_srgb(RED) @ LUMA, colour_of(points) / 255 @ LUMA)
    np.testing.assert_allclose(luma, expected, atol=tolerance)


def assert_range(camera, source, view, meaning):
    """Check that a range of depth has the nearest and the farthest depth of all frames."""
    depths = [frame.depth(frame.lightfield.views[view], meaning) for frame in source.frames]
    nearest = [np.nanmin(depth) for depth in depths]
    assert np.ptp(nearest) > 0.05
    expected = [min(nearest), max(np.nanmax(depth) for depth in depths)]
    np.testing.assert_allclose(camera["Depth_range"], expected)


@pytest.mark.parametrize("lens", ["perspective", "shifted", "panorama"])
def test_miv_has_the_depth_and_the_colour_of_each_frame(sequences, tmp_path, lens):
    source = sequences[lens]
    folder = exported(source, "miv_frames", tmp_path, **RATE)
    content = json.loads((folder / "sequence.json").read_text())
    assert (content["Fps"], content["Frames_number"]) == (12, 6)
    assert content["Content_name"] == lens
    assert len(content["cameras"]) == 2
    for number, camera in enumerate(content["cameras"]):
        assert_range(camera, source, number, "z" if lens != "panorama" else "distance")
        width, height = camera["Resolution"]
        videos = {}
        for kind, bits in (("depth", 16), ("texture", 10)):
            name = f"{camera['Name']}_{kind}_{width}x{height}_yuv420p{bits}le.yuv"
            frames = np.fromfile(folder / name, "<u2").reshape(6, width * height * 3 // 2)
            videos[kind] = frames[:, : width * height].reshape(6, height, width)
        for index in range(6):
            levels = videos["depth"][index]
            assert (levels > 0).all()
            points = omaf_points(camera, of_disparity(levels, camera, 16))
            on_ball = assert_shows(points, index, 1e-3)
            luma = (videos["texture"][index] / 4 - 16) / 219
            assert_shows_luma(luma, points, on_ball, 2e-3)


def decoded(path, camera, bits):
    """Return the luma (frames, h, w) of a video, in the order in which its frames are coded.

    OpenDIBR shows frames when they are decoded, whatever their times.
    """
    command = ["ffmpeg", "-v", "error", "-flags", "low_delay", "-i", path]
    command += ["-f", "rawvideo", "-pix_fmt", f"yuv420p{bits}le", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    width, height = camera["Resolution"]
    frames = np.frombuffer(raw, "<u2").reshape(-1, width * height * 3 // 2)
    return frames[:, : width * height].reshape(-1, height, width)


def packets(path):
    """Return the times of a video's packets in the order of the file, and its frames a second."""
    command = ["ffprobe", "-v", "error", "-of", "json", "-show_packets", "-show_streams", path]
    facts = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    rate, unit = map(int, facts["streams"][0]["r_frame_rate"].split("/"))
    return [float(packet["pts_time"]) for packet in facts["packets"]], rate / unit


@pytest.mark.parametrize("lens", ["perspective", "panorama", "wide"])
def test_opendibr_has_the_disparity_and_the_colour_of_each_frame(sequences, tmp_path, lens):
    source = sequences[lens]
    folder = exported(source, "opendibr_frames", tmp_path, **RATE)
    viewport, *cameras = json.loads((folder / "cameras.json").read_text())["cameras"]
    assert viewport["NameColor"] == "viewport"
    assert len(cameras) == 2
    for number, camera in enumerate(cameras):
        assert (camera["BitDepthColor"], camera["BitDepthDepth"]) == (10, 12)
        assert_range(camera, source, number, "z" if lens == "perspective" else "distance")
        disparity = decoded(folder / camera["NameDepth"], camera, 12)
        colour = decoded(folder / camera["NameColor"], camera, 10)
        assert len(disparity) == len(colour) == 6
        for index in range(6):
            points = opengl_points(camera, of_disparity(disparity[index], camera, 12))
            points = np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)
            seen = np.isfinite(points[..., 0])
            on_ball = assert_shows(points[seen], index, 0.01)
            luma = (colour[index][seen] / 4 - 16) / 219
            assert_shows_luma(luma, points[seen], on_ball, 3e-3)


def test_opendibr_s_videos_are_coded_in_the_order_of_time_and_have_equal_bytes(sequences, tmp_path):
    folder = exported(sequences["perspective"], "opendibr_frames", tmp_path / "first", **RATE)
    again = exported(sequences["perspective"], "opendibr_frames", tmp_path / "again", **RATE)
    videos = sorted(folder.glob("*.mp4"))
    assert len(videos) == 4
    for path in videos:
        times, rate = packets(path)
        np.testing.assert_allclose(times, np.arange(6) / 12, atol=1e-4)
        assert rate == 12
        assert (again / path.name).read_bytes() == path.read_bytes()


def dynamic_points(camera, levels):
    """Return the points of all pixels, as dyn-lf-renderer's depth_processor.py computes them.

    ``levels`` (h, w) have 10 bits.
    """
    near, far = camera["Depth_range"]
    z = 1 / (1 / far + levels / 1023 * (1 / near - 1 / far))
    (fx, fy), (cx, cy) = camera["Focal"], camera["Principal_point"]
    width, height = camera["Resolution"]
    x = z * ((np.arange(width) + 0.5 - cx) / fx)
    y = z * ((np.arange(height) + 0.5 - cy) / fy).reshape(-1, 1)
    points = np.stack([x, y, z, np.ones_like(z)], axis=-1) @ np.transpose(camera["model"])
    return points[..., :3]


@pytest.mark.parametrize("lens", ["perspective", "shifted", "panorama"])
def test_dyn_lf_renderer_gets_its_own_list_of_perspective_videos(sequences, tmp_path, lens):
    folder = exported(sequences[lens], "opendibr_frames", tmp_path, **RATE)
    path = folder / "opendibr_frames.json"
    assert path.exists() == (lens != "panorama")
    cameras = json.loads(path.read_text())["cameras"] if path.exists() else []
    for camera in cameras:
        assert (folder / camera["NameColor"]).is_file()
        # Its script decompress_depth.sh makes 10 bits of these.
        depth = decoded(folder / camera["NameDepth"], camera, 10)
        for index in range(6):
            points = dynamic_points(camera, depth[index].astype(float))
            points = np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)
            assert_shows(points, index, 0.03)


def ncore_points(store, time):
    """Return the points and the colours that the lidar measures at a time."""
    frame = f"lidars/points/frames/{time}"
    directions = store.array(f"{frame}/ray_bundle/direction").astype(float)
    assert (store.array(f"{frame}/ray_bundle/timestamp_us") == time).all()
    distances = store.array(f"{frame}/ray_bundle_returns/distance_m")[0].astype(float)
    return directions * distances[:, None], store.array(f"{frame}/generic_data/rgb")


def can_be_seen(points, on_ball, place, ball):
    """Return which points (n, 3) a camera sees clear of the ball's edge and not behind it."""
    distances = np.linalg.norm(points - place, axis=1)
    rays = (points - place) / distances[:, None]
    along = rays @ (ball - place)
    beside = np.sqrt((ball - place) @ (ball - place) - along**2)
    in_front = on_ball & (beside < 0.8 * BALL_RADIUS) & (distances < along)
    return in_front | (~on_ball & (beside > 1.2 * BALL_RADIUS))


@pytest.mark.parametrize("lens", ["perspective", "wide"])
@pytest.mark.parametrize("travel", [(0, 0, 0), (0.05, 0.02, -0.03)])
def test_ncore_has_times_cameras_and_points_of_each_frame(sequences, tmp_path, lens, travel):
    source = sequences[lens]
    if any(travel):
        source = write_sequence(tmp_path / "moving", LENSES[lens], travel=travel)
    folder = exported(source, "ncore_frames", tmp_path, points=400, **RATE)
    sequence = json.loads((folder / "views.json").read_text())
    (entry,) = sequence["component_stores"]
    store = ncore.Store(folder / entry["path"], Exported())
    # Two frames of the animation, of 24 a second, after one another.
    times = [0, 83333, 166667, 250000, 333333, 416667]
    assert sequence["sequence_timestamp_interval_us"] == {"start": 0, "stop": 416668}
    measured = store.attributes("lidars/points/frames")["frames_timestamps_us"]
    assert measured == [[time, time] for time in times]
    assert sorted(entry["components"]["cameras"]) == ["view_0000f", "view_0001f"]
    for camera in entry["components"]["cameras"]:
        frames = store.attributes(f"cameras/{camera}/frames")["frames_timestamps_us"]
        poses = store.attributes("poses/default/dynamic_poses")[f"('{camera}', 'world')"]
        assert frames == [[time, time] for time in times]
        assert poses["timestamps_us"] == times
        intrinsics = store.attributes(f"intrinsics/default/cameras/{camera}")
        for index, time in enumerate(times):
            pose = np.array(poses["poses"][index])
            expected = LightField.read(source.frames[index].dataset / "lightfield.json")
            (view,) = [view for view in expected.views if view.name == camera]
            np.testing.assert_array_equal(pose @ np.diag([1, -1, -1, 1]), view.world_from_camera)
            points, colours = ncore_points(store, time)
            assert len(points) == 400
            on_ball = assert_shows(points, index, 1e-5)
            shown = np.where(on_ball[:, None], 255 * encode_srgb(RED), colour_of(points))
            np.testing.assert_allclose(colours, shown, atol=6)
            frame = f"cameras/{camera}/frames/{time}"
            png = store.array(f"{frame}/image").tobytes()
            picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            height, width = picture.shape[:2]
            pixels = ncore_pixels(intrinsics, (points - pose[:3, 3]) @ pose[:3, :3])
            with np.errstate(invalid="ignore"):
                inside = ((pixels >= 0) & (pixels < [width, height])).all(axis=1)
            inside &= can_be_seen(points, on_ball, pose[:3, 3], ball_at(index))
            column, row = np.floor(pixels[inside]).astype(int).T
            is_valid = np.ones(len(row), bool)
            if lens == "wide":
                is_valid = store.array(f"{frame}/generic_data/mask")[row, column] > 0
            assert is_valid.sum() > 50
            seen = picture[row, column][is_valid]
            np.testing.assert_allclose(seen, shown[inside][is_valid], atol=6)


def test_an_ncore_camera_that_moves_is_exposed_for_half_a_frame_of_the_animation(tmp_path):
    motion = {"camera_motion": {"travel": [0.2, 0, 0.1], "turn": [0, 20, 5]}}
    source = write_sequence(tmp_path / "rig", LENSES["wide"], numbers=[1, 2], render=motion)
    folder = exported(source, "ncore_frames", tmp_path, points=50, rate=25)
    store = ncore.Store(folder / "views.ncore4.zarr", Exported())
    poses = store.attributes("poses/default/dynamic_poses")["('view_0000f', 'world')"]
    at_time = dict(zip(poses["timestamps_us"], np.array(poses["poses"]), strict=True))
    frames = store.attributes("cameras/view_0000f/frames")["frames_timestamps_us"]
    assert frames == [[10000, 10000], [50000, 50000]]
    for index, (time, _) in enumerate(frames):
        about = store.attributes(f"cameras/view_0000f/frames/{time}/generic_data")
        assert about["exposure_us"] == [time - 10000, time + 10000]
        view = source.frames[index].lightfield.views[0]
        for moment, expected in zip(
            [time, *about["exposure_us"]], [view.world_from_camera, *view.exposure], strict=True
        ):
            found = at_time[moment] @ np.diag([1, -1, -1, 1])
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_view_with_a_name_of_ncore_s_own_is_refused(tmp_path):
    write_sequence(tmp_path / "rig", LENSES["perspective"], numbers=[1, 2])
    for path in (tmp_path / "rig").glob("*/lightfield.json"):
        change_json(path, lambda content: content["frames"][1].update(name="points"))
    folders = frame_folders(tmp_path / "rig")
    source = SourceSequence.of_folders(tmp_path / "rig", folders, "", ".exr", {})
    problem = r"f00001/lightfield.json: frames: NCore has a points itself; give the camera another"
    with pytest.raises(UserError, match=problem):
        exported(source, "ncore_frames", tmp_path)
    assert not (tmp_path / "ncore_frames").exists()


@pytest.mark.parametrize("name", ["miv_frames", "opendibr_frames"])
def test_video_refuses_moving_cameras_and_frames_at_unequal_steps(sequences, tmp_path, name):
    moving = write_sequence(tmp_path / "moving", LENSES["perspective"], [1, 2], (0.1, 0, 0))
    problem = r"f00002/lightfield.json: frames: its cameras are not where they were at the first"
    with pytest.raises(UserError, match=problem):
        exported(moving, name, tmp_path)
    uneven = write_sequence(tmp_path / "uneven", LENSES["perspective"], [1, 2, 5])
    with pytest.raises(UserError, match=r"uneven: frames: are 1, 2, 5; .* equal steps"):
        exported(uneven, name, tmp_path)
    with pytest.raises(UserError, match=r"rig: has 1 frames; a sequence must have at least two"):
        SourceSequence.of_folders(tmp_path / "rig", ["f00001"], "", ".exr", {})
    assert not (tmp_path / name).exists()


def test_opendibr_s_videos_need_ffmpeg_that_writes_h265(sequences, tmp_path, monkeypatch):
    programs = tmp_path / "bin"
    programs.mkdir()
    monkeypatch.setenv("PATH", str(programs))
    with pytest.raises(UserError, match=r"lightfield.json: becomes H.265, for which ffmpeg must"):
        exported(sequences["perspective"], "opendibr_frames", tmp_path)
    # An ffmpeg without the encoder.
    (programs / "ffmpeg").write_text("#!/bin/sh\necho \"Unknown encoder 'libx265'\" >&2\nexit 1\n")
    (programs / "ffmpeg").chmod(0o755)
    problem = r"_texture.mp4: ffmpeg cannot write H.265 of 10 bits: Unknown encoder 'libx265'"
    with pytest.raises(UserError, match=problem) as error:
        exported(sequences["perspective"], "opendibr_frames", tmp_path)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "opendibr_frames").exists()


@pytest.mark.parametrize(
    ("name", "camera", "last", "problem"),
    [
        ("miv_frames", LENSES["perspective"] | {"resolution": [64, 47]}, 2, "use even sizes"),
        ("opendibr_frames", LENSES["perspective"] | {"resolution": [63, 48]}, 2, "use even sizes"),
        *(
            (name, LENSES["perspective"], 1, "has fewer than two frames")
            for name in ("miv_frames", "opendibr_frames", "ncore_frames")
        ),
        ("miv_frames", LENSES["wide"], 2, "has a lens that MIV lacks"),
        ("ncore_frames", LENSES["panorama"], 2, "has a lens that NCore lacks"),
    ],
)
def test_a_scene_yaml_with_an_impossible_video_is_refused(name, camera, last, problem):
    content = {
        "scene": {"blend": "a.blend"},
        "render": {"samples": 1},
        "rigs": {"LF": RIG | {"camera": camera, "frames": {"first": 1, "last": last}}},
        "exports": {name: {"sources": ["views"]}},
    }
    said = f"exports.{name}.sources: views: the rig LF .*{problem}"
    with pytest.raises(ValidationError, match=said):
        TypeAdapter(Scene).validate_python(content)


# ---- the oracles ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def exported_rig(sequences, tmp_path_factory):
    """A rig's folder with a sequence and its three exports."""
    rig = tmp_path_factory.mktemp("exported") / "rig"
    shutil.copytree(sequences["perspective"].dataset, rig)
    source = SourceSequence.of_folders(rig, frame_folders(rig), "", ".exr", {})
    for name, options in VIDEOS.items():
        exported(source, name, rig / "exports", **options)
    return rig


def problems(rig):
    """Return what validation and the oracles say of the exports."""
    result = validate_sequence(rig, frame_folders(rig), export_lists(rig))
    return [line for check in result.checks for line in check.problems] + oracle.faults(rig)


def test_correct_videos_are_valid(exported_rig):
    assert {path.parent.name for path in export_lists(exported_rig)} == set(VIDEOS)
    assert problems(exported_rig) == []


def change_json(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def rate_of_the_animation(folder):
    change_json(folder / "miv_frames/sequence.json", lambda content: content.update(Fps=24))


def range_of_the_first_frame(folder):
    def change(content):
        content["cameras"][0]["Depth_range"][0] += 0.2

    change_json(folder / "miv_frames/sequence.json", change)


def frames_in_another_order(folder):
    path = folder / "miv_frames/view_0001f_depth_64x48_yuv420p16le.yuv"
    frames = np.fromfile(path, "<u2").reshape(6, -1)
    frames[[0, 1, 2, 4, 3, 5]].tofile(path)


def short_video(folder):
    videos = sorted((folder / "opendibr_frames").glob("*.mp4"))
    options = ["-frames:v", "5", "-c", "copy", "-y", videos[0]]
    subprocess.run(["ffmpeg", "-v", "error", "-i", videos[1], *options], check=True)


def swapped_cameras(folder):
    def change(content):
        first, second = content["cameras"][1:]
        first["Position"], second["Position"] = second["Position"], first["Position"]

    change_json(folder / "opendibr_frames/cameras.json", change)


def points_of_another_frame(folder):
    frames = folder / "ncore_frames/views.ncore4.zarr/lidars/points/frames"
    for name in ("ray_bundle/direction/0.0", "ray_bundle_returns/distance_m/0.0"):
        shutil.copy(frames / "0" / name, frames / "83333" / name)


@pytest.mark.parametrize(
    ("change", "file", "said"),
    [
        (rate_of_the_animation, "miv_frames/sequence.json: Fps", "is 24; must be 12.0"),
        (range_of_the_first_frame, "miv_frames/sequence.json: cameras[0]", "but depth goes from"),
        (frames_in_another_order, "view_0001f_depth", "has another depth than its view in"),
        (short_video, "opendibr_frames/view_0000f_depth.mp4: pictures", "is 5; must be 6"),
        (swapped_cameras, "opendibr_frames/cameras.json: cameras[1]", "its position is"),
        (points_of_another_frame, "83333/ray_bundle", "is not a point of a view's depth"),
    ],
)
def test_what_is_wrong_in_a_video_is_named(change, file, said, exported_rig, tmp_path):
    rig = shutil.copytree(exported_rig, tmp_path / "rig")
    change(rig / "exports")
    lines = problems(rig)
    assert any(file in line and said in line for line in lines), lines
