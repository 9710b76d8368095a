"""A dataset, as rules and programs use it: description, files and shards."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from lightfield.configuration.dataset_paths import DatasetPaths
from lightfield.formats import passes
from lightfield.planning.cost import shard_count
from lightfield.workflow import shard_counts


@dataclass(frozen=True)
class Dataset(DatasetPaths):
    """One scene seen by one rig, made shard by shard."""

    @cached_property
    def shards(self) -> list[tuple[int, int]]:
        """The views in runs (first, end) of nearly equal length.

        A dataset that was begun keeps its number of shards.
        """
        if self.views_per_shard == "auto":
            count = shard_counts.noted(self.work_root, self.name, self.view_count)
            count = count or shard_count(self)
        else:
            count = math.ceil(self.view_count / self.views_per_shard)
        bounds = [self.view_count * number // count for number in range(count + 1)]
        return list(pairwise(bounds))

    def records(self, stage: str) -> list[str]:
        return [self.record(stage, first, end) for first, end in self.shards]

    @property
    def stages(self) -> list[str]:
        """The stages that make the dataset's images, shard by shard."""
        stages = ["render", *self.reprojections]
        if self.flow:
            stages.append(passes.FLOW.name)
        return stages

    @property
    def all_records(self) -> list[str]:
        """The records of all stages."""
        return [file for stage in self.stages for file in self.records(stage)]

    @property
    def files(self) -> list[str]:
        """All files of the finished dataset, as a target rule names them.

        The records are among them, although other files depend on them: Snakemake makes a missing
        file again only if a target rule names it.
        """
        return [
            f"{self.folder}/validation.json",
            f"{self.folder}/sha256sums.txt",
            *_paths(self.splits),
            *self.published,
            *self.sequence_exports,
            *_paths(self.sequence_sums),
            *self.pictures,
            self.costs,
            self.page,
            *self.all_records,
        ]

    @property
    def intermediates(self) -> list[str]:
        """The intermediate files, which a target rule names, too: a missing one is made again."""
        scene = self.blend_check if self.source.blend else self.blend
        files = _paths(
            scene,
            self.model_record,
            self.inventory,
            self.calibration,
            self.places,
            self.cameras,
        )
        files.append(f"{self.work}/checksums.txt")
        if isinstance(self.panorama, str):
            files += [f"{self.work}/panorama/lightfield.json", self.panorama]
        for name in self.reprojections:
            files += self.lens_maps(name)
        return files


def _paths(*paths_or_empty: str | list[str]) -> list[str]:
    """Return the paths among several properties. A file that a dataset lacks is an empty list."""
    return [path for path in paths_or_empty if isinstance(path, str)]
