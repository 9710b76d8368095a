"""The stages that make the datasets of one member: the rules' stages, with the same settings.

All stages of a member run in this process, so that Blender is loaded once for many members. Each
stage that needs the scene opens its .blend anew, as the stages of other scenes do. The stages have
no receipts of their own: what they read and make is in the member's receipt.
"""

import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import InstanceOf

from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import prefix_of
from lightfield.configuration.scene_yaml import Scene
from lightfield.engine.stage import Stage
from lightfield.stages.checks import Validate
from lightfield.stages.exports import ExportViews
from lightfield.stages.lenses import Reproject
from lightfield.stages.publishing import PublishChecksums
from lightfield.stages.rig import CheckCameras, FreePlaces, MakeLightfield
from lightfield.stages.scene import BuildScene, ImportModel, ImportSettings, Inventory
from lightfield.stages.views import Device, ListSplits, RenderShard
from lightfield.workflow import job_settings

# The names of stages in a member's log and record. Other stages have the names of their programs.
NAMES: dict[type[Stage[Any]], str] = {
    MakeLightfield: "lightfield",
    RenderShard: "render",
    PublishChecksums: "validate",
}


class MemberInventory(Inventory):
    """Lists what a member's scene contains. Its scene YAML is no file.

    It does not measure memory, because the measurement starts a process of its own.
    """

    written: InstanceOf[Scene]
    datasets: Sequence[InstanceOf[Dataset]]

    def run(self) -> None:
        """Write the inventory. Raises `UserError` for a scene that cannot be rendered."""
        # Only now, because the process that starts workers needs no Blender.
        from lightfield.rendering.inspection.inventory_file import write_of_datasets

        write_of_datasets(
            self.blend, self.written, self.datasets, self.output, measures_memory=False
        )


class StageRun:
    """A run of stages. ``stage`` is the name of the one at work, or of the last one.

    ``seconds`` are the CPU seconds of each stage.
    """

    def __init__(self) -> None:
        self.stage = "settings"
        self.seconds: dict[str, float] = {}

    def run(self, jobs: Iterable[Stage[Any]]) -> None:
        """Run the stages, and name each in the log."""
        for job in jobs:
            self.stage = NAMES.get(type(job), job.name)
            print(f"stage: {self.stage}", flush=True)
            began = time.process_time()
            job.run()
            seconds = self.seconds.get(self.stage, 0.0) + time.process_time() - began
            self.seconds[self.stage] = round(seconds, 4)


def jobs_of(
    datasets: Sequence[Dataset],
    written: Scene,
    scene: str,
    work: str,
    device: Device,
    threads: int,
) -> Iterator[Stage[Any]]:
    """Yield the stages of a member, in the order in which they run.

    ``datasets`` are all that its scene YAML has, as ``written``. ``scene`` is what its light fields
    have as the name of the scene. ``work`` is the workflow's folder of intermediate files.
    """
    yield from _scene_jobs(datasets, written)
    for dataset in datasets:
        yield from _camera_jobs(dataset, scene)
    for dataset in datasets:
        yield from _view_jobs(dataset, device, threads)
    if with_split := [dataset for dataset in datasets if dataset.splits]:
        yield ListSplits(
            lightfields=[Path(dataset.paths.lightfield) for dataset in with_split],
            output=Path(with_split[0].paths.splits),
        )
    # Those that test take the scale of those that train.
    for dataset in sorted(datasets, key=lambda each: each.trained_by is not None):
        yield from _export_jobs(dataset)
    for dataset in datasets:
        yield from _check_jobs(dataset, Path(work, "removed"))


def _scene_jobs(datasets: Sequence[Dataset], written: Scene) -> Iterator[Stage[Any]]:
    first = datasets[0]
    blend = _blend(first)
    if first.model_record:
        yield ImportModel(
            settings=ImportSettings.of_source(written.scene),
            output=blend,
            record=Path(first.model_record),
        )
    else:
        yield BuildScene(settings=job_settings.build_scene(first), output=blend)
    yield MemberInventory(
        blend=blend, written=written, datasets=datasets, output=Path(first.paths.inventory)
    )


def _camera_jobs(dataset: Dataset, scene: str) -> Iterator[Stage[Any]]:
    lightfield = Path(dataset.paths.lightfield)
    if dataset.places:
        yield FreePlaces(
            settings=job_settings.free_places(dataset),
            blend=_blend(dataset),
            output=Path(dataset.places),
        )
    yield MakeLightfield(
        settings=job_settings.lightfield(dataset).model_copy(update={"scene": scene}),
        inventory=_path(dataset.lightfield_inventory),
        model=_path(dataset.model_record),
        places=_path(dataset.places),
        output=lightfield,
    )
    yield CheckCameras(
        blend=_blend(dataset), lightfield=lightfield, output=Path(dataset.paths.cameras)
    )


def _view_jobs(dataset: Dataset, device: Device, threads: int) -> Iterator[Stage[Any]]:
    lightfield, views = Path(dataset.paths.lightfield), Path(dataset.paths.views)
    yield RenderShard(
        blend=_blend(dataset),
        lightfield=lightfield,
        inventory=Path(dataset.paths.inventory),
        output=views,
        device=device,
        threads=threads,
    )
    for name, settings in dataset.reprojections.items():
        yield Reproject(
            settings=settings,
            input_cfg=lightfield,
            input_dir=views,
            output_dir=Path(dataset.paths.reprojected(name)),
            output_cfg=Path(dataset.paths.source_lightfield(prefix_of(name))),
            views=f"0:{dataset.view_count}",
        )


def _export_jobs(dataset: Dataset) -> Iterator[Stage[Any]]:
    paths = dataset.paths
    for name, options in dataset.exports.selected.items():
        for source in options.sources:
            prefix = prefix_of(source)
            yield ExportViews(
                settings=job_settings.export(dataset, options, source),
                format=name,
                dataset=Path(paths.folder),
                output=Path(paths.export_list(name, prefix)).parent,
            )


def _check_jobs(dataset: Dataset, removed: Path) -> Iterator[Stage[Any]]:
    paths = dataset.paths
    validation = Path(paths.validation)
    yield Validate(
        settings=job_settings.validate(dataset),
        dataset=Path(paths.folder),
        output=validation,
        clearance=Path(paths.cameras),
        inventory=Path(paths.inventory),
        splits=_path(dataset.splits),
        removed=removed,
    )
    # A member has no page.
    yield PublishChecksums(validation=validation, page=validation, output=Path(paths.sums))


def _blend(dataset: Dataset) -> Path:
    assert dataset.blend
    return Path(dataset.blend)


def _path(path: str | None) -> Path | None:
    return None if path is None else Path(path)
