"""The settings files of all jobs: what the plan writes, and the programs read with --settings.

`settings_file` is the only provider. Each stage has an entry in one of its tables, by what the
stage works on: a scene, a dataset, a reprojection, or something else with wildcards of its own.
"""

import os
import shlex
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lightfield.configuration import keys
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.exports import Export, InstantNgp, export_settings_of
from lightfield.configuration.reprojections import Reprojection
from lightfield.configuration.scene_source import SceneSource
from lightfield.configuration.scene_yaml import load_scene, scene_content, scene_path
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.names import MESH, ROOT, SOFTBOXES, VIEWS
from lightfield.geometry.rigs import Poses
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
from lightfield.stages.report import FiguresSettings, MeasurementFile, PageSettings
from lightfield.stages.rig import FreePlacesSettings
from lightfield.stages.scene import BuildSettings, ImportSettings
from lightfield.workflow.build import Build, Wildcards, full_datasets, source_of
from lightfield.workflow.loading import rendered_frames, scene_datasets

Content = dict[str, Any]


def settings_file(stage: str, build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    """Return the path and the content of the settings file of a stage's job.

    Raises `UserError` for a job that no scene YAML asks for.
    """
    if stage in _OF_SCENE:
        dataset = build.scene(wildcards)
        return f"{dataset.paths.scene_work}/settings/{stage}.json", _OF_SCENE[stage](dataset)
    if stage in _OF_DATASET:
        dataset = build.dataset(wildcards)
        return dataset.paths.settings(stage), _OF_DATASET[stage](build, dataset)
    if stage in _OF_REPROJECTION:
        dataset = build.dataset(wildcards)
        reprojection = build.reprojection(wildcards)
        assert reprojection
        path = dataset.paths.settings(f"{wildcards['reprojection']}/{stage}")
        return path, _OF_REPROJECTION[stage](reprojection)
    name, content = _OTHERS[stage](build, wildcards)
    folder = "/".join(wildcards[key] for key in ("scene", "rig", "family") if key in wildcards)
    return os.path.normpath(f"{build.config.work}/{folder}/settings/{name}.json"), content


# Of a scene.


def _build_scene(dataset: Dataset) -> Content:
    source = dataset.source
    if source.builder is None:
        raise UserError(f"{dataset.paths.built_blend}: the scene YAML has no builder that makes it")
    settings = BuildSettings(
        builder=source.builder, parameters=source.parameters, fingerprint=dataset.fingerprint
    )
    return settings.as_json()


def _import_model(dataset: Dataset) -> Content:
    source = load_scene(dataset.scene_name).scene
    if source.model is None:
        raise UserError(f"{dataset.paths.model_blend}: the scene YAML has no model that makes it")
    return ImportSettings.of_source(source).as_json()


def _check_blend(dataset: Dataset) -> Content:
    return {
        # The scene YAML's checksum. Without it the job itself records the file's.
        "sha256": load_scene(dataset.scene_name).scene.sha256,
        # Another bpy makes everything of the file again.
        "bpy": version("bpy"),
    }


def _inventory(dataset: Dataset) -> Content:
    """Return what an inventory depends on in the scene YAML."""
    written = load_scene(dataset.scene_name)
    datasets = scene_datasets(dataset.scene_name)
    source = written.scene
    assert written.render
    content: Content = {
        # Raise this number when the program lists something else.
        "version": 5,
        "scene_name": source.scene_name,
        "view_layers": source.view_layers,
        "allow_missing": source.allow_missing,
        "motion_blur": written.render.motion_blur,
        "rendered_frames": rendered_frames(datasets),
        # Like the program, leave out rigs without frames.
        "camera_frames": [frame for each in datasets for frame in each.camera_frames],
    }
    if content["camera_frames"]:
        # Raise this number when the program takes or refuses other cameras.
        content["camera_version"] = 1
    if source.followed_camera:
        content["followed_camera"] = source.followed_camera
    if written.render.light_groups:
        content["light_groups"] = written.render.light_groups
    return content


_OF_SCENE: Mapping[str, Callable[[Dataset], Content]] = {
    "build_scene": _build_scene,
    "import_model": _import_model,
    "check_blend": _check_blend,
    "inventory": _inventory,
}


# Of a dataset.


def _free_places(build: Build, dataset: Dataset) -> Content:
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
    ).as_json()


