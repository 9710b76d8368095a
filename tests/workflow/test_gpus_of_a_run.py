"""A run on a machine with GPUs, which nvidia-smi's answers simulate. The processor renders."""

import os
from itertools import pairwise

import simulated_gpus
from checkouts import checkout, snakemake
from conftest import BLENDER

from lightfield.core.units import duration
from lightfield.workflow import history

RENDERS_ON = "renders on the GPU NVIDIA H200 (device=auto; device=cpu for the processor)"
WITH_GPU = f"""
import sys
sys.path.insert(0, {str(BLENDER.parent)!r})
import simulated_gpus
simulated_gpus.let_cycles_see_one()
"""


def on_one_gpu(folder, *arguments, device="auto"):
    """Run Snakemake in a checkout on a machine whose driver lists one GPU. Return its result."""
    (folder / "bin").mkdir(exist_ok=True)
    simulated_gpus.write_nvidia_smi(folder / "bin", [simulated_gpus.H200])
    variables = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "TMPDIR": str(folder)}
    variables["CUDA_CACHE_PATH"] = str(folder / "cache")
    result = snakemake(
        folder, "--config", "scenes=[smoke]", f"device={device}", *arguments, env=variables
    )
    assert result.returncode == 0, result.stderr
    return result


def test_a_run_says_its_gpu_and_renders_on_it_one_view_at_a_time(tmp_path):
    folder = checkout(tmp_path / "plenoforge")
    for name in ("check_device.py", "render_shard.py"):
        program = folder / "scripts" / name
        program.write_text(program.read_text().replace("if __name__", f"{WITH_GPU}\nif __name__"))
    options = ("--cores", "4", "--until", "render")
    lines = on_one_gpu(folder, *options).stderr.splitlines()
    assert lines.count(RENDERS_ON) == 1
    # Three shards need the kernels.
    assert len([line for line in lines if line.startswith("compiling Cycles' kernels")]) == 1
    assert len([line for line in lines if line.startswith("compiled Cycles' kernels")]) == 1
    runs = [
        run
        for receipt in (folder / "work").rglob("receipts/**/render/*.jsonl")
        for run in history.read(receipt)
    ]
    assert {run.start["device"] for run in runs} == {"GPU"}
    # On each GPU one shard renders, and another one starts.
    assert {run.start["threads"] for run in runs} == {2}
    times = sorted(
        (run.views[0]["finished"] - run.views[0]["wall_seconds"], run.views[-1]["finished"])
        for run in runs
    )
    assert len(times) > 2
    assert all(end < begin for (_, end), (begin, _) in pairwise(times))


def test_the_check_of_the_device_names_the_gpu(run_program):
    result = run_program(BLENDER / "simulated_gpu.py", 0, "check_device.py", "auto")
    assert RENDERS_ON in result.stdout.splitlines()


def test_a_dry_run_counts_the_gpu_hours_of_a_gpu_check(tmp_path):
    folder = checkout(tmp_path / "plenoforge")
    checked = folder / "results/benchmarks/gpu_check/smoke.json"
    checked.parent.mkdir(parents=True)
    # A second for a sample of a megapixel. Views have 64² pixels, two samples, and denoising.
    checked.write_text('{"gpu_seconds": 1.0, "samples": 7}')
    forecast = on_one_gpu(folder, "-n").stdout
    seconds = 6 * 64 * 64 * (2 + 3) / 1e6
    expected = (
        f"LFPlane_3x2_equisolid: rendering 6 views takes {duration(seconds)} of a GPU, by the GPU"
    )
    assert expected in forecast
    assert "GPU time" in forecast
    # The processor's hours are a guess.
    assert "of a GPU" not in on_one_gpu(folder, "-n", device="cpu").stdout
