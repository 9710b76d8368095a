"""The record of a calibration: which settings reach a scene's target error."""

from collections.abc import Mapping
from typing import Any

# What a `render` block with a target error says of its calibration, and not of rendering: the
# target, and a preset's limits.
UNCALIBRATED = ("target_error", "most_samples", "denoise")


def calibrated(render: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block with what was chosen for its ``target_error`` in it."""
    kept = {key: value for key, value in render.items() if key not in UNCALIBRATED}
    return {**kept, "target_error": record["target_error"], **record["choice"]}
