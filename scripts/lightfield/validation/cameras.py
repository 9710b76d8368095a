"""The cameras of a dataset's views, with what a comparison of their depth must know."""

import math
from functools import cache

import numpy as np

from lightfield.formats.layout import ImageSet
from lightfield.geometry.lenses import Lens
from lightfield.validation.consistency import Camera


def camera_of(image_set: ImageSet, view: int) -> Camera:
    """Return the camera of a view with depth."""
    lightfield = image_set.lightfield
    assert lightfield.depth is not None
    grain = grain_of(image_set)
    angle = _central_angle(lightfield.lens)
    # So many pixels are as wide as a pixel of a source view, in the middle.
    spacing = math.ceil(grain / angle) if grain > angle > 0 else 1
    matrix = lightfield.world_from_cameras[view]
    return Camera(lightfield.lens, matrix, lightfield.depth, grain, spacing)


def grain_of(image_set: ImageSet) -> float:
    """Return the angle in radians between two pixels at the centre of a source view.

    It is 0 for rendered views.
    """
    source = image_set.source
    return _central_angle(source.lightfield.lens) if source else 0.0


@cache
def _central_angle(lens: Lens) -> float:
    """Return the angle in radians between two pixels in the middle of the image."""
    x = np.array([lens.width - 1, lens.width + 1]) / 2
    left_ray, right_ray = lens.rays(x, np.full(2, lens.height / 2))
    return float(np.arccos(np.clip(left_ray @ right_ray, -1.0, 1.0)))
