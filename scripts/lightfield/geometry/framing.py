"""Finds cameras that cannot see a box, or see almost nothing of it, before anything is rendered."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry.lenses import Lens
from lightfield.geometry.rotations import Floats

Bools = NDArray[np.bool_]

# So many rays to a side of the image stand for all its rays.
_RAYS = 33
# A scene that covers less than this part of each view is most likely a mistake of scale.
_SMALL = 0.001


def may_see(lens: Lens, world_from_cameras: Floats, box: Floats) -> Bools:
    """Return which cameras (n, 4, 4) may see something in a ``box`` (2, 3), in metres.

    The sphere around the box counts, so some of these cameras may miss the box.
    """
    directions, angles = _directions(world_from_cameras, box)
    x, y = (np.linspace(0, side, _RAYS) for side in (lens.width, lens.height))
    rays: Floats = lens.rays(x[None, :], y[:, None])
    nearest = _angles(rays[np.isfinite(rays[..., 0])] @ directions.T).min(axis=0)
    # A ray between these rays, or at the rim of the image circle, may be nearer.
    diagonals = (rays[1:, 1:] * rays[:-1, :-1]).sum(axis=-1)
    gap = max(_angles(diagonals[np.isfinite(diagonals)]).tolist(), default=0.0)
    return np.asarray(nearest <= angles + gap, np.bool_)


def _directions(world_from_cameras: Floats, box: Floats) -> tuple[Floats, Floats]:
    """Return the directions (n, 3) of a box's middle in the cameras' axes, and its radii (n,).

    The radii are angles. A camera in the sphere around the box has π.
    """
    towards = box.mean(axis=0) - world_from_cameras[:, :3, 3]
    distances = np.linalg.norm(towards, axis=1)
    radius = np.linalg.norm(box[1] - box[0]) / 2
    is_outside = distances > radius
    angles = np.full(len(distances), math.pi)
    angles[is_outside] = np.arcsin(radius / distances[is_outside])
    local = np.einsum("nji,nj->ni", world_from_cameras[:, :3, :3], towards)
    return local / np.maximum(distances, 1e-12)[:, None], angles


def _angles(cosines: Floats) -> Floats:
    angles: Floats = np.arccos(np.clip(cosines, -1, 1))
    return angles


def _largest_share(lens: Lens, world_from_cameras: Floats, box: Floats) -> float:
    """Return the largest part of an image that the sphere around a box covers, about."""
    x = np.array([lens.width - 1, lens.width + 1]) / 2
    left, right = lens.rays(x, np.full(2, lens.height / 2))
    _, angles = _directions(world_from_cameras, box)
    pixels = 2 * float(np.max(angles)) / max(float(_angles(left @ right)), 1e-12)
    return math.pi / 4 * pixels**2 / (lens.width * lens.height)


def place(positions: Floats, box: Floats) -> str:
    """Return in words where a scene and the cameras at ``positions`` (n, 3) are.

    ``box`` (2, 3) is around the scene.
    """
    distances = np.linalg.norm(positions - box.mean(axis=0), axis=1)
    low, high = (f"({', '.join(f'{side:.4g}' for side in corner)})" for corner in box)
    nearest, farthest = f"{np.min(distances):.4g}", f"{np.max(distances):.4g}"
    away = nearest if nearest == farthest else f"{nearest} to {farthest}"
    return f"reaches from {low} to {high} m, and the cameras are {away} m from its middle"


def warnings(
    lens: Lens, names: Sequence[str], world_from_cameras: Floats, box: Floats
) -> Iterator[str]:
    """Yield a line if cameras cannot see the scene in a ``box`` (2, 3), or hardly see it.

    ``names`` are of the views of ``world_from_cameras`` (n, 4, 4).
    """
    where = "it " + place(world_from_cameras[:, :3, 3], box)
    mend = "move the rig (center), or give the scene another size"
    missing = [
        name
        for name, sees in zip(names, may_see(lens, world_from_cameras, box), strict=True)
        if not sees
    ]
    if missing:
        yield (
            f"{len(missing)} of {len(names)} cameras look past the scene: {', '.join(missing[:8])}"
            f"{' …' if len(missing) > 8 else ''}: {where}; {mend}"
        )
    elif (share := _largest_share(lens, world_from_cameras, box)) < _SMALL:
        yield f"the scene covers at most {share:.1g} of each view: {where}; {mend}"
