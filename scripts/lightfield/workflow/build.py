"""All datasets of a run, and which of them a job concerns.

A job has the wildcards of its output's path: ``scene`` and ``rig`` name the folders of a dataset,
``name`` names a scene YAML. ``reprojection`` or ``source`` say which of its views are meant, and
``format`` says which export.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TypeVar

from lightfield.configuration.config_file import Configuration
from lightfield.configuration.corpus import CORPUS_FILES
from lightfield.configuration.dataset import Cluster, Dataset
from lightfield.configuration.family import RECORD, Family, Member
from lightfield.configuration.reprojections import Reprojection
from lightfield.configuration.scene_yaml import mistake
from lightfield.core.errors import UserError
from lightfield.core.names import CORPUS, RENDERED, VIEWS, scene_folder
from lightfield.exporters.base import Export
from lightfield.planning.cost import Cost, members_cost
from lightfield.planning.loading import (
    chosen_families,
    load_datasets,
    scene_datasets,
)

Wildcards = Mapping[str, str]
Entry = TypeVar("Entry")
Batches = Mapping[str, Mapping[str, list[Member]]]
"""The members of each batch of each family, by the folder of the family."""
SMOKE = "smoke"
INVENTORY = "inventory.json"


def shards_of(wildcards: Wildcards) -> str:
    """Return the folder of the shards whose views a job makes or reads: see `Dataset.receipts`."""
    source = wildcards.get("source", "").rstrip("/")
    return wildcards.get("reprojection", source or RENDERED)


def source_of(wildcards: Wildcards) -> str:
    """Return the name of the views that an export reads: of a reprojection, or `VIEWS`."""
    return wildcards["source"].rstrip("/") or VIEWS


@dataclass(frozen=True)
class Build:
    """The datasets of a run: the chosen ones, and the datasets that the chosen ones may need.

    The run makes the ``chosen`` datasets. ``datasets`` maps names to all datasets. Some of them
    only test models that were trained on chosen ones. ``families`` maps the names of scene YAMLs to
    the chosen families. ``batches`` has their members.
    """

    config: Configuration
    chosen: list[Dataset]
    datasets: dict[str, Dataset]
    families: dict[str, Family]
    batches: Batches

    @classmethod
    def load(cls, config: Configuration, cluster: Cluster | None = None) -> "Build":
        """Load the datasets of a configuration. Raises `UserError` for a mistake in it."""
        chosen = load_datasets(config, cluster)
        every_rig = load_datasets(config.model_copy(update={"rigs": "all"}), cluster)
        smoke: list[Dataset] = []
        # Other scenes need no smoke scene. `smoke` raises its error.
        with suppress(UserError):
            smoke = scene_datasets(SMOKE, settings=config, cluster=cluster)
        datasets = {dataset.name: dataset for dataset in [*smoke, *every_rig]}
        families = chosen_families(config)
        return cls(config, chosen, datasets, families, _batches(config, families))

    @cached_property
    def smoke(self) -> list[Dataset]:
        """The datasets of the smoke scene. Raises `UserError` if its YAML is missing or wrong."""
        return [self.datasets[d.name] for d in scene_datasets(SMOKE, settings=self.config)]

    def smoke_files(self, wildcards: Wildcards) -> list[str]:
        """Return all files of the smoke scene. Raises `UserError` as `smoke` does."""
        return [path for d in self.smoke for path in (*d.files, *d.intermediates)]

    @cached_property
    def scenes(self) -> dict[str, Dataset]:
        """Any dataset of each scene YAML, by its name: all of them have the same .blend."""
        return {dataset.scene_name: dataset for dataset in self.datasets.values()}

    def dataset(self, wildcards: Wildcards) -> Dataset:
        """Return the dataset that a job concerns."""
        name = f"{wildcards['scene']}/{wildcards['rig']}"
        results = self.config.results
        return _entry(self.datasets, name, results, "dataset of the chosen scenes")

    def scene(self, wildcards: Wildcards) -> Dataset:
        """Return any dataset of the scene that a job concerns."""
        return _entry(self.scenes, wildcards["name"], self.config.work, "chosen scene")

    def reprojection(self, wildcards: Wildcards) -> Reprojection | None:
        """Return the reprojection that a job concerns. None for the rendered views."""
        name = shards_of(wildcards)
        if name == RENDERED:
            return None
        dataset = self.dataset(wildcards)
        return _entry(dataset.reprojections, name, dataset.paths.folder, "reprojection of it")

    def receipts(self, wildcards: Wildcards) -> list[str]:
        """Return the receipts of the shards whose views a job reads."""
        return self.dataset(wildcards).receipts(shards_of(wildcards))

    def rendered_receipts(self, wildcards: Wildcards) -> list[str]:
        """Return the receipts of a dataset's rendered views."""
        return self.dataset(wildcards).receipts(RENDERED)

    def lens_maps(self, wildcards: Wildcards) -> list[str]:
        """Return the lens maps of a reprojection. Empty if there is no such reprojection."""
        dataset = self.dataset(wildcards)
        name = wildcards["reprojection"]
        return dataset.lens_maps(name) if name in dataset.reprojections else []

    def export(self, wildcards: Wildcards) -> Export:
        """Return the options of the export that a job makes."""
        dataset = self.dataset(wildcards)
        folder = f"{dataset.paths.folder}/exports"
        return _entry(dataset.exports.selected, wildcards["format"], folder, "export of it")

    def beside(self, dataset: Dataset, export: Export) -> list[Dataset]:
        """Return the other datasets whose views go into an ``export`` of a dataset."""
        rigs = dataset.rigs_beside(export)
        return [self.datasets[f"{dataset.scene_folder}/{rig}"] for rig in rigs]

    def exported_views(self, wildcards: Wildcards) -> list[str]:
        """Return the inputs of an export: the views of its dataset, and of other rigs.

        Points follow from the depth of the rendered views, for any source.
        """
        dataset = self.dataset(wildcards)
        files = [*dataset.receipts(RENDERED), *dataset.receipts(shards_of(wildcards))]
        for other in self.beside(dataset, self.export(wildcards)):
            files += _views_of_source(other, wildcards)
        return list(dict.fromkeys(files))

    def training_lists(self, wildcards: Wildcards) -> list[str]:
        """Return the list of the export of the views that train, if a job's export reads it."""
        dataset = self.dataset(wildcards)
        path = dataset.training_list(self.export(wildcards), source_of(wildcards))
        return [path] if path else []

    @cached_property
    def _rigs(self) -> dict[str, list[Dataset]]:
        """The dataset of each rig, or the datasets of all frames of its sequence."""
        rigs: dict[str, list[Dataset]] = {}
        for dataset in self.datasets.values():
            rigs.setdefault(dataset.sequence_name, []).append(dataset)
        return rigs

    def rig(self, wildcards: Wildcards) -> list[Dataset]:
        """Return the dataset of a rig, or the datasets of all frames of a sequence."""
        name = f"{wildcards['scene']}/{wildcards['rig']}"
        return _entry(self._rigs, name, self.config.results, "dataset of the chosen scenes")

    def frames(self, wildcards: Wildcards) -> list[Dataset]:
        """Return the datasets of a rig's sequence, in the order of time.

        Raises `UserError` if there is none, and if it has no export of the job's format.
        """
        frames = [dataset for dataset in self.rig(wildcards) if dataset.rig.sequence]
        export_format = wildcards.get("format")
        folder = f"{self.config.results}/{wildcards['scene']}/{wildcards['rig']}"
        if export_format and not (frames and export_format in frames[0].exports.selected):
            raise UserError(
                f"{folder}/exports/{export_format}: the scene YAML asks for no such export of a "
                "sequence"
            )
        if not frames:
            raise UserError(f"{folder}: is no sequence; its rig in the scene YAML has no frames")
        return frames

    def exported_frames(self, wildcards: Wildcards) -> list[str]:
        """Return the inputs of an export of a sequence: the views of all frames."""
        files = []
        for frame in self.frames(wildcards):
            export = frame.exports.selected[wildcards["format"]]
            for dataset in (frame, *self.beside(frame, export)):
                files += _views_of_source(dataset, wildcards)
        return list(dict.fromkeys(files))

    def validated_frames(self, wildcards: Wildcards) -> list[str]:
        """Return the files with which exports of a sequence are compared: the views of all frames.

        Exports may have views of other rigs. Their lightfield.json has their poses.
        """
        files = []
        for frame in self.frames(wildcards):
            files += [*frame.all_receipts, *frame.lightfields]
            for export in frame.exports.selected.values():
                if export.is_of_sequence:
                    for other in self.beside(frame, export):
                        files += other.lightfields
        return list(dict.fromkeys(files))

    def shown_frames(self, wildcards: Wildcards) -> list[str]:
        """Return the files that the page of a sequence shows: the views of all frames."""
        files = []
        for frame in self.frames(wildcards):
            paths = frame.paths
            files += [*frame.receipts(RENDERED), paths.lightfield, paths.validation]
        return files

    @property
    def pages(self) -> list[str]:
        """The pages of the chosen datasets and sequences."""
        pages = []
        for dataset in self.chosen:
            pages.append(dataset.paths.page)
            if dataset.sequence_page:
                pages.append(dataset.sequence_page)
        return list(dict.fromkeys(pages))

    def sequence_exports(self, wildcards: Wildcards) -> list[str]:
        """Return the lists of the exports of a sequence."""
        return self.frames(wildcards)[0].sequence_exports

    @property
    def probes(self) -> list[tuple[str, int, str]]:
        """Name, number of frames, and probe of each chosen rig.

        A sequence has the probe of its first frame.
        """
        frames_of_rig: dict[str, list[Dataset]] = {}
        for dataset in self.chosen:
            if not dataset.imported:
                frames_of_rig.setdefault(dataset.sequence_name, []).append(dataset)
        return [
            (name, len(frames), frames[0].paths.probe) for name, frames in frames_of_rig.items()
        ]

    def packages(self, wildcards: Wildcards) -> list[str]:
        """Return the packages of the chosen datasets, and the documents beside them.

        Raises `UserError` if only families are chosen, which have no packages.
        """
        if not self.chosen:
            raise UserError(
                f"package: {' and '.join(self.families)}: a family has no packages; its corpus is "
                "published as it is, see docs/how-to/use-a-corpus.md"
            )
        return [*(dataset.sequence_paths.package for dataset in self.chosen), *self.documents]

    @property
    def documents(self) -> list[str]:
        """The descriptions of the chosen datasets whose scene YAML says how to publish them."""
        return [
            document
            for dataset in self.chosen
            if dataset.written.publish
            for document in dataset.sequence_paths.documents
        ]

    @property
    def verified_folders(self) -> list[str]:
        """The folders of the chosen datasets, sequences and families."""
        folders = [dataset.sequence_paths.folder for dataset in self.chosen]
        return list(dict.fromkeys([*folders, *self.family_results]))

    def first_of_scene(self, folder: str) -> Dataset:
        """Return the dataset of a scene's first rig, whose views are the scene's probes.

        The folder of a scene that is not chosen is its name, and means the scene at full size.
        """
        for dataset in self.datasets.values():
            if dataset.scene_folder == folder:
                return dataset
        return scene_datasets(folder, settings=self.config)[0]

    def packed_sums(self, wildcards: Wildcards) -> list[str]:
        """Return the checksums that exist when everything in an archive is finished."""
        datasets = self.rig(wildcards)
        sums = [dataset.paths.sums for dataset in datasets]
        if sequence_sums := datasets[0].sequence_sums:
            sums.append(sequence_sums)
        return sums

    def packed_page(self, wildcards: Wildcards) -> str:
        """Return the page whose walk is in an archive: of the first frame, if there are several."""
        return self.rig(wildcards)[0].paths.page

    def packed_lists(self, wildcards: Wildcards) -> list[str]:
        """Return the validations and lists that name all files in an archive."""
        datasets = self.rig(wildcards)
        files = list(datasets[0].sequence_exports)
        if files:
            files.append(datasets[0].sequence_paths.validation)
        for dataset in datasets:
            files += [dataset.paths.validation, *dataset.published, *dataset.all_receipts]
        return files

    def truth_receipts(self, wildcards: Wildcards) -> list[str]:
        """Return the receipts of the views with which synthesised views are compared."""
        truths = self.held_out(self.dataset(wildcards))
        return [record for truth in truths for record in truth.receipts(RENDERED)]

    def held_out(self, dataset: Dataset) -> list[Dataset]:
        """Return the scene's chosen datasets that reach less far than this one.

        Empty for a rig whose cameras span no surface, because nothing lies between them.
        """
        # How far a rig reaches that fits the scene is unknown before the scene is read.
        if dataset.rig.cells() is None or dataset.rig.is_fitted:
            return []
        return [
            other
            for other in self.chosen
            if other.scene_folder == dataset.scene_folder
            and other.rig.cells() is not None
            and not other.rig.is_fitted
            and _reach(other) < _reach(dataset)
        ]

    def split_lightfields(self, wildcards: Wildcards) -> list[str]:
        """Return the light fields of a scene's rigs that have a split."""
        return [
            dataset.paths.lightfield
            for dataset in self.datasets.values()
            if dataset.scene_folder == wildcards["scene"] and dataset.splits
        ]

    def head_lightfields(self, wildcards: Wildcards) -> list[str]:
        """Return the light fields of a scene's rigs that are cameras of heads."""
        return [
            dataset.paths.lightfield
            for dataset in self.datasets.values()
            if dataset.scene_folder == wildcards["scene"] and dataset.heads
        ]

    # Families.

    @cached_property
    def family_names(self) -> dict[str, str]:
        """The names of the chosen families, by their folders."""
        return {scene_folder(name, self.config.preset): name for name in self.families}

    @property
    def batch_count(self) -> int:
        """The number of batches of all families."""
        return sum(map(len, self.batches.values()))

    def members(self, wildcards: Wildcards) -> list[Member]:
        """Return the members of the batch that a job builds."""
        batches = self.batches[wildcards["family"]]
        return _entry(batches, wildcards["batch"], self.config.work, "batch of it")

    def missing_members(self, wildcards: Wildcards) -> int:
        """Return how many members of a batch have no record yet."""
        folder = Path(self.config.results, wildcards["family"])
        names = [member.name for member in self.members(wildcards)]
        return sum(not (folder / name / RECORD).exists() for name in names)

    @cached_property
    def member_datasets(self) -> dict[str, list[Dataset]]:
        """By a family's folder: the datasets of a member that stands for all its members."""
        config = self.config
        limits = config.presets[config.preset]
        return {
            folder: scene_datasets(name, config.preset, limits, config)
            for folder, name in self.family_names.items()
        }

    def batch_views(self, wildcards: Wildcards) -> int:
        """Return how many views the missing members of a batch have."""
        datasets = self.member_datasets[wildcards["family"]]
        return self.missing_members(wildcards) * sum(d.view_count for d in datasets)

    def batch_cost(self, wildcards: Wildcards) -> Cost:
        """Return the cost of the missing members of a batch."""
        datasets = self.member_datasets[wildcards["family"]]
        return members_cost(datasets, self.missing_members(wildcards))

    @property
    def family_results(self) -> list[str]:
        """The folders of the chosen families that have members."""
        folders = [f"{self.config.results}/{folder}" for folder in self.family_names]
        return [folder for folder in folders if any(Path(folder).glob(f"*/{RECORD}"))]

    @property
    def corpora(self) -> list[str]:
        """The files of the chosen families' corpora."""
        return [
            f"{self.config.results}/{folder}/{name}"
            for folder in self.family_names
            for name in CORPUS_FILES
        ]

    @property
    def corpus_lists(self) -> list[str]:
        """The lists of the members of the chosen families."""
        return [f"{self.config.results}/{folder}/{CORPUS}" for folder in self.family_names]

    @property
    def family_targets(self) -> list[str]:
        """The files that a run with families makes."""
        counts = [f"{self.config.work}/{folder}/members.json" for folder in self.family_names]
        return self.corpora + counts


