"""The settings files of all jobs: what the plan writes, and the programs read with --settings.

The record of a job in `lightfield.workflow.jobs` names the function of this module that returns its
settings, by what the job works on: a scene, a dataset, a reprojection, or something else with
wildcards of its own. The jobs of a family's members have the same settings, but no files of them.
"""

import os
import re
import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from lightfield.configuration import keys
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.config_file import Preset
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.reprojections import Reprojection
from lightfield.configuration.scene_source import SceneSource
from lightfield.configuration.scene_yaml import load_scene, scene_content, scene_path
from lightfield.configuration.shown_look import shown_look
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.names import MESH, ROOT, SOFTBOXES, VIDEO, VIEWS
from lightfield.exporters import export_settings_of
from lightfield.exporters.base import Export, ExportSettings
from lightfield.geometry import rigs
from lightfield.geometry.rigs import Poses
from lightfield.imaging import blender_looks
from lightfield.planning.loading import datasets_of, rendered_frames
from lightfield.settings.base import ReaderSettings, Settings
from lightfield.stages.checks import SequenceValidationSettings, ValidationSettings
from lightfield.stages.exports import MeshSettings
from lightfield.stages.family import BatchSettings, CorpusSettings, CountSettings
from lightfield.stages.measurement import (
    CostSettings,
    FullSize,
    GpuCheckSettings,
    SynthesisSettings,
)
from lightfield.stages.publishing import PackSettings
from lightfield.stages.report import (
    FiguresSettings,
    MeasurementFile,
    PageSettings,
    SequenceSettings,
    VideoSettings,
)
from lightfield.stages.rig import FreePlacesSettings
from lightfield.stages.scene import (
    BuildSettings,
    CheckBlendSettings,
    ImportSettings,
    InventorySettings,
)
from lightfield.workflow.build import Build, Wildcards, full_datasets, source_of

Content = dict[str, Any]


class SettingsFile(NamedTuple):
    """The settings file of a job: its path and its content."""

    path: str
    content: Content


SettingsOf = Callable[[Build, Wildcards], SettingsFile]
"""Returns the settings file of a job. Raises `UserError` for a job that no scene YAML asks for."""


def of_scene(name: str, settings_of: Callable[[Dataset], Settings]) -> SettingsOf:
    """Return the settings file ``name`` of a scene's job, by any dataset of the scene."""

    def settings_file(build: Build, wildcards: Wildcards) -> SettingsFile:
        dataset = build.scene(wildcards)
        path = f"{dataset.paths.scene_work}/settings/{name}.json"
        return SettingsFile(path, settings_of(dataset).as_json())

    return settings_file


def of_dataset(name: str, settings_of: Callable[[Dataset], Settings]) -> SettingsOf:
    """Return the settings file ``name`` of a dataset's job."""
    return of_dataset_in(name, lambda build, dataset: settings_of(dataset))


def of_dataset_in(name: str, settings_of: Callable[[Build, Dataset], Settings]) -> SettingsOf:
    """Return the settings file ``name`` of a dataset's job, which depends on the build, too."""

    def settings_file(build: Build, wildcards: Wildcards) -> SettingsFile:
        dataset = build.dataset(wildcards)
        return SettingsFile(dataset.paths.settings(name), settings_of(build, dataset).as_json())

    return settings_file


def of_reprojection(name: str, content_of: Callable[[Reprojection], Content]) -> SettingsOf:
    """Return the settings file ``name`` of a reprojection's job."""

    def settings_file(build: Build, wildcards: Wildcards) -> SettingsFile:
        dataset = build.dataset(wildcards)
        reprojection = build.reprojection(wildcards)
        assert reprojection
        path = dataset.paths.settings(f"{wildcards['reprojection']}/{name}")
        return SettingsFile(path, content_of(reprojection))

    return settings_file


def of_others(named_settings: Callable[[Build, Wildcards], tuple[str, Settings]]) -> SettingsOf:
    """Return the settings file of a job with wildcards of its own, by its name and its settings."""

    def settings_file(build: Build, wildcards: Wildcards) -> SettingsFile:
        name, settings = named_settings(build, wildcards)
        keys_of_folder = [key for key in ("scene", "rig", "family") if key in wildcards]
        folder = "/".join(wildcards[key] for key in keys_of_folder)
        path = os.path.normpath(f"{build.config.work}/{folder}/settings/{name}.json")
        return SettingsFile(path, settings.as_json())

    return settings_file


# Of a scene.


