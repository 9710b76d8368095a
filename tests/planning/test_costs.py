"""The costs of a dataset: added up from receipts and TSVs, and extrapolated to the full one."""

import json
import math
import re
import statistics

import bookkeeping
import numpy as np
import psutil
import pytest

from lightfield.engine import receipts
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses
from lightfield.measurement import costs
from lightfield.workflow import history

FULL = {"views": 3, "resolution": [8, 4], "samples": 2, "denoise": False}
POWER = {"watts": 100, "cores": 4}
HEAD = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"


def start(at, start_up=2.0, device="CPU", threads=1):
    return [
        {"started": at, "host": "there", "pid": 1},
        {
            "start_up_seconds": start_up,
            "start_up_cpu_seconds": start_up / 2,
            "device": device,
            "threads": threads,
        },
    ]


def view(name, finished, wall, traced, cpu, memory=100):
    return {
        "view": name,
        "finished": finished,
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "render_seconds": traced,
        "synchronization_seconds": 0.0,
        "memory_bytes": memory,
    }


def end(at, wall, cpu, memory):
    return {
        "ended": at,
        "wall_seconds": wall,
        "cpu_seconds": cpu,
        "peak_memory_bytes": memory,
    }


# Killed after two of three views. The second view was then lost, and rendered again.
KILLED = [
    *start(1000.0),
    view("a", 1012.0, wall=10.0, traced=6.0, cpu=10.0),
    view("b", 1022.0, wall=10.0, traced=8.0, cpu=10.0, memory=300),
]
RESUMED = [
    *start(2000.0),
    view("b", 2010.0, wall=8.0, traced=4.0, cpu=8.0),
    view("c", 2020.0, wall=10.0, traced=9.0, cpu=10.0),
    end(2021.0, wall=21.0, cpu=19.5, memory=700),
]


@pytest.fixture
def dataset(tmp_path, run_program):
    """A dataset of three views of 8 × 4 pixels with the receipts and TSVs of its jobs."""
    folder, work = tmp_path / "results", tmp_path / "work"
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [8, 4]})
    render = {"samples": 2, "denoise": False}
    for path, size in (("exr/a.exr", 100), ("exr/b.exr", 200), ("flat/a.png", 70)):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"x" * size)
    (work / "scene.blend").parent.mkdir()
    (work / "scene.blend").write_bytes(b"x" * 5000)
    for path, row in {
        "scene/build_scene.tsv": "4.0\t0:00:04\t200.0\t0\t0\t0\t0\t0\t50\t3.0",
        # The job was too short for Snakemake to measure it.
        "rig/flat/0-3.tsv": "0.4\t0:00:00\tNA\tNA\tNA\tNA\tNA\tNA\tNA\tNA",
        "rig/flat/lens_map.tsv": "2.0\t0:00:02\t50.0\t0\t0\t0\t0\t0\t50\t1.0",
        # This TSV has the last run alone, so it does not count. The receipt has both runs.
        "rig/render/0-3.tsv": "21.0\t0:00:21\t700.0\t0\t0\t0\t0\t0\t50\t19.0",
    }.items():
        (work / path).parent.mkdir(parents=True, exist_ok=True)
        (work / path).write_text(HEAD + row + "\n")

    def count(*lines, full=None, inventory=None, names="abc"):
        views = [View.placed(name, np.eye(4)) for name in names]
        content = {**lens.to_lightfield(), "render": render}
        LightField(content, views).write(folder / "lightfield.json")
        folder_of_receipts = work / "receipts/rig/render"
        # This copy by the user belongs to no shard.
        for name in ("kept", "0-3"):
            bookkeeping.note_shard(folder_of_receipts / f"{name}.jsonl", {}, lines)
        arguments = []
        if inventory:
            (work / "inventory.json").write_text(json.dumps(inventory))
            arguments = ["--inventory", work / "inventory.json"]
        settings = {"energy": POWER, "full": FULL | (full or {}), "reprojections": ["flat"]}
        (tmp_path / "settings.json").write_text(json.dumps(settings))
        run_program(
            "costs.py",
            "--dataset",
            folder,
            "--receipts",
            folder_of_receipts,
            "--benchmarks",
            work / "rig",
            "--scene-benchmarks",
            work / "scene",
            "--blend",
            work / "scene.blend",
            "--settings",
            tmp_path / "settings.json",
            "--output",
            tmp_path / "costs.json",
            *arguments,
        )
        return json.loads((tmp_path / "costs.json").read_text())

    return count


def test_all_time_counts_and_repeated_time_is_reported(dataset):
    costs_content = dataset(*KILLED, *RESUMED)
    (shard,) = costs_content["shards"]
    assert shard["shard"] == "0-3"
    assert (shard["views"], shard["views_rendered"]) == (3, 4)
    assert (shard["runs"], shard["killed_runs"]) == (2, 1)
    assert shard["wall_seconds"] == 22 + 21
    assert shard["cpu_seconds"] == 1 + 20 + 19.5
    assert shard["peak_memory_bytes"] == 700
    assert shard["path_tracing_seconds"] == 6 + 8 + 4 + 9
    assert shard["overhead_seconds"] == 43 - 27
    # The first rendering of view b, and the second start.
    assert shard["repeated_seconds"] == 10 + 2
    for key in ("path_tracing_seconds", "overhead_seconds", "repeated_seconds"):
        assert costs_content[key] == shard[key]


