"""What measurements come to, for tables: it measures nothing, so that pages are made quickly."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# Of views that were held out, synthesised from the others.
COLUMNS = ("truth", "variant", "value")
MEANS = (
    *("psnr", "psnr_black", "ws_psnr", "iv_psnr", "ssim", "flip", "flip_black"),
    *("holes", "source_bytes"),
)
# Of all that is between the middle of the cameras and the edge of their interpolation volume, so
# much is inside, the rest towards the edge, and what is farther out beyond.
PLACES = {"inside": 0.5, "edge": 1.0, "beyond": np.inf}
# The region of a picture that is all of it. The others are of the pixels that show most of a kind
# of light: glossy is that of metal and mirrors, transmission that of glass, volume that of fog and
# fire.
WHOLE = "all"


def means(rows: Sequence[Mapping[str, Any]], region: str = WHOLE) -> list[dict[str, Any]]:
    """Return one row for each variant and truth: means over views, of numbers or their texts.

    Each view counts as much as it has of the ``region``; ``part`` is that of all views.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in COLUMNS), []).append(row)
    found = []
    for names, group in groups.items():
        some = [row for row in group if row["region"] == region]
        if not some:
            continue
        parts = [float(row["part"]) for row in some]
        count = sum(row["region"] == WHOLE for row in group)
        mean: dict[str, Any] = dict(zip(COLUMNS, names, strict=True))
        mean["part"] = sum(parts) / count
        for name in MEANS:
            mean[name] = float(np.average([float(row[name]) for row in some], weights=parts))
        found.append(mean)
    return found


def strata_table(content: Mapping[str, Any]) -> tuple[list[str], list[list[Any]]]:
    """Return the columns and rows of what was measured of each stratum and method."""
    columns = ["stratum", "part", "method", "slope", "s", "error in these", "error", "s to it"]
    columns += ["times faster", "at most samples"]
    rows = []
    for stratum, found in {"whole views": {"area": 1.0, **content}, **content["strata"]}.items():
        for middle, most in zip(found["methods"], found["methods_at_most_samples"], strict=True):
            slope = found["slopes"].get(middle["method"], {}).get("over_time", {}).get("slope")
            names = ("seconds", "error", "equal_error", "seconds_at_equal_error", "times_faster")
            figures = [middle[name] for name in names]
            row = [stratum, found["area"], middle["method"], slope, *figures]
            rows.append([*row, most["times_faster"]])
    return columns, rows
