"""A dataset as rules and programs know it: description, files, shards and estimates."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from lightfield.dataset import passes, shard_counts
from lightfield.dataset.dataset_paths import DatasetPaths
from lightfield.dataset.estimate import Estimate


@dataclass(frozen=True)
class Dataset(DatasetPaths):
    """One scene seen by one rig, made shard by shard."""

    @cached_property
    def estimate(self) -> Estimate:
        """What the dataset will take."""
        return Estimate(self)

    @cached_property
    def shards(self) -> list[tuple[int, int]]:
        """The views in runs (first, end) of nearly equal length, as many as there were before."""
        if self.views_per_shard == "auto":
            count = shard_counts.noted(self.work_root, self.name, self.view_count)
            count = count or self.estimate.shard_count
        else:
            count = math.ceil(self.view_count / self.views_per_shard)
        bounds = [self.view_count * number // count for number in range(count + 1)]
        return list(pairwise(bounds))

    def records(self, stage: str) -> list[str]:
        return [self.record(stage, first, end) for first, end in self.shards]

    @property
    def stages(self) -> list[str]:
        """The stages that make the dataset's images, shard by shard."""
        return ["render", *self.reprojections, *([passes.FLOW.name] if self.flow else [])]

    @property
    def all_records(self) -> list[str]:
        """The records of all of these."""
        return [file for stage in self.stages for file in self.records(stage)]

    @property
    def files(self) -> list[str]:
        """All that the finished dataset consists of, as a target rule asks for it.

        The records are named although later files follow from them, because Snakemake makes a
        missing file anew only if a target rule names it.
        """
        return [
            f"{self.folder}/validation.json",
            f"{self.folder}/sha256sums.txt",
            *_paths(self.splits),
            *self.published,
            *self.pictures,
            self.costs,
            self.page,
            *self.all_records,
        ]

    @property
    def intermediates(self) -> list[str]:
        """What is made on the way to the dataset, named so that a missing one is made anew, too."""
        scene = self.blend if self.source.builder else self.blend_check
        return [
            *_paths(scene, self.inventory, self.calibration, self.places, self.cameras),
            f"{self.work}/checksums.txt",
            *(
                [f"{self.work}/panorama/lightfield.json", self.panorama]
                if isinstance(self.panorama, str)
                else []
            ),
            *(path for name in self.reprojections for path in self.lens_maps(name)),
        ]


def _paths(*perhaps: str | list[str]) -> list[str]:
    """Return those of several files that there are; one that a dataset has not is an empty list."""
    return [path for path in perhaps if isinstance(path, str)]
