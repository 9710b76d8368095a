"""Exports of a sequence are checked: each frame has its own cameras, times, points and flow."""

import json
import shutil
from contextlib import contextmanager

import cv2
import numpy as np
import pytest
import test_sequence_exports
from oracles import sequence as sequence_oracle
from oracles.readers.mp4 import read_mp4
from test_sequence_exports import CAMERAS, FRAMES, source_of, write_moving_ball

from lightfield.core.files import sha256
from lightfield.export.sequence import SourceSequence
from lightfield.exporters import EXPORTERS
from lightfield.formats.layout import frame_folders
from lightfield.imaging import images
from lightfield.products import exports
from lightfield.validation.sequence import (
    export_lists,
    remove_strays,
    validate_sequence,
)
from lightfield.validation.verification import faults

sequence = test_sequence_exports.sequence
KINDS = ("dnerf", "neural_3d_video", "colmap_frames", "multipleview", "ncore_frames")
POINTS = {"points": 200}


@contextmanager
def video(path, size, rate, **options):
    """Write a video with OpenCV, so that these tests need no ffmpeg."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), rate, size)
    yield lambda picture: writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()


@pytest.fixture(scope="module")
def rigs(sequence, tmp_path_factory):
    """The sequence's rigs with all exports of the views that have no flow."""
    folder = tmp_path_factory.mktemp("exported")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lightfield.imaging.video.video", video)
        patch.setattr("shutil.which", lambda name: name)
        for name in ("plain", "split"):
            shutil.copytree(sequence / name, folder / name)
            source = source_of(folder / name)
            for kind in KINDS:
                settings = EXPORTERS[kind](sources=["perspective"], **POINTS)
                exports.run(source, settings, folder / name / "perspective/exports" / kind)
    return folder


@pytest.fixture
def rig(rigs, tmp_path):
    return shutil.copytree(rigs / "split", tmp_path / "scene" / "split")


@pytest.fixture(scope="module")
def flow(tmp_path_factory):
    """A rig with scene flow between its two frames, and the file of the flow."""
    rig = tmp_path_factory.mktemp("flow") / "rig"
    view, _ = write_moving_ball(rig, CAMERAS["panorama"])
    source = SourceSequence.of_folders(rig, frame_folders(rig), "", ".exr", {})
    settings = EXPORTERS["scene_flow"](sources=["views"])
    exports.run(source, settings, rig / "exports/scene_flow")
    return rig, f"exports/scene_flow/f00001/{view.name}.exr"


def problems(rig):
    """Return what validation and the oracles say of a sequence."""
    result = validate_sequence(rig, frame_folders(rig), export_lists(rig))
    lines = [line for check in result.checks for line in check.problems]
    assert result.valid == (not lines)
    return [*lines, *sequence_oracle.faults(rig)]


@pytest.mark.parametrize("name", ["plain", "split"])
def test_correct_exports_of_a_sequence_are_valid(rigs, name):
    assert len(export_lists(rigs / name)) == len(KINDS)
    assert problems(rigs / name) == []


def test_a_sequence_behind_links_is_valid_and_has_the_same_sums(rigs, rig, tmp_path):
    def sums():
        return validate_sequence(rig, frame_folders(rig), export_lists(rig)).checksums

    expected = sums()
    disk = tmp_path / "disk"
    disk.mkdir()
    for place in (frame_folders(rig)[0], "perspective/exports/dnerf", "perspective"):
        shutil.move(rig / place, disk / place.replace("/", "_"))
        (rig / place).symlink_to(disk / place.replace("/", "_"))
    assert problems(rig) == []
    assert sums() == expected
    shutil.move(rig, disk / "rig")
    rig.symlink_to(disk / "rig")
    assert problems(rig) == []
    assert sums() == expected
    (disk / "perspective/mine.txt").write_text("mine")
    lists = export_lists(rig)
    remove_strays(rig, frame_folders(rig), lists, tmp_path / "removed")
    assert (disk / "perspective/mine.txt").is_file()
    (problem,) = problems(rig)
    assert problem.startswith("perspective/mine.txt: is not a file of this sequence; remove it")


