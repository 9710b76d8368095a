"""The work of one run of scripts/reproject.py: its files, its views, and their keys."""

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.configuration.reprojections import LIGHT_GROUPS
from lightfield.core.cli import view_slice
from lightfield.core.errors import UserError
from lightfield.formats import light_groups, lightfield, passes
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import Pass
from lightfield.formats.sensors import sensor_files
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.rotations import matrix_to_euler
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.images import Attribute, check_codec, write_exr
from lightfield.imaging.look import Look
from lightfield.imaging.primaries import Chromaticities
from lightfield.imaging.sensor import SensorParameters
from lightfield.reprojection import lens_map
from lightfield.reprojection.geometry import ReprojectionGeometry, Target
from lightfield.reprojection.lens_map import LensMap
from lightfield.reprojection.sensor import parameters_of
from lightfield.stages.lenses import Reproject

SUFFIXES = (".exr", ".png", ".jpg", ".jpeg")

# The effort of zip. OpenEXR's default, 4, takes a third longer. Its files are 0 to 5 % smaller.
_LEVEL = 1


@dataclass(frozen=True)
class SourceView:
    """One image to reproject: its output name and the file, or a cube map's six."""

    name: str
    paths: tuple[Path, ...]


@dataclass(frozen=True)
class Light:
    """The light of a view's images, whose names end with ``suffix``.

    ``weights`` are the factors of red, green and blue of each light group. None leaves the view's
    colour as it is. ``group`` is the only group that shines, if there is one by its name.
    """

    suffix: str = ""
    weights: Mapping[str, Sequence[float]] | None = None
    group: str | None = None


