"""Writes the errors of rendered test views as a table, and as a page with the pictures."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_csv
from lightfield.core.leftovers import temporary_folder
from lightfield.core.names import VIEWS
from lightfield.core.progress import Progress
from lightfield.export.source import Floats, SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.formats import gaussians
from lightfield.formats.lightfield import View
from lightfield.imaging import images
from lightfield.measurement import evaluation, lpips
from lightfield.measurement.evaluation import ShownRender
from lightfield.measurement.lpips import Lpips
from lightfield.measurement.picture_difference import flip_map
from lightfield.report import page
from lightfield.stages.measurement import Evaluate, EvaluationSettings

# The page shows pictures of at most this many views. The table has all.
_SHOWN_VIEWS = 24
WIDEST = 1500


def evaluate(job: Evaluate) -> None:
    """Write the errors of renders, and their page. If this fails, the output stays as it was."""
    source = _source(job.dataset, job.settings)
    views = source.lightfield.views
    tests = [view for view in views if view.split == "test"] or splits(source.lightfield).test
    background = np.array(list(bytes.fromhex(job.settings.background))) / 255
    network = lpips.read(job.lpips_weights) if job.lpips_weights else None
    job.output.parent.mkdir(parents=True, exist_ok=True)
    with temporary_folder(job.output.parent) as temporary:
        overall = write(temporary, source, tests, job.renders, job.masks, background, network)
        _move_files(temporary, job.output)
    views_compared = "1 view" if len(tests) == 1 else f"{len(tests)} views"
    print(
        f"{views_compared}: PSNR {overall['psnr']:.2f} dB, WS-PSNR {overall['ws_psnr']:.2f} dB, "
        f"IV-PSNR {overall['iv_psnr']:.2f} dB, SSIM {overall['ssim']:.4f}, "
        f"FLIP {overall['flip']:.4f}, "
        + (
            f"LPIPS ({network.net}) {overall['lpips']:.4f}"
            if network
            else "no LPIPS without --lpips-weights (see docs/how-to/evaluate-renders.md)"
        )
    )


def _source(dataset: Path, settings: EvaluationSettings) -> SourceDataset:
    """Return the true views of a dataset."""
    name = "" if settings.source == VIEWS else settings.source
    return SourceDataset(
        dataset,
        name,
        settings.suffix,
        exposure=settings.exposure,
        reinhard=settings.reinhard,
        look_name=settings.look,
    )


def _move_files(folder: Path, target: Path) -> None:
    """Move all files below a folder to the same places below another one."""
    for path in list(folder.rglob("*")):
        if path.is_file():
            moved = target / path.relative_to(folder)
            moved.parent.mkdir(parents=True, exist_ok=True)
            path.replace(moved)


def write(
    output: Path,
    source: SourceDataset,
    tests: Sequence[View],
    renders: Path,
    masks: Path | None,
    background: Floats,
    network: Lpips | None,
) -> dict[str, Any]:
    """Write the table, the page and the pictures of the test views. Return the means over all.

    Pictures with alpha are composited over ``background`` (3,) in sRGB, 0 to 1. Warns about renders
    whose alpha or background differs from the truth's. Raises `UserError` for a render that is
    missing in the folder ``renders``, or that cannot be compared. ``renders`` may be the PLY of a
    Gaussian splat, which is drawn. The ``network`` gives LPIPS.
    """
    read = _reader(renders, source, tests, background)
    rows: list[dict[str, Any]] = []
    problems = []
    progress = Progress(len(tests), "evaluate", "views")
    for view in tests:
        mask = evaluation.find(masks, source, view, [".png"]) if masks else None
        picture = output / "pictures" / f"{view.name}.png"
        render = read(view)
        errors, problem = _compare(view, render, source, mask, background, picture, network)
        rows += errors
        if problem:
            problems.append(f"{render.name}: {problem}")
        progress.done()
    if problems:
        count = f" (and {len(problems) - 1} more of {len(tests)})" if problems[1:] else ""
        print(f"warning: {problems[0]}{count}", file=sys.stderr)
    means = evaluation.means(rows)
    write_csv(output / "evaluation.csv", [*rows, *means])
    page.write(
        output / "index.html",
        "evaluation.html.j2",
        name="/".join(absolute_path(source.dataset).parts[-2:]),
        renders=absolute_path(renders).name,
        means=means,
        rows=rows,
        background=evaluation.hexadecimal(background),
        network=network.net if network else None,
        recipe=lpips.RECIPE,
        problems=[problem.removeprefix(f"{renders}/") for problem in problems],
        pictures={
            view.name: page.photo(output / "pictures" / f"{view.name}.png", WIDEST)
            for view in tests[:_SHOWN_VIEWS]
        },
    )
    return means[0]


def _reader(
    renders: Path, source: SourceDataset, tests: Sequence[View], background: Floats
) -> Callable[[View], ShownRender]:
    """Return the function that returns a view's render. All renders must be there."""
    if renders.suffix == ".ply":
        splat = gaussians.read(renders)
        return lambda view: evaluation.drawn(splat, str(renders), source, view, background)
    paths = {view.name: evaluation.find(renders, source, view) for view in tests}
    return lambda view: evaluation.rendered(paths[view.name], source, background)


def _compare(
    view: View,
    render: ShownRender,
    source: SourceDataset,
    mask: Path | None,
    background: Floats,
    picture: Path,
    network: Lpips | None,
) -> tuple[list[dict[str, Any]], str | None]:
    """Return a row of errors for each region of a ``render``, and a warning or None.

    Writes the truth, the render and the FLIP map beside each other to ``picture``.
    """
    shown = render.pictures
    true = evaluation.truth(source, view, render.largest, background)
    counted = np.ones(shown.colour.shape[:2], bool)
    if mask:
        counted = evaluation.mask(mask, source)
    regions = evaluation.regions(source, view, counted, true.depth)
    if not regions:
        raise UserError(f"{render.name}: its mask leaves no pixel that the lens sees")
    if not np.isfinite(shown.colour[regions["all"]]).all():
        raise UserError(f"{render.name}: has colour that is not a number where it is compared")
    rows = [
        {"view": view.name, "region": region, **errors}
        for region, errors in evaluation.errors(shown, true, regions, source.lens, network)
    ]
    pictures = [np.nan_to_num(image.colour) for image in (true, shown)]
    flip = flip_map(*pictures)[..., np.newaxis].repeat(3, axis=-1)
    strip = np.concatenate([*pictures, flip], axis=1).clip(0, 1)
    images.write_png(picture, np.round(strip * 255).astype(np.uint8))
    return rows, evaluation.background_problem(shown, true, regions["all"], background)
