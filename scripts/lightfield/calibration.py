"""The record of a calibration: which settings reach a scene's target error."""

from collections.abc import Mapping
from typing import Any


def calibrated(render: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block with what was chosen for its ``target_error`` in it."""
    kept = {key: value for key, value in render.items() if key not in ("most_samples", "denoise")}
    return {**kept, **record["choice"]}
