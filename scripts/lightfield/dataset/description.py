"""One scene seen by one rig: what is rendered, and what the views become."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from lightfield.dataset import config
from lightfield.dataset.capture import Capture
from lightfield.dataset.config import Preset
from lightfield.dataset.exports import Exports


@dataclass(frozen=True)
class Cluster:
    """A cluster that renders: how many jobs run at once, and the cores of each job."""

    jobs: int
    cores: int


@dataclass(frozen=True, kw_only=True)
class Description(Capture):
    """One scene seen by one rig, with every default filled in and the preset applied.

    ``rig_folder`` is the rig's name. In a sequence the frame's folder follows, as in
    LFSphere/f00001.
    """

    preset: str
    rig_name: str
    rig_folder: str
    reprojections: dict[str, config.Reprojection]
    flow: config.Flow | None
    exports: Exports
    # For the report, from the rig's centre.
    has_panorama: bool
    limits: Preset
    # Folders of the rigs in which others test what is trained on this one, and that of the rig on
    # which is trained what this one tests.
    tested_by: tuple[str, ...] = ()
    trained_by: str | None = None
    results_root: str = "results"
    work_root: str = "work"
    views_per_shard: int | Literal["auto"] = "auto"
    # None where this machine renders.
    cluster: Cluster | None = None

    @property
    def scene_folder(self) -> str:
        """The scene's name and the preset's unless it is ``full``: presets keep to themselves."""
        full = self.preset == "full"
        return self.scene_name if full else f"{self.scene_name}_{self.preset}"

    @cached_property
    def view_count(self) -> int:
        """Number of views of the rig."""
        return self.rig.view_count

    @property
    def name(self) -> str:
        """Scene and rig, as in garden_tiny/LFSphere."""
        return f"{self.scene_folder}/{self.rig_folder}"

    @property
    def panorama_width(self) -> int:
        """Twice a 180 degree fisheye view's angular resolution, within 4096 pixels."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    @property
    def pixels(self) -> int:
        """Pixels of a view."""
        return math.prod(self.rig.camera.resolution)
