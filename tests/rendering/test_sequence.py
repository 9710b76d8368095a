"""Sequences: every frame of an animation is a dataset of its own in its rig's folder."""

import json
import re
import tarfile

import numpy as np
import pytest
import yaml
from checkouts import checkout, planned, snakemake

from lightfield.configuration import config_file, scene_yaml
from lightfield.core.errors import UserError
from lightfield.imaging import images
from lightfield.planning.loading import load_datasets, scene_datasets

SCENE = """
scene: {builder: garden, parameters: {detail: 0.02}, frame: 5}
render: {samples: 16}
rigs:
  LFStill:
    type: plane
    cameras: [2, 1]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
  LFSequence:
    type: lattice
    cameras: [1, 1, 1]
    center: [0, 0, 1]
    frames: {first: 1, last: 17, step: 8}
    camera: {lens: equirectangular, resolution: [144, 72]}
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 90, resolution: [8, 8]}
"""
FRAMES = ["LFSequence/f00001", "LFSequence/f00009", "LFSequence/f00017"]


@pytest.fixture
def moving(tmp_path, monkeypatch):
    (tmp_path / "moving.yaml").write_text(SCENE)
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    return tmp_path / "moving.yaml"


def test_each_frame_is_a_dataset_in_the_rigs_folder(moving):
    datasets = scene_datasets("moving")
    assert [(d.rig_folder, d.source.frame) for d in datasets] == [
        ("LFStill", 5),
        *zip(FRAMES, (1, 9, 17), strict=True),
    ]
    assert {dataset.rig_name for dataset in datasets} == {"LFStill", "LFSequence"}
    settings = {"scenes": ["moving"], "preset": "full", "presets": {"full": {}}}
    chosen = load_datasets(config_file.load_config({**settings, "rigs": ["LFSequence"]}))
    assert [dataset.rig_folder for dataset in chosen] == FRAMES


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"frames": {"first": 3, "last": 2}}, "LFSequence.frames: first is 3; must be at most"),
        ({"frames": {"first": 1}}, "LFSequence.frames: is missing the key last"),
        (
            {"frames": {"first": 1, "last": 2, "step": 0}},
            "frames.step: is 0; must be a whole number at least",
        ),
        ({"frames": 3}, "LFSequence.frames: is 3; must be a mapping"),
    ],
)
def test_a_wrong_sequence_is_refused(change, expected, moving):
    content = yaml.safe_load(SCENE)
    content["rigs"]["LFSequence"] |= change
    moving.write_text(yaml.safe_dump(content))
    with pytest.raises(UserError) as caught:
        scene_yaml.read_scene(moving)
    assert expected in str(caught.value)


def test_a_reprojection_cannot_have_a_frames_folder(moving):
    moving.write_text(SCENE.replace("perspective:", "f00001:"))
    with pytest.raises(UserError, match=r"reprojections\.f00001: the name f00001 is taken"):
        scene_yaml.read_scene(moving)


@pytest.mark.slow
def test_every_stage_is_planned_for_every_frame(tmp_path):
    folder = checkout(tmp_path, moving=SCENE)
    jobs = planned(folder, "package", "--config", "scenes=[moving]", "rigs=all", "preset=full")
    assert jobs["build_scene"] == jobs["inventory"] == 1
    for name in ("lightfield", "check_cameras", "render", "reproject", "validate"):
        assert jobs[name] == 4
    # One archive has all frames of a sequence.
    assert jobs["pack"] == 2
    jobs = planned(folder, "--config", "scenes=[moving]", "rigs=all", "preset=full")
    # One page has all frames, and each frame has a page.
    assert (jobs["page"], jobs["sequence_page"]) == (4, 1)


@pytest.mark.slow
def test_a_forecast_has_a_row_for_all_frames_of_a_sequence(tmp_path):
    folder = checkout(tmp_path, moving=SCENE)
    result = snakemake(
        folder, "package", "-n", "--config", "scenes=[moving]", "rigs=all", "preset=full"
    )
    rows = [line.split() for line in result.stdout.splitlines()]
    views = {row[0]: row[2] for row in rows if row and re.fullmatch(r"moving/\w+", row[0])}
    assert views == {"moving/LFStill": "2", "moving/LFSequence": "3"}


TRAINED = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFPair:
    type: plane
    cameras: [2, 1]
    size: 0.5
    center: [0, 0, 1.2]
    frames: {first: 2, last: 3}
    camera: {lens: rectilinear, fov: 70, resolution: [16, 16]}
exports:
  dnerf: {sources: [views], points: 20}
  miv_frames: {sources: [views], rate: 24}
  opendibr_frames: {sources: [views], rate: 24}
  ncore_frames: {sources: [views], points: 20, rate: 24}
  poses_csv: {sources: [views]}
