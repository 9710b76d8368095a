"""Constants and functions for the sampling of a ``render`` block, and the cost of samples."""

import math
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightfield.core.files import read_keys, reading
from lightfield.planning.unit_costs import DENOISING_SAMPLES

# Keys of a `render` block that only its calibration reads: the target error, and a preset's limits.
_UNCALIBRATED = ("target_error", "most_samples", "denoise")

# A calibration renders this many windows of views, and as many held-out ones.
PROBES = 16
# The pixels along a window's side.
WINDOW_SIZE = 64

# A calibration's reference takes more seeds, of REFERENCE_SAMPLES samples each, until its own error
# is below REFERENCE_PART of the target.
REFERENCE_SAMPLES = 16
REFERENCE_PART = 0.2
FEWEST_SEEDS = 4
MOST_SEEDS = 256

# Plain path tracing is measured at these samples. Beyond, its error is inversely proportional.
PLAIN_SAMPLES = (1, 4, 16, 64)

# The names of renders without and with the denoiser in reports.
TRACED = "path tracing"
DENOISED = "denoised"

PLAIN = {"adaptive_threshold": 0, "denoise": False}


def cost_in_samples(samples: float, denoise: bool) -> float:
    """Return the cost of a pixel in samples: ``samples``, and denoising if ``denoise``."""
    return samples + DENOISING_SAMPLES * denoise


def calibrated(render: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return a ``render`` block with calibrate.py's choice for its target error.

    Raises `UserError` if the file at ``path`` is not a calibration.
    """
    record = read_keys(path, "calibrate.py", "target_error", "choice")
    with reading(path, "calibration"):
        target = {"target_error": record["target_error"]}
        return {**without_target(render), **target, **record["choice"]}


def without_target(render: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block without the keys that only its calibration reads."""
    return {key: value for key, value in render.items() if key not in _UNCALIBRATED}


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of ``values``. 0 for a single value."""
    return statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
