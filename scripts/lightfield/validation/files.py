"""Checks which files a dataset has: none of its own is missing, and no other is there.

A dataset is a folder with lightfield.json, exr/<view>.exr, and reprojections, each a folder with
its own lightfield.json and images.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, set_aside, sha256, write_text
from lightfield.dataset.dataset_paths import REPORT_FILES
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.dataset.passes import FLOW, NAMES, Pass
from lightfield.geometry import rotations
from lightfield.geometry.lenses import Lens
from lightfield.validation.consistency import Camera
from lightfield.validation.result import Check

IMAGES = "exr"
"""The folder of a dataset's own views."""

SUMS = "sha256sums.txt"
"""The checksums in a dataset: only a valid one has them."""

OUTPUTS = ("validation.json", SUMS)
"""The files in a dataset that say what came out of its validation."""

REPORT = "report"
"""The folder in a dataset that is not published with it."""

README, CARD = "README.md", "card.json"
"""What a package adds to a dataset."""

BESIDE = "{view}_depth.png"
"""The picture beside a view that scripts/reproject.py makes with --depth-png."""


@dataclass(frozen=True)
class Manifest:
    """How to find the files of one kind of export, so that they are published and checked.

    - ``lists``: a pattern for the export's lists, which are files beside a lightfield.json.
    - ``pictures``: reads a list, and returns the paths, relative to it, of images that have the
      size of the views. It raises `UserError` for a file that is no such list.
    - ``beside``: names, with ``{view}``, of images of that size that may lie beside the views and
      beside those pictures.
    - ``files``: returns the SHA-256 of every file of the export, if its list has them.
    """

    lists: str
    pictures: Callable[[Path], Sequence[str]]
    beside: tuple[str, ...] = ()
    files: Callable[[Path], Mapping[str, str]] = lambda _: {}


@dataclass(frozen=True, eq=False)
class ImageSet:
    """The views of one lightfield.json: the dataset's own (``name`` "") or a reprojection's.

    ``grain`` is the angle in radians between the pixels at the centre of the views from which these
    were reprojected, 0 for rendered views.
    """

    name: str
    lightfield: LightField
    grain: float

    @property
    def folder(self) -> str:
        """The folder of its images, relative to the dataset."""
        return self.name or IMAGES

    @property
    def prefix(self) -> str:
        """The prefix of its files' paths and of its checks' names."""
        return f"{self.name}/" if self.name else ""

    @cached_property
    def views(self) -> list[str]:
        return [view.name for view in self.lightfield.views]

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The positions of its views by their names."""
        return {name: number for number, name in enumerate(self.views)}

    def camera(self, view: int) -> Camera:
        depth = self.lightfield.depth
        assert depth is not None
        return Camera(self.lightfield.lens, self.lightfield.matrices[view], depth, self.grain)


@dataclass(frozen=True)
class File:
    """An image file: its ``path`` relative to the dataset, its set, and its view.

    What is no view (a mask, a depth map, a picture for a trainer) has ``view`` −1, and has only to
    be readable and of its set's size. ``of_pass`` is the pass that it holds of a view.
    """

    path: str
    set: int
    view: int = -1
    of_pass: Pass | None = None


def read_sets(dataset: Path, reprojections: Iterable[str]) -> tuple[list[ImageSet], list[Check]]:
    """Read every lightfield.json. Return the sets that could be read, and a check of each."""
    sets: list[ImageSet] = []
    checks = []
    for name in ("", *reprojections):
        path = dataset / name / NAME
        try:
            lightfield = LightField.read(path)
        except UserError as error:
            problem = str(error).replace(f"{dataset}/", "")
            check = f"{name}/lightfield".removeprefix("/")
            checks.append(Check(check, False, "cannot be understood", problems=[problem]))
            continue
        source = rendered(sets)
        sets.append(
            ImageSet(name, lightfield, _central_angle(source.lightfield.lens) if source else 0.0)
        )
        checks.append(_poses(sets[-1], source))
    return sets, checks


def rendered(sets: Sequence[ImageSet]) -> ImageSet | None:
    """Return the set of the rendered views, or None if its lightfield.json could not be read."""
    return sets[0] if sets and not sets[0].name else None


def source_view(source: ImageSet | None, name: str) -> int | None:
    """Return the number of the view from which the reprojected view ``name`` was made."""
    numbers = source.numbers if source else {}
    # A face of a cube map is named for its view, and itself.
    return numbers.get(name, numbers.get(name.rpartition("_")[0]))


def _poses(image_set: ImageSet, source: ImageSet | None) -> Check:
    """Check that each pose is rigid, the same in both forms, and at its source's place."""
    views = image_set.lightfield.views
    # Blender keeps poses in float32.
    near = 1e-5 * (1 + max(np.abs(view.position).max() for view in views))
    faults = {}
    for view in views:
        difference = (
            np.abs(rotations.euler_to_matrix(view.rotation) - view.matrix[:3, :3]).max()
            + np.abs(view.position - view.matrix[:3, 3]).max()
            + np.abs(view.matrix[3] - (0, 0, 0, 1)).max()
        )
        if not difference < near:
            faults[view.name] = "world_matrix: is not that of its position and rotation"
        elif source:
            number = source_view(source, view.name)
            if number is None:
                faults[view.name] = f"is made of no view of the dataset's {NAME}"
            elif np.abs(view.position - source.lightfield.views[number].position).max() > near:
                faults[view.name] = f"is not at the place of {source.views[number]}"
    path = f"{image_set.prefix}{NAME}"
    return Check(
        f"{image_set.prefix}lightfield",
        not faults,
        f"{len(views)} views",
        [*faults],
        [f"{path}: frames: {view}: {fault}" for view, fault in faults.items()],
    )