def build_scene(dataset: Dataset) -> BuildSettings:
    """Return the settings that build a dataset's scene."""
    source = dataset.source
    if source.builder is None:
        raise UserError(f"{dataset.paths.built_blend}: the scene YAML has no builder that makes it")
    return BuildSettings(
        builder=source.builder, parameters=source.parameters, fingerprint=dataset.fingerprint
    )


def import_model(dataset: Dataset) -> ImportSettings:
    source = dataset.written.scene
    if source.model is None:
        raise UserError(f"{dataset.paths.model_blend}: the scene YAML has no model that makes it")
    return ImportSettings.of_source(source)


def check_blend(dataset: Dataset) -> CheckBlendSettings:
    return CheckBlendSettings.of(sha256=dataset.written.scene.sha256, bpy=version("bpy"))


def inventory(dataset: Dataset) -> InventorySettings:
    """Return what an inventory depends on in the scene YAML: the same for all presets."""
    written = dataset.written
    datasets = datasets_of(dataset.scene_name, written, "full", Preset(), {})
    source = written.scene
    assert written.render
    # Like the program, leave out rigs without frames.
    camera_frames = [frame for each in datasets for frame in each.camera_frames]
    return InventorySettings.of(
        scene_name=source.scene_name,
        view_layers=source.view_layers,
        targets=source.targets,
        allow_missing=source.allow_missing,
        motion_blur=written.render.motion_blur,
        rendered_frames=rendered_frames(datasets),
        camera_frames=camera_frames,
        # Raise this number when the program takes or refuses other cameras.
        camera_version=1 if camera_frames else None,
        # Raise this number when the program reads more of the .blend's look, or refuses others.
        look_version=1 if any(each.uses_file_look for each in datasets) else None,
        followed_camera=source.followed_camera,
        light_groups=written.render.light_groups or None,
        measures_box=any(each.rig.is_fitted for each in datasets) or None,
    )


# Of a dataset.


def free_places(dataset: Dataset) -> FreePlacesSettings:
    """Return the settings that place the cameras of a random rig."""
    if not dataset.places:
        raise UserError(
            f"{dataset.paths.places}: is for rigs of type random; "
            f"{dataset.rig_name} has type {dataset.rig.type}"
        )
    source = dataset.source
    return FreePlacesSettings.of(
        rig=dataset.rig,
        frame=source.frame,
        scene_name=source.scene_name,
        view_layers=source.view_layers,
        targets=source.targets,
    )


def lightfield(dataset: Dataset) -> LightfieldSettings:
    """Return the settings of a dataset's lightfield.json."""
    file = dataset.rig.file if isinstance(dataset.rig, Poses) else None
    settings = LightfieldSettings.of_capture(
        dataset,
        flow=bool(dataset.flow),
        file_look=dataset.uses_file_look,
        fingerprint=dataset.builder_fingerprint,
        poses_sha256=sha256(file) if file else None,
    )
    if dataset.member is None:
        return settings
    return settings.model_copy(update={"scene": f"{dataset.scene_name}/{dataset.member}"})


def panorama(dataset: Dataset) -> LightfieldSettings:
    return LightfieldSettings.of_capture(
        dataset,
        panorama_width=dataset.panorama_width,
        fingerprint=dataset.builder_fingerprint,
    )


def mesh(dataset: Dataset) -> MeshSettings:
    if not dataset.mesh:
        raise UserError(f"{dataset.paths.folder}/{MESH}: the scene YAML asks for no mesh of it")
    source = dataset.source
    return MeshSettings.of(
        formats=dataset.mesh.formats,
        frame=source.frame,
        scene_name=source.scene_name,
        view_layers=source.view_layers,
        targets=source.targets,
        numbered=not {"object", "instance"}.isdisjoint(dataset.render.passes or ()),
    )


def video(dataset: Dataset) -> VideoSettings:
    if not dataset.video:
        raise UserError(f"{dataset.paths.folder}/{VIDEO}: the scene YAML asks for no video of it")
    return VideoSettings.of(
        path=dataset.video.path,
        format=dataset.video.format,
        seconds=dataset.video.seconds,
        height=dataset.video.height,
        rig=dataset.placed_rig,
        look=dataset.shown_look,
    )


def validate(dataset: Dataset) -> ValidationSettings:
    """Return the settings that check a dataset."""
    return ValidationSettings(
        reprojections=[*dataset.reprojections],
        exports=dataset.export_lists,
    )


