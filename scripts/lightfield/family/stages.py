"""The stages that make the datasets of one member, through the functions that programs call.

All stages of a member run in this process, so that Blender is loaded once for many members. Each
stage that needs the scene opens its .blend anew, as the stages of other scenes do.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import prefix_of
from lightfield.configuration.exports import Export, InstantNgp, export_settings_of
from lightfield.configuration.family import SOURCES
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import write_bytes, write_json
from lightfield.core.names import VIEWS
from lightfield.formats.export_lists import FOLDER
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.rendering import inventory_file
from lightfield.stages.checks import Validate, ValidationSettings
from lightfield.stages.exports import ExportInstantNgp, ExportViews
from lightfield.stages.family import BatchSettings
from lightfield.stages.lenses import Reproject
from lightfield.stages.rig import CheckCameras, FreePlaces, FreePlacesSettings, MakeLightfield
from lightfield.stages.scene import BuildScene, BuildSettings, ImportModel, ImportSettings
from lightfield.stages.views import RenderShard
from lightfield.validation.result import causes


class Stages:
    """Runs the stages of a member. ``stage`` is the one at work, or the last one.

    ``written`` is the member's scene YAML, ``datasets`` are all its datasets, and ``name`` is what
    its light fields have as the name of the scene. ``seconds`` are the CPU seconds of each stage.
    """

    def __init__(
        self,
        settings: BatchSettings,
        name: str,
        written: Scene,
        datasets: list[Dataset],
        device: str,
        threads: int,
    ) -> None:
        self.settings = settings
        self.name = name
        self.written = written
        self.datasets = datasets
        self.device = device
        self.threads = threads
        self.stage = ""
        self.seconds: dict[str, float] = {}
        first = datasets[0]
        paths = first.paths
        self.blend = Path(paths.model_blend if first.source.model else paths.built_blend)
        self.inventory = Path(paths.inventory)
        self.model_record = Path(first.model_record) if first.model_record else None

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        """Name the stage in the log, and measure its CPU time."""
        self.stage = name
        print(f"stage: {name}", flush=True)
        began = time.process_time()
        yield
        seconds = self.seconds.get(name, 0.0) + time.process_time() - began
        self.seconds[name] = round(seconds, 4)

    def run(self) -> None:
        """Make all files of the datasets. Raises `UserError` if one is not valid."""
        self._make_scene()
        for dataset in self.datasets:
            self._place_cameras(dataset)
        for dataset in self.datasets:
            self._render(dataset)
            for name in dataset.reprojections:
                with self._stage("reproject"):
                    self._reproject(dataset, name)
        splits = self._write_splits()
        with self._stage("export"):
            # Those that test take the scale of those that train.
            for dataset in sorted(self.datasets, key=lambda each: each.trained_by is not None):
                self._export(dataset)
        for dataset in self.datasets:
            with self._stage("validate"):
                self._validate(dataset, splits)

    def _make_scene(self) -> None:
        source = self.written.scene
        if source.builder:
            with self._stage("build_scene"):
                settings = BuildSettings(builder=source.builder, parameters=source.parameters)
                BuildScene(settings=settings, output=self.blend).run()
        else:
            assert self.model_record
            with self._stage("import_model"):
                ImportModel(
                    settings=ImportSettings.of_source(source),
                    output=self.blend,
                    record=self.model_record,
                    sources=self.model_record.with_name(SOURCES),
                ).run()
        with self._stage("inventory"):
            inventory_file.write_of_datasets(
                self.blend, self.written, self.datasets, self.inventory, measures_memory=False
            )

    def _place_cameras(self, dataset: Dataset) -> None:
        places = Path(dataset.places) if dataset.places else None
        lightfield = Path(dataset.paths.lightfield)
        if places:
            with self._stage("free_places"):
                settings = FreePlacesSettings.of(rig=dataset.rig, frame=dataset.source.frame)
                FreePlaces(settings=settings, blend=self.blend, output=places).run()
        with self._stage("lightfield"):
            capture = LightfieldSettings.of_capture(dataset)
            capture = capture.model_copy(update={"scene": self.name})
            MakeLightfield(
                settings=capture,
                inventory=self.inventory if dataset.lightfield_inventory else None,
                model=self.model_record,
                places=places,
                output=lightfield,
            ).run()
        with self._stage("check_cameras"):
            CheckCameras(
                blend=self.blend,
                lightfield=lightfield,
                output=Path(dataset.paths.cameras),
            ).run()

    def _render(self, dataset: Dataset) -> None:
        with self._stage("render"):
            (record,) = dataset.records("render")
            RenderShard(
                blend=self.blend,
                lightfield=Path(dataset.paths.lightfield),
                inventory=self.inventory,
                output=Path(dataset.paths.views),
                record=Path(record),
                journal=Path(record).with_suffix(".journal.jsonl"),
                device=self.device,
                threads=self.threads,
            ).run()

    def _reproject(self, dataset: Dataset, name: str) -> None:
        """Make the images of a reprojection, and its lightfield.json."""
        (source_record,) = dataset.records("render")
        (record,) = dataset.records(name)
        folder = Path(dataset.paths.reprojected(name))
        Reproject(
            settings=dataset.reprojections[name],
            input_cfg=Path(dataset.paths.lightfield),
            input_dir=Path(dataset.paths.views),
            output_dir=folder,
            output_cfg=folder / "lightfield.json",
            source_record=Path(source_record),
            record=Path(record),
            views=f"0:{dataset.view_count}",
        ).run()

    def _write_splits(self) -> Path | None:
        """Write the splits.json of the member. Return None if no rig has a split."""
        with_split = [dataset for dataset in self.datasets if dataset.splits]
        if not with_split:
            return None
        lightfields = {
            dataset.rig_folder: LightField.read(Path(dataset.paths.lightfield))
            for dataset in with_split
        }
        path = Path(with_split[0].paths.splits)
        write_json(path, splits_content(lightfields))
        return path

    def _export(self, dataset: Dataset) -> None:
        """Write all exports of a dataset."""
        for name, options in dataset.exports.selected.items():
            for source in options.sources:
                self._export_source(dataset, name, options, source)

    def _export_source(self, dataset: Dataset, name: str, options: Export, source: str) -> None:
        folder = Path(dataset.paths.folder, prefix_of(source))
        roles: dict[str, Any] = {}
        if isinstance(options, InstantNgp):
            if dataset.trained_by:
                rig = Path(dataset.paths.scene_results, dataset.trained_by)
                trained = rig / prefix_of(source) / "transforms.json"
                roles["trained_by"] = str(trained)
        elif options.is_for_training:
            rigs = Path(dataset.paths.scene_results)
            roles["tested_by"] = {rig: str(rigs / rig) for rig in dataset.tested_by}
        is_rendered = source == VIEWS
        settings: Any = export_settings_of(name).of(
            options=options.model_copy(update={"sources": [source]}),
            suffix=".exr" if is_rendered else dataset.reprojections[source].suffix,
            **roles,
        )
        if isinstance(options, InstantNgp):
            ExportInstantNgp(
                settings=settings,
                input_cfg=folder / "lightfield.json",
                output=folder / "transforms.json",
                image_dir=Path(
                    dataset.paths.views if is_rendered else dataset.paths.reprojected(source)
                ),
            ).run()
        else:
            ExportViews(
                settings=settings,
                format=name,
                dataset=Path(dataset.paths.folder),
                output=folder / FOLDER / name,
            ).run()

    def _validate(self, dataset: Dataset, splits: Path | None) -> None:
        """Check a dataset, and write its validation.json and checksums.

        Raises `UserError` with the first problems if it is not valid.
        """
        folder = Path(dataset.paths.folder)
        sums = Path(dataset.paths.checksums)
        settings = ValidationSettings(
            reprojections=list(dataset.reprojections),
            exports=dataset.export_lists,
            records=dataset.all_records,
        )
        result = Validate(
            settings=settings,
            dataset=folder,
            output=Path(dataset.paths.validation),
            sums=sums,
            clearance=Path(dataset.paths.cameras),
            inventory=self.inventory,
            splits=splits if dataset.rig.split else None,
            removed=Path(self.settings.work, "removed"),
        ).run()
        if not result.valid:
            raise UserError(f"{folder}: is not valid: {causes(result.to_json())}")
        write_bytes(Path(dataset.paths.sums), sums.read_bytes())
