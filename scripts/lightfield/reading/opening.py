"""Finds the datasets at a path: a rig's folder, a package, shards, or many of them."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, reading
from lightfield.core.names import CORPUS, PARTS
from lightfield.core.paths import case_hint, inside
from lightfield.formats.layout import (
    CARD,
    FRAME_FOLDERS,
    OTHER_FILES,
    SUMS,
    frame_number,
    frame_times,
    further_parts,
    read_sums,
)
from lightfield.formats.lightfield import NAME
from lightfield.reading.dataset import OpenDataset
from lightfield.reading.files import Files, Folder, Packed, PackedFile, members_of
from lightfield.reading.shards import check_complete, read_shards

# A run of shards: garden_ring-train-{00000..00009}.tar.
_RUN = re.compile(r"\{(\d+)\.\.(\d+)\}")
# A part of a package after the first: garden_ring.2.tar.
_FURTHER_PART = re.compile(r"(.+)\.\d+\.tar")


def open_dataset(path: str | os.PathLike[str]) -> OpenDataset:
    """Open the dataset at ``path``. It is one of:

    - the folder of a rig, of a sequence, or of a dataset that SILVR's tools wrote;
    - the .tar of a package. Further parts are found beside it;
    - a folder of WebDataset shards, one shard, or a run of shards such as ``x-{00000..00009}.tar``.

    Raises `UserError`, an exception of one line, if there is no dataset, or more than one, and if
    shards or parts of a package are missing.
    """
    datasets = open_corpus(path)
    if len(datasets) > 1:
        raise UserError(f"{path}: has {len(datasets)} datasets; open_corpus returns them as a list")
    # Read it now, so that a mistake in it is found here.
    datasets[0].lightfield  # noqa: B018
    return datasets[0]


def open_corpus(path: str | os.PathLike[str]) -> list[OpenDataset]:
    """Open all datasets at ``path``: of a family, of a scene's rigs, or of a folder of packages.

    ``member`` of a family's dataset has what its corpus.json says of the scene. Takes all that
    `open_dataset` takes, too, and a family's folder ``shards``. Raises `UserError` if there is no
    dataset, and if shards or parts of a package are missing.
    """
    # Files are read later, when the program may have changed its directory.
    path = Path(path).absolute()
    if path.is_dir():
        datasets = _in_folder(path)
    elif run := _RUN.search(path.name):
        datasets = _in_tars(path, _shards_of_run(path, *run.groups()))
    elif not path.exists():
        raise UserError(f"{path}: is not there{case_hint(path)}")
    elif path.suffix == ".tar":
        datasets = _in_tars(path, [path])
    else:
        raise UserError(f"{path}: must be the folder of a dataset, or a .tar")
    if not datasets:
        raise UserError(
            f"{path}: has no {NAME}; open the folder of a dataset, the first .tar of a package, or "
            "shards"
        )
    return datasets


def _in_folder(folder: Path) -> list[OpenDataset]:
    if own := _dataset(Folder(folder)):
        return [own]
    if (folder / CORPUS).is_file():
        return _members(folder)
    rigs = [_dataset(Folder(path)) for path in sorted(folder.iterdir()) if path.is_dir()]
    if datasets := [rig for rig in rigs if rig]:
        return datasets
    # The shards of a family have a folder for each part of the split.
    tars = sorted(folder.glob("*.tar")) or [
        tar for part in PARTS for tar in sorted(folder.glob(f"{part}/*.tar"))
    ]
    return _in_tars(folder, [tar for tar in tars if tar.name != OTHER_FILES]) if tars else []


def _shards_of_run(path: Path, first: str, last: str) -> list[Path]:
    """Return the shards of a run. Raises `UserError` if some of them are missing."""
    numbers = (f"{number:0{len(first)}d}" for number in range(int(first), int(last) + 1))
    shards = [path.with_name(_RUN.sub(number, path.name)) for number in numbers]
    if missing := [shard.name for shard in shards if not shard.exists()]:
        raise UserError(f"{path}: misses {', '.join(missing)}; copy them to {path.parent}")
    return shards


def _members(family: Path) -> list[OpenDataset]:
    """Return the datasets of a family's valid members."""
    datasets = []
    content = read_keys(family / CORPUS, "corpus.py", "members")
    with reading(family / CORPUS, "corpus"):
        for entry in content["members"]:
            for rig in entry["datasets"] if entry["state"] == "valid" else ():
                name = f"{entry['name']}/{rig}"
                files = Folder(inside(family, name, f"{family / CORPUS}: {name}"))
                datasets.append(_dataset(files, entry) or OpenDataset(files, member=entry))
    return datasets


