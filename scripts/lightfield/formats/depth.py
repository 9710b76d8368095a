"""The depth of a view's file: along the optical axis, or the distance from the camera."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry.depth import converted
from lightfield.imaging import images
from lightfield.imaging.images import DEPTH_ATTRIBUTE, Attribute

Floats = NDArray[np.float64]


def depth_meaning(header: Mapping[str, Attribute], lightfield: LightField) -> str | None:
    """Return what channel Z of a view means: "z", "distance", or None if nothing says so.

    The ``header`` of the view takes precedence over its lightfield.json, which another program may
    have written.
    """
    meaning = header.get(DEPTH_ATTRIBUTE, lightfield.depth)
    return None if meaning is None else str(meaning)


def depth_of(path: Path, lightfield: LightField, rays: Floats, meaning: str) -> Floats:
    """Return a view's depth (h, w) in metres, as "z" or "distance". NaN where there is no ray.

    ``rays`` (h, w, 3) are the pixels' rays. Raises `UserError` for a view of another size, and if
    neither its header nor lightfield.json says what channel Z means.
    """
    image = images.read_image(path, ["Z"])
    check_size(path, lightfield, image.channels["Z"])
    depth = image.channels["Z"].astype(np.float64)
    stored_meaning = depth_meaning(image.attributes, lightfield)
    if stored_meaning not in ("z", "distance"):
        raise UserError(
            f"{lightfield.path}: depth: is {stored_meaning!r}; must be z or distance "
            "to say what channel Z of the views holds"
        )
    # A pixel without a ray has no depth.
    return np.where(np.isnan(rays[..., 2]), np.nan, converted(depth, rays, stored_meaning, meaning))


def check_size(path: Path, lightfield: LightField, pixels: NDArray[Any]) -> None:
    """Raise `UserError` if a view's pixels (h, w, …) do not have the size of the lens."""
    height, width = pixels.shape[:2]
    lens = lightfield.lens
    if (width, height) != (lens.width, lens.height):
        raise UserError(
            f"{path}: is {width} × {height}, but {lightfield.path} says "
            f"{lens.width} × {lens.height}"
        )
