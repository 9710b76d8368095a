"""Flow between two views: where one view shows what the other shows.

Either the scene stands still and the cameras differ, or one camera sees the scene at two frames.
"""

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.frames import ONE_PLACE
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.visibility import ONE_SURFACE, nothing_hides

# A point is hidden if the other view's surface is nearer by more than this part of its distance.
# The other view has depth only at its pixels' centres, and not at the point.
_HIDDEN = 0.01
# Two cameras are equally near if their distances differ by less than this part.
_AS_NEAR = 1e-6
# A surface is followed if its way there and back ends within this many pixels.
_RETURNS = 0.5


def neighbours(world_from_cameras: Array) -> list[int]:
    """Return for each of the views at ``world_from_cameras`` (n, 4, 4) the number of its neighbour.

    The neighbour is the view with the nearest camera; of equally near ones, the view with the most
    similar direction. Views from the very same place do not count, because nothing hides anything
    between them. Raises `UserError` if there are no other places.
    """
    from lightfield.geometry.nearest import Cameras

    places, ahead = world_from_cameras[:, :3, 3], world_from_cameras[:, :3, 2]
    cameras = Cameras(places)
    numbers = []
    for view, look in enumerate(ahead):
        candidates = cameras.nearest_apart(view, ONE_PLACE, _AS_NEAR)
        away = np.linalg.norm(places[candidates] - places[view], axis=1)
        away[away < ONE_PLACE] = np.inf
        if np.isinf(away.min()):
            raise UserError("flow: all views are from one place; must be two or more")
        near = candidates[away <= away.min() * (1 + _AS_NEAR)]
        numbers.append(int(near[np.argmax(np.round(ahead[near] @ look, 6))]))
    return numbers


def flow(
    lens: Lens,
    world_from_camera: Array,
    world_from_other: Array,
    distance: Array,
    other_distance: Array,
) -> tuple[Array, Array]:
    """Return the flow (h, w, 2) from one view to another, and where (h, w) its point is visible.

    Flow is in pixels, x right and y down. The matrices (4, 4) are camera-to-world. The distances
    (h, w) are along the ray, in metres, and inf where a ray hits nothing. The other view's distance
    is NaN where it hides all points. Flow is NaN where the lens has no ray, or where the other view
    has no ray to the point. A point is visible if it is in the other view's frame, and if nothing
    hides it there.
    """
    rays = lens.pixel_rays() @ world_from_camera[:3, :3].T
    far = np.isinf(distance)
    baseline = np.where(far[..., None], 0, world_from_camera[:3, 3] - world_from_other[:3, 3])
    offset = rays * np.where(far, 1, distance)[..., None] + baseline
    pixels = lens.pixels(offset @ world_from_other[:3, :3])
    x, y = np.moveaxis(pixels, -1, 0)
    inside = lens.in_frame(pixels)
    # Take the farthest of the four pixels around: at an edge, the surface behind is visible, too.
    farthest = np.full(distance.shape, -np.inf)
    for dx in (-0.5, 0.5):
        for dy in (-0.5, 0.5):
            column = np.where(inside, x + dx, 0).astype(int).clip(0, lens.width - 1)
            row = np.where(inside, y + dy, 0).astype(int).clip(0, lens.height - 1)
            farthest = np.fmax(farthest, other_distance[row, column])
    expected = np.where(far, np.inf, np.linalg.norm(offset, axis=-1))
    visible = inside & nothing_hides(farthest, expected, part=_HIDDEN)
    motion = pixels - (np.indices(distance.shape)[::-1].transpose(1, 2, 0) + 0.5)
    motion[..., 0] = shorter(lens, motion[..., 0])
    return motion, visible


