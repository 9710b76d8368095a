"""The GPU check: when pictures count as the same, and the estimated hours. Needs no GPU."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import simulated_gpus
from checkouts import ROOT
from conftest import BLENDER

from lightfield.configuration.config_file import Energy, load_config, read_config
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import lenses
from lightfield.measurement import costs, gpu_check, plan
from lightfield.measurement.equal_error import EqualError
from lightfield.measurement.trials import Trial
from lightfield.planning import cost as planning
from lightfield.planning.cost import read_probe
from lightfield.planning.loading import scene_datasets
from lightfield.stages.measurement import FullSize
from lightfield.workflow import history

CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [96, 96]}
RIG = {"type": "plane", "cameras": [2, 1], "size": 0.3}
NOISE = 0.3
# What the simulated GPU takes for a sample of a pixel.
SAMPLE_SECONDS = 1e-7
PROGRAM = """
import json, sys
from pathlib import Path
from lightfield.formats.lightfield import LightField
from lightfield.measurement import gpu_check, trials
lightfield = LightField.read("lightfield.json")
renderer = trials.Trials(*sys.argv[1:], lightfield, "cpu", 1, Path("cache"))
print(json.dumps(gpu_check.check(renderer, "cpu", 4, {})))
"""


class Simulated:
    """Trials that render nothing: their seeds' noise on a known picture."""

    def __init__(self, lens, device="cpu"):
        self.lens, self.device, self.lightfield = lens, device, None
        self.first_view = lens

    def on(self, device, lens):
        return Simulated(lens, device)

    def mask(self, window):
        return np.isfinite(self.lens.pixel_rays()[..., 0])

    def render(self, window, seed, sampling):
        height, width = self.lens.height, self.lens.width
        light = np.linspace(0.1, 2, width * height * 3, dtype=np.float32)
        light = light.reshape(height, width, 3)
        random = np.random.default_rng(seed)
        # Like path tracing, now and then a path is bright.
        noise = random.exponential(NOISE, light.shape) - NOISE
        noise += (random.random(light.shape) < 1e-3) * 5 - 0.005
        depth = np.where(light[..., 0] < 1.5, light[..., 0] + 1, np.inf)
        samples = sampling["samples"]
        seconds = width * height * samples * 1e-6 / (10 if self.device == "gpu" else 1)
        colour = (light * (1 + noise)).astype(np.float32)
        return Trial(colour, depth.astype(np.float32), samples, seconds, self.device.upper())


@pytest.fixture(scope="module")
def trials():
    renderer = Simulated(lenses.from_camera(CAMERA))
    made = [renderer.render(renderer.first_view, seed, {"samples": 4}) for seed in range(8)]
    return made[:4], made[4:], renderer.mask(renderer.first_view)


def test_renders_of_other_seeds_are_the_same_picture(trials):
    first, second, mask = trials
    comparison = gpu_check.compare(first, second, mask)
    assert comparison.same
    assert comparison.colour == pytest.approx(1, abs=0.5)
    assert comparison.depth == 0


@pytest.mark.parametrize(
    "change",
    [
        lambda trial: replace(trial, colour=trial.colour * np.float32(1.02)),
        lambda trial: replace(trial, colour=trial.colour[::-1]),
        lambda trial: replace(trial, colour=trial.colour * np.float32([1.05, 1, 0.95])),
        lambda trial: replace(trial, depth=trial.depth * np.float32(1.0002)),
        lambda trial: replace(trial, depth=np.roll(trial.depth, 4, axis=1)),
        lambda trial: replace(trial, depth=np.full_like(trial.depth, np.inf)),
    ],
    ids=["exposure", "mirrored", "tinted", "depth", "shifted", "misses"],
)
def test_a_changed_picture_is_not_the_same(trials, change):
    first, second, mask = trials
    assert not gpu_check.compare(first, [change(trial) for trial in second], mask).same


def test_pictures_without_noise_are_compared_exactly(trials):
    first, _, mask = trials
    still = [replace(trial, colour=np.full_like(trial.colour, 0.5)) for trial in first]
    assert gpu_check.compare(still, still, mask).same
    brighter = [replace(trial, colour=trial.colour * 2) for trial in still]
    assert not gpu_check.compare(still, brighter, mask).same


def test_hours_follow_from_views_pixels_and_samples():
    full = {"big": FullSize(views=10, resolution=[2000, 1000])}
    renderer = Simulated(lenses.from_camera(CAMERA))
    content = gpu_check.check(renderer, "gpu", 256, full)
    assert content["devices"] == ["CPU", "GPU"]
    assert content["core_seconds"] == pytest.approx(1)
    assert content["gpu_seconds"] == pytest.approx(0.1)
    assert content["hours"]["big"] == pytest.approx(10 * 2e6 * 256 * 1e-7 / 3600)
    assert "times as fast as on one core" in gpu_check.table("garden", content)