def test_correct_scene_flow_is_valid(flow):
    assert problems(flow[0]) == []


def change_json(path, change):
    content = json.loads(path.read_text())
    change(content["frames"])
    path.write_text(json.dumps(content))


def wrong_time(rig):
    change_json(rig / "dnerf/transforms_train.json", lambda frames: frames[-1].update(time=0.9))


def picture_of_another_frame(rig):
    def change(frames):
        frames[-1]["file_path"] = frames[0]["file_path"]

    change_json(rig / "dnerf/transforms_test.json", change)


def moved_camera(rig):
    def change(frames):
        frames[2]["transform_matrix"][0][3] += 0.01

    change_json(rig / "dnerf/transforms_train.json", change)


def swapped_parts(rig):
    lists = [rig / f"dnerf/transforms_{part}.json" for part in ("train", "test")]
    train, test = (json.loads(path.read_text()) for path in lists)
    train["frames"][-1], test["frames"][-1] = test["frames"][-1], train["frames"][-1]
    for path, content in zip(lists, (train, test), strict=True):
        path.write_text(json.dumps(content))


def moved_point(rig):
    path = rig / "dnerf/fused.ply"
    content = path.read_bytes()
    start = content.index(b"end_header\n") + len(b"end_header\n")
    x = np.frombuffer(content, "<f4", 1, start) + np.float32(0.1)
    path.write_bytes(content[:start] + x.tobytes() + content[start + 4 :])


def swapped_videos(rig):
    poses = np.load(rig / "neural_3d_video/poses_bounds.npy")
    np.save(rig / "neural_3d_video/poses_bounds.npy", poses[[1, 0, *range(2, len(poses))]])


def long_focus(rig):
    poses = np.load(rig / "neural_3d_video/poses_bounds.npy")
    poses[0, 14] += 1
    np.save(rig / "neural_3d_video/poses_bounds.npy", poses)


def short_video(rig):
    with video(rig / "neural_3d_video/cam02.mp4", (64, 48), 30) as add:
        add(np.zeros((48, 64, 3), np.uint8))


def points_of_another_frame(rig):
    for name in ("points3D", "images"):
        file = f"sparse/0/{name}.bin"
        shutil.copy(rig / "colmap_frames/colmap_0" / file, rig / "colmap_frames/colmap_1" / file)


def swapped_cameras(rig):
    first, second = (rig / f"multipleview/sparse_/{name}.bin" for name in ("images", "old"))
    content = first.read_bytes()
    first.rename(second)
    changed = content.replace(b"image1.png", b"imageX.png").replace(b"image2.png", b"image1.png")
    first.write_bytes(changed.replace(b"imageX.png", b"image2.png"))
    second.unlink()


def missing_frame(rig):
    (rig / "multipleview/cam02/frame_00003.jpg").unlink()


def small_frame(rig):
    images.write_jpeg(rig / "multipleview/cam02/frame_00003.jpg", np.zeros((8, 8, 3), np.uint8))


def missing_image(rig):
    (rig / "colmap_frames/colmap_2/images/cam01.png").unlink()


@pytest.mark.parametrize(
    ("change", "file", "said"),
    [
        (wrong_time, "dnerf/transforms_train.json: frames[", "times must"),
        (picture_of_another_frame, "transforms_test.json: frames[", "must be f00011_"),
        (moved_camera, "transforms_train.json: frames[2]", "its position is 0.01 m"),
        (swapped_parts, "transforms_train.json: frames of f00011", "lacks view_"),
        (moved_point, "dnerf/fused.ply: vertex 0", "is not a point of a view's depth"),
        (swapped_videos, "poses_bounds.npy: row 0 (cam00)", "its position"),
        (long_focus, "poses_bounds.npy: row 0", "its camera has rays up to"),
        (short_video, "cam02.mp4: pictures", "is 1; must be 3"),
        (points_of_another_frame, "colmap_1/sparse/0/points3D.bin", "is not a point of a view's"),
        (swapped_cameras, "multipleview/sparse_/images.bin: image 1 (image2)", "its position"),
        (missing_frame, "multipleview/cam02", "must have frame_00001.jpg to frame_00003.jpg"),
        (small_frame, "multipleview/cam02/frame_00003.jpg", "size of its view"),
        (missing_image, "colmap_2", "cam01.png is not a file"),
    ],
)
def test_what_is_wrong_in_an_export_of_a_sequence_is_named(change, file, said, rig):
    change(rig / "perspective/exports")
    lines = problems(rig)
    assert any(file in line and said in line for line in lines), lines