def figures(dataset: Dataset) -> FiguresSettings:
    exports = [*dataset.exports.selected.values()]
    chooses_tests = any(_chooses_tests(dataset, export) for export in exports)
    return FiguresSettings.of(
        rig=dataset.placed_rig, chooses_tests=chooses_tests or None, look=dataset.shown_look
    )


def _chooses_tests(dataset: Dataset, export: Export) -> bool:
    """Return whether an export chooses test views itself, because the rig has no split."""
    return export.chooses_tests and dataset.rig.split is None


def reader(dataset: Dataset) -> ReaderSettings:
    """Return the settings of a job that depends only on files, which its rule names."""
    return ReaderSettings()


# Of a reprojection.


def lens_map(reprojection: Reprojection) -> Content:
    """Return what a lens map depends on."""
    return reprojection.lens_map_settings


def reproject(reprojection: Reprojection) -> Content:
    """Return the settings of a reprojection."""
    return reprojection.as_json()


# Of a dataset in a build.


def costs(build: Build, dataset: Dataset) -> CostSettings:
    return CostSettings(
        energy=build.config.energy,
        full=_full_size(dataset),
        reprojections=[*dataset.reprojections],
    )


def _full_size(dataset: Dataset) -> FullSize:
    """Return the size of a dataset in the scene YAML, without the preset.

    It lacks samples and denoise if the YAML has a target error instead, or no render.
    """
    full = full_datasets(dataset.scene_name)[dataset.rig_folder]
    return FullSize.of(
        views=full.view_count,
        resolution=[*full.rig.camera.resolution],
        samples=full.render.samples,
        denoise=full.render.given_denoise,
    )


def page(build: Build, dataset: Dataset) -> PageSettings:
    measured = [
        MeasurementFile(file=str(path), sha256=sha256(path))
        for path in _measurements(build, dataset)
    ]
    return PageSettings.of(
        rig=dataset.placed_rig,
        yaml=_without_schema(scene_path(dataset.scene_name).read_text(encoding="utf-8")),
        command=_rebuilding(dataset),
        panorama=bool(dataset.panorama),
        measurements=measured,
        look=dataset.shown_look,
    )


def _without_schema(yaml: str) -> str:
    """Return a scene YAML without the line that tells editors its schema."""
    return re.sub(r"\A# yaml-language-server: .*\n", "", yaml)


def _measurements(build: Build, dataset: Dataset) -> list[Path]:
    """Return the files of the finished measurements that concern a dataset.

    They are not inputs: a page must never start a measurement, which takes an hour.
    """
    stems = [
        "reprojection",
        "stability",
        f"error_vs_time/{dataset.scene_name}",
        f"synthesis/{dataset.scene_folder}/{dataset.rig_folder}",
    ]
    files = [
        Path(build.config.results, "benchmarks", f"{stem}{suffix}")
        for stem in stems
        for suffix in (".csv", ".json", ".svg", ".png")
    ]
    return [file for file in files if file.exists()]


def _rebuilding(dataset: Dataset) -> str:
    """Return the command that makes a dataset, for its page."""
    snakefile = os.path.relpath(ROOT / "Snakefile")
    arguments = [] if snakefile == "Snakefile" else ["-s", snakefile]
    choice = [f"scenes={dataset.scene_name}", f"rigs={dataset.rig_name}"]
    arguments += ["--cores", "all", "--config", *choice, f"preset={dataset.preset}"]
    return shlex.join(["snakemake", *arguments])


def synthesis(build: Build, dataset: Dataset) -> SynthesisSettings:
    truths = build.held_out(dataset)
    return SynthesisSettings(truth=[truth.paths.folder for truth in truths])


# Of an export.


def export(dataset: Dataset, options: Export, source: str) -> ExportSettings[Export]:
    """Return the settings that export a source of a dataset."""
    # In a sequence the frame's folder follows the rig's name.
    folders = {
        rig.partition("/")[0]: replace(dataset.paths, rig=rig).folder
        for rig in dataset.rigs_beside(options)
    }
    training_list = dataset.training_list(options, source)
    return _export_settings(dataset, options, source, tested_by=folders, trained_by=training_list)


def _export_settings(
    dataset: Dataset, options: Export, source: str, **roles: Any
) -> ExportSettings[Export]:
    return export_settings_of(options.name).of(
        options=options.model_copy(update={"sources": [source]}),
        suffix=".exr" if source == VIEWS else dataset.reprojections[source].suffix,
        spread_version=keys.VERSIONS["spread"] if _chooses_tests(dataset, options) else None,
        points_version=keys.VERSIONS["points"] if hasattr(options, "points") else None,
        look_source=blender_looks.source_of(getattr(options, "look", None)),
        **roles,
    )


