"""Writes a COLMAP model for each frame of a sequence, as SpacetimeGaussians reads it.

``colmap_0/``, ``colmap_1/`` and so on have ``sparse/0`` and ``images`` of a frame each. Images have
the same names in all of them. SpacetimeGaussians tests with the first by name, which is cam00.png.
Source: readColmapSceneInfo in SpacetimeGaussians' dataset_readers.py.
"""

from pathlib import Path

from lightfield.configuration.exports import ColmapFrames
from lightfield.export import colmap
from lightfield.export.sequence import SourceSequence


def export(source: SourceSequence, settings: ColmapFrames, folder: Path) -> None:
    """Write a sequence into ``folder``."""
    source.require_still_cameras()
    for number, frame in enumerate(source.numbered().frames):
        colmap.export(frame, settings, folder / f"colmap_{number}")
