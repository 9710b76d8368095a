"""One GPU a process: no two processes share a GPU, and none waits while another GPU is free.

No GPU is needed: a process takes its name.
"""

import os
import re
import subprocess
import sys

import pytest
from conftest import BLENDER, SCRIPTS

from lightfield.core import gpus
from lightfield.core.errors import UserError
from lightfield.core.gpus import CUDA, HIP, Gpu
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

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
            assert process.stderr.readline() == "waiting for one of 2 GPUs to be free\n"
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


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({CUDA: "0,1", HIP: ""}, [Gpu(CUDA, "0"), Gpu(CUDA, "1")]),
        ({CUDA: "-1", HIP: "3"}, [Gpu(HIP, "3")]),
        ({CUDA: "", HIP: ""}, []),
        ({}, [Gpu(CUDA, "GPU-1"), Gpu(CUDA, "GPU-2"), Gpu(HIP, "0"), Gpu(HIP, "1")]),
    ],
)
def test_only_gpus_that_the_process_may_use_count(environment, expected, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    (tmp_path / "nvidia-smi").write_text("#!/bin/sh\necho GPU-1\necho GPU-2\n")
    (tmp_path / "nvidia-smi").chmod(0o755)
    monkeypatch.setattr(gpus, "_KFD", tmp_path)
    for number, name in enumerate(("0", "4711", "4712")):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "gpu_id").write_text(f"{name}\n")
    assert gpus.visible(environment) == expected


USER = """
import os
from lightfield.core.gpus import CUDA, HIP, use_one
use_one()
print(os.environ[CUDA], os.environ[HIP])
"""


def test_a_process_sees_only_the_gpu_that_it_took(tmp_path):
    _, lock = gpus.take(FAKE[:1], tmp_path)
    environment = {CUDA: "GPU-a,GPU-b", HIP: "0", "TMPDIR": str(tmp_path)}
    process = subprocess.run(
        [sys.executable, "-c", USER],
        env=os.environ | environment | {"PYTHONPATH": str(SCRIPTS)},
        capture_output=True,
        text=True,
        check=True,
    )
    lock.close()
    assert process.stdout == "GPU-b -1\n"


@pytest.mark.parametrize(
    "message",
    [
        "System is out of GPU memory",
        "Out of memory in cuMemAlloc_v2(&device_pointer, size) (device_impl.cpp:601)",
    ],
)
def test_a_gpu_without_memory_is_reported_with_advice(message, room, run_program, tmp_path):
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [16, 16]})
    sampling = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    rig = {"type": "plane", "cameras": [1, 1]}
    lightfield = LightField.from_rig(rig, lens, depth=None, frame=1, render=sampling)
    lightfield.write(tmp_path / "lightfield.json")
    result = run_program(
        BLENDER / "full_gpu.py",
        message,
        "--blend",
        room,
        "--device",
        "cuda",
        "--lightfield",
        tmp_path / "lightfield.json",
        "--output",
        tmp_path / "exr",
        check=False,
    )
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1] == (
        f"error: Cycles cannot render the view: {message}: lower resolution, shrink the scene's "
        "textures, end what else uses the GPU, or take device=cpu"
    )
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.rglob("*.exr"))
