"""Converts between depth along the optical axis (Z-depth) and distance from the camera.

A view stores one of them. Its header says which, or else `LightField.depth`. `Lens.usual_depth` is
the default. `conventional_depth` is the one that other programs expect.
"""

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear

# The largest number of 16 bits.
LARGEST_STEP = 65535


def conventional_depth(lens: Lens) -> str:
    """Return which depth other programs expect of a lens: "z" or "distance".

    Cycles, instant-ngp, nerfstudio, OpenDIBR and TMIV share one convention: Z-depth for perspective
    cameras, distance for all others.
    """
    return "z" if isinstance(lens, Rectilinear) else "distance"


def converted(depth: Array, rays: Array, stored: str | None, wanted: str) -> Array:
    """Return ``depth`` (...) in metres, which is ``stored`` as "z" or "distance", as ``wanted``.

    The unit ``rays`` (..., 3) convert it, if the two differ. ``stored`` is None if there is no
    depth to convert: all of it is inf or NaN.
    """
    if stored in (wanted, None):
        return depth
    return z_from_distance(depth, rays) if wanted == "z" else distance_from_z(depth, rays)


def z_from_distance(distance: Array, rays: Array) -> Array:
    """Return the Z-depth of points at ``distance`` (...) metres along unit ``rays`` (..., 3).

    z = distance · cos θ, negative behind the camera. A miss (inf) stays inf and NaN stays NaN.
    The dtype is the wider of the two inputs.
    """
    with np.errstate(invalid="ignore"):
        z = distance * -rays[..., 2]
    return np.where(np.isinf(distance) & ~np.isnan(rays[..., 2]), distance, z)


def distance_from_z(z: Array, rays: Array) -> Array:
    """Return the distance of points at Z-depth ``z`` (...) metres along unit ``rays`` (..., 3).

    distance = z / cos θ. A miss (inf) stays inf and NaN stays NaN. Z-depth gives no distance for
    rays in the camera plane, nor for a depth on the other side of that plane: both become NaN.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = z / -rays[..., 2]
        distance = np.where((rays[..., 2] != 0) & (distance >= 0), distance, np.nan)
    return np.where(np.isinf(z) & ~np.isnan(rays[..., 2]), z, distance)


def in_16_bits(steps: Array) -> tuple[NDArray[np.uint16], int]:
    """Return depth (h, w) in ``steps`` as whole numbers of 16 bits, where 0 means none.

    Also returns how many depths were lost, because they are too near or too far for a number.
    """
    rounded = np.round(steps)
    has_depth = np.isfinite(steps) & (steps > 0)
    fits = has_depth & (rounded >= 1) & (rounded <= LARGEST_STEP)
    return np.where(fits, rounded, 0).astype(np.uint16), int((has_depth & ~fits).sum())


def with_precision(depth: Array, precision: str) -> Array:
    """Return ``depth`` in the precision of ``render.depth_precision``.

    "float" is float32, and "half" is float16. "rounded" is float32 with 16 of the mantissa's 23
    stored bits, rounded to nearest even. The relative error is at most 2⁻¹⁷ = 7.6e-6, and the zero
    bits compress well.
    """
    if precision == "half":
        with np.errstate(over="ignore"):
            return depth.astype(np.float16)
    depth = depth.astype(np.float32, copy=False)
    if precision == "float":
        return depth
    bits = depth.view(np.uint32)
    lowest_kept = (bits >> np.uint32(7)) & np.uint32(1)
    rounded = (bits + np.uint32(0x3F) + lowest_kept) & ~np.uint32(0x7F)
    return np.where(np.isfinite(depth), rounded.view(np.float32), depth)