def test_flow_that_the_pass_motion_contradicts_is_named(flow, tmp_path):
    rig = shutil.copytree(flow[0], tmp_path / "rig")
    channels = dict(images.read_image(rig / flow[1]).channels)
    channels["X"] = np.where(channels["V"] > 0, channels["X"] + 0.1, 0).astype(np.float32)
    images.write_exr(rig / flow[1], channels)
    assert any(flow[1] in line and "do not move as" in line for line in problems(rig))
    (rig / flow[1]).unlink()
    assert any("f00001/view_0000f.exr: is missing" in line for line in problems(rig))


def test_the_length_of_a_video_is_read_without_its_pictures(tmp_path):
    with video(tmp_path / "cam00.mp4", (64, 48), 25) as add:
        for _ in range(7):
            add(np.zeros((48, 64, 3), np.uint8))
    facts = read_mp4(tmp_path / "cam00.mp4")
    assert (facts.width, facts.height, facts.pictures) == (64, 48, 7)
    assert facts.rate == pytest.approx(25)


def test_the_program_writes_sums_that_a_copy_of_the_sequence_is_checked_by(
    rig, run_program, tmp_path
):
    former = rig / "exports/dnerf/transforms_train.json"
    former.parent.mkdir(parents=True)
    former.write_text("{}")
    validation, sums = (rig / name for name in ("validation.json", "sha256sums.txt"))
    arguments = (rig, "--removed", tmp_path / "removed", "--output", validation, "--sums", sums)
    said = run_program("validate_sequence.py", *arguments).stdout
    assert "1 files that are no longer its own" in said
    assert not former.exists()
    assert json.loads(validation.read_text())["valid"] is True
    listed = dict(line.split("  ")[::-1] for line in sums.read_text().splitlines())
    files = {path.relative_to(rig).as_posix(): path for path in rig.rglob("*") if path.is_file()}
    of_sequence = {
        name: path for name, path in files.items() if name.split("/")[0] == "perspective"
    }
    assert listed == {name: sha256(path) for name, path in of_sequence.items()} | {
        "validation.json": sha256(validation)
    }
    shutil.copytree(rig, tmp_path / "copy")
    # Each frame is a dataset, and has no checksums here.
    lists = [tmp_path / f"copy/f{frame:05}/sha256sums.txt" for frame in FRAMES]
    frames = {str(path): "is missing" for path in lists}
    assert faults(tmp_path / "copy") == frames
    damaged = tmp_path / "copy/perspective/exports/neural_3d_video/cam01.mp4"
    damaged.write_bytes(damaged.read_bytes()[:-1])
    (tmp_path / "copy/exports").mkdir()
    (tmp_path / "copy/exports/mine.txt").write_text("mine")
    found = faults(tmp_path / "copy")
    assert found.keys() - frames == {str(damaged), str(tmp_path / "copy/exports/mine.txt")}
    said = run_program("verify.py", tmp_path / "copy", check=False)
    assert "cam01.mp4" in said.stdout


def test_the_program_writes_no_sums_of_a_sequence_that_is_not_valid(rig, run_program):
    (rig / "perspective/exports/dnerf/fused.ply").unlink()
    arguments = (rig, "--output", rig / "validation.json", "--sums", rig / "sha256sums.txt")
    said = run_program("validate_sequence.py", *arguments, check=False)
    assert said.returncode == 1
    assert "fused.ply is not a file" in said.stderr
    assert "Traceback" not in said.stderr
    assert not (rig / "sha256sums.txt").exists()
