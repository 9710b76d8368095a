"""Develops light as reprojections and exports do, apart from the code that wrote them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def toned(light: NDArray[Any], exposure: float, white: float) -> Floats:
    """Return ``light`` (...) after an exposure in stops and a tone curve. Both grow with light.

    A ``white`` of 1 changes nothing. Negative light becomes 0. Source: Reinhard et al. 2002,
    equation 4.
    """
    with np.errstate(all="ignore"):
        brighter = np.maximum(light, 0) * np.exp2(exposure)
        return np.asarray(brighter * (1 + brighter / white / white) / (1 + brighter), np.float64)
