"""Leaves shadow catchers out of transparent views, where no shadow falls on them.

There the picture shows nothing, and its alpha is 0. But Cycles gives the shadow catcher's depth,
number and albedo. It leaves holdouts out by itself.
"""

import math
from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np

from lightfield.formats.passes import PARTS_OF_LIGHT, VARIANCE, Pass
from lightfield.imaging.images import LEAST_ALPHA
from lightfield.rendering.views.colour_pass import Colour
from lightfield.rendering.views.geometry_pass import ViewGeometry, cleared
from lightfield.rendering.views.view import Array


def left_out(
    colour: Colour, geometry: ViewGeometry | None, view_passes: Iterable[Pass]
) -> tuple[Colour, ViewGeometry | None, int]:
    """Return a view without the surfaces that it does not show, and how many pixels had one.

    ``geometry`` has its alpha. Passes of light keep their light, and the colour its variance.
    """
    # As the view's file of half floats has it.
    shows_nothing = colour.pixels[..., 3].astype(np.float16) < LEAST_ALPHA
    of_surface = [view_pass.name for view_pass in view_passes if view_pass.of_colour]
    of_surface = [name for name in of_surface if name not in (*PARTS_OF_LIGHT, VARIANCE)]
    passes = {name: cleared(colour.passes[name], shows_nothing) for name in of_surface}
    colour = replace(colour, passes=colour.passes | passes)
    if geometry is None:
        return colour, None, 0
    assert geometry.alpha is not None
    # A pixel may show something else beside its centre. The one sample at the centre tells, but may
    # find no shadow in a half-shadow. Half-shadows are rare beside a pixel that shows nothing.
    unshown = shows_nothing | (_widened(shows_nothing) & (geometry.alpha < LEAST_ALPHA))
    count = int((np.isfinite(geometry.depth) & unshown).sum())
    return colour, geometry.without(unshown), count


def _widened(pixels: Array) -> Array:
    """Return the pixels (height, width), and all that the pixel filter mixes with them."""
    reach = math.floor(bpy.context.scene.cycles.filter_width / 2) + 1
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(pixels, reach), (2 * reach + 1, 2 * reach + 1)
    )
    return np.asarray(windows.any(axis=(-1, -2)))
