"""Writes a finished dataset as WebDataset shards: tars in which each view is a sample.

A sample's members follow each other, and share their names up to the first dot:
view_0000f.views.exr is the view, view_0000f.normal.exr its pass, view_0000f.perspective.png its
reprojection, and view_0000f.json has the pose and the camera of each. view_0000f.thumbnail.jpg is a
small picture of the view. What belongs to no view is in a tar of its own. Equal datasets give equal
bytes.
"""

import json
import tarfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, write_csv
from lightfield.core.names import PARTS, VIEWS
from lightfield.core.progress import Progress
from lightfield.formats.layout import (
    OTHER_FILES,
    SUMS,
    File,
    ImageSet,
    pass_files,
    read_set,
    read_sums,
    source_view,
    view_files,
)
from lightfield.formats.lightfield import NAME, OMNIDIRECTIONAL
from lightfield.imaging.look import Look
from lightfield.publishing import thumbnails
from lightfield.publishing.package import TAR_END, add_entry, tar_size

# A shard's size without a size in the settings. WebDataset advises about this.
SHARD_BYTES = 1e9
INDEX = "views.csv"
# The member of a sample that is a small picture of its view.
THUMBNAIL = "thumbnail.jpg"
_VIEW = f"{VIEWS}.exr"


@dataclass
class Sample:
    """A view with all its pictures.

    ``files`` has the path of each by its field, such as normal.exr. ``content`` is the JSON.
    ``thumbnail`` is a small picture of the view, or empty.
    """

    key: str
    split: str
    content: dict[str, Any]
    files: dict[str, Path] = field(default_factory=dict)
    thumbnail: bytes = b""

    @property
    def members(self) -> Iterator[tuple[str, Path | bytes]]:
        """The members of the tar: their names, and their files or contents."""
        yield f"{self.key}.json", self.text
        for name, path in sorted(self.files.items()):
            yield f"{self.key}.{name}", path
        if self.thumbnail:
            yield f"{self.key}.{THUMBNAIL}", self.thumbnail

    @property
    def text(self) -> bytes:
        """The JSON."""
        return (json.dumps(self.content, indent=1) + "\n").encode()

    @property
    def tar_bytes(self) -> int:
        """The most bytes that it takes in a tar."""
        contents = (
            len(content) if isinstance(content, bytes) else content.stat().st_size
            for _, content in self.members
        )
        return sum(map(tar_size, contents))


class InTar(Protocol):
    """What a tar holds, a sample, by its size."""

    @property
    def tar_bytes(self) -> int:
        """The most bytes that it takes in a tar."""


OfTar = TypeVar("OfTar", bound=InTar)


@dataclass(frozen=True)
class DatasetFiles:
    """A finished dataset, or a frame of a sequence: its samples, and its files without a view.

    The ``others`` have their paths in the package. The exports of a whole sequence have no samples.
    """

    samples: Sequence[Sample]
    others: Mapping[str, Path]


def read_dataset(root: Path, folder: Path) -> DatasetFiles:
    """Read the dataset in a ``folder`` that is the package's ``root``, or lies in it.

    Names and checksums come from sha256sums.txt. Raises `UserError` without that file.
    """
    if not (folder / SUMS).is_file():
        raise UserError(f"{folder / SUMS}: is missing; only a valid dataset can be published")
    sums = read_sums(folder / SUMS)
    if folder == root and NAME not in sums:
        return DatasetFiles([], _others(root, folder, [*sums, SUMS]))
    reprojections = sorted(Path(name).parent.name for name in sums if name.endswith(f"/{NAME}"))
    source = read_set(folder, "")
    sets = [source]
    for name in reprojections:
        if f"{name}/{NAME}" in sums:
            sets.append(read_set(folder, name, source))
    prefix = "_".join(folder.relative_to(root).parts)
    samples = [_sample(source, number, prefix) for number in range(len(source.views))]
    files = []
    for number, image_set in enumerate(sets):
        files += view_files(folder, image_set, number)[0]
    for file in [*files, *pass_files(folder, sets)[0]]:
        _add_file(samples, source, sets[file.set], file, folder, sums)
    sample_files = {path for sample in samples for path in sample.files.values()}
    names = [name for name in (*sums, SUMS) if folder / name not in sample_files]
    return DatasetFiles(samples, _others(root, folder, names))


def _others(root: Path, folder: Path, names: Iterable[str]) -> dict[str, Path]:
    """Return files of a ``folder`` by their paths in the package's ``root``."""
    return {(folder / name).relative_to(root).as_posix(): folder / name for name in names}


def _sample(source: ImageSet, number: int, prefix: str) -> Sample:
    view = source.lightfield.views[number]
    # A dot would end the key.
    key = "_".join(filter(None, [prefix, view.name])).replace(".", "_")
    # Without a split, all views may train.
    split = view.split or "train"
    if split not in PARTS:
        parts = ", ".join(PARTS)
        raise UserError(
            f"{source.lightfield.path}: {view.name}: split: is {split!r}; must be {parts}"
        )
    content = {"view": view.name, "split": split, "pictures": {}}
    return Sample(key, split, content)


