"""Old results are used for what they are: in copies, with new times, and without receipts."""

import os
import re
import shutil
import subprocess
import time

import bookkeeping
import pytest
import tiny
from bookkeeping import rendered
from checkouts import assert_same_bytes, planned, snakemake

pytestmark = pytest.mark.slow
NOTHING = "Nothing to be done"
# The jobs that a change of the scene YAML plans.
PUBLISHED = {"export_to_instant_ngp", "validate", "checksums", "costs", "page", "index"}
REPROJECTED = {"lens_map", "reprojected_lightfield", "reproject"} | PUBLISHED
RENDERED = {"lightfield", "check_cameras", "render", "figures"} | REPROJECTED
CHANGES = {
    ("licence: CC0-1.0", "licence: CC-BY-4.0"): {"page", "index"},
    ("fov: 80", "fov: 70"): REPROJECTED,
    ("samples: 4", "samples: 5"): REPROJECTED
    | {"lightfield", "check_cameras", "render", "figures"},
}


def plan(folder):
    return snakemake(folder, "--dry-run", *tiny.CHOSEN).stderr


def copy_without_times(folder, parent):
    """Return a copy of everything with new times and without Snakemake's notes."""
    copy = shutil.copytree(folder, parent / "copy", copy_function=shutil.copyfile)
    shutil.rmtree(copy / ".snakemake")
    return copy


def test_a_copy_without_times_has_nothing_to_do(built_tiny, tmp_path):
    copy = copy_without_times(built_tiny, tmp_path)
    assert NOTHING in plan(copy)
    # The second plan reads no file again.
    assert NOTHING in plan(copy)


@pytest.mark.parametrize("without_notes", [False, True])
def test_a_changed_setting_plans_its_jobs_and_no_others(built_tiny, tmp_path, without_notes):
    if without_notes:
        folder = copy_without_times(built_tiny, tmp_path)
    else:
        folder = shutil.copytree(built_tiny, tmp_path / "copy")
    for (old, new), rules in CHANGES.items():
        tiny.edit(folder, old, new)
        assert planned(folder, *tiny.CHOSEN).keys() - {"all"} == rules
        tiny.edit(folder, new, old)
    assert NOTHING in plan(folder)


@pytest.mark.parametrize("without_notes", [False, True])
def test_new_times_run_nothing(tiny_build, without_notes):
    if without_notes:
        shutil.rmtree(tiny_build / ".snakemake")
    names = [
        path for name in ("results", "work", "configs") for path in (tiny_build / name).rglob("*")
    ]
    for path in [*names, tiny_build / "config.yaml", tiny_build / "Snakefile"]:
        os.utime(path)
        # Each file by itself takes too long.
    assert NOTHING in plan(tiny_build)
    for name in (
        tiny.LIGHTFIELD,
        tiny.BLEND,
        tiny.VIEW,
        bookkeeping.shard(tiny.NAME, "render", "0-2"),
    ):
        os.utime(tiny_build / name)
        assert NOTHING in plan(tiny_build), name


def spoil_a_view(folder):
    content = bytearray((folder / tiny.VIEW).read_bytes())
    content[-1] ^= 1
    (folder / tiny.VIEW).write_bytes(content)


def change_samples(folder):
    tiny.edit(folder, "samples: 4", "samples: 3")


@pytest.mark.parametrize("change", [spoil_a_view, change_samples])
def test_files_of_a_clock_that_was_ahead_hide_no_change(tiny_build, change):
    set_times(tiny_build, time.time() + 3600)
    assert NOTHING in plan(tiny_build)
    change(tiny_build)
    set_times(tiny_build, time.time() + 3600)
    for option in ("--keep-going", "--dry-run"):
        result = snakemake(tiny_build, *tiny.CHOSEN, option)
        assert result.returncode == 1
        assert ": its time is in the future (" in result.stderr
    (remedy,) = re.findall(r"present time: (.*)$", result.stderr, re.M)
    subprocess.run(remedy, shell=True, cwd=tiny_build, check=True)
    jobs = planned(tiny_build, *tiny.CHOSEN)
    assert jobs["render"] == (1 if change is spoil_a_view else 3)


def test_a_run_waits_for_a_clock_that_is_seconds_ahead(tiny_build):
    change_samples(tiny_build)
    set_times(tiny_build, time.time() + 4)
    assert planned(tiny_build, *tiny.CHOSEN)["render"] == 3


