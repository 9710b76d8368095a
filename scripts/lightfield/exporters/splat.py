"""Writes a Gaussian splat of all surfaces, without training: a PLY as 3D Gaussian splatting has it.

Its world is the dataset's: metres, with Z up.
"""

from pathlib import Path
from typing import Literal

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
    # Settings and export.json have it only if it is used, so that earlier exports keep their bytes.
    fit: Literal["colours"] | None = Field(
        None,
        exclude_if=lambda fit: fit is None,
        description="What to fit to the views that train: `colours` fits colours and opacities, "
        "and keeps places and sizes.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return None if has_depth else NO_DEPTH

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``splat.ply`` into ``folder``."""
        made = splats.make(source, self.gaussians)
        if self.fit == "colours":
            # Only here, because its kernels take long to load.
            from lightfield.export.splat_fitting import fitted

            made = fitted(made, source, self.gaussians)
        gaussians.write(folder / "splat.ply", made)
