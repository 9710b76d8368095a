"""The status of a build: never started, at work, killed and finished."""

import json
import os
import re
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from checkouts import ROOT, snakemake

from lightfield.configuration import keys
from lightfield.core import files, progress
from lightfield.core.files import Stamp
from lightfield.engine.flags import parsed
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses
from lightfield.stages.checks import Status

NAMES = ["a", "b", "c", "d"]
# A scene YAML of five members.
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
FAMILY = {
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {"plane": {"type": "plane", "cameras": [2, 1], "size": 1, "camera": CAMERA}},
    "family": {"seeds": "0-4"},
}


@pytest.fixture
def dataset(tmp_path, capsys):
    """A dataset of four views. Functions note some of them as made, and print its status."""
    folder, receipts = tmp_path / "results/scene/rig", tmp_path / "work/receipts/scene/rig"
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [2, 1]})
    content = LightField(lens.to_lightfield(), [View.placed(name, np.eye(4)) for name in NAMES])

    def lines(others=()):
        folders = ("--results", tmp_path / "results", "--work", tmp_path / "work")
        arguments = (*folders, "--dataset", "scene/rig", 4, "flat", *others)
        parsed(Status, None, [*map(str, arguments)]).run()
        return capsys.readouterr().out.splitlines()

    def make(path, key, receipt):
        """Make a file, and note it in the unfinished receipt of a shard."""
        files.write_text(folder / path, path)
        note(receipt, {"file": str(folder / path), **Stamp.of(folder / path)._asdict(), "key": key})

    def note(receipt, *lines):
        for line in lines:
            files.append_json_line(receipts / f"{receipt}.part", line)

    def render(*names, settings=content):
        folder.mkdir(parents=True, exist_ok=True)
        content.write(folder / "lightfield.json")
        for view in settings.views:
            if view.name in names:
                make(f"exr/{view.name}.exr", keys.render_key(settings, view), "render/0-4")

    def seal(receipt):
        """Make the receipt of a shard a finished one."""
        part = receipts / f"{receipt}.part"
        header = {"job": f"scene/rig/{receipt}", "stage": "render_shard", "version": None}
        header |= {"settings": {}, "inputs": {}}
        files.write_text(part.with_suffix(".jsonl"), json.dumps(header) + "\n" + part.read_text())
        part.unlink()

    lines.folder, lines.content = folder, content
    lines.render, lines.make, lines.note, lines.seal = render, make, note, seal
    return lines


def started(ago, pid):
    return {"started": time.time() - ago, "host": socket.gethostname(), "pid": pid}


def finished(name, ago):
    seconds = dict.fromkeys(("wall_seconds", "cpu_seconds", "render_seconds"), 1)
    return {"view": name, "finished": time.time() - ago, **seconds}


def test_a_build_that_was_never_started_has_no_views(dataset):
    assert dataset() == [
        "scene/rig",
        "  rendered: 0 of 4, no rate yet",
        "  flat: 0 of 4",
        "  validated: no",
        "all: 0 of 4 views rendered, no rate yet",
    ]


def test_views_of_other_settings_are_not_counted(dataset):
    dataset.render("a", "b")
    dataset.render("c", settings=dataset.content.changed(resolution=[4, 1]))
    (dataset.folder / "exr/d.exr").write_bytes(b"of nobody")
    assert dataset()[1] == "  rendered: 2 of 4, no rate yet"


def test_views_of_an_outdated_scene_are_not_counted(dataset):
    dataset.render("a", "b")
    assert "rendered: 2 of 4" in dataset()[1]
    outdated = dataset(("--outdated", "scene/rig"))
    assert "rendered: 0 of 4" in outdated[1]
    assert "  outdated: 2 views of an earlier scene, or of earlier settings" in outdated


def test_a_view_counts_while_its_file_is_as_its_receipt_says(dataset):
    dataset.render("a", "b")
    dataset.seal("render/0-4")
    dataset.render("c")
    # The names that a pass numbers are not a view.
    dataset.make("object/d.json", "0", "render/0-4")
    assert dataset()[1].startswith("  rendered: 3 of 4")
    (dataset.folder / "exr/a.exr").write_bytes(b"cut short")
    (dataset.folder / "exr/c.exr").unlink()
    assert dataset()[1].startswith("  rendered: 1 of 4")


def test_the_time_left_follows_from_the_rate_of_the_shards_at_work(dataset, monkeypatch):
    dataset.render("a", "b")
    # This process stands in for the renderer's. It began just now, so the clock is put forward.
    now = time.time() + 1000
    monkeypatch.setattr(time, "time", lambda: now)
    start = started(1000, pid=os.getpid())
    dataset.note("render/0-4", start, *(finished("a", ago) for ago in (900, 500, 1)))
    lines = dataset()
    # Two views were finished in the last ten minutes, and two are left.
    assert lines[1] == (
        "  rendered: 2 of 4, 0.2 a minute, 10 min left at the rate of the last 10 min"
    )
    assert "  shards at work: 0:4" in lines
    assert lines[-1] == lines[1].replace("  rendered: 2 of 4", "all: 2 of 4 views rendered")


def test_a_killed_shard_is_listed_until_its_views_are_finished(dataset):
    dataset.render("a")
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    dataset.note("render/0-4", started(100, gone.pid), finished("a", 50))
    lines = dataset()
    assert lines[1] == "  rendered: 1 of 4, no rate yet"
    assert "  shards killed, the next run goes on with them: 0:4" in lines
    dataset.render(*NAMES)
    assert "killed" not in "\n".join(dataset())


