"""One estimate of a build: `snakemake -n`, `plan`, the page and a GPU check print one figure."""

import re

import bookkeeping
import numpy as np
import pytest
from checkouts import ROOT

from lightfield.configuration.config_file import Energy, load_config, read_config
from lightfield.core.files import read_json, write_json
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses
from lightfield.measurement import gpu_check
from lightfield.planning import cost
from lightfield.planning.forecast import Work, forecast
from lightfield.planning.loading import scene_datasets
from lightfield.stages.measurement import Costs, CostSettings, FullSize, Plan
from lightfield.workflow.known_times import finished_of, read_known, time_files

RIG = "LFSphere_e100cm_d170cm"
# The garden's sphere at full size.
VIEWS, SIDE, SAMPLES = 642, 2048, 256
# Views of a preview.
SMALL = (16, 2)


class Build:
    """The folders of one build of the garden, and what its four programs print."""

    def __init__(self, folder):
        content = read_config(ROOT / "config.yaml") | {
            "work": str(folder / "work"),
            "results": str(folder / "results"),
        }
        self.folder, self.config = folder, load_config(content)
        datasets = scene_datasets("garden", settings=self.config)
        (self.dataset,) = (each for each in datasets if each.rig_name == RIG)
        self.files = time_files(self.dataset, self.config)

    def finish(self, preset, view_seconds, size, device="CPU", views=4):
        """Leave finished views of a preset. Each took the seconds, and the first one more."""
        side, samples = size
        lens = lenses.from_camera({"lens": "equirectangular", "resolution": [side, side]})
        render = {"samples": samples, "denoise": False}
        poses = [View.placed(f"view_{index}", np.eye(4)) for index in range(views + 1)]
        lightfield, receipts = self.of(preset)
        lightfield.parent.mkdir(parents=True)
        LightField({**lens.to_lightfield(), "render": render}, poses).write(lightfield)
        lines = [
            {"started": 0.0, "host": "there", "pid": 1},
            {"start_up_seconds": 2.0, "device": device, "threads": 1},
        ]
        for index, pose in enumerate(poses):
            seconds = view_seconds * (1 if index else 9)
            line = dict.fromkeys(("wall_seconds", "cpu_seconds", "render_seconds"), seconds)
            lines.append({"view": pose.name, "finished": float(index)} | line)
        bookkeeping.note_shard(receipts / f"0-{views + 1}.jsonl", {}, lines)

    def of(self, preset):
        """Return the lightfield.json and the receipts of the rig under a preset."""
        folder = f"/garden_{preset}/" if preset != "full" else "/garden/"
        return next(files for files in self.files.finished if folder in str(files[0]))

    def probe(self, view_seconds, device="CPU"):
        content = {"views": VIEWS, "resolution": [SIDE, SIDE], "samples": SAMPLES}
        content |= {"device": device, "denoise": False}
        content |= {"view_seconds": [view_seconds] * 3, "view_bytes": [1e6]}
        write_json(self.files.probe, content)

    def check_gpu(self, sample_seconds):
        content = {"gpu_seconds": 1e6 * sample_seconds, "samples": SAMPLES}
        write_json(self.files.gpu_check, content)

    # What is printed: the time, its device, and what it was measured by.

    def forecast(self, on_gpu=False):
        """`snakemake -n`."""
        estimate = cost.estimate_of(self.dataset, self.files.read(), on_gpu)
        works = [
            Work(
                "views",
                "garden/sphere",
                VIEWS,
                cost.rendering(self.dataset, VIEWS, estimate),
                estimate,
            )
        ]
        return printed(forecast(works))

    def plan(self):
        """`snakemake plan`."""
        finished = [("garden/sphere", *files) for files in self.files.finished]
        output = self.folder / "plan.md"
        job = Plan(
            dataset=[("garden/sphere", 1, self.files.probe)], finished=finished, output=output
        )
        job.run()
        return printed(output.read_text())

    def page(self, preset):
        """The figures of a preset's page."""
        lightfield, receipts = self.of(preset)
        output = self.folder / "costs.json"
        full = FullSize(views=VIEWS, resolution=[SIDE, SIDE], samples=SAMPLES, denoise=False)
        nothing = self.folder / "nothing"
        Costs(
            dataset=lightfield.parent,
            receipts=receipts,
            benchmarks=nothing,
            scene_benchmarks=[nothing],
            probe=self.files.probe,
            gpu_check=self.files.gpu_check,
            finished=self.files.finished,
            settings=CostSettings(energy=Energy(watts=1, cores=1), full=full),
            output=output,
        ).run()
        return printed(read_json(output)["extrapolation"]["rendering"])

    def gpu_check(self):
        """`snakemake gpu_check`, which has just measured the file of the check."""
        full = {RIG: FullSize(views=VIEWS, resolution=[SIDE, SIDE])}
        finished = [(RIG, *files) for files in self.files.finished]
        known = {RIG: read_known(self.files.probe, None, finished_of(finished, RIG))}
        content = read_json(self.files.gpu_check)
        (line,) = gpu_check.full_hours(content, SAMPLES, full, known)["rendering"]
        return printed(line)


