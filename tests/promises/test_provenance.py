"""Every file knows its inputs: a change is planned again without Snakemake's own metadata.

That metadata lies in .snakemake. A fresh clone beside an old build does not have it.
"""

import csv
import os
import shutil
import subprocess

import bookkeeping
import forks
import pytest
from checkouts import checkout, jobs_on, planned, snakemake

pytestmark = pytest.mark.slow
CUBOID = "LFCuboid_1x1x1"


@pytest.fixture(scope="module")
def built(smoke, tmp_path_factory):
    """A fresh clone with the old folders of results and work."""
    return copy_of(smoke, tmp_path_factory.mktemp("provenance"))


def copy_of(built, parent):
    folder = checkout(parent / "plenoforge")
    # The files of a clone have new times.
    for path in (*folder.glob("configs/scenes/*"), *folder.glob("scripts/scenes/**/*.py")):
        os.utime(path)
    for name in ("results", "work"):
        # The copy keeps the files' times.
        shutil.copytree(built / name, folder / name)
    return folder


@pytest.fixture
def folder(built, tmp_path):
    return copy_of(built, tmp_path)


def in_yaml(old, new):
    def change(folder):
        path = folder / "configs/scenes/smoke.yaml"
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


def in_builder(folder):
    path = folder / "scripts/scenes/room/__init__.py"
    text = path.read_text()
    red = '("sphere", (0.7, 0.15, 0.1)'
    assert red in text
    path.write_text(text.replace(red, '("sphere", (0.1, 0.15, 0.7)'))


VIEWS = {"lightfield", "check_cameras", "render", "reproject", "validate", "checksums", "page"}


def test_a_fresh_clone_beside_an_old_build_has_nothing_to_do(built):
    result = snakemake(built, "--dry-run", "smoke")
    assert "Nothing to be done" in result.stdout + result.stderr


def test_views_of_an_old_scene_are_rendered_again_for_a_new_one(folder):
    """A real run: another colour of the sphere makes another picture."""
    record = bookkeeping.shard(f"smoke/{CUBOID}", "render", "0-6")
    view = folder / f"results/smoke/{CUBOID}/exr/view_r0000f.exr"
    before = view.read_bytes()
    in_builder(folder)
    blend = (folder / "work/smoke/scene.blend").read_bytes()
    result = snakemake(folder, record)
    assert result.returncode == 0, result.stderr
    assert (folder / "work/smoke/scene.blend").read_bytes() != blend
    assert view.read_bytes() != before
    again = snakemake(folder, "--dry-run", record)
    assert "Nothing to be done" in again.stdout + again.stderr
    # The published files follow.
    assert {"reproject", "validate", "checksums"} <= planned(folder, "smoke").keys()


def test_a_plan_between_two_builds_hides_no_change(folder):
    """The settings files are newer then, whatever the times say later."""
    in_yaml("samples: 4", "samples: 5")(folder)
    assert planned(folder, "smoke").keys() >= VIEWS
    for root in ("results", "work"):
        for path in (folder / root).rglob("*"):
            os.utime(path, (1_700_000_000, 1_700_000_000))
    assert planned(folder, "smoke").keys() >= VIEWS


def test_files_that_are_not_noted_are_made_again(folder):
    bookkeeping.forget(folder, "work/smoke/scene.blend")
    assert {"build_scene", "inventory", "render"} <= planned(folder, "smoke").keys()


def test_every_file_that_a_job_reads_is_noted(smoke):
    """An input without a note could change unnoticed."""
    summary = snakemake(smoke, "--detailed-summary", "--", "smoke").stdout.splitlines()
    read_by_snakemake = {
        row["output_file"]: set(row["input-file(s)"].split(","))
        for row in csv.DictReader(summary, delimiter="\t")
    }
    noted = bookkeeping.noted(smoke)
    assert len(noted.keys() & read_by_snakemake.keys()) > 100
    # The summary has the declared outputs.
    for output in noted.keys() & read_by_snakemake.keys():
        job = noted[output]
        read = read_by_snakemake[output] - {"-", ""}
        unnoted = {name for name in read - job.inputs.keys() if bookkeeping.is_content(name)}
        assert not unnoted, output


def test_a_changed_input_that_no_job_makes_is_noticed(smoke, tmp_path):
    """Two builds run beside each other: an export is made while its light field is replaced."""
    folder = copy_of(smoke, tmp_path)
    export = f"results/smoke/{CUBOID}/perspective_hdr/exports/colmap/export.json"
    lightfield = f"results/smoke/{CUBOID}/perspective_hdr/lightfield.json"
    assert lightfield in bookkeeping.noted(folder)[export].inputs
    with bookkeeping.made_from_other_inputs(folder, {export: [lightfield]}):
        assert "export" in planned(folder, "smoke")


def test_damage_is_found_before_its_checksum_is_published(folder):
    """After the plan a digit changes at the same size. The job that reads the file refuses it."""
    dataset = folder / f"results/smoke/{CUBOID}"
    plan = ("--dry-run", "--forcerun", "validate", "--logger", "jobs", "--")
    planned_jobs = jobs_on(
        snakemake(folder, *plan, f"results/smoke/{CUBOID}/sha256sums.txt").stderr
    )
    (validate,) = (job for job in planned_jobs if job["rule"] == "validate")
    transforms = dataset / "perspective/transforms.json"
    transforms.write_text(transforms.read_text().replace("0.", "1.", 1))
    path = f"{forks.python().parent}:{os.environ['PATH']}"
    command = ["bash", "-c", validate["command"]]
    result = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, check=False)
    assert result.returncode == 1
    log = (folder / validate["log"][0]).read_text()
    name = transforms.relative_to(folder)
    assert log == f"error: {name}: is not as its job made it; the next run makes it again\n"
