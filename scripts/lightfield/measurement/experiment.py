"""The experiment behind every measurement of rendering: methods, windows, references, errors.

`Experiment.run` renders each window with each `Method` and several seeds. The errors come from
comparing these renders with a reference of the same window (see `metrics`). `error_vs_time`,
`advice` and `calibration` choose windows and methods, and report what the experiment measured.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from statistics import fmean, median
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.measurement import metrics, strata
from lightfield.measurement.metrics import Reference
from lightfield.measurement.trials import Trial, Trials, ViewWindow
from lightfield.planning.sampling import DENOISER_KEYS

# The name of all strata together in reports.
WHOLE_VIEWS = "whole views"

# A stratified reference splits its samples among this many seeds. Their differences tell its error.
_REFERENCE_SEEDS = 8

# Denoising a pixel takes up to twice as long in a window of 64² as in a view. From this side on, a
# larger window makes less than a tenth of a difference.
_DENOISED_SIDE = 256
# The denoiser's time is the median over these seeds.
_DENOISED_SEEDS = range(1, 4)

# The correction of a render's time is at most this part of it, so that no load on the machine while
# the denoiser was timed leaves a time below zero.
_MOST_EXCESS = 0.9

# The renders of one method, by window and seed.
Renders = Sequence[Sequence[Trial]]
# References by the number of their window. Windows without a pixel of a stratum have none.
References = Mapping[int, Reference]


@dataclass(frozen=True)
class Method:
    """One way to render: a name for reports, and a change of the scene's ``render`` settings."""

    name: str
    settings: Mapping[str, Any]

    @property
    def key(self) -> str:
        """The key of this method's renders: its settings."""
        return json.dumps(self.settings)


@dataclass(frozen=True)
class Denoising:
    """The seconds that denoising a megapixel takes with some ``settings``.

    ``seconds`` are of a window of ``side`` pixels, ``in_windows`` of the experiment's own windows.
    """

    settings: Mapping[str, Any]
    side: int
    seconds: float
    in_windows: float


