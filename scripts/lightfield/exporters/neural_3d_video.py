"""Writes a sequence as the Neural 3D Video data set: a video for each camera, and their poses.

- ``cam00.mp4`` and so on: H.264. cam00 tests, and the others train.
- ``poses_bounds.npy`` (n, 17) float64: a row for each video (`lightfield.export.llff`).
- ``points3D_downsample2.ply``: points of the first frame, from which 4DGaussians starts.

Source: neural_3D_dataset_NDC.py of 4DGaussians.
"""

import shutil
from contextlib import ExitStack
from pathlib import Path

from pydantic import Field

from lightfield.core.progress import Progress
from lightfield.export.llff import depths, write_poses_bounds
from lightfield.export.points import lift, write_ply
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import Floats
from lightfield.exporters.base import ForTraining, PointCount, centred_pinhole, odd_size_refusal
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear

POINTS = "points3D_downsample2.ply"
# The constant rate factor of H.264: 0 is lossless, 18 is said to look so.
_RATE_FACTOR = 10


class Neural3dVideo(ForTraining):
    """The layout of Neural 3D Video: a video for each camera, and LLFF's poses_bounds.npy."""

    name = "neural_3d_video"
    summary = "Sequence in the layout of Neural 3D Video, for programs that read it."
    rank = 13
    loader = "python train.py -s {} --configs arguments/dynerf/default.py  # 4DGaussians"
    is_of_sequence = True
    needs_surfaces = True

    points: PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )
    rate: float = Field(
        30,
        gt=0,
        le=1000,
        description="Frames per second of the videos.",
        json_schema_extra={"unit": "Hz"},
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if shutil.which("ffmpeg") is None:
            return "becomes a video, for which ffmpeg must be installed"
        return centred_pinhole(lens) or odd_size_refusal(lens)

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        # Only here, because it takes long to load.
        from lightfield.imaging.video import video

        source.require_still_cameras()
        sequence = source.numbered()
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        views = sequence.lightfield.views
        seen_depths: dict[str, list[Floats]] = {view.name: [] for view in views}
        progress = Progress(len(sequence.frames), "neural_3d_video", "frames")
        folder.mkdir(parents=True)
        with ExitStack() as stack:
            add_picture = {
                view.name: stack.enter_context(
                    video(
                        folder / f"{view.name}.mp4",
                        (lens.width, lens.height),
                        self.rate,
                        rate_factor=_RATE_FACTOR,
                        is_reproducible=True,
                    )
                )
                for view in views
            }
            for frame in sequence.frames:
                for view, surface in frame.surfaces(frame.lightfield.views):
                    add_picture[view.name](frame.opaque(view))
                    seen_depths[view.name].append(depths(lens, view, surface))
                progress.done()
        write_poses_bounds(folder / "poses_bounds.npy", lens, views, seen_depths)
        write_ply(folder / POINTS, lift(sequence.frames[0], count=self.points))