report: {panorama: false}
"""


@pytest.mark.slow
def test_all_frames_go_into_one_export_of_the_sequence(tmp_path):
    folder = checkout(tmp_path, moving=TRAINED)
    arguments = ("package", "--config", "scenes=[moving]", "rigs=all", "preset=full")
    assert planned(folder, *arguments)["export_sequence"] == 4
    result = snakemake(folder, "--cores", "2", *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    # A package has the walk of the first frame's page.
    ends = [line for line in result.stderr.splitlines() if line.startswith(("valid: ", "packed: "))]
    assert ends == [
        "valid: results/moving/LFPair/f00002/report/index.html",
        "packed: results/moving/moving_LFPair.tar",
    ]
    rig = folder / "results/moving/LFPair"
    lists = {path.name for path in rig.glob("exports/dnerf/*.json")}
    parts = ("train", "val", "test")
    assert lists == {"export.json", *(f"transforms_{part}.json" for part in parts)}
    content = json.loads((rig / "exports/dnerf/transforms_train.json").read_text())
    assert [frame["time"] for frame in content["frames"]] == [0, 1]
    assert json.loads((rig / "exports/miv_frames/sequence.json").read_text())["Fps"] == 24
    assert len([*rig.glob("exports/opendibr_frames/*.mp4")]) == 4
    sequence = json.loads((rig / "exports/ncore_frames/views.json").read_text())
    # The second frame is a 24th of a second after the first.
    assert sequence["sequence_timestamp_interval_us"] == {"start": 0, "stop": 41668}
    # Other exports are made frame by frame.
    assert len([*rig.glob("f0000?/exports/poses_csv/poses.csv")]) == 2
    with tarfile.open(folder / "results/moving/moving_LFPair.tar") as archive:
        assert "moving_LFPair/exports/dnerf/transforms_test.json" in archive.getnames()
        card = json.load(archive.extractfile("moving_LFPair/card.json"))
    assert "exports/dnerf" in card["loaders"]
    assert json.loads((rig / "validation.json").read_text())["valid"] is True
    assert "exports/dnerf/transforms_test.json" in (rig / "sha256sums.txt").read_text()
    damaged = rig / "exports/dnerf" / f"{content['frames'][0]['file_path']}.png"
    damaged.write_bytes(b"")
    verified = snakemake(folder, "verify", "--config", "scenes=[moving]", "rigs=all", "preset=full")
    assert verified.returncode == 1
    assert damaged.name in verified.stdout + verified.stderr
    assert planned(folder, *arguments)["export_sequence"] == 1
    assert snakemake(folder, "--cores", "2", *arguments).returncode == 0
    assert damaged.stat().st_size > 0
    plan = snakemake(folder, "-n", *arguments)
    assert "Nothing to be done" in plan.stdout + plan.stderr
    result = snakemake(folder, "--cores", "2", "report_html", *arguments[1:])
    assert result.returncode == 0, result.stdout + result.stderr
    # A build shows the page of all frames, which is no file of their exports.
    assert "valid: results/moving/LFPair/report/sequence.html" in result.stderr.splitlines()
    page = (rig / "report/sequence.html").read_text()
    assert all(f"../{name}/report/index.html" in page for name in ("f00002", "f00003"))
    checked = snakemake(folder, "verify", "--config", "scenes=[moving]", "rigs=all", "preset=full")
    assert checked.returncode == 0, checked.stdout + checked.stderr


# Without the map of the sky by which Cycles sends its rays to bright parts. It would take most of
# the time of these small renders.
GARDEN = """
import sys
from pathlib import Path
import bpy
from lightfield.rendering.scenes import blend_file
from scenes import garden
blend_file.new_scene()
garden.build({"seed": 0, "detail": 0.02})
bpy.context.scene.world.cycles.sampling_method = "NONE"
blend_file.save_scene(Path(sys.argv[1]))
"""


def test_fire_and_water_move_and_the_rest_stands_still(run_program, tmp_path):
    folder = checkout(tmp_path, moving=SCENE)
    blend, inventory = tmp_path / "garden.blend", tmp_path / "inventory.json"
    (tmp_path / "program.py").write_text(GARDEN)
    run_program(tmp_path / "program.py", blend)
    run_program("inventory.py", "--blend", blend, "--output", inventory)
    colours, depths = [], []
    for rig in (FRAMES[0], FRAMES[2]):
        lightfield, output = tmp_path / rig / "lightfield.json", tmp_path / rig / "exr"
        program = folder / "scripts" / "make_lightfield.py"
        run_program(program, "--scene", "moving", "--rig", rig, "--output", lightfield)
        assert json.loads(lightfield.read_text())["frame"] == int(rig[-5:])
        arguments = ("--blend", blend, "--inventory", inventory, "--lightfield", lightfield)
        run_program("render_shard.py", *arguments, "--output", output, "--threads", "1")
        image = images.read_image(output / "view_0000f.exr")
        colours.append(np.stack([image.channels[c] for c in "RGB"]).astype(np.float64).sum(axis=0))
        depths.append(image.channels["Z"])
    changed = np.abs(colours[0] - colours[1]) / (colours[0] + colours[1] + 1e-9)

    def around(x, y, z):
        """Return the mean change within 6 degrees of a point, seen from the panorama."""
        column = (0.5 + np.arctan2(x, y) / (2 * np.pi)) * 144
        row = (0.5 - np.arctan2(z - 1, np.hypot(x, y)) / np.pi) * 72
        rows, columns = np.ogrid[:72, :144]
        near = np.maximum(abs(rows - row), abs((columns - column + 72) % 144 - 72)) < 2.5
        return changed[near].mean()

    from_scene = {"fire": (3.1, 1.1, 0.7), "water": (-5.5, 0.6, -0.07), "statue": (0, 3.75, 1.2)}
    change = {name: around(*place) for name, place in from_scene.items()}
    assert min(change["fire"], change["water"]) > 10 * change["statue"]
    assert np.median(changed) < 0.01
    # Nothing solid moves. Only rays through the moving water differ.
    assert np.mean(depths[0] != depths[1]) < 0.01
