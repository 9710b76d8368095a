"""Every fault in every kind of file: each is found and repaired, and never published.

Every kind of file of a smoke build is damaged at once, each with another fault. There are as many
batches as faults, so that every kind of file gets every fault.
"""

import json
import os
import re
import shutil
import signal
from pathlib import Path

import forks
import pytest
import simulated
from checkouts import assert_same_bytes, checkout, rendered, snakemake, start_snakemake
from faults import CUBOID, FAULTS, KINDS, flip, spoil
from waiting import wait_until

from lightfield.core.files import broken, set_aside, sha256
from lightfield.dataset import ledger
from lightfield.dataset.loading import scene_datasets
from lightfield.validation.integrity import Integrity

# These record finished work, and no job can make them again. A run finds only those that it cannot
# read. `snakemake verify` finds the rest.
HISTORY = {"log of checksums", "journal", "benchmark"}
# A job's log has no checksum.
WITHOUT_CHECKSUM = {"log"}
# Each plan writes settings, and each run notes its shards.
REWRITTEN = {"settings", "note of shards"}
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
        env = {"PYTHONPATH": str(Path(__file__).parent), forks.OBEDIENT: "1"}
        return forks.run_snakemake(["--cores", "2", *arguments], self.root, env)

    def damaged_and_made(self, result):
        """Return the files that a run reports as damaged, and the files that it makes."""
        named = set(re.findall(r"^([^:\n]+): .*; it is made anew$", result.stderr, re.M))
        jobs = [json.loads(line) for line in result.stderr.splitlines() if line.startswith("{")]
        return named, {file for job in jobs for file in job["output"]}

    def verified(self, monkeypatch):
        """Return the files in which `snakemake verify` finds a fault."""
        monkeypatch.chdir(self.root)
        folders = [Path(dataset.folder) for dataset in scene_datasets("smoke")]
        return {str(f.path) for path in folders for f in Integrity(path, Path("work")).faults()}


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
        elif kind not in REWRITTEN | WITHOUT_CHECKSUM or (kind == "log" and is_obstacle):
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


# ---- the ledger itself ----------------------------------------------------------------------