def set_times(folder, moment):
    """Give all files of a build a time."""
    for name in ("results", "work"):
        for path in (folder / name).rglob("*"):
            os.utime(path, (moment, moment))


def test_touching_outputs_with_snakemake_hides_nothing(tiny_build):
    (tiny_build / tiny.VIEW).write_text("not a view")
    tiny.build(tiny_build, "--touch")
    assert planned(tiny_build, *tiny.CHOSEN)["render"] == 1
    tiny.edit(tiny_build, "fov: 80", "fov: 70")
    tiny.build(tiny_build, "--touch")
    assert planned(tiny_build, *tiny.CHOSEN)["reproject"] == 3


def test_other_views_and_shards_give_the_bytes_of_a_fresh_build(tiny_build, tmp_path):
    for count, change in enumerate(
        [
            lambda: tiny.edit(tiny_build, "cameras: [3, 2]", "cameras: [3, 3]"),
            lambda: tiny.edit(tiny_build, "cameras: [3, 3]", "cameras: [2, 2]"),
        ]
    ):
        change()
        tiny.build(tiny_build)
        assert NOTHING in plan(tiny_build), count
    before = rendered(tiny_build)
    tiny.build(tiny_build, "views_per_shard=3")
    assert rendered(tiny_build) == before
    fresh = tiny.checked_out(tmp_path / "fresh")
    tiny.edit(fresh, "cameras: [3, 2]", "cameras: [2, 2]")
    tiny.build(fresh)
    assert_same_bytes(fresh, tiny_build)


