"""The .blend's own camera: its pose at each of some frames of the animation."""

import math
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
    """The views of the .blend's own camera, one for each of ``frames``. The scene does not move.

    Three fields are not for scene YAMLs. ``file`` is the inventory of the .blend. ``rendered`` is
    the rendered frame, and None means the .blend's own. ``max_views`` is the limit of a preset.
    """

    shape = "PLANE"
    is_loose = True

    type: Literal["blend_camera"]
    frames: Frames | None = Field(
        None,
        description="Frames at which the pose of the .blend's camera is taken. Each frame gives "
        "one view, and the scene itself stays at scene.frame. Without this key, there is one view, "
        "with the camera's pose at scene.frame.",
    )
    file: SkipJsonSchema[str | None] = None
    # Pydantic keeps a whole number whole.
    rendered: SkipJsonSchema[int | float | None] = None
    max_views: SkipJsonSchema[int | None] = Field(None, ge=1)

    @property
    def sequence(self) -> None:
        """Its frames are views of one dataset."""
        return

    @property
    def path(self) -> list[float | None]:
        """The frame of each view; None is the .blend's own."""
        if self.frames is None:
            return [self.rendered]
        frames = self.frames.numbers
        views = min(self.max_views or len(frames), len(frames))
        return [frames[round(row)] for row in np.linspace(0, len(frames) - 1, views).tolist()]

    @property
    def positions(self) -> int:
        return len(self.path)

    def placed(self, file: Path | str, rendered: float | None) -> Self:
        """Return the rig with its cameras where a .blend's inventory has them."""
        return self.model_copy(update={"file": str(file), "rendered": rendered})

    def is_at_one_place(self) -> bool:
        return self.view_count == 1  # Only the .blend can tell whether the camera moves.

    def unit_poses(self) -> UnitPoses:
        """Return the views. Raises `UserError` before the inventory has been set."""
        if self.file is None:
            raise UserError("blend_camera: the camera's place is unknown until the .blend is read")
        blend = read_keys(self.file, "inventory.py", "blend")["blend"]
        with reading(self.file, "inventory"):
            frames = [blend["frame"] if frame is None else frame for frame in self.path]
            matrix_at_frame = blend["camera"]["matrices"]
            for frame in frames:
                if str(frame) not in matrix_at_frame:
                    raise UserError(f"{self.file}: blend: has no camera at frame {frame}")
            matrices: Floats = np.array([matrix_at_frame[str(frame)] for frame in frames])
            names = [f"view_{math.floor(frame):04d}f" for frame in frames]
            rotations = matrix_to_euler(matrices[:, :3, :3])
            return UnitPoses(names, np.arange(len(names)), matrices[:, :3, 3], rotations)

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"max_views": positions}) if positions else None