def test_a_process_on_another_machine_is_at_work_if_it_wrote_lately(dataset):
    dataset.render("a", "c")
    elsewhere = started(5000, pid=1) | {"host": "another-node"}
    dataset.note("render/0-2", elsewhere, finished("a", 30))
    dataset.note("render/2-4", elsewhere, finished("c", 4000))
    lines = dataset()
    assert any(
        re.fullmatch(r"  shards at work: 0:2 on another-node \(heard of 3\d s ago\)", line)
        for line in lines
    )
    assert "  shards not heard of for an hour: 2:4" in lines


def test_a_reprojected_view_older_than_its_source_is_not_counted(dataset):
    dataset.make("flat/a.png", "0", "flat/0-4")
    dataset.render(*NAMES)
    for name in "bc":
        dataset.make(f"flat/{name}.png", "0", "flat/0-4")
    # The last face of a cube map.
    dataset.make("flat/d_d.png", "0", "flat/0-4")
    (dataset.folder / "flat/c.png").write_bytes(b"cut short")
    assert "  flat: 2 of 4" in dataset()


def test_a_validation_counts_only_for_the_present_views(dataset):
    dataset.render(*NAMES)
    file = dataset.folder / "validation.json"
    file.write_text('{"valid": true}')
    assert "  validated: yes" in dataset()
    os.utime(file, (1, 1))
    assert "  validated: not since its views were made" in dataset()
    file.write_text('{"valid": false}')
    assert any(line.startswith("  validated: yes, and it is not valid") for line in dataset())


def test_a_view_that_was_made_after_the_validation_is_not_validated(dataset):
    dataset.render(*NAMES[:-1])
    file = dataset.folder / "validation.json"
    file.write_text('{"valid": true}')
    time.sleep(0.02)
    dataset.render(NAMES[-1])
    assert "  validated: not since its views were made" in dataset()


def test_a_clock_that_is_ahead_gives_no_rate(dataset):
    dataset.render("a")
    elsewhere = started(-5, pid=1) | {"host": "another-node"}
    dataset.note("render/0-4", elsewhere, finished("a", -7))
    assert dataset()[1] == "  rendered: 1 of 4, no rate yet"


def test_all_chosen_datasets_are_added_up(dataset):
    dataset.render("a")
    assert dataset(("--dataset", "scene/other", 6, ""))[-1] == (
        "all: 1 of 10 views rendered, no rate yet"
    )


@pytest.mark.slow
def test_snakemake_shows_the_status_without_a_lock(tmp_path):
    folders = (f"results={tmp_path / 'results'}", f"work={tmp_path / 'work'}")
    arguments = ("--quiet", "all", "--nolock", "status", "--config", *folders, "preset=tiny")
    result = snakemake(ROOT, *arguments)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[0] == "garden_tiny/LFSphere_e100cm_d170cm"
    assert result.stdout.splitlines()[-1] == "all: 0 of 12 views rendered, no rate yet"


def test_progress_starts_at_once_and_can_be_read_in_a_log(capsys, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    render_progress = progress.Progress(10, "render scene/rig 0:12", already=2)
    assert capsys.readouterr().err == "render scene/rig 0:12: 10 views to do, 2 already done\n"
    # The first view takes 100 s more than the others' 20 s.
    for seconds in (120, 20, 20):
        now[0] += seconds
        render_progress.done()
    assert capsys.readouterr().err.splitlines() == [
        "render scene/rig 0:12: 1 of 10 views, 120 s each, 18 min left",
        "render scene/rig 0:12: 2 of 10 views, 20 s each, 2 min 40 s left",
        "render scene/rig 0:12: 3 of 10 views, 20 s each, 2 min 20 s left",
    ]
    # Within the interval nothing is printed, except the end.
    now[0] += 1
    render_progress.done()
    assert capsys.readouterr().err == ""
    render_progress.done(6)
    assert capsys.readouterr().err.endswith("done in 2 min 41 s\n")


def test_progress_works_while_nothing_is_finished(capsys, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    place_progress = progress.Progress(10, "places", "cameras")
    now[0] += 60
    place_progress.done(0)
    now[0] += 60
    place_progress.done(4)
    assert capsys.readouterr().err.splitlines() == [
        "places: 10 cameras to do",
        "places: 4 of 10 cameras, 30 s each, 3 min 00 s left",
    ]


def test_a_familys_members_are_counted_by_their_state(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failure = {"stage": "import_model", "cause": "it is empty", "log": "work/chairs/b/member.log"}
    states = {"0000": {"state": "valid"}, "0001": {"state": "failed", "failure": failure}}
    # The family no longer has this one.
    states["0005"] = {"state": "valid"}
    files.write_json(tmp_path / "configs/scenes/chairs.yaml", FAMILY)
    for name, state in states.items():
        record = {"format": "plenoforge member", "name": name, "key": "0" * 64, "values": {}}
        record |= {"seed": int(name), "datasets": {}, **state}
        (tmp_path / "chairs_tiny" / name).mkdir(parents=True)
        files.write_json(tmp_path / "chairs_tiny" / name / "member.json", record)
    folders = ("--results", str(tmp_path), "--work", str(tmp_path))
    parsed(Status, None, [*folders, "--family", "chairs_tiny", "chairs"]).run()
    assert capsys.readouterr().out == "chairs_tiny: 1 of 5 members built, 1 failed\n"
