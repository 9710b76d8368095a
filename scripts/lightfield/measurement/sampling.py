"""How a ``render`` block says that pixels are sampled, and what that costs."""

import math
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightfield.core.files import read_keys, reading

# What a `render` block with a target error says of its calibration, and not of rendering: the
# target, and a preset's limits.
UNCALIBRATED = ("target_error", "most_samples", "denoise")

# A calibration renders so many windows of views, of so many pixels along a side, and again as many
# that are held out.
PROBES = 16
WINDOW_SIZE = 64

# A reference takes renders of so many samples until its own error is this part of the target.
REFERENCE_SAMPLES = 16
REFERENCE_PART = 0.2
FEWEST_SEEDS, MOST_SEEDS = 4, 256

# Plain path tracing is measured at these; beyond, its error is inversely proportional to samples.
PLAIN_SAMPLES = (1, 4, 16, 64)

# What changes of settings are compared with.
TRACED, DENOISED = "path tracing", "denoised"

PLAIN = {"adaptive_threshold": 0, "denoise": False}

# What denoising a pixel costs in samples of it: 18 µs against 6, measured on one core of an EPYC in
# views of the garden of 256² and more. In small windows it is up to twice as much.
DENOISING_SAMPLES = 3


def cost_in_samples(samples: float, denoise: bool) -> float:
    """Return how many samples of a pixel take as long as these and, if so, denoising them."""
    return samples + DENOISING_SAMPLES * denoise


def calibrated(render: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return a ``render`` block with what scripts/calibrate.py chose for its ``target_error``.

    Raises `UserError` where the file at ``path`` is no such choice.
    """
    record = read_keys(path, "calibrate.py", "target_error", "choice")
    with reading(path, "calibration"):
        target = {"target_error": record["target_error"]}
        return {**without_target(render), **target, **record["choice"]}


def without_target(render: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a ``render`` block says of rendering alone."""
    return {key: value for key, value in render.items() if key not in UNCALIBRATED}


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of ``values``; 0 for a single one."""
    return statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