def _add_file(
    samples: Sequence[Sample],
    source: ImageSet,
    image_set: ImageSet,
    file: File,
    folder: Path,
    sums: Mapping[str, str],
) -> None:
    """Add a picture to the sample of the view that it shows, with its camera and checksum."""
    lightfield = image_set.lightfield
    view = lightfield.views[file.view]
    number = source_view(source, view.name)
    if number is None:
        raise UserError(f"{folder / file.path}: shows no view of {folder / NAME}")
    face = view.name.removeprefix(source.views[number]).lstrip("_")
    parts = [image_set.name, face, file.of_pass.name if file.of_pass else ""]
    # No name has a plus sign, and without dots each pattern *.name.exr finds one kind of member.
    stem = "+".join(filter(None, parts)).replace(".", "_") or VIEWS
    name = stem + Path(file.path).suffix
    sample = samples[number]
    if name in sample.files:
        raise UserError(f"{folder}: {file.path} and {sample.files[name]} would both be {name}")
    sample.files[name] = folder / file.path
    sample.content["pictures"][name] = {
        "path": file.path,
        "sha256": sums.get(file.path),
        "camera": lightfield.content["camera"],
        "resolution": lightfield.content["resolution"],
        "sensor_size": lightfield.content["sensor_size"],
        "depth": lightfield.depth,
        "world_matrix": view.world_from_camera.tolist(),
        # Without a centre, the rays do not follow from camera and matrix alone.
        **{key: lightfield.content[key] for key in {OMNIDIRECTIONAL} & lightfield.content.keys()},
    }


def write_shards(
    output: Path,
    name: str,
    datasets: Sequence[DatasetFiles],
    most: float,
    look: Look | None = None,
) -> dict[str, list[Path]]:
    """Write the samples as tars of at most ``most`` bytes. Return the tars of each split.

    Each sample has a thumbnail, which Hugging Face's viewer shows
    (huggingface.co/docs/hub/datasets-webdataset). It is made only when its tar is written,
    with the ``look`` if there is one.
    `INDEX` beside them says which tar has which view. A larger sample has a tar of its own. Removes
    tars of an earlier publication. Raises `UserError` if two views have the same key.
    """
    samples = [sample for dataset in datasets for sample in dataset.samples]
    for key, count in Counter(sample.key for sample in samples).items():
        if count > 1:
            raise UserError(f"{output}: {count} views have the key {key} in shards; rename them")
    for old in output.glob("*.tar"):
        old.unlink()
    exposure = thumbnails.exposure_of([sample.files[_VIEW] for sample in samples], look)
    progress = Progress(len(samples), name, "views")
    shards: dict[str, list[Path]] = {}
    rows = []
    for split in PARTS:
        of_split = (
            replace(sample, thumbnail=thumbnails.jpeg(sample.files[_VIEW], exposure, look))
            for sample in samples
            if sample.split == split
        )
        for number, part in enumerate(parts(of_split, most)):
            # mlcroissant takes tars with equal names for one, even of different datasets.
            path = output / f"{name}-{split}-{number:05}.tar"
            write_tar(path, (member for sample in part for member in sample.members))
            shards.setdefault(split, []).append(path)
            for sample in part:
                rows.append(
                    {
                        "sample": sample.key,
                        "view": sample.content["view"],
                        "split": split,
                        "shard": path.name,
                    }
                )
                progress.done()
    write_csv(output / INDEX, rows)
    return shards


def write_others(output: Path, name: str, datasets: Sequence[DatasetFiles]) -> Path:
    """Write all files without a view as a tar that unpacks to the folder ``name``."""
    path = output / OTHER_FILES
    files = {inside: file for dataset in datasets for inside, file in dataset.others.items()}
    write_tar(path, ((f"{name}/{inside}", files[inside]) for inside in sorted(files)))
    return path


def parts(samples: Iterable[OfTar], most: float) -> Iterator[list[OfTar]]:
    """Yield runs of samples whose tar has at most ``most`` bytes. A larger sample is alone."""
    part: list[OfTar] = []
    size = float(TAR_END)
    for sample in samples:
        needed = sample.tar_bytes
        if part and size + needed > most:
            yield part
            part = []
            size = TAR_END
        part.append(sample)
        size += needed
    if part:
        yield part


def write_tar(path: Path, members: Iterable[tuple[str, Path | bytes]]) -> None:
    """Write a tar of members, atomically: their names, and their files or contents."""
    with atomic_path(path) as temporary, tarfile.open(temporary, "w") as archive:
        for name, content in members:
            add_entry(archive, name, content)
