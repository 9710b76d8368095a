"""Every fault in every kind of file: each is found and repaired, and never published.

Every kind of file of a smoke build is damaged at once, each with another fault. There are as many
batches as faults, so that every kind of file gets every fault.
"""

import json
import os
import re
import shutil
import signal

import bookkeeping
import forks
import pytest
import simulated
from bookkeeping import HISTORY, REWRITTEN, WITHOUT_CHECKSUM, rendered
from checkouts import ROOT, assert_same_bytes, checkout, snakemake, start_snakemake
from faults import CUBOID, FAULTS, KINDS, flip, spoil
from waiting import wait_until

from lightfield.core.files import sha256
from lightfield.workflow.loading import scene_datasets

BATCHES = range(len(FAULTS))
OBSTACLES = {"a folder", "a link to nowhere", "unreadable"}


class Damaged:
    """A copy of a build in which each kind of file has the fault of a batch.

    A second batch damages the other file of each kind. Without a batch there is no fault.
    """

    def __init__(self, build, root, *batches):
        self.root = checkout(root / "plenoforge")
        for name in ("results", "work"):
            shutil.copytree(build / name, self.root / name)
        faults = list(FAULTS)
        # The kind of file and the fault, by path.
        self.files = {}
        for number, batch in enumerate(batches):
            for place, kind in enumerate(KINDS):
                fault = faults[(place + batch) % len(faults)]
                # Some kinds share a file. A swap damages both files.
                is_free = KINDS[kind][number] not in self.files
                if is_free and not (fault == "swapped" and number):
                    spoilt = spoil(self.root, kind, fault, number)
                    self.files |= dict.fromkeys(spoilt, (kind, fault))

    def run(self, *arguments):
        """Run Snakemake as a user who obeys permissions, which root does not."""
        env = {"PYTHONPATH": str(ROOT / "tests"), forks.OBEDIENT: "1"}
        return forks.run_snakemake(["--cores", "2", *arguments], self.root, env)

    def damaged_and_made(self, result):
        """Return the files that a run reports as damaged, and the files that it makes."""
        named = bookkeeping.named_in_plan(result.stderr)
        jobs = [json.loads(line) for line in result.stderr.splitlines() if line.startswith("{")]
        return named, {file for job in jobs for file in job["output"]}

    def verified(self, monkeypatch):
        """Return the files in which `snakemake verify` finds a fault."""
        monkeypatch.chdir(self.root)
        datasets = scene_datasets("smoke")
        return bookkeeping.problems(dataset.paths.folder for dataset in datasets).keys()


def has_same_bytes(first, second, path):
    return (first / path).read_bytes() == (second / path).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("batch", BATCHES)
def test_every_fault_in_every_kind_of_file_is_found(smoke, tmp_path, batch, monkeypatch):
    damaged = Damaged(smoke, tmp_path, batch)
    result = damaged.run("--dry-run", "--logger", "jobs", "--", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    named, made = damaged.damaged_and_made(result)
    verified = damaged.verified(monkeypatch)
    for path, (kind, fault) in damaged.files.items():
        is_obstacle = fault in OBSTACLES
        if kind == "settings":
            assert has_same_bytes(damaged.root, smoke, path)
        elif kind in HISTORY and not is_obstacle:
            assert path in verified, (kind, fault)
        elif kind not in REWRITTEN and (kind not in WITHOUT_CHECKSUM or is_obstacle):
            is_planned_as_missing = fault == "deleted" and path in made
            assert path in named or is_planned_as_missing, (kind, fault)
    # No intact file is reported.
    assert named | verified <= damaged.files.keys()


# These batches have every obstacle to Snakemake. No other batch needs a run.
@pytest.mark.slow
def test_one_plain_run_mends_every_kind_of_file(smoke, tmp_path, monkeypatch):
    damaged = Damaged(smoke, tmp_path, 10, 4)
    journals = f"work/{CUBOID}/render"
    before = rendered(damaged.root)
    result = damaged.run("smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Traceback" not in result.stderr
    assert_same_bytes(smoke, damaged.root)
    for kind in REWRITTEN:
        assert has_same_bytes(damaged.root, smoke, KINDS[kind][0])
    assert not damaged.verified(monkeypatch)
    plan = damaged.run("--dry-run", "smoke")
    assert "Nothing to be done" in plan.stdout + plan.stderr
    # Views with intact files are not rendered again, although their scene was damaged.
    again = (rendered(damaged.root) - before).items()
    assert {key[1]: n for key, n in again if key[0] == damaged.root / journals} == {
        "view_b0000f": 1,
        "view_f0000f": 1,
    }


# ---- the notes of finished jobs -------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["a bit", "emptied", "deleted", *sorted(OBSTACLES)])
def test_after_damage_to_the_notes_a_run_makes_unknown_files_again(smoke, tmp_path, fault):
    damaged = Damaged(smoke, tmp_path)
    # Other tests have added notes, and have made packages.
    bookkeeping.keep_one_line_a_job(damaged.root, ".tar")
    FAULTS[fault][0](damaged.root / bookkeeping.NOTES, None)
    result = damaged.run("--dry-run", "--logger", "jobs", "--", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    named, made = damaged.damaged_and_made(result)
    assert made
    assert named == ({bookkeeping.NOTES} if fault in OBSTACLES else set())
    # The next run knows what this run notes.
    lens_map = KINDS["lens map"][1]
    result = damaged.run("--allowed-rules", "lens_map", "--", lens_map)
    assert result.returncode == 0, result.stdout + result.stderr
    assert lens_map in bookkeeping.noted(damaged.root)


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_a_scene_damaged_before_it_is_noted_is_built_again(tmp_path):
    """Its SHA-256 was not noted before the kill, so no job may use it."""
    folder = checkout(tmp_path / "plenoforge")
    blend, inventory = "work/smoke/scene.blend", "work/smoke/inventory.json"
    run = start_snakemake(folder, inventory)
    wait_until((folder / blend).exists, run)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert blend not in bookkeeping.noted(folder)
    flip(folder / blend, None)
    rotten = (folder / blend).read_bytes()
    result = snakemake(folder, inventory)
    assert result.returncode == 0, result.stdout + result.stderr
    assert (folder / blend).read_bytes() != rotten
    assert bookkeeping.noted(folder)[blend].files[blend] == sha256(folder / blend)


@pytest.mark.slow
def test_a_single_dataset_notices_a_changed_yaml_and_damage(tmp_path):
    folder = checkout(tmp_path)
    first, second, _ = simulated.build(folder)
    targets = [f"{first.paths.folder}/sha256sums.txt", second.sequence_paths.package]
    assert not simulated.planned(folder, targets[0])
    path = folder / "configs/scenes/smoke.yaml"
    path.write_text(re.sub(r"samples: \d+", "samples: 3", path.read_text(), count=1))
    (folder / second.inventory).write_text("{")
    os.utime(folder / second.inventory, (simulated.WHEN, simulated.WHEN))
    expected = {f"{d.paths.folder}/lightfield.json" for d in (first, second)} | {second.inventory}
    assert expected <= simulated.planned(folder, *targets)