def _central_angle(lens: Lens) -> float:
    """Return the angle in radians between two pixels in the middle of the image."""
    x = np.array([lens.width - 1, lens.width + 1]) / 2
    one, other = lens.rays(x, np.full(2, lens.height / 2))
    return float(np.arccos(np.clip(one @ other, -1.0, 1.0)))


def of_views(dataset: Path, sets: Sequence[ImageSet]) -> tuple[list[File], list[Check]]:
    """Return the files of the views that exist, and for each set a check that none is missing.

    A reprojection is EXR, PNG or both. A format that it has of one view, it must have of all.
    """
    files: list[File] = []
    checks = []
    for number, image_set in enumerate(sets):
        present = _files(dataset / image_set.folder)
        formats = [
            suffix
            for suffix in ((".exr", ".png") if image_set.name else (".exr",))
            if any(view + suffix in present for view in image_set.views)
        ]
        paths = [
            (view, f"{image_set.folder}/{name}{suffix}")
            for suffix in formats or [".exr"]
            for view, name in enumerate(image_set.views)
        ]
        set_files = [File(path, number, view) for view, path in paths if Path(path).name in present]
        missing = {path: "is missing" for _, path in paths if Path(path).name not in present}
        detail = f"{len(set_files)} of {len(paths)} images are there"
        checks.append(Check.of_files(f"{image_set.prefix}views", missing, detail))
        files += set_files
    return files, checks


def _files(folder: Path) -> set[str]:
    """Return the names of the files in a folder."""
    return {path.name for path in folder.glob("*") if path.is_file()}


def of_passes(dataset: Path, sets: Sequence[ImageSet]) -> tuple[list[File], dict[str, str]]:
    """Return the files of passes and flow that exist, and by path what is wrong with the others."""
    files = _of_passes(sets)
    present = [file for file in files if (dataset / file.path).is_file()]
    missing = {file.path for file in files} - {file.path for file in present}
    return present, dict.fromkeys(sorted(missing), "is missing")


def _of_passes(sets: Sequence[ImageSet]) -> list[File]:
    return [
        File(view_pass.path(Path(image_set.name), name).as_posix(), number, index, view_pass)
        for number, image_set in enumerate(sets)
        for index, view in enumerate(image_set.lightfield.views)
        for view_pass, name in (
            *((view_pass, view.name) for view_pass in image_set.lightfield.passes),
            *([(FLOW, view.flow)] if view.flow else []),
        )
    ]


def names(sets: Sequence[ImageSet]) -> list[str]:
    """Return the paths of the files that name what the passes of a dataset number."""
    rendered_set = rendered(sets)
    passes = rendered_set.lightfield.passes if rendered_set else []
    return [f"{each.name}/{NAMES}" for each in passes if each.kind == "id"]


def lists_of(
    dataset: Path,
    image_set: ImageSet,
    manifest: Manifest,
    wanted: Collection[Path] | None = None,
) -> list[Path]:
    """Return a set's lists of one kind of export. ``wanted`` limits them, unless it is None."""
    lists = sorted((dataset / image_set.name).glob(manifest.lists))
    return [path for path in lists if wanted is None or path.resolve() in wanted]


