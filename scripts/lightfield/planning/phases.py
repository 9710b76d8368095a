"""The phases of a build, by which the display and the forecast count its jobs."""

from typing import Literal

Phase = Literal[
    "scene",
    "cameras",
    "calibration",
    "views",
    "flow",
    "reprojections",
    "sensor",
    "exports",
    "validation",
    "report",
    "package",
    "family",
    "plan",
    "measurement",
    "benchmark",
    "synthesis",
]
CHANGE_DATASETS: tuple[Phase, ...] = (
    "cameras",
    "views",
    "flow",
    "reprojections",
    "sensor",
    "exports",
    "validation",
)
"""The phases whose jobs change what a dataset's sha256sums.txt lists."""
# The phase of the jobs that develop views as a sensor sees them.
SENSOR_PHASE: Phase = "sensor"
