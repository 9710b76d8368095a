"""Flow between two views of a still scene: where one view shows what the other shows."""

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.frames import ONE_PLACE
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular

# A point is hidden if the other view sees a surface that is nearer by more than this part.
HIDDEN = 0.01
# Two cameras are equally near if their distances differ by less than this part.
AS_NEAR = 1e-6


def neighbours(matrices: Array) -> list[int]:
    """Return for each of the views at ``matrices`` (n, 4, 4) the number of its neighbour.

    The neighbour is the view with the nearest camera; of equally near ones, the view with the most
    similar direction. Views from the very same place do not count, because nothing hides anything
    between them. Raises `UserError` if there are no other places.
    """
    from lightfield.geometry.nearest import Cameras

    places, ahead = matrices[:, :3, 3], matrices[:, :3, 2]
    cameras = Cameras(places)
    chosen = []
    for view, look in enumerate(ahead):
        candidates = cameras.nearest_apart(view, ONE_PLACE, AS_NEAR)
        away = np.linalg.norm(places[candidates] - places[view], axis=1)
        away[away < ONE_PLACE] = np.inf
        if np.isinf(away.min()):
            raise UserError("flow: all views are from one place; must be two or more")
        near = candidates[away <= away.min() * (1 + AS_NEAR)]
        chosen.append(int(near[np.argmax(np.round(ahead[near] @ look, 6))]))
    return chosen


def flow(
    lens: Lens, matrix: Array, other_matrix: Array, distance: Array, other_distance: Array
) -> tuple[Array, Array]:
    """Return the flow (h, w, 2) from one view to another, and where (h, w) its point is visible.

    Flow is in pixels, x right and y down. The matrices (4, 4) are camera-to-world. The distances
    (h, w) are along the ray, in metres, and inf where a ray hits nothing. Flow is NaN where the
    lens has no ray, or where the other view has no ray to the point. A point is visible if it is in
    the other view's frame, and if no surface hides it there.
    """
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    far = np.isinf(distance)
    baseline = np.where(far[..., None], 0, matrix[:3, 3] - other_matrix[:3, 3])
    offset = rays * np.where(far, 1, distance)[..., None] + baseline
    pixels = lens.pixels(offset @ other_matrix[:3, :3])
    x, y = np.moveaxis(pixels, -1, 0)
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < lens.width) & (y >= 0) & (y < lens.height)
    # Take the farthest of the four pixels around: at an edge, the surface behind is visible, too.
    farthest = np.full(distance.shape, -np.inf)
    for dx in (-0.5, 0.5):
        for dy in (-0.5, 0.5):
            column = np.where(inside, x + dx, 0).astype(int).clip(0, lens.width - 1)
            row = np.where(inside, y + dy, 0).astype(int).clip(0, lens.height - 1)
            farthest = np.fmax(farthest, other_distance[row, column])
    expected = np.where(far, np.inf, np.linalg.norm(offset, axis=-1))
    visible = inside & (expected <= (1 + HIDDEN) * farthest)
    motion = pixels - (np.indices(distance.shape)[::-1].transpose(1, 2, 0) + 0.5)
    motion[..., 0] = shorter(lens, motion[..., 0])
    return motion, visible


def shorter(lens: Lens, across: Array) -> Array:
    """Return ``across``, a motion in x in pixels, by the shorter way around a panorama."""
    if not isinstance(lens, Equirectangular):
        return across
    return np.asarray(across - lens.turn * np.rint(across / lens.turn))


def in_frame(lens: Lens, motion: Array) -> Array:
    """Return where (h, w) a flow (2, h, w) leads into the frame, up to rounding."""
    y, x = np.indices(motion.shape[1:]) + 0.5 + motion[::-1]
    if isinstance(lens, Equirectangular):
        x %= lens.turn
    rounding = 0.01
    sides = ((x, lens.width), (y, lens.height))
    inside = [(-rounding < at) & (at < side + rounding) for at, side in sides]
    return np.asarray(inside[0] & inside[1])
