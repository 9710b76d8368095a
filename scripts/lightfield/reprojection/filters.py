"""The filters to choose from. A new one is an entry here, with its kernel in kernels.py.

Their arguments are those of the kernels: the source window, where it has rays, the samples'
coordinates and flags, how the source continues, and what to fill.
"""

from collections.abc import Callable
from dataclasses import dataclass

from lightfield.reprojection import kernels


@dataclass(frozen=True)
class Filter:
    """A filter reads up to ``reach`` pixels on each side of the one that a sample falls in.

    ``sample`` is the kernel that fills a pixel a sample; without one, OpenImageIO's st_warp does.
    ``cover`` is that of a filter which takes as many samples as cover the whole pixel, for lens
    maps in which any pixel needs more than one.
    """

    reach: int
    sample: Callable[..., None] | None = None
    cover: Callable[..., None] | None = None


FILTERS = {
    "nearest": Filter(0, kernels.nearest),
    "bilinear": Filter(1, kernels.interpolating(kernels.linear_weights)),
    "bicubic": Filter(2, kernels.interpolating(kernels.cubic_weights)),
    "lanczos": Filter(3, kernels.interpolating(kernels.lanczos_weights)),
    "adaptive": Filter(
        2, kernels.interpolating(kernels.cubic_weights), kernels.covering(kernels.cubic_weights)
    ),
    "st_warp": Filter(2),
}
DEFAULT_FILTER = "adaptive"
