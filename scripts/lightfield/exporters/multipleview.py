"""Writes a sequence as 4DGaussians reads its own recordings, which it calls MultipleView.

- ``cam01/frame_00001.jpg`` and so on: the frames of each camera.
- ``sparse_/``: a binary COLMAP model. Its image1 has the pose of cam01.
- ``points3D_multipleview.ply``: points of the first frame.
- ``poses_bounds_multipleview.npy``: LLFF's poses, around which 4DGaussians draws a video.

4DGaussians trains on all frames of all cameras, so views that do not train are left out. Source:
multipleview_dataset.py and dataset_readers.py of 4DGaussians.
"""

from pathlib import Path

import numpy as np
from pydantic import Field

from lightfield.core.progress import Progress
from lightfield.export.llff import depths, write_poses_bounds
from lightfield.export.points import Observations, lift, write_ply
from lightfield.export.sequence import SourceSequence
from lightfield.exporters.base import Developed, PointCount, centred_pinhole
from lightfield.exporters.colmap import Model
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images


class MultipleView(Developed):
    """The layout of 4DGaussians' own recordings: a folder of frames for each camera."""

    name = "multipleview"
    summary = "Sequence for 4DGaussians, in its layout MultipleView."
    rank = 15
    loader = "python train.py -s {} --configs arguments/multipleview/default.py  # 4DGaussians"
    is_of_sequence = True
    needs_surfaces = True

    points: PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return centred_pinhole(lens)

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        source.require_still_cameras()
        sequence = source.training()
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        first = sequence.frames[0]
        views = first.lightfield.views
        points = lift(first, count=self.points)
        unseen = Observations(np.empty(0, np.intp), np.empty((0, 2)))
        model = Model(first, points, [unseen for _ in views], np.empty(0, np.intp))
        model.write_binary(folder / "sparse_")
        write_ply(folder / "points3D_multipleview.ply", points)
        seen_depths = {view.name: [depths(lens, view, s)] for view, s in first.surfaces(views)}
        path = folder / "poses_bounds_multipleview.npy"
        write_poses_bounds(path, lens, views, seen_depths)
        progress = Progress(len(sequence.frames), "multipleview", "frames")
        for number, frame in enumerate(sequence.frames, 1):
            for view in frame.lightfield.views:
                camera = view.name.removeprefix("image").zfill(2)
                picture = folder / f"cam{camera}" / f"frame_{number:05d}.jpg"
                images.write_jpeg(picture, frame.opaque(view))
            progress.done()
