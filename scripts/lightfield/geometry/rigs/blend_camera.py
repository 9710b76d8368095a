"""The .blend's own camera: where it is at each of some frames of the animation."""

from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading
from lightfield.geometry.rigs.rig import Frames, Rig, UnitPoses
from lightfield.geometry.rotations import Floats, matrix_to_euler


class BlendCamera(Rig):
    """One view for each of the ``frames``, of a scene that stands still.

    ``file``, ``rendered`` and ``max_views`` are for no scene YAML: the inventory of the .blend, the
    frame that is rendered (None is the .blend's own), and what a preset has thinned the rig to.
    """

    shape = "PLANE"
    is_loose = True

    type: Literal["blend_camera"]
    frames: Frames | None = Field(
        None,
        description="The camera's path: where it is at each of these frames, of the scene at "
        "scene.frame; without it, where it is at that frame.",
    )
    file: SkipJsonSchema[str | None] = None
    rendered: SkipJsonSchema[int | None] = None
    max_views: SkipJsonSchema[int | None] = Field(None, ge=1)

    @property
    def sequence(self) -> None:
        """Its frames are views of one dataset."""
        return

    @property
    def path(self) -> list[int | None]:
        """The frame of each view; None is the .blend's own."""
        if self.frames is None:
            return [self.rendered]
        frames = self.frames.numbers
        views = min(self.max_views or len(frames), len(frames))
        return [frames[round(row)] for row in np.linspace(0, len(frames) - 1, views).tolist()]

    @property
    def positions(self) -> int:
        return len(self.path)

    def placed(self, file: Path | str, rendered: int | None) -> Self:
        """Return the rig with its cameras where a .blend's inventory has them."""
        return self.model_copy(update={"file": str(file), "rendered": rendered})

    def is_at_one_place(self) -> bool:
        return self.view_count == 1  # Whether the camera moves is known once the .blend is read.

    def unit_poses(self) -> UnitPoses:
        """Return the views; raises `UserError` before the inventory is known."""
        if self.file is None:
            raise UserError("blend_camera: where it is, is known once the .blend has been read")
        said = read_keys(self.file, "inventory.py", "blend")["blend"]
        with reading(self.file, "inventory"):
            frames = [said["frame"] if frame is None else frame for frame in self.path]
            places = said["camera"]["matrices"]
            for frame in frames:
                if str(frame) not in places:
                    raise UserError(f"{self.file}: blend: has no camera at frame {frame}")
            matrices: Floats = np.array([places[str(frame)] for frame in frames])
            names = [f"view_{frame:04d}f" for frame in frames]
            turns = matrix_to_euler(matrices[:, :3, :3])
            return UnitPoses(names, np.arange(len(names)), matrices[:, :3, 3], turns)

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"max_views": positions}) if positions else None
