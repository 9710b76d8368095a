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


def cuts(lens: Lens, world_from_cameras: Floats, points: Floats) -> Bools:
    """Return which cameras (n, 4, 4) have one of the ``points`` (m, 3) outside of their image."""
    local = (points - world_from_cameras[:, None, :3, 3]) @ world_from_cameras[:, :3, :3]
    return np.asarray(~lens.in_frame(lens.pixels(local)).all(axis=1), np.bool_)


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


def reach(box: Floats) -> str:
    """Return in words from where to where a ``box`` (2, 3) in metres reaches."""
    low, high = (f"({', '.join(f'{side:.4g}' for side in corner)})" for corner in box)
    return f"reaches from {low} to {high} m"


def place(positions: Floats, box: Floats) -> str:
    """Return in words where a scene and the cameras at ``positions`` (n, 3) are.

    ``box`` (2, 3) is around the scene.
    """
    distances = np.linalg.norm(positions - box.mean(axis=0), axis=1)
    nearest, farthest = f"{np.min(distances):.4g}", f"{np.max(distances):.4g}"
    away = nearest if nearest == farthest else f"{nearest} to {farthest}"
    return f"{reach(box)}, and the cameras are {away} m from its middle"


def warnings(
    lens: Lens, names: Sequence[str], world_from_cameras: Floats, box: Floats
) -> Iterator[str]:
    """Yield a line if cameras cannot see the scene in a ``box`` (2, 3), or hardly see it.

    ``names`` are of the views of ``world_from_cameras`` (n, 4, 4).
    """
    where = "it " + place(world_from_cameras[:, :3, 3], box)
    mend = "move the rig (center), or give the scene another size"
    missing = _chosen(names, ~may_see(lens, world_from_cameras, box))
    if missing:
        yield (
            f"{len(missing)} of {len(names)} cameras look past the scene: {_listed(missing)}: "
            f"{where}; {mend}"
        )
    elif (share := _largest_share(lens, world_from_cameras, box)) < _SMALL:
        yield f"the scene covers at most {share:.1g} of each view: {where}; {mend}"


def cut_warnings(
    lens: Lens, names: Sequence[str], world_from_cameras: Floats, points: Floats
) -> Iterator[str]:
    """Yield a line if most views cut a model, which has its outermost ``points`` (m, 3) in metres.

    Cameras in the model's box count as right, because they may be in a room. ``names`` are of the
    views of ``world_from_cameras`` (n, 4, 4).
    """
    box = np.array([points.min(axis=0), points.max(axis=0)])
    places = world_from_cameras[:, :3, 3]
    is_outside = ((places < box[0]) | (places > box[1])).any(axis=1)
    cut_views = _chosen(names, is_outside & cuts(lens, world_from_cameras, points))
    if len(cut_views) > len(names) / 2:
        yield (
            f"{len(cut_views)} of {len(names)} views cut the model: {_listed(cut_views)}: it "
            f"{place(places, box)}; make the rig larger (size: fit), or the field of view"
        )


def _chosen(names: Sequence[str], is_chosen: Bools) -> list[str]:
    return [name for name, chosen in zip(names, is_chosen.tolist(), strict=True) if chosen]


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:8])}{' …' if len(names) > 8 else ''}"
