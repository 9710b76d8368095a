"""The whole workflow with real bpy: a tiny dataset, every stage, and what can go wrong."""

import json
import os
import re
import shutil
import signal
import subprocess
import tarfile
import zipfile
from collections import Counter
from pathlib import Path

import bookkeeping
import numpy as np
import pytest
from bookkeeping import rendered, unfinished_shards
from checkouts import assert_same_bytes, checkout, planned, snakemake, start_snakemake
from waiting import wait_until

from lightfield.imaging import images

CUBOID = Path("results/smoke/LFCuboid_1x1x1")
pytestmark = pytest.mark.slow


@pytest.fixture
def other(tmp_path):
    """A checkout without any build."""
    return checkout(tmp_path / "other")


def succeeding(folder, *arguments):
    result = snakemake(folder, *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout + result.stderr


def failing(folder, *arguments):
    result = snakemake(folder, *arguments)
    assert result.returncode == 1, result.stdout + result.stderr
    return result.stdout + result.stderr


def files(folder):
    """Return the time of each file. A dry run must not change them."""
    paths = {path for name in ("results", "work") for path in (folder / name).rglob("*")}
    paths -= {folder / name for name in bookkeeping.OF_PLANS}
    return {path: path.stat().st_mtime_ns for path in paths if path.is_file()}


def test_every_dataset_is_valid_and_its_checksums_hold(smoke):
    datasets = [path.parent for path in smoke.glob("results/smoke/*/validation.json")]
    assert len(datasets) >= 3
    for dataset in datasets:
        assert json.loads((dataset / "validation.json").read_text())["valid"] is True
        subprocess.run(
            ["sha256sum", "--check", "--strict", "--quiet", "sha256sums.txt"],
            cwd=dataset,
            check=True,
        )
    assert len(list((smoke / CUBOID / "exr").glob("*.exr"))) == 6
    assert len(list((smoke / CUBOID / "perspective").glob("view_*.png"))) == 6
    transforms = json.loads((smoke / CUBOID / "perspective/transforms.json").read_text())
    for frame in transforms["frames"]:
        assert (smoke / CUBOID / "perspective" / frame["file_path"]).is_file()


def test_a_second_run_does_nothing(smoke):
    assert "Nothing to be done" in succeeding(smoke, "--cores", "2", "smoke")


def test_only_deleted_and_damaged_views_are_rendered_again(smoke, tmp_path):
    """A plan reports them and changes nothing. A run renders only them, to the same bytes."""
    folder = tmp_path / "copy"
    shutil.copytree(smoke, folder)
    before = rendered(folder)
    views, pictures = folder / CUBOID / "exr", folder / CUBOID / "perspective"
    (views / "view_b0000f.exr").unlink()
    half = views / "view_u0000f.exr"
    os.truncate(half, half.stat().st_size // 2)
    flipped = views / "view_d0000f.exr"
    content = bytearray(flipped.read_bytes())
    content[len(content) // 2] ^= 1
    flipped.write_bytes(content)
    half = pictures / "view_l0000f.png"
    os.truncate(half, half.stat().st_size // 2)
    (pictures / "view_d0000f.png").unlink()
    (pictures / "view_f0000f.png").write_bytes((pictures / "view_r0000f.png").read_bytes())

    times_before = files(folder)
    assert planned(folder, "smoke")["render"] == 1
    assert files(folder) == times_before
    succeeding(folder, "--cores", "2", "smoke")
    again = rendered(folder) - before
    assert sorted(name for _, name in again.elements()) == [
        "view_b0000f",
        "view_d0000f",
        "view_u0000f",
    ]
    assert_same_bytes(smoke, folder)
    # Both runs count, and repeated renders are reported.
    costs = json.loads((folder / CUBOID / "report/costs.json").read_text())
    (shard,) = costs["shards"]
    assert (shard["views"], shard["views_rendered"], shard["runs"]) == (6, 9, 2)
    assert 0 < shard["repeated_seconds"] < shard["wall_seconds"]


def test_an_invalid_dataset_gets_a_page_but_no_checksums_until_it_is_repaired(smoke, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(smoke, folder)
    dataset = folder / CUBOID
    view = dataset / "exr/view_b0000f.exr"
    image = images.read_image(view)
    kept = {key: value for key, value in image.attributes.items() if key.startswith("plenoforge:")}
    channels = {name: pixels.copy() for name, pixels in image.channels.items()}
    channels["G"][20:24, 30:40] = np.nan
    images.write_exr(view, channels, kept)
    # The view is wrong as if it had been rendered so.
    name = CUBOID.relative_to("results").as_posix()
    bookkeeping.accept(folder, name, "render", "0-6", "exr/view_b0000f.exr")
    # A stray file is not a fault: it is moved away.
    (dataset / "notes.txt").touch()

    nan = "colour: exr/view_b0000f.exr: 40 values are not a number"
    page_path = f"{CUBOID}/report/index.html"
    archive = "results/smoke/smoke_LFCuboid_1x1x1.tar"
    # A second run repairs nothing, so it validates and fails again.
    for _ in range(2):
        terminal = failing(folder, "--cores", "2", "smoke", archive)
        assert terminal.splitlines()[-2:] == [
            f"checksums failed: error: smoke/{CUBOID.name} is not valid, and so gets no checksums: "
            f"{nan}: see {page_path}",
            f"  log: work/logs/smoke/{CUBOID.name}/checksums.log",
        ]
        assert json.loads((dataset / "validation.json").read_text())["valid"] is False
        assert not (dataset / "sha256sums.txt").exists()
        assert not (folder / archive).exists()
        page = (folder / page_path).read_text()
        assert "This dataset failed its validation" in page
        assert 'alt="Colour of view_b0000f.exr"' in page
        assert "sha256sums.txt" not in page
        assert not (dataset / "notes.txt").exists()
    assert list((folder / "work/removed").rglob("notes.txt"))
    view.unlink()
    succeeding(folder, "--cores", "2", "smoke", archive)
    for suffix in (".tar", ".json"):
        (folder / archive).with_suffix(suffix).unlink()
    assert_same_bytes(smoke, folder)
    assert "This dataset failed" not in (dataset / "report/index.html").read_text()
    assert "Nothing to be done" in succeeding(folder, "--cores", "2", "smoke")


def test_a_package_unpacks_to_one_folder_named_after_scene_and_rig(smoke):
    package = smoke / "results/smoke/smoke_LFCuboid_1x1x1.tar"
    succeeding(smoke, "--cores", "1", package.relative_to(smoke))
    with tarfile.open(package) as file:
        names = {Path(name) for name in file.getnames()}
    package.unlink()
    package.with_suffix(".json").unlink()
    assert {name.parts[0] for name in names} == {"smoke_LFCuboid_1x1x1"}
    assert Path("smoke_LFCuboid_1x1x1/exr/view_b0000f.exr") in names
    assert not any("report" in name.parts for name in names)


def test_snakemakes_own_report_holds_the_figures_and_their_captions(smoke, tmp_path):
    succeeding(smoke, "--cores", "1", "smoke", "--report", str(tmp_path / "report.zip"))
    with zipfile.ZipFile(tmp_path / "report.zip") as file:
        html = file.read("report/report.html").decode()
        pictures = Counter(Path(name).name for name in file.namelist())
    for name, caption in (
        ("overview", "A panorama of the scene from the centre of the rig"),
        ("contact_sheet", "The views in their order"),
        ("rig", "The cameras of the rig"),
        ("depth", "The overview's depth on a logarithmic scale"),
    ):
        assert pictures[f"{name}.png"] == 3
        assert html.count(caption) == 3
    assert "Plenoforge makes light-field datasets" in html
    # It is read without a network.
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=.?(?:https?:)?//", html)


@pytest.mark.usefixtures("in_forks")
def test_after_a_kill_during_rendering_the_next_run_continues(smoke, other):
    """The bytes are the same with other shards, and on one core."""
    rigs = ("LFPlane_3x2_equisolid", "LFLattice_2panos")
    chosen = ("scenes=smoke", f"rigs=[{','.join(rigs)}]", "preset=full", "views_per_shard=2")
    landed = 0
    for views in (1, 3, 5):
        run = start_snakemake(other, "--cores", "2", "--config", *chosen)
        wait_until(
            lambda views=views: (
                unfinished_shards(other, "smoke")
                and len(list(other.glob("results/smoke/*/exr/*.exr"))) >= views
            ),
            run,
        )
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
        landed += bool(unfinished_shards(other, "smoke"))
    assert landed
    succeeding(other, "--cores", "1", "--config", *chosen)
    assert max(rendered(other).values()) == 1
    for rig in rigs:
        assert_same_bytes(smoke, other, f"smoke/{rig}")


@pytest.mark.parametrize("preset", ["tiny", "full"])
def test_the_default_scene_plans_its_stages(preset, smoke):
    rules = planned(smoke, "--config", f"preset={preset}")
    assert "build_scene" in rules
    assert "check_blend" not in rules


def test_targets_whose_settings_are_in_one_folder_are_planned_together(other):
    """The first target's settings are listed before those of the second are written."""
    folders = ("results=pair/results", "work=pair/work")
    panorama = "pair/work/smoke/LFCuboid_1x1x1/panorama"
    targets = (f"pair/{CUBOID}/lightfield.json", f"{panorama}/lightfield.json")
    rules = planned(other, *targets, "--config", *folders, "scenes=smoke")
    assert set(rules) == {"lightfield", "panorama_lightfield"}


def test_a_dry_run_ends_with_the_phases_and_their_sum(smoke):
    result = snakemake(smoke, "-n", "--cores", "1", "--config", "preset=tiny")
    before, _, table = result.stdout.partition("phase ")
    assert len((result.stderr + before).splitlines()) <= 4
    lines = table.splitlines()
    rows = [line.split() for line in lines[1 : lines.index("")]]
    assert [row[0] for row in rows] == [
        "scene",
        "cameras",
        "views",
        "reprojections",
        "exports",
        "validation",
        "report",
        "all",
    ]
    jobs = [int(row[1]) for row in rows]
    assert jobs[-1] == sum(jobs[:-1])
    assert [row[2] for row in rows if row[0] in ("views", "all")] == ["12", "12"]


def test_a_run_ends_with_its_forecast(other):
    folders = ("results=forecast/results", "work=forecast/work")
    target = f"forecast/{CUBOID}/lightfield.json"
    said = succeeding(other, "--cores", "1", "--config", *folders, "scenes=smoke", "--", target)
    times = r"^1 job in [\d.]+ m?s, [\d.]+ m?s of CPU time; the forecast was 1 s$"
    assert re.search(times, said, re.M)


@pytest.mark.parametrize(
    ("target", "problem"),
    [
        (
            "results/smoke/LFCuboid_1x1/sha256sums.txt",
            "results/smoke/LFCuboid_1x1: no dataset of the chosen scenes; is smoke/LFCuboid_1x1x1",
        ),
        (f"{CUBOID}/perspectiv/lightfield.json", f"{CUBOID}/perspectiv: no reprojection of it; is"),
        (f"{CUBOID}/exports/colmab/export.json", "exports/colmab: no export of it; is colmap me"),
        ("work/smoky/scene.blend", "work/smoky: no chosen scene; is smoke meant?"),
    ],
)
def test_a_missing_target_is_named_with_the_existing_ones(target, problem, other):
    last = failing(other, "--dry-run", target).splitlines()[-1]
    assert last.startswith("error: ") and problem in last
