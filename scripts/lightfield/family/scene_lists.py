"""Writes the lists with which feed-forward trainers find the exports of a corpus's members."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, read_keys, reading, write_bytes
from lightfield.core.names import CORPUS, PARTS
from lightfield.core.paths import inside
from lightfield.core.units import count
from lightfield.exporters import list_path
from lightfield.exporters.dust3r import PAIRS
from lightfield.formats import npz
from lightfield.stages.family import ListScenes

# The trainers' names of the parts.
_NAMES = {"train": "train", "validation": "val", "test": "test"}


def write(job: ListScenes) -> None:
    """Write the lists of each part that has such exports, and say how many exports they have.

    Raises `UserError` if no member has such an export.
    """
    corpus = absolute_path(job.corpus)
    content = read_keys(corpus / CORPUS, "corpus.py", "name", "members")
    numbers = [_write_part(job.output, corpus, content, part) for part in PARTS]
    if not any(numbers):
        raise UserError(
            f"{corpus}: no valid member has an export for these trainers; give the scene YAML "
            "exports: wai, or exports: dust3r"
        )
    parts = zip(PARTS, numbers, strict=True)
    print(", ".join(f"{part}: {count(number, 'export')}" for part, number in parts))


def _write_part(output: Path, corpus: Path, content: dict[str, Any], part: str) -> int:
    """Write the lists of one part of the split. Return the number of exports in them."""
    datasets = _datasets(corpus, content["members"], part)
    folder = output / _NAMES[part]
    scenes = [path.relative_to(corpus).as_posix() for path in _exports(datasets, "wai")]
    if scenes:
        path = folder / f"{content['name']}_scene_list_{_NAMES[part]}.npy"
        write_bytes(path, npz.npy(np.array(scenes)))
    exports = list(_exports(datasets, "dust3r"))
    if exports:
        npz.write(folder / PAIRS, _joined(exports, absolute_path(folder)))
    return len(scenes) + len(exports)


def _datasets(corpus: Path, members: Sequence[dict[str, Any]], part: str) -> list[Path]:
    """Return the folders of the datasets of a part's valid members."""
    with reading(corpus / CORPUS, "corpus"):
        return [
            inside(corpus, f"{member['name']}/{rig}", f"{corpus / CORPUS}: members")
            for member in members
            if member["split"] == part and member["state"] == "valid"
            for rig in member["datasets"]
        ]


def _exports(datasets: Iterable[Path], name: str) -> Iterable[Path]:
    """Yield the folders of an export: of views, reprojections, and the frames of a sequence."""
    for dataset in datasets:
        for depth in ("", "*/", "*/*/"):
            yield from (path.parent for path in sorted(dataset.glob(depth + list_path(name))))


def _joined(exports: Sequence[Path], folder: Path) -> dict[str, NDArray[Any]]:
    """Return the pairs of several exports as one list. Scenes are paths from ``folder``."""
    joined: dict[str, list[NDArray[Any]]] = {}
    scenes = frames = 0
    for export in exports:
        data = npz.read(export / PAIRS)
        with reading(export / PAIRS, "list of pairs"):
            paths = [os.path.relpath(export / scene, folder) for scene in data["scenes"].tolist()]
            pairs = data["pairs"] + [scenes, frames, frames]
            arrays = data | {"scenes": np.array(paths), "pairs": pairs}
            for name in ("scenes", "frames", "pairs", "scores"):
                joined.setdefault(name, []).append(arrays[name])
        scenes += len(paths)
        frames += len(arrays["frames"])
    return {name: np.concatenate(parts) for name, parts in joined.items()}
