"""Measures how much memory a scene takes, on one view of very few pixels."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.leftovers import temporary_folder
from lightfield.core.memory import available
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.workflow import history

PROGRAM = Path(__file__).resolve().parents[3] / "render_shard.py"
RENDER = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "seed": 0}


def measure(blend: Path, inventory: Mapping[str, Any], scene_block: Mapping[str, Any]) -> int:
    """Return the peak memory in bytes of a process that renders one small panorama of a scene.

    The panorama shows the fullest frame of the ``inventory``. ``scene_block`` is a scene YAML's
    ``scene`` block, or empty. Raises `UserError` if the scene does not fit into the machine's
    memory, or cannot be rendered.
    """
    keys = ("scene_name", "view_layers", "targets")
    scene = {key: scene_block[key] for key in keys if scene_block.get(key)}
    with temporary_folder() as folder:
        content = {
            **Equirectangular(width=32, height=16).to_lightfield(),
            "depth": "distance",
            "frame": inventory["fullest_frame"],
            "scene": scene,
            "render": {**RENDER, "depth_precision": "float"},
        }
        LightField(content, [View.placed("view", np.eye(4))]).write(folder / "lightfield.json")
        # The .blend's files are in their places.
        write_json(folder / "inventory.json", {**inventory, "external_files": []})
        command: list[Any] = [
            "--blend",
            blend,
            "--lightfield",
            folder / "lightfield.json",
            "--inventory",
            folder / "inventory.json",
            "--receipt",
            folder / "receipts/0-1.jsonl",
            "--output",
            folder / "exr",
            "--device",
            "cpu",
            "--threads",
            "1",
        ]
        result = subprocess.run(
            [sys.executable, PROGRAM, *command],
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        if result.returncode < 0:
            raise UserError(
                f"{blend}: its render ends by signal {-result.returncode}: does the scene fit into "
                f"this machine's {units.size(available())} of memory?"
            )
        if result.returncode:
            raise UserError(f"{blend}: {result.stderr.splitlines()[-1].removeprefix('error: ')}")
        (run,) = history.read(folder / "receipts/0-1.jsonl")
    return run.peak_memory_bytes
