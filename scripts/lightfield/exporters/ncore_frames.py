"""Writes a sequence of NCore v4 with the times of an animation: see `ncore`.

Each view of the rig is a camera of its own, with a frame for each frame of the animation. The rig
may move. ``lidars/points`` has a frame at each time, too: the points of that time.

A moving camera's exposure takes half a frame of the animation, and begins at the frame's time.
"""

from collections.abc import Mapping
from pathlib import Path

from pydantic import Field

from lightfield.export.sequence import SourceSequence
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import AnimationRate, PointCount
from lightfield.exporters.ncore import NCoreSequence, Stream, TimedView, free_name, row_times_of

_MICROSECONDS = 1_000_000
# Of a moving camera's exposure, in frames of the animation.
_EXPOSURE = 0.5


class NCoreFrames(NCoreSequence):
    """A sequence of NCore v4 with the times of an animation."""

    name = "ncore_frames"
    summary = "Sequence of NCore v4 with times: a camera for each view of the rig."
    rank = 19
    loader = (
        "from pathlib import Path\nfrom ncore.data.v4 import SequenceComponentGroupsReader, "
        "SequenceLoaderV4\nreader = SequenceComponentGroupsReader([Path('{}/views.json')])\n"
        "sequence = SequenceLoaderV4(reader)"
    )
    is_of_sequence = True

    points: PointCount = Field(
        50000, description="Largest number of points at each frame, computed from depth."
    )
    rate: AnimationRate = 30

    def export(self, source: SourceSequence, folder: Path) -> None:
        """Write a sequence into ``folder``."""
        times = [round(_MICROSECONDS * second) for second in source.seconds(self.rate)]
        seen = dict(zip(times, source.frames, strict=True))
        duration = round(_MICROSECONDS * _EXPOSURE / self.rate)
        streams = [
            _stream(seen, number, duration) for number, _ in enumerate(source.lightfield.views)
        ]
        self.write_sequence(streams, seen, self.points, folder)


def _stream(seen: Mapping[int, SourceDataset], number: int, duration: int) -> Stream:
    """Return the stream of the view with this ``number``, whose frames are ``seen`` at times.

    Times are in microseconds, and so is the ``duration`` of a moving camera's exposure.
    """
    first = next(iter(seen.values()))
    view = first.lightfield.views[number]
    lens = first.view(view).lens
    rows = row_times_of(first, lens)
    frames = [
        TimedView.of(source, source.lightfield.views[number], time, duration, rows)
        for time, source in seen.items()
    ]
    name = free_name(view.name, f"{first.lightfield.path}: frames")
    return Stream(name, lens, frames, rows is not None)
