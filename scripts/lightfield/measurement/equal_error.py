"""Compares the time of plain path tracing with the time of denoised views of the same error.

The figures come from what was measured for a scene: its calibration, or its `error_vs_time`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_keys, reading
from lightfield.measurement.effort import Line, fit, whole_samples
from lightfield.planning.estimate import ProbedViews
from lightfield.planning.sampling import DENOISED, TRACED

# A method that takes this many times as long as plain path tracing does not reach its error.
_OUT_OF_REACH = 1e4


@dataclass(frozen=True)
class EqualError:
    """Two ways to render a dataset with one error. A figure is None if nobody knows it.

    - ``plain``: the time of plain path tracing, over the time of the dataset's own settings.
    - ``cheapest``: the same for the cheapest setting, which is usually denoised.
    - ``bias``: the part of the cheapest setting's error of all pixels that is squared bias.
    - ``correlation``: of its bias between neighbouring views.
    """

    plain: float | None = None
    cheapest: float | None = None
    bias: float | None = None
    correlation: float | None = None

    @property
    def is_plain(self) -> bool:
        """Whether the dataset has plain path tracing that no calibration chose."""
        return self.plain == 1 and self.cheapest != 1


def of_calibration(record: Path, seconds: Path) -> EqualError:
    """Return the figures of a calibration, whose choice are the dataset's own settings.

    Not known are the figures that older calibrations, or lost files, do not have. Raises
    `UserError` for a damaged file.
    """
    plain = bias = correlation = None
    if seconds.exists():
        plain = read_keys(seconds, "calibrate.py", "times_faster")["times_faster"]
    if record.exists():
        content = read_keys(record, "calibrate.py", "choice")
        with reading(record, "calibration"):
            if measured := content.get("bias"):
                bias = measured["squared_bias"] / measured["error"]
                correlation = measured["correlation"]
    return EqualError(plain, 1.0, bias, correlation)


def of_measurement(probe: ProbedViews, content: Mapping[str, Any] | None) -> EqualError:
    """Return the figures of a dataset whose samples are given, by the result of `error_vs_time`."""
    plain = 1.0 if probe.denoise is False else None
    own_settings = {"samples": probe.samples, "denoise": False}
    if content is None or content["changes"]["own"] != own_settings:
        return EqualError(plain)
    laws = {method: _law(points) for method, points in content["changes"]["unchanged"].items()}
    traced, denoised = laws.get(TRACED), laws.get(DENOISED)
    if traced is None or denoised is None:
        return EqualError(plain)
    samples = denoised.samples_to(traced.errors.at(probe.samples))
    cheapest = denoised.seconds(samples) / traced.seconds(probe.samples)
    if cheapest >= _OUT_OF_REACH:
        return EqualError(plain)
    return EqualError(plain, cheapest, *_bias_at(samples, content))


@dataclass(frozen=True)
class _Law:
    """The error is a power of the samples, and the seconds are a line over them."""

    errors: Line
    overhead: float
    sample_seconds: float

    def samples_to(self, error: float) -> float:
        """Return the samples that reach an error: a whole number, at least one."""
        return max(1.0, whole_samples(self.errors.inverse(error)))

    def seconds(self, samples: float) -> float:
        return self.overhead + self.sample_seconds * samples


def _law(points: list[dict[str, float]]) -> _Law | None:
    """Fit a method's points. None if they do not fit, as in a scene without noise."""
    counts = [point["samples"] for point in points]
    errors = fit(counts, [point["error"] for point in points])
    if errors is None:
        return None
    slope, intercept = np.polyfit(counts, [point["seconds"] for point in points], 1)
    return _Law(errors, max(0.0, float(intercept)), float(slope)) if slope > 0 else None


def _bias_at(samples: float, content: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the bias and its correlation of the measured denoised point nearest to ``samples``."""
    points = [point for point in content["points"] if point["method"] == DENOISED]
    if not points:
        return None, None
    point = min(points, key=lambda each: abs(math.log(each["samples"] / samples)))
    bias = point["bias"] / point["relative_mse_whole"] if point["relative_mse_whole"] > 0 else None
    of_point = (DENOISED, point["settings"])
    correlations = [
        pair.get("bias_correlation")
        for pair in content["neighbouring_views"]
        if (pair["method"], pair["settings"]) == of_point
    ]
    return bias, correlations[0] if correlations else None
