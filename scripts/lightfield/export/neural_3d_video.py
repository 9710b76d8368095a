"""Writes a sequence as the Neural 3D Video data set: a video for each camera, and their poses.

- ``cam00.mp4`` and so on: H.264. cam00 tests, and the others train.
- ``poses_bounds.npy`` (n, 17) float64: a row for each video. It begins with a 3 × 5 matrix, row by
  row: the camera-to-world rotation with columns down, right and backwards, the position, and
  height, width and focal length in pixels. The nearest and the farthest Z in metres follow.
- ``points3D_downsample2.ply``: points of the first frame, from which 4DGaussians starts.

Sources: load_llff.py of the original NeRF, and neural_3D_dataset_NDC.py of 4DGaussians.
"""

from contextlib import ExitStack
from io import BytesIO
from pathlib import Path

import numpy as np

from lightfield.core.files import write_bytes
from lightfield.core.progress import Progress
from lightfield.dataset.exports import Neural3dVideo
from lightfield.dataset.lightfield import View
from lightfield.export import cameras
from lightfield.export.points import lift, write_ply
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import Floats, pixel_indices
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging.video import video

POINTS = "points3D_downsample2.ply"
# LLFF's bounds leave out this percentage of the nearest and of the farthest points.
_OUTLIERS = 0.1
# Depth is measured at every n-th pixel across and down.
_STEP = 4
# The constant rate factor of H.264: 0 is lossless, 18 is said to look so.
_RATE_FACTOR = 10


def export(source: SourceSequence, settings: Neural3dVideo, folder: Path) -> None:
    """Write a sequence into ``folder``."""
    source.require_still_cameras()
    sequence = source.numbered()
    lens = source.lens
    assert isinstance(lens, Rectilinear)
    views = sequence.lightfield.views
    depths: dict[str, list[Floats]] = {view.name: [] for view in views}
    progress = Progress(len(sequence.frames), "neural_3d_video", "frames")
    folder.mkdir(parents=True)
    with ExitStack() as stack:
        add_picture = {
            view.name: stack.enter_context(
                video(
                    folder / f"{view.name}.mp4",
                    (lens.width, lens.height),
                    settings.rate,
                    rate_factor=_RATE_FACTOR,
                    is_reproducible=True,
                )
            )
            for view in views
        }
        for frame in sequence.frames:
            for view, surface in frame.surfaces(frame.lightfield.views):
                add_picture[view.name](frame.colour(view))
                depths[view.name].append(_depths(lens, view, surface.points(_STEP)[0]))
            progress.done()
    rows = [_row(lens, view, np.concatenate(depths[view.name])) for view in views]
    content = BytesIO()
    np.save(content, np.array(rows, np.float64))
    write_bytes(folder / "poses_bounds.npy", content.getvalue())
    write_ply(folder / POINTS, lift(sequence.frames[0], count=settings.points))


def _depths(lens: Rectilinear, view: View, points: Floats) -> Floats:
    """Return the Z of those world points (n, 3) that are in a view's frame."""
    local = (points - view.matrix[:3, 3]) @ view.matrix[:3, :3]
    inside = pixel_indices(lens, local)[2]
    return np.asarray(-local[inside, 2])


def _row(lens: Rectilinear, view: View, depths: Floats) -> Floats:
    """Return a camera's 17 numbers. ``depths`` (n,) are the Z that it sees."""
    right, up, back, position = view.matrix[:3].T
    size = np.array([lens.height, lens.width, cameras.focal_pixels(lens)[0]])
    # A camera that sees nothing has any bounds.
    bounds = np.percentile(depths, [_OUTLIERS, 100 - _OUTLIERS]) if len(depths) else [0.1, 100.0]
    return np.concatenate([np.stack([-up, right, back, position, size], axis=1).ravel(), bounds])