def _batches(config: Configuration, families: Mapping[str, Family]) -> Batches:
    """Return the batches of families. Raises `UserError` for a family without members."""
    batches = {}
    for name, family in families.items():
        try:
            batches[scene_folder(name, config.preset)] = family.batches()
        except UserError as error:
            raise mistake(name, str(error)) from None
    return batches


@cache
def full_datasets(scene: str) -> dict[str, Dataset]:
    """Return a scene YAML's datasets at full size, by rig."""
    return {dataset.rig_folder: dataset for dataset in scene_datasets(scene)}


def _views_of_source(dataset: Dataset, wildcards: Wildcards) -> list[str]:
    """Return the records and light fields of a dataset's rendered views, and of the source's."""
    return [
        *dataset.receipts(RENDERED),
        *dataset.receipts(shards_of(wildcards)),
        dataset.paths.lightfield,
        dataset.paths.source_lightfield(wildcards["source"]),
    ]


def _entry(by_name: Mapping[str, Entry], name: str, folder: str, kind: str) -> Entry:
    """Return the entry that a file's path names. Raises `UserError` if there is none."""
    if name not in by_name:
        near = " or ".join(difflib.get_close_matches(name, by_name))
        hint = f"; is {near} meant?" if near else ""
        raise UserError(f"{folder}/{name}: no {kind}{hint}")
    return by_name[name]


def _reach(dataset: Dataset) -> float:
    """Return the largest distance of a rig's cameras from their middle, in metres."""
    places: Sequence[Sequence[float]] = [pose.position for pose in dataset.rig.poses()]
    middle = [sum(axis) / len(places) for axis in zip(*places, strict=True)]
    return max(math.dist(place, middle) for place in places)