class Experiment:
    """Renders ``windows`` with methods, and compares the renders with ``references``.

    ``by_stratum`` holds each stratum's references, in which only the stratum's pixels count.
    ``areas`` holds each stratum's part of the whole views. Without strata, all pixels form one.
    """

    def __init__(
        self,
        renderer: Trials,
        windows: Sequence[ViewWindow],
        references: Sequence[Reference],
        by_stratum: Mapping[str, References] | None = None,
        areas: Mapping[str, float] | None = None,
    ) -> None:
        self.renderer = renderer
        self.windows = windows
        self.references = references
        self.all_windows = dict(enumerate(references))
        self.strata = by_stratum or {WHOLE_VIEWS: self.all_windows}
        areas = areas or {WHOLE_VIEWS: 1.0}
        self.areas = {stratum: areas[stratum] for stratum in self.strata}
        self._renders: dict[str, list[list[Trial]]] = {}
        self._denoising: dict[str, Denoising] = {}

    @classmethod
    def stratified(
        cls,
        renderer: Trials,
        windows: Sequence[ViewWindow],
        areas: Mapping[str, float],
        samples: int,
        name: str,
    ) -> "Experiment":
        """Render references of at least ``samples`` samples a pixel, and split them by stratum.

        ``areas`` is each stratum's part of the whole views. ``name`` starts the progress lines.
        Raises `UserError` if no window has enough pixels of a stratum.
        """
        # The pilot renders first, because it sets up Cycles for the parts of light.
        classes = strata.classes_of(renderer, windows)
        progress = Progress(len(windows), f"{name}: references")
        samples_of_seed = samples_of_reference(samples) // _REFERENCE_SEEDS
        references = []
        for window in windows:
            references.append(renderer.reference(window, _REFERENCE_SEEDS, samples_of_seed))
            progress.done()
        references = metrics.exposed_alike(references)
        by_stratum = split_by_stratum(references, classes)
        counted = {stratum: by_stratum[stratum] for stratum in areas if stratum in by_stratum}
        if not counted:
            raise UserError(
                f"{name}: its windows of {windows[0].width} × {windows[0].height} pixels have no "
                f"{strata.FEWEST_PIXELS} pixels that show the same kind of light; give a larger "
                "--size, or more pixels to the views"
            )
        return cls(renderer, windows, references, counted, areas)

    @cached_property
    def device(self) -> str:
        """The device that Cycles renders on, CPU or GPU."""
        return self.renderer.render(self.windows[0], 1, {"samples": 1}).device

    @property
    def megapixels(self) -> float:
        """The size of a window. All have the same size."""
        return self.windows[0].megapixels

    def run(self, methods: Iterable[Method], seeds: Sequence[int], title: str = "") -> None:
        """Render all windows with all methods and seeds. A ``title`` starts the progress lines.

        Methods take turns, so that another load on the machine slows all of them alike. The time of
        denoised renders is corrected: it counts denoising as in a large window.
        """
        by_key = {method.key: method for method in methods}
        for key in by_key:
            self._renders[key] = [[] for _ in self.windows]
        count = len(seeds) * len(self.windows) * len(by_key)
        progress = Progress(count, title, "renders") if title else None
        for seed in seeds:
            for number, window in enumerate(self.windows):
                for key, method in by_key.items():
                    trial = self.renderer.render(window, seed, method.settings)
                    excess = self._denoising_excess(method.settings)
                    excess = min(excess, _MOST_EXCESS * trial.seconds)
                    corrected = replace(trial, seconds=trial.seconds - excess)
                    self._renders[key][number].append(corrected)
                    if progress:
                        progress.done()

    def _denoising_excess(self, settings: Mapping[str, Any]) -> float:
        """Return the seconds that denoising takes longer in a window than in a large window."""
        if not settings.get("denoise"):
            return 0.0
        keys = ("denoise", *DENOISER_KEYS)
        denoiser = {key: settings[key] for key in keys if key in settings}
        key = json.dumps(denoiser)
        if key not in self._denoising:
            self._denoising[key] = self._measured_denoising(denoiser)
        measured = self._denoising[key]
        return (measured.in_windows - measured.seconds) * self.megapixels

    def _measured_denoising(self, denoiser: Mapping[str, Any]) -> Denoising:
        """Measure the time of denoising in the first window, and in a large one around it."""
        window = self.windows[0]
        large = window.grown(max(_DENOISED_SIDE, window.width), self.renderer.lens)
        by_window: dict[ViewWindow, list[float]] = {window: [], large: []}
        for seed in _DENOISED_SEEDS:
            for place, seconds in by_window.items():
                plain = self.renderer.render(place, seed, {"samples": 1})
                denoised = self.renderer.render(place, seed, {"samples": 1, **denoiser})
                seconds.append((denoised.seconds - plain.seconds) / place.megapixels)
        return Denoising(denoiser, large.width, median(by_window[large]), median(by_window[window]))

    def renders(self, method: Method) -> Renders:
        """Return the renders of a method from `run`, by window and seed."""
        return self._renders[method.key]

    def errors(
        self, method: Method, references: References, left_out: float = metrics.OUTLIERS
    ) -> list[list[float]]:
        """Return the relative mean squared errors of a method, by window and seed.

        ``left_out`` is the part of the pixels, with the largest errors, that does not count.
        """
        errors = []
        for number, reference in references.items():
            trials = self.renders(method)[number]
            errors.append(
                [metrics.relative_mse(trial.colour, reference, left_out) for trial in trials]
            )
        return errors

    def seconds(self, method: Method, numbers: Iterable[int] | None = None) -> list[list[float]]:
        """Return a method's seconds a megapixel, by window and seed, of all windows or some."""
        renders = self.renders(method)
        chosen = range(len(renders)) if numbers is None else numbers
        return [[trial.seconds / self.megapixels for trial in renders[n]] for n in chosen]

    def over_views(self, values: Mapping[str, float]) -> float:
        """Return the mean of a value of each stratum, weighted by the strata's areas."""
        return over_views(values, self.areas)

    @property
    def reference_error(self) -> float:
        """The expected error of the references themselves, in whole views."""
        return self.over_views(
            {
                stratum: mean_own_error(references.values())
                for stratum, references in self.strata.items()
            }
        )

    def described(self) -> dict[str, Any]:
        """Return the windows of this experiment, and the time of denoising, for its report."""
        return {
            "probes": [window.name for window in self.windows],
            "size": self.windows[0].width,
            "resolution": [self.renderer.lens.width, self.renderer.lens.height],
            "denoising": [asdict(measured) for measured in self._denoising.values()],
        }


def samples_of_reference(least: int) -> int:
    """Return the samples of a stratified reference: at least ``least``, and equal for all seeds."""
    return _REFERENCE_SEEDS * math.ceil(least / _REFERENCE_SEEDS)


def split_by_stratum(
    references: Sequence[Reference], classes: Sequence[strata.Classes]
) -> dict[str, dict[int, Reference]]:
    """Return each stratum's references, in which only its pixels count.

    ``classes`` has the strata of the references' windows. A stratum leaves out windows with fewer
    than `strata.FEWEST_PIXELS` of its pixels. A stratum without any window is left out.
    """
    by_stratum: dict[str, dict[int, Reference]] = {}
    for stratum_number, stratum in enumerate(strata.STRATA):
        for number, (reference, kinds) in enumerate(zip(references, classes, strict=True)):
            part = replace(reference, part=kinds == stratum_number)
            if part.counted.sum() >= strata.FEWEST_PIXELS:
                by_stratum.setdefault(stratum, {})[number] = part
    return by_stratum


def over_views(values: Mapping[str, float], areas: Mapping[str, float]) -> float:
    """Return the mean of a value of each stratum, weighted by the strata's ``areas``."""
    total = sum(areas[stratum] for stratum in values)
    return sum(areas[stratum] * value for stratum, value in values.items()) / total


def mean_own_error(references: Iterable[Reference]) -> float:
    """Return the mean of the references' own expected errors."""
    return fmean(reference.own_error for reference in references)
