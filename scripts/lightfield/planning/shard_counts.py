"""The number of shards of each dataset. A dataset that was begun keeps its number.

The number depends on --jobs or a probe, which may change later, or be unknown to a job. So the
names of the receipts tell the number of shards, also of receipts that are not finished.
"""

import math
import os

from lightfield.configuration.dataset import Dataset, shard_bounds
from lightfield.core.names import RENDERED
from lightfield.engine.receipts import FOLDER, SHARD
from lightfield.planning import cost


def shard_count(dataset: Dataset) -> int:
    """Return the number of shards of a dataset. One that was begun keeps its number.

    It is the present number if that explains all names, and else the number that explains most.
    Shards of an earlier number may be left.
    """
    views = dataset.view_count
    if dataset.views_per_shard != "auto":
        return math.ceil(views / dataset.views_per_shard)
    present_count = cost.shard_count(dataset)
    begun = _begun_shards(f"{dataset.work_root}/{FOLDER}/{dataset.name}/{RENDERED}")
    if begun.issubset(shard_bounds(views, present_count)):
        return present_count
    names = {
        count: len(begun.intersection(shard_bounds(views, count)))
        for count in sorted(_possible_counts(begun, views))
    }
    best = max(names, key=lambda count: names[count], default=present_count)
    return best if names.get(best) else present_count


def _possible_counts(begun: set[tuple[int, int]], views: int) -> set[int]:
    """Return the numbers of shards in which one may have the length of a shard that was begun."""
    return {
        count
        for first, end in begun
        if first < end <= views
        for count in range(views // (end - first + 1), views // max(1, end - first - 1) + 1)
        if 0 < count <= views
    }


def _begun_shards(folder: str) -> set[tuple[int, int]]:
    """Return the bounds of the shards that have a receipt in a folder, finished or not."""
    try:
        names = os.listdir(folder)  # noqa: PTH208, a `Path` is slow for many files
    except OSError:
        return set()
    matches = (SHARD.match(name) for name in names)
    return {(int(match[1]), int(match[2])) for match in matches if match}