def of_exports(
    dataset: Path,
    sets: Sequence[ImageSet],
    views: Iterable[File],
    manifests: Sequence[Manifest],
    wanted: Collection[Path] | None = None,
) -> tuple[list[File], list[str], Check]:
    """Return the pictures beside the views, the exports' other files, and a check of both.

    Only the ``wanted`` lists count; None takes all that exist.
    """
    pictures: dict[str, File] = {}
    lists: list[str] = []
    others: list[str] = []
    problems: list[str] = []
    for number, image_set in enumerate(sets):
        folders = {image_set.folder}
        patterns = [BESIDE]
        for manifest in manifests:
            taken = lists_of(dataset, image_set, manifest, wanted)
            patterns += manifest.beside if taken or wanted is None else ()
            for path in taken:
                lists.append(path.relative_to(dataset).as_posix())
                try:
                    named = manifest.pictures(path)
                    sums = manifest.files(path)
                except UserError as error:
                    problems.append(str(error).replace(f"{dataset}/", ""))
                    continue
                for name in named:
                    target = (path.parent / name).resolve()
                    if target.is_file() and target.is_relative_to(dataset):
                        relative = target.relative_to(dataset)
                        pictures[relative.as_posix()] = File(relative.as_posix(), number)
                        folders.add(relative.parent.as_posix())
                    else:
                        problems.append(f"{lists[-1]}: {name} is no file of the dataset")
                for name, digest in sums.items():
                    target = path.parent / name
                    if not target.resolve().is_relative_to(dataset) or not target.is_file():
                        problems.append(f"{lists[-1]}: {name} is no file of the dataset")
                    elif sha256(target) != digest:
                        problems.append(f"{target.relative_to(dataset)}: is not as it was exported")
                    else:
                        others.append(target.relative_to(dataset).as_posix())
        for folder in sorted(folders):
            present = _files(dataset / folder)
            for view in image_set.views:
                for name in (pattern.format(view=view) for pattern in patterns):
                    if name in present:
                        pictures[f"{folder}/{name}"] = File(f"{folder}/{name}", number)
    for file in views:
        pictures.pop(file.path, None)
    files = [file for _, file in sorted(pictures.items())]
    passed = not problems if lists or files else None
    detail = f"{len(lists)} lists of frames, {len(files)} pictures beside the views"
    return files, [*lists, *others], Check("exports", passed, detail, problems=problems)


def listing(
    dataset: Path, sets: Sequence[ImageSet], owned: Iterable[str]
) -> tuple[list[str], Check]:
    """Return the files that the dataset publishes, and a check that fails if there are others."""
    published, strays = _sorted_out(dataset, sets, owned)
    problems = [f"{path}: is no file of this dataset" for path in strays]
    return published, Check("files", not strays, f"{len(published)} files", problems=problems)


def _sorted_out(
    dataset: Path, sets: Sequence[ImageSet], owned: Iterable[str]
) -> tuple[list[str], list[str]]:
    """Return the files that the dataset publishes, and all others in its folder."""
    all_owned = {*owned, *(f"{image_set.prefix}{NAME}" for image_set in sets)}
    paths = [path.relative_to(dataset) for path in dataset.rglob("*") if path.is_file()]
    present = sorted(path.as_posix() for path in paths if path.parts[0] != REPORT)
    beside = (*OUTPUTS, README, CARD)
    strays = [path for path in present if path not in all_owned and path not in beside]
    return [path for path in present if path in all_owned], strays


def remove_strays(
    dataset: Path,
    reprojections: Sequence[str],
    manifests: Sequence[Manifest],
    folder: Path,
    wanted: Collection[Path] | None = None,
) -> int:
    """Move files that do not belong to the dataset into ``folder``. Return their number.

    Such files are views of a rig that had more cameras, former reprojections and exports, and what
    an older program drew for the report. Moves nothing if a lightfield.json or an export cannot be
    read. ``wanted`` is that of `of_exports`.
    """
    sets, _ = read_sets(dataset, reprojections)
    if len(sets) <= len(reprojections):
        return 0
    views, _ = of_views(dataset, sets)
    views += of_passes(dataset, sets)[0]
    extras, lists, exports = of_exports(dataset.resolve(), sets, views, manifests, wanted)
    if exports.passed is False:
        return 0
    owned = {*lists, *names(sets), *(file.path for file in [*views, *extras])}
    _, strays = _sorted_out(dataset, sets, owned)
    # Hidden files are being drawn at this moment.
    drawn = {path.name for path in (dataset / REPORT).glob("[!.]*")}
    strays += [f"{REPORT}/{name}" for name in sorted(drawn - {*REPORT_FILES})]
    for name in strays:
        set_aside(dataset / name, folder)
        for parent in (dataset / name).parents:
            if parent == dataset or any(parent.iterdir()):
                break
            parent.rmdir()
    return len(strays)