def scene_flow(
    lens: Lens,
    world_from_camera: Array,
    distance: Array,
    motion: Array,
    next_distance: Array,
    next_motion: Array,
) -> tuple[Array, Array]:
    """Return how far (h, w, 3) the surface at each pixel moves in the world, and where it is known.

    Flow is in metres, from one frame to the next, and 0 where it is not known. The camera at
    ``world_from_camera`` (4, 4) stands still. The distances (h, w) are along the ray, in metres, at
    the two frames. ``motion`` (h, w, 2) is the way in pixels to the surface's place in the next
    frame. ``next_motion`` is the way of the next frame's surfaces back to this one.

    The surface is at the distance that the next frame has around its new place. 1/distance is
    interpolated there, which is linear on a plane. Flow is not known where

    - a ray hits nothing, or the surface leaves the frame;
    - another surface hides it in the next frame, so that the way back leads elsewhere;
    - the four pixels around its new place are not of one surface.
    """
    height, width = distance.shape
    pixels = np.indices((height, width))[::-1].transpose(1, 2, 0) + 0.5
    target = pixels + motion
    is_known = np.isfinite(distance)
    inverse = np.zeros((height, width))
    nearest = np.full((height, width), np.inf)
    farthest = np.zeros((height, width))
    # The centre of the pixel to the upper left, and the parts of the way to its neighbours.
    corner = np.floor(target - 0.5)
    parts = target - 0.5 - corner
    back = np.zeros((height, width, 2))
    for right in (0, 1):
        for down in (0, 1):
            column, row, inside = _pixel(lens, corner + np.array([right, down]))
            around = np.where(inside, next_distance[row, column], np.inf)
            weights = np.abs(parts - (1 - right, 1 - down)).prod(axis=-1)
            # A pixel without weight does not matter: the last column has none to its right.
            matters = weights > 0
            is_known &= ~matters | np.isfinite(around)
            nearest = np.where(matters, np.fmin(nearest, around), nearest)
            farthest = np.where(matters, np.fmax(farthest, around), farthest)
            inverse += weights / np.where(matters, around, 1)
            back += weights[..., None] * next_motion[row, column]
    returned = motion + back
    returned[..., 0] = shorter(lens, returned[..., 0])
    is_known &= np.linalg.norm(returned, axis=-1) < _RETURNS
    is_known &= farthest < (1 + ONE_SURFACE) * nearest
    rays = lens.rays(target[..., 0], target[..., 1])
    is_known &= np.isfinite(rays).all(axis=-1)
    before = lens.pixel_rays() * np.where(is_known, distance, 0)[..., None]
    after = rays * np.where(is_known, 1 / np.where(inverse > 0, inverse, 1), 0)[..., None]
    return np.where(
        is_known[..., None], (after - before) @ world_from_camera[:3, :3].T, 0
    ), is_known


def _pixel(lens: Lens, place: Array) -> tuple[Array, Array, Array]:
    """Return the column and row of pixels (h, w, 2), and which are in the frame."""
    column, row = np.moveaxis(place, -1, 0).astype(int)
    if isinstance(lens, Equirectangular) and lens.is_full:
        column = column % lens.width
    inside = (column >= 0) & (column < lens.width) & (row >= 0) & (row < lens.height)
    return column.clip(0, lens.width - 1), row.clip(0, lens.height - 1), inside


def shorter(lens: Lens, across: Array) -> Array:
    """Return ``across``, a motion in x in pixels, by the shorter way around a panorama."""
    if not isinstance(lens, Equirectangular):
        return across
    return np.asarray(across - lens.turn * np.rint(across / lens.turn))


def in_frame(lens: Lens, motion: Array) -> Array:
    """Return where (h, w) a flow (2, h, w) leads into the frame, up to rounding."""
    rounding = 0.01
    y, x = np.indices(motion.shape[1:]) + 0.5 + motion[::-1]
    if isinstance(lens, Equirectangular):
        # Rounding at the left edge must not lead around a part of a panorama.
        x = (x + rounding) % lens.turn - rounding
    sides = ((x, lens.width), (y, lens.height))
    inside = [(-rounding <= at) & (at < side + rounding) for at, side in sides]
    return np.asarray(inside[0] & inside[1])
