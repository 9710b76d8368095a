"""Views that somebody else rendered, in SILVR's published layout, become a dataset."""

import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import exr_windows
import forks
import numpy as np
import OpenImageIO as oiio
import pytest
from checkouts import ROOT, planned, snakemake
from pydantic import TypeAdapter
from sphere import write_views

from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy, sha256
from lightfield.engine import receipts
from lightfield.formats.published import lightfields
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.planning.loading import scene_datasets
from lightfield.settings.base import checked
from lightfield.stages.registry import VERSIONS
from lightfield.stages.views import ImportViews
from lightfield.workflow.check import JobCheck

RIG = {"type": "plane", "cameras": [2, 2], "size": 0.4, "center": [0.3, -0.2, 0.1]}
VIEWS = {"lens": "equidistant", "fov": 180, "resolution": [48, 48]}
YAML = """
scene: {dataset: published}
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 90, resolution: [24, 24]}
    format: exr
exports:
  instant_ngp: {sources: [perspective], depth: true}
"""

# Runs Snakemake, then writes how often it listed each folder.
COUNTING = """
import atexit, collections, json, os, sys
listings = collections.Counter()
def count(event, arguments):
    if event in ("os.listdir", "os.scandir") and not isinstance(arguments[0], int):
        listings[os.path.relpath(os.fsdecode(arguments[0] or "."))] += 1
sys.addaudithook(count)
atexit.register(lambda: json.dump(listings, open("listings.json", "w")))
from snakemake.cli import main
main(sys.argv[1:])
"""


@pytest.fixture
def published(tmp_path):
    """A folder with one rig's views as SILVR publishes them: half depth, and none of our files."""
    folder = tmp_path / "published" / "LFPlane"
    write_views(folder, VIEWS, RIG)
    content = json.loads((folder / "lightfield.json").read_text())
    del content["depth"]
    (folder / "lightfield.json").write_text(json.dumps(content))
    for path in folder.glob("*.exr"):
        channels = images.read_image(path).channels
        nothing = np.isnan(channels["Z"])
        half = {name: pixels.astype(np.float16) for name, pixels in channels.items()}
        half["Z"][nothing] = np.inf
        images.write_exr(folder / "exr" / path.name, half)
        path.unlink()
    (tmp_path / "configs" / "scenes").mkdir(parents=True)
    (tmp_path / "configs" / "scenes" / "theirs.yaml").write_text(YAML)
    return folder


def test_published_views_are_reprojected_exported_and_validated(published, tmp_path, run_program):
    def run(name, *arguments, **options):
        return run_program(name, *arguments, cwd=tmp_path, **options)

    dataset = tmp_path / "results" / "theirs" / "LFPlane"
    own_lightfield = dataset / "lightfield.json"
    run("make_lightfield.py", "--scene", "theirs", "--rig", "LFPlane", "--output", own_lightfield)
    content, theirs = (
        json.loads(p.read_text()) for p in (own_lightfield, published / "lightfield.json")
    )
    assert content["frames"] == theirs["frames"]
    assert content["camera"] == theirs["camera"]
    assert content["depth"] == "z"
    # The machine that rendered them is unknown.
    assert "machine" not in content
    receipt = tmp_path / "work/receipts/theirs/LFPlane/render/0-4.jsonl"
    views = dataset / "exr"
    arguments = [
        "--dataset",
        published,
        "--lightfield",
        own_lightfield,
        "--output",
        views,
        "--receipt",
        receipt,
    ]
    run("import_views.py", *arguments)
    outputs = receipts.read(receipt).outputs
    names = {f"exr/{path.name}" for path in (published / "exr").iterdir()}
    assert outputs.keys() == {f"results/theirs/LFPlane/{name}" for name in names}
    for name in names:
        (digest,) = {sha256(published / name), sha256(dataset / name)}
        assert outputs[f"results/theirs/LFPlane/{name}"].stamp.sha256 == digest
    again = dataset / "perspective"
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [24, 24]}
    settings = tmp_path / "perspective.json"
    settings.write_text(json.dumps({"camera": camera, "formats": ["exr"]}))
    arguments = ["--settings", settings, "--input-cfg", own_lightfield, "--input-dir", views]
    run(
        "reproject.py", *arguments, "--output-dir", again, "--output-cfg", again / "lightfield.json"
    )
    arguments = ["--input-cfg", again / "lightfield.json", "--image-suffix", ".exr"]
    run("export_instant_ngp.py", *arguments, "--output", again / "transforms.json")
    arguments = [dataset, "--reprojection", "perspective", "--receipts", receipt]
    arguments += ["--output", dataset / "validation.json"]
    run("validate.py", *arguments)
    validation = json.loads((dataset / "validation.json").read_text())
    assert validation["valid"], validation["summary"]


