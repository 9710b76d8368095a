"""Reads WebDataset shards as datasets: finds each view's files by the JSON of its sample."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import reading
from lightfield.formats import passes
from lightfield.formats.layout import IMAGES, OTHER_FILES, SUMS, read_sums
from lightfield.formats.lightfield import NAME, OMNIDIRECTIONAL
from lightfield.formats.passes import FLOW
from lightfield.reading.files import Packed, PackedFile, members_of

# The keys of lightfield.json that a sample's JSON has of each picture.
_OF_LENS = ("camera", "resolution", "sensor_size", "depth", OMNIDIRECTIONAL)
# The keys of a sample of a family that corpus.json has, too.
_OF_MEMBER = ("values", "split")


# A shard's name: garden_ring-train-00000.tar.
_NUMBERED = re.compile(r"(.+-)(\d+)\.tar")


@dataclass
class _ShownViews:
    """The views of one lightfield.json, as far as the shards have them."""

    content: dict[str, Any] = field(default_factory=dict)
    frames: dict[str, dict[str, Any]] = field(default_factory=dict)
    passes: set[str] = field(default_factory=set)

    def to_json(self) -> dict[str, Any]:
        names = [name for name in self.passes if name != FLOW.name]
        return {**self.content, "passes": sorted(names), "frames": [*self.frames.values()]}


@dataclass
class _DatasetInShards:
    """A dataset in shards: its files, its lightfield.jsons by their folders, and its member."""

    contents: dict[str, PackedFile | bytes] = field(default_factory=dict)
    shown: dict[str, _ShownViews] = field(default_factory=dict)
    member: dict[str, Any] = field(default_factory=dict)


def check_complete(shards: Iterable[Path]) -> None:
    """Raise `UserError` if shards are missing in the folders of these ``shards``.

    The checksums of published shards, and of a family, list all of them. Without checksums, the
    shards of a run are numbered from 0 without gaps.
    """
    names: dict[Path, set[str]] = {}
    for shard in shards:
        names.setdefault(shard.parent, set()).add(shard.name)
    for folder, present in names.items():
        if missing := sorted(_expected(folder, present) - present):
            raise UserError(
                f"{folder}: misses {', '.join(missing)}; copy them, or open the others by their "
                "names"
            )


def _expected(folder: Path, present: Iterable[str]) -> set[str]:
    """Return the names of the shards that must lie beside those ``present``."""
    expected = set()
    for name in {*present, *_listed(folder)}:
        if shard := _NUMBERED.fullmatch(name):
            run, last = shard.groups()
            expected |= {f"{run}{number:0{len(last)}}.tar" for number in range(int(last) + 1)}
    return expected


def _listed(folder: Path) -> Iterator[str]:
    """Yield the names of the files in ``folder`` that checksums list.

    Published shards have their checksums beside them, and a family has them above shards/<part>.
    """
    for sums in (folder / SUMS, folder.parent.parent / SUMS):
        if sums.is_file():
            with reading(sums, "list of checksums"):
                paths = [sums.parent / name for name in read_sums(sums)]
            yield from (path.name for path in paths if path.parent == folder)


def read_shards(
    path: Path, shards: Mapping[Path, Mapping[str, PackedFile]]
) -> list[tuple[Packed, dict[str, Any]]]:
    """Return the files of each dataset in ``shards``, and what is known of its member of a family.

    Published shards are of one dataset, and the shards of a family of many. The files of no single
    view are taken from the tar that lies beside published shards. Without that tar, the samples
    give each lightfield.json.
    """
    datasets: dict[str, _DatasetInShards] = {}
    for archive, members in shards.items():
        for name in members:
            if name.endswith(".json") and name.count(".") == 1:
                with reading(archive / name, "sample"):
                    _add_sample(datasets, name.removesuffix(".json"), members)
    others = _others(archive.parent / OTHER_FILES for archive in shards)
    for dataset in datasets.values():
        if not dataset.member:
            # Of the frames of a sequence, the shards may have only some.
            dataset.contents |= {
                name: file for name, file in others.items() if PurePosixPath(name).name != NAME
            }
        for folder, shown in dataset.shown.items():
            name = str(PurePosixPath(folder, NAME))
            content = shown.to_json()
            if name in others:
                with reading(others[name].archive / name, NAME):
                    content = json.loads(others[name].read())
                    frames = [each for each in content["frames"] if each["name"] in shown.frames]
                    content |= {"frames": frames}
            dataset.contents[name] = json.dumps(content).encode()
    return [(Packed(path, each.contents), each.member) for each in datasets.values()]


def _others(archives: Iterable[Path]) -> dict[str, PackedFile]:
    """Return the files of no single view, by their names in the dataset."""
    others: dict[str, PackedFile] = {}
    for archive in {*archives}:
        if archive.is_file():
            others |= {name.partition("/")[2]: file for name, file in members_of(archive).items()}
    return others


def _add_sample(
    datasets: dict[str, _DatasetInShards], key: str, members: Mapping[str, PackedFile]
) -> None:
    """Add the pictures of a sample to its dataset."""
    sample = json.loads(members[f"{key}.json"].read())
    is_of_family = "member" in sample
    name = f"{sample['member']}/{sample['rig']}" if is_of_family else ""
    dataset = datasets.setdefault(name, _DatasetInShards())
    frame = "" if is_of_family else key.removesuffix(sample["view"].replace(".", "_")).rstrip("_")
    if is_of_family:
        dataset.member = {"name": sample["member"], **{k: sample[k] for k in _OF_MEMBER}}
    split = sample["view_split" if is_of_family else "split"]
    for suffix, picture in sample["pictures"].items():
        path = PurePosixPath(frame, picture["path"])
        dataset.contents[str(path)] = members[f"{key}.{suffix}"]
        _add_picture(dataset, frame, sample["view"], split, picture)


def _add_picture(
    dataset: _DatasetInShards, frame: str, view: str, split: str, picture: Mapping[str, Any]
) -> None:
    """Add a picture's view to the lightfield.json of its folder."""
    path = PurePosixPath(picture["path"])
    folders = [folder for folder in path.parent.parts if folder != IMAGES]
    view_pass = folders.pop() if folders and _is_pass(folders[-1]) else None
    shown = dataset.shown.setdefault(str(PurePosixPath(frame, *folders)), _ShownViews())
    shown.content |= {key: picture[key] for key in _OF_LENS if key in picture}
    name = view if view_pass == FLOW.name else path.stem
    pose = {"name": name, "world_matrix": picture["world_matrix"], "split": split}
    shown_frame = shown.frames.setdefault(name, pose)
    if view_pass:
        shown.passes.add(view_pass)
    if view_pass == FLOW.name:
        shown_frame["flow"] = path.stem.removeprefix(f"{view}_to_")


def _is_pass(folder: str) -> bool:
    try:
        return folder == FLOW.name or bool(passes.by_name(folder))
    except KeyError:
        return False
