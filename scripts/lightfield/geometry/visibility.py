"""Whether a view sees a point: the surface that the view has at the point's pixel says it.

A surface and a point are compared by their distances from the view's camera, along the ray, in
metres. inf is a miss, and NaN is unknown. A tolerance is a part of the distance, because a pixel
covers a part of it. Each caller has its own tolerance, with its reason.

`lightfield.validation.consistency` measures differences that are far smaller. It fits planes, and
its tolerances are standard deviations of a plane and footprints of a pixel. `lightfield.synthesis`
compares inverse distances in its loops: there a surface hides another one by a part, not wholly.
"""

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Array, Lens

Bools = NDArray[np.bool_]

ONE_SURFACE = 0.1
"""Pixels beside each other show one surface if their distances differ by less than this part.

A 180° fisheye of 2048² pixels shows a plane as one surface up to 89° from its normal.
"""


def pixel_indices(lens: Lens, rays: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Bools]:
    """Return the column and row (n,), (n,) of each ray's pixel, and which rays are in the frame.

    ``rays`` (n, 3) may have any length. Outside the frame column and row are 0.
    """
    pixels = lens.pixels(rays)
    inside = lens.in_frame(pixels)
    column, row = np.where(inside, np.floor(pixels).T, 0).astype(np.intp)
    return column, row, inside


def lies_on(surface: Array, distance: Array, *, part: float) -> Bools:
    """Return where points at a ``distance`` lie on the view's ``surface``, within a ``part`` of it.

    A point behind the surface is hidden, and a point in front of it is not there.
    """
    with np.errstate(invalid="ignore"):
        on_surface: Bools = np.abs(surface - distance) < part * distance
    return on_surface


def nothing_hides(surface: Array, distance: Array, *, part: float) -> Bools:
    """Return where no ``surface`` is nearer than points at a ``distance``, by more than a ``part``.

    Nothing hides a miss where the view has a miss, too. An unknown surface hides everything.
    """
    with np.errstate(invalid="ignore"):
        visible: Bools = distance <= (1 + part) * surface
    return visible