def checksums(
    recorded: Mapping[str, tuple[int, str]] | None,
    sums: Mapping[str, tuple[int, str]],
    sets: Sequence[ImageSet],
    altered_files: Mapping[str, str],
) -> Check:
    """Check that the images have the sizes and SHA-256 that their writers recorded.

    ``recorded`` and the actual sums are by path. The ``altered_files`` of the ledger fail, too.
    """
    if recorded is None and not altered_files:
        return Check("checksums", None, "no record was given")
    recorded = recorded or {}
    faults = dict(altered_files)
    for path, (size, digest) in sorted(recorded.items()):
        if path not in sums:
            faults[path] = "is recorded but is no image of this dataset"
        elif size != sums[path][0]:
            faults[path] = f"has {sums[path][0]} bytes, but its record says {size}"
        elif digest != sums[path][1]:
            faults[path] = f"has the sha256 {sums[path][1]}, but its record says {digest}"
    # Renderers record views and passes, but not masks and pictures for trainers.
    rendered_set = rendered(sets)
    views = rendered_set.views if rendered_set else []
    rendered_files = [f"{IMAGES}/{view}.exr" for view in views]
    rendered_files += [file.path for file in _of_passes(sets[:1])] if rendered_set else []
    for path in sorted(rendered_files):
        if path in sums and path not in recorded:
            faults[path] = "has no record"
    detail = f"{len(recorded)} of {len(sums)} images have a record"
    return Check.of_files("checksums", faults, detail)


def altered(published: Mapping[str, str], noted: Mapping[str, str]) -> dict[str, str]:
    """Return which published files changed since they were made, and how.

    Both arguments hold SHA-256 by path; ``noted`` is from when the files were made. Without this
    check, a damaged file would be published with a checksum of its damage.
    """
    return {
        path: f"has the sha256 {published[path]}, but {noted[path]} when it was made"
        for path in sorted(published.keys() & noted.keys())
        if published[path] != noted[path]
    }


def clearance(path: Path | None, sets: Sequence[ImageSet]) -> Check:
    """Check that no camera of the dataset is inside geometry."""
    if path is None:
        return Check("cameras", None, "no clearance was given")
    content = read_json(path)
    try:
        around = {
            str(name): (float(entry["distance"] or math.inf), bool(entry["inside"]))
            for name, entry in content["views"].items()
        }
    except (LookupError, TypeError, ValueError, AttributeError):
        raise UserError(f"{path}: views: must map names to distance and inside") from None
    rendered_set = rendered(sets)
    views = rendered_set.views if rendered_set else []
    faults = {}
    for view in views:
        if view not in around:
            faults[f"{IMAGES}/{view}.exr"] = "its clearance was not measured"
        elif around[view][1]:
            faults[f"{IMAGES}/{view}.exr"] = "its camera is inside geometry"
    nearest = min((around[view][0] for view in views if view in around), default=math.inf)
    detail = "nothing is near a camera"
    figures = {}
    if math.isfinite(nearest):
        detail = f"nothing is nearer to a camera than {nearest:.3g} m"
        figures = {"nearest_metres": round(nearest, 4)}
    return Check.of_files("cameras", faults, detail, figures=figures)


def read_sums(path: Path) -> dict[str, str]:
    """Return the SHA-256 of each file that a sha256sums.txt names below its own folder."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {
        name: digest
        for digest, _, name in (line.partition("  ") for line in lines)
        if name and ".." not in name.split("/") and not name.startswith("/")
    }


def write_sums(path: Path, checksums: Mapping[str, str], dataset: Path, result: Path) -> None:
    """Write ``checksums`` as sha256sum does, with that of ``result`` if the dataset holds it."""
    sums = dict(checksums)
    if result.resolve().is_relative_to(dataset.resolve()):
        sums[result.resolve().relative_to(dataset.resolve()).as_posix()] = sha256(result)
    write_text(path, "".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items())))
