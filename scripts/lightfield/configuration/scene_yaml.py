"""The scene YAML as typed models, which say what each key may be. Reads and checks scene YAMLs.

scripts/schema.py makes the JSON schemas in configs/schema/ from these models and the models of
config_file.py. With the schemas, editors complete and check the files.
"""

import difflib
import math
import re
from collections.abc import Iterable, Sequence, Set
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, model_validator

from lightfield.configuration.exports import NO_DEPTH, NOT_EXR, Export, Exports
from lightfield.configuration.family import Family, stand_in
from lightfield.configuration.publication import PUBLISHED_FOLDER, SPDX, Publication
from lightfield.configuration.render_settings import Render
from lightfield.configuration.reprojections import (
    LIGHT_GROUPS,
    OPTICS,
    Light,
    Reprojection,
    ReprojectionEntry,
    bracketed,
    face_problem,
)
from lightfield.configuration.scene_source import SceneSource
from lightfield.core.errors import UserError
from lightfield.core.names import FILE, MESH, PARTS, RENDERED, ROOT, VIEWS
from lightfield.formats import light_groups, published
from lightfield.formats.passes import FLOW, GROUP_PREFIX, PASSES
from lightfield.formats.sensors import Sensor
from lightfield.geometry.frames import MOST_VIEWS as MOST_VIEWS_OF_RIG
from lightfield.geometry.lenses import LENSES, CameraSettings
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import AnyRig, BlendCamera, Poses, Rig
from lightfield.geometry.rigs.split_setting import Chosen
from lightfield.imaging import blender_looks
from lightfield.settings.base import Name, Settings, checked, checked_yaml, suggestion
from lightfield.settings.types import Auto, unique_names
from lightfield.settings.yaml_files import (
    find_key,
    located,
    parse_yaml,
    read_settings_text,
    read_yaml,
)

SCENES = ROOT / "configs" / "scenes"
# The user's own scene YAMLs, relative to Snakemake's working folder.
OWN_SCENES = Path("configs", "scenes")
FLOW_PLACES = "needs views from two or more places"
# Names that a rig's folder cannot have, because other folders beside it have them.
_RIG_NEIGHBOURS = {PUBLISHED_FOLDER, "settings", "trials"}
# Names that a reprojection's folder cannot have.
_REPROJECTION_NEIGHBOURS = {
    "exr",
    "exports",
    MESH,
    "panorama",
    RENDERED,
    "report",
    "settings",
    FLOW.name,
    *PASSES,
}
# Names of files, and of a sequence's frames, beside the folders of rigs and reprojections.
_OTHER_NEIGHBOURS = re.compile(r"f\d{5,7}|.*\.(blend|html|jsonl?|lock|log|part|tar|tsv|txt)")
# For keys of a camera in lightfield.json: Blender's least and largest value, the unit of messages,
# and the name in messages.
_BLENDER_LIMITS = {
    "focal_length": (1.0, 1e6, 1.0, "focal length in mm"),
    "fisheye_fov": (0.1745, 31.4159, math.pi / 180, "fov in degrees"),
    "fisheye_lens": (0.01, 100.0, 1.0, "focal length in mm"),
}
# Blender makes each side of a smaller image so long.
SMALLEST_IMAGE = 4
# Planning more frames or views than these would take hours.
MOST_FRAMES = 10_000
MOST_VIEWS = 1_000_000


class Flow(Settings):
    """Optical flow between pairs of views."""

    pairs: Literal["neighbours"] = Field(
        description="Pairs of views. neighbours: from each view to the view whose camera is "
        "nearest."
    )


class MeshFiles(Settings):
    """Meshes of the surface that cameras can see, and the boxes and poses of its objects."""

    formats: Annotated[list[Literal["glb", "ply"]], AfterValidator(unique_names)] = Field(
        ["glb", "ply"],
        description="Formats to write. glb: objects keep their names, and instances share a mesh. "
        "ply: all triangles together, in world coordinates.",
    )
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs whose datasets get the meshes. Without this key, all rigs.",
    )


