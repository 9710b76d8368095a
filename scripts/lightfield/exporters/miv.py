"""Writes a sequence of one frame for TMIV, the test model of MPEG immersive video.

- ``sequence.json``: the cameras, and the number of frames.
- ``<name>_texture_<W>x<H>_yuv420p10le.yuv``: colour, for each camera.
- ``<name>_depth_<W>x<H>_yuv420p16le.yuv``: normalised disparity, for each camera. It is computed
  from Z for perspective views, and from distance for panoramas. Level 0 means none.

In a sequence of several, frames follow one another in these files, and a camera has one range of
depth for all of them.

Axes are OMAF's: x forward, y left, z up. A rotation is yaw, pitch and roll in degrees. Source:
TMIV's sequence configurations.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import absolute_path, write_json
from lightfield.core.progress import Progress
from lightfield.export import yuv
from lightfield.export.disparity import DisparityFrames, Farther
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, Developed, odd_size_refusal
from lightfield.exporters.opendibr import projection
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import matrix_to_euler

_COLOUR_BITS = 10
_DEPTH_BITS = 16
# Frames a second of a sequence of one frame, which takes no time.
_RATE = 30
# TMIV's encoder finds the sequence by the name of its folder.
LOADER = (
    "Encoder -c CONFIGURATION -p inputDirectory {{}}/.. -p inputSequenceConfigPathFmt "
    "{{1}}/sequence.json -s {name} -n {frames}  # TMIV, with a configuration of its own"
)

# Columns: forward, left and up of OMAF's camera in our camera's axes (looks along −z, y up).
_FROM_OMAF = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])


class MivSequence(Developed):
    """The options of exports that are sequences for TMIV."""

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear | Equirectangular):
            return (
                "has a lens that MIV lacks; reproject to rectilinear, or to equirectangular, "
                "a fisheye of 180 degrees with longitude: [-90, 90], and format: exr"
            )
        return odd_size_refusal(lens) or (None if has_depth else NO_DEPTH)

    def write_sequence(
        self, frames: Sequence[SourceDataset], title: str, rate: float, folder: Path
    ) -> None:
        """Write the ``frames`` of still cameras into ``folder``, with ``rate`` of them a second."""
        lightfield = frames[0].lightfield
        farther = Farther()
        progress = Progress(len(lightfield.views), self.name, "views")
        camera_entries = []
        for view in lightfield.views:
            disparity = DisparityFrames(frames, view, farther)
            _write_videos(frames, view, disparity, folder)
            camera_entries.append(_camera(lightfield.lens, view, disparity.limits))
            progress.done()
        farther.report(folder)
        content: dict[str, Any] = {
            "Version": "3.0",
            "Content_name": title,
            "BoundingBox_center": lightfield.world_from_cameras[:, :3, 3].mean(axis=0).tolist(),
            "Fps": rate,
            "Frames_number": len(frames),
            "lengthsInMeters": True,
            "sourceCameraNames": [view.name for view in lightfield.views],
            "cameras": camera_entries,
        }
        write_json(folder / "sequence.json", content)


class Miv(MivSequence):
    """A sequence of one frame for TMIV, the test model of MPEG immersive video."""

    name = "miv"
    summary = "Sequence for TMIV, the test model of MPEG immersive video."
    rank = 6
    loader = LOADER.format(name="miv", frames=1)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        self.write_sequence([source], absolute_path(source.dataset).name, _RATE, folder)


def _write_videos(
    frames: Sequence[SourceDataset], view: View, disparity: DisparityFrames, folder: Path
) -> None:
    """Write the texture and the depth of a view in all ``frames``."""
    lens = frames[0].lens
    name = f"{view.name}_{{}}_{lens.width}x{lens.height}_yuv420p{{}}le.yuv"
    textures = (yuv.of_colour(frame.encoded(view), _COLOUR_BITS) for frame in frames)
    yuv.write_raw(folder / name.format("texture", _COLOUR_BITS), textures)
    depths = (yuv.of_levels(levels, _DEPTH_BITS) for levels in disparity.levels(_DEPTH_BITS, 1))
    yuv.write_raw(folder / name.format("depth", _DEPTH_BITS), depths)


def _camera(lens: Lens, view: View, limits: tuple[float, float]) -> dict[str, Any]:
    """Return the entry of a view's camera. ``limits`` are its nearest and its farthest depth."""
    return {
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


def rotation(world_from_camera: Floats) -> list[float]:
    """Return yaw, pitch and roll in degrees of a camera-to-world matrix (4, 4)."""
    roll, pitch, yaw = np.degrees(matrix_to_euler(world_from_camera[:3, :3] @ _FROM_OMAF)).tolist()
    return [yaw, pitch, roll]