# Others. Each returns the name of the settings file, and its content.


def export_of(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    name, source = wildcards["format"], source_of(wildcards)
    settings = export(build.dataset(wildcards), build.export(wildcards), source)
    return f"exports/{source}/{name}", settings


def export_sequence(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    name, source = wildcards["format"], source_of(wildcards)
    frames = build.frames(wildcards)
    first = frames[0]
    options = first.exports.selected[name]
    others = build.beside(first, options)
    settings = _export_settings(
        first,
        options,
        source,
        tested_by={other.rig_name: other.sequence_paths.folder for other in others},
        frames=[Path(frame.paths.folder).name for frame in frames],
    )
    return f"exports/{source}/{name}", settings


def validate_sequence(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    frames = build.frames(wildcards)
    settings = SequenceValidationSettings(
        frames=[Path(frame.paths.folder).name for frame in frames],
        exports=frames[0].sequence_exports,
    )
    return "validate", settings


def sequence_page(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    frames = build.frames(wildcards)
    settings = SequenceSettings.of(
        frames=[Path(frame.paths.folder).name for frame in frames],
        rig=frames[0].placed_rig,
        look=frames[0].shown_look,
    )
    return "sequence_page", settings


def probes(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    """Return the settings of a scene's probe cameras. They are its first rig's, without an imu."""
    settings = lightfield(build.first_of_scene(wildcards["scene"]))
    if isinstance(settings.rig, rigs.Path):
        rig = settings.rig.model_copy(update={"imu": None})
        settings = settings.model_copy(update={"rig": rig})
    return "probes", settings


def gpu_check(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    """Return the settings of a scene's GPU check: the full sizes of its rigs."""
    sizes = {
        rig: FullSize(views=dataset.view_count, resolution=[*dataset.rig.camera.resolution])
        for rig, dataset in full_datasets(wildcards["scene"]).items()
    }
    return "gpu_check", GpuCheckSettings(full=sizes)


def pack(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    datasets = build.rig(wildcards)
    settings = PackSettings.of(
        datasets=[dataset.name for dataset in datasets],
        gigabytes=build.config.package_gigabytes,
        rig=datasets[0].rig.type,
        scene=datasets[0].written,
        look=datasets[0].shown_look,
    )
    return "pack", settings


def batch(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    folder = wildcards["family"]
    name = build.family_names[folder]
    values = build.families[name].values
    scene, fingerprint = _family_scene(name, has_drawn_light="scene.light" in values)
    settings = BatchSettings.of(
        members=build.members(wildcards),
        family=name,
        scene=scene,
        values=values,
        preset=build.config.preset,
        limits=build.config.presets[build.config.preset],
        results=build.config.results,
        work=build.config.work,
        fingerprint=fingerprint,
        bpy=version("bpy"),
    )
    return f"batches/{wildcards['batch']}", settings


@cache
def _family_scene(name: str, has_drawn_light: bool) -> tuple[Content, str | None]:
    """Return a family's scene YAML without its members, and the fingerprint of its source.

    Computed once for all batches, of which a family may have hundreds.
    """
    content = scene_content(name)
    # New members must not change the settings of the others.
    del content["family"]
    return content, _source_fingerprint(load_scene(name).scene, has_drawn_light)


def _source_fingerprint(source: SceneSource, has_drawn_light: bool) -> str | None:
    """Return what changes with a builder's text, or with the import of models."""
    if source.builder:
        return keys.scene_fingerprint(source)
    # A drawn light may be the softboxes.
    light = SOFTBOXES if has_drawn_light else source.light
    import_version = keys.import_version(light)
    # Batches of the first version keep their settings.
    return str(import_version) if import_version > 1 else None


def members(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    return "members", CountSettings(family=build.family_names[wildcards["family"]])


def corpus(build: Build, wildcards: Wildcards) -> tuple[str, Settings]:
    folder = wildcards["family"]
    options = build.families[build.family_names[folder]].corpus
    members = [member.name for batch in build.batches[folder].values() for member in batch]
    scene = load_scene(build.family_names[folder])
    look = shown_look(scene.developments.values(), scene.exports.selected.values())
    settings = CorpusSettings.of(
        **dict(options),
        family=folder,
        members=sorted(members),
        look=look,
        description=scene.description,
        licence=scene.licence,
        credit=scene.credit,
    )
    return "corpus", settings
