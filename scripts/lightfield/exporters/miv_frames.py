"""Writes a sequence for TMIV, the test model of MPEG immersive video: see `miv`."""

from pathlib import Path

from lightfield.core.files import absolute_path
from lightfield.export.sequence import SourceSequence
from lightfield.exporters.base import AnimationRate
from lightfield.exporters.miv import LOADER, MivSequence


class MivFrames(MivSequence):
    """A sequence of all frames for TMIV, the test model of MPEG immersive video."""

    name = "miv_frames"
    summary = "Sequence of all frames for TMIV, the test model of MPEG immersive video."
    rank = 17
    loader = LOADER.format(name="miv_frames", frames="FRAMES")
    is_of_sequence = True

    rate: AnimationRate = 30

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        # TMIV's encoder reads the cameras once, for all frames.
        source.require_still_cameras()
        title = absolute_path(source.dataset).name
        self.write_sequence(source.frames, title, source.video_rate(self.rate), folder)
