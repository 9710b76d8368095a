"""Writes perspective views with depth, and the pairs of them that overlap, for DUSt3R and MASt3R.

- ``waymo_pairs.npz``: ``scenes``, the folders of scenes; ``frames``, the names of views; and
  ``pairs`` (n, 3), the number of a scene and of two frames. ``scores`` (n,) has the overlap of each
  pair: the share of one view's pixels whose surface the other sees, the lesser of the two shares.
- ``views/<view>.jpg``: the views as 8-bit RGB. Transparent views are in front of black.
- ``views/<view>.exr``: Z in metres with one channel of 32-bit floats. 0 for none.
- ``views/<view>.npz``: ``cam2world`` (4, 4) in metres, with OpenCV's axes, and ``intrinsics``
  (3, 3) in pixels. The first pixel's centre is at (0, 0).

The layout is their dataset Waymo's: metric scenes, exact depth, any number of scenes, and a list of
pairs. Sources: dust3r/datasets/waymo.py, mast3r/datasets, and dust3r/utils/geometry.py.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.export import cameras, covisibility, heads
from lightfield.export.pictures import write_z
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, Developed, Joined
from lightfield.formats import npz
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images

PAIRS = "waymo_pairs.npz"
_SCENE = "views"


class Dust3r(Joined, Developed):
    """Pairs of views for DUSt3R and MASt3R."""

    name = "dust3r"
    summary = "Pairs of views that overlap, for DUSt3R and MASt3R."
    rank = 11
    loader = (
        "from dust3r.datasets.waymo import Waymo\n"
        "pairs = Waymo(split='train', ROOT='{}', resolution=224)"
    )

    overlap: float = Field(
        0.25,
        ge=0,
        le=1,
        description="Least overlap of a pair: the share of each view's pixels whose surface the "
        "other view sees.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not perspective, but DUSt3R takes only such views; {TO_RECTILINEAR}"
        return None if has_depth else NO_DEPTH

    def joins(self, lens: Lens, other: Lens) -> bool:
        # Each view has its own intrinsics.
        return True

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views and pairs. Raises `UserError` if no two views overlap enough."""
        source = heads.by_camera(source)
        views = source.lightfield.views
        pairs, scores = _pairs(covisibility.shares(source), self.overlap)
        progress = Progress(len(views), "dust3r", "views")
        for view in views:
            _write_view(source, view, folder / _SCENE)
            progress.done()
        names = np.array([view.name for view in views])
        scenes = np.array([_SCENE])
        lists = {"scenes": scenes, "frames": names, "pairs": pairs, "scores": scores}
        npz.write(folder / PAIRS, lists)


def _write_view(source: SourceDataset, view: View, folder: Path) -> None:
    images.write_jpeg(folder / f"{view.name}.jpg", source.opaque(view))
    write_z(source, view, folder / f"{view.name}.exr")
    lens = source.view(view).lens
    assert isinstance(lens, Rectilinear)
    fx, fy, cx, cy = cameras.opencv_pinhole(lens)
    camera = {
        "cam2world": cameras.opencv_matrix(view),
        "intrinsics": np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
    }
    npz.write(folder / f"{view.name}.npz", camera)


def _pairs(
    shares: NDArray[np.float32], least: float
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return the pairs (n, 3) of views whose overlap is not ``least`` or less, and it (n,)."""
    overlaps = np.triu(np.minimum(shares, shares.T), 1)
    first, second = np.nonzero((overlaps >= least) & (overlaps > 0))
    if not len(first):
        raise UserError(
            f"exports.dust3r.overlap: is {least:g}, but no two views have more than "
            f"{float(overlaps.max()):.2f} in common"
        )
    return np.column_stack([np.zeros_like(first), first, second]), overlaps[first, second]
