"""Checks that points and depth in exports agree with the depth of the views.

A point was lifted from the centre of a pixel of a rendered view. So it must lie where that pixel's
depth puts it, as exactly as float32 resolves. While a view is read, it is compared with the points
that were likely lifted from it (`lifted_points`). A point that does not fit is then compared with
all views.
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

# At most this many points that do not fit their view are compared with all views.
MOST_SOUGHT = 20_000
# At most this many wrong points of a cloud are named one by one.
MOST_NAMED = 100
# A plane that is seen head on has one depth. Exports widen its range by at most this factor.
WIDENED = 1.002

Key = tuple[int, int]
"""The number of a set, and of one of its views."""
Ask = Callable[[Sequence[tuple[File, Question]]], Iterable[Answer | None]]
"""Answers questions about views, in their order. None for a view that cannot be read."""


@dataclass(frozen=True)
class _Piece:
    """The part of a cloud's points that one rendered view is asked about.

    ``points`` are indices in the cloud. ``start`` is their place among the points of the question.
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
        # For each cloud, the number of points that were compared with a view.
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
            if _holds_depth(export):
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
        """Yield the points that each rendered view is asked about."""
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
            for depth_range in export.exported.ranges:
                for view in self._views_of(depth_range, image_set):
                    meanings[export.number, view] = depth_range.meaning
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

    def _views_of(self, depth_range: DepthRange, image_set: ImageSet) -> list[int]:
        if depth_range.view is None:
            return [*range(len(image_set.views))]
        number = image_set.numbers.get(depth_range.view)
        return [] if number is None else [number]

    # ---- answers ------------------------------------------------------------------------

    def _range_faults(self, export: SetExport, answers: Mapping[Key, Answer]) -> Iterator[str]:
        """Yield what is wrong with an export's ranges of depth, depth map and unit cube."""
        image_set = self.sets[export.number]
        for depth_range in export.exported.ranges:
            keys = [(export.number, view) for view in self._views_of(depth_range, image_set)]
            if keys and all(key in answers for key in keys):
                yield from _range_fault(depth_range, [answers[key] for key in keys])
        cube = export.exported.cube
        keys = [(export.number, view) for view in _bounds_views(export, image_set)]
        if cube and keys and all(key in answers for key in keys):
            world_points = np.concatenate([answers[key].world_points for key in keys])
            if len(world_points):
                cameras = image_set.lightfield.matrices[:, :3, 3]
                yield from unit_cube.seen_faults(cube, cameras, world_points)
        if export.exported.depth_map:
            yield from self._depth_map_fault(export.exported.depth_map, image_set)

    def _depth_map_fault(self, depth_map: DepthMap, image_set: ImageSet) -> Iterator[str]:
        """Compare one depth map, in metres by the export's unit, with the depth of its view."""
        if depth_map.view not in image_set.numbers or image_set.lightfield.depth is None:
            return
        path = self.dataset / image_set.folder / f"{depth_map.view}.exr"
        try:
            steps = images.read_image(depth_map.path).channels["Y"].astype(np.float64)
            depth = images.read_image(path, ["Z"]).channels["Z"]
        except (UserError, LookupError):
            return  # which other checks say
        camera = image_set.camera(image_set.numbers[depth_map.view])
        if steps.shape != depth.shape:
            return
        depth = converted(depth, camera, depth_map.meaning)
        has_depth = steps > 0
        errors = np.abs(steps * depth_map.metres - depth)[has_depth]
        rounding = (0.5 + FLOAT32) * depth_map.metres + FLOAT32 * depth[has_depth]
        if not (errors <= rounding).all():
            error = f"{errors.max():.2g} m"
            yield f"{depth_map.place}: with it {depth_map.path} is up to {error} off its view"

    def _cloud_faults(
        self, index: int, cloud: Cloud, answers: Mapping[Key, Answer], ask: Ask
    ) -> Iterator[str]:
        """Yield the points of a cloud that no view's depth puts there."""
        source = rendered(self.sets)
        if source is None or any((0, view) not in answers for view in range(len(source.views))):
            return
        gaps = np.full(len(cloud.positions), np.inf)
        for piece in self.pieces:
            if piece.cloud == index:
                piece_gaps = answers[0, piece.view].gaps[piece.rows]
                gaps[piece.points] = np.fmin(gaps[piece.points], piece_gaps)
        limit = resolved(cloud.positions)
        off = np.flatnonzero(~(gaps <= limit))
        # They may have been lifted from another view than the likely one.
        count = min(len(off), MOST_SOUGHT)
        sought = off[np.linspace(0, len(off) - 1, count).astype(int)]
        self.compared[index] = len(gaps) - len(off) + count
        if count:
            gaps[sought] = np.fmin(gaps[sought], _gaps_in_all(cloud.positions[sought], source, ask))
        wrong = sought[~(gaps[sought] <= limit[sought])]
        for point in wrong[:MOST_NAMED]:
            gap = _describe_gap(gaps[point])
            yield f"{cloud.name(point)}: is not a point of a view's depth{gap}"
        if len(wrong) > MOST_NAMED:
            yield f"{cloud.file}: {len(wrong)} of {count} points are not points of a view's depth"


def _describe_gap(gap: float) -> str:
    return f"; what is seen there is {gap:.2g} m away" if np.isfinite(gap) else ""


def _holds_depth(export: SetExport) -> bool:
    exported = export.exported
    return bool(exported.clouds or exported.ranges or exported.depth_map or export.fits_depth)


def _bounds_views(export: SetExport, image_set: ImageSet) -> list[int]:
    """Return the views to whose depth a unit cube is fitted. They are spread evenly."""
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


def _range_fault(depth_range: DepthRange, answers: Sequence[Answer]) -> Iterator[str]:
    """Compare a range with the nearest and the farthest depth of its views."""
    near = min(depth_range.farthest, *(answer.nearest for answer in answers))
    far = max(near, *(min(answer.farthest, depth_range.farthest) for answer in answers))
    # If the range may reach to infinity, pixels without a source count as infinitely far.
    if np.isinf(depth_range.farthest) and any(answer.has_unknown for answer in answers):
        far = depth_range.farthest
    is_near = same(depth_range.near, near)
    is_far = (
        depth_range.far == far
        or same(depth_range.far, far)
        or far <= depth_range.far <= WIDENED * near
    )
    if not (is_near and is_far):
        yield (
            f"{depth_range.place}: is {depth_range.near:.7g} to {depth_range.far:.7g} m, "
            f"but depth goes from {near:.7g} to {far:.7g} m"
        )


def _gaps_in_all(points: NDArray[Any], source: ImageSet, ask: Ask) -> Floats:
    """Return how far points (n, 3) are from what any view sees at the pixel on whose ray they lie.

    The distance is inf for points that lie on no such ray.
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
    gaps = np.full(len(points), np.inf)
    for point_indices, answer in zip(indices, ask(questions), strict=True):
        if answer:
            gaps[point_indices] = np.fmin(gaps[point_indices], answer.gaps)
    return gaps
