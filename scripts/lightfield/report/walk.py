"""Collects the walk's data beside the views: the rays, the volume, the start, constants.

The walk in the browser (templates/walk/) chooses, draws and blends views as `synthesis.view` does.
This module passes it the same constants.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from lightfield.geometry.interpolation_volume import flatness
from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import pixel_indices
from lightfield.report import walk_start
from lightfield.report.packing import packed_bytes, webp
from lightfield.stages.synthesis import BEST
from lightfield.synthesis import apparent, kernels
from lightfield.synthesis import view as synthesis

Array = NDArray[Any]

# The side in pixels of the octahedral map of the directions that the lens sees.
_SIGHT = 64
# Cameras count as flat if their volume is thinner than this part of its length. The eye may then
# leave their surface by _SLACK of the length.
_THIN = 0.05
_SLACK = 0.1


def collect(
    lens: Lens,
    places: Array,
    world_from_cameras: Array,
    distances: Array,
    first: int,
    *,
    fills_holes: bool,
) -> dict[str, Any]:
    """Return the data of the walk.

    ``lens`` is the lens of the embedded views. ``places`` (n, 3) are the positions of all cameras.
    ``world_from_cameras`` (m, 4, 4) and ``distances`` (m, height, width), in metres, belong to
    the embedded views. ``first`` is the number of the embedded view in the middle of the rig.
    ``fills_holes`` is as in `lightfield.synthesis.view.Sources`. Some of the keys:

    - ``rays``: the pixels' octahedral rays as a picture: above across, below down. The first two
      channels are the high and the low byte.
    - ``sight``: a byte for each direction of an octahedral map, 1 where the lens sees it.
    - ``planes`` (m, 4): the bounds n · p + c ≤ 0 of the volume between the cameras.
    - ``toRim``: a grey picture, 0 at the edge of the image circle, 255 far from it.
    - ``pixel``: the angle between two pixels, in radians.
    - ``fieldOfView``: the angles that the lens sees across and down, in radians.
    - ``start``: where the walk begins: ``at``, and the angles ``yaw`` and ``pitch`` in radians.
    """
    steps = (np.arange(_SIGHT) + 0.5) / _SIGHT
    x, y = np.meshgrid(steps, steps)
    _, _, is_seen = pixel_indices(lens, _direction(np.stack([x, y], axis=-1)).reshape(-1, 3))
    coded = np.round(_octahedral(np.nan_to_num(lens.pixel_rays())) * 65535).astype(np.uint16)
    stacked = np.concatenate([coded[..., 0], coded[..., 1]])
    to_rim = np.round(255 * synthesis.to_rim(lens)).astype(np.uint8)
    start = walk_start.start_of(lens, world_from_cameras, distances, first)
    return {
        "rays": webp(np.stack([stacked >> 8, stacked & 255, 0 * stacked], -1).astype(np.uint8)),
        "sight": packed_bytes(is_seen.astype(np.uint8).tobytes()),
        "side": _SIGHT,
        "planes": np.round(bounds(places), 6).tolist(),
        "toRim": webp(np.stack([to_rim] * 3, axis=-1)),
        "pixel": synthesis.pixel_angle(lens),
        "steepest": float(synthesis.steepest(lens)),
        "fieldOfView": list(lens.field_of_view),
        "start": walk_start.as_angles(*start),
        "distances": walk_start.typical_of(distances).tolist(),
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


def bounds(places: Array) -> Array:
    """Return the planes (n, 4) around all places (m, 3): their hull. Thin ones get some slack."""
    around = places
    if flatness(places) < _THIN:
        length = max(float(np.linalg.norm(np.ptp(places, axis=0))), 0.1)
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        around = (places[:, None] + _SLACK * length * corners).reshape(-1, 3)
    planes: Array = np.unique(np.round(ConvexHull(around).equations, 9), axis=0)
    return planes
