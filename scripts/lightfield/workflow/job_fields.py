"""The files of the jobs that members of families have, too: their stages' fields, by name.

The record of a job in `lightfield.workflow.jobs` names the function of this module that returns its
fields. Rules show the same files in their commands. The members of a family have no rules: their
stages take the fields from here. A function returns None if the build has no such job.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import Paths, prefix_of
from lightfield.core.names import RENDERED
from lightfield.engine.receipts import REMOVED
from lightfield.workflow.build import Build, Wildcards

Fields = dict[str, Any]
FieldsOf = Callable[[Build, Wildcards], Fields | None]
"""Returns the fields of a job's stage, without its settings and the options of the machine."""


def _of_scene(fields_of: Callable[[Dataset], Fields | None]) -> FieldsOf:
    return lambda build, wildcards: fields_of(build.scene(wildcards))


def _of_dataset(fields_of: Callable[[Dataset], Fields | None]) -> FieldsOf:
    return lambda build, wildcards: fields_of(build.dataset(wildcards))


@_of_scene
def build_scene(dataset: Dataset) -> Fields | None:
    return {"output": dataset.paths.built_blend} if dataset.source.builder else None


@_of_scene
def import_model(dataset: Dataset) -> Fields | None:
    if not dataset.model_record:
        return None
    return {"output": dataset.blend, "record": dataset.model_record}


@_of_scene
def inventory(dataset: Dataset) -> Fields | None:
    if dataset.inventory is None:
        return None
    return {
        # The scene YAML of a member is no file.
        "scene": None if dataset.member else dataset.scene_name,
        "blend": dataset.blend,
        "output": dataset.inventory,
        # All members are built in one process.
        "skip_memory": bool(dataset.member),
    }


@_of_dataset
def free_places(dataset: Dataset) -> Fields | None:
    if dataset.places is None:
        return None
    return {
        "blend": dataset.blend,
        "inventory": dataset.rig_inventory,
        "output": dataset.places,
    }


@_of_dataset
def lightfield(dataset: Dataset) -> Fields:
    return {
        "calibration": dataset.calibration,
        "inventory": dataset.lightfield_inventory,
        "model": dataset.model_record,
        "places": dataset.places,
        "output": dataset.paths.lightfield,
    }


@_of_dataset
def check_cameras(dataset: Dataset) -> Fields | None:
    return _of_cameras_in_scene(dataset, dataset.cameras)


@_of_dataset
def corners(dataset: Dataset) -> Fields | None:
    return _of_cameras_in_scene(dataset, dataset.corners)


def _of_cameras_in_scene(dataset: Dataset, output: str | None) -> Fields | None:
    """Return the fields of a job that opens the scene with the cameras in it."""
    if output is None:
        return None
    return {
        "blend": dataset.blend,
        "lightfield": dataset.paths.lightfield,
        "inventory": dataset.blend_inventory,
        "output": output,
    }


def splits(build: Build, wildcards: Wildcards) -> Fields | None:
    lightfields = build.split_lightfields(wildcards)
    if not lightfields:
        return None
    paths = Paths(build.config.results, build.config.work, wildcards["scene"])
    return {"lightfields": lightfields, "output": paths.splits}


def heads(build: Build, wildcards: Wildcards) -> Fields | None:
    lightfields = build.head_lightfields(wildcards)
    if not lightfields:
        return None
    paths = Paths(build.config.results, build.config.work, wildcards["scene"])
    return {"lightfields": lightfields, "output": paths.heads}


def render(build: Build, wildcards: Wildcards) -> Fields | None:
    dataset = build.dataset(wildcards)
    if dataset.imported:
        return None
    return {
        "blend": dataset.blend,
        "lightfield": dataset.paths.lightfield,
        "inventory": dataset.inventory,
        "views": _slice(wildcards),
        "output": dataset.paths.views,
    }


def reprojected_lightfield(build: Build, wildcards: Wildcards) -> Fields:
    name = wildcards["reprojection"]
    paths = build.dataset(wildcards).paths
    return {
        "input_cfg": paths.lightfield,
        "input_dir": paths.views,
        "output_cfg": paths.source_lightfield(prefix_of(name)),
        "output_dir": paths.reprojected(name),
        "dry_run": True,
    }


def reproject(build: Build, wildcards: Wildcards) -> Fields:
    dataset = build.dataset(wildcards)
    name = wildcards["reprojection"]
    paths = dataset.paths
    fields = {
        "input_cfg": paths.lightfield,
        "input_dir": paths.views,
        "views": _slice(wildcards),
        "output_dir": paths.reprojected(name),
    }
    if dataset.member:
        # It has one shard, which computes the lens map, and one receipt.
        return fields
    return fields | {
        "lens_map": paths.lens_map(name),
        "source_receipt": paths.receipt(RENDERED, wildcards["first"], wildcards["end"]),
    }


def export(build: Build, wildcards: Wildcards) -> Fields | None:
    dataset = build.dataset(wildcards)
    path = dataset.paths.export_list(wildcards["format"], wildcards["source"])
    if path not in dataset.exported:
        return None
    return {
        "format": wildcards["format"],
        "dataset": dataset.paths.folder,
        "output": Path(path).parent,
    }


@_of_dataset
def validate(dataset: Dataset) -> Fields:
    return {
        "dataset": dataset.paths.folder,
        "output": dataset.paths.validation,
        "clearance": dataset.cameras,
        "inventory": dataset.inventory,
        "splits": dataset.splits,
        "removed": f"{dataset.work_root}/{REMOVED}",
    }


@_of_dataset
def checksums(dataset: Dataset) -> Fields:
    paths = dataset.paths
    return {
        "validation": paths.validation,
        # A member has no page.
        "page": paths.validation if dataset.member else paths.page,
        "output": paths.sums,
    }


def _slice(wildcards: Wildcards) -> str:
    """Return which views a shard has, as programs take it."""
    return f"{wildcards['first']}:{wildcards['end']}"
