"""A sequence of MPEG immersive video with all frames of an animation."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.core.files import read_json
from oracles.readers import miv
from oracles.readers.contents import Exported, video_rate


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the cameras, which all frames share, and the pictures of each frame."""
    shared = miv.read(listing, size, options)
    path = listing.parent / "sequence.json"
    content = read_json(path)
    shared.expect(f"{path}: Frames_number", content["Frames_number"], len(frames))
    shared.expect(f"{path}: Fps", content["Fps"], video_rate(options, frames))
    exported = [shared]
    for number in range(1, len(frames)):
        pictures = [replace(picture, frame=number) for picture in shared.pictures]
        later = Exported(views=shared.views, cameras=shared.cameras, pictures=pictures)
        exported.append(later)
    return exported
