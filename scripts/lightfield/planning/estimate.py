"""How long a dataset's views take to render: one estimate, from the sharpest known measurement.

`snakemake -n`, the target `plan`, a dataset's page and a GPU check all ask `Known.estimate`. So
they give the same figure for the same views on the same device. The order of preference:

1. finished views of the same size and samples, at least as many as a probe has;
2. a probe of these views;
3. on a GPU, the check of this scene;
4. finished views of another size, in proportion to pixels and samples.

If none is known, a dry run guesses: see `lightfield.planning.cost`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

from lightfield.core import units
from lightfield.core.files import read_keys, reading
from lightfield.planning import sampling

CPU = "CPU"
"""The device of views that processor cores rendered."""
# As many views as a probe renders. Fewer say less than a probe.
_FEWEST_FINISHED = 3


class ViewSize(NamedTuple):
    """The size of views whose time is asked.

    - ``samples``: paths of a pixel. None if a target error decides, or the .blend.
    - ``effort``: the cost of a pixel in samples, with denoising. None if it is unknown.
    """

    resolution: tuple[int, int]
    samples: int | None
    effort: float | None

    @property
    def pixels(self) -> int:
        return math.prod(self.resolution)


@dataclass(frozen=True)
class ProbedViews:
    """The figures of scripts/probe.py: seconds of one core or of the GPU, and bytes, of some views.

    ``views``, ``resolution``, ``samples`` and ``denoise`` are the dataset's. Older probes do not
    say whether views are denoised.
    """

    views: int
    resolution: tuple[int, int]
    samples: int
    device: str
    seconds: tuple[float, ...]
    sizes: tuple[float, ...]
    denoise: bool | None = None

    @property
    def on_gpu(self) -> bool:
        """Whether a GPU rendered the views."""
        return self.device != CPU

    @property
    def size(self) -> ViewSize:
        """The size of the dataset's views. Their effort is unknown without ``denoise``."""
        is_known = self.denoise is not None
        effort = sampling.cost_in_samples(self.samples, bool(self.denoise)) if is_known else None
        return ViewSize(self.resolution, self.samples, effort)

    @property
    def view_bytes(self) -> float:
        """The mean size of a view's file."""
        return fmean(self.sizes)

    @property
    def estimate(self) -> Estimate:
        """The estimate of the dataset's views."""
        count = len(self.seconds)
        source = f"a probe of {units.count(count, 'view')}"
        return Estimate(fmean(self.seconds), source, self.on_gpu, self.view_error, count)

    def is_of(self, size: ViewSize, on_gpu: bool) -> bool:
        """Return whether it probed views of a size on a device."""
        samples = size.samples or self.samples
        planned = (size.resolution, samples, on_gpu)
        return (self.resolution, self.samples, self.on_gpu) == planned

    @property
    def view_error(self) -> float:
        """The standard error of the mean seconds of a view."""
        return sampling.standard_error(self.seconds)


def read_probe(path: Path | str) -> ProbedViews:
    """Return the result of scripts/probe.py. Raises `UserError` if the file is damaged."""
    keys = ("views", "resolution", "samples", "device", "view_seconds", "view_bytes")
    content = read_keys(path, "probe.py", *keys)
    with reading(path, "probe"):
        views, (width, height), samples, device, seconds, sizes = (content[key] for key in keys)
        if not all(0 < number < 1e12 for number in [*seconds, *sizes]):
            raise ValueError("a number is not above 0, or far too large")
        if not all(isinstance(n, int) and 0 <= n < 2**31 for n in (views, samples, width, height)):
            raise ValueError("a count is not a whole number")
        if not (seconds and sizes):
            raise ValueError("no view was measured")
        return ProbedViews(
            views,
            (width, height),
            samples,
            device,
            tuple(seconds),
            tuple(sizes),
            content.get("denoise"),
        )