class ReprojectionJob:
    """The settings that all views of a run share. Errors name the wrong flag or key."""

    def __init__(self, stage: Reproject) -> None:
        self.stage = stage
        settings = stage.settings
        if not settings.formats:
            raise UserError("--settings: formats: must be a list of exr, png, or both")
        self.settings = settings
        if settings.compression:
            check_codec("compression", settings.compression)
        self.lightfield, self.source = stage.read()
        self.geometry = ReprojectionGeometry.of(settings, self.source)
        self.targets = self.geometry.targets
        if stage.no_configs and stage.output_cfg:
            raise UserError("--output-cfg: needs --input-cfg, which --no-configs excludes")
        if not self.copies:
            self.lightfield.require_centre()
        if settings.sensor and self.lightfield.transparent:
            raise UserError("sensor: does not go with transparent views")
        self.look = self._chosen_look()
        self.passes = self._chosen_passes()
        self.lights = self._chosen_lights()
        # For each 16-bit depth map, the number of depths that no step of it can hold.
        self.lost_depths: list[int] = []

    def _chosen_look(self) -> Look | None:
        """Return the look of the images, if they get one.

        Raises `UserError` for images that have one already: they are no light.
        """
        if self.lightfield.has_look:
            raise UserError(
                f"{self.stage.input_cfg}: reprojection.look: its images are no light any more; "
                "reproject the views from which they were made"
            )
        settings = self.settings
        chosen = Look.of(settings.look, settings.exposure, self.lightfield.content.get(FILE_LOOK))
        # A sensor has an exposure of its own.
        return replace(chosen, exposure=0.0) if chosen and settings.sensor else chosen

    @cached_property
    def published(self) -> dict[str, Any]:
        """The settings in lightfield.json and the images' headers, beside the lens."""
        return self.settings.published(self.look)

    def _chosen_passes(self) -> list[Pass]:
        """Return the passes to reproject. Raises `UserError` for a pass that the views lack."""
        available = [each.name for each in self.lightfield.passes if each.kind != "motion"]
        names: list[str] = []
        for name in self.settings.passes:
            groups = self.lightfield.light_groups if name == LIGHT_GROUPS else []
            names += map(passes.group_pass, groups) if groups else [name]
        for name in names:
            if name not in available:
                allowed = ", ".join(available) or "no passes to reproject"
                raise UserError(f"passes: is {name}; {self.stage.input_cfg} has {allowed}")
        return [passes.by_name(name) for name in names]

    def _chosen_lights(self) -> list[Light]:
        """Return the lights of the images. Raises `UserError` for a group that the views lack."""
        light = self.settings.relight
        groups = self.lightfield.light_groups
        if light is None:
            return [Light()]
        if not groups:
            raise UserError(
                f"relight: {self.stage.input_cfg} has no light groups; "
                "render.light_groups makes them"
            )
        if isinstance(light, str):
            return [Light(f"_{group}", {group: [1.0] * 3}, group) for group in groups]
        try:
            return [Light("", light_groups.weights(light, groups))]
        except ValueError as error:
            raise UserError(f"relight: {error}") from None

    @cached_property
    def copies(self) -> bool:
        """Whether the target is the source itself, so that nothing is resampled."""
        target = self.targets[0]
        return target.lens == self.source and np.array_equal(target.source_from_target, np.eye(3))

    @cached_property
    def maps(self) -> list[LensMap]:
        """The lens map of each target, from --lens-map or computed."""
        return [self._map(target) for target in self.targets]

    def _map(self, target: Target) -> LensMap:
        path = self.stage.lens_map
        if path is None:
            return self.geometry.compute(target)
        path = path.with_name(path.stem + target.suffix + path.suffix)
        loaded = lens_map.load(path)
        for key, value in self.geometry.map_settings(target).items():
            if loaded.settings[key] != value:
                raise UserError(
                    f"{path}: is a lens map for {key} {json.dumps(loaded.settings[key])}, "
                    f"and this is {json.dumps(value)}; compute it anew with lens_map.py"
                )
        return loaded

    @property
    def needs_depth(self) -> bool:
        """Whether an output holds depth. The images of single light groups hold none."""
        if self.lights[0].group:
            return False
        return "exr" in self.settings.formats or self.settings.depth_png is not None

    @property
    def depth_precision(self) -> str:
        """The precision of the source's float depth, by its lightfield.json."""
        return self.lightfield.known_render.depth_precision

    @cached_property
    def _numbers(self) -> dict[str, int]:
        """The positions of the views in lightfield.json, by their names."""
        return {view.name: number for number, view in enumerate(self.lightfield.views)}

    def sensor_parameters(self, view: SourceView, target: Target) -> SensorParameters | None:
        """Return the parameters of the sensor for a view's image. None without a sensor."""
        if self.settings.sensor is None:
            return None
        number = self._numbers.get(view.name, 0)
        frame = self.lightfield.content.get("frame", 0)
        return parameters_of(self.settings.sensor, number, view.name, target.suffix, frame)

    def key(self, view: SourceView, target: Target, light: Light, identity: str) -> str:
        """Return the SHA-256 of everything that the pixels of a view's image depend on.

        ``identity`` stands for the source's content.
        """
        content = {
            "version": Reproject.version,
            "map": self.geometry.map_settings(target),
            **self.settings.development(self.look),
            "depth_png": self.settings.depth_png,
            "depth": self.lightfield.content.get("depth"),
            "source": identity,
        }
        # Defaults are left out, so that the keys of earlier versions stay valid.
        if self.lightfield.transparent:
            content["transparent"] = True
        if self.settings.compression:
            content["compression"] = self.settings.compression
        if light.weights is not None:
            content["light"] = light.weights
        if any(map(passes.is_group, self.passes)):
            content["light_groups"] = "add up to the colour"
        if parameters := self.sensor_parameters(view, target):
            content["sensor"] = parameters.to_json()
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def write_exr(
        self,
        path: Path,
        channels: Mapping[str, Array],
        attributes: Mapping[str, Attribute],
        chromaticities: Chromaticities | None = None,
    ) -> None:
        """Write (H, W) arrays as an EXR, with the compression of the settings."""
        compression = self.settings.compression or "zip"
        write_exr(path, channels, attributes, compression, chromaticities, _LEVEL)

    def outputs(self, view: SourceView, target: Target, light: Light) -> dict[str, Path]:
        """Return the files of a view's image, by kind."""
        name = view.name + light.suffix + target.suffix
        files: dict[str, str] = {kind: f"{name}.{kind}" for kind in self.settings.formats}
        if self.settings.depth_png is not None:
            files["depth"] = f"{name}_depth.png"
        if self.settings.mask:
            files["mask"] = f"dynamic_mask_{name}.png"
        if self.settings.sensor:
            files |= sensor_files(self.settings.sensor, name)
        folder = self.stage.output_dir
        return {kind: folder / file for kind, file in files.items()}

    def pass_outputs(self, view: SourceView, target: Target) -> dict[Pass, Path]:
        """Return the files of a view's passes."""
        folder = self.stage.output_dir
        return {each: each.path(folder, view.name + target.suffix) for each in self.passes}

    def files(self, view: SourceView, target: Target, light: Light) -> list[Path]:
        """Return all files that a target makes of a view in one of the lights."""
        images = self.outputs(view, target, light)
        return [*images.values(), *self.pass_outputs(view, target).values()]

    def sources(self, view: SourceView) -> list[Path]:
        """Return the files from which a view is made: its images, and the files of its passes."""
        folder = self.lightfield.folder
        read = [each.path(folder, view.name) for each in self.passes]
        for light in self.lights:
            read += [self.group_path(view, group) for group in light.weights or ()]
        return list(dict.fromkeys([*view.paths, *read]))

    def group_path(self, view: SourceView, group: str) -> Path:
        """Return the file of a light group of a view."""
        return passes.of_group(group).path(self.lightfield.folder, view.name)

    def output_lightfield(self) -> LightField:
        """Return the input's lightfield.json with the lens, depth and poses of the new images."""
        lens = self.targets[0].lens
        depth = lens.usual_depth if self.needs_depth and self.lightfield.depth else None
        views = [
            _turned(view, target, light)
            for view in self.lightfield.views
            if self._passes(view.name, ".exr")
            for light in self.lights
            for target in self.targets
        ]
        changes: dict[str, Any] = {"reprojection": self.published}
        if self.lightfield.passes:
            changes["passes"] = [each.name for each in self.passes]
        if head := self.lightfield.head:
            changes[lightfield.HEAD] = self._turned_head(head)
        return self.lightfield.changed(lens, views, depth=depth, **changes)

    def _turned_head(self, head: lightfield.HeadCamera) -> dict[str, Any]:
        """Return the place of the new images' camera in its head.

        The faces of a cube map are several cameras, so they have no place.
        """
        if len(self.targets) > 1:
            return {"name": head.head, "camera": head.name}
        (target,) = self.targets
        turned = _world_from_target(head.body_from_camera, target)
        return replace(head, body_from_camera=turned).to_json()

    def views(self) -> list[SourceView]:
        """Return the chosen views, in the order of their names or frames."""
        stage = self.stage
        if stage.single:
            if isinstance(self.source, CubeMap):
                raise UserError(
                    "--single: is one face of a cube map; give --input-dir, for all six"
                )
            return [SourceView(stage.single.stem, (stage.single,))]
        folder = stage.input_dir
        if folder is None:
            raise UserError("--input-dir: is missing; or give --single")
        if not folder.is_dir():
            raise UserError(f"--input-dir {folder}: no such folder")
        if stage.views:
            names = [view.name for view in self.lightfield.views]
            names = names[view_slice(stage.views, len(names))]
            views = [SourceView(name, _find(folder, name, self.source)) for name in names]
        else:
            views = self._views_in(folder)
        views = [view for view in views if self._passes(view.name, view.paths[0].suffix)]
        for first, second in itertools.pairwise(sorted(views, key=lambda view: view.name)):
            if first.name == second.name:
                raise UserError(
                    f"{first.paths[0]} and {second.paths[0]}: would have one output; "
                    "choose with --filter-suffix"
                )
        if not views:
            raise UserError(f"--input-dir {folder}: no image passes the filters")
        return views

    def _views_in(self, folder: Path) -> list[SourceView]:
        paths = sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()
        )
        if isinstance(self.source, CubeMap):
            stems = [path.stem[:-2] for path in paths if path.stem.endswith("_f")]
            return [SourceView(stem, _find(folder, stem, self.source)) for stem in stems]
        return [SourceView(path.stem, (path,)) for path in paths]

    def _passes(self, name: str, suffix: str) -> bool:
        """Return whether a name passes the filters, with or without its ``suffix``."""
        end = self.stage.filter_suffix
        return name.startswith(self.stage.filter_prefix) and (
            name.endswith(end) or (name + suffix).endswith(end)
        )