def _lightfield(build: Build, dataset: Dataset) -> Content:
    file = dataset.rig.file if isinstance(dataset.rig, Poses) else None
    return LightfieldSettings.of_capture(
        dataset,
        flow=bool(dataset.flow),
        fingerprint=dataset.builder_fingerprint,
        poses_sha256=sha256(file) if file else None,
    ).as_json()


def _panorama(build: Build, dataset: Dataset) -> Content:
    return LightfieldSettings.of_capture(
        dataset,
        panorama_width=dataset.panorama_width,
        fingerprint=dataset.builder_fingerprint,
    ).as_json()


def _mesh(build: Build, dataset: Dataset) -> Content:
    if not dataset.mesh:
        raise UserError(f"{dataset.paths.folder}/{MESH}: the scene YAML asks for no mesh of it")
    source = dataset.source
    return MeshSettings.of(
        formats=dataset.mesh.formats,
        frame=source.frame,
        scene_name=source.scene_name,
        view_layers=source.view_layers,
        numbered=not {"object", "instance"}.isdisjoint(dataset.render.passes or ()),
    ).as_json()


def _validate(build: Build, dataset: Dataset) -> Content:
    return ValidationSettings(
        reprojections=[*dataset.reprojections],
        exports=dataset.export_lists,
        records=dataset.all_records,
    ).as_json()


def _figures(build: Build, dataset: Dataset) -> Content:
    return FiguresSettings.of(rig=dataset.placed_rig).as_json()


def _costs(build: Build, dataset: Dataset) -> Content:
    return CostSettings(
        energy=build.config.energy,
        full=_full_size(dataset),
        reprojections=[*dataset.reprojections],
    ).as_json()


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


def _page(build: Build, dataset: Dataset) -> Content:
    measured = [
        MeasurementFile(file=str(path), modified_ns=path.stat().st_mtime_ns)
        for path in _measurements(build, dataset)
    ]
    return PageSettings.of(
        rig=dataset.placed_rig,
        yaml=scene_path(dataset.scene_name).read_text(),
        command=_rebuilding(dataset),
        panorama=bool(dataset.panorama),
        measurements=measured,
    ).as_json()


def _measurements(build: Build, dataset: Dataset) -> list[Path]:
    """Return the files of the finished measurements that concern a dataset.

    They are not inputs: a page must never start a measurement, which takes an hour.
    """
    stems = ["reprojection", "stability", f"error_vs_time/{dataset.scene_name}"]
    for kind in ("synthesis", "learn"):
        stems.append(f"{kind}/{dataset.scene_folder}/{dataset.rig_folder}")
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


def _synthesis(build: Build, dataset: Dataset) -> Content:
    truths = build.held_out(dataset)
    return SynthesisSettings(truth=[truth.paths.folder for truth in truths]).as_json()


_OF_DATASET: Mapping[str, Callable[[Build, Dataset], Content]] = {
    "free_places": _free_places,
    "lightfield": _lightfield,
    "panorama": _panorama,
    "mesh": _mesh,
    "validate": _validate,
    "figures": _figures,
    "costs": _costs,
    "page": _page,
    "synthesis": _synthesis,
}


# Of a reprojection.


_OF_REPROJECTION: Mapping[str, Callable[[Reprojection], Content]] = {
    "lens_map": lambda reprojection: reprojection.lens_map_settings,
    "reproject": lambda reprojection: reprojection.as_json(),
}


# Others. Each returns the name of the settings file, and its content.


