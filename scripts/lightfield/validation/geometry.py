"""Checks that the views of a set see the same world: compares each view with its neighbours."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass

from lightfield.core.progress import Progress
from lightfield.formats.layout import File, ImageSet
from lightfield.formats.lightfield import NAME
from lightfield.validation import consistency
from lightfield.validation.cameras import camera_of, grain_of
from lightfield.validation.consistency import Answer, Patches
from lightfield.validation.result import Check

# A view fails if more than half of its pairs exceed one of two limits. The first is the part of
# contradictions among the points that are not occluded. The second is the displacement in pixels
# that explains a pair's residuals best. Few points determine the displacement badly, so it must
# also exceed EXPECTED_DISPLACEMENTS times the value to expect of a right pair, which follows from
# the points' noise and number. Right views of 40² pixels reach 2.5 times.
# A set fails if all its pairs together indicate an error of all angles, or of all depths, above the
# scale limit. A reprojection takes each depth from a source pixel up to half a pixel away, so its
# limits are wider.
CONTRADICTIONS_LIMIT = 0.05
DISPLACEMENT_LIMIT = 0.2
_REPROJECTED_DISPLACEMENT_LIMIT = 0.4
_EXPECTED_DISPLACEMENTS = 3.0
SCALE_LIMIT = 0.007
_REPROJECTED_SCALE_LIMIT = 0.015
# A scale is not checked if its standard deviation is larger than this.
SCALE_DEVIATION_LIMIT = 0.0015

Question = tuple[File, list[tuple[int, Patches]]]
"""An image, and the positions and patches of the views to look up in it."""

Pair = tuple[int, int]
"""The positions of two views among the views with depth."""


def check(
    image_set: ImageSet,
    patches_of_files: Mapping[File, Patches],
    ask: Callable[[Sequence[Question]], Iterable[list[Answer]]],
) -> Check:
    """Check that the views of a set see the same world.

    ``patches_of_files`` maps the images with depth to the surface patches that they see. ``ask``
    answers questions in their order.
    """
    name = f"{image_set.prefix}geometry"
    if image_set.lightfield.depth is None:
        return Check(name, None, "the views have no depth")
    if image_set.lightfield.follows_views:
        return Check(name, None, "each view shows another scene: objects follow its camera")
    if len(patches_of_files) < 2:
        return Check(name, None, f"{len(patches_of_files)} views with depth have no neighbours")
    pairs = _pair_answers(name, image_set, patches_of_files, ask)
    return _judge(name, image_set, list(patches_of_files), pairs)


def _pair_answers(
    name: str,
    image_set: ImageSet,
    patches_of_files: Mapping[File, Patches],
    ask: Callable[[Sequence[Question]], Iterable[list[Answer]]],
) -> dict[Pair, Answer]:
    """Return one answer for each pair of neighbours: the sum of both directions."""
    files = list(patches_of_files)
    patches = list(patches_of_files.values())
    pairs = consistency.view_pairs([camera_of(image_set, file.view) for file in files], patches)
    neighbours: dict[int, list[int]] = {}
    for first, second in pairs:
        neighbours.setdefault(first, []).append(second)
        neighbours.setdefault(second, []).append(first)
    views = sorted(neighbours)
    questions: list[Question] = []
    for view in views:
        looked_up = [(files[asking].view, patches[asking]) for asking in neighbours[view]]
        questions.append((files[view], looked_up))
    answers: dict[Pair, Answer] = {}
    progress = Progress(len(questions), f"validate {name}")
    for view, answers_of_view in zip(views, ask(questions), strict=True):
        for asking, answer in zip(neighbours[view], answers_of_view, strict=True):
            answers[asking, view] = answer
        progress.done()
    return {pair: answers[pair] + answers[pair[::-1]] for pair in pairs}


@dataclass(frozen=True)
class _ViewVerdict:
    """How a view agrees with its neighbours: medians over its pairs.

    ``contradiction`` is the part of its points that contradict them. ``displacement`` and its
    ``displacement_limit`` are in pixels.
    """

    contradiction: float
    displacement: float
    displacement_limit: float

    @property
    def is_bad(self) -> bool:
        return (
            self.contradiction > CONTRADICTIONS_LIMIT or self.displacement > self.displacement_limit
        )

    def describe(self) -> str:
        """Return what is wrong with a bad view."""
        return (
            f"{_percent(self.contradiction)} of its points contradict its neighbours "
            f"(at most {_percent(CONTRADICTIONS_LIMIT)}), and it seems displaced by "
            f"{self.displacement:.2f} pixels (at most {self.displacement_limit:.2g})"
        )


def _judge(
    name: str, image_set: ImageSet, files: Sequence[File], pairs: Mapping[Pair, Answer]
) -> Check:
    """Return the check that follows from the pairs' answers. It names the bad views."""
    limit = _REPROJECTED_DISPLACEMENT_LIMIT if grain_of(image_set) else DISPLACEMENT_LIMIT
    verdicts = _view_verdicts(pairs, limit)
    if not verdicts:
        return Check(name, None, "no two views see enough of the same smooth surfaces")
    bad_views = [view for view, verdict in verdicts.items() if verdict.is_bad]
    path = f"{image_set.prefix}{NAME}"
    problems = [f"{files[view].path}: {verdicts[view].describe()}" for view in bad_views]
    if 2 * len(bad_views) > len(verdicts):
        problems.insert(
            0,
            f"{path}: most views contradict each other: lens, axes or the meaning of depth do not "
            "belong to the images",
        )
    scales = _scales(pairs, set(bad_views))
    scale_limit = _REPROJECTED_SCALE_LIMIT if grain_of(image_set) else SCALE_LIMIT
    for quantity, (error, deviation) in scales.items():
        if deviation < SCALE_DEVIATION_LIMIT and abs(error) > scale_limit + 3 * deviation:
            problems.append(
                f"{path}: the views agree better if all {quantity}s are scaled by {1 + error:.3f} "
                f"(at most {_percent(scale_limit)} is allowed)"
            )
    untested = len(image_set.views) - len(verdicts)
    warning = f"{untested} views in {image_set.folder} see too little that others see too"
    figures = _figures(pairs, verdicts, scales)
    detail = (
        f"{len(verdicts)} views × {2 * len(pairs) / len(verdicts):.1f} neighbours agree "
        f"{_percent(figures['agree'])} ({_percent(figures['contradict'])} contradict, "
        f"{_percent(figures['occluded'])} occluded)"
    )
    return Check(
        name,
        not problems,
        detail,
        [image_set.views[files[view].view] for view in bad_views],
        problems,
        [warning] if untested else [],
        {key: round(figure, DECIMALS.get(key, 4)) for key, figure in figures.items()},
    )


