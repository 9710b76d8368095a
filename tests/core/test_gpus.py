"""One GPU a process: no two processes share a GPU, and none waits while another GPU is free.

No GPU is needed: a process takes its name.
"""

import os
import re
import subprocess
import sys
from contextlib import contextmanager

import pytest
import simulated_gpus
from conftest import BLENDER, SCRIPTS

from lightfield.core import gpus
from lightfield.core.errors import UserError
from lightfield.core.gpus import CUDA, HIP, Gpu
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

ME = subprocess.run(["id", "-un"], capture_output=True, text=True, check=True).stdout.strip()
FAKE = [Gpu(CUDA, "GPU-a"), Gpu(CUDA, "GPU-b")]

WAITER = """
import sys
from pathlib import Path
from lightfield.core.gpus import CUDA, Gpu, take
gpu, _ = take([Gpu(CUDA, name) for name in sys.argv[2:]], Path(sys.argv[1]))
print(gpu.id, flush=True)
input()
"""


def waiter(folder, *names):
    return subprocess.Popen(
        [sys.executable, "-c", WAITER, folder, *names],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": str(SCRIPTS)},
    )


def test_no_two_processes_take_the_same_gpu(tmp_path):
    first, lock = gpus.take(FAKE, tmp_path)
    second, other = gpus.take(FAKE, tmp_path)
    assert [first, second] == FAKE
    with waiter(tmp_path, "GPU-a", "GPU-b") as third, waiter(tmp_path, "GPU-a", "GPU-b") as fourth:
        for process in (third, fourth):
            # The user learns whom to ask.
            holder = f"process {os.getpid()} of {ME}"
            waiting = f"waiting for one of 2 GPUs: others render ({holder}, {holder})\n"
            assert process.stderr.readline() == waiting
        other.close()
        lock.close()
        assert {third.stdout.readline(), fourth.stdout.readline()} == {"GPU-a\n", "GPU-b\n"}
        # A killed process releases its GPU.
        third.kill()
        third.wait()
        fifth, lock = gpus.take(FAKE, tmp_path)
        assert fifth in FAKE
        fourth.kill()
        lock.close()


def test_a_gpu_is_free_whoever_used_it_before(nobody):
    (nobody / "plenoforge-CUDA_VISIBLE_DEVICES_GPU_a.lock").touch(0o444)
    gpu, lock = gpus.take(FAKE[:1], nobody)
    lock.close()
    assert gpu == FAKE[0]


@pytest.mark.parametrize("kind", ["file", "missing", "folder"])
def test_a_link_in_a_folder_of_all_users_is_refused_and_not_followed(tmp_path, kind):
    victim = tmp_path / "victim"
    if kind == "file":
        victim.write_text("mine")
        victim.chmod(0o600)
    elif kind == "folder":
        victim.mkdir()
    lock = tmp_path / "plenoforge-CUDA_VISIBLE_DEVICES_GPU_a.lock"
    lock.symlink_to(victim)
    with pytest.raises(UserError, match=re.escape(str(lock))):
        gpus.take(FAKE[:1], tmp_path)
    assert victim.exists() == (kind != "missing")
    assert kind != "file" or victim.stat().st_mode & 0o777 == 0o600


def test_every_user_may_lock_an_existing_lock_file(tmp_path):
    umask = os.umask(0o077)
    _, lock = gpus.take(FAKE[:1], tmp_path)
    os.umask(umask)
    lock.close()
    assert next(tmp_path.iterdir()).stat().st_mode & 0o777 == 0o666


class Machine:
    """A machine's GPUs: their lines of nvidia-smi, and the KFD's ids of AMD's."""

    def __init__(self, folder, monkeypatch):
        self.folder = folder
        monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")
        monkeypatch.setattr(gpus, "_KFD", folder / "kfd")

    def has(self, *nvidia, amd=()):
        rows = [
            {"index": number, "uuid": uuid, "name": name}
            for number, (uuid, name) in enumerate(nvidia)
        ]
        simulated_gpus.write_nvidia_smi(self.folder, rows)
        for number, name in enumerate(amd):
            (self.folder / "kfd" / str(number)).mkdir(parents=True)
            (self.folder / "kfd" / str(number) / "gpu_id").write_text(f"{name}\n")


@pytest.fixture
def machine(tmp_path, monkeypatch):
    return Machine(tmp_path, monkeypatch)


H200 = [("GPU-1", "NVIDIA H200"), ("GPU-2", "NVIDIA H200")]
MIXED = [("GPU-1", "NVIDIA T1000"), ("GPU-2", "NVIDIA RTX A6000")]
AMD = ("0", "4711", "4712")


