"""Writes a sequence of one frame for TMIV, the test model of MPEG immersive video.

- ``sequence.json``: the cameras.
- ``<name>_texture_<W>x<H>_yuv420p10le.yuv``: colour, for each camera.
- ``<name>_depth_<W>x<H>_yuv420p16le.yuv``: normalised disparity, for each camera. It is computed
  from Z for perspective views, and from distance for panoramas. Level 0 means none.

Axes are OMAF's: x forward, y left, z up. A rotation is yaw, pitch and roll in degrees. Source:
TMIV's sequence configurations.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import absolute_path, write_bytes, write_json
from lightfield.core.progress import Progress
from lightfield.export import yuv
from lightfield.export.disparity import Farther, depth_range, levels
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, Developed, odd_size_refusal
from lightfield.exporters.opendibr import projection
from lightfield.geometry.depth import conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import matrix_to_euler

_COLOUR_BITS = 10
_DEPTH_BITS = 16

# Columns: forward, left and up of OMAF's camera in our camera's axes (looks along −z, y up).
_FROM_OMAF = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])


class Miv(Developed):
    """A sequence for TMIV, the test model of MPEG immersive video."""

    name = "miv"
    summary = "Sequence for TMIV, the test model of MPEG immersive video."
    rank = 6
    loader = "Encoder -c {}/sequence.json  # TMIV, with a configuration of its own"

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear | Equirectangular):
            return (
                "has a lens that MIV lacks; reproject to rectilinear, or to equirectangular, "
                "a fisheye of 180 degrees with longitude: [-90, 90], and format: exr"
            )
        return odd_size_refusal(lens) or (None if has_depth else NO_DEPTH)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        lens = source.lens
        meaning = conventional_depth(lens)
        size = f"{lens.width}x{lens.height}"
        views = source.lightfield.views
        camera_entries = []
        farther = Farther()
        progress = Progress(len(views), "miv", "views")
        for view in views:
            depth = source.depth(view, meaning)
            farther.count(depth)
            limits = depth_range(depth)
            texture = yuv.of_colour(source.encoded(view), _COLOUR_BITS)
            write_bytes(folder / f"{view.name}_texture_{size}_yuv420p{_COLOUR_BITS}le.yuv", texture)
            geometry = yuv.of_levels(levels(depth, limits, _DEPTH_BITS, 1), _DEPTH_BITS)
            write_bytes(folder / f"{view.name}_depth_{size}_yuv420p{_DEPTH_BITS}le.yuv", geometry)
            camera_entries.append(
                {
                    "Name": view.name,
                    "Position": view.world_from_camera[:3, 3].tolist(),
                    "Rotation": rotation(view.world_from_camera),
                    "Depth_range": list(limits),
                    "Resolution": [lens.width, lens.height],
                    **projection(lens),
                    "BitDepthColor": _COLOUR_BITS,
                    "BitDepthDepth": _DEPTH_BITS,
                    "ColorSpace": "YUV420",
                    "DepthColorSpace": "YUV420",
                    "HasInvalidDepth": True,
                }
            )
            progress.done()
        farther.report(folder)
        content: dict[str, Any] = {
            "Version": "3.0",
            "Content_name": absolute_path(source.dataset).name,
            "BoundingBox_center": source.lightfield.world_from_cameras[:, :3, 3]
            .mean(axis=0)
            .tolist(),
            "Fps": 30,
            "Frames_number": 1,
            "lengthsInMeters": True,
            "sourceCameraNames": [view.name for view in views],
            "cameras": camera_entries,
        }
        write_json(folder / "sequence.json", content)


def rotation(world_from_camera: Floats) -> list[float]:
    """Return yaw, pitch and roll in degrees of a camera-to-world matrix (4, 4)."""
    roll, pitch, yaw = np.degrees(matrix_to_euler(world_from_camera[:3, :3] @ _FROM_OMAF)).tolist()
    return [yaw, pitch, roll]
