"""Do the views of a set see the same world? Each is compared with its neighbours."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence

from lightfield.core.progress import Progress
from lightfield.dataset.lightfield import NAME
from lightfield.validation import consistency
from lightfield.validation.consistency import Answer, Patches
from lightfield.validation.files import File, ImageSet
from lightfield.validation.result import Check

# A view fails when over half of its pairs exceed one of these: the part of contradictions among
# the points that are not occluded, and the displacement in pixels that a pair's residuals ask for.
# Few pixels on curved surfaces determine that badly: it must be as many times what is expected of a
# right pair, too (right views of 40² come to 2.5).
# A set fails when its pairs together ask for such a change of all angles or of all depths. A
# reprojection takes each depth from a pixel of its source, which may lie half a pixel away.
CONTRADICTIONS_LIMIT = 0.05
DISPLACEMENT_LIMIT, REPROJECTED_DISPLACEMENT_LIMIT = 0.2, 0.4
EXPECTED_DISPLACEMENTS = 3.0
SCALE_LIMIT, REPROJECTED_SCALE_LIMIT = 0.007, 0.015
# Residuals that determine a scale no better than this do not count as a check of it.
SCALE_DEVIATION_LIMIT = 0.0015

Question = tuple[File, list[tuple[int, Patches]]]
"""An image, and the numbers and patches of the views that are looked up in it."""


def check(
    image_set: ImageSet,
    seen: Mapping[File, Patches],
    ask: Callable[[Sequence[Question]], Iterable[list[Answer]]],
) -> Check:
    """Check that the views of a set see the same world.

    ``seen`` are its images with depth and the surfaces in each; ``ask`` answers questions in order.
    """
    name = f"{image_set.prefix}geometry"
    if image_set.lightfield.depth is None:
        return Check(name, None, "the views have no depth")
    if len(seen) < 2:
        return Check(name, None, f"{len(seen)} views with depth have no neighbours")
    files = list(seen)
    patches = list(seen.values())
    pairs = consistency.view_pairs([image_set.camera(file.view) for file in files], patches)
    asking: dict[int, list[int]] = {}
    for one, other in pairs:
        asking.setdefault(one, []).append(other)
        asking.setdefault(other, []).append(one)
    questions = [
        (files[view], [(files[other].view, patches[other]) for other in others])
        for view, others in sorted(asking.items())
    ]
    answers: dict[tuple[int, int], Answer] = {}
    progress = Progress(len(questions), f"validate {name}")
    for (view, others), found in zip(sorted(asking.items()), ask(questions), strict=True):
        answers |= {(other, view): answer for other, answer in zip(others, found, strict=True)}
        progress.done()
    both = {pair: answers[pair] + answers[pair[::-1]] for pair in pairs}
    return _judged(name, image_set, files, both)


def _judged(
    name: str, image_set: ImageSet, files: Sequence[File], both: Mapping[tuple[int, int], Answer]
) -> Check:
    """Turn what the views of each pair say of each other into a check that names the wrong ones."""
    limit, scale_limit = DISPLACEMENT_LIMIT, SCALE_LIMIT
    if image_set.grain:
        limit = REPROJECTED_DISPLACEMENT_LIMIT
        scale_limit = REPROJECTED_SCALE_LIMIT
    contradictions: dict[int, float] = {}
    displacements: dict[int, tuple[float, float]] = {}
    of_view: dict[int, list[Answer]] = defaultdict(list)
    for pair, answer in both.items():
        for view in pair:
            of_view[view].append(answer)
    for view in range(len(files)):
        own = of_view[view]
        contradiction = _low_median(answer.contradiction for answer in own)
        if contradiction is not None:
            contradictions[view] = contradiction
            displacements[view] = _displacement(own, limit)
    tested = len(contradictions)
    if not tested:
        return Check(name, None, "no two views see enough of the same smooth surfaces")
    bad = {
        view: f"{_percent(contradiction)} of its points contradict its neighbours "
        f"(at most {_percent(CONTRADICTIONS_LIMIT)}), and it seems displaced by "
        f"{displacements[view][0]:.2f} pixels (at most {displacements[view][1]:.2g})"
        for view, contradiction in contradictions.items()
        if contradiction > CONTRADICTIONS_LIMIT or displacements[view][0] > displacements[view][1]
    }
    path = f"{image_set.prefix}{NAME}"
    problems = [f"{files[view].path}: {text}" for view, text in bad.items()]
    if 2 * len(bad) > tested:
        problems.insert(
            0,
            f"{path}: most views contradict each other: lens, axes or the meaning of depth are not "
            "those of the images",
        )
    good = [answer for pair, answer in both.items() if not bad.keys() & set(pair)]
    scale, deviation = consistency.scales(sum(good, start=consistency.NOTHING))
    scales = dict(zip(("angle", "depth"), zip(scale, deviation, strict=True), strict=True))
    for what, (value, sure) in scales.items():
        if sure < SCALE_DEVIATION_LIMIT and abs(value) > scale_limit + 3 * sure:
            problems.append(
                f"{path}: the views agree better if all {what}s are scaled by {1 + value:.3f} "
                f"(at most {_percent(scale_limit)} is allowed)"
            )
    total = sum(both.values(), start=consistency.NOTHING)
    points = total.agree + total.occluded + total.contradict
    parts = {key: getattr(total, key) / points for key in ("agree", "contradict", "occluded")}
    untested = len(image_set.views) - tested
    warning = f"{untested} views in {image_set.folder} see too little that others see too"
    return Check(
        name,
        not problems,
        f"{tested} views × {2 * len(both) / tested:.1f} neighbours agree "
        f"{_percent(parts['agree'])} ({_percent(parts['contradict'])} contradict, "
        f"{_percent(parts['occluded'])} occluded)",
        [image_set.views[files[view].view] for view in bad],
        problems,
        [warning] if untested else [],
        {
            "pairs": len(both),
            "points": points,
            **{key: round(part, 4) for key, part in parts.items()},
            "worst_contradiction": round(max(contradictions.values()), 4),
            "worst_displacement_pixels": round(max(displacements.values())[0], 3),
            **{
                f"{what}_scale_{key}": round(float(number), 4)
                for what, numbers in scales.items()
                for key, number in zip(("error", "deviation"), numbers, strict=True)
                if math.isfinite(numbers[1])
            },
        },
    )


def _displacement(answers: Iterable[Answer], limit: float) -> tuple[float, float]:
    """Return the displacement of a view, and what it may be: those of its median pair.

    A pair may have ``limit``, and what resolution and precision alone may lead to.
    """
    pairs = [
        (answer.displacement, max(limit, EXPECTED_DISPLACEMENTS * answer.expected))
        for answer in answers
        if answer.displacement is not None and answer.expected is not None
    ]
    pairs.sort(key=lambda pair: pair[0] - pair[1])
    return pairs[(len(pairs) - 1) // 2] if pairs else (0.0, limit)


def _low_median(values: Iterable[float | None]) -> float | None:
    """Return the lower median of what is known: one bad neighbour of two is not one's own fault."""
    known = sorted(value for value in values if value is not None)
    return known[(len(known) - 1) // 2] if known else None


def _percent(part: float) -> str:
    return f"{100 * part:.2g} %" if part < 0.1 else f"{100 * part:.1f} %"