def printed(text):
    """Return the time, the device and the source in the line about rendering."""
    (line,) = re.findall(r"rendering 642 views takes (.*) of (a GPU|one core), by (.*)", text)
    return line


@pytest.fixture
def build(tmp_path):
    return Build(tmp_path)


def hours(view_seconds):
    return f"{VIEWS * view_seconds / 3600:,.0f} h"


def test_all_estimates_of_a_dataset_are_those_of_its_probe(build):
    """The preview would say 1,300 h, and the guess 1,149 h."""
    build.finish("preview", 7290 * (16 * 16 * 2) / (SIDE * SIDE * SAMPLES), SMALL)
    build.probe(6757.0)
    build.check_gpu(1e-9)
    told = {build.forecast(), build.plan(), build.page("preview")}
    assert told == {("1,205 h", "one core", "a probe of 3 views")}


def test_all_estimates_of_a_dataset_on_a_gpu_are_those_of_its_probe(build):
    build.finish("preview", 0.5, SMALL, device="GPU")
    build.probe(500.0, device="GPU")
    build.check_gpu(1e-9)
    told = {build.forecast(on_gpu=True), build.plan(), build.page("preview"), build.gpu_check()}
    assert told == {(hours(500), "a GPU", "a probe of 3 views")}


def test_a_gpu_check_estimates_what_no_probe_measured(build):
    build.finish("preview", 0.5, SMALL, device="GPU")
    build.check_gpu(1e-7)
    told = {build.forecast(on_gpu=True), build.page("preview"), build.gpu_check()}
    assert told == {(hours(1e-7 * SIDE * SIDE * SAMPLES), "a GPU", "the GPU check")}
    # Times of a core say nothing of a GPU, nor a GPU's of a core.
    build.probe(6757.0)
    assert build.forecast(on_gpu=True) == build.gpu_check()
    assert build.forecast() == ("1,205 h", "one core", "a probe of 3 views")


def test_the_page_and_a_dry_run_extrapolate_from_the_same_views(build):
    """The views with the most path tracing are the sharpest, also for another preset's page."""
    build.finish("tiny", 9.0, (8, 1))
    build.finish("preview", 2.0, SMALL)
    # 128 times the side and samples.
    source = "4 finished views of 16 × 16 pixels with 2 samples"
    expected = {(hours(2 * 128**2 * 128), "one core", source)}
    assert {build.forecast(), build.page("preview"), build.page("tiny")} == expected


def test_finished_views_of_the_dataset_are_sharper_than_its_probe(build):
    build.probe(6757.0)
    build.finish("full", 5000.0, (SIDE, SAMPLES))
    source = "4 finished views of 2048 × 2048 pixels with 256 samples"
    told = {build.forecast(), build.plan(), build.page("full")}
    assert told == {(hours(5000), "one core", source)}


def test_two_finished_views_are_not_sharper_than_a_probe(build):
    build.probe(6757.0)
    build.finish("full", 5000.0, (SIDE, SAMPLES), views=2)
    assert build.forecast() == ("1,205 h", "one core", "a probe of 3 views")


def test_a_guess_and_damaged_files_are_named_as_such(build):
    guess = (hours(6e-6 * SIDE * SIDE * SAMPLES), "one core", "a guess: nothing was measured")
    assert build.forecast() == guess
    assert build.forecast(on_gpu=True) == guess
    for file in (build.files.probe, build.files.gpu_check):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text('{"views": 3')
    assert build.forecast(on_gpu=True) == guess


def test_a_dry_run_adds_gpu_time_apart_from_cpu_time(build):
    build.check_gpu(1e-7)
    estimate = cost.estimate_of(build.dataset, build.files.read(), on_gpu=True)
    works = [
        Work(
            "views",
            "garden/sphere",
            VIEWS,
            cost.rendering(build.dataset, VIEWS, estimate),
            estimate,
        ),
        Work("validation", "garden/sphere", 0, cost.Cost(60.0)),
    ]
    rows = {row.split()[0]: row.split() for row in forecast(works).splitlines() if row}
    assert rows["phase"][3:] == ["CPU", "time", "GPU", "time", "size"]
    gpu_hours = VIEWS * 1e-7 * SIDE * SIDE * SAMPLES / 3600
    gpu_time = f"{gpu_hours:.0f} h"
    assert " ".join(rows["views"]).startswith(f"views 1 642 3 s {gpu_time} ")
    assert " ".join(rows["all"]).startswith(f"all 2 642 63 s {gpu_time} ")
