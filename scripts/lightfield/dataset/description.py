"""The description of a dataset: what is rendered, how, and by which cameras."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Self

from lightfield.core.files import reading
from lightfield.dataset import blend, config
from lightfield.dataset.config import FILE, Preset, SceneSource
from lightfield.dataset.exports import Exports
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.keys import scene_fingerprint
from lightfield.dataset.lightfield import OMNIDIRECTIONAL
from lightfield.geometry.rigs import BlendCamera, Poses, Rig

# The keys of a scene YAML's `scene` block that lightfield.json records. Paths and URLs are none.
SOURCE_KEYS = {"builder", "parameters", "scene_name", "view_layers", "frame"}


@dataclass(frozen=True)
class Cluster:
    """A cluster that renders: how many jobs run at once, and the cores of each job."""

    jobs: int
    cores: int


@dataclass(frozen=True)
class Description:
    """One scene seen by one rig, with every default filled in and the preset applied.

    ``scene_name`` is the scene YAML's name. ``rig_folder`` is the rig's name. In a sequence the
    frame's folder follows, as in LFSphere/f00001. ``render`` is the block of lightfield.json.
    """

    scene_name: str
    preset: str
    rig_name: str
    rig_folder: str
    source: SceneSource
    render: dict[str, Any]
    rig: Rig
    reprojections: dict[str, config.Reprojection]
    flow: config.Flow | None
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
    # Path and SHA-256 of each file that a .blend reads. `resolved` fills them in.
    external_files: Sequence[tuple[str, str | None]] = ()

    def resolved(self, inventory: Path) -> Self:
        """Return the dataset with the values of a user's .blend, which its ``inventory`` lists.

        Raises `UserError` if the .blend lacks something that the scene YAML needs.
        """
        if not self.source.blend:
            return self
        content = read_inventory(inventory, "blend", "external_files")
        with reading(inventory, "inventory"):
            facts = content["blend"]
            external_files = [(file["path"], file["sha256"]) for file in content["external_files"]]
            frame = int(facts["frame"] if self.source.frame == FILE else self.source.frame)
            render = dict(self.render)
            rig = self.rig
            if render.get("samples") == FILE:
                most = render.pop("most_samples", facts["samples"])
                render["samples"] = min(facts["samples"], most)
            if render.get("depth_of_field"):
                blend.camera_of(facts)
            if isinstance(rig, BlendCamera):
                blend.camera_of(facts)
                rig = rig.placed(inventory, frame)
            if rig.camera.lens == FILE:
                camera = blend.lens_of(facts, rig.camera.resolution)
                rig = rig.model_copy(update={"camera": camera})
            return replace(
                self,
                source=self.source.model_copy(update={"frame": frame}),
                render=render,
                rig=rig,
                external_files=external_files,
            )

    @property
    def scene_folder(self) -> str:
        """The folder of the scene under its preset: garden, or garden_tiny."""
        is_full = self.preset == "full"
        return self.scene_name if is_full else f"{self.scene_name}_{self.preset}"

    @cached_property
    def view_count(self) -> int:
        """Number of views of the rig."""
        return self.rig.view_count

    @property
    def depth(self) -> str | None:
        """The meaning of the rendered views' channel Z: ``z``, ``distance``, or None for no depth.

        Lenses that see beyond 180 degrees have no usable Z-depth. Views without a centre have no
        depth at all.
        """
        if self.rig.is_omnidirectional:
            return None
        match self.render["depth"]:
            case "none":
                return None
            case "auto":
                return self.rig.camera.make().usual_depth
            case meaning:
                return str(meaning)

    @property
    def name(self) -> str:
        """Scene and rig, as in garden_tiny/LFSphere."""
        return f"{self.scene_folder}/{self.rig_folder}"

    @property
    def fingerprint(self) -> str:
        """The identity of the scene: see `scene_fingerprint`."""
        return scene_fingerprint(self.source, self.external_files)

    def origin(self, render: dict[str, Any]) -> dict[str, Any]:
        """Return the keys of lightfield.json that say what is rendered, and how.

        ``render`` is its block `render`.
        """
        origin: dict[str, Any] = {"depth": self.depth}
        if self.rig.stereo and self.rig.is_omnidirectional:
            origin[OMNIDIRECTIONAL] = self.rig.stereo.distance
        origin["frame"] = self.source.frame
        origin["scene"] = {
            "name": self.scene_name,
            **self.source.model_dump(include=SOURCE_KEYS, exclude_none=True),
            "fingerprint": self.fingerprint,
        }
        origin["render"] = render
        return origin

    @property
    def builder_fingerprint(self) -> str | None:
        """A value that changes when the builder does. A user's .blend needs none."""
        return None if self.source.blend else self.fingerprint

    @property
    def imported(self) -> str | None:
        """The folder of a light field that somebody else has rendered. None for other datasets."""
        if isinstance(self.rig, Poses) and self.source.dataset:
            return str(Path(self.rig.file).parent)
        return None

    @property
    def limits_json(self) -> str:
        """The preset's limits, in the form that scripts/make_lightfield.py takes."""
        return self.limits.model_dump_json(exclude_none=True)

    @property
    def panorama_width(self) -> int:
        """The panorama's width: twice a 180 degree fisheye's angular resolution, at most 4096."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    @property
    def pixels(self) -> int:
        """The number of pixels of a view."""
        return math.prod(self.rig.camera.resolution)
