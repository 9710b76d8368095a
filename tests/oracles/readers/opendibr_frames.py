"""Videos for OpenDIBR, of all frames of an animation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from oracles.readers import opendibr
from oracles.readers.contents import Exported, video_rate
from oracles.readers.mp4 import read_mp4


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the cameras, which all frames share, and the headers of the videos."""
    shared = opendibr.read(listing, size, options | {"format": "h265"})
    for video in sorted(listing.parent.glob("*.mp4")):
        facts = read_mp4(video)
        shared.expect(f"{video}: pixels", [facts.width, facts.height], list(size))
        shared.expect(f"{video}: pictures", facts.pictures, len(frames))
        shared.expect(f"{video}: pictures a second", facts.rate, video_rate(options, frames))
    later = [Exported(views=shared.views, cameras=shared.cameras) for _ in range(len(frames) - 1)]
    return [shared, *later]
