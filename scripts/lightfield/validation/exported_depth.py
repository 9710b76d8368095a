"""Checks that points and depth in exports agree with the depth of the views.

A point was lifted from the centre of a pixel of a rendered view. So it must lie where that pixel's
depth puts it, as exactly as float32 resolves. While a view is read, it is asked for the points that
were likely lifted from it (`lifted_points`). A point that does not fit is looked for in all others.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.dataset.exports import BOUNDS_PIXELS, BOUNDS_VIEWS
from lightfield.imaging import images
from lightfield.validation import unit_cube
from lightfield.validation.depth_questions import Answer, Floats, Question, converted
from lightfield.validation.exported_cameras import SetExport
from lightfield.validation.files import File, ImageSet, rendered, source_view
from lightfield.validation.lifted_points import likely_views, on_pixel_rays, resolved
from lightfield.validation.readers.contents import FLOAT32, Cloud, DepthMap, DepthRange, same
from lightfield.validation.result import Check

Ints = NDArray[np.int64]

# How many points that do not fit their view are looked for in all views.
MOST_SOUGHT = 20_000
# How many wrong points of a cloud are named one by one.
MOST_NAMED = 100
# A plane that is seen head on has one depth; the range that an export gives it is no wider.
WIDENED = 1.002

Key = tuple[int, int]
"""The number of a set, and of one of its views."""
Ask = Callable[[Sequence[tuple[File, Question]]], Iterable[Answer | None]]
"""Answers questions about views in their order; None for a view that cannot be read."""


@dataclass(frozen=True)
class _Piece:
    """The indices of a cloud's points for which one rendered view is asked.

    They follow ``start`` others in the question to that view.
    """

    cloud: int
    points: Ints
    view: int
    start: int

    @property
    def rows(self) -> slice:
        return slice(self.start, self.start + len(self.points))


class ExportedDepth:
    """The questions to the views, and the checks that follow from their answers."""

    def __init__(
        self, dataset: Path, sets: Sequence[ImageSet], exports: Sequence[SetExport]
    ) -> None:
        self.dataset = dataset
        self.sets = sets
        self.exports = exports
        self.clouds = [
            (export.number, cloud) for export in exports for cloud in export.exported.clouds
        ]
        # Of how many points of each cloud it is known whether they are right.
        self.compared = [0] * len(self.clouds)
        self.pieces = list(self._pieces())
        self.questions = self._questions()

    def question(self, file: File) -> Question | None:
        """Return the question to an image file, or None."""
        if file.of_pass or not file.path.endswith(".exr"):
            return None
        return self.questions.get((file.set, file.view))

    def checks(self, answers: Mapping[Key, Answer], ask: Ask) -> list[Check]:
        """Return a check for each set with exports that hold depth."""
        faults: dict[int, list[str]] = {}
        for export in self.exports:
            if _speaks_of_depth(export):
                faults.setdefault(export.number, []).extend(self._range_faults(export, answers))
        for index, (number, cloud) in enumerate(self.clouds):
            faults[number] += self._cloud_faults(index, cloud, answers, ask)
        unread = sum(key not in answers for key in self.questions)
        return [self._check(number, problems, unread) for number, problems in faults.items()]

    def _check(self, number: int, problems: Sequence[str], unread: int) -> Check:
        cloud_indices = [index for index, (of, _) in enumerate(self.clouds) if of == number]
        points = sum(len(self.clouds[index][1].positions) for index in cloud_indices)
        compared = sum(self.compared[index] for index in cloud_indices)
        ranges = sum(len(e.exported.ranges) for e in self.exports if e.number == number)
        name = f"{self.sets[number].prefix}exported_depth"
        if (unread or compared < points) and not problems:
            missing = points - compared
            detail = f"{unread} views cannot be read, so {missing} points are not compared"
            return Check(name, None, detail)
        detail = f"{points} points and {ranges} ranges of depth are those of the views"
        if problems:
            detail = f"of {points} points and {ranges} ranges of depth some are not the views'"
        return Check(
            name,
            not problems,
            detail,
            problems=[problem.replace(f"{self.dataset}/", "") for problem in problems],
            figures={"points": points, "ranges": ranges},
        )

    # ---- questions ----------------------------------------------------------------------

    def _pieces(self) -> Iterator[_Piece]:
        """Yield the points for which each rendered view is asked."""
        source = rendered(self.sets)
        if source is None:
            return
        starts = [0] * len(source.views)
        for index, (number, cloud) in enumerate(self.clouds):
            order = _lifting_views(self.sets[number], source)
            matrices = source.lightfield.matrices[order]
            points, places = likely_views(cloud.positions, source.lightfield.lens, matrices)
            views = order[places]
            by_view = np.argsort(views, kind="stable")
            bounds = np.searchsorted(views[by_view], np.arange(len(source.views) + 1))
            for view in range(len(source.views)):
                view_points = points[by_view[bounds[view] : bounds[view + 1]]]
                yield _Piece(index, view_points, view, starts[view])
                starts[view] += len(view_points)

    def _questions(self) -> dict[Key, Question]:
        points: dict[Key, list[NDArray[Any]]] = {}
        for piece in self.pieces:
            positions = self.clouds[piece.cloud][1].positions[piece.points]
            points.setdefault((0, piece.view), []).append(positions)
        meanings: dict[Key, str] = {}
        steps: dict[Key, int] = {}
        for export in self.exports:
            image_set = self.sets[export.number]
            for given in export.exported.ranges:
                for view in self._views_of(given, image_set):
                    meanings[export.number, view] = given.meaning
            for view in _bounds_views(export, image_set):
                lens = image_set.lightfield.lens
                step = max(1, max(lens.width, lens.height) // BOUNDS_PIXELS)
                steps[export.number, view] = step
        return {
            key: Question(
                np.concatenate(points.get(key, [np.empty((0, 3))])),
                meanings.get(key),
                steps.get(key, 0),
            )
            for key in {**points, **meanings, **steps}
        }

    def _views_of(self, given: DepthRange, image_set: ImageSet) -> list[int]:
        if given.view is None:
            return [*range(len(image_set.views))]
        return [image_set.numbers[given.view]] if given.view in image_set.numbers else []

    # ---- answers ------------------------------------------------------------------------

    def _range_faults(self, export: SetExport, answers: Mapping[Key, Answer]) -> Iterator[str]:
        """Yield what is wrong with an export's ranges of depth, depth map and unit cube."""
        image_set = self.sets[export.number]
        for given in export.exported.ranges:
            keys = [(export.number, view) for view in self._views_of(given, image_set)]
            if keys and all(key in answers for key in keys):
                yield from _range_fault(given, [answers[key] for key in keys])
        cube = export.exported.cube
        keys = [(export.number, view) for view in _bounds_views(export, image_set)]
        if cube and keys and all(key in answers for key in keys):
            seen = np.concatenate([answers[key].seen for key in keys])
            if len(seen):
                cameras = image_set.lightfield.matrices[:, :3, 3]
                yield from unit_cube.seen_faults(cube, cameras, seen)
        if export.exported.depth_map:
            yield from self._depth_map_fault(export.exported.depth_map, image_set)

    def _depth_map_fault(self, given: DepthMap, image_set: ImageSet) -> Iterator[str]:
        """Compare one depth map, in metres by the export's unit, with the depth of its view."""
        if given.view not in image_set.numbers or image_set.lightfield.depth is None:
            return
        path = self.dataset / image_set.folder / f"{given.view}.exr"
        try:
            steps = images.read_image(given.path).channels["Y"].astype(np.float64)
            depth = images.read_image(path, ["Z"]).channels["Z"]
        except (UserError, LookupError):
            return  # which other checks say
        camera = image_set.camera(image_set.numbers[given.view])
        if steps.shape != depth.shape:
            return
        depth = converted(depth, camera, given.meaning)
        known = steps > 0
        apart = np.abs(steps * given.metres - depth)[known]
        if not (apart <= (0.5 + FLOAT32) * given.metres + FLOAT32 * depth[known]).all():
            yield f"{given.place}: with it {given.path} is up to {apart.max():.2g} m off its view"

    def _cloud_faults(
        self, index: int, cloud: Cloud, answers: Mapping[Key, Answer], ask: Ask
    ) -> Iterator[str]:
        """Yield the faults of a cloud: points that no view's depth puts there."""
        source = rendered(self.sets)
        if source is None or any((0, view) not in answers for view in range(len(source.views))):
            return
        apart = np.full(len(cloud.positions), np.inf)
        for piece in self.pieces:
            if piece.cloud == index:
                distances = answers[0, piece.view].apart[piece.rows]
                apart[piece.points] = np.fmin(apart[piece.points], distances)
        limit = resolved(cloud.positions)
        off = np.flatnonzero(~(apart <= limit))
        # They may have been lifted from another view than the likely one.
        count = min(len(off), MOST_SOUGHT)
        sought = off[np.linspace(0, len(off) - 1, count).astype(int)]
        self.compared[index] = len(apart) - len(off) + count
        if count:
            elsewhere = _sought(cloud.positions[sought], source, ask)
            apart[sought] = np.fmin(apart[sought], elsewhere)
        wrong = sought[~(apart[sought] <= limit[sought])]
        for point in wrong[:MOST_NAMED]:
            yield f"{cloud.name(point)}: is no point of a view's depth{_seen_at(apart[point])}"
        if len(wrong) > MOST_NAMED:
            yield f"{cloud.file}: {len(wrong)} of {count} points are none of a view's depth"


