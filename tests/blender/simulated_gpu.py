"""Runs a program on a simulated GPU whose first render takes long. It renders on the processor.

The arguments are the seconds of the first render, and the program with its arguments. Where
Blender's list of GPUs has none of the chosen GPU's kind, Cycles itself renders on the processor.
"""

import runpy
import sys
import time
from importlib import import_module
from pathlib import Path

import bpy

# Name, type, identifier, and flags of its features.
GPU = ("NVIDIA H200", "CUDA", "CUDA_0", *[True] * 6)
seconds = float(sys.argv.pop(1))
name = sys.argv.pop(1)

assert bpy.app.version
# bpy brings both modules.
import_module("_cycles").available_devices = lambda kind: [GPU] if kind == "CUDA" else []
engine = import_module("cycles.engine")
render_on_processor = engine.render


def render_first(render_engine, depsgraph):
    engine.render = render_on_processor
    time.sleep(seconds)
    render_on_processor(render_engine, depsgraph)


engine.render = render_first
sys.argv[0] = name
runpy.run_path(str(Path(__file__).parents[2] / "scripts" / name), run_name="__main__")
