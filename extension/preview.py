"""Builds a rig with small views in the background, and says how far the build is.

A build is Snakemake's process, of the checkout that has the scene YAML, or that the panel names. It
writes to a file. Blender's timer reads the file, so nothing waits for the build.
"""

import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from . import rig_objects, scene_file
from .scripts.lightfield.core.errors import UserError

PRESETS = ("tiny", "preview")
# Seconds between two looks at a build.
_INTERVAL = 0.5
# A cancelled build that still works after so many seconds is killed.
_PATIENCE = 20.0
# How a line begins that names the cause of a failure.
_CAUSE = re.compile(r"^(\S+ failed: )?error: |^\S+ failed: |Error:? ")
# Variables that would lead the checkout's Python to Blender's packages.
_OF_BLENDER = ("PYTHONPATH", "PYTHONHOME", "PYTHONUSERBASE")


class Build:
    """A build of a rig that has been started. ``state`` is what the panel says of it."""

    def __init__(self, checkout: Path, yaml: Path, rig: str, preset: str) -> None:
        home = scene_file.home(yaml)
        self.title = f"{yaml.stem}, {rig}, {preset}"
        self._home = home
        self._dataset = home / "results" / f"{yaml.stem}_{preset}" / rig
        self.state = "starts"
        self.is_running = True
        self.page: Path | None = None
        self._cancelled_at: float | None = None
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 - it stays open while the build works
        programs = checkout / ".venv" / "bin"
        environment = {k: v for k, v in os.environ.items() if k not in _OF_BLENDER}
        environment["PATH"] = f"{programs}{os.pathsep}{environment.get('PATH', os.defpath)}"
        choice = [f"scenes={yaml.stem}", f"rigs={rig}", f"preset={preset}"]
        command = [programs / "snakemake", "-s", checkout / "Snakefile", "--directory", home]
        self._process = subprocess.Popen(
            [*command, "--cores", str(os.cpu_count()), "--config", *choice],
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            env=environment,
            # A group of its own, so that all its jobs can be ended.
            start_new_session=True,
        )

    def look(self) -> None:
        """Update the state."""
        status = self._process.poll()
        if self._cancelled_at is not None:
            self._look_for_the_end(self._cancelled_at)
            return
        lines = self._lines()
        if status is None:
            views = len(list(self._dataset.glob("exr/*.exr")))
            self.state = f"{views} views. {lines[-1] if lines else 'Snakemake starts'}"
            return
        self.is_running = False
        self._output.close()
        if status == 0:
            self._say_result(lines)
        else:
            cause = next((line for line in lines if _CAUSE.search(line)), None)
            self.state = cause or (lines[-1] if lines else f"ended with status {status}")

    def cancel(self) -> None:
        """End the build and its jobs. `look` says when they have ended."""
        if self.is_running and self._cancelled_at is None:
            self._cancelled_at = time.monotonic()
            self.state = "is being cancelled"
            self._signal(signal.SIGTERM)

    def _look_for_the_end(self, cancelled_at: float) -> None:
        """Note the end of a cancelled build. Its jobs may end after Snakemake."""
        is_late = time.monotonic() - cancelled_at > _PATIENCE
        if is_late or not self._signal(0):
            self._signal(signal.SIGKILL)
            self._process.wait()
            self.is_running = False
            self._output.close()
            self.state = "cancelled"

    def _signal(self, number: int) -> bool:
        """Send a signal to Snakemake and its jobs. Return whether any of them is there."""
        try:
            os.killpg(self._process.pid, number)
        except ProcessLookupError:
            return False
        return True

    def _lines(self) -> list[str]:
        """Return what the build has printed, without empty lines."""
        # The process writes at the end of the same file.
        content = os.pread(self._output.fileno(), 2**24, 0).decode(errors="replace")
        return [line.strip() for line in content.splitlines() if line.strip()]

    def _say_result(self, lines: Sequence[str]) -> None:
        """Show the page of the valid dataset. A run with nothing to do does not name it."""
        pages = [line.removeprefix("valid: ") for line in lines if line.startswith("valid: ")]
        page = self._home / pages[0] if pages else self._dataset / "report" / "index.html"
        self.state = "valid" if page.is_file() else lines[-1]
        self.page = page if page.is_file() else None


# The build that was started last.
_last: list[Build] = []


def last() -> Build | None:
    """Return the build that was started last, if any."""
    return _last[0] if _last else None


def start(scene: Any, rig: str, preset: str) -> None:
    """Start the build of a rig. Raises `UserError` if it cannot start, or if one is at work."""
    build = last()
    if build and build.is_running:
        raise UserError(f"{build.title}: is being built; wait, or cancel it")
    path = rig_objects.yaml_path(scene)
    if path is None or path.parts[-3:-1] != ("configs", "scenes"):
        raise UserError("open or write a scene YAML in a folder configs/scenes/ first")
    _last[:] = [Build(_checkout(scene), path, rig, preset)]
    if not bpy.app.timers.is_registered(tick):
        bpy.app.timers.register(tick, first_interval=_INTERVAL, persistent=True)


def tick() -> float | None:
    """Look at the build, and draw the panel. Return the seconds until the next time, or None."""
    build = last()
    if build is None or not build.is_running:
        return None
    build.look()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
    return _INTERVAL if build.is_running else None


def stop() -> None:
    """End a build at work, and forget the last one."""
    if build := last():
        build.cancel()
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    _last.clear()


def needs_checkout(scene: Any) -> bool:
    """Return whether the scene YAML is in a folder that is no checkout."""
    return not (rig_objects.folder(scene) / "Snakefile").is_file()


def _checkout(scene: Any) -> Path:
    """Return the checkout that builds. Raises `UserError` if it is none, or not set up."""
    chosen = scene.plenoforge_checkout if needs_checkout(scene) else ""
    folder = Path(bpy.path.abspath(chosen)) if chosen else rig_objects.folder(scene)
    if not (folder / "Snakefile").is_file():
        raise UserError(f"{folder}: is no checkout of Plenoforge; choose it in the panel")
    if not (folder / ".venv" / "bin" / "snakemake").exists():
        raise UserError(f"{folder}: has no environment yet; run make there")
    return folder