def _dataset(files: Files, member: dict[str, object] | None = None) -> OpenDataset | None:
    """Return the dataset of these files, or the sequence. None if they have no lightfield.json."""
    if files.has(NAME):
        return OpenDataset(files, member=member or {})
    folders = sorted(files.datasets_in("", FRAME_FOLDERS), key=frame_number)
    if not folders:
        return None
    times = frame_times([frame_number(folder) for folder in folders])
    return OpenDataset(files, tuple(folders), tuple(times), member=member or {})


def _in_tars(path: Path, archives: Sequence[Path]) -> list[OpenDataset]:
    """Return the datasets in packages or in shards. ``path`` is what the user opened."""
    parts_of_package = {archive: further_parts(archive) for archive in archives}
    further = [part for parts in parts_of_package.values() for part in parts]
    members = {archive: members_of(archive) for archive in {*archives, *further}}
    # The files of a package lie in its folder, and the files of a shard in none.
    if any("/" in name for name in members[archives[0]]):
        packages = [
            _package([archive, *parts_of_package[archive]], members)
            for archive in archives
            if archive not in further
        ]
        datasets = [_dataset(package) for package in packages]
    else:
        if path.is_dir():
            check_complete(archives)
        shards = {archive: members[archive] for archive in archives}
        datasets = [_dataset(files, member) for files, member in read_shards(path, shards)]
    return [dataset for dataset in datasets if dataset]


def _package(parts: Sequence[Path], members: Mapping[Path, Mapping[str, PackedFile]]) -> Packed:
    """Return the files of a package of these parts, without the folder that it unpacks to.

    Raises `UserError` if parts are missing.
    """
    contents = {
        name.partition("/")[2]: file for part in parts for name, file in members[part].items()
    }
    package = Packed(parts[0], contents)
    if CARD in contents:
        _check_parts(parts, package)
    elif further_part := _FURTHER_PART.fullmatch(parts[0].name):
        raise UserError(f"{parts[0]}: open the first .tar of the package, {further_part[1]}.tar")
    return package


def _check_parts(parts: Sequence[Path], package: Packed) -> None:
    """Raise `UserError` if a package lacks a part, or files that its checksums name."""
    first, *further = parts
    names = {part.name for part in further}
    numbers = [int(name.split(".")[-2]) for name in names]
    expected = [f"{first.stem}.{number}.tar" for number in range(2, max(numbers, default=1))]
    if missing := [name for name in expected if name not in names]:
        raise UserError(f"{first}: misses {', '.join(missing)}; copy them to {first.parent}")
    lost_files = sorted(_listed_files(package) - package.contents.keys())
    if lost_files:
        raise UserError(
            f"{first}: misses {units.count(len(lost_files), 'file')}, such as {lost_files[0]}; "
            f"copy all parts of the package to {first.parent}"
        )


def _listed_files(package: Packed) -> set[str]:
    """Return the files that must be in a package: checksums, and the files that they list."""
    with package.on_disk(CARD) as file:
        content = read_keys(file, "package.py")
    folders = content.get("frames", [""])
    files = {str(PurePosixPath(folder, SUMS)) for folder in folders}
    for sums in files & package.contents.keys():
        with package.on_disk(sums) as file, reading(file, "list of checksums"):
            files |= {str(PurePosixPath(sums).parent / name) for name in read_sums(file)}
    return files
