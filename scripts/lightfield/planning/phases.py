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
# The phase of the jobs that develop views as a sensor sees them.
SENSOR_PHASE: Phase = "sensor"