def _find(folder: Path, name: str, lens: Lens) -> tuple[Path, ...]:
    """Return the files of a view: one image, or the six faces of a cube map."""
    if isinstance(lens, CubeMap):
        return tuple(_find_image(folder, f"{name}_{face}") for face in CUBE_FACES)
    return (_find_image(folder, name),)


def _find_image(folder: Path, name: str) -> Path:
    """Return the image of this name. A missing image gets the first of `SUFFIXES`."""
    candidates = [folder / f"{name}{suffix}" for suffix in SUFFIXES]
    return next((path for path in candidates if path.is_file()), candidates[0])


def _turned(view: lightfield.View, target: Target, light: Light) -> lightfield.View:
    """Return the view of a target's camera in one of the lights."""
    name = view.name + light.suffix + target.suffix
    # Flow is in pixels of the source's lens.
    others = {k: v for k, v in view.others.items() if k != "flow"}
    if light.group:
        others["light"] = light.group
    view = replace(view, others=others)
    if np.array_equal(target.source_from_target, np.eye(3)):
        return replace(view, name=name)
    world_from_camera = _world_from_target(view.world_from_camera, target)
    if view.exposure:
        start, end = (_world_from_target(pose, target).tolist() for pose in view.exposure)
        exposure = {lightfield.EXPOSURE: {"start": start, "end": end}}
        view = replace(view, others={**view.others, **exposure})
    return replace(
        view,
        name=name,
        world_from_camera=world_from_camera,
        rotation=matrix_to_euler(world_from_camera[:3, :3]),
    )


def _world_from_target(world_from_camera: Array, target: Target) -> Array:
    """Return the camera-to-world matrix (4, 4) of a target's camera."""
    world_from_target = world_from_camera.copy()
    world_from_target[:3, :3] = world_from_camera[:3, :3] @ target.source_from_target
    return world_from_target