def keep_what_counts(path):
    """Keep the last line of each job that a plan needs. Other tests have added lines."""
    last_lines = {}
    for line in path.read_text().splitlines(keepends=True):
        outputs = line.partition('"files"')[0].partition(" ")[2]
        if ".tar" not in outputs:
            last_lines[outputs] = line
    path.write_text("".join(last_lines.values()))


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["a bit", "emptied", "deleted", *sorted(OBSTACLES)])
def test_after_damage_to_the_ledger_a_run_makes_unknown_files_again(smoke, tmp_path, fault):
    damaged = Damaged(smoke, tmp_path)
    path = damaged.root / "work/ledger.txt"
    keep_what_counts(path)
    FAULTS[fault][0](path, None)
    result = damaged.run("--dry-run", "--logger", "jobs", "--", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    named, made = damaged.damaged_and_made(result)
    assert made
    assert named == ({"work/ledger.txt"} if fault in OBSTACLES else set())
    # The next run knows what this run notes.
    lens_map = KINDS["lens map"][1]
    result = damaged.run("--allowed-rules", "lens_map", "--", lens_map)
    assert result.returncode == 0, result.stdout + result.stderr
    assert lens_map in ledger.read(damaged.root / "work/ledger.txt")


def note(path, *files):
    """Write into a ledger that a job made this file."""
    stamps = {str(file): ledger.Stamp.of(file) for file in files}
    ledger.Ledger(path).note(ledger.Job([str(files[0])], stamps, {}, {}))


@pytest.mark.parametrize("fault", sorted(FAULTS.keys() - {"deleted"}))
def test_the_ledger_names_the_damaged_file_and_what_to_make_again(nobody, fault):
    path, sound, sibling = (nobody / name for name in ("a.json", "b.json", "c.json"))
    for number, file in enumerate((path, sound, sibling)):
        file.write_text(json.dumps({"number": [number] * 10}))
    note(nobody / "ledger.txt", path, sound)
    FAULTS[fault][0](path, sibling)
    (damaged,) = ledger.Ledger(nobody / "ledger.txt").damage.items()
    assert damaged[0] == str(path) and damaged[1][1] == [str(path)]
    assert "\n" not in damaged[1][0]


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_a_scene_damaged_before_its_ledger_line_is_built_again(tmp_path):
    """Its SHA-256 was not noted before the kill, so no job may use it."""
    folder = checkout(tmp_path / "plenoforge")
    blend, inventory = "work/smoke/scene.blend", "work/smoke/inventory.json"
    run = start_snakemake(folder, inventory)
    wait_until((folder / blend).exists, run)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert not (folder / "work/ledger.txt").exists()
    flip(folder / blend, None)
    rotten = (folder / blend).read_bytes()
    result = snakemake(folder, inventory)
    assert result.returncode == 0, result.stdout + result.stderr
    assert (folder / blend).read_bytes() != rotten
    sums = ledger.Ledger(folder / "work/ledger.txt").sums
    assert sums[blend] == sha256(folder / blend)


# ---- messages, and where damaged files go ---------------------------------------------------


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b'{"half": [', "is not JSON: "),
        (b"[1, 2]", "is a list, not a mapping"),
        (b'{"\xff": 1}', "is not text in UTF-8"),
        (b"", "is empty"),
        (b"null", "is a NoneType, not a mapping"),
        (b"{}", None),
    ],
)
def test_the_message_says_what_is_wrong_with_a_json(content, problem, tmp_path):
    path = tmp_path / "a.json"
    assert broken(path) is None
    path.write_bytes(content)
    said = broken(path)
    assert said is problem is None or said.startswith(problem)


def test_files_set_aside_are_never_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for content in "ab":
        Path("results").mkdir(exist_ok=True)
        Path("results/a.json").write_text(content)
        set_aside(Path("results/a.json"), Path("work/removed"))
    assert Path("work/removed/results/a.json").read_text() == "a"
    assert Path("work/removed/results/a.json.2").read_text() == "b"
    assert not Path("results/a.json").exists()


def test_files_outside_the_folder_are_set_aside_with_all_others(tmp_path, monkeypatch):
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path / "own")
    inside = Path("work/removed") / (tmp_path / "a.json").relative_to("/")
    for path, name in ((tmp_path / "a.json", inside.name), (Path("../a.json"), "a.json.2")):
        (tmp_path / "a.json").touch()
        assert set_aside(path, Path("work/removed")) == inside.with_name(name)
        assert inside.with_name(name).is_file()


def test_a_folder_is_set_aside_even_in_place_of_a_broken_link(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.exr").symlink_to("a.exr")
    set_aside(Path("a.exr"), Path("removed"))
    Path("a.exr/inside").mkdir(parents=True)
    assert set_aside(Path("a.exr"), Path("removed")) == Path("removed/a.exr.2")
    assert Path("removed/a.exr").is_symlink()
    assert Path("removed/a.exr.2/inside").is_dir()


@pytest.mark.slow
def test_a_single_dataset_notices_a_changed_yaml_and_damage(tmp_path):
    folder = checkout(tmp_path)
    first, second, _ = simulated.build(folder)
    targets = [f"{first.folder}/sha256sums.txt", second.package]
    assert not simulated.planned(folder, targets[0])
    path = folder / "configs/scenes/smoke.yaml"
    path.write_text(re.sub(r"samples: \d+", "samples: 3", path.read_text(), count=1))
    (folder / second.costs).write_text("{")
    os.utime(folder / second.costs, (simulated.WHEN, simulated.WHEN))
    expected = {f"{d.folder}/lightfield.json" for d in (first, second)} | {second.costs}
    assert expected <= simulated.planned(folder, *targets)
