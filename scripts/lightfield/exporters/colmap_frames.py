"""Writes a COLMAP model for each frame of a sequence, as SpacetimeGaussians reads it.

``colmap_0/``, ``colmap_1/`` and so on have ``sparse/0`` and ``images`` of a frame each. Images have
the same names in all of them. SpacetimeGaussians tests with the first by name, which is cam00.png.
Source: readColmapSceneInfo in SpacetimeGaussians' dataset_readers.py.
"""

from pathlib import Path

from lightfield.export.sequence import SourceSequence
from lightfield.exporters.base import TO_RECTILINEAR
from lightfield.exporters.colmap import ColmapModel
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear


class ColmapFrames(ColmapModel):
    """A COLMAP model for each frame of a sequence, for SpacetimeGaussians."""

    name = "colmap_frames"
    summary = "Sequence for SpacetimeGaussians: a COLMAP model for each frame."
    rank = 14
    loader = "python train.py -s {}/colmap_0 --loader colmap  # SpacetimeGaussians"
    is_of_sequence = True
    needs_surfaces = True

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not a pinhole, the only camera of SpacetimeGaussians; {TO_RECTILINEAR}"
        return super().refusal(lens, has_depth)

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        source.require_still_cameras()
        for number, frame in enumerate(source.numbered().frames):
            self.write_model(frame, folder / f"colmap_{number}")
