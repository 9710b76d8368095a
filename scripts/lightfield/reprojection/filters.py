"""The filters of a reprojection. A new filter is an entry here, and a kernel in kernels.py.

kernels.py explains the kernels' arguments.
"""

from collections.abc import Callable
from dataclasses import dataclass

from lightfield.reprojection import kernels


@dataclass(frozen=True)
class Filter:
    """A filter reads up to ``reach`` pixels on each side of the pixel that a sample falls in.

    ``sample`` is the kernel that fills one output pixel for each sample. Without it, OpenImageIO's
    st_warp does this. ``cover`` is the kernel that averages as many samples as cover the whole
    pixel. It is used for lens maps in which some pixel needs more than one sample.
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
