"""The description of a lightfield.json: a scene, its rendering, and the cameras that see it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PlainSerializer

from lightfield.configuration import blend_lock, scene_source
from lightfield.configuration.keys import VERSIONS, scene_fingerprint
from lightfield.configuration.scene_source import SceneSource
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading
from lightfield.core.names import FILE
from lightfield.engine.stage import cause
from lightfield.formats import blend
from lightfield.formats.inventory import read_inventory, scene_box
from lightfield.formats.lightfield import MODEL_PLACEMENT, OMNIDIRECTIONAL
from lightfield.formats.passes import VARIANCE
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import rigs
from lightfield.geometry.rigs import BlendCamera, Poses, Rig
from lightfield.settings.base import Settings
from lightfield.settings.types import AtLeastOne

# The keys of a scene YAML's `scene` block that lightfield.json records. Paths and URLs are not
# among them.
_SOURCE_KEYS = {
    *("builder", "parameters", "scene_name", "view_layers", "followed_camera", "frame", "targets"),
}
# The same for a model.
_MODEL_SOURCE_KEYS = {"frame", "targets", *scene_source.MODEL_KEYS}
# The keys on which a lightfield.json depends. It depends on the SHA-256 in the YAML, if any.
_CAPTURED_KEYS = _SOURCE_KEYS | {"blend", "model", "dataset", "sha256", *scene_source.MODEL_KEYS}


@dataclass(frozen=True, kw_only=True)
class Capture:
    """A scene as the cameras of a rig see it.

    ``scene_name`` is the scene YAML's name. ``render`` is the block of lightfield.json.
    ``external_files`` are path and SHA-256 of each file that a .blend reads. `resolved` fills them
    in. ``model_fingerprint`` is the identity of a model, and ``model_placement`` how it came into
    the unit box. `of_model` fills them in.
    """

    scene_name: str
    source: SceneSource
    render: RenderBlock
    rig: Rig
    external_files: Sequence[tuple[str, str | None]] = ()
    model_fingerprint: str | None = None
    model_placement: Mapping[str, Any] | None = None

    def of_model(self, record: Path) -> Self:
        """Return the capture with the facts of its model, from the ``record`` of its import."""
        content = read_keys(record, "import_model.py", "fingerprint")
        return replace(
            self,
            model_fingerprint=str(content["fingerprint"]),
            model_placement=content.get("placement"),
        )

    def resolved(self, inventory: Path) -> Self:
        """Return the capture with what the ``inventory`` of its scene says.

        These are the values of a user's .blend, and the size and center of a rig that fits the
        scene's box. Raises `UserError` if the scene lacks something that the scene YAML needs.
        """
        capture = self._of_blend(inventory) if self.source.blend else self
        if not capture.rig.is_fitted:
            return capture
        return replace(capture, rig=rigs.fitted(capture.rig, scene_box(inventory)))

    def _of_blend(self, inventory: Path) -> Self:
        """Return the capture with the values of a user's .blend."""
        content = read_inventory(inventory, "blend", "external_files")
        with reading(inventory, "inventory"):
            facts = content["blend"]
            external_files = [(file["path"], file["sha256"]) for file in content["external_files"]]
            frame: float = facts["frame"] if self.source.frame == FILE else self.frame
            render = self.render
            rig = self.rig
            if render.samples == FILE:
                most = render.most_samples or facts["samples"]
                samples = min(facts["samples"], most)
                if samples < render.fewest_samples:
                    raise UserError(
                        f"{self.source.blend}: has {samples} samples a pixel; must have at least "
                        f"{render.fewest_samples} for the pass {VARIANCE}; set render.samples"
                    )
                render = render.changed(samples=samples, most_samples=None)
            if blend.is_shutter_reset(facts, render):
                # Earlier versions rendered these views otherwise: they need another key.
                render = render.changed(shutter="centred")
            if render.depth_of_field:
                blend.camera_of(facts)
            if isinstance(rig, BlendCamera):
                blend.camera_of(facts)
                rig = rig.placed(inventory, frame)
            if rig.camera.lens == FILE:
                camera = blend.lens_of(facts, rig.camera.resolution)
                rig = rig.model_copy(update={"camera": camera})
            return replace(
                self,
                source=self.source.model_copy(
                    update={
                        "frame": frame,
                        "followed_camera": blend.followed_camera(
                            facts, self.source.followed_camera
                        ),
                    }
                ),
                render=render,
                rig=rig,
                external_files=external_files,
            )

    @property
    def frame(self) -> float:
        """The rendered frame. The frame of a .blend is known once the capture is `resolved`."""
        assert not isinstance(self.source.frame, str)
        return self.source.frame

    @property
    def depth(self) -> str | None:
        """The meaning of the rendered views' channel Z: ``z``, ``distance``, or None for no depth.

        Lenses that see beyond 180 degrees have no usable Z-depth. Views without a centre have no
        depth at all.
        """
        if self.rig.is_omnidirectional:
            return None
        match self.render.depth:
            case "none":
                return None
            case "auto":
                return self.rig.camera.make().usual_depth
            case meaning:
                return str(meaning)

    @property
    def fingerprint(self) -> str:
        """The identity of the scene: see `scene_fingerprint` and `model_fingerprint`."""
        if self.source.model:
            if self.model_fingerprint is None:
                raise UserError(
                    f"{self.source.model}: is not imported; run scripts/import_model.py first"
                )
            return self.model_fingerprint
        return scene_fingerprint(self.source, self.external_files)

    @property
    def origin(self) -> dict[str, Any]:
        """The keys of lightfield.json that describe the scene and its rendering."""
        origin: dict[str, Any] = {"depth": self.depth}
        if self.rig.stereo and self.rig.is_omnidirectional:
            origin[OMNIDIRECTIONAL] = self.rig.stereo.distance
        origin["frame"] = self.frame
        scene = self.source.model_dump(
            include=_MODEL_SOURCE_KEYS if self.source.model else _SOURCE_KEYS,
            exclude_none=True,
            # The frame in a .blend may have a fraction. The frame in a scene YAML has none.
            warnings=False,
        )
        # Without the folders of this machine.
        if self.source.light_file:
            scene["light"] = Path(self.source.light_file).name
        if self.source.builder:
            scene["builder"] = Path(self.source.builder).name
        origin["scene"] = {
            "name": self.scene_name,
            **scene,
            "fingerprint": self.fingerprint,
        }
        if self.model_placement:
            origin[MODEL_PLACEMENT] = self.model_placement
        origin["render"] = self.render.to_json()
        return origin

    @property
    def builder_fingerprint(self) -> str | None:
        """A value that changes when the builder does. A user's .blend or model needs none."""
        return None if self.source.blend or self.source.model else self.fingerprint

    @property
    def imported(self) -> str | None:
        """The folder of a light field that somebody else has rendered. None for other datasets."""
        if isinstance(self.rig, Poses) and self.source.dataset:
            return str(Path(self.rig.file).parent)
        return None


