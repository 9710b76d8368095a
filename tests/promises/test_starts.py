"""Runs that cannot start, or are stopped: each ends with one line that says what is wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import bookkeeping
import pytest
from checkouts import ROOT, checkout, planned, snakemake, start_snakemake
from tiny import BLEND, CHOSEN, SCENE
from waiting import wait_until

pytestmark = pytest.mark.slow


def last_line(run):
    """Return the last line of a run that failed without a traceback."""
    said = run.stdout + run.stderr
    assert run.returncode != 0 and "Traceback" not in said, said
    return said.splitlines()[-1]


def test_a_folder_with_braces_is_named(tmp_path):
    folder = checkout(tmp_path / "{wildcards.y}", tiny=SCENE)
    said = last_line(snakemake(folder, "--dry-run", *CHOSEN))
    assert said.startswith(f"error: {folder}: the path of Plenoforge's folder has a brace")


@pytest.mark.parametrize("kind", ["is a file", "is a link that leads nowhere"])
def test_snakemakes_folder_that_is_none_is_named(kind, tmp_path):
    folder = checkout(tmp_path, tiny=SCENE)
    notes = folder / ".snakemake"
    if kind == "is a file":
        notes.touch()
    else:
        notes.symlink_to("missing/folder")
    said = last_line(snakemake(folder, "--dry-run", *CHOSEN))
    assert said.startswith("error: .snakemake: cannot be written: ") and f"{notes} {kind}" in said


@pytest.mark.parametrize(
    "name", ["results/tiny", "work/tiny", "work/logs", "work/benchmarks/tiny", bookkeeping.NOTES]
)
def test_a_file_in_place_of_a_folder_is_named(name, tmp_path):
    folder = checkout(tmp_path, tiny=SCENE)
    (folder / name).parent.mkdir(parents=True)
    (folder / name).touch()
    said = last_line(snakemake(folder, *CHOSEN))
    assert said.startswith("error: ") and f"{folder / name} is a file, and must be" in said


def test_a_home_that_takes_no_files_is_named(tmp_path):
    folder = checkout(tmp_path / "plenoforge", tiny=SCENE)
    home = tmp_path / "home"
    home.touch()
    # The plugin of this checkout, which Snakemake loads before it reads the rules.
    environment = os.environ | {"HOME": str(home), "PYTHONPATH": str(ROOT / "envs")}
    environment.pop("XDG_CACHE_HOME", None)
    command = [Path(sys.executable).with_name("snakemake"), "--cores", "1", "-n", *CHOSEN]
    run = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    said = last_line(run)
    assert said.startswith("error: ") and f"{home}/.cache" in said and "XDG_CACHE_HOME" in said


def test_a_script_that_bash_runs_first_moves_no_job(tmp_path):
    folder = checkout(tmp_path / "plenoforge", tiny=SCENE)
    script = tmp_path / "script.sh"
    script.write_text("cd /\n")
    run = snakemake(folder, *CHOSEN, "--", BLEND, env={"BASH_ENV": str(script)})
    assert run.returncode == 0, run.stdout + run.stderr
    assert (folder / BLEND).is_file()


def test_other_scenes_need_no_smoke_scene(tmp_path):
    folder = checkout(tmp_path, tiny=SCENE)
    (folder / "configs/scenes/smoke.yaml").unlink()
    assert planned(folder, *CHOSEN)["lightfield"] == 1
    said = last_line(snakemake(folder, "--dry-run", "smoke"))
    assert said.startswith("error: config.yaml: scenes: there is no scene 'smoke'")


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def test_a_locale_without_utf8_changes_no_letter(tmp_path):
    scene = f"description: Café\n{SCENE}"
    folder = checkout(tmp_path / "plenoforge")
    (folder / "configs/scenes/tiny.yaml").write_text(scene, encoding="utf-8")
    command = [Path(sys.executable).with_name("snakemake"), "--cores", "1", "-n", *CHOSEN]
    run = subprocess.run(
        command, cwd=folder, env=os.environ | ASCII, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    settings = json.loads((folder / "work/tiny/LFPlane/settings/page.json").read_bytes())
    assert settings["yaml"] == scene


def test_a_locale_without_utf8_shows_every_help():
    command = [sys.executable, ROOT / "scripts/reproject.py", "--help"]
    run = subprocess.run(command, env=os.environ | ASCII, capture_output=True, check=False)
    assert run.returncode == 0, run.stderr
    assert b"--settings" in run.stdout


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_ends_a_run_with_one_line(times, tmp_path):
    folder = checkout(tmp_path, tiny=SCENE)
    run = start_snakemake(
        folder, *CHOSEN, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    log = folder / "work/logs/tiny/build_scene.log"
    wait_until(log.exists, run)
    for _ in range(times):
        os.killpg(run.pid, signal.SIGINT)
        time.sleep(0.1)
    said, _ = run.communicate(timeout=60)
    assert run.returncode != 0
    assert "Traceback" not in said and "KeyboardInterrupt" not in said, said
    assert said.splitlines()[-1].startswith("error: the run was stopped before its last job")
