"""Runs a program on a simulated GPU whose first render takes long. It renders on the processor.

The arguments are the seconds of the first render, and the program with its arguments.
"""

import runpy
import sys
import time
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import simulated_gpus

seconds = float(sys.argv.pop(1))
name = sys.argv.pop(1)

simulated_gpus.let_cycles_see_one()
engine = import_module("cycles.engine")
render_on_processor = engine.render


def render_first(render_engine, depsgraph):
    engine.render = render_on_processor
    time.sleep(seconds)
    render_on_processor(render_engine, depsgraph)


engine.render = render_first
sys.argv[0] = name
runpy.run_path(str(Path(__file__).parents[2] / "scripts" / name), run_name="__main__")
