"""Writes a sequence as OpenDIBR plays it: H.265 for each camera's colour and disparity.

OpenDIBR begins again after the last frame. It plays 30 frames a second, whatever the files say.
"""

from pathlib import Path

from lightfield.export.sequence import SourceSequence
from lightfield.exporters.base import AnimationRate, odd_size_refusal
from lightfield.exporters.opendibr import LOADER, OpenDibrViews, hevc_refusal
from lightfield.geometry.lenses import Lens


class OpenDibrFrames(OpenDibrViews):
    """The videos and list that OpenDIBR plays."""

    name = "opendibr_frames"
    summary = "Sequence of all frames for OpenDIBR: videos of colour and disparity."
    rank = 18
    loader = LOADER
    is_of_sequence = True

    rate: AnimationRate = 30

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return super().refusal(lens, has_depth) or odd_size_refusal(lens) or hevc_refusal()

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        source.require_still_cameras()
        self.write_views(source.frames, "h265", folder, source.video_rate(self.rate))