def reprojected(folder, published, run_program):
    """Import published views into a folder, reproject them, and return them by their names."""
    dataset = folder / "results" / "theirs" / "LFPlane"
    lightfield = dataset / "lightfield.json"
    arguments = ["--scene", "theirs", "--rig", "LFPlane", "--output", lightfield]
    run_program("make_lightfield.py", *arguments, cwd=folder)
    arguments = ["--dataset", published, "--lightfield", lightfield, "--output", dataset / "exr"]
    run_program("import_views.py", *arguments)
    settings = folder / "perspective.json"
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [24, 24]}
    settings.write_text(json.dumps({"camera": camera, "formats": ["exr"]}))
    output = dataset / "perspective"
    arguments = ["--settings", settings, "--input-cfg", lightfield, "--input-dir", dataset / "exr"]
    arguments += ["--output-dir", output, "--output-cfg", output / "lightfield.json"]
    run_program("reproject.py", *arguments)
    return {path.name: images.read_image(path).channels for path in output.glob("*.exr")}


def test_views_with_data_windows_are_reprojected_as_viewers_show_them(
    published, tmp_path, run_program
):
    """OpenImageIO pads and crops to the display window. What is missing is black, and a miss."""
    views = sorted((published / "exr").iterdir())
    exr_windows.widen(views[0])
    exr_windows.crop(views[1], np.s_[20:40], np.s_[3:30])
    shown = reprojected(tmp_path, published, run_program)
    for view in views[:2]:
        pixels = oiio.ImageBuf(str(view))
        planes = np.moveaxis(pixels.get_pixels(oiio.HALF, pixels.roi_full), -1, 0)
        channels = dict(zip(pixels.spec().channelnames, planes, strict=True))
        channels["Z"][channels["Z"] == 0] = np.inf
        view.unlink()
        images.write_exr(view, channels)
    shutil.rmtree(tmp_path / "results")
    whole = reprojected(tmp_path, published, run_program)
    assert shown.keys() == whole.keys()
    for name, channels in whole.items():
        for channel, plane in channels.items():
            np.testing.assert_array_equal(shown[name][channel], plane, err_msg=name)


def change(lightfield, frame_keys, **keys):
    """Add keys to a lightfield.json, and to its frames, one after the other."""
    content = json.loads(lightfield.read_text())
    for frame, more in zip(content["frames"], frame_keys, strict=True):
        frame.update(more)
    lightfield.write_text(json.dumps(content | keys))


def test_each_key_of_a_lightfield_json_is_used_or_named(published, tmp_path, run_program):
    parts = ["train", "test", "validation", "train"]
    exposure = {"start": np.eye(4).tolist(), "end": np.eye(4).tolist()}
    change(
        published / "lightfield.json",
        [{"split": part, "exposure": exposure} for part in parts],
        render={"transparent": True, "samples": 4, "depth": "auto"},
        frame=7,
        gamma=2,
    )
    output = tmp_path / "lightfield.json"
    arguments = ["--scene", "theirs", "--rig", "LFPlane", "--output", output]
    said = run_program("make_lightfield.py", *arguments, cwd=tmp_path)
    named = "lightfield.json: is imported without frame, gamma, render, frames.exposure\n"
    assert said.stdout.startswith("note: ") and said.stdout.endswith(named)
    content = json.loads(output.read_text())
    assert [frame["split"] for frame in content["frames"]] == parts
    assert content["render"]["transparent"] is True
    assert content["depth"] == "z"


