"""What the page's walk inside a light field needs beside the views: their rays, and their room.

How views are chosen, drawn and blended is that of `synthesis.view`, once more in a browser
(templates/walk/): its constants are handed over here.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from lightfield.export.source import pixel_indices
from lightfield.geometry.lenses import Lens
from lightfield.report.packing import packed_bytes
from lightfield.synthesis import kernels
from lightfield.synthesis import view as synthesis

Array = NDArray[Any]

# The side of the octahedral map in which directions are that the lens sees, in pixels.
SIGHT = 64


def collect(lens: Lens, places: Array, distances: Array, *, fills_holes: bool) -> dict[str, Any]:
    """Return what the walk needs of the embedded views' ``lens`` and of all ``places`` (n, 3).

    ``distances`` (m, h, w) are what embedded views see, in metres. ``fills_holes`` is as of
    `lightfield.synthesis.view.Sources`.
    ``rays`` are those of the pixels, row by row, octahedral in two times 16 bits; ``sight`` has a
    byte for each direction of an octahedral map, 1 where the lens sees it; ``planes`` (m, 4) bound
    the volume between the cameras: n · p + c ≤ 0. ``toRim`` has a byte for each pixel, 255 where it
    is far from the edge of what the lens sees; ``pixel`` is one's angle in radians.
    ``nearest`` is how near to a camera, in metres, its surroundings are, but for the nearest
    hundredth of them.
    """
    steps = (np.arange(SIGHT) + 0.5) / SIGHT
    x, y = np.meshgrid(steps, steps)
    _, _, sees = pixel_indices(lens, _direction(np.stack([x, y], axis=-1)).reshape(-1, 3))
    some = distances[:: max(1, len(distances) // 4)]
    seen = some[some > 0]
    hit = seen[np.isfinite(seen)]
    coded = np.round(_octahedral(np.nan_to_num(lens.pixel_rays())) * 65535).astype("<u2")
    return {
        "rays": packed_bytes(coded.tobytes()),
        "sight": packed_bytes(sees.astype(np.uint8).tobytes()),
        "side": SIGHT,
        "planes": np.round(_bounds(places), 6).tolist(),
        "toRim": packed_bytes(np.round(255 * synthesis.to_rim(lens)).astype(np.uint8).tobytes()),
        "pixel": synthesis.pixel_angle(lens),
        "steepest": float(synthesis.steepest(lens)),
        "distances": synthesis.typical(1 / seen).tolist() if seen.size else [1.0, 1.0],
        "nearest": float(np.percentile(hit, 1)) if hit.size else 1.0,
        "best": synthesis.BEST,
        "directions": synthesis.DIRECTIONS,
        "distance": synthesis.DISTANCE,
        "sharp": synthesis.SHARP,
        "torn": synthesis.TORN_WEIGHT,
        "sharpened": synthesis.SHARPENED,
        "dark": float(kernels.DARK),
        "even": float(kernels.EVEN),
        "same": float(kernels.SAME),
        "hidden": float(kernels.HIDDEN),
        "certain": float(kernels.CERTAIN),
        "far": float(kernels.FAR),
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
    """Return the vectors (..., 3), not of unit length, of `_octahedral` points (..., 2)."""
    plane = 2 * points - 1
    z = 1 - np.abs(plane).sum(axis=-1)
    folded = (1 - np.abs(plane[..., ::-1])) * np.where(plane >= 0, 1, -1)
    side = np.where(z[..., None] >= 0, plane, folded)
    vectors: Array = np.concatenate([side, z[..., None]], axis=-1)
    return vectors


def _bounds(places: Array) -> Array:
    """Return the planes (n, 4) around all places (m, 3): their hull, or a box where it is flat."""
    try:
        planes: Array = np.unique(np.round(ConvexHull(places).equations, 9), axis=0)
        return planes
    except QhullError:
        low = places.min(axis=0)
        high = places.max(axis=0)
        slack = 0.1 * max(float(np.linalg.norm(high - low)), 0.1)
        sides = np.concatenate([np.eye(3), -np.eye(3)])
        return np.column_stack([sides, np.concatenate([-high, low]) - slack])