def _export(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    dataset = build.dataset(wildcards)
    options = build.export(wildcards)
    tests = {test.rig_name: test.paths.folder for test in build.testing(dataset, options)}
    return _export_content(dataset, wildcards["format"], options, wildcards, tested_by=tests)


def _export_sequence(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    frames = build.frames(wildcards)
    first = frames[0]
    options = first.exports.selected[wildcards["format"]]
    return _export_content(
        first,
        wildcards["format"],
        options,
        wildcards,
        tested_by={
            test.rig_name: test.sequence_paths.folder for test in build.testing(first, options)
        },
        frames=[Path(frame.paths.folder).name for frame in frames],
    )


def _instant_ngp(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    dataset = build.dataset(wildcards)
    # A user may name a transforms.json that the scene YAML does not export.
    options = dataset.exports.instant_ngp or InstantNgp(sources=[source_of(wildcards)])
    transforms = build.training_transforms(wildcards)
    roles = {"trained_by": transforms[0]} if transforms else {}
    return _export_content(dataset, "instant_ngp", options, wildcards, **roles)


def _export_content(
    dataset: Dataset, export_format: str, options: Export, wildcards: Wildcards, **roles: Any
) -> tuple[str, Content]:
    source = source_of(wildcards)
    settings = export_settings_of(export_format).of(
        options=options.model_copy(update={"sources": [source]}),
        suffix=".exr" if source == VIEWS else dataset.reprojections[source].suffix,
        **roles,
    )
    return f"exports/{source}/{export_format}", settings.as_json()


def _validate_sequence(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    frames = build.frames(wildcards)
    settings = SequenceValidationSettings(
        frames=[Path(frame.paths.folder).name for frame in frames],
        exports=frames[0].sequence_exports,
    )
    return "validate", settings.as_json()


def _probes(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    """Return the settings of a scene's probe cameras: those of its first rig."""
    return "probes", _lightfield(build, build.first_of_scene(wildcards["scene"]))


def _gpu_check(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    """Return the settings of a scene's GPU check: the full sizes of its rigs."""
    sizes = {
        rig: FullSize(views=dataset.view_count, resolution=[*dataset.rig.camera.resolution])
        for rig, dataset in full_datasets(wildcards["scene"]).items()
    }
    return "gpu_check", GpuCheckSettings(full=sizes).as_json()


def _splits(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    return "splits", {"lightfields": build.split_lightfields(wildcards)}


def _pack(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    datasets = build.rig(wildcards)
    settings = PackSettings.of(
        datasets=[dataset.name for dataset in datasets],
        gigabytes=build.config.package_gigabytes,
        scene=load_scene(datasets[0].scene_name),
    )
    return "pack", settings.as_json()


def _index(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    return "index", {"pages": [dataset.paths.page for dataset in build.chosen]}


def _batch(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    folder = wildcards["family"]
    name = build.family_names[folder]
    family = build.families[name]
    content = scene_content(name)
    # New members must not change the settings of the others.
    del content["family"]
    settings = BatchSettings.of(
        members=build.members(wildcards),
        family=name,
        scene=content,
        values=family.values,
        preset=build.config.preset,
        limits=build.config.presets[build.config.preset],
        results=build.config.results,
        work=build.config.work,
        fingerprint=_source_fingerprint(load_scene(name).scene, family.values),
        bpy=version("bpy"),
    )
    return f"batches/{wildcards['batch']}", settings.as_json()


def _source_fingerprint(source: SceneSource, values: Mapping[str, Any]) -> str | None:
    """Return what changes with a builder's text, or with the import of models."""
    if source.builder:
        return keys.scene_fingerprint(source)
    # A drawn light may be the softboxes.
    light = SOFTBOXES if "scene.light" in values else source.light
    import_version = keys.import_version(light)
    # Batches of the first version keep their settings.
    return str(import_version) if import_version > 1 else None


def _members(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    folder = wildcards["family"]
    settings = CountSettings(
        family=build.family_names[folder], records=build.batch_records(wildcards)
    )
    return "members", settings.as_json()


def _corpus(build: Build, wildcards: Wildcards) -> tuple[str, Content]:
    folder = wildcards["family"]
    options = build.families[build.family_names[folder]].corpus
    members = [member.name for batch in build.batches[folder].values() for member in batch]
    settings = CorpusSettings(**dict(options), family=folder, members=sorted(members))
    return "corpus", settings.as_json()


_OTHERS: Mapping[str, Callable[[Build, Wildcards], tuple[str, Content]]] = {
    "export": _export,
    "export_sequence": _export_sequence,
    "instant_ngp": _instant_ngp,
    "validate_sequence": _validate_sequence,
    "probes": _probes,
    "gpu_check": _gpu_check,
    "splits": _splits,
    "pack": _pack,
    "index": _index,
    "batch": _batch,
    "members": _members,
    "corpus": _corpus,
}