def test_imported_views_of_one_part_need_no_rig_of_another(published, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    change(published / "lightfield.json", [{"split": "test"}] * 4)
    (dataset,) = scene_datasets("theirs")
    assert {pose.split for pose in dataset.rig.poses()} == {None}


def test_views_without_a_centre_are_not_imported(published, tmp_path, monkeypatch):
    """Reprojections and exports of them would be wrong."""
    monkeypatch.chdir(tmp_path)
    change(published / "lightfield.json", [{}] * 4, omnidirectional_stereo=0.064)
    with pytest.raises(UserError, match=r"omnidirectional_stereo: its views have no centre"):
        scene_datasets("theirs")


@pytest.mark.parametrize(("side", "fewest", "most"), [(64, 1, 1), (2048, 4, 20)])
def test_a_shard_takes_over_enough_views_to_be_worth_a_start(
    published, tmp_path, monkeypatch, side, fewest, most
):
    monkeypatch.chdir(tmp_path)
    path = published / "lightfield.json"
    content = json.loads(path.read_text())
    content["resolution"] = [side, side]
    (frame, *_) = content["frames"]
    content["frames"] = [frame | {"name": f"view_{number:04}f"} for number in range(400)]
    path.write_text(json.dumps(content))
    yaml = tmp_path / "configs/scenes/theirs.yaml"
    yaml.write_text(YAML.replace("[24, 24]", f"[{side}, {side}]"))
    (dataset,) = scene_datasets("theirs")
    # There are 400 views. Small ones are finished before a second process could start.
    assert fewest <= len(dataset.shards) <= most


@pytest.mark.parametrize("has_hard_links", [True, False])
def test_a_view_replaced_by_an_older_file_of_equal_size_is_imported_again(
    published, tmp_path, monkeypatch, has_hard_links
):
    def no_links(*_arguments):
        raise PermissionError

    monkeypatch.chdir(tmp_path)
    if not has_hard_links:
        monkeypatch.setattr("os.link", no_links)
    old_time = 1_700_000_000
    for view in (published / "exr").iterdir():
        os.utime(view, (old_time, old_time))
    (dataset,) = scene_datasets("theirs")
    (path,) = dataset.receipts("render")
    # The folder of the views has a path as in a scene YAML.
    source = published.relative_to(tmp_path)
    job = ImportViews(
        dataset=source,
        lightfield=source / "lightfield.json",
        output=Path(dataset.paths.views),
        receipt=Path(path),
    )
    job.run()
    views = sorted((published / "exr").iterdir())

    def outdated():
        check = JobCheck(Path("work"), Path("results"), lambda _: None, VERSIONS)
        return check.verdict(path, job.settings.as_json()).outdated

    assert outdated() == []
    # As rsync does with --archive.
    new_view = tmp_path / "new.exr"
    new_view.write_bytes(views[0].read_bytes()[:-1] + b"?")
    os.utime(new_view, (old_time - 60, old_time - 60))
    new_view.replace(views[0])
    assert outdated() == [receipts.name_of(views[0])]
    job.run()
    assert Path(dataset.paths.views, views[0].name).read_bytes() == views[0].read_bytes()
    assert outdated() == []


def test_a_preset_keeps_the_resolution_of_imported_views(published, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (full,) = scene_datasets("theirs")
    (small,) = scene_datasets("theirs", "tiny", Preset(resolution=12, views=4))
    assert small.rig.camera.resolution == full.rig.camera.resolution == (48, 48)
    assert small.view_count == 4
    reprojection = small.reprojections["perspective"].camera
    assert max(reprojection.resolution) == 12


@pytest.mark.slow
def test_nothing_is_rendered_for_imported_views(published, tmp_path):
    arguments = ("--snakefile", ROOT / "Snakefile", "--config", "scenes=theirs", "preset=full")
    jobs = planned(tmp_path, *arguments)
    assert jobs.keys() >= {"import_views", "reproject", "validate", "page"}
    rendering = {"render", "render_panorama", "build_scene", "inventory", "check_cameras"}
    assert not rendering & jobs.keys()
    assert planned(tmp_path, "plan", *arguments) == {"plan": 1}
    terminal = snakemake(tmp_path, "plan", *arguments).stderr
    assert "plan failed: error: the views of all chosen" in terminal
    dataset, (view, *_) = tmp_path / "results/theirs/LFPlane", (published / "exr").iterdir()
    again = []
    for part in (1, 0.5):
        # A view that its owner changes is taken over again.
        channels = images.read_image(view).channels
        images.write_exr(view, channels | {name: part * channels[name] for name in "RGB"})
        built = snakemake(tmp_path, *arguments)
        assert built.returncode == 0, built.stdout + built.stderr
        assert "\nvalid: results/theirs/LFPlane/report/index.html\n" in built.stdout + built.stderr
        assert sha256(dataset / "exr" / view.name) == sha256(view)
        again.append(images.read_image(dataset / "perspective" / view.name).channels["R"])
    assert again[1].sum() == pytest.approx(again[0].sum() / 2, rel=0.01)


def run_of_theirs(folder, script):
    """Return a command that builds the imported views by a script that runs Snakemake."""
    program = folder / "run.py"
    program.write_text(script)
    command = [forks.python(), program, "--cores", "1"]
    return [*command, "--snakefile", ROOT / "Snakefile", "--config", "scenes=theirs", "preset=full"]


@pytest.mark.slow
def test_a_run_does_not_list_a_folder_for_each_shard(published, tmp_path):
    """Thousands of shards share a folder of many thousand files."""
    command = run_of_theirs(tmp_path, COUNTING)
    of_views_and_records = []
    for views_per_shard in (4, 1):
        arguments = [*command, f"views_per_shard={views_per_shard}"]
        subprocess.run(arguments, cwd=tmp_path, capture_output=True, check=True)
        assert (
            len([*tmp_path.glob("work/receipts/theirs/LFPlane/render/*-?.jsonl")])
            == 4 / views_per_shard
        )
        listings = json.loads((tmp_path / "listings.json").read_text())
        roots = ("results", "work")
        own_listings = {
            folder: count for folder, count in listings.items() if folder.startswith(roots)
        }
        assert "results/theirs/LFPlane/exr" in own_listings
        of_views_and_records.append(own_listings)
        for folder in (*roots, ".snakemake"):
            shutil.rmtree(tmp_path / folder)
    assert of_views_and_records[0] == of_views_and_records[1]


def test_linked_folders_are_rigs_by_the_names_of_their_links(published, tmp_path, monkeypatch):
    for name in ("near", "far"):
        folder = tmp_path / "linked" / name
        folder.parent.mkdir(exist_ok=True)
        folder.symlink_to(published)
    assert list(lightfields(str(tmp_path / "linked"))) == ["far", "near"]
    monkeypatch.chdir(published)
    assert list(lightfields(".")) == list(lightfields("../LFPlane/exr/..")) == ["LFPlane"]


def test_a_folder_that_cannot_be_a_rig_is_named(published, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    published.rename(published.with_name("view sphere"))
    with pytest.raises(UserError, match=r"theirs.yaml: rigs: 'view sphere' is not a name; must"):
        checked(TypeAdapter(Scene), {"scene": {"dataset": "published"}}, "theirs.yaml")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"scene": {"dataset": "elsewhere"}}, "there is no lightfield.json in elsewhere"),
        ({"scene": {"dataset": "published"}, "rigs": {}}, "rigs: does not go with scene.dataset"),
        ({"scene": {"dataset": "published", "blend": "a.blend"}}, "must have one of builder,"),
        ({"scene": {"dataset": "published", "frame": 3}}, "frame: does not go with dataset"),
        (
            {"scene": {"dataset": "published"}, "exports": {"colmap": {"sources": ["views"]}}},
            "exports.colmap.sources: views: the rig LFPlane sees 180 degrees",
        ),
    ],
)
def test_settings_that_do_not_go_with_imported_views_are_refused(
    published, tmp_path, monkeypatch, content, problem
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=problem):
        checked(TypeAdapter(Scene), content, "theirs.yaml")


