"""Flow between two views of a scene that stands still: where one sees what the other does."""

import numpy as np

from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular

# A point is hidden if the other view sees a surface that is nearer by more than this part of it.
HIDDEN = 0.01


def flow(
    lens: Lens, here: Array, there: Array, distance: Array, distance_there: Array
) -> tuple[Array, Array]:
    """Return the flow (h, w, 2) in pixels, x to the right and y down, and what of it is visible.

    ``here`` and ``there`` are (4, 4) camera-to-world; ``distance`` (h, w) of both views is along
    the ray, in metres, inf where nothing is hit. Flow is NaN where the lens has no ray, or the
    other view none for the point. Visible (h, w) is what is in the other view's frame and behind
    none of the surfaces that it sees.
    """
    rays = lens.pixel_rays() @ here[:3, :3].T
    far = np.isinf(distance)
    baseline = np.where(far[..., None], 0, here[:3, 3] - there[:3, 3])
    offset = rays * np.where(far, 1, distance)[..., None] + baseline
    pixels = lens.pixels(offset @ there[:3, :3])
    x, y = np.moveaxis(pixels, -1, 0)
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < lens.width) & (y >= 0) & (y < lens.height)
    # The farthest of the four pixels around: at an edge what is behind it is visible, too.
    farthest = np.full(distance.shape, -np.inf)
    for dx in (-0.5, 0.5):
        for dy in (-0.5, 0.5):
            column = np.where(inside, x + dx, 0).astype(int).clip(0, lens.width - 1)
            row = np.where(inside, y + dy, 0).astype(int).clip(0, lens.height - 1)
            farthest = np.fmax(farthest, distance_there[row, column])
    expected = np.where(far, np.inf, np.linalg.norm(offset, axis=-1))
    visible = inside & (expected <= (1 + HIDDEN) * farthest)
    found = pixels - (np.indices(distance.shape)[::-1].transpose(1, 2, 0) + 0.5)
    if isinstance(lens, Equirectangular):
        # The shorter of the two paths around.
        turn = lens.width * 2 * np.pi / (lens.longitude[1] - lens.longitude[0])
        found[..., 0] -= turn * np.rint(found[..., 0] / turn)
    return found, visible
