"""Checks that exports have the cameras of lightfield.json. Reads each export as its consumer does.

It compares the poses of views, the lenses by where they project the rays of pixels, the lists of
views and their parts, and the numbers that a file has twice. Numbers may differ by a few steps of
float32, with which consumers compute.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import NAME, LightField, View
from lightfield.dataset.splits_file import SPLITS
from lightfield.geometry import rotations
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs.split_setting import PARTS
from lightfield.validation import unit_cube
from lightfield.validation.files import ImageSet, Manifest, lists_of
from lightfield.validation.readers import read
from lightfield.validation.readers.cameras import Camera, PolynomialFisheye
from lightfield.validation.readers.contents import FLOAT32, Exported, ExportedView, Floats
from lightfield.validation.result import Check

# How many pixels along each side of an image have their rays compared.
GRID = 33
# To a lens that is no polynomial one is fitted for instant-ngp. It may miss the lens by so many
# pixels, and by so many times what one fitted here does.
FITTED_PIXELS, FITTED_TIMES = 0.25, 3.0
# Where the scene has no split, every such view by name tests, as in most trainers' own examples.
EVERY = 8


@dataclass(frozen=True)
class SetExport:
    """What one export says of the views of the set ``number``.

    ``fits_depth`` is whether instant-ngp's unit cube is fitted to the depth of these views.
    """

    number: int
    exported: Exported
    fits_depth: bool


class Expected:
    """What an export must say: the views of a set, and those of the scene's other rigs."""

    def __init__(self, dataset: Path, image_set: ImageSet) -> None:
        self.dataset = dataset
        self.image_set = image_set
        self.path = f"{image_set.prefix}{NAME}"
        self.numbers = image_set.numbers

    @cached_property
    def others(self) -> dict[str, View]:
        """The views of the scene's other rigs that are here, by the names <rig>_<view>."""
        return {
            f"{rig}_{view.name}": view
            for rig, folder in self.other_rigs.items()
            for view in _views(folder / self.image_set.name / NAME)
        }

    @cached_property
    def other_rigs(self) -> dict[str, Path]:
        """The datasets of the scene's other rigs by their names. Empty without a splits.json."""
        # A frame of a sequence lies one folder deeper.
        for home in self.dataset.parents[:2]:
            if (home / SPLITS).is_file():
                rig, *below = self.dataset.relative_to(home).parts
                folders = {path.parent.name: path.parent for path in home.glob(f"*/{NAME}")}
                if below:
                    frames = home.glob(f"*/{below[0]}/{NAME}")
                    folders = {path.parent.parent.name: path.parent for path in frames}
                return {name: folder for name, folder in folders.items() if name != rig}
        return {}

    @property
    def has_split(self) -> bool:
        """Whether the rig has a split."""
        return any(view.split for view in self.image_set.lightfield.views)

    @cached_property
    def parts(self) -> Mapping[str, set[str]]:
        """The names of the views of each part: as the rig splits them, or every eighth to test."""
        views = dict(zip(self.numbers, self.image_set.lightfield.views, strict=True))
        if self.has_split:
            views |= self.others
            parts = {
                str(part): {name for name, view in views.items() if view.split == part}
                for part in PARTS
            }
        else:
            tests = set(sorted(views)[::EVERY])
            parts = {"train": views.keys() - tests, "validation": set(), "test": tests}
        # Without views for validation, the test views validate.
        parts["validation"] = parts["validation"] or parts["test"]
        return parts

    @property
    def lacks_rigs(self) -> bool:
        """Whether other rigs test what these views train, and their datasets are not here."""
        return not self.parts["test"]

    def view(self, name: str) -> View | None:
        """Return the view with a name from an export. None if it is not here."""
        if name in self.numbers:
            return self.image_set.lightfield.views[self.numbers[name]]
        return self.others.get(name)


def _views(path: Path) -> Sequence[View]:
    """Return the views of another rig. No views if its lightfield.json cannot be read."""
    try:
        return LightField.read(path).views
    except UserError:
        return ()


