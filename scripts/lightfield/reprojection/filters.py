"""The filters of a reprojection. A new filter is an entry here, and its kernel one in colour.py."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Filter:
    """A filter reads up to ``reach`` pixels on each side of the pixel that a sample falls in.

    ``covers`` says whether it averages as many samples as cover the whole pixel, in lens maps in
    which some pixel needs more than one sample.
    """

    reach: int
    covers: bool = False


FILTERS = {
    "nearest": Filter(0),
    "bilinear": Filter(1),
    "bicubic": Filter(2),
    "lanczos": Filter(3),
    "adaptive": Filter(2, covers=True),
    "st_warp": Filter(2),
}
