"""Into how many shards the views of each dataset are cut, noted when the first is rendered.

work/shards.json: "datasets" has "views" and "shards" of each, and "sha256" is of "datasets". A
damaged file counts for nothing. What a count follows from may change later, such as --jobs or a
probe, or be unknown where a job runs. So a dataset that was begun keeps its own.
"""

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from lightfield.core.files import DAMAGE, write_json_if_changed

NAME = "shards.json"


def noted(work: str, dataset: str, views: int) -> int | None:
    """Return how many shards a dataset of so many views was given; None if none was begun.

    ``work`` is the folder that has the note; one that is broken says nothing.
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
    """Note the views and the shards of these datasets, beside those of others."""
    path = Path(work, NAME)
    try:
        known = dict(_read(path, path.stat().st_mtime_ns))
    except (OSError, *DAMAGE):
        known = {}
    new = {name: {"views": views, "shards": shards} for name, (views, shards) in counts.items()}
    datasets = dict(sorted((known | new).items()))
    write_json_if_changed(path, {"datasets": datasets, "sha256": _digest(datasets)})


@lru_cache(maxsize=1)
def _read(path: Path, _changed: int) -> Any:
    """Return what is noted of each dataset; raises ValueError for a file that is damaged."""
    content = json.loads(path.read_bytes())
    if content.get("sha256") != _digest(content.get("datasets")):
        raise ValueError(f"{path}: is damaged")
    return {
        name: {key: int(entry[key]) for key in ("views", "shards")}
        for name, entry in content["datasets"].items()
    }


def _digest(datasets: Any) -> str:
    return hashlib.sha256(json.dumps(datasets, sort_keys=True).encode()).hexdigest()