def check(
    dataset: Path,
    sets: Sequence[ImageSet],
    manifests: Sequence[Manifest],
    wanted: Collection[Path] | None = None,
) -> tuple[list[Check], list[SetExport]]:
    """Return a check for each set that has exports, and the exports that could be read.

    ``wanted`` is that of `files.of_exports`.
    """
    checks = []
    set_exports: list[SetExport] = []
    for number, image_set in enumerate(sets):
        expected = Expected(dataset, image_set)
        lens = image_set.lightfield.lens
        problems: list[str] = []
        views = 0
        paths = [
            path
            for manifest in manifests
            for path in lists_of(dataset, image_set, manifest, wanted)
        ]
        for path in paths:
            try:
                exported = read(path, (lens.width, lens.height))
            except UserError as error:
                problems.append(str(error))
                continue
            cube = exported.cube
            if cube and not unit_cube.is_of_rig(cube, image_set, expected.other_rigs):
                cube = None
            set_exports.append(SetExport(number, exported, cube is not None and cube.fits_depth))
            views += len(exported.views)
            problems += exported.faults
            problems += _faults(exported, expected)
            if cube and not cube.fits_depth:
                problems += unit_cube.faults(cube, image_set.lightfield.matrices)
        if paths:
            shown = [problem.replace(f"{dataset}/", "") for problem in problems]
            detail = f"{len(paths)} exports have {views} cameras as {expected.path} has them"
            if problems:
                detail = f"{len(paths)} exports have {views} cameras, not all as {expected.path}"
            name = f"{image_set.prefix}exported_cameras"
            checks.append(Check(name, not problems, detail, problems=shown))
    return checks, set_exports


def _faults(exported: Exported, expected: Expected) -> Iterator[str]:
    """Yield what an export says that differs from lightfield.json."""
    lens = expected.image_set.lightfield.lens
    errors: dict[Camera, str | None] = {}
    for given in exported.cameras:
        if given.camera not in errors:
            errors[given.camera] = _lens_fault(given.camera, lens)
        if fault := errors[given.camera]:
            yield f"{given.place}: {fault} {expected.path}"
    if exported.views:
        yield from _pose_faults(exported.views, expected)
        yield from _name_faults(exported, expected)
    for part in exported.parts:
        yield from _different_names(part.place, part.names, expected.parts[part.part], expected)


def _lens_fault(camera: Camera, lens: Lens) -> str | None:
    """Say how a camera differs from the lens, for "… that of" a file to follow."""
    if (camera.width, camera.height) != (lens.width, lens.height):
        size = f"{camera.width} × {camera.height} pixels"
        return f"its image has {size}, not the {lens.width} × {lens.height} of"
    across, down = (np.linspace(0.5, side - 0.5, GRID) for side in (lens.width, lens.height))
    pixels = np.stack([axis.ravel() for axis in np.meshgrid(across, down)], axis=-1)
    rays = lens.rays(pixels[:, 0], pixels[:, 1])
    seen = np.isfinite(rays).all(axis=-1)
    limit = FLOAT32 * max(lens.width, lens.height)
    if isinstance(camera, PolynomialFisheye):
        fitted = _fitted(lens)
        # Its loader sees less than 90 degrees from the axis, and nothing at the very centre. Where
        # the angle at the centre is not 0, rays around it may be those of the other side.
        hole = 2 * abs(fitted.terms[0] / fitted.terms[1])
        seen &= (rays[:, 2] < -1e-6) & (np.hypot(*(pixels - lens.center).T) > hole)
        if not camera.is_equidistant:
            best = np.abs(fitted.pixels(rays[seen]) - pixels[seen]).max()
            limit = max(limit, min(FITTED_PIXELS, FITTED_TIMES * best))
    pixels, rays = pixels[seen], rays[seen]
    apart = np.abs(camera.pixels(rays) - pixels).max(axis=-1)
    if (apart <= limit).all():
        return None
    if np.isnan(apart).any():
        return "its camera does not see all rays that are seen by the lens of"
    return f"its camera has rays up to {apart.max():.3g} pixels from where they are by the lens of"


