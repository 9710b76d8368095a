"""What is known of the open scene once it is set up for the views of a light field."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lightfield.formats.render_block import CameraMotion
from lightfield.geometry.lenses.base import RadialLens
from lightfield.rendering.scenes.ids import Numbers
from lightfield.rendering.scenes.instances import Instances


@dataclass(frozen=True, kw_only=True)
class OpenScene:
    """The open scene, set up for the views of a light field: what its renders ask of it.

    - ``device``: what Cycles renders on, CPU or GPU.
    - ``numbers``: by kind, "object" and "material", the numbers of the blocks, if a pass has them.
    - ``instances``: what the scene shows, if a pass numbers its instances. Else None.
    - ``namesakes``: the objects that share their names with others, if a pass is a matte.
    - ``volumes``: the full names of the objects that are only volumes.
    - ``motion``: how the camera moves while the shutter is open. None if it stands still.
    - ``shader_lens``: the lens, if a shader renders it because Cycles lacks it. Else None.
    """

    device: str
    numbers: Mapping[str, Numbers]
    instances: Instances | None
    namesakes: Sequence[Any]
    volumes: frozenset[str]
    motion: CameraMotion | None
    shader_lens: RadialLens | None

    def names(self, kind: str) -> dict[str, int]:
        """Return the numbers that the pass of a ``kind`` has: object, material or instance."""
        if kind != "instance":
            return self.numbers[kind].names
        assert self.instances
        return self.instances.names
