"""Simulates what NVIDIA's driver, and Cycles, tell of a machine's GPUs."""

import sys
from importlib import import_module

# The fields of a GPU, as nvidia-smi names them.
H200 = {
    "index": 0,
    "uuid": "GPU-1",
    "name": "NVIDIA H200",
    "compute_cap": "9.0",
    "driver_version": "580.159",
}

PROGRAM = """#!{python} -IS
import sys
rows = {rows}
(query,) = [word for word in sys.argv if word.startswith("--query-gpu=")]
for row in rows:
    print(", ".join(str(row[field]) for field in query.partition("=")[2].split(",")))
"""


def available_devices(kind):
    """Return the devices of a kind, as Cycles lists them on a machine with one H200.

    Each has its name, type and identifier, and flags of its features.
    """
    return [(H200["name"], "CUDA", "CUDA_0", *[True] * 6)] if kind == "CUDA" else []


def let_cycles_see_one():
    """Let Cycles list a GPU. Where Blender's list has none, Cycles renders on the processor."""
    # bpy brings this module.
    import bpy

    assert bpy.app.version
    import_module("_cycles").available_devices = available_devices


def write_nvidia_smi(folder, rows):
    """Write a program nvidia-smi into ``folder``. Each row has the fields of a GPU."""
    program = folder / "nvidia-smi"
    program.unlink(missing_ok=True)
    program.write_text(PROGRAM.format(python=sys.executable, rows=rows))
    program.chmod(0o755)