def _fitted(lens: Lens) -> PolynomialFisheye:
    """Return a polynomial fitted to a lens to the right of its centre, up to 90 degrees."""
    x, y = lens.center
    radius = np.linspace(0, max(lens.width, lens.height), 1000)[1:]
    rays = lens.rays(x + radius, np.full_like(radius, y))
    seen = rays[:, 2] < 0
    angles = np.arctan2(rays[seen, 0], -rays[seen, 2])
    p0, p1, p2, p3, p4 = Polynomial.fit(radius[seen], angles, 4).convert().coef.tolist()
    return PolynomialFisheye(lens.width, lens.height, x, y, (p0, p1, p2, p3, p4))


def _pose_faults(views: Sequence[ExportedView], expected: Expected) -> Iterator[str]:
    """Yield the views whose matrix is neither form of the pose in lightfield.json."""
    matrices = np.array([view.matrix for view in views])
    named = [expected.view(view.name) if view.name else None for view in views]
    if all(view.name is None for view in views):
        named = list(_nearest(matrices[:, :3, 3], expected))
    compared = [index for index, view in enumerate(named) if view]
    if not compared:
        return
    right = [view for view in named if view]
    forms = np.array([[view.matrix for view in right], [view.matrix for view in right]])
    forms[1, :, :3, :3] = rotations.euler_to_matrix(np.array([view.rotation for view in right]))
    forms[1, :, :3, 3] = [view.position for view in right]
    difference = np.abs(matrices[compared] - forms)
    turned = difference[..., :3, :3].max(axis=(-1, -2)).min(axis=0)
    moved = difference[..., :3, 3].max(axis=-1).min(axis=0)
    last = difference[..., 3, :].max(axis=-1).min(axis=0)
    reach = 1 + np.abs(forms[..., :3, 3]).max(axis=(0, -1))
    for row, (index, view) in enumerate(zip(compared, right, strict=True)):
        where = f"{views[index].file}: {views[index].place} ({views[index].name or view.name})"
        if not moved[row] <= FLOAT32 * reach[row]:
            yield f"{where}: its position is {moved[row]:.2g} m from that in {expected.path}"
        if not turned[row] <= FLOAT32:
            yield (
                f"{where}: its rotation differs by {turned[row]:.2g} from that in {expected.path}"
            )
        if last[row] != 0:
            yield f"{where}: the last row of its matrix is not 0, 0, 0, 1"


def _nearest(positions: Floats, expected: Expected) -> Iterable[View]:
    """Return the view of the set that is nearest to each of the positions (n, 3)."""
    from scipy.spatial import KDTree

    lightfield = expected.image_set.lightfield
    rows = KDTree(lightfield.matrices[:, :3, 3]).query(positions)[1]
    return [lightfield.views[row] for row in rows]


def _name_faults(exported: Exported, expected: Expected) -> Iterator[str]:
    """Yield the views that a file lacks, has twice, or must not have."""
    first = exported.views[0]
    if first.name is None:
        if len(exported.views) != len(expected.numbers):
            counts = f"{len(exported.views)} views, but {expected.path} {len(expected.numbers)}"
            yield f"{first.file}: has {counts}"
        return
    names = [view.name or "" for view in exported.views]
    for part in exported.parts:
        for name in sorted(set(part.names).difference(names)):
            yield f"{part.place}: has {name}, which is none of its views"
    # The lists of NeRF's synthetic scenes are compared as parts of the split.
    if all(view.file == first.file for view in exported.views):
        wanted = set(expected.numbers)
        if exported.views_of and expected.has_split:
            wanted = wanted & expected.parts[exported.views_of]
        yield from _different_names(str(first.file), names, wanted, expected)


def _different_names(
    place: str, names: Sequence[str], wanted: Collection[str], expected: Expected
) -> Iterator[str]:
    """Yield the names that are doubled, missing, or not expected."""
    for name, count in Counter(names).items():
        if count > 1:
            yield f"{place}: has {name} {count} times"
    for name in sorted(set(wanted).difference(names)):
        yield f"{place}: lacks {name} of {expected.path}"
    for name in sorted(set(names).difference(wanted)):
        if name in expected.numbers:
            yield f"{place}: has {name}, which is for something else by {expected.path}"
        elif expected.view(name) is None and not expected.lacks_rigs:
            yield f"{place}: has {name}, but {expected.path} has no such view"
