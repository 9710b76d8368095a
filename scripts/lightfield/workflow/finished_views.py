"""The times of a dataset's finished views, from the history in the receipts of its shards."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.planning.estimate import CPU, FinishedViews, ViewSize
from lightfield.planning.sampling import cost_in_samples
from lightfield.workflow import history


@dataclass(frozen=True)
class RenderedView:
    """The time of one view: path tracing, the rest, and when it was finished.

    Times are seconds of one core, or of the whole machine if a graphics card renders.
    """

    view: str
    finished: float
    path_tracing: float
    rest: float
    # Whether it is its process's first view, which pays for the scene's acceleration structures.
    first: bool


def renderings(run: history.ProcessHistory) -> Iterator[RenderedView]:
    """Split the time of each view that a process rendered.

    While Cycles traces paths, all threads are busy. The rest takes one thread. The view's processor
    time is divided in these proportions, because wall time includes the work of other programs.
    """
    for index, view in enumerate(run.views):
        traced = view["render_seconds"]
        rest = max(0.0, view["wall_seconds"] - traced)
        if on_processor(run):
            busy = run.start["threads"] * traced
            traced = view["cpu_seconds"] * busy / (busy + rest)
            rest = view["cpu_seconds"] - traced
        yield RenderedView(view["view"], view["finished"], traced, rest, first=index == 0)


def on_processor(run: history.ProcessHistory) -> bool:
    """Return whether a process rendered on the processor's cores."""
    return bool(run.start["device"] == CPU)


def latest_device(runs: Sequence[history.ProcessHistory]) -> str | None:
    """Return the device that rendered the latest view. None without a rendered view."""
    rendered = [run for run in runs if run.views]
    if not rendered:
        return None
    latest = max(rendered, key=lambda run: run.views[-1]["finished"])
    return str(latest.start["device"])


def of_latest_device(runs: Sequence[history.ProcessHistory]) -> list[history.ProcessHistory]:
    """Return the runs without views, and of the others the runs on the latest view's device.

    Times of a core and of a whole machine have no mean.
    """
    by_processor = latest_device(runs) == CPU
    return [run for run in runs if not run.views or on_processor(run) == by_processor]


def counted_renderings(
    runs: Sequence[history.ProcessHistory], lightfield: LightField
) -> list[RenderedView]:
    """Return the renderings of a dataset's views on the latest view's device.

    Receipts may have views that the dataset had under earlier settings. They do not count.
    """
    names = {view.name for view in lightfield.views}
    return [
        rendering
        for run in of_latest_device(runs)
        for rendering in renderings(run)
        if rendering.view in names
    ]


def finished_views(
    runs: Sequence[history.ProcessHistory], lightfield: LightField
) -> FinishedViews | None:
    """Return the times of a dataset's views, by its latest device. None without views.

    The first views of processes do not represent the others. They count only if there are no
    others.
    """
    all_renderings = counted_renderings(runs, lightfield)
    if not all_renderings:
        return None
    by_finish = sorted(all_renderings, key=lambda rendering: rendering.finished)
    by_view = {rendering.view: rendering for rendering in by_finish}
    latest = [*by_view.values()]
    latest = [rendering for rendering in latest if not rendering.first] or latest
    return FinishedViews(
        _size_of(lightfield),
        latest_device(runs) != CPU,
        [view.path_tracing for view in latest],
        fmean(view.rest for view in latest),
    )


def read_finished_views(lightfield: Path, receipts: Path) -> FinishedViews | None:
    """Return the times of a dataset's views. None without them, or if a file is damaged."""
    shards = history.shards(receipts)
    if not shards or not lightfield.exists():
        return None
    try:
        runs = [run for path in shards for run in history.read(path)]
        return finished_views(runs, LightField.read(lightfield))
    except UserError:
        return None


def _size_of(lightfield: LightField) -> ViewSize:
    """Return the size of a dataset's views. Their effort is unknown with a target error."""
    render, lens = lightfield.render, lightfield.lens
    assert isinstance(render.samples, int)
    effort = None if render.target_error else cost_in_samples(render.samples, render.denoise)
    return ViewSize((lens.width, lens.height), render.samples, effort)
