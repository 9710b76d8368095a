"""Render views as scripts/render_shard.py does, and measure the seconds of each step of a view.

A thread writes a view while the next is rendered. So the seconds of both add up to more than those
of the whole.

It takes the flags of scripts/render_shard.py, and writes --times besides. With --osl, the shader
of the lens takes the place of Cycles' own camera. Of the GPUs, only OptiX can do that.
benchmarks/gpu.py starts it.
"""

import os
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import wraps
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core import files, processors
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.engine.flags import program
from lightfield.engine.stage import option, writes
from lightfield.formats.lightfield import LightField
from lightfield.geometry.lenses.base import RadialLens
from lightfield.imaging import images
from lightfield.rendering.views import shard
from lightfield.stages.views import RenderShard
from lightfield.workflow import shard_log

# The functions whose seconds are steps of their own. A step inside another one counts once.
STEPS = {
    "read": (images, "read_image"),
    "compress": (images, "write_exr"),
    "flush": (os, "fsync"),
    "hash": (files.Stamp, "of"),
}


class TimedShard(RenderShard):
    """Renders views as `RenderShard` does, and measures their steps."""

    name = "timed_shard"
    function = "timed_shard:render"

    times: Path = writes("JSON to write: the seconds of each view by step")
    denoise_on_gpu: bool = option("denoise on the GPU", False)
    osl: bool = option("render through an OSL shader of the same lens", False)


class Clock(threading.local):
    """Adds up the seconds of steps. The seconds of a step inside another one are not the other's.

    Each thread has its own ``seconds``, of the current view.
    """

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.began: list[float] = []
        self.inner = [0.0]

    def begin(self, *_: Any) -> None:
        """Begin a step."""
        self.began.append(time.perf_counter())
        self.inner.append(0.0)

    def end(self, step: str) -> None:
        """End the step that began last, and count its seconds."""
        whole = time.perf_counter() - self.began.pop()
        self.seconds[step] += whole - self.inner.pop()
        self.inner[-1] += whole

    def wrap(self, owner: Any, name: str, step: str) -> None:
        """Count the seconds of a function as a step."""
        function = getattr(owner, name)

        @wraps(function)
        def timed(*arguments: Any, **options: Any) -> Any:
            self.begin()
            try:
                return function(*arguments, **options)
            finally:
                self.end(step)

        setattr(owner, name, timed)

    def take(self) -> dict[str, float]:
        """Return the seconds of the current view, and begin the next."""
        seconds = dict(self.seconds)
        self.seconds.clear()
        return seconds


def render(job: TimedShard) -> None:
    """Render the views, and write the seconds of their steps."""
    # Blender's libraries start their threads when they are imported.
    with processors.only(job.threads or processors.available()):
        from lightfield.rendering.setup import cycles
        from lightfield.rendering.views import colour_pass, geometry_pass

    clock = Clock()
    for step, (owner, name) in STEPS.items():
        clock.wrap(owner, name, step)
    watch_cycles(clock, colour_pass, "render_colour", "colour")
    watch_cycles(clock, geometry_pass, "render_geometry", "geometry")
    change_set_up(cycles, job, clock)
    lines = watch_start()
    watch_views(clock, lines)
    shard.render(job)
    write_json(job.times, lines)


def watch_blender(clock: Clock) -> None:
    """Count the seconds of Blender's renders, from the first to the last of its own."""
    import bpy

    bpy.app.handlers.render_init.append(clock.begin)
    bpy.app.handlers.render_complete.append(lambda *_: clock.end("blender"))


def watch_cycles(clock: Clock, module: Any, name: str, step: str) -> None:
    """Count Cycles' own seconds of a render as a step, and not as Blender's."""
    function = getattr(module, name)

    @wraps(function)
    def timed(*arguments: Any, **options: Any) -> Any:
        rendered = function(*arguments, **options)
        clock.seconds[step] += rendered.render_seconds
        clock.seconds["synchronization"] += rendered.synchronization_seconds
        clock.seconds["blender"] -= rendered.render_seconds + rendered.synchronization_seconds
        return rendered

    setattr(module, name, timed)


def change_set_up(cycles: Any, job: TimedShard, clock: Clock) -> None:
    """Make the set-up of Cycles also set what a dataset cannot have, and watch Blender."""
    function = cycles.set_up
    lens = LightField.read(job.lightfield).lens

    def set_up(*arguments: Any) -> Any:
        import bpy

        from lightfield.rendering.setup import lens_shader

        opened = function(*arguments)
        if job.osl:
            if not isinstance(lens, RadialLens):
                raise UserError(f"--osl: no shader renders a {lens.title}")
            lens_shader.see_through(bpy.context.scene.camera.data, lens)
        # Opening a scene has removed earlier handlers.
        watch_blender(clock)
        bpy.context.scene.cycles.denoising_use_gpu = job.denoise_on_gpu
        return opened

    cycles.set_up = set_up


def watch_start() -> list[Mapping[str, Any]]:
    """Return the list that will have the line of history about the start."""
    log: Callable[[Mapping[str, Any]], None] = shard_log.log
    lines: list[Mapping[str, Any]] = []

    def timed(entry: Mapping[str, Any]) -> None:
        log(entry)
        if "start_up_seconds" in entry:
            lines.append(entry)

    shard_log.log = timed
    return lines


def watch_views(clock: Clock, lines: list[Mapping[str, Any]]) -> None:
    """Add the seconds of each view's steps to ``lines``.

    ``whole`` is the time since the view before was given to the thread that writes it.
    """

    class TimedWriter(ThreadPoolExecutor):
        """Counts the seconds of the thread that renders, and of the thread that writes."""

        def __init__(self, **options: Any) -> None:
            super().__init__(**options)
            self.before = time.perf_counter()
            clock.take()

        def submit(self, write: Any, /, view: Any, *arguments: Any, **_: Any) -> Future[Any]:
            now = time.perf_counter()
            steps = {**clock.take(), "whole": now - self.before}
            self.before = now

            def timed() -> None:
                clock.begin()
                write(view, *arguments)
                clock.end("convert")
                lines.append({"view": view.name, "steps": {**steps, **clock.take()}})

            return super().submit(timed)

    shard.ThreadPoolExecutor = TimedWriter


if __name__ == "__main__":
    program(TimedShard, __doc__)
