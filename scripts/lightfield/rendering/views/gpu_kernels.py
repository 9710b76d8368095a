"""Compiles Cycles' kernels for a GPU before the first view, and says so, because it takes minutes.

Blender brings kernels for some compute capabilities of NVIDIA GPUs. For a GPU of exactly such a
capability, Cycles loads them as they are. For any other it loads kernels in PTX, an intermediate
code. The driver compiles the PTX, and keeps the result in its cache. OptiX needs these kernels,
too.
"""

import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import IO

import bpy

from lightfield.core import gpus
from lightfield.core.locks import lock
from lightfield.core.progress import COMPILED, COMPILING
from lightfield.core.units import duration
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.scenes.render_graph import changed
from lightfield.rendering.setup import cycles
from lightfield.rendering.views.view import Array, render_view

# Measured on an H200.
_EXPECTED = "about 7 minutes"
# The side of the view that makes Cycles load all kernels, in pixels.
_SIZE = 8


def compile_first(opened: OpenScene, world_from_camera: Array) -> float:
    """Compile Cycles' kernels if this process's GPU needs that, and no process has done it before.

    Returns for how many seconds this process compiled, or waited for another that did.

    This renders a tiny view of a camera at ``world_from_camera``, (4, 4)
    camera-to-world. It leaves nothing of it in memory, so that the next view is as without it.
    """
    started = time.monotonic()
    missing = _models_without_kernels()
    for model, driver in missing:
        path = _mark(model, driver)
        if _has_content(path):
            continue
        with _locked(path, model) as mark:
            if _has_content(path):
                continue
            _tell(f"{COMPILING}Cycles' kernels for {model}: once, {_EXPECTED}")
            began = time.monotonic()
            _render_tiny_view(opened, world_from_camera)
            took = duration(time.monotonic() - began)
            _tell(f"{COMPILED}Cycles' kernels for {model} in {took}")
            mark.write(f"compiled in {took}\n")
    return time.monotonic() - started if missing else 0.0


def _models_without_kernels() -> list[tuple[str, str]]:
    """Return the model and the driver of each GPU in use for which Cycles loads PTX."""
    models = cycles.used_gpus("CUDA", "OPTIX")
    if not models:
        return []
    folder = Path(str(import_module("cycles").__file__)).with_name("lib")
    needed = {
        (model, driver): folder / f"kernel_sm_{capability.replace('.', '')}.cubin.zst"
        for model, driver, capability in gpus.nvidia("name", "driver_version", "compute_cap")
        if model in models
    }
    return [found for found, kernels in needed.items() if not kernels.exists()]


def _mark(model: str, driver: str) -> Path:
    """Return the path of the file that has content if the driver's cache has the kernels.

    It lies in the driver's cache, so that it is removed with the cache.
    """
    folder = os.environ.get("CUDA_CACHE_PATH") or Path.home() / ".nv/ComputeCache"
    name = re.sub(r"[^\w.]+", "-", f"plenoforge bpy {version('bpy')} driver {driver} {model}")
    return Path(folder, name)


def _has_content(path: Path) -> bool:
    try:
        return path.stat().st_size > 0
    except OSError:
        return False


@contextmanager
def _locked(path: Path, model: str) -> Iterator[IO[str]]:
    """Open a mark for one process at a time. If it cannot be written, open a temporary file."""
    with ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file: IO[str] = stack.enter_context(path.open("a", encoding="utf-8"))
        except OSError:
            # The driver cannot keep the kernels there either.
            file = stack.enter_context(tempfile.TemporaryFile("w", encoding="utf-8"))
        lock(file, f"a process that compiles Cycles' kernels for {model}")
        yield file


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _render_tiny_view(opened: OpenScene, world_from_camera: Array) -> None:
    scene = bpy.context.scene
    with ExitStack() as stack:
        for owner, name, value in (
            (scene.render, "resolution_x", _SIZE),
            (scene.render, "resolution_y", _SIZE),
            # Cycles would keep the scene as this view needs it.
            (scene.render, "use_persistent_data", False),
            (scene.cycles, "samples", 1),
        ):
            stack.enter_context(changed(owner, name, value))
        render_view(opened, world_from_camera, 0, {"Combined": "RGB"})