def test_each_stage_has_its_jobs_times_and_bytes(dataset):
    costs_content = dataset(*KILLED, *RESUMED)
    stages = {stage.pop("stage"): stage for stage in costs_content["stages"]}
    assert list(stages) == ["scene", "render", "flat"]
    assert stages["scene"] == {
        "jobs": 1,
        "wall_seconds": 4.0,
        "cpu_seconds": 3.0,
        "peak_memory_bytes": 200 * 2**20,
        "bytes": 5000,
    }
    assert stages["flat"] == {
        "jobs": 2,
        "wall_seconds": 2.4,
        "cpu_seconds": 1.4,
        "peak_memory_bytes": 50 * 2**20,
        "bytes": 70,
    }
    assert (stages["render"]["wall_seconds"], stages["render"]["bytes"]) == (43, 300)
    # 100 W times the busy part of four cores.
    seconds = (3.0 + 40.5 + 1.4) / 4
    assert costs_content["energy_kwh"] == pytest.approx(100 * seconds / 3600 / 1000)


def test_a_graphics_card_takes_the_whole_machine(dataset):
    lines = [
        *start(0.0, device="GPU"),
        view("a", 12.0, wall=10.0, traced=9.0, cpu=1.0),
        end(12.0, wall=12.0, cpu=2.0, memory=1),
    ]
    costs_content = dataset(*lines)
    assert costs_content["device"] == "GPU"
    assert costs_content["energy_kwh"] == pytest.approx(100 * (12 + 4.4 / 4) / 3.6e6)


def test_the_full_dataset_is_extrapolated_from_the_path_tracing_of_the_views(dataset):
    traced = [4.0, 5.0, 6.0, 5.0]
    lines = start(0.0)
    # The first view prepares the scene, so it does not represent the others.
    for name, seconds in zip("zabcd", [50.0, *traced], strict=True):
        lines.append(view(name, 10.0, wall=seconds + 1, traced=seconds, cpu=seconds + 1))
    full = {"views": 40, "resolution": [16, 8], "samples": 20}
    extrapolation = dataset(*lines, full=full, names="zabcd")["extrapolation"]
    assert (extrapolation["views"], extrapolation["resolution"], extrapolation["samples"]) == (
        40,
        [16, 8],
        20,
    )
    # Four times the pixels, ten times the samples. In proportion to pixels: the second that each
    # view took beside path tracing, and the reprojection's jobs for five views.
    path_tracing = 40 * statistics.mean(traced) * 40
    each = 40 * (1.0 + 1.4 / 5) * 4
    once = 1.0 + 1.0 + 3.0
    assert extrapolation["core_hours"] == pytest.approx((path_tracing + each + once) / 3600)
    # The standard error of a mean of 4 out of 40 views.
    error = statistics.stdev(traced) / 2 * math.sqrt(1 - 4 / 40)
    assert extrapolation["core_hours_uncertainty"] == pytest.approx(error * 40 * 40 / 3600)
    kwh = extrapolation["core_hours"] / 4 * 0.1
    assert extrapolation["energy_kwh"] == pytest.approx(kwh)
    assert extrapolation["energy_kwh_uncertainty"] / kwh == pytest.approx(
        extrapolation["core_hours_uncertainty"] / extrapolation["core_hours"]
    )
    assert extrapolation["gigabytes"] == pytest.approx(300 / 5 * 40 * 4 / 1e9)
    assert "4 views: 8 × 4 pixels, 2 samples" in extrapolation["basis"]
    # The description follows from this build alone.
    assert "40 times the path tracing" in extrapolation["basis"]
    same = dataset(*lines)["extrapolation"]["basis"]
    assert "times the path tracing" not in same
    assert not re.search(r"\d\.\d", extrapolation["basis"] + same)


def test_views_of_earlier_settings_do_not_tell_the_cost_of_the_full_dataset(dataset):
    """The rig once had ten views of fewer samples. Their history stays."""
    of_dataset = [*start(2000.0), *(view(n, 2010.0, 6.0, traced=5.0, cpu=6.0) for n in "abc")]
    expected = dataset(*of_dataset)["extrapolation"]
    earlier = [view(n, 1010.0, 1.5, traced=0.5, cpu=1.5) for n in "abcdefghij"]
    both = dataset(*start(1000.0, start_up=0.0), *earlier, *of_dataset)["extrapolation"]
    assert "path tracing of 2 views:" in both["basis"]
    # Only the first view of the earlier process adds what it took beside path tracing.
    assert both["core_hours"] == pytest.approx(expected["core_hours"] + 1.0 / 3600)