class Report(Settings):
    """What the page of a dataset shows."""

    panorama: Auto | bool = Field(
        "auto",
        description="Whether the page shows a panorama from the rig's centre. auto: only if the "
        "cameras look outward in all directions. Otherwise, the page shows the view in the rig's "
        "middle.",
    )


class Credits(Settings):
    """What a package's card says about the scene, and what publishing needs in addition."""

    description: str | None = Field(None, description="Description of the scene, in one line.")
    licence: str | None = Field(
        None,
        description="Licence of the scene, for a package's card. It is also the licence of the "
        "data, unless publish has another.",
    )
    credit: str | None = Field(None, description="How to cite the artist of the scene.")
    publish: Publication | None = Field(
        None,
        description="What a repository of datasets needs to know. With this key, its metadata and "
        "shards are also written. Without it, a package is only an archive.",
    )

    @property
    def data_licence(self) -> str | None:
        """The short name of the data's licence: its own, or else the scene's."""
        if self.publish and self.publish.licence:
            return self.publish.licence
        is_short_name = self.licence and re.fullmatch(SPDX, self.licence)
        return self.licence if is_short_name else None

    @property
    def missing_texts(self) -> list[str]:
        """The keys without a value that a published dataset should have."""
        keys = [] if self.description else ["description"]
        if self.publish:
            keys += [f"publish.{key}" for key in self.publish.missing_keys]
        return keys

    @model_validator(mode="after")
    def _can_be_published(self) -> Self:
        if self.publish and self.data_licence is None:
            raise ValueError(
                "publish.licence: is missing; must be a short name from https://spdx.org/licenses, "
                "unless the scene's licence is one"
            )
        return self


