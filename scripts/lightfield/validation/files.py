"""Checks a dataset's files: none is missing, and no foreign file lies among them.

A dataset is a folder with lightfield.json, exr/<view>.exr, and reprojections. Each reprojection is
a folder with its own lightfield.json and images.
"""

import math
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lightfield.configuration.dataset_paths import REPORT_FILES
from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, read_json, set_aside, sha256
from lightfield.core.names import PARTS
from lightfield.core.paths import (
    files_below,
    kept_behind_link,
    leads_inside,
    link_above,
    stray_places,
)
from lightfield.engine.receipts import Output
from lightfield.exporters import MANIFESTS
from lightfield.formats.layout import (
    DEPTH_PICTURE,
    IMAGES,
    OUTPUTS,
    PACKAGED,
    REPORT,
    File,
    ImageSet,
    Manifest,
    expected_pass_files,
    file_names,
    pass_files,
    read_set,
    rendered,
    side_files,
    source_view,
    view_files,
)
from lightfield.formats.lightfield import NAME, View
from lightfield.formats.sensors import (
    BRACKET_FILES,
)
from lightfield.geometry import rotations
from lightfield.geometry.exposure import pose_between
from lightfield.validation.result import Check


def read_sets(dataset: Path, reprojections: Iterable[str]) -> tuple[list[ImageSet], list[Check]]:
    """Read every lightfield.json. Return the sets that could be read, and a check of each."""
    sets: list[ImageSet] = []
    checks = []
    for name in ("", *reprojections):
        try:
            image_set = read_set(dataset, name, rendered(sets))
        except UserError as error:
            problem = str(error).replace(f"{dataset}/", "")
            check = f"{name}/lightfield".removeprefix("/")
            checks.append(Check(check, False, "cannot be understood", problems=[problem]))
            continue
        sets.append(image_set)
        checks.append(_poses(image_set))
    return sets, checks


def _poses(image_set: ImageSet) -> Check:
    """Check each view's pose and split.

    A pose is rigid, the same in both forms, and at its source's position.
    """
    views = image_set.lightfield.views
    source = image_set.source
    # Blender keeps poses in float32.
    tolerance = 1e-5 * (1 + max(np.abs(view.position).max() for view in views))
    faults = {}
    for view in views:
        difference = (
            np.abs(rotations.euler_to_matrix(view.rotation) - view.world_from_camera[:3, :3]).max()
            + np.abs(view.position - view.world_from_camera[:3, 3]).max()
            + np.abs(view.world_from_camera[3] - (0, 0, 0, 1)).max()
        )
        if not difference < tolerance:
            faults[view.name] = "world_matrix: does not follow from its position and rotation"
        elif view.split not in (None, *PARTS):
            faults[view.name] = f"split: is {view.split!r}; must be {', '.join(PARTS)}, or missing"
        elif _moves_elsewhere(view, tolerance):
            faults[view.name] = "exposure: has not the pose of world_matrix in its middle"
        elif source:
            number = source_view(source, view.name)
            if number is None:
                faults[view.name] = f"is made of no view of the dataset's {NAME}"
            elif np.abs(view.position - source.lightfield.views[number].position).max() > tolerance:
                faults[view.name] = f"is not at the place of {source.views[number]}"
    path = f"{image_set.prefix}{NAME}"
    return Check(
        f"{image_set.prefix}lightfield",
        not faults,
        f"{len(views)} views",
        [*faults],
        [f"{path}: frames: {view}: {fault}" for view, fault in faults.items()],
    )


def _moves_elsewhere(view: View, tolerance: float) -> bool:
    """Return whether a moving camera is not at the view's pose in the middle of its exposure."""
    try:
        if view.exposure is None:
            return False
        middle = pose_between(*view.exposure, 0.5)
        return not np.abs(middle - view.world_from_camera).max() < tolerance
    except (LookupError, TypeError, ValueError):
        return True  # The values are not two matrices.


def of_views(dataset: Path, sets: Sequence[ImageSet]) -> tuple[list[File], list[Check]]:
    """Return the files of the views that exist, and for each set a check that none is missing."""
    files: list[File] = []
    checks = []
    for number, image_set in enumerate(sets):
        set_files, missing = view_files(dataset, image_set, number)
        faults = dict.fromkeys(missing, "is missing")
        detail = f"{len(set_files)} of {len(set_files) + len(faults)} images are there"
        checks.append(Check.of_files(f"{image_set.prefix}views", faults, detail))
        files += set_files
    return files, checks


