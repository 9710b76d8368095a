"""The time limits of jobs that render shards on a cluster, and how long a shard may take.

A partition of a cluster may limit the time of a job. A shard's render and its reprojections may run
as one job, one after the other. So together they keep the limit.
"""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lightfield.configuration.dataset import Dataset

# A cluster's job is expected to take at most so many minutes, but at least one view.
_LONGEST_JOB = 120.0
# A job's time limit is so many times its expected time, and these minutes.
_TIMES_EXPECTED = 5
_RESERVE = 30


def most_minutes(seconds: float, cores: float, limit: int | None = None) -> int:
    """Return the time limit of a job that takes ``seconds`` of a core, and is shared by ``cores``.

    ``limit`` are the minutes that it may request at most.
    """
    expected = math.ceil(_TIMES_EXPECTED * seconds / 60 / cores)
    if limit is None:
        return _RESERVE + expected
    return min(_reserve(limit) + expected, limit)


def longest_job(dataset: "Dataset") -> float:
    """Return how many minutes a job that renders a shard is expected to take at most."""
    limit = limit_of_render(dataset)
    if limit is None:
        return _LONGEST_JOB
    return min(_LONGEST_JOB, (limit - _reserve(limit)) / _TIMES_EXPECTED)


def limit_of_render(dataset: "Dataset") -> int | None:
    """Return the partition's minutes without those of the reprojections. None without a limit."""
    limit = dataset.cluster and dataset.cluster.minutes
    if not limit:
        return None
    return max(1, limit - len(dataset.reprojections) * (minutes_of_reprojection(dataset) or 0))


def minutes_of_reprojection(dataset: "Dataset") -> int | None:
    """Return the time limit of a reprojection of a shard. None without a limit of the partition.

    A shard's reprojections get half of the partition's minutes at most.
    """
    limit = dataset.cluster and dataset.cluster.minutes
    count = len(dataset.reprojections)
    return max(1, min(_RESERVE, limit // (2 * count))) if limit and count else None


def _reserve(limit: int) -> int:
    """Return the part of a time limit that does not grow with the work."""
    return min(_RESERVE, limit // 2)