def test_a_flipped_byte_at_the_old_time_is_refused_by_its_reader(tiny_build):
    """The plan compares sizes and times. Jobs that read the file, and verify, compare bytes."""
    view = tiny_build / tiny.VIEW
    status = view.stat()
    content = bytearray(view.read_bytes())
    content[len(content) // 2] ^= 1
    view.write_bytes(content)
    os.utime(view, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert NOTHING in plan(tiny_build)
    tiny.edit(tiny_build, "fov: 80", "fov: 70")
    result = snakemake(tiny_build, *tiny.CHOSEN)
    assert result.returncode == 1
    assert f"{tiny.VIEW}: is not as its job made it" in result.stdout + result.stderr
    # Now the plan knows.
    before = rendered(tiny_build)
    tiny.build(tiny_build)
    assert (rendered(tiny_build) - before).total() == 1


def test_the_views_of_a_dataset_without_receipts_are_not_rendered_again(built_tiny, tiny_build):
    """The published checksums tell which are intact."""
    bookkeeping.forget_all(tiny_build)
    tiny.build(tiny_build)
    assert not rendered(tiny_build)
    assert_same_bytes(built_tiny, tiny_build)
    assert NOTHING in plan(tiny_build)


# ---- what a run says at its end, and Snakemake's own files -----------------------------------

DATASET = f"results/{tiny.NAME}"
VALID = f"valid: {DATASET}/report/index.html\n"


def test_a_run_that_leaves_jobs_out_calls_nothing_valid(tiny_build):
    tiny.edit(tiny_build, "fov: 80", "fov: 70")
    for arguments in (["--until", "lens_map"], ["--touch"]):
        said = tiny.build(tiny_build, *arguments)
        assert f"not finished: {DATASET}\n" in said and "valid: " not in said, arguments
    said = tiny.build(tiny_build)
    assert VALID in said and "not " not in said


def planned_views(folder):
    """Return how many views a plan renders. Without any, the column is empty."""
    forecast = snakemake(folder, "--dry-run", *tiny.CHOSEN).stdout
    (row,) = re.findall(r"^views +\d+ +(?:(\d+) )? *\d.*$", forecast, re.M)
    return int(row or 0)


def test_a_plan_counts_only_the_views_that_a_run_will_render(tiny_build):
    tiny.edit(tiny_build, "    size: 0.5\n", "    size: 0.5\n    split: {every: 3}\n")
    assert planned_views(tiny_build) == 0
    tiny.build(tiny_build)
    # No view a second time.
    assert set(rendered(tiny_build).values()) == {1}
    (tiny_build / DATASET / "exr/view_0001f.exr").unlink()
    assert planned_views(tiny_build) == 1
    tiny.edit(tiny_build, "size: 0.5", "size: 0.6")
    assert planned_views(tiny_build) == 6


def test_more_cameras_of_a_random_rig_render_only_the_new_views(tmp_path):
    folder = tiny.checked_out(tmp_path / "random")
    plane = "    type: plane\n    cameras: [3, 2]\n"
    tiny.edit(folder, plane, "    type: random\n    clearance: 0.1\n    count: 4\n")
    tiny.build(folder)
    first = (folder / tiny.VIEW).read_bytes()
    tiny.edit(folder, "count: 4", "count: 12")
    assert planned_views(folder) == 8
    tiny.build(folder)
    assert len(rendered(folder)) == 12 and set(rendered(folder).values()) == {1}
    assert (folder / tiny.VIEW).read_bytes() == first
    assert NOTHING in plan(folder)


def test_a_run_that_leaves_the_page_of_all_datasets_out_does_not_name_it(tiny_build):
    handlers = tiny_build / "scripts/lightfield/workflow/handlers.py"
    # As if there were many datasets, of which only this page is named.
    handlers.write_text(handlers.read_text().replace("MOST_PAGES = 12\n", "MOST_PAGES = 0\n"))
    tiny.edit(tiny_build, "fov: 80", "fov: 70")
    (tiny_build / "results/index.html").unlink()
    said = tiny.build(tiny_build, "--until", "page")
    assert "\nvalid: 1 dataset: results\n" in said
    assert "valid: 1 dataset: results/index.html" not in said
    said = tiny.build(tiny_build)
    assert "\nvalid: 1 dataset: results/index.html\n" in said
    assert (tiny_build / "results/index.html").is_file()


def test_a_page_of_views_that_contradict_each_other_is_not_called_valid(tiny_build):
    first, second = (tiny_build / DATASET / f"exr/view_000{n}f.exr" for n in (0, 1))
    shutil.copyfile(first, second)
    bookkeeping.accept(tiny_build, tiny.NAME, "render", "0-2", "exr/view_0001f.exr")
    result = snakemake(tiny_build, *tiny.CHOSEN, "--until", "page")
    assert result.returncode == 0, result.stderr
    assert f"not valid: {DATASET}/report/index.html\n" in result.stderr
    assert f"\n{VALID}" not in result.stderr


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"\xff\xfe", "is not text"),
        (b'"x"', "is no note of Snakemake"),
        (b"[1]", "is no note of Snakemake"),
        (b"[" * 100_000, "is no note of Snakemake"),
    ],
    ids=["bytes", "text", "list", "deep"],
)
def test_a_note_of_snakemake_that_is_none_is_named(tiny_build, content, problem):
    note = next((tiny_build / ".snakemake/metadata").iterdir())
    note.write_bytes(content)
    result = snakemake(tiny_build, *tiny.CHOSEN, "--dry-run")
    assert result.returncode == 1
    assert f"error: .snakemake/metadata/{note.name}: {problem}" in result.stderr
    assert "Traceback" not in result.stderr
    (remedy,) = re.findall(r"(rm -r \S+);", result.stderr)
    subprocess.run(remedy, shell=True, cwd=tiny_build, check=True)
    assert NOTHING in plan(tiny_build)


@pytest.mark.parametrize("name", ["exr", "perspective", "report"])
def test_a_plan_names_a_folder_that_is_a_link_to_itself(tiny_build, name):
    folder = tiny_build / DATASET / name
    shutil.rmtree(folder)
    folder.symlink_to(name)
    result = snakemake(tiny_build, *tiny.CHOSEN, "--dry-run")
    assert result.returncode == 1
    assert f"error: {DATASET}/{name}: cannot be written: " in result.stderr
    assert f"{name} is a link that leads nowhere" in result.stderr


def test_a_dataset_that_a_run_changed_in_part_is_not_called_validated(tiny_build):
    sums = ["sha256sum", "-c", "--quiet", "sha256sums.txt"]
    dataset = tiny_build / "results" / tiny.NAME
    assert "validated: yes" in tiny.build(tiny_build, "--", "status")
    tiny.edit(tiny_build, "fov: 80", "fov: 70")
    tiny.build(tiny_build, "--until", "reproject")
    said = tiny.build(tiny_build, "--", "status")
    assert "validated: not since its reprojections were made" in said
    assert subprocess.run(sums, cwd=dataset, capture_output=True).returncode == 1
    tiny.build(tiny_build)
    assert "validated: yes" in tiny.build(tiny_build, "--", "status")
    subprocess.run(sums, cwd=dataset, check=True)
