"""One scene seen by one rig: what is rendered, how, and by which cameras."""

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

# What of a scene YAML's `scene` block is written down: not where a file came from, nor where it is.
SOURCE_KEYS = {"builder", "parameters", "scene_name", "view_layers", "frame"}


@dataclass(frozen=True)
class Cluster:
    """A cluster that renders: how many jobs run at once, and the cores of each job."""

    jobs: int
    cores: int


@dataclass(frozen=True)
class Description:
    """One scene seen by one rig, with every default filled in and the preset applied.

    ``scene_name`` is the scene YAML's name. ``rig_folder`` is the rig's name, in a sequence
    followed by the frame's folder, as in LFSphere/f00001. ``render`` is what lightfield.json holds.
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
    # Path and SHA-256 of each file that a .blend reads, once its inventory is known.
    external_files: Sequence[tuple[str, str | None]] = ()

    def resolved(self, inventory: Path) -> Self:
        """Return the dataset with what a user's .blend says, by its ``inventory``, filled in.

        Raises `UserError` where the .blend has not what the scene YAML asks of it.
        """
        if not self.source.blend:
            return self
        found = read_inventory(inventory, "blend", "external_files")
        with reading(inventory, "inventory"):
            said = found["blend"]
            frame = int(said["frame"] if self.source.frame == FILE else self.source.frame)
            render = dict(self.render)
            rig = self.rig
            if render.get("samples") == FILE:
                most = render.pop("most_samples", said["samples"])
                render["samples"] = min(said["samples"], most)
            if render.get("depth_of_field"):
                blend.camera_of(said)
            if isinstance(rig, BlendCamera):
                blend.camera_of(said)
                rig = rig.placed(inventory, frame)
            if rig.camera.lens == FILE:
                camera = blend.lens_of(said, rig.camera.resolution)
                rig = rig.model_copy(update={"camera": camera})
            return replace(
                self,
                source=self.source.model_copy(update={"frame": frame}),
                render=render,
                rig=rig,
                external_files=[(file["path"], file["sha256"]) for file in found["external_files"]],
            )

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
    def depth(self) -> str | None:
        """What channel Z of the rendered views means: ``z``, ``distance``, or None for no depth.

        Z-depth is unusable for lenses that see beyond 180 degrees, and depth without a centre.
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
        """What the scene is identified by: see `scene_fingerprint`."""
        return scene_fingerprint(self.source, self.external_files)

    def origin(self, render: dict[str, Any]) -> dict[str, Any]:
        """Return what lightfield.json says of what is rendered, and how: by this ``render``."""
        return {
            "depth": self.depth,
            **(
                {OMNIDIRECTIONAL: self.rig.stereo.distance}
                if self.rig.stereo and self.rig.is_omnidirectional
                else {}
            ),
            "frame": self.source.frame,
            "scene": {
                "name": self.scene_name,
                **self.source.model_dump(include=SOURCE_KEYS, exclude_none=True),
                "fingerprint": self.fingerprint,
            },
            "render": render,
        }

    @property
    def builder_fingerprint(self) -> str | None:
        """What changes when a builder does; a user's .blend is a file, which is checked."""
        return None if self.source.blend else self.fingerprint

    @property
    def imported(self) -> str | None:
        """The folder of a light field that somebody else has rendered."""
        if isinstance(self.rig, Poses) and self.source.dataset:
            return str(Path(self.rig.file).parent)
        return None

    @property
    def limits_json(self) -> str:
        """The preset's limits, as scripts/make_lightfield.py takes them."""
        return self.limits.model_dump_json(exclude_none=True)

    @property
    def panorama_width(self) -> int:
        """Twice a 180 degree fisheye view's angular resolution, within 4096 pixels."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    @property
    def pixels(self) -> int:
        """Pixels of a view."""
        return math.prod(self.rig.camera.resolution)
