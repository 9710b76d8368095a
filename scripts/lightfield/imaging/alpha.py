"""Divides colour by its alpha."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def divisor(alpha: NDArray[Any]) -> NDArray[Any]:
    """Return ``alpha``, by which premultiplied colour is divided. 1 where nothing is covered.

    So a pixel with light but without alpha, as of a flame, keeps its colour.
    """
    return np.where(alpha > 0, alpha, alpha.dtype.type(1))