def _view_verdicts(pairs: Mapping[Pair, Answer], limit: float) -> dict[int, _ViewVerdict]:
    """Return the verdicts on the views that share enough with any neighbour, in their order.

    ``limit`` is the displacement in pixels that any pair may have.
    """
    answers_of_view: dict[int, list[Answer]] = defaultdict(list)
    for pair, answer in pairs.items():
        for view in pair:
            answers_of_view[view].append(answer)
    verdicts = {}
    for view in sorted(answers_of_view):
        answers = answers_of_view[view]
        contradiction = _low_median(answer.contradiction for answer in answers)
        if contradiction is not None:
            verdicts[view] = _ViewVerdict(contradiction, *_displacement(answers, limit))
    return verdicts


def _scales(pairs: Mapping[Pair, Answer], bad_views: Set[int]) -> dict[str, tuple[float, float]]:
    """Return the errors of all angles and of all depths, each with its standard deviation.

    An error is the part by which they must grow. Pairs with bad views do not count.
    """
    good = [answer for pair, answer in pairs.items() if not bad_views & set(pair)]
    errors, deviations = consistency.scales(sum(good, start=consistency.NOTHING))
    return {
        "angle": (float(errors[0]), float(deviations[0])),
        "depth": (float(errors[1]), float(deviations[1])),
    }


# Decimals of figures in validation.json. All other figures have 4.
DECIMALS = {"worst_displacement_pixels": 3}


def _figures(
    pairs: Mapping[Pair, Answer],
    verdicts: Mapping[int, _ViewVerdict],
    scales: Mapping[str, tuple[float, float]],
) -> dict[str, float]:
    """Return the check's figures for validation.json, not yet rounded."""
    total = sum(pairs.values(), start=consistency.NOTHING)
    points = total.agree + total.occluded + total.contradict
    figures = {
        "pairs": len(pairs),
        "points": points,
        "agree": total.agree / points,
        "contradict": total.contradict / points,
        "occluded": total.occluded / points,
        "worst_contradiction": max(verdict.contradiction for verdict in verdicts.values()),
        "worst_displacement_pixels": max(verdict.displacement for verdict in verdicts.values()),
    }
    for quantity, (error, deviation) in scales.items():
        if math.isfinite(deviation):
            figures[f"{quantity}_scale_error"] = error
            figures[f"{quantity}_scale_deviation"] = deviation
    return figures


def _displacement(answers: Iterable[Answer], limit: float) -> tuple[float, float]:
    """Return a view's displacement in pixels and its limit, both of its median pair.

    A pair's limit is ``limit``, or more if resolution and precision alone lead to more.
    """
    pairs = [
        (answer.displacement, max(limit, _EXPECTED_DISPLACEMENTS * answer.expected))
        for answer in answers
        if answer.displacement is not None and answer.expected is not None
    ]
    pairs.sort(key=lambda pair: pair[0] - pair[1])
    return pairs[(len(pairs) - 1) // 2] if pairs else (0.0, limit)


def _low_median(values: Iterable[float | None]) -> float | None:
    """Return the lower median of the values that are not None, or None without any.

    The lower median lets a view with two neighbours pass if one of them is bad.
    """
    numbers = sorted(value for value in values if value is not None)
    return numbers[(len(numbers) - 1) // 2] if numbers else None


def _percent(part: float) -> str:
    return f"{100 * part:.2g} %" if part < 0.1 else f"{100 * part:.1f} %"
