"""Checks that exports have the cameras of lightfield.json. Reads each export as its consumer does.

It compares poses, lenses, lists of views, the parts of the split, and numbers that a file repeats.
Two lenses are the same if they project the rays of pixels to the same place. Numbers may differ by
a few steps of float32, with which consumers compute.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from lightfield.core.errors import UserError
from lightfield.core.names import PARTS, SPLITS
from lightfield.exporters import MANIFESTS
from lightfield.formats.layout import ImageSet
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.geometry import rotations
from lightfield.geometry.lenses import Lens
from lightfield.validation.files import lists_of
from oracles import exported_boxes, unit_cube
from oracles.readers import read
from oracles.readers.cameras import Camera, PolynomialFisheye
from oracles.readers.contents import FLOAT32, Exported, ExportedView, Floats

# A lens is compared at this many pixels along each side of its image.
GRID = 33
# The export for instant-ngp fits a polynomial to a lens that is none. The fit may miss the lens by
# this many pixels, and by this many times the error of the fit that is made here.
FITTED_PIXELS = 0.25
FITTED_TIMES = 3.0
# Without a split, an eighth of the views tests.
EVERY = 8


@dataclass(frozen=True)
class SetExport:
    """One export of the set with this ``number``.

    ``fits_depth`` says whether instant-ngp's unit cube is fitted to the depth of these views.
    """

    number: int
    exported: Exported
    fits_depth: bool


class Expected:
    """What an export must contain: the views of a set, and those of the scene's other rigs."""

    def __init__(self, dataset: Path, image_set: ImageSet) -> None:
        self.dataset = dataset
        self.image_set = image_set
        self.path = f"{image_set.prefix}{NAME}"
        self.numbers = image_set.numbers

    @cached_property
    def views_of_other_rigs(self) -> dict[str, View]:
        """The views of other rigs that test what these views train, by the names <rig>_<view>.

        These are the rigs of which no view trains. A rig with test views of its own has none.
        """
        if any(view.split != "train" for view in self.image_set.lightfield.views):
            return {}
        views: dict[str, View] = {}
        for rig, folder in self.other_rigs.items():
            rig_views = _views(folder / self.image_set.name / NAME)
            if all(view.split in ("validation", "test") for view in rig_views):
                views |= {f"{rig}_{view.name}": view for view in rig_views}
        return views

    @cached_property
    def other_rigs(self) -> dict[str, Path]:
        """The datasets of the scene's other rigs by their names. Empty without a splits.json."""
        # A frame of a sequence lies one folder deeper.
        for home in self.dataset.parents[:2]:
            if not (home / SPLITS).is_file():
                continue
            rig, *frame = self.dataset.relative_to(home).parts
            pattern = "/".join(["*", *frame, NAME])
            datasets = [path.parent for path in home.glob(pattern)]
            folders = {folder.relative_to(home).parts[0]: folder for folder in datasets}
            return {name: folder for name, folder in folders.items() if name != rig}
        return {}

    @property
    def has_split(self) -> bool:
        """Whether the rig has a split."""
        return any(view.split for view in self.image_set.lightfield.views)

    @cached_property
    def _parts_of_split(self) -> dict[str, set[str]]:
        """The names of the views of each part of the split."""
        views = dict(zip(self.numbers, self.image_set.lightfield.views, strict=True))
        views |= self.views_of_other_rigs
        parts: dict[str, set[str]] = {str(part): set() for part in PARTS}
        for name, view in views.items():
            if view.split in parts:
                parts[view.split].add(name)
        return parts

    def parts(self, exported: Exported) -> Mapping[str, set[str]]:
        """Return the names of the views that each part of an export must have.

        Without a split, the export chooses the test views.
        """
        if self.has_split:
            parts = self._parts_of_split
        else:
            listed = {name for part in exported.parts if part.part == "test" for name in part.names}
            tests = listed & self.numbers.keys()
            parts = {"train": self.numbers.keys() - tests, "validation": set(), "test": tests}
        # Without views for validation, the test views validate.
        return parts | {"validation": parts["validation"] or parts["test"]}

    def choice_fault(self, tests: Collection[str]) -> str | None:
        """Return what is wrong with the test views that an export chose, for a rig without a split.

        They are an eighth, and leave no larger gap than every eighth view.
        """
        count = -(-len(self.numbers) // EVERY)
        if len(tests) != count:
            return f"has {len(tests)} test views, not {count}"
        if self._largest_gap(tests) > (1 + 1e-6) * self._largest_gap(sorted(self.numbers)[::EVERY]):
            return "has test views that are spread worse than every eighth view"
        return None

    def _largest_gap(self, tests: Collection[str]) -> float:
        """Return the largest distance from a view to the nearest test view, in metres."""
        places = self.image_set.lightfield.world_from_cameras[:, :3, 3]
        chosen = places[[self.numbers[name] for name in tests]]
        return float(np.linalg.norm(places[:, None] - chosen, axis=-1).min(axis=1).max())

    def view(self, name: str) -> View | None:
        """Return the view with a name from an export. None if it is not here."""
        if name in self.numbers:
            return self.image_set.lightfield.views[self.numbers[name]]
        return self.views_of_other_rigs.get(name)


def _views(path: Path) -> Sequence[View]:
    """Return the views of another rig. No views if its lightfield.json cannot be read."""
    try:
        return LightField.read(path).views
    except UserError:
        return ()


def check(
    dataset: Path,
    sets: Sequence[ImageSet],
    export_lists: Collection[Path] | None = None,
) -> tuple[list[str], list[SetExport]]:
    """Return what is wrong with the cameras of all exports, and the exports that could be read.

    ``export_lists`` are the lists of the exports to read. None takes all that exist.
    """
    set_exports: list[SetExport] = []
    problems: list[str] = []
    for number, image_set in enumerate(sets):
        expected = Expected(dataset, image_set)
        lens = image_set.lightfield.lens
        paths = [
            path
            for manifest in MANIFESTS
            for path in lists_of(dataset, image_set, manifest, export_lists)
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
            problems += exported.faults
            problems += faults(exported, expected)
            problems += _missing_parts(path, expected)
            problems += exported_boxes.faults(exported, dataset, image_set)
            if cube and not cube.fits_depth:
                problems += unit_cube.faults(cube, image_set.lightfield.world_from_cameras)
    return problems, set_exports


def faults(exported: Exported, expected: Expected) -> Iterator[str]:
    """Yield how an export differs from lightfield.json."""
    lens = expected.image_set.lightfield.lens
    lens_faults: dict[Camera, str | None] = {}
    for exported_camera in exported.cameras:
        camera = exported_camera.camera
        if camera not in lens_faults:
            lens_faults[camera] = _lens_fault(camera, lens)
        fault = lens_faults[camera]
        if fault:
            yield f"{exported_camera.place}: {fault} {expected.path}"
    if exported.views:
        yield from _pose_faults(exported.views, expected)
        yield from _exposure_faults(exported.views, expected)
        yield from _name_faults(exported, expected)
    parts = expected.parts(exported)
    for part in exported.parts:
        yield from _different_names(part.place, part.names, parts[part.part], expected)
        if part.part == "test" and not expected.has_split:
            fault = expected.choice_fault(parts["test"])
            if fault:
                yield f"{part.place}: {fault}"


def _missing_parts(path: Path, expected: Expected) -> Iterator[str]:
    """Yield the lists for instant-ngp that a transforms.json lacks: one of each part's views."""
    if path.name != "transforms.json":
        return
    for part in PARTS:
        has_views = any(view.split == part for view in expected.image_set.lightfield.views)
        list_of_part = path.with_stem(f"{path.stem}_{part}")
        if has_views and not list_of_part.is_file():
            yield f"{list_of_part}: is missing, but {expected.path} has views for {part}"


def _lens_fault(camera: Camera, lens: Lens) -> str | None:
    """Return how a camera differs from the lens, or None. The name of a file follows the text."""
    if (camera.width, camera.height) != (lens.width, lens.height):
        size = f"{camera.width} × {camera.height} pixels"
        return f"its image has {size}, not the {lens.width} × {lens.height} of"
    across, down = (np.linspace(0.5, side - 0.5, GRID) for side in (lens.width, lens.height))
    pixels = np.stack([axis.ravel() for axis in np.meshgrid(across, down)], axis=-1)
    rays = lens.rays(pixels[:, 0], pixels[:, 1])
    visible = np.isfinite(rays).all(axis=-1)
    limit = FLOAT32 * max(lens.width, lens.height)
    if isinstance(camera, PolynomialFisheye):
        fitted = _fitted(lens)
        # Its loader sees less than 90 degrees from the axis, and nothing at the very centre. Where
        # the angle at the centre is not 0, rays around it may be those of the other side.
        hole = 2 * abs(fitted.terms[0] / fitted.terms[1])
        visible &= (rays[:, 2] < -1e-6) & (np.hypot(*(pixels - lens.center).T) > hole)
        if not camera.is_equidistant:
            best = np.abs(fitted.pixels(rays[visible]) - pixels[visible]).max()
            limit = max(limit, min(FITTED_PIXELS, FITTED_TIMES * best))
    pixels = pixels[visible]
    rays = rays[visible]
    offsets = np.abs(camera.pixels(rays) - pixels).max(axis=-1)
    if (offsets <= limit).all():
        return None
    if np.isnan(offsets).any():
        return "its camera does not see all rays that are seen by the lens of"
    return (
        f"its camera has rays up to {offsets.max():.3g} pixels from where they are by the lens of"
    )


def _fitted(lens: Lens) -> PolynomialFisheye:
    """Return a polynomial fitted to a lens to the right of its centre, up to 90 degrees."""
    # A fisheye is symmetric about its centre, so one half axis is enough.
    x, y = lens.center
    radius = np.linspace(0, max(lens.width, lens.height), 1000)[1:]
    rays = lens.rays(x + radius, np.full_like(radius, y))
    in_front = rays[:, 2] < 0
    angles = np.arctan2(rays[in_front, 0], -rays[in_front, 2])
    p0, p1, p2, p3, p4 = Polynomial.fit(radius[in_front], angles, 4).convert().coef.tolist()
    return PolynomialFisheye(lens.width, lens.height, x, y, (p0, p1, p2, p3, p4))


def _pose_faults(views: Sequence[ExportedView], expected: Expected) -> Iterator[str]:
    """Yield the views whose matrix is neither form of the pose in lightfield.json."""
    matrices = np.array([view.world_from_camera for view in views])
    candidates = [expected.view(view.name) if view.name else None for view in views]
    if all(view.name is None for view in views):
        candidates = list(_nearest(matrices[:, :3, 3], expected))
    compared = [index for index, view in enumerate(candidates) if view]
    if not compared:
        return
    references = [view for view in candidates if view]
    # lightfield.json has each pose as a matrix, and as a position with Euler angles.
    forms = np.array([[view.world_from_camera for view in references]] * 2)
    euler_angles = np.array([view.rotation for view in references])
    forms[1, :, :3, :3] = rotations.euler_to_matrix(euler_angles)
    forms[1, :, :3, 3] = [view.position for view in references]
    difference = np.abs(matrices[compared] - forms)
    rotation_error = difference[..., :3, :3].max(axis=(-1, -2)).min(axis=0)
    position_error = difference[..., :3, 3].max(axis=-1).min(axis=0)
    last_row_error = difference[..., 3, :].max(axis=-1).min(axis=0)
    reach = 1 + np.abs(forms[..., :3, 3]).max(axis=(0, -1))
    for row, (index, view) in enumerate(zip(compared, references, strict=True)):
        where = f"{views[index].file}: {views[index].place} ({views[index].name or view.name})"
        if not position_error[row] <= FLOAT32 * reach[row]:
            distance = f"{position_error[row]:.2g} m"
            yield f"{where}: its position is {distance} from that in {expected.path}"
        if not rotation_error[row] <= FLOAT32:
            amount = f"{rotation_error[row]:.2g}"
            yield f"{where}: its rotation differs by {amount} from that in {expected.path}"
        if last_row_error[row] != 0:
            yield f"{where}: the last row of its matrix is not 0, 0, 0, 1"


def _exposure_faults(views: Sequence[ExportedView], expected: Expected) -> Iterator[str]:
    """Yield the views whose poses at the start and the end of the exposure are others."""
    for view in views:
        reference = expected.view(view.name) if view.name else None
        if view.exposure is None or reference is None:
            continue
        where = f"{view.file}: {view.place} ({view.name})"
        if reference.exposure is None:
            yield f"{where}: its camera moves, and not in {expected.path}"
            continue
        reach = 1 + np.abs(reference.position).max()
        for name, pose, true_pose in zip(
            ("start", "end"), view.exposure, reference.exposure, strict=True
        ):
            if not np.abs(pose - true_pose).max() <= FLOAT32 * reach:
                yield f"{where}: its pose at the {name} of the exposure is not in {expected.path}"


def _nearest(positions: Floats, expected: Expected) -> Iterable[View]:
    """Return the nearest view of the set for each of the positions (n, 3)."""
    from scipy.spatial import KDTree

    lightfield = expected.image_set.lightfield
    rows = KDTree(lightfield.world_from_cameras[:, :3, 3]).query(positions)[1]
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
            yield f"{part.place}: has {name}, which is not one of its views"
    # The lists of NeRF's synthetic scenes are compared as parts of the split.
    if all(view.file == first.file for view in exported.views):
        expected_names = set(expected.numbers)
        if exported.views_of and expected.has_split:
            expected_names &= expected.parts(exported)[exported.views_of]
        yield from _different_names(str(first.file), names, expected_names, expected)


def _different_names(
    place: str, names: Sequence[str], expected_names: Collection[str], expected: Expected
) -> Iterator[str]:
    """Yield the names that are doubled, missing, or not expected."""
    for name, count in Counter(names).items():
        if count > 1:
            yield f"{place}: has {name} {count} times"
    for name in sorted(set(expected_names).difference(names)):
        yield f"{place}: lacks {name} of {expected.path}"
    for name in sorted(set(names).difference(expected_names)):
        if name in expected.numbers:
            yield f"{place}: has {name}, which is for something else by {expected.path}"
        elif expected.view(name) is None:
            yield f"{place}: has {name}, but {expected.path} has no such view"