class Scene(Credits):
    """One scene: where it comes from, how its rigs render it, and what is made of the views."""

    scene: SceneSource = Field(
        description="Where the scene comes from: a builder, a .blend, a model, or a dataset."
    )
    render: Render | None = Field(
        None,
        description="How Cycles renders the views. Required, but not allowed with scene.dataset.",
    )
    rigs: dict[Name, AnyRig] = Field(
        {},
        min_length=1,
        description="Camera setups, by the names of their folders. Leave it out with "
        "scene.dataset, which has its own cameras.",
    )
    reprojections: Annotated[dict[Name, ReprojectionEntry], AfterValidator(bracketed)] = Field(
        {},
        description="Versions of the views through other lenses or as other files, by the names of "
        "their folders.",
    )
    relight: dict[Name, Light] = Field(
        {},
        description="Versions of the views under other lights, as EXR, by the names of their "
        "folders. A light gives light groups a strength, or one each for red, green and blue. "
        "Other groups keep theirs. each: every group alone, one after the other.",
    )
    sensor: Sensor | None = Field(
        None,
        description="Versions of the views as a real sensor would record them, with noise, "
        "vignetting or exposure brackets.",
    )
    flow: Flow | None = Field(
        None,
        description="Optical flow between views, from depth and poses, for scenes that do not "
        "move.",
    )
    mesh: MeshFiles | None = Field(
        None,
        description="Meshes of the surface that cameras can see, and the bounding boxes of its "
        "objects.",
    )
    exports: Exports = Field(
        Exports(), description="Exports to the formats of trainers and other programs."
    )
    report: Report = Field(Report(), description="What the page of a dataset shows.")
    family: Family | None = Field(
        None, description="Many scenes that differ in seed, model or drawn values."
    )

    @model_validator(mode="before")
    @classmethod
    def _rigs_of_dataset(cls, content: Any) -> Any:
        match content:
            case {"scene": {"dataset": str(dataset)}}:
                for key in ("render", "rigs"):
                    if key in content:
                        raise ValueError(f"{key}: does not go with scene.dataset, which brings it")
                try:
                    return {**content, "rigs": published.rigs(dataset)}
                except UserError as error:
                    raise ValueError(f"scene.dataset: {error}") from None
        return content

    @model_validator(mode="before")
    @classmethod
    def _developed_lights(cls, content: Any) -> Any:
        """Add a reprojection for each entry of relight, which develops the views in that light."""
        match content:
            case {"relight": dict(lights)}:
                reprojections = content.get("reprojections", {})
                if not isinstance(reprojections, dict):
                    return content
                for name in lights:
                    if name in reprojections:
                        raise ValueError(f"relight.{name}: is the name of a reprojection, too")
                relit = {name: {"relight": name, "format": "exr"} for name in lights}
                return {**content, "reprojections": {**reprojections, **relit}}
        return content

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key in ("render", "rigs"):
            if not self.scene.dataset and not getattr(self, key):
                raise ValueError(f"is missing the key {key}")
        if self.scene.sha256 and not self.scene.url:
            raise ValueError(
                "scene.sha256: is only for a file with scene.url; leave it out, because the lock "
                "file beside the scene YAML records it"
            )
        for name, rig in self.rigs.items():
            _check_name(f"rigs.{name}", name, _RIG_NEIGHBOURS)
            self._check_rig(f"rigs.{name}", name, rig)
        if self.render and self.scene.blend is None:
            if self.render.samples == FILE:
                raise ValueError("render.samples: file is only for scene.blend")
            if self.render.depth_of_field:
                raise ValueError(
                    "render.depth_of_field: is only for scene.blend, whose camera it uses"
                )
        if self.mesh:
            self._check_mesh(self.mesh)
        for name, reprojection in self.reprojections.items():
            block = "relight" if name in self.relight else "reprojections"
            neighbours = _REPROJECTION_NEIGHBOURS
            if name.startswith(GROUP_PREFIX) or (block == "relight" and name == light_groups.EACH):
                neighbours = {name}
            _check_name(f"{block}.{name}", name, neighbours)
            self._check_reprojection(f"reprojections.{name}", reprojection)
        if self.sensor:
            self._check_sensor(self.sensor)
        for name, export in self.exports.selected.items():
            self._check_export(f"exports.{name}", export)
        if self.scene.blend is None:
            for key in self._keys_of_file_look:
                raise ValueError(f"{key}: file is only for scene.blend; give it a name such as AgX")
        for key in ("flow", "mesh"):
            if getattr(self, key) is not None and self.scene.followed_camera == "view":
                raise ValueError(
                    f"{key}: needs one scene for all views, but scene.followed_camera is view"
                )
        if self.flow and self.render and self.render.depth == "none":
            raise ValueError("flow: follows from depth, but render.depth is none")
        self._check_split_rigs()
        if self.family:
            self._check_family(self.family)
        return self

    def _check_family(self, family: Family) -> None:
        """Check that a job can build the members of a family one after the other."""
        if family.seeds and not self.scene.builder:
            raise ValueError("family.seeds: needs scene.builder")
        if self.render and self.render.target_error is not None:
            raise ValueError("render.target_error: does not go with family; give samples")
        for key in ("flow", "mesh"):
            if getattr(self, key) is not None:
                raise ValueError(f"{key}: does not go with family")
        for name, rig in self.rigs.items():
            if rig.sequence:
                raise ValueError(f"rigs.{name}.frames: does not go with family")

    @property
    def _keys_of_file_look(self) -> list[str]:
        """The keys that ask for the look of the .blend."""
        blocks: dict[str, Any] = {
            **{f"reprojections.{name}": entry for name, entry in self.reprojections.items()},
            **{f"exports.{name}": export for name, export in self.exports.selected.items()},
            "sensor": self.sensor,
        }
        return [f"{key}.look" for key, block in blocks.items() if _look_of(block) == FILE]

    @property
    def developments(self) -> dict[str, Reprojection]:
        """The reprojections, and those that ``sensor`` adds, by the names of their folders."""
        developments = {
            name: entry.resolved(self.light_of(entry)) for name, entry in self.reprojections.items()
        }
        for source in self.sensor.sources if self.sensor else ():
            developments |= self._sensor_reprojections(source)
        return developments

    def _sensor_reprojections(self, source: str) -> dict[str, Reprojection]:
        """Return the reprojections that ``sensor`` adds for a source, by their folders' names."""
        assert self.sensor
        original = self.reprojections.get(source) or ReprojectionEntry()
        optics = {name: getattr(original, name) for name in OPTICS}
        return {
            name: Reprojection.of(
                **optics,
                rigs=self.sensor.rigs or original.rigs,
                bits=8 if sensor.bits <= 8 else 16,
                formats=["png"],
                sensor=sensor,
                look=sensor.look,
                look_source=blender_looks.source_of(sensor.look),
            )
            for name, sensor in self.sensor.folders(source).items()
        }

    def _check_sensor(self, sensor: Sensor) -> None:
        """Check that the sensor's sources and rigs exist, and that it can develop them."""
        allowed_sources = [VIEWS, *self.reprojections]
        for source in sensor.sources:
            if source not in allowed_sources:
                raise ValueError(
                    f"sensor.sources: is {source!r}; must be of {', '.join(allowed_sources)}"
                )
            if sensor.sources.count(source) > 1:
                raise ValueError(f"sensor.sources: must name {source} once")
            original = self.reprojections.get(source)
            if original and original.relight is not None:
                raise ValueError(f"sensor.sources: {source} has relight; name one without")
            if original and original.cube_map and sensor.vignetting:
                raise ValueError(f"sensor.vignetting: does not go with the faces of {source}")
            for rig_name in sensor.rigs or ():
                if original and rig_name not in (original.rigs or self.rigs):
                    raise ValueError(
                        f"sensor.rigs: {rig_name} is not a rig of the reprojection {source}"
                    )
            for name in sensor.folders(source):
                if name in self.reprojections:
                    raise ValueError(f"reprojections.{name}: the name is taken by sensor")
        for rig_name in sensor.rigs or ():
            if rig_name not in self.rigs:
                raise ValueError(
                    f"sensor.rigs: there is no rig {rig_name!r}{suggestion(rig_name, self.rigs)}"
                )
        if self.render and self.render.transparent:
            raise ValueError("sensor: does not go with render.transparent")

    def _check_reprojection(self, key: str, reprojection: ReprojectionEntry) -> None:
        """Check that a reprojection's rigs and passes exist."""
        self._check_rig_names(f"{key}.rigs", reprojection.rigs or ())
        if reprojection.relight is not None:
            self._check_light(key, reprojection)
        for pass_name in reprojection.passes or ():
            if pass_name == LIGHT_GROUPS:
                if self.render is None or self.render.light_groups is None:
                    raise ValueError(f"{key}.passes: light_groups needs render.light_groups")
                continue
            if self.render is None or pass_name not in (self.render.passes or ()):
                raise ValueError(f"{key}.passes: {pass_name} is not in render.passes")
            if PASSES[pass_name].kind == "motion":
                raise ValueError(f"{key}.passes: motion is in pixels of the rendered lens")

    def _check_mesh(self, mesh: MeshFiles) -> None:
        if self.scene.dataset:
            raise ValueError("mesh: does not go with scene.dataset, which has no scene to read")
        self._check_rig_names("mesh.rigs", mesh.rigs or ())

    def _check_rig_names(self, key: str, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.rigs:
                hint = suggestion(name, self.rigs)
                raise ValueError(f"{key}: there is no rig {name!r}{hint}")

    def light_of(self, reprojection: ReprojectionEntry) -> Any:
        """Return the strengths of a reprojection's light, or `each`. None for unchanged light."""
        light = reprojection.relight
        return self.relight[light] if isinstance(light, str) and light in self.relight else light

    def _check_light(self, key: str, reprojection: ReprojectionEntry) -> None:
        """Check that the groups of a light exist, as far as the scene YAML names them."""
        light = self.light_of(reprojection)
        at = f"{key}.relight"
        if isinstance(reprojection.relight, str) and reprojection.relight in self.relight:
            at = f"relight.{reprojection.relight}"
        if self.render is None or self.render.light_groups is None:
            raise ValueError(f"{at}: needs render.light_groups, whose strengths it changes")
        if light == light_groups.EACH:
            if reprojection.passes:
                raise ValueError(f"{key}.passes: does not go with the light each")
            return
        if isinstance(light, str):
            hint = suggestion(light, self.relight)
            raise ValueError(f"{at}: there is no relight.{light}{hint}")
        names = light_groups.names_in(self.render.light_groups)
        if names is not None:
            try:
                light_groups.weights(light, [*names, light_groups.REST])
            except ValueError as error:
                raise ValueError(f"{at}: {error}") from None

    def _check_split_rigs(self) -> None:
        """Check the rigs of a split: trainers see them as one dataset."""
        split_rigs = {name: rig for name, rig in self.rigs.items() if rig.split in PARTS}
        if not split_rigs:
            return
        training = next((name for name, rig in split_rigs.items() if rig.split == "train"), None)
        if training is None:
            name = next(iter(split_rigs))
            raise ValueError(f"rigs.{name}.split: is {split_rigs[name].split}, but no rig trains")
        if not any(rig.split == "test" for rig in split_rigs.values()):
            raise ValueError(f"rigs.{training}.split: is train, but no rig tests")
        for name, rig in split_rigs.items():
            for key in ("camera", "frames"):
                if getattr(rig, key) != getattr(split_rigs[training], key):
                    raise ValueError(f"rigs.{name}.{key}: must be as in {training}, which trains")
        for name, reprojection in self.developments.items():
            key = f"reprojections.{name}" if name in self.reprojections else "sensor"
            self._check_whole_split(f"{key}.rigs", split_rigs.keys(), reprojection.rigs)
        for name, export in self.exports.selected.items():
            if export.joins_split:
                self._check_whole_split(f"exports.{name}.rigs", split_rigs.keys(), export.rigs)

    def _check_whole_split(
        self, key: str, split_rigs: Set[str], chosen_rigs: list[str] | None
    ) -> None:
        """Check that the chosen rigs, or all without a choice, have a whole split or none of it."""
        missing_rigs = split_rigs - set(chosen_rigs or self.rigs)
        if missing_rigs and missing_rigs != split_rigs:
            rigs = ", ".join(sorted(missing_rigs))
            raise ValueError(
                f"{key}: lacks {rigs}; must have all rigs of the split, the one that trains and "
                "the ones that test, or none"
            )

    def _check_export(self, export_key: str, export: Export) -> None:
        """Check that an export's rigs and sources exist, and that its consumer can take them."""
        self._check_rig_names(f"{export_key}.rigs", export.rigs or ())
        key = f"{export_key}.sources"
        developments = self.developments
        allowed_sources = [VIEWS, *developments]
        if _look_of(export) and not any(
            source == VIEWS or "exr" in developments[source].formats
            for source in export.sources
            if source in allowed_sources
        ):
            source = export.sources[0]
            of_look = f"the reprojection {source}" if source in self.reprojections else "sensor"
            raise ValueError(f"{export_key}.look: is for EXR sources; give look to {of_look}")
        for source in export.sources:
            if source not in allowed_sources:
                raise ValueError(f"{key}: is {source!r}; must be of {', '.join(allowed_sources)}")
            reprojection = None if source == VIEWS else developments[source]
            if reprojection and reprojection.relight == light_groups.EACH:
                raise ValueError(
                    f"{key}: {source} holds one image per light; an export needs one image per view"
                )
            self._check_passes_of(key, source, export)
            motion = self.render and self.render.camera_motion
            is_resampled = reprojection is not None and reprojection.camera is not None
            if export.has_row_times and is_resampled and motion and motion.rolling not in (None, 1):
                raise ValueError(
                    f"{key}: {source} mixes the rows of a rolling shutter, whose times the export "
                    f"has; export {VIEWS}"
                )
            self._check_exported_rigs(export_key, export, source)

    def _check_exported_rigs(self, export_key: str, export: Export, source: str) -> None:
        """Check that an export's consumer can take the views of each chosen rig of a source."""
        reprojection = self.developments.get(source)
        rigs_of_source = (reprojection and reprojection.rigs) or [*self.rigs]
        for name in export.rigs or ():
            if name not in rigs_of_source:
                raise ValueError(
                    f"{export_key}.rigs: {name} is not a rig of the reprojection {source}"
                )
        refusals = {
            name: self._export_refusal(export, self.rigs[name], source)
            for name in export.rigs or rigs_of_source
        }
        accepted = ", ".join(name for name, refusal in refusals.items() if not refusal)
        for name, refusal in refusals.items():
            if refusal:
                hint = f"; or export without it: rigs: [{accepted}]" if accepted else ""
                raise ValueError(f"{export_key}.sources: {source}: the rig {name} {refusal}{hint}")

    def _export_refusal(self, export: Export, rig: Rig, source: str) -> str | None:
        """Return why an export's consumer cannot take a rig's views, and what to do. Or None."""
        if rig.is_omnidirectional:
            return "has views without a centre, as omnidirectional stereo has"
        reprojection = self.developments.get(source)
        camera = (reprojection and reprojection.camera) or rig.camera
        renders_depth = self._renders_depth(rig)
        has_depth = renders_depth and (reprojection is None or reprojection.has_depth)
        lacks_surfaces = export.needs_surfaces and not renders_depth
        refusal = export.rig_refusal(rig) or (NO_DEPTH if lacks_surfaces else None)
        refusal = refusal or export.refusal(camera.make(), has_depth)
        if refusal not in (NO_DEPTH, NOT_EXR):
            return refusal
        if not renders_depth:
            return f"{NO_DEPTH}; {self._depth_remedy}"
        if source not in self.reprojections:
            return f"{refusal}; export the sensor's source"
        return f"{refusal}; give reprojections.{source} format: exr"

    def _renders_depth(self, rig: Rig) -> bool:
        """Return whether the views of a rig hold depth, before any reprojection."""
        if self.render:
            return self.render.depth != "none"
        return not isinstance(rig, Poses) or published.render(rig).depth != "none"

    @property
    def _depth_remedy(self) -> str:
        if self.render:
            return "leave out render.depth: none"
        return "its lightfield.json says so; leave out the export"

    def _check_passes_of(self, key: str, source: str, export: Export) -> None:
        """Check that the views of a source have the passes that an export needs."""
        passes = self.render and self.render.passes
        place = "render.passes"
        if source != VIEWS:
            passes = self.developments[source].passes
            place = f"reprojections.{source}.passes"
        for pass_name in export.needed_passes if self.render else ():
            if pass_name not in (passes or ()):
                is_of_sensor = source != VIEWS and source not in self.reprojections
                remedy = "export the sensor's source" if is_of_sensor else f"add it to {place}"
                raise ValueError(f"{key}: {source} lacks the pass {pass_name}; {remedy}")

    def _check_rig(self, key: str, name: str, rig: Rig) -> None:
        """Check a rig with its camera, its file and the depth."""
        camera = rig.camera
        if camera is None:
            raise ValueError(f"{key}: is missing the key camera")
        if isinstance(rig, Poses) and not Path(rig.file).is_file():
            raise ValueError(f"{key}.file: is {rig.file!r}; there is no such file")
        if self.scene.blend is None and isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.type: blend_camera needs scene.blend")
        if camera.lens == FILE and not isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.camera.lens: file is only for a rig of type blend_camera")
        frames = len(rig.sequence.numbers) if rig.sequence else 1
        if frames > MOST_FRAMES or frames * rig.view_count > MOST_VIEWS:
            raise ValueError(
                f"{key}: has {frames} frames of {rig.view_count} views; must be at most "
                f"{MOST_FRAMES} frames and {MOST_VIEWS} views in all"
            )
        if rig.view_count > MOST_VIEWS_OF_RIG:
            raise ValueError(
                f"{key}: has {rig.view_count:,} views; must be at most {MOST_VIEWS_OF_RIG:,}"
            )
        for view in _unknown_names(rig):
            raise ValueError(f"{key}.split: there is no view {view!r}")
        lens = camera.make()
        if self.render and not lens.in_cycles:
            lenses = ", ".join(name for name, lens in LENSES.items() if lens.in_cycles)
            raise ValueError(
                f"{key}.camera.lens: is {camera.lens!r}, which Cycles does not have; "
                f"must be one of {lenses} (reproject for the others)"
            )
        if self.render:
            _check_blender_limits(f"{key}.camera", camera)
        if self.render and isinstance(lens, Rectilinear) and not lens.has_square_pixels:
            raise ValueError(
                f"{key}.camera.sensor_size: is {list(lens.sensor)}, but the pixels of Cycles' "
                f"perspective views are square; must be its width alone, {lens.sensor[0]:g}"
            )
        if self.render and self.render.depth == "z" and not lens.has_z_depth:
            raise ValueError(
                f"render.depth: is 'z', but {key}.camera sees beyond 180 degrees; "
                "must be auto, distance or none"
            )
        _check_cube_map(key, rig)
        if rig.cube_map and self.render and self.render.camera_motion:
            raise ValueError(
                f"render.camera_motion: does not go with {key}.cube_map, whose faces would each "
                "move along axes of their own; render panoramas, and reproject with cube_map"
            )
        if rig.is_omnidirectional:
            self._check_without_centre(key, name)
        if self.flow and rig.is_at_one_place():
            raise ValueError(f"flow: {FLOW_PLACES}, but all views of {key} are from one")

    def _check_without_centre(self, key: str, name: str) -> None:
        """Check that nothing needs a centre of a rig's views, which have none."""
        if self.rigs[name].camera.lens != "equirectangular":
            raise ValueError(f"{key}.stereo.omnidirectional: needs the lens equirectangular")
        refusal = f"does not go with {key}.stereo.omnidirectional, whose views have no centre"
        if self.render and self.render.camera_motion:
            raise ValueError(f"render.camera_motion: {refusal}")
        if self.flow:
            raise ValueError(f"flow: {refusal}")
        if self.render and "motion" in (self.render.passes or ()):
            raise ValueError(f"render.passes: motion {refusal}")
        for reprojection_name, reprojection in self.reprojections.items():
            if reprojection.camera and name in (reprojection.rigs or self.rigs):
                raise ValueError(f"reprojections.{reprojection_name}: {refusal}")


def small_image(resolution: Sequence[int]) -> str | None:
    """Return what is wrong with an image that is smaller than Blender's smallest. Or None."""
    if min(resolution) >= SMALLEST_IMAGE:
        return None
    least = f"{SMALLEST_IMAGE} × {SMALLEST_IMAGE}"
    return f"is {[*resolution]}; must be at least {least} pixels, the smallest image of Blender"


def _look_of(block: Any) -> str | None:
    """Return the look of a reprojection, of an export or of the sensor, if it has one."""
    return getattr(block, "look", None)


def _check_blender_limits(key: str, settings: CameraSettings) -> None:
    """Refuse a value outside Blender's limits, which Blender would clamp."""
    if problem := small_image(settings.resolution):
        raise ValueError(f"{key}.resolution: {problem}")
    lens = settings.make()
    camera = lens.to_lightfield()["camera"]
    fov = getattr(settings, "fov", None)
    if isinstance(lens, Rectilinear) and lens.focal_length < 1 and fov:
        widest = math.degrees(2 * math.atan(lens.sensor[0] / 2))
        raise ValueError(f"{key}.fov: is {fov:g}; must be at most {widest:.4g} in Blender")
    for name, (least, most, unit, title) in _BLENDER_LIMITS.items():
        value = camera.get(name, least)
        if not least <= value <= most:
            bound = f"at least {least / unit:.4g}" if value < least else f"at most {most / unit:g}"
            raise ValueError(
                f"{key}: its {title} is {value / unit:.4g}; must be {bound} in Blender"
            )
    if max(lens.sensor) < 1:
        raise ValueError(
            f"{key}.sensor_size: is {lens.sensor[0]:g}; must be at least 1 mm in Blender"
        )


def _check_cube_map(key: str, rig: Rig) -> None:
    """Check that the camera of a rig with cube maps can be a face's camera."""
    if rig.cube_map and (problem := face_problem(rig.camera)):
        raise ValueError(f"{key}.camera{problem}")


def _check_name(key: str, name: str, neighbours: set[str]) -> None:
    if name in neighbours or _OTHER_NEIGHBOURS.fullmatch(name):
        raise ValueError(f"{key}: the name {name} is taken; choose another")


def _unknown_names(rig: Rig) -> list[str]:
    """Return the names in a rig's split that no view has."""
    if not isinstance(rig.split, Chosen) or not rig.split.names:
        return []
    # The .blend names the views of its camera. It has not been read yet.
    if isinstance(rig, BlendCamera):
        return []
    return sorted({*rig.split.names} - {pose.name for pose in rig.poses()})


_SCENE = TypeAdapter(Scene)


def load_scene(scene: str) -> Scene:
    """Read and check one scene YAML. Raises `UserError` with file, key, value and what is right."""
    path = scene_path(scene)
    if not path.is_file():
        files = {*SCENES.glob("*.yaml"), *OWN_SCENES.glob("*.yaml")}
        scenes = sorted({file.stem for file in files})
        similar = " or ".join(difflib.get_close_matches(scene, scenes))
        hint = f"is {similar} meant?" if similar else f"there are {', '.join(scenes)}"
        raise UserError(f"config.yaml: scenes: there is no scene {scene!r}; {hint}")
    return read_scene(path)


def scene_path(scene: str) -> Path:
    """Return the path of a scene's YAML: the user's own, or else the repository's."""
    own_file = OWN_SCENES / f"{scene}.yaml"
    is_in_repository = OWN_SCENES.resolve() == ROOT / OWN_SCENES
    if own_file.is_file() and not is_in_repository:
        return own_file
    return SCENES / f"{scene}.yaml"


def family_of(scene: str) -> Family | None:
    """Return the block `family` of a scene YAML, if it has one. Raises `UserError`."""
    return load_scene(scene).family


def scene_content(scene: str) -> Any:
    """Return the content of a scene YAML as it is written. Raises `UserError`."""
    return read_yaml(scene_path(scene), f"{OWN_SCENES}/{scene}.yaml")


def check_member(content: Any, name: str) -> Scene:
    """Return the content of a member's scene YAML as settings. Errors begin with ``name``."""
    return checked(_SCENE, content, name)


def read_scene(path: Path) -> Scene:
    """Read and check the scene YAML at ``path``, as `load_scene` does by name."""
    file = _shown(path)
    return check_scene(read_settings_text(path, file), file)


def check_scene(text: str, file: str) -> Scene:
    """Return a scene YAML's text as settings. Raises `UserError`, which calls the YAML ``file``."""
    return _checked_scene(text, file, Path.cwd())


def mistake(scene: str, problem: str) -> UserError:
    """Return the error for a mistake in a scene YAML, with the line of the problem's key."""
    path = scene_path(scene)
    file = _shown(path)
    return UserError(_located_in_family(problem, read_settings_text(path, file), file))


def _shown(path: Path) -> str:
    """Return the path of a scene YAML for messages."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


# The rules ask for the same scenes many times.
@lru_cache(maxsize=100)
def _checked_scene(text: str, file: str, _folder: Path) -> Scene:
    """Return a scene YAML's text as settings. Its relative paths start from ``_folder``."""
    content = parse_yaml(text, file)
    is_family = False
    if isinstance(content, dict) and "family" in content:
        # The check below reports a block `family` that is wrong itself.
        with suppress(ValidationError, TypeError):
            content = stand_in(content)
            is_family = True
    locate = _located_in_family if is_family else located
    return checked_yaml(_SCENE, content, lambda problem: locate(problem, text, file))


def _located_in_family(problem: str, text: str, file: str) -> str:
    """Return `located`. The line of a value that a family draws is in family.values."""
    depth, line = find_key(f"family.values.{problem}", text)
    return f"{file}:{line}: {problem}" if depth > 2 else located(problem, text, file)