@pytest.mark.parametrize(
    "camera",
    [
        VIEWS,
        {"lens": "rectilinear", "focal_length": 18, "sensor_size": 36, "resolution": [8, 6]},
        {"lens": "equirectangular", "latitude": [-90, 45], "resolution": [8, 6]},
        {"lens": "equisolid", "focal_length": 10.5, "fov": 123.4567, "resolution": [8, 8]},
        {
            "lens": "polynomial",
            "fov": 180,
            "coefficients": [0, -0.08, 0, 0, 1e-6],
            "principal_point": [3.5, 4],
            "resolution": [8, 8],
        },
    ],
)
def test_a_lens_can_be_written_as_a_yamls_camera(camera):
    lens = lenses.from_camera(camera)
    assert lenses.from_camera(lens.settings()) == lens


def test_an_angle_that_blender_rounded_becomes_round_again():
    camera = {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT"}
    camera["fisheye_fov"] = float(np.float32(2 * math.pi))
    lens = lenses.from_lightfield({"camera": camera, "resolution": [8, 8]})
    assert lens.settings()["fov"] == 360


def test_a_read_only_view_is_taken_over(nobody):
    view, taken = nobody / "published.exr", nobody / "exr" / "taken.exr"
    view.write_bytes(b"a view")
    view.chmod(0o444)
    (nobody / "deep").mkdir()
    link = nobody / "deep" / "link.exr"
    link.symlink_to("../published.exr")
    for name in (view, link):
        link_or_copy(name, taken)
        assert taken.samefile(view)
        assert not taken.is_symlink()
