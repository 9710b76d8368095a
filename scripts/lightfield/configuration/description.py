"""The description of a dataset: what is rendered, and what the views become."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from lightfield.configuration import scene_yaml
from lightfield.configuration.capture import Capture
from lightfield.configuration.config_file import Preset
from lightfield.configuration.exports import Exports
from lightfield.configuration.reprojections import Reprojection


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
    reprojections: dict[str, Reprojection]
    flow: scene_yaml.Flow | None
    mesh: scene_yaml.MeshFiles | None
    exports: Exports
    # Whether the report shows a panorama from the rig's centre.
    has_panorama: bool
    limits: Preset
    # The folders of the rigs that test what is trained on this rig.
    tested_by: tuple[str, ...] = ()
    # The folder of the rig that trains what this rig tests.
    trained_by: str | None = None
    results_root: str = "results"
    work_root: str = "work"
    views_per_shard: int | Literal["auto"] = "auto"
    # None if this machine renders.
    cluster: Cluster | None = None
    # The member of a family of scenes whose dataset this is.
    member: str | None = None

    @property
    def scene_folder(self) -> str:
        """The folder of the scene under its preset: garden, garden_tiny, or garden_tiny/0007."""
        is_full = self.preset == "full"
        folder = self.scene_name if is_full else f"{self.scene_name}_{self.preset}"
        return f"{folder}/{self.member}" if self.member else folder

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
        """The panorama's width: twice a 180 degree fisheye's angular resolution, at most 4096."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    @property
    def pixels(self) -> int:
        """The number of pixels of a view."""
        return math.prod(self.rig.camera.resolution)
