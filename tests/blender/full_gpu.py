"""Runs render_shard.py on a simulated GPU without memory. The first argument is Cycles' message.

Cycles' own engine reports an error through the call that is made here, and ends the render.
"""

import runpy
import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import simulated_gpus

MESSAGE = sys.argv.pop(1)


def render(render_engine, depsgraph):
    render_engine.report({"ERROR"}, MESSAGE)
    render_engine.error_set(MESSAGE)


simulated_gpus.let_cycles_see_one()
import_module("cycles.engine").render = render
sys.argv[0] = "render_shard.py"
runpy.run_path(str(Path(__file__).parents[2] / "scripts" / sys.argv[0]), run_name="__main__")
