"""The GPU benchmark, on the processor: what it writes, and that its OSL camera is the lens."""

import json

import numpy as np
import pytest
import tiny
from conftest import ROOT

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images

BENCHMARK = ROOT / "benchmarks" / "gpu.py"
SMALL = ("--scenes", "tiny", "--devices", "cpu", "--size", 24, "--samples", 2, "--preset", "tiny")
STEPS = [
    "tiny scene",
    "tiny first small view, cpu",
    "tiny plain, cpu",
    "tiny denoised, cpu",
    "tiny denoised, cpu, without depth",
    "tiny camera by OSL, cpu",
    "tiny build, cpu",
]
# Cycles rounds each of four times to hundredths of a second.
ROUNDED = 0.02
# Writes a hollow cube around the origin.
CUBE = """
import sys
from pathlib import Path
import bpy
from lightfield.rendering.scenes import blend_file
blend_file.new_scene()
bpy.ops.mesh.primitive_cube_add(size=6)
blend_file.save_scene(Path(sys.argv[1]))
"""
HALF_SIDE = 3.0


@pytest.fixture
def own_folder(tmp_path):
    scenes = tmp_path / "configs" / "scenes"
    scenes.mkdir(parents=True)
    (scenes / "tiny.yaml").write_text(tiny.SCENE)
    return tmp_path


def rows(folder, table):
    steps = json.loads((folder / "measured/gpu.json").read_text())["steps"].values()
    return [step["row"] for step in steps if step["table"] == table]


def test_the_benchmark_measures_every_step_and_goes_on_where_it_ended(own_folder, run_program):
    arguments = ("--output", "measured", *SMALL)
    run_program(BENCHMARK, *arguments, "--minutes", 0, cwd=own_folder)
    listed = (own_folder / "measured/gpu.md").read_text()
    assert [step for step in STEPS if f"| {step} | was not begun: " in listed] == STEPS

    run_program(BENCHMARK, *arguments, cwd=own_folder)
    content = json.loads((own_folder / "measured/gpu.json").read_text())
    assert content["missing"] == {}
    assert list(content["steps"]) == STEPS
    assert "was not begun" not in (own_folder / "measured/gpu.md").read_text()
    views = rows(own_folder, "Seconds of a view by step")
    assert [(row["samples"], row["denoiser"], row["depth"]) for row in views] == [
        (1, "none", True),
        (2, "none", True),
        (2, "processor", True),
        (2, "processor", False),
    ]
    for row in views:
        columns = list(row)
        steps = columns[columns.index("view") + 1 : -1]
        # A thread does the steps from this one on while the next view is rendered.
        writing = steps.index("convert")
        assert sum(row[step] for step in steps[:writing]) == pytest.approx(row["view"])
        assert sum(row[step] for step in steps[writing:]) > 0
        assert min(row[step] for step in steps) > -ROUNDED
    (camera,) = rows(own_folder, "A camera by OSL beside Cycles' own")
    assert camera["noises"] < 0.1
    assert camera["depths"] == 0
    (build,) = rows(own_folder, "A build by Snakemake")
    assert build["valid"]
    assert build["views"] == 6

    again = run_program(BENCHMARK, *arguments, "--minutes", 0, cwd=own_folder)
    assert again.stdout.strip() == "measured/gpu.md: 0 steps are missing"
    refused = run_program(BENCHMARK, *arguments, "--size", 16, cwd=own_folder, check=False)
    assert refused.stderr.startswith("error: --output measured: ")


def test_a_machine_without_such_a_gpu_is_refused_in_one_line(tmp_path, run_program):
    result = run_program(
        BENCHMARK, "--output", tmp_path / "measured", "--devices", "metal", check=False
    )
    assert result.returncode == 1
    assert result.stderr.startswith("error: --devices: this machine has no metal device ")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "measured").exists()


@pytest.mark.parametrize(
    "camera",
    [
        {"lens": "equidistant", "fov": 180, "resolution": [48, 48]},
        {"lens": "equidistant", "fov": 220, "resolution": [48, 32]},
    ],
    ids=["180", "220 wide"],
)
def test_the_shader_has_the_rays_of_the_lens(camera, tmp_path, run_program):
    (tmp_path / "cube.py").write_text(CUBE)
    run_program(tmp_path / "cube.py", tmp_path / "cube.blend")
    lens = lenses.from_camera(camera)
    rig = {"type": "lattice", "cameras": [1, 1, 1], "center": [0.4, -0.7, 1.1]}
    render = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    lightfield = LightField.from_rig(
        rig | {"rotation": [40, -5, 12]}, lens, depth="distance", frame=1, render=render
    )
    lightfield.write(tmp_path / "lightfield.json")
    arguments = ["--blend", tmp_path / "cube.blend", "--lightfield", tmp_path / "lightfield.json"]
    arguments += ["--output", tmp_path / "exr", "--receipt", tmp_path / "receipts/views.jsonl"]
    arguments += ["--times", tmp_path / "times.json", "--device", "cpu", "--osl"]
    run_program(ROOT / "benchmarks/timed_shard.py", *arguments)

    (view,) = lightfield.views
    rays = lens.pixel_rays() @ view.world_from_camera[:3, :3].T
    walls = (np.copysign(HALF_SIDE, rays) - view.position) / rays
    distance = np.nan_to_num(walls.min(axis=-1), nan=np.inf)
    measured = images.read_image(tmp_path / "exr" / f"{view.name}.exr").channels["Z"]
    np.testing.assert_allclose(measured, distance, rtol=1e-5)
