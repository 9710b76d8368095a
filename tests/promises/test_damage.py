"""Every fault in every kind of file: each is found and repaired, and never published.

Every kind of file of a smoke build is damaged at once, each with another fault. There are as many
batches as faults, so that every kind of file gets every fault.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import bookkeeping
import pytest
import simulated
from bookkeeping import REWRITTEN, WITHOUT_CHECKSUM, rendered
from checkouts import ROOT, assert_same_bytes, checkout, snakemake, start_snakemake
from faults import CUBOID, FAULTS, KINDS, flip, spoil
from waiting import wait_until

from lightfield.core.files import sha256
from lightfield.planning.loading import scene_datasets

BATCHES = range(len(FAULTS))
# These may keep the size and the time of a file.
HIDDEN = {"a bit, at the old time", "a digit", "another valid file"}
# Snakemake does not know these files. In the place of its own files, a link to nowhere or a file
# without permissions ends the plan with Snakemake's message, which names the file.
UNDECLARED = {
    "view",
    "reprojected PNG",
    "reprojected EXR",
    "parameters of a sensor",
    "transforms of a split",
    "picture of instant-ngp",
    "picture of an export",
    "points",
    "surface",
    "settings",
    "log",
    "array of a Zarr store",
    "metadata of a Zarr store",
}


# Starts a command without root's rights to read and write files against their permissions.
RIGHTS = "-dac_override,-dac_read_search"
OBEDIENT = [] if os.geteuid() else ["setpriv", f"--bounding-set={RIGHTS}", f"--inh-caps={RIGHTS}"]


class Damaged:
    """A copy of a build in which each kind of file has the fault of a batch.

    A second batch damages the other file of each kind. Without a batch there is no fault, and none
    of the faults that are ``left_out``.
    """

    def __init__(self, build, root, *batches, left_out=()):
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
                if fault in ("a link to nowhere", "unreadable") and kind not in UNDECLARED:
                    continue
                if fault in left_out:
                    continue
                is_free = KINDS[kind][number] not in self.files
                if is_free and not (fault == "swapped" and number):
                    spoilt = spoil(self.root, kind, fault, number)
                    self.files |= dict.fromkeys(spoilt, (kind, fault))

    def run(self, *arguments):
        """Run Snakemake as a user who obeys permissions, which root does not."""
        return subprocess.run(
            [*OBEDIENT, Path(sys.executable).with_name("snakemake"), "--cores", "2", *arguments],
            cwd=self.root,
            env=os.environ | {"PYTHONPATH": str(ROOT / "tests")},
            capture_output=True,
            text=True,
            check=False,
        )

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
    unchanged = bookkeeping.unchanged_notes(smoke, damaged.root)
    # A job whose receipt is damaged looks for damage itself.
    noted = bookkeeping.noted(smoke)
    made |= {file for output in made & noted.keys() for file in noted[output].files}
    for path, (kind, fault) in damaged.files.items():
        # A run writes settings when it starts, and takes none from the file.
        if kind in REWRITTEN | WITHOUT_CHECKSUM or path in unchanged:
            continue
        # A plan does not read a file with its old size and time.
        is_hidden = fault in HIDDEN and path in verified
        assert path in named | made or is_hidden, (kind, fault)
        if fault == "deleted" and path in named:
            assert f"{path}: is missing; it is made anew" in result.stderr
    # No intact file is reported.
    assert named | verified <= damaged.files.keys()


# These batches have every obstacle to Snakemake. No other batch needs a run.
@pytest.mark.slow
def test_one_plain_run_mends_every_kind_of_file(smoke, tmp_path, monkeypatch):
    # A plan does not see these. A job names a file that it may not read.
    damaged = Damaged(smoke, tmp_path, 11, 4, left_out=HIDDEN | {"unreadable"})
    folder_of_shard = (damaged.root / bookkeeping.shard(CUBOID, "render", "0-6")).parent
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
    assert {key[1]: n for key, n in again if key[0] == folder_of_shard} == {
        "view_b0000f": 1,
        "view_f0000f": 1,
    }


# ---- the notes of finished jobs -------------------------------------------------------------


@pytest.mark.slow
def test_without_notes_a_run_makes_all_files_again_but_not_the_views(smoke, tmp_path):
    """The published checksums tell which views are intact."""
    damaged = Damaged(smoke, tmp_path)
    bookkeeping.forget_all(damaged.root)
    result = damaged.run("--dry-run", "--logger", "jobs", "--", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    named, made = damaged.damaged_and_made(result)
    assert not named
    assert made >= {names[0] for kind, names in KINDS.items() if kind in ("scene", "light field")}
    result = damaged.run("smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    assert not rendered(damaged.root)
    assert_same_bytes(smoke, damaged.root)


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
    if blend in bookkeeping.noted(folder):
        bookkeeping.forget(folder, blend)
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
