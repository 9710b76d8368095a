"""Constants and functions for the sampling of a ``render`` block."""

import math
import statistics
from collections.abc import Sequence
from pathlib import Path

from lightfield.core.files import read_keys, reading
from lightfield.formats.render_block import RenderBlock

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
# For the error of so many samples, it takes these seeds instead. Together they have as many samples
# as are needed, because the error of plain path tracing is inversely proportional to them.
SEEDS_OF_SAMPLES = 8

# Plain path tracing is measured at these samples. Beyond, its error is inversely proportional.
PLAIN_SAMPLES = (1, 4, 16, 64)

# The names of renders without and with the denoiser in reports.
TRACED = "path tracing"
DENOISED = "denoised"

# A calibration measures the bias of its choice with these seeds: with more than the fewest only
# while they take less than this part of the reference's samples.
FEWEST_BIAS_SEEDS = 2
MOST_BIAS_SEEDS = 4
BIAS_PART = 0.1

# Samples of a pixel that take as long as denoising it: 18 µs against 6, in views of the garden of
# 256² and more on an EPYC. In small windows denoising costs up to twice as much.
DENOISING_SAMPLES = 3

# The settings that change how a denoised view is denoised.
DENOISER_KEYS = ("denoise_quality", "denoise_prefilter")

PLAIN = {"adaptive_threshold": 0, "denoise": False}


def cost_in_samples(samples: float, denoise: bool) -> float:
    """Return the cost of a pixel in samples: ``samples``, and denoising if ``denoise``."""
    return samples + DENOISING_SAMPLES * denoise


def calibrated(render: RenderBlock, path: Path) -> RenderBlock:
    """Return a ``render`` block with calibrate.py's choice for its target error.

    Raises `UserError` if the file at ``path`` is not a calibration.
    """
    record = read_keys(path, "calibrate.py", "target_error", "choice")
    with reading(path, "calibration"):
        return render.uncalibrated.changed(target_error=record["target_error"], **record["choice"])


def reference_of_samples(count: int) -> tuple[int, int]:
    """Return the seeds of a reference for the error of ``count`` samples, and each seed's samples.

    With all of them, the reference's own error is about `REFERENCE_PART` of that error.
    """
    samples = max(count / REFERENCE_PART, FEWEST_SEEDS * REFERENCE_SAMPLES)
    return SEEDS_OF_SAMPLES, math.ceil(samples / SEEDS_OF_SAMPLES)


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of ``values``. 0 for a single value."""
    return statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
