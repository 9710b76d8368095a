"""Reads the frames of a sequence for an exporter. Each frame is a dataset of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.formats.layout import frame_times
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.lenses import Lens
from lightfield.imaging.look import Look


@dataclass(frozen=True)
class SourceSequence:
    """The views of a rig at each frame of a sequence, in the order of time.

    - ``dataset``: the rig's folder, which holds a folder for each frame.
    - ``frames``: the views at each frame.
    - ``numbers``: the frames of the animation.
    """

    dataset: Path
    frames: Sequence[SourceDataset]
    numbers: Sequence[int]

    @classmethod
    def of_folders(
        cls,
        rig: Path,
        folders: Sequence[str],
        name: str,
        suffix: str,
        beside: Mapping[str, Path],
        exposure: float = 0.0,
        reinhard: float = 1.0,
        look_name: str | None = None,
    ) -> "SourceSequence":
        """Return the sequence in the ``folders`` of a rig's folder, such as f00001.

        ``beside`` are the folders of the rigs whose views test these. The other arguments are
        fields of `SourceDataset`. Raises `UserError` for a sequence with fewer than two frames, and
        if a frame has another lens or other views than the first.
        """
        if len(folders) < 2:
            raise UserError(f"{rig}: has {len(folders)} frames; a sequence must have at least two")
        frames = [
            SourceDataset(
                rig / frame,
                name,
                suffix,
                {other: folder / frame for other, folder in beside.items()},
                exposure,
                reinhard,
                look_name=look_name,
            )
            for frame in sorted(folders)
        ]
        first = frames[0].lightfield
        for frame in frames[1:]:
            lightfield = frame.lightfield
            names = [view.name for view in lightfield.views]
            if lightfield.lens != first.lens or names != [view.name for view in first.views]:
                raise UserError(
                    f"{lightfield.path}: has another lens or other views than the first"
                )
        numbers = [int(frame.lightfield.frame) for frame in frames]
        return cls(rig, frames, numbers)

    @property
    def name(self) -> str:
        """The name of the reprojection. Empty for the rendered views."""
        return self.frames[0].name

    @property
    def lightfield(self) -> LightField:
        """The views at the first frame."""
        return self.frames[0].lightfield

    @property
    def look(self) -> Look | None:
        """The look of the developed views, if they get one."""
        return self.frames[0].look

    @property
    def lens(self) -> Lens:
        return self.lightfield.lens

    @property
    def lenses(self) -> dict[Lens, Path]:
        """The different lenses of the views, each with a lightfield.json that has it."""
        return self.frames[0].lenses

    @property
    def has_depth(self) -> bool:
        return self.frames[0].has_depth

    @property
    def times(self) -> list[float]:
        """The time of each frame: 0 for the first, 1 for the last."""
        return frame_times(self.numbers)

    def seconds(self, rate: float) -> list[float]:
        """Return the time of each frame, 0 for the first, of an animation of ``rate`` Hz."""
        return [(number - self.numbers[0]) / rate for number in self.numbers]

    def video_rate(self, rate: float) -> float:
        """Return the frames a second of a video of the sequence, of an animation of ``rate`` Hz.

        Raises `UserError` if the frames do not follow one another at equal steps.
        """
        steps = {following - number for number, following in pairwise(self.numbers)}
        if len(steps) > 1:
            raise UserError(
                f"{self.dataset}: frames: are {', '.join(map(str, self.numbers))}; a video needs "
                "frames at equal steps"
            )
        return rate / steps.pop()

    def require_still_cameras(self) -> None:
        """Raise `UserError` if a camera moves: the consumer has one pose for all frames."""
        for frame in self.frames[1:]:
            if not np.array_equal(
                frame.lightfield.world_from_cameras, self.lightfield.world_from_cameras
            ):
                raise UserError(
                    f"{frame.lightfield.path}: frames: its cameras are not where they were at the "
                    "first frame, and this format has one pose for each camera"
                )

    def numbered(self) -> "SourceSequence":
        """Return the sequence with views named cam00, cam01 and so on. cam00 is the test view.

        cam00 is the first test view of the rig's split, and the others are its training views.
        Without a split, cam00 is the first view by name.
        """
        views: list[View] = sorted(self.lightfield.views, key=lambda view: view.name)
        if any(view.split for view in views):
            parts = splits(self.lightfield)
            views = [parts.test[0], *parts.train]
        digits = max(2, len(str(len(views) - 1)))
        names = {f"cam{number:0{digits}d}": view.name for number, view in enumerate(views)}
        return self._renamed(names)

    def training(self) -> "SourceSequence":
        """Return the sequence of the views that train, named image1, image2 and so on.

        Without a split, all views train. Raises `UserError` if none does.
        """
        views = sorted(self.lightfield.views, key=lambda view: view.name)
        views = [view for view in views if view.split in (None, "train")]
        if not views:
            raise UserError(f"{self.lightfield.path}: frames: no view is left to train")
        return self._renamed({f"image{n}": view.name for n, view in enumerate(views, 1)})

    def _renamed(self, names: Mapping[str, str]) -> "SourceSequence":
        """Return the sequence of these views alone: new names and the views'."""
        return replace(self, frames=[replace(frame, renamed=names) for frame in self.frames])
