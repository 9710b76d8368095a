"""A COLMAP model for each frame, read as SpacetimeGaussians' dataset_readers.py does."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from oracles.readers.colmap import read as read_colmap
from oracles.readers.contents import Exported, Part


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the model of each frame. The first image by name tests, the same in every frame."""
    models = []
    for number in range(len(frames)):
        folder = listing.parent / f"colmap_{number}"
        exported = read_colmap(folder / listing.name, size, options)
        names = sorted(view.name or "" for view in exported.views)
        exported.parts.append(Part(f"{folder}: images", "test", names[:1]))
        exported.parts.append(Part(f"{folder}: images", "train", names[1:]))
        models.append(exported)
    return models