def test_the_processor_agrees_with_itself(tmp_path, run_program, room, monkeypatch):
    """Uses real renders, with the processor in place of the GPU."""
    content = LightField.from_rig(
        RIG | {"center": [0, 0, 1.5]},
        lenses.from_camera(CAMERA | {"resolution": [48, 48]}),
        depth="z",
        frame=1,
        render={"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0},
    )
    content.write(tmp_path / "lightfield.json")
    run_program("inventory.py", "--blend", room, "--output", tmp_path / "inventory.json")
    program = tmp_path / "check.py"
    program.write_text(PROGRAM)
    result = run_program(program, room, tmp_path / "inventory.json", cwd=tmp_path)
    assert '"same": true' in result.stdout
    # The program itself says so in one line, without writing a file.
    arguments = ["--blend", room, "--inventory", tmp_path / "inventory.json"]
    arguments += ["--lightfield", tmp_path / "lightfield.json", "--cache", tmp_path / "cache"]
    arguments += ["--output", tmp_path / "room"]
    for device, said in (("cpu", "device: is cpu"), ("metal", "has no metal device")):
        refused = run_program("gpu_check.py", *arguments, "--device", device, check=False)
        assert refused.returncode == 1
        assert refused.stderr.count("error: ") == 1
        assert said in refused.stderr
    assert not (tmp_path / "room.json").exists()
    # Before it measures a GPU, the driver compiles Cycles' kernels.
    simulated_gpus.write_nvidia_smi(tmp_path, [simulated_gpus.H200])
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("CUDA_CACHE_PATH", str(tmp_path / "kernels"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    told = []
    for _ in range(2):
        program = BLENDER / "simulated_gpu.py"
        checked = run_program(program, 0, "gpu_check.py", *arguments, "--device", "cuda")
        told.append("compiling Cycles' kernels for NVIDIA H200" in checked.stderr)
        shutil.rmtree(tmp_path / "cache")
    assert told == [True, False]


@pytest.fixture
def garden(tmp_path, monkeypatch):
    """The garden's first dataset at full size, and the time of a sample of the simulated GPU."""
    monkeypatch.setattr(planning, "SAMPLE_SECONDS", SAMPLE_SECONDS)
    content = read_config(ROOT / "config.yaml") | {"work": str(tmp_path), "preset": "full"}
    dataset, *_ = scene_datasets("garden", settings=load_config(content))
    return dataset


@pytest.mark.parametrize("denoise", [False, True])
def test_each_estimate_of_one_dataset_gives_the_same_hours(garden, denoise):
    """A sample of a pixel takes `SAMPLE_SECONDS`. Four programs estimate a dataset's hours."""
    dataset = replace(garden, render=garden.render.changed(denoise=denoise))
    width, height = dataset.rig.camera.resolution
    samples = dataset.render.samples
    # A denoised pixel takes three samples longer.
    seconds = dataset.view_count * width * height * (samples + 3 * denoise) * SAMPLE_SECONDS
    hours = {"by hand": seconds / 3600}
    # `snakemake -n`, which adds the start of Blender.
    hours["forecast"] = (planning.rendering(dataset).seconds - planning.START_UP_SECONDS) / 3600
    # `snakemake gpu_check`.
    full = FullSize(views=dataset.view_count, resolution=[width, height])
    renderer = Simulated(lenses.from_camera(CAMERA))
    cost_samples = planning.pixel_cost(RenderBlock(samples=samples, denoise=denoise), None)
    checked = gpu_check.check(renderer, "gpu", cost_samples, {"LFSphere": full})
    hours["GPU check"] = checked["hours"]["LFSphere"]
    # The page of a preview of 8 × 4 pixels with 2 samples.
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [8, 4]})
    render = {"samples": 2, "denoise": denoise}
    lightfield = LightField(
        {**lens.to_lightfield(), "render": render}, [View.placed("a", np.eye(4))]
    )
    took = 8 * 4 * (2 + 3 * denoise) * SAMPLE_SECONDS
    rendered = {"view": "a", "finished": 9.0, "wall_seconds": took, "cpu_seconds": took}
    run = history.ProcessHistory(
        {"started": 0.0, "device": "CPU", "threads": 1}, [rendered | {"render_seconds": took}]
    )
    size = full.model_copy(update={"samples": samples, "denoise": denoise})
    page = costs.extrapolation([run], {}, 0, lightfield, Energy(watts=1, cores=1), size, [])
    hours["page"] = page["core_hours"]
    # `snakemake plan`, whose probe rendered a view. Then the forecast takes the probe's seconds.
    probe = {
        "views": dataset.view_count,
        "resolution": [width, height],
        "samples": samples,
        "device": "CPU",
        "denoise": denoise,
        "view_seconds": [seconds / dataset.view_count],
        "view_bytes": [1e6],
    }
    path = Path(dataset.work_root, dataset.scene_folder, dataset.rig_name, "probe.json")
    write_json(path, probe)
    expected = plan.Expected("garden", 1, read_probe(path), EqualError())
    hours["plan"] = expected.cost.seconds / 3600
    probed = planning.rendering(dataset).seconds - planning.START_UP_SECONDS
    hours["forecast with a probe"] = probed / 3600
    assert hours == pytest.approx(dict.fromkeys(hours, hours["by hand"]))


def test_adaptive_sampling_costs_what_its_calibration_measured(tmp_path):
    calibration = tmp_path / "calibration.json"
    calibration.write_text('{"choice": {"samples": 4096, "denoise": true}, "cost_samples": 40.5}')
    render = RenderBlock(samples=4096, denoise=True)
    assert planning.pixel_cost(render, None) == 4096 + 3
    assert planning.pixel_cost(render, calibration) == 40.5
    calibration.write_text("{}")
    with pytest.raises(UserError, match=r"calibration\.json: cost_samples: is missing"):
        planning.pixel_cost(render, calibration)
