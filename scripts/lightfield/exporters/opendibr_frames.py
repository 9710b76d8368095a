"""Writes a sequence as OpenDIBR plays it: H.265 for each camera's colour and disparity.

OpenDIBR begins again after the last frame. It plays 30 frames a second, whatever the files say.

Of perspective views, there is also the list that dyn-lf-renderer's preprocessor reads. It has the
name of its folder. Cameras have x right, y down and z forward there. Source: its data_loader.py and
depth_processor.py.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.files import write_json
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import Floats
from lightfield.exporters.base import AnimationRate, odd_size_refusal
from lightfield.exporters.opendibr import LOADER, TO_OPENGL, OpenDibrViews, hevc_refusal
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import OPENCV_AXES

# The keys of a camera that both programs have.
_SHARED_KEYS = ("NameColor", "NameDepth", "Resolution", "Focal", "Depth_range")


class OpenDibrFrames(OpenDibrViews):
    """The videos and list that OpenDIBR plays."""

    name = "opendibr_frames"
    summary = "Sequence of all frames for OpenDIBR and dyn-lf-renderer, as videos."
    rank = 18
    loader = LOADER
    is_of_sequence = True

    rate: AnimationRate = 30

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return super().refusal(lens, has_depth) or odd_size_refusal(lens) or hevc_refusal()

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        source.require_still_cameras()
        rate = source.video_rate(self.rate)
        entries = self.write_views(source.frames, "h265", folder, rate)
        if isinstance(source.lens, Rectilinear):
            matrices = source.lightfield.world_from_cameras
            cameras = [_camera(*camera) for camera in zip(entries, matrices, strict=True)]
            write_json(folder / f"{folder.name}.json", {"cameras": cameras})


def _camera(entry: Mapping[str, Any], world_from_camera: Floats) -> dict[str, Any]:
    """Return dyn-lf-renderer's entry of a camera, by OpenDIBR's ``entry``."""
    model = world_from_camera @ OPENCV_AXES
    model[:3] = TO_OPENGL @ model[:3]
    shared = {key: entry[key] for key in _SHARED_KEYS}
    return {**shared, "Principal_point": entry["Principle_point"], "model": model.tolist()}