@dataclass(frozen=True)
class FinishedViews:
    """The times of a dataset's finished views, on one device.

    Seconds count for one core, or for the GPU. ``traced`` has the seconds of each view's path
    tracing. ``rest`` is the mean of the other seconds of a view. The ``effort`` in ``size`` is None
    if a target error chose the samples. Then a view of another size is taken to have as many.
    """

    size: ViewSize
    on_gpu: bool
    traced: Sequence[float]
    rest: float

    @property
    def description(self) -> str:
        """What was rendered, in words."""
        width, height = self.size.resolution
        return (
            f"{units.count(len(self.traced), 'finished view')} of {width} × {height} pixels "
            f"with {units.count(self.size.samples or 0, 'sample')}"
        )

    def is_like(self, size: ViewSize) -> bool:
        """Return whether these views have a size, so that nothing is extrapolated."""
        has_effort = self.size.effort in (None, size.effort)
        is_equal = has_effort and self.size.pixels == size.pixels
        return is_equal and len(self.traced) >= _FEWEST_FINISHED

    def estimate(self, size: ViewSize) -> Estimate:
        """Return the estimate of views of another size."""
        pixels = size.pixels / self.size.pixels
        factor = self._path_tracing_of(size)
        return Estimate(
            factor * fmean(self.traced) + pixels * self.rest,
            self.description,
            self.on_gpu,
            factor * sampling.standard_error(self.traced) if len(self.traced) > 1 else None,
            len(self.traced),
        )

    def _path_tracing_of(self, size: ViewSize) -> float:
        """Return the path tracing of a view of another size, in units of one of these."""
        pixels = size.pixels / self.size.pixels
        if size.effort is None or self.size.effort is None:
            return pixels
        return pixels * size.effort / self.size.effort


@dataclass(frozen=True)
class CheckedGpu:
    """What a GPU check found: the seconds of a sample, and the cost of the scene's pixels."""

    sample_seconds: float
    effort: float

    def estimate(self, size: ViewSize) -> Estimate:
        """Return the estimate of views on the GPU."""
        effort = self.effort if size.effort is None else size.effort
        return Estimate(size.pixels * effort * self.sample_seconds, "the GPU check", on_gpu=True)


def read_gpu_check(path: Path) -> CheckedGpu:
    """Return the result of scripts/gpu_check.py. Raises `UserError` if the file is damaged."""
    content = read_keys(path, "gpu_check.py", "gpu_seconds", "samples")
    with reading(path, "GPU check"):
        # The file has the seconds of a megapixel.
        return CheckedGpu(float(content["gpu_seconds"]) / 1e6, float(content["samples"]))


@dataclass(frozen=True)
class Estimate:
    """The seconds of a view, of one core or of the GPU, and what they were measured by.

    ``view_error`` is the standard error of ``view_seconds``, by so many ``measured`` views. None if
    it is unknown.
    """

    view_seconds: float
    source: str
    on_gpu: bool = False
    view_error: float | None = None
    measured: int = 1

    def error(self, views: int) -> float | None:
        """Return the standard error of the seconds of so many views. None if it is unknown."""
        if self.view_error is None:
            return None
        # Measured views have no error.
        missing_part = max(0.0, 1 - self.measured / views)
        return views * self.view_error * math.sqrt(missing_part)

    def line(self, name: str, views: int) -> str:
        """Return a line that says how long so many views of ``name`` take, and by what."""
        device = "a GPU" if self.on_gpu else "one core"
        return (
            f"{name}: rendering {units.count(views, 'view')} takes "
            f"{units.duration(views * self.view_seconds)} of {device}, by {self.source}"
        )


@dataclass(frozen=True)
class Known:
    """What is known of the time of a dataset's views."""

    probe: ProbedViews | None = None
    gpu_check: CheckedGpu | None = None
    finished: Sequence[FinishedViews] = ()

    def estimate(self, size: ViewSize, on_gpu: bool) -> Estimate | None:
        """Return the estimate of a view on a device. None if nothing is known.

        The module's documentation has the order of preference.
        """
        return next(self._estimates(size, on_gpu), None)

    def _estimates(self, size: ViewSize, on_gpu: bool) -> Iterator[Estimate]:
        finished = [each for each in self.finished if each.on_gpu == on_gpu]
        # The sharpest are the views with the most path tracing.
        finished.sort(key=lambda each: (each.size.pixels, each.size.samples or 0), reverse=True)
        yield from (each.estimate(size) for each in finished if each.is_like(size))
        if self.probe and self.probe.is_of(size, on_gpu):
            yield self.probe.estimate
        if self.gpu_check and on_gpu:
            yield self.gpu_check.estimate(size)
        yield from (each.estimate(size) for each in finished)
