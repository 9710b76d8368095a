"""Writes a Gaussian splat of all surfaces, without training: a PLY as 3D Gaussian splatting has it.

Its world is the dataset's: metres, with Z up.
"""

from pathlib import Path

from pydantic import Field

from lightfield.export import splats
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import NO_DEPTH, ForTraining, PointCount
from lightfield.formats import gaussians
from lightfield.geometry.lenses import Lens


class Splat(ForTraining):
    """A Gaussian splat, for viewers, and to begin a training with."""

    name = "splat"
    summary = "Gaussian splat without training, for viewers, and to begin a training with."
    rank = 19
    chooses_tests = True
    loader = "# Open {}/splat.ply in SuperSplat, Brush or another viewer of splats."

    gaussians: PointCount = Field(1_000_000, description="The largest number of Gaussians.")

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return None if has_depth else NO_DEPTH

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``splat.ply`` into ``folder``."""
        gaussians.write(folder / "splat.ply", splats.make(source, self.gaussians))
