"""Estimates the noise of a rendered picture, from the picture alone."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.util import view_as_blocks

Array = NDArray[Any]

# The median magnitude of normally distributed values, over their standard deviation.
_MEDIAN_OF_NORMAL = 0.6745
# The root of the sum of the squares of Immerkær's mask.
_MASK_NORM = 6.0
# A block with at least this many pixels along a side has an estimate exact to a few percent.
SMALLEST_BLOCK = 8


def relative_noise(luminance: Array, block: int = SMALLEST_BLOCK) -> Array:
    """Return noise over luminance of each block of ``block``² pixels of a picture (height, width).

    Noise is the standard deviation of the filtered picture. The filter, [[1, −2, 1], [−2, 4, −2],
    [1, −2, 1]], removes linear gradients (Immerkær, *Fast Noise Variance Estimation*, 1996). The
    deviation follows from the median magnitude, so an edge through a block does not count. Fine
    texture does. NaN for a block that is black, not finite, or cut by the picture's border.
    """
    light = luminance.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = np.abs(np.diff(np.diff(light, 2, axis=0), 2, axis=1)) / _MASK_NORM
        deviation = np.median(_blocks(residual, block), axis=2) / _MEDIAN_OF_NORMAL
        mean = np.mean(_blocks(light[1:-1, 1:-1], block), axis=2)
        ratio = deviation / mean
    return np.where((mean > 0) & np.isfinite(mean), ratio, np.nan)


def _blocks(values: Array, block: int) -> Array:
    """Return the complete blocks of values (height, width) as (rows, columns, block²)."""
    rows, columns = (side // block * block for side in values.shape)
    complete = np.ascontiguousarray(values[:rows, :columns])
    blocks = view_as_blocks(complete, (block, block))
    # numpy 1.26 refuses a median over two axes if there is no block at all.
    return np.asarray(blocks.reshape(*blocks.shape[:2], block**2))
