"""Runs render_shard.py on a simulated GPU without memory. The first argument is Cycles' message.

Cycles' own engine reports an error through the call that is made here, and ends the render.
"""

import runpy
import sys
from importlib import import_module
from pathlib import Path

import bpy

MESSAGE = sys.argv.pop(1)
# Name, type, identifier, and flags of its features.
GPU = ("Simulated", "CUDA", "CUDA_0", *[True] * 6)


def render(render_engine, depsgraph):
    render_engine.report({"ERROR"}, MESSAGE)
    render_engine.error_set(MESSAGE)


assert bpy.app.version
# bpy brings both modules.
import_module("_cycles").available_devices = lambda kind: [GPU] if kind == "CUDA" else []
import_module("cycles.engine").render = render
sys.argv[0] = "render_shard.py"
runpy.run_path(str(Path(__file__).parents[2] / "scripts" / sys.argv[0]), run_name="__main__")
