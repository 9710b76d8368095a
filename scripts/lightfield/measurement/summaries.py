"""Means and rows of measurements for tables. Imports nothing slow, so that pages build quickly."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# The tables of synthesised views: the columns that name a row, and the columns that are averaged.
COLUMNS = ("truth", "variant", "value")
MEANS = (
    "psnr",
    "psnr_black",
    "ws_psnr",
    "iv_psnr",
    "ssim",
    "flip",
    "flip_black",
    "holes",
    "source_bytes",
)
# The places of views, and how far each reaches: 0 is the middle of the cameras, 1 is the edge of
# their interpolation volume.
PLACES = {"inside": 0.5, "edge": 1.0, "beyond": np.inf}
# The region of all pixels. The other regions are named after the light that dominates their pixels:
# glossy is the light of metal and mirrors, transmission of glass, volume of fog and fire.
ALL_PIXELS = "all"


def means(rows: Sequence[Mapping[str, Any]], region: str = ALL_PIXELS) -> list[dict[str, Any]]:
    """Return a row of means over the views for each variant and truth.

    ``rows`` may have numbers or their texts. A view counts by its part of the ``region``; ``part``
    is the region's part of all views.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in COLUMNS), []).append(row)
    mean_rows = []
    for names, group in groups.items():
        in_region = [row for row in group if row["region"] == region]
        if not in_region:
            continue
        parts = [float(row["part"]) for row in in_region]
        count = sum(row["region"] == ALL_PIXELS for row in group)
        mean: dict[str, Any] = dict(zip(COLUMNS, names, strict=True))
        mean["part"] = sum(parts) / count
        for name in MEANS:
            mean[name] = float(np.average([float(row[name]) for row in in_region], weights=parts))
        mean_rows.append(mean)
    return mean_rows


def strata_table(content: Mapping[str, Any]) -> tuple[list[str], list[list[Any]]]:
    """Return the columns and rows of the table of each stratum and method of error_vs_time."""
    columns = [
        "stratum",
        "part",
        "method",
        "slope",
        "s",
        "error in these",
        "error",
        "s to it",
        "times faster",
        "at most samples",
    ]
    rows = []
    whole_views = {"area": 1.0, **content}
    for stratum, measured in {"whole views": whole_views, **content["strata"]}.items():
        at_most_samples = measured["methods_at_most_samples"]
        for middle, most in zip(measured["methods"], at_most_samples, strict=True):
            slope = measured["slopes"].get(middle["method"], {}).get("over_time", {}).get("slope")
            names = ("seconds", "error", "equal_error", "seconds_at_equal_error", "times_faster")
            figures = [middle[name] for name in names]
            row = [stratum, measured["area"], middle["method"], slope, *figures]
            rows.append([*row, most["times_faster"]])
    return columns, rows
