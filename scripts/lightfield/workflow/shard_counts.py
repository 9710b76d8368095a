"""The number of shards of each dataset. It is noted when the first shard is rendered.

In work/shards.json, "datasets" has the "views" and "shards" of each dataset, and "sha256" is the
checksum of "datasets". A damaged file is ignored. The count depends on --jobs or a probe, which may
change later, or be unknown to a job. So a dataset that was begun keeps its count.
"""

import hashlib
import json
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

from lightfield.configuration.dataset import Dataset
from lightfield.core.files import DAMAGE, write_json_if_changed
from lightfield.planning import cost

NAME = "shards.json"


def shard_count(dataset: Dataset) -> int:
    """Return the number of shards of a dataset. One that was begun keeps its number."""
    if dataset.views_per_shard != "auto":
        return math.ceil(dataset.view_count / dataset.views_per_shard)
    noted_count = noted(dataset.work_root, dataset.name, dataset.view_count)
    return noted_count or cost.shard_count(dataset)


def noted(work: str, dataset: str, views: int) -> int | None:
    """Return the noted number of shards of a dataset with this many views, or None.

    ``work`` is the folder of the note. A broken note is ignored.
    """
    path = Path(work, NAME)
    if not path.is_file():
        return None
    try:
        entry = _read(path, path.stat().st_mtime_ns)[dataset]
        return max(1, min(int(entry["shards"]), views)) if entry["views"] == views else None
    except (OSError, *DAMAGE):
        return None


def note(work: str, counts: dict[str, tuple[int, int]]) -> None:
    """Note the views and shards of these datasets. Keeps the notes of others."""
    path = Path(work, NAME)
    try:
        noted_datasets = dict(_read(path, path.stat().st_mtime_ns))
    except (OSError, *DAMAGE):
        noted_datasets = {}
    for name, (views, shards) in counts.items():
        noted_datasets[name] = {"views": views, "shards": shards}
    datasets = dict(sorted(noted_datasets.items()))
    write_json_if_changed(path, {"datasets": datasets, "sha256": _digest(datasets)})


@lru_cache(maxsize=1)
def _read(path: Path, _changed: int) -> Any:
    """Return the note of each dataset. Raises ValueError for a damaged file.

    ``_changed`` is the file's time, with which the cache notices a new file.
    """
    content = json.loads(path.read_bytes())
    if content.get("sha256") != _digest(content.get("datasets")):
        raise ValueError(f"{path}: is damaged")
    return {
        name: {key: int(entry[key]) for key in ("views", "shards")}
        for name, entry in content["datasets"].items()
    }


def _digest(datasets: Any) -> str:
    return hashlib.sha256(json.dumps(datasets, sort_keys=True).encode()).hexdigest()
