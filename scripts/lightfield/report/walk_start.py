"""Chooses where a walk begins: where the views together see most of the picture."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.geometry.rotations import looking_at
from lightfield.geometry.visibility import pixel_indices
from lightfield.synthesis import view as synthesis

Array = NDArray[Any]

# The walk begins beside one of about this many cameras. It moves from there towards the middle, by
# at most this part of the way.
_MOST_CAMERAS = 40
_INWARD = 0.1
# A later candidate is taken only if it sees this much more.
_CLEARLY_MORE = 0.05
# A walk begins with a field of view of at most about this.
WIDEST = math.radians(80)


def start_of(
    lens: Lens, world_from_cameras: Array, distances: Array, first: int
) -> tuple[Array, Array]:
    """Return the place (3,) and the unit direction (3,) in which the walk begins.

    The arguments are as in `lightfield.report.walk.collect`.
    """
    seen = _sample_of(distances)
    hit = seen[np.isfinite(seen)]
    nearest = float(np.percentile(hit, 1)) if hit.size else 1.0
    starts = candidates(lens, world_from_cameras, distances, first, nearest)
    return best(starts, lens, world_from_cameras, typical_of(distances))


def typical_of(distances: Array) -> Array:
    """Return the two ``distances`` in metres that are typical of the scene."""
    seen = _sample_of(distances)
    return synthesis.typical(1 / seen) if seen.size else np.ones(2)


def _sample_of(distances: Array) -> Array:
    """Return the distances (n,) in some of the views, also infinite ones."""
    sample: Array = distances[:: max(1, len(distances) // 4)]
    return sample[sample > 0]


def candidates(
    lens: Lens, world_from_cameras: Array, distances: Array, first: int, nearest: float
) -> list[tuple[Array, Array]]:
    """Return the places and unit directions (3,) in which the walk may begin, the best guess first.

    The arguments are as in `lightfield.report.walk.collect`. ``nearest`` is the distance of near
    surfaces in metres.
    """
    places = world_from_cameras[:, :3, 3]
    middle = places.mean(axis=0)
    aheads = np.array([_gaze(lens) @ matrix[:3, :3].T for matrix in world_from_cameras])
    chosen = [first, *range(0, len(places), math.ceil(len(places) / _MOST_CAMERAS))]
    starts = []
    for camera in chosen:
        seen = distances[camera][np.isfinite(distances[camera]) & (distances[camera] > 0)]
        target = places[camera] + aheads[camera] * (np.median(seen) if seen.size else 1e4)
        way = middle - places[camera]
        # Move away from the volume's edge, but not into the nearest surface.
        step = min(_INWARD, nearest / 4 / max(float(np.linalg.norm(way)), 1e-9))
        place = places[camera] + step * way
        starts.append((place, _unit(target - place)))
    look_inwards = ((middle - places) * aheads).sum() > 0
    if not look_inwards and np.linalg.norm(aheads.mean(axis=0)) <= 0.5:
        # Cameras that look around see most from their middle. People look ahead, not up or down.
        level = aheads[first] * [1, 1, 0]
        starts.insert(0, (middle, _unit(level) if np.linalg.norm(level) > 0.1 else aheads[first]))
    elif not look_inwards:
        starts.insert(0, (middle, aheads[first]))
    return starts


def _gaze(lens: Lens) -> Array:
    """Return the unit ray (3,) of the picture's middle, or the lens's axis if it has none."""
    ray: Array = lens.rays(lens.width / 2, lens.height / 2)
    return ray if np.isfinite(ray).all() else np.array([0.0, 0.0, -1.0])


def _unit(vector: Array) -> Array:
    unit: Array = vector / np.linalg.norm(vector)
    return unit


def best(
    starts: list[tuple[Array, Array]], lens: Lens, world_from_cameras: Array, distances: Array
) -> tuple[Array, Array]:
    """Return the start, of a place and a direction, from which views see most of a picture.

    A picture has the lens's field of view, but at most 80°, and directions as in
    `lightfield.synthesis.view.Sources.best`. ``distances`` are typical of the scene.
    """
    seen = [_seen_part(eye(*start), lens, world_from_cameras, distances) for start in starts]
    return next(
        start for start, part in zip(starts, seen, strict=True) if part >= max(seen) - _CLEARLY_MORE
    )


def as_angles(at: Array, ahead: Array) -> dict[str, Any]:
    """Return a start as the page's program has it."""
    return {
        "at": np.round(at, 6).tolist(),
        "yaw": 0.0 if math.hypot(*ahead[:2]) <= 0.1 else math.atan2(-ahead[0], ahead[1]),
        "pitch": math.asin(max(-1.0, min(1.0, float(ahead[2])))),
    }


def _seen_part(pose: Array, lens: Lens, world_from_cameras: Array, distances: Array) -> float:
    """Return the part of the picture of an eye at ``pose`` (4, 4) that at least one view sees."""
    half = math.tan(min(*lens.field_of_view, WIDEST) / 2)
    steps = half * ((np.arange(synthesis.DIRECTIONS) + 0.5) / synthesis.DIRECTIONS * 2 - 1)
    x, y = np.meshgrid(steps, steps)
    rays = np.stack([x, y, np.full_like(x, -1)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    points = pose[:3, 3] + np.concatenate([distance * rays for distance in distances])
    is_seen = np.zeros(len(points), bool)
    for matrix in world_from_cameras:
        is_seen |= pixel_indices(lens, (points - matrix[:3, 3]) @ matrix[:3, :3])[2]
    return float(is_seen.mean())


def eye(at: Array, ahead: Array) -> Array:
    """Return the pose (4, 4) of an upright eye at a place that looks ahead."""
    pose = np.eye(4)
    pose[:3, :3] = looking_at(-ahead[np.newaxis], np.zeros(3))[0]
    pose[:3, 3] = at
    return pose