def _seen_at(apart: float) -> str:
    return f"; what is seen there is {apart:.2g} m away" if np.isfinite(apart) else ""


def _speaks_of_depth(export: SetExport) -> bool:
    said = export.exported
    return bool(said.clouds or said.ranges or said.depth_map or export.fits_depth)


def _bounds_views(export: SetExport, image_set: ImageSet) -> list[int]:
    """Return the views whose depth a unit cube is fitted to. They are spread evenly."""
    if not export.fits_depth:
        return []
    last = len(image_set.views) - 1
    chosen = np.unique(np.linspace(0, last, BOUNDS_VIEWS).round().astype(int))
    return [int(view) for view in chosen]


def _lifting_views(image_set: ImageSet, source: ImageSet) -> Ints:
    """Return the rendered views in the order in which a set's exporters lift points from them."""
    views = image_set.lightfield.views
    training = [view for view in views if view.split in (None, "train")] or views
    source_views = [source_view(source, view.name) for view in training]
    return np.array([view for view in source_views if view is not None], np.int64)


def _range_fault(given: DepthRange, answers: Sequence[Answer]) -> Iterator[str]:
    """Compare a range with the nearest and the farthest depth of its views."""
    near = min(given.farthest, *(answer.nearest for answer in answers))
    far = max(near, *(min(answer.farthest, given.farthest) for answer in answers))
    # Without an end of what is far, pixels without a source count as being there too.
    if np.isinf(given.farthest) and any(answer.has_unknown for answer in answers):
        far = given.farthest
    is_near = same(given.near, near)
    is_far = given.far == far or same(given.far, far) or far <= given.far <= WIDENED * near
    if not (is_near and is_far):
        yield (
            f"{given.place}: is {given.near:.7g} to {given.far:.7g} m, "
            f"but depth goes from {near:.7g} to {far:.7g} m"
        )


def _sought(points: NDArray[Any], source: ImageSet, ask: Ask) -> Floats:
    """Return how far points (n, 3) are from what the views see of which they are on a pixel's ray.

    It is inf for those that are on no such ray.
    """
    lens = source.lightfield.lens
    indices: list[Ints] = []
    questions: list[tuple[File, Question]] = []
    for number, (name, matrix) in enumerate(
        zip(source.views, source.lightfield.matrices, strict=True)
    ):
        near = on_pixel_rays(points, lens, np.broadcast_to(matrix, (len(points), 4, 4)))
        if near.any():
            indices.append(np.flatnonzero(near))
            file = File(f"{source.folder}/{name}.exr", 0, number)
            questions.append((file, Question(points[near])))
    apart = np.full(len(points), np.inf)
    for found, answer in zip(indices, ask(questions), strict=True):
        if answer:
            apart[found] = np.fmin(apart[found], answer.apart)
    return apart