def lists_of(
    dataset: Path,
    image_set: ImageSet,
    manifest: Manifest,
    export_lists: Collection[Path] | None = None,
) -> list[Path]:
    """Return a set's lists of one kind of export: those in ``export_lists``, or all for None."""
    lists = sorted((dataset / image_set.name).glob(manifest.lists))
    return [path for path in lists if export_lists is None or path.resolve() in export_lists]


def of_exports(
    dataset: Path,
    sets: Sequence[ImageSet],
    views: Iterable[File],
    export_lists: Collection[Path] | None = None,
) -> tuple[list[File], list[str], Check]:
    """Return the pictures beside the views, the exports' other files, and a check of both.

    Only the lists in ``export_lists`` count. None takes all that exist.
    """
    pictures: dict[str, File] = {}
    lists: list[str] = []
    other_files: list[str] = []
    problems: list[str] = []
    for number, image_set in enumerate(sets):
        folders = {image_set.folder}
        patterns = [DEPTH_PICTURE]
        if image_set.sensor and image_set.sensor.bracket is not None:
            patterns += BRACKET_FILES.values()
        for manifest in MANIFESTS:
            set_lists = lists_of(dataset, image_set, manifest, export_lists)
            if set_lists or export_lists is None:
                patterns += manifest.beside
            for path in set_lists:
                lists.append(path.relative_to(dataset).as_posix())
                try:
                    listed = listed_files(dataset, path, manifest)
                except UserError as error:
                    problems.append(str(error).replace(f"{dataset}/", ""))
                    continue
                for picture in listed.pictures:
                    pictures[picture.as_posix()] = File(picture.as_posix(), number)
                    folders.add(picture.parent.as_posix())
                other_files += listed.other_files
                problems += listed.problems
        for folder in sorted(folders):
            present = file_names(dataset / folder)
            for view in image_set.views:
                for pattern in patterns:
                    name = pattern.format(view=view)
                    if name in present:
                        pictures[f"{folder}/{name}"] = File(f"{folder}/{name}", number)
    for file in views:
        pictures.pop(file.path, None)
    files = [file for _, file in sorted(pictures.items())]
    passed = not problems if lists or files else None
    detail = f"{len(lists)} lists of frames, {len(files)} pictures beside the views"
    return files, [*lists, *other_files], Check("exports", passed, detail, problems=problems)


@dataclass(frozen=True)
class ListedFiles:
    """The files in an export's list, relative to the dataset, and the faults of the list."""

    pictures: list[Path] = field(default_factory=list)
    other_files: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


def listed_files(dataset: Path, path: Path, manifest: Manifest) -> ListedFiles:
    """Read an export's list. Raises `UserError` if it is not a list of this kind."""
    named_pictures = manifest.pictures(path)
    sums = manifest.files(path)
    list_name = path.relative_to(dataset).as_posix()
    listed = ListedFiles()
    for name in named_pictures:
        if place := _listed_place(dataset, path, name):
            listed.pictures.append(Path(place))
        else:
            listed.problems.append(f"{list_name}: {name} is not a file of the dataset")
    for name, digest in sums.items():
        place = _listed_place(dataset, path, name)
        if place is None:
            listed.problems.append(f"{list_name}: {name} is not a file of the dataset")
        elif sha256(dataset / place) != digest:
            listed.problems.append(f"{place}: is not as it was exported")
        else:
            listed.other_files.append(place)
    return listed


def _listed_place(dataset: Path, path: Path, name: str) -> str | None:
    """Return the path in the dataset of a file that the list at ``path`` names.

    The file may lie beside the list's folder. None if it is no file, or outside the dataset.
    """
    place = os.path.normpath(path.parent.relative_to(dataset) / name)
    return place if leads_inside(place) and (dataset / place).is_file() else None


def listing(
    dataset: Path, sets: Sequence[ImageSet], owned: Iterable[str]
) -> tuple[list[str], Check]:
    """Return the files that the dataset publishes, and a check that fails if there are others."""
    published, strays = _sorted_out(dataset, sets, owned)
    problems = stray_problems(dataset, strays, "dataset")
    return published, Check("files", not strays, f"{len(published)} files", problems=problems)


def _sorted_out(
    dataset: Path, sets: Sequence[ImageSet], owned: Iterable[str]
) -> tuple[list[str], list[str]]:
    """Return the files that the dataset publishes, and all others in its folder."""
    all_owned = {*owned, *(f"{image_set.prefix}{NAME}" for image_set in sets)}
    present = present_files(dataset, {REPORT})
    folders = {image_set.folder for image_set in sets}
    strays = strays_among(dataset, present, all_owned, folders)
    return [path for path in present if path in all_owned], strays