@pytest.mark.parametrize(
    ("nvidia", "amd", "device", "environment", "expected"),
    [
        # Numbers mean another GPU in each job of a batch system, so they become UUIDs.
        (H200[1:], (), "auto", {CUDA: "0"}, [Gpu(CUDA, "GPU-2")]),
        (H200, (), "auto", {CUDA: "1,0"}, [Gpu(CUDA, "GPU-2"), Gpu(CUDA, "GPU-1")]),
        (H200, (), "auto", {CUDA: "GPU-2"}, [Gpu(CUDA, "GPU-2")]),
        # CUDA numbers different models by their speed, which nvidia-smi does not tell.
        (MIXED, (), "auto", {CUDA: "0"}, [Gpu(CUDA, "0")]),
        (
            MIXED,
            (),
            "auto",
            {CUDA: "0", "CUDA_DEVICE_ORDER": "PCI_BUS_ID"},
            [Gpu(CUDA, "GPU-1")],
        ),
        # A processor's own AMD GPU beside NVIDIA's.
        (H200[:1], AMD, "auto", {}, [Gpu(CUDA, "GPU-1")]),
        (H200[:1], AMD, "optix", {}, [Gpu(CUDA, "GPU-1")]),
        (H200[:1], AMD, "hip", {}, [Gpu(HIP, "0"), Gpu(HIP, "1")]),
        (H200[:1], AMD, "cpu", {}, []),
        (H200[:1], AMD, "auto", {CUDA: "-1", HIP: "3"}, [Gpu(HIP, "3")]),
        (H200[:1], AMD, "auto", {CUDA: "", HIP: ""}, []),
        ((), AMD, "gpu", {}, [Gpu(HIP, "0"), Gpu(HIP, "1")]),
    ],
)
def test_only_gpus_that_the_process_may_use_count(
    machine, nvidia, amd, device, environment, expected
):
    machine.has(*nvidia, amd=amd)
    assert gpus.visible(device, environment) == expected


USER = """
import os, sys
from lightfield.core.gpus import CUDA, use_one, visible
use_one(visible(sys.argv[1]))
print(os.environ.get(CUDA, "all"), flush=True)
input()
"""


@contextmanager
def user(folder, device="auto", **environment):
    """Start a process that takes one of its GPUs, and holds it."""
    environment = os.environ | {"TMPDIR": str(folder), "PYTHONPATH": str(SCRIPTS)} | environment
    with subprocess.Popen(
        [sys.executable, "-c", USER, device],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.kill()


def test_a_process_sees_only_the_gpu_that_it_took(machine, tmp_path):
    machine.has(*H200)
    with user(tmp_path) as first, user(tmp_path) as second:
        assert {first.stdout.readline(), second.stdout.readline()} == {"GPU-1\n", "GPU-2\n"}


def test_two_processes_do_not_share_the_only_gpu_of_a_machine(machine, tmp_path):
    machine.has(*H200[:1])
    with user(tmp_path) as first:
        assert first.stdout.readline() == "GPU-1\n"
        # The second process, whose environment names the same GPU, waits for the first to end.
        with user(tmp_path, **{CUDA: "0"}) as second:
            holder = f"process {first.pid} of {ME}"
            assert second.stderr.readline() == f"waiting for the GPU: others render ({holder})\n"
            first.kill()
            assert second.stdout.readline() == "GPU-1\n"


def test_jobs_to_which_a_batch_system_gave_different_gpus_do_not_wait(machine, tmp_path):
    machine.has(*H200[:1])
    with user(tmp_path, **{CUDA: "0"}) as first:
        assert first.stdout.readline() == "GPU-1\n"
        machine.has(*H200[1:])
        with user(tmp_path, **{CUDA: "0"}) as second:
            assert second.stdout.readline() == "GPU-2\n"


def test_a_number_that_no_driver_explains_makes_no_job_wait(machine, tmp_path):
    with user(tmp_path, **{CUDA: "0"}) as first, user(tmp_path, **{CUDA: "0"}) as second:
        assert first.stdout.readline() == second.stdout.readline() == "0\n"


@pytest.fixture
def error_line(room, run_program, tmp_path):
    """Return a function that renders on a GPU, where Cycles ends with a message.

    It returns the line of the error.
    """
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [16, 16]})
    sampling = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    rig = {"type": "plane", "cameras": [1, 1]}
    lightfield = LightField.from_rig(rig, lens, depth=None, frame=1, render=sampling)
    lightfield.write(tmp_path / "lightfield.json")

    def render(message):
        arguments = ["--blend", room, "--lightfield", tmp_path / "lightfield.json"]
        arguments += ["--device", "cuda", "--output", tmp_path / "exr"]
        result = run_program(BLENDER / "full_gpu.py", message, *arguments, check=False)
        assert result.returncode == 1
        assert "Traceback" not in result.stderr
        assert not list(tmp_path.rglob("*.exr"))
        return result.stderr.splitlines()[-1]

    return render


@pytest.mark.parametrize(
    "message",
    [
        "System is out of GPU memory",
        "System is out of GPU and shared host memory",
        "Out of memory in cuMemAlloc_v2(&device_pointer, size) (device_impl.cpp:601)",
        "Out of memory in HIP queue enqueue (integrator_shade_surface)",
        "OPTIX_ERROR_DEVICE_OUT_OF_MEMORY in optixAccelBuild(context, stream) (bvh.cpp:1)",
        "Failed to load CUDA kernel from 'lib/kernel_compute_75.ptx.zst' (Out of memory)",
    ],
)
def test_a_gpu_without_memory_is_reported_with_advice(message, error_line):
    assert error_line(message) == (
        f"error: Cycles cannot render the view: {message}: lower resolution, shrink the scene's "
        "textures, end what else uses the GPU, or take device=cpu"
    )


def test_another_error_of_a_gpu_gets_no_advice_about_memory(error_line):
    message = "Illegal address in cuMemcpyHtoD_v2(pointer, mem.memory_size()) (device_impl.cpp:7)"
    assert error_line(message) == f"error: Cycles cannot render the view: {message}"