def test_times_of_a_core_and_of_a_graphics_card_are_not_averaged(dataset):
    """A run on the processor was interrupted. The next one had a graphics card."""
    on_core = [
        *start(1000.0, start_up=0.0),
        view("c", 1100.0, wall=100.0, traced=100.0, cpu=100.0),
        view("a", 1200.0, wall=100.0, traced=100.0, cpu=100.0),
    ]
    on_card = [
        *start(2000.0, start_up=0.0, device="GPU"),
        view("b", 2002.0, wall=2.0, traced=2.0, cpu=1.0),
        view("c", 2004.0, wall=2.0, traced=2.0, cpu=1.0),
        end(2005.0, wall=5.0, cpu=2.0, memory=1),
    ]
    content = dataset(*on_core, *on_card)
    assert content["device"] == "GPU"
    extrapolation = content["extrapolation"]
    # Three views of 2 s, and the scene's and the reprojection's jobs on one of four cores.
    assert extrapolation["core_hours"] == pytest.approx((3 * 2 + (3.0 + 1.4) / 4) / 3600)
    assert "path tracing of 1 view:" in extrapolation["basis"]
    # In all, 200 s of a core, and 5 s of the machine.
    machine = 5 + (200 + 3.0 + 1.4) / 4
    assert content["energy_kwh"] == pytest.approx(100 * machine / 3.6e6)
    assert "all of it while a graphics card renders" in content["attribution"]


def test_the_bytes_of_exports_are_those_of_all_their_files(dataset, tmp_path):
    folder = tmp_path / "results"
    for path, size in (
        ("transforms.json", 1),
        ("exports/nerfstudio/transforms.json", 20),
        ("flat/transforms.json", 300),
        ("flat/exports/colmap/points3D.txt", 4000),
    ):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"x" * size)
    # A linked view takes no more space.
    (folder / "flat/exports/colmap/a.png").hardlink_to(folder / "flat/a.png")
    table = tmp_path / "work/rig/export/flat/colmap.tsv"
    table.parent.mkdir(parents=True)
    table.write_text(HEAD + "4.0\t0:00:04\t200.0\t0\t0\t0\t0\t0\t50\t3.0\n")
    sizes = {stage["stage"]: stage["bytes"] for stage in dataset(*KILLED, *RESUMED)["stages"]}
    assert sizes == {"scene": 5000, "render": 300, "flat": 70, "export": 4321}


def test_the_full_dataset_defaults_to_the_samples_of_the_blend(dataset):
    inventory = {"blend": {"samples": 6}}
    content = dataset(*KILLED, *RESUMED, full={"samples": "file"}, inventory=inventory)
    assert content["extrapolation"]["samples"] == 6


def test_other_programs_do_not_count_as_path_tracing():
    # Other programs used the machine too: of 20 s of wall time the process had 10, on one thread.
    lines = [*start(0.0), view("a", 20.0, wall=20.0, traced=16.0, cpu=10.0)]
    part = history.ProcessHistory(lines[0] | lines[1], [lines[2]])
    (rendering,) = costs.renderings(part)
    assert rendering.path_tracing == pytest.approx(8.0)
    assert rendering.rest == pytest.approx(2.0)


def test_views_without_history_have_no_known_cost(dataset):
    costs_content = dataset({"started": 5.0, "host": "there", "pid": 1}, end(6.0, 1.0, 0.5, 9))
    assert costs_content["extrapolation"] is None
    assert costs_content["shards"][0]["views_rendered"] == 0


def test_denoising_counts_as_three_samples(dataset):
    lines = [*start(0.0), *(view(name, 10.0, wall=6.0, traced=5.0, cpu=6.0) for name in "abc")]
    plain, denoised = (
        dataset(*lines, full={"denoise": denoise})["extrapolation"]["core_hours"]
        for denoise in (False, True)
    )
    # 3 views of 5 s with 2 samples.
    assert denoised - plain == pytest.approx(3 * 5.0 * 3 / 2 / 3600)


def test_a_line_that_a_kill_cut_short_is_left_out(tmp_path):
    file = tmp_path / "0-3.part"
    file.write_text("\n".join(map(json.dumps, KILLED)) + '\n{"view": "c", "fin')
    (part,) = history.read(file.with_suffix(".jsonl"))
    assert [line["view"] for line in part.views] == ["a", "b"]
    assert part.end is None


def test_a_processs_peak_memory_is_in_bytes(tmp_path):
    file = tmp_path / "receipts/0-1.jsonl"
    header = {"stage": "render_shard", "version": None, "settings": {}}
    with receipts.opened(file, header, []) as receipt:
        log = history.History()
        now = psutil.Process().memory_info().rss
        log.end()
        receipt.seal()
    (run,) = history.read(file)
    # The system's figure lags a little. A peak is never below the memory in use now.
    assert 0.9 * now < run.peak_memory_bytes < psutil.virtual_memory().total
