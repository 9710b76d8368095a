"""Collects the walk's data beside the views: the rays, the volume between the cameras, constants.

The walk in the browser (templates/walk/) chooses, draws and blends views as `synthesis.view` does.
This module passes it the same constants.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import pixel_indices
from lightfield.report.packing import packed_bytes, webp
from lightfield.stages.synthesis import BEST
from lightfield.synthesis import apparent, kernels
from lightfield.synthesis import view as synthesis

Array = NDArray[Any]

# The side in pixels of the octahedral map of the directions that the lens sees.
_SIGHT = 64


def collect(lens: Lens, places: Array, distances: Array, *, fills_holes: bool) -> dict[str, Any]:
    """Return the data of the walk.

    ``lens`` is the lens of the embedded views. ``places`` (n, 3) are the positions of all cameras.
    ``distances`` (m, height, width) are the distances in the embedded views, in metres.
    ``fills_holes`` is as in `lightfield.synthesis.view.Sources`. Some of the keys:

    - ``rays``: the pixels' octahedral rays as a picture: above across, below down. The first two
      channels are the high and the low byte.
    - ``sight``: a byte for each direction of an octahedral map, 1 where the lens sees it.
    - ``planes`` (m, 4): the bounds n · p + c ≤ 0 of the volume between the cameras.
    - ``toRim``: a grey picture, 0 at the edge of the image circle, 255 far from it.
    - ``pixel``: the angle between two pixels, in radians.
    - ``nearest``: the first percentile of the distances.
    """
    steps = (np.arange(_SIGHT) + 0.5) / _SIGHT
    x, y = np.meshgrid(steps, steps)
    _, _, is_seen = pixel_indices(lens, _direction(np.stack([x, y], axis=-1)).reshape(-1, 3))
    sample = distances[:: max(1, len(distances) // 4)]
    positive = sample[sample > 0]
    hit = positive[np.isfinite(positive)]
    coded = np.round(_octahedral(np.nan_to_num(lens.pixel_rays())) * 65535).astype(np.uint16)
    stacked = np.concatenate([coded[..., 0], coded[..., 1]])
    to_rim = np.round(255 * synthesis.to_rim(lens)).astype(np.uint8)
    return {
        "rays": webp(np.stack([stacked >> 8, stacked & 255, 0 * stacked], -1).astype(np.uint8)),
        "sight": packed_bytes(is_seen.astype(np.uint8).tobytes()),
        "side": _SIGHT,
        "planes": np.round(_bounds(places), 6).tolist(),
        "toRim": webp(np.stack([to_rim] * 3, axis=-1)),
        "pixel": synthesis.pixel_angle(lens),
        "steepest": float(synthesis.steepest(lens)),
        "distances": synthesis.typical(1 / positive).tolist() if positive.size else [1.0, 1.0],
        "nearest": float(np.percentile(hit, 1)) if hit.size else 1.0,
        "best": BEST,
        "directions": synthesis.DIRECTIONS,
        "distance": float(kernels.DISTANCE),
        "sharp": float(kernels.SHARP),
        "closest": float(kernels.CLOSEST),
        "torn": synthesis.TORN_WEIGHT,
        "unmoved": synthesis.UNMOVED_WEIGHT,
        "sharpened": synthesis.SHARPENED,
        "dark": float(kernels.DARK),
        "even": float(kernels.EVEN),
        "same": float(kernels.SAME),
        "hidden": float(kernels.HIDDEN),
        "behind": float(kernels.BEHIND),
        "splat": float(kernels.SPLAT),
        "splatSame": float(kernels.SPLAT_SAME),
        "certain": float(kernels.CERTAIN),
        "far": float(kernels.FAR),
        "steps": apparent.STEPS,
        "fillsHoles": fills_holes,
    }


def _octahedral(rays: Array) -> Array:
    """Return unit vectors (..., 3) as points (..., 2) of the unit square.

    Source: Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit
    Vectors", section 2.
    """
    scaled = rays / np.maximum(np.abs(rays).sum(axis=-1, keepdims=True), 1e-12)
    plane = scaled[..., :2]
    folded = (1 - np.abs(plane[..., ::-1])) * np.where(plane >= 0, 1, -1)
    points: Array = np.where(rays[..., 2:] >= 0, plane, folded) / 2 + 0.5
    return points


def _direction(points: Array) -> Array:
    """Return vectors (..., 3) in the directions of `_octahedral` points (..., 2)."""
    plane = 2 * points - 1
    z = 1 - np.abs(plane).sum(axis=-1)
    folded = (1 - np.abs(plane[..., ::-1])) * np.where(plane >= 0, 1, -1)
    side = np.where(z[..., None] >= 0, plane, folded)
    vectors: Array = np.concatenate([side, z[..., None]], axis=-1)
    return vectors


def _bounds(places: Array) -> Array:
    """Return the planes (n, 4) around all places (m, 3): their hull, or a box if they are flat."""
    try:
        planes: Array = np.unique(np.round(ConvexHull(places).equations, 9), axis=0)
        return planes
    except QhullError:
        low = places.min(axis=0)
        high = places.max(axis=0)
        slack = 0.1 * max(float(np.linalg.norm(high - low)), 0.1)
        sides = np.concatenate([np.eye(3), -np.eye(3)])
        return np.column_stack([sides, np.concatenate([-high, low]) - slack])
