"""The compilation of Cycles' kernels: who is told of it, when, and that it changes nothing else.

Needs no GPU: the driver's answers are simulated, and the processor renders.
"""

import fcntl
import os
import subprocess
import time

import forks
import numpy as np
import pytest
import simulated_gpus
from conftest import BLENDER, SCRIPTS

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.workflow import history

COMPILATION = 8
TOLD = "compiling Cycles' kernels for NVIDIA H200: once, about 7 minutes"
DONE = "compiled Cycles' kernels for NVIDIA H200 in "


class Machine:
    """A machine with one simulated GPU, a scene, and the folder of its driver's cache."""

    def __init__(self, folder, blend):
        self.folder = folder
        self.blend = blend
        self.cache = folder / "cache"
        self.has()
        sampling = {"samples": 2, "adaptive_threshold": 0, "denoise": False, "seed": 0}
        lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [24, 24]})
        rig = {"type": "plane", "cameras": [2, 1], "size": 0.3, "center": [0, 0, 1.5]}
        lightfield = LightField.from_rig(rig, lens, depth="distance", frame=1, render=sampling)
        lightfield.write(folder / "lightfield.json")

    def has(self, capability="9.0", driver="580.159"):
        row = simulated_gpus.H200 | {"compute_cap": capability, "driver_version": driver}
        simulated_gpus.write_nvidia_smi(self.folder, [row])

    def start(self, name, seconds=0, device="cuda", stall=0):
        """Start to render a dataset. The first render takes ``seconds`` longer."""
        command = [forks.python(), BLENDER / "simulated_gpu.py", seconds, "render_shard.py"]
        command += ["--blend", self.blend, "--lightfield", self.folder / "lightfield.json"]
        command += ["--device", device, "--output", self.folder / name / "exr"]
        command += ["--receipt", self.receipt(name), "--stall", stall]
        variables = {
            "PATH": f"{self.folder}:{os.environ['PATH']}",
            "CUDA_CACHE_PATH": str(self.cache),
            "TMPDIR": str(self.folder),
            "PYTHONPATH": str(SCRIPTS),
        }
        return subprocess.Popen(
            [*map(str, command)], stderr=subprocess.PIPE, text=True, env=os.environ | variables
        )

    def told(self, name, **options):
        """Return what the user is told of kernels while a dataset is rendered."""
        _, text = self.start(name, **options).communicate()
        assert "done in" in text, text
        return [line for line in text.splitlines() if "Cycles' kernels" in line]

    def receipt(self, name):
        return self.folder / "receipts" / f"{name}.jsonl"

    def pixels(self, name):
        files = sorted((self.folder / name / "exr").glob("*.exr"))
        return [images.read_image(file).channels for file in files]


@pytest.fixture
def machine(tmp_path, room):
    return Machine(tmp_path, room)


def test_a_user_is_told_once_and_the_views_do_not_count_it(machine):
    # A view takes less than this limit. Compilation takes more.
    told = machine.told("first", seconds=COMPILATION, stall=COMPILATION - 1)
    assert told[0] == TOLD
    assert told[1].startswith(DONE)
    assert float(told[1].removeprefix(DONE).split()[0]) >= COMPILATION
    assert len(told) == 2
    (run,) = history.read(machine.receipt("first"))
    assert run.start["start_up_seconds"] < COMPILATION
    assert all(view["wall_seconds"] < COMPILATION for view in run.views)
    assert machine.told("second") == []
    np.testing.assert_equal(machine.pixels("first"), machine.pixels("second"))
    # Another driver, or a lost cache, compiles anew.
    machine.has(driver="590.1")
    assert machine.told("third")[0] == TOLD
    for mark in machine.cache.iterdir():
        mark.unlink()
    assert machine.told("fourth")[0] == TOLD


@pytest.mark.parametrize(
    ("capability", "device", "is_told"),
    [("7.5", "cuda", False), ("9.0", "cpu", False), ("12.1", "cuda", True)],
)
def test_only_kernels_of_exactly_this_capability_are_ready(machine, capability, device, is_told):
    machine.has(capability)
    assert bool(machine.told("dataset", device=device)) == is_told


def test_a_process_waits_for_another_that_compiles(machine):
    machine.told("first")
    (mark,) = machine.cache.iterdir()
    content = mark.read_text()
    with mark.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        process = machine.start("second")
        for line in process.stderr:
            if line.startswith("waiting for a process that compiles"):
                break
        file.write(content)
    _, text = process.communicate()
    assert TOLD not in text
    assert process.returncode == 0


def test_a_cache_that_cannot_be_written_is_no_error(machine):
    machine.cache.write_text("not a folder")
    assert machine.told("dataset")[0] == TOLD


def test_a_killed_compilation_does_not_count(machine):
    process = machine.start("first", seconds=600)
    for line in process.stderr:
        if line.strip() == TOLD:
            break
    process.kill()
    process.wait()
    time.sleep(0.1)
    assert machine.told("second")[0] == TOLD
