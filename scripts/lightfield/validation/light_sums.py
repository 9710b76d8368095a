"""Checks that a view's light groups add up to its colour."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.formats import passes
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images

# The sum may differ from the colour by this part of it. Rounding to halves takes up to 2⁻¹⁰: half
# of that in the colour, and half in the groups.
MOST_OFF = 1e-3


def reason_against(lightfield: LightField) -> str | None:
    """Return why the light groups of an image set need not add up. None if they must."""
    reprojection = lightfield.content.get("reprojection")
    if reprojection is None:
        return None
    if lightfield.is_relit:
        return "the views are relit"
    if reprojection.get("exposure") != 0 or reprojection.get("reinhard") != 1:
        return "the views have another exposure or tone mapping than their light groups"
    return None


def error(folder: Path, view: str, groups: list[str], colour: NDArray[Any]) -> float | None:
    """Return the largest difference between the sum of a view's ``groups`` and its colour.

    It is relative to the ``colour`` (3, height, width), in half floats. ``folder`` holds
    lightfield.json. Returns None if a group cannot be read, which another check reports. Values
    that the half range clamps do not count.
    """
    total = np.zeros(colour.shape, np.float64)
    counts = np.abs(colour) < images.HALF_MAX
    for group in groups:
        try:
            pixels = images.read_image(passes.of_group(group).path(folder, view), "RGB")
        except UserError:
            return None
        planes = np.stack([pixels.channels[name] for name in "RGB"])
        if planes.shape != colour.shape:
            return None
        counts &= np.abs(planes) < images.HALF_MAX
        total += planes
    # The smallest half floats are coarse.
    smallest = 2.0**-25 * (len(groups) + 1) / MOST_OFF
    size = np.maximum(np.abs(colour.astype(np.float64)), smallest)
    return float((np.abs(total - colour) / size)[counts].max(initial=0))
