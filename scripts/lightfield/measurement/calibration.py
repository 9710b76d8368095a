"""What ways to render cost, and the record of which reach a scene's target error."""

from collections.abc import Mapping
from typing import Any

# What a `render` block with a target error says of its calibration, and not of rendering: the
# target, and a preset's limits.
UNCALIBRATED = ("target_error", "most_samples", "denoise")

# What denoising a pixel costs in samples of it: 18 µs against 6, measured on one core of an EPYC in
# views of the garden of 256² and more. In the small windows of probes it is up to twice as much.
DENOISING_SAMPLES = 3


def cost_in_samples(samples: float, denoise: bool) -> float:
    """Return how many samples of a pixel take as long as these and, if so, denoising them."""
    return samples + DENOISING_SAMPLES * denoise


def calibrated(render: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block with what was chosen for its ``target_error`` in it."""
    kept = {key: value for key, value in render.items() if key not in UNCALIBRATED}
    return {**kept, "target_error": record["target_error"], **record["choice"]}