def _source_as_written(source: SceneSource) -> dict[str, Any]:
    """Return the keys of a scene YAML's `scene` on which a lightfield.json depends."""
    if source.dataset:
        return {"dataset": source.dataset}
    return source.model_dump(
        mode="json", include=_CAPTURED_KEYS, exclude_unset=True, exclude_none=True
    )


def _without_locked_sha256(capture: Capture) -> SceneSource:
    """Return the source without a SHA-256 from the lock file, because a job may write that file."""
    source = capture.source
    if source.blend is None:
        return source
    unlocked = source.model_copy(update={"sha256": None})
    locked_sha256, _ = blend_lock.blend_sha256(capture.scene_name, unlocked)
    return unlocked if source.sha256 == locked_sha256 else source


class LightfieldSettings(Settings):
    """The settings of scripts/make_lightfield.py."""

    scene: str = Field(description="Name of a file in configs/scenes/.")
    source: Annotated[SceneSource, PlainSerializer(_source_as_written)] = Field(
        description="The block `scene` of the scene YAML."
    )
    render: Annotated[RenderBlock, PlainSerializer(RenderBlock.to_json)] = Field(
        description="The block `render` of the scene YAML, within the limits of the preset."
    )
    rig: Annotated[rigs.AnyRig, PlainSerializer(rigs.as_written)] = Field(
        description="The rig's block in the scene YAML."
    )
    flow: bool = Field(
        False, description="Whether to choose a neighbour of each view, for its optical flow."
    )
    file_look: bool | None = Field(
        None,
        description="Whether to write the look of the .blend down, because something is developed "
        "with it.",
    )
    panorama_width: AtLeastOne | None = Field(
        None,
        description="Width of a panorama from the rig's centre. With this key, the panorama is the "
        "only view.",
        json_schema_extra={"unit": "pixels"},
    )
    fingerprint: str | None = cause(
        "Hash of the builder's code. If it changes, the scene is captured again."
    )
    poses_sha256: str | None = cause(
        "SHA-256 of the rig's file of poses. If it changes, the file is read again."
    )
    spread_version: int | None = cause(
        "Version of the choice of test views, if the rig's split has the key every."
    )

    @classmethod
    def of_capture(cls, capture: Capture, panorama_width: int | None = None, **keys: Any) -> Self:
        """Return the settings for a capture, or for its panorama. ``keys`` are the other keys."""
        rig = capture.rig
        # These centres are unknown until the scene has been read.
        if panorama_width and not (isinstance(rig, BlendCamera) or rig.is_fitted):
            rig = panorama_rig(rig, panorama_width)
        return cls.of(
            scene=capture.scene_name,
            source=_source_as_written(_without_locked_sha256(capture)),
            render=capture.render.to_json(),
            rig=rig,
            panorama_width=panorama_width,
            spread_version=VERSIONS["spread"] if rig.tests_one_of else None,
            **keys,
        )

    @property
    def capture(self) -> Capture:
        """The capture that these settings describe, with the recorded SHA-256 of a .blend."""
        source = self.source
        if source.blend:
            sha256, _ = blend_lock.blend_sha256(self.scene, source)
            source = source.model_copy(update={"sha256": sha256})
        return Capture(scene_name=self.scene, source=source, render=self.render, rig=self.rig)


def panorama_rig(rig: Rig, width: int) -> Rig:
    """Return a rig of one full equirectangular view, level, at the centre of ``rig``."""
    return rigs.from_settings(
        {
            "type": "lattice",
            "cameras": [1, 1, 1],
            "center": rig.middle.tolist(),
            "camera": {"lens": "equirectangular", "resolution": [width, width // 2]},
        }
    )
