"""How a ``render`` block samples pixels, and what the samples cost."""

import math
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightfield.core.files import read_keys, reading

# The keys of a `render` block with a target error that are for its calibration alone: the target,
# and a preset's limits.
UNCALIBRATED = ("target_error", "most_samples", "denoise")

# A calibration renders so many windows of views, of so many pixels along a side, and holds out as
# many more.
PROBES = 16
WINDOW_SIZE = 64

# A calibration's reference takes more seeds, of so many samples each, until its own error is this
# part of the target.
REFERENCE_SAMPLES = 16
REFERENCE_PART = 0.2
FEWEST_SEEDS = 4
MOST_SEEDS = 256

# Plain path tracing is measured at these samples; beyond, its error is inversely proportional.
PLAIN_SAMPLES = (1, 4, 16, 64)

# What reports call renders without and with the denoiser.
TRACED = "path tracing"
DENOISED = "denoised"

PLAIN = {"adaptive_threshold": 0, "denoise": False}

# Denoising a pixel costs as much as so many samples of it: 18 µs against 6, on one core of an EPYC,
# in views of the garden of 256² and more. In small windows it costs up to twice as much.
DENOISING_SAMPLES = 3


def cost_in_samples(samples: float, denoise: bool) -> float:
    """Return the samples of a pixel that take as long as ``samples`` and, if so, denoising."""
    return samples + DENOISING_SAMPLES * denoise


def calibrated(render: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return a ``render`` block with the settings that calibrate.py chose for its target error.

    Raises `UserError` if the file at ``path`` is not a calibration.
    """
    record = read_keys(path, "calibrate.py", "target_error", "choice")
    with reading(path, "calibration"):
        target = {"target_error": record["target_error"]}
        return {**without_target(render), **target, **record["choice"]}


def without_target(render: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block without the keys that are for calibration alone."""
    return {key: value for key, value in render.items() if key not in UNCALIBRATED}


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of ``values``; 0 for a single one."""
    return statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
