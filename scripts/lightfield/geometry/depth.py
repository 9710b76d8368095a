"""Depth along the optical axis (Z-depth) and distance from the camera, each from the other.

A view stores one of them, as `LightField.depth` says: `Lens.usual_depth` where the user chose none.
`conventional_depth` says which of them other programs mean.
"""

import numpy as np

from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear


def conventional_depth(lens: Lens) -> str:
    """Return what other programs mean by the depth of a lens: "z" or "distance".

    Cycles, instant-ngp, nerfstudio, OpenDIBR and TMIV share one convention: Z-depth for perspective
    cameras, distance for all others.
    """
    return "z" if isinstance(lens, Rectilinear) else "distance"


def stored_distance(depth: Array, rays: Array, meaning: str | None) -> Array:
    """Return the distance (...) in metres of the ``depth`` (...) that a view stores.

    ``meaning`` is what the view's depth means. Z-depth, "z", is converted with the unit ``rays``
    (..., 3); "distance" is returned as it is.
    """
    return distance_from_z(depth, rays) if meaning == "z" else depth


def z_from_distance(distance: Array, rays: Array) -> Array:
    """Return the Z-depth of points at ``distance`` (...) metres along unit ``rays`` (..., 3).

    z = distance · cos θ, negative behind the camera. A miss (inf) stays inf and NaN stays NaN;
    the dtype is the wider of the two inputs.
    """
    with np.errstate(invalid="ignore"):
        z = distance * -rays[..., 2]
    return np.where(np.isinf(distance) & ~np.isnan(rays[..., 2]), distance, z)


def distance_from_z(z: Array, rays: Array) -> Array:
    """Return the distance of points at Z-depth ``z`` (...) metres along unit ``rays`` (..., 3).

    distance = z / cos θ. A miss (inf) stays inf and NaN stays NaN. NaN also marks what no
    Z-depth can say: rays in the camera plane, and a depth on the other side of that plane.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = z / -rays[..., 2]
        distance = np.where((rays[..., 2] != 0) & (distance >= 0), distance, np.nan)
    return np.where(np.isinf(z) & ~np.isnan(rays[..., 2]), z, distance)


def with_precision(depth: Array, precision: str) -> Array:
    """Return ``depth`` as a file holds it with one of ``render.depth_precision``.

    "float" is float32, "half" float16. "rounded" is float32 of which 16 of the mantissa's 23 stored
    bits are kept, rounded to nearest even: within 2⁻¹⁷ = 7.6e-6 of itself, and its zeros compress.
    """
    if precision == "half":
        with np.errstate(over="ignore"):
            return depth.astype(np.float16)
    depth = depth.astype(np.float32, copy=False)
    if precision == "float":
        return depth
    bits = depth.view(np.uint32)
    lowest_kept = (bits >> np.uint32(7)) & np.uint32(1)
    kept = (bits + np.uint32(0x3F) + lowest_kept) & ~np.uint32(0x7F)
    return np.where(np.isfinite(depth), kept.view(np.float32), depth)