def present_files(dataset: Path, excluded: Collection[str]) -> list[str]:
    """Return the paths in the dataset of all its files but those in ``excluded`` subfolders."""
    paths = [path.relative_to(dataset) for path in files_below(dataset)]
    return sorted(path.as_posix() for path in paths if path.parts[0] not in excluded)


def strays_among(
    dataset: Path,
    present: Iterable[str],
    owned: Collection[str],
    own_folders: Collection[str] = (),
) -> list[str]:
    """Return the files of ``present`` that are neither ``owned`` nor of a validation or package.

    Files behind a foreign link count as that link: see `stray_places`.
    """
    all_owned = {*owned, *OUTPUTS, *PACKAGED}
    strays = [path for path in present if path not in all_owned]
    return stray_places(dataset, strays, all_owned, own_folders)


def stray_problems(dataset: Path, strays: Iterable[str], kind: str) -> list[str]:
    """Return a line for each file that does not belong to a dataset or sequence."""
    return [
        f"{path}: is not a file of this {kind}{kept_behind_link(dataset, path)}" for path in strays
    ]


def remove_strays(
    dataset: Path,
    reprojections: Sequence[str],
    folder: Path,
    export_lists: Collection[Path] | None = None,
) -> int:
    """Move files that do not belong to the dataset into ``folder``. Return their number.

    Such files are views of a rig that had more cameras, former reprojections and exports, and
    files in the report's folder that no report has. Moves nothing if a lightfield.json or an export
    cannot be read. ``export_lists`` is the argument of `of_exports`.
    """
    sets, _ = read_sets(dataset, reprojections)
    if len(sets) <= len(reprojections):
        return 0
    views, _ = of_views(dataset, sets)
    views += pass_files(dataset, sets)[0]
    extras, lists, exports = of_exports(absolute_path(dataset), sets, views, export_lists)
    if exports.passed is False:
        return 0
    owned = {*lists, *side_files(sets), *(file.path for file in [*views, *extras])}
    _, strays = _sorted_out(dataset, sets, owned)
    # Leave hidden files: another process is writing them now.
    drawn = {path.name for path in (dataset / REPORT).glob("[!.]*")}
    strays += [f"{REPORT}/{name}" for name in sorted(drawn - {*REPORT_FILES})]
    return set_strays_aside(dataset, strays, folder)


def set_strays_aside(dataset: Path, strays: Iterable[str], folder: Path) -> int:
    """Move files out of a dataset into ``folder``, and remove the folders that become empty.

    Leaves files behind links, because the folder there may be of other use, too. Says how many
    files it has moved, and returns the number.
    """
    moved = [name for name in strays if link_above(dataset, name) is None]
    for name in moved:
        set_aside(dataset / name, folder)
        for parent in (dataset / name).parents:
            if parent == dataset or any(parent.iterdir()):
                break
            parent.rmdir()
    if moved:
        print(
            f"{dataset}: {len(moved)} files that are no longer its own are now below {folder}, "
            "under their own paths"
        )
    return len(moved)


def checksums(
    made: Mapping[str, Output],
    images: Collection[str],
    published: Mapping[str, str],
    sets: Sequence[ImageSet],
) -> Check:
    """Check that files have the SHA-256 with which they were made.

    ``made`` are the outputs of jobs. ``images`` are the paths of images, and ``published`` has the
    present SHA-256 of files. Without this check, a damaged file would be published with a checksum
    of its damage.
    """
    faults = {}
    for path, digest in sorted(published.items()):
        if path in made and (expected := made[path].stamp.sha256) != digest:
            faults[path] = f"has the sha256 {digest}, but its record says {expected}"
    recorded = {path for path, output in made.items() if output.key}
    if not recorded and not faults:
        return Check("checksums", None, "no record was given")
    for path in sorted(recorded - {*images}):
        faults[path] = "is recorded but is not an image of this dataset"
    # Views and passes have a key. Masks and pictures for trainers have none.
    rendered_set = rendered(sets)
    views = rendered_set.views if rendered_set else []
    rendered_files = [f"{IMAGES}/{view}.exr" for view in views]
    rendered_files += [file.path for file in expected_pass_files(sets[:1])] if rendered_set else []
    for path in sorted(rendered_files):
        if path in images and path not in recorded:
            faults[path] = "has no record"
    detail = f"{len(recorded)} of {len(images)} images have a record"
    return Check.of_files("checksums", faults, detail)


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
