"""Finds the cheapest method that reaches a scene's target error.

Cost is counted in samples of a pixel, not in seconds. So a scene makes the same choice each time,
and the bytes of its views follow from the choice. `lightfield.measurement.metrics` defines the
error.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_json
from lightfield.formats.lightfield import LightField
from lightfield.formats.render_block import MeasuredTargetError, RenderBlock
from lightfield.measurement import bias, metrics, strata
from lightfield.measurement.effort import effort_for, whole_samples
from lightfield.measurement.experiment import Experiment, Method, split_by_stratum
from lightfield.measurement.trials import Trials, ViewWindow, nearest_view
from lightfield.planning.sampling import (
    BIAS_PART,
    DENOISING_SAMPLES,
    FEWEST_BIAS_SEEDS,
    FEWEST_SEEDS,
    MOST_BIAS_SEEDS,
    MOST_SEEDS,
    PLAIN,
    PLAIN_SAMPLES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
    cost_in_samples,
    reference_of_samples,
    standard_error,
)
from lightfield.stages.measurement import Calibrate

_PROBE_SEED = 1
_HELD_OUT_SEED = 2

# Cycles' largest number of samples of a pixel.
MOST_SAMPLES = 2**24
# The most samples of adaptive sampling. The calibration chooses its threshold.
_MOST_ADAPTIVE_SAMPLES = 4096
_FIRST_THRESHOLD = 0.4
_LEAST_THRESHOLD = 1e-4

# The target leaves out the worst thousandth of pixels. A method that reaches it may have at most
# this many times the error of all pixels of plain path tracing at the target. More hides fireflies.
_MOST_OF_PLAIN = 2

# The least error that is worth a target: about the error of rounding light to half floats.
_LEAST_TARGET = 1e-8

# An error within this part of the target counts as on the target.
_CLOSE = 0.05
# Held-out views confirm the choice if their error is within this part of the target.
_CONFIRMED = 0.2


@dataclass(frozen=True)
class Candidate:
    """A method at one effort: means over some windows.

    - ``samples``: the samples that a pixel took. ``cost`` adds the denoiser's time in samples.
    - ``error``: the relative mean squared error without the worst thousandth of pixels.
      ``whole_error`` includes it.
    - ``seconds``: the time that one core, or the GPU, takes for a megapixel.
    """

    way: str
    settings: Mapping[str, Any]
    samples: float
    cost: float
    error: float
    whole_error: float
    seconds: float

    @property
    def method(self) -> Method:
        """The method that was measured."""
        return Method(self.way, self.settings)

    def evidence(self) -> dict[str, Any]:
        """Return the figures that are the same in every calibration."""
        return {key: value for key, value in asdict(self).items() if key != "seconds"}


class Bench:
    """An experiment with one seed. Its references are good enough for a target error.

    The references take more seeds until their own error is a small part of the ``target``. For the
    error of so many samples, `reference_of_samples` says how many they need. ``exposure`` is the
    references' exposure. Without it, their own light decides.
    """

    def __init__(
        self,
        renderer: Trials,
        windows: Sequence[ViewWindow],
        seed: int,
        target: float | MeasuredTargetError,
        exposure: float | None = None,
    ) -> None:
        self.seed = seed
        if isinstance(target, MeasuredTargetError):
            self.reference_seeds, self.samples_of_seed = reference_of_samples(target.of_samples)
            most_error = math.inf
        else:
            self.reference_seeds, self.samples_of_seed = FEWEST_SEEDS, REFERENCE_SAMPLES
            most_error = REFERENCE_PART * target
        while True:
            references = metrics.exposed_alike(self._references(renderer, windows), exposure)
            self.experiment = Experiment(renderer, windows, references)
            self.own_error = self.experiment.reference_error
            if self.own_error <= most_error or self.reference_seeds >= MOST_SEEDS:
                break
            self.reference_seeds *= 2

    @property
    def reference_samples(self) -> int:
        """The samples of a pixel of the references, with all seeds."""
        return self.reference_seeds * self.samples_of_seed

    def _references(
        self, renderer: Trials, windows: Sequence[ViewWindow]
    ) -> list[metrics.Reference]:
        references = []
        for number, window in enumerate(windows, 1):
            references.append(
                renderer.reference(window, self.reference_seeds, self.samples_of_seed)
            )
            _print_progress(f"reference {number} of {len(windows)}, {self.reference_samples} spp")
        return references

    def measure(self, method: Method) -> Candidate:
        """Render every window with a method, and return the means."""
        self.experiment.run([method], [self.seed])
        samples = fmean(trial.samples for (trial,) in self.experiment.renders(method))
        candidate = Candidate(
            way=method.name,
            settings={**PLAIN, **method.settings},
            samples=samples,
            cost=cost_in_samples(samples, method.settings.get("denoise", False)),
            error=fmean(self.errors(method)),
            whole_error=fmean(self.errors(method, left_out=0)),
            seconds=fmean(seconds for (seconds,) in self.experiment.seconds(method)),
        )
        _print_progress(
            f"{method.name} {method.settings}: error {candidate.error:.3g} "
            f"at cost {candidate.cost:.4g}"
        )
        return candidate

    def errors(self, method: Method, left_out: float = metrics.OUTLIERS) -> list[float]:
        """Return the error of each window, rendered with a measured method."""
        by_window = self.experiment.errors(method, self.experiment.all_windows, left_out)
        return [error for (error,) in by_window]


class Search:
    """Measures every method at rising effort. ``measured`` holds the candidates to choose from.

    ``measure`` renders a method and returns its figures, as `Bench.measure` does. The ``target``
    may be the error of so many samples, which is then measured first. ``most`` limits a pixel's
    samples. ``denoise`` True or False leaves out the methods without or with the denoiser.
    """

    def __init__(
        self,
        measure: Callable[[Method], Candidate],
        target: float | MeasuredTargetError,
        most: int | None = None,
        denoise: bool | None = None,
    ) -> None:
        self.measure = measure
        self.denoise = denoise
        self.limit = math.inf if most is None else most
        counts = {*PLAIN_SAMPLES}
        if isinstance(target, MeasuredTargetError):
            counts.add(target.of_samples)
        self.measured = [measure(Method("plain", {"samples": n})) for n in sorted(counts)]
        self.target = self._error_of(target)
        self._plain_samples_needed = self.plain_samples(self.target)
        _print_progress(f"plain path tracing needs {self._plain_samples_needed:.3g} samples")
        # The error of all pixels of plain path tracing is inversely proportional to its samples.
        error_of_one_sample = fmean(e.whole_error * e.samples for e in self.measured)
        self.most_whole_error = _MOST_OF_PLAIN * error_of_one_sample / self._plain_samples_needed
        if denoise in (None, True):
            self._climb("denoised", _with_samples, {"denoise": True}, 1, self.limit)
            self._climb_thresholds("adaptive, denoised", {"denoise": True})
        if denoise in (None, False):
            self._climb_thresholds("adaptive", {"denoise": False})
        if not denoise and self._plain_samples_needed <= self._affordable():
            plain = _with_samples(min(self._plain_samples_needed, self.limit))
            if plain["samples"] not in counts:
                self.measured.append(measure(Method("plain", plain)))

    def _error_of(self, target: float | MeasuredTargetError) -> float:
        """Return the target error as a number. A scene without noise has a very small one."""
        if not isinstance(target, MeasuredTargetError):
            return target
        errors = [entry.error for entry in self.measured if entry.samples == target.of_samples]
        return max(*errors, _LEAST_TARGET)

    def plain_samples(self, error: float) -> float:
        """Return how many samples plain path tracing needs for an error."""
        plain = (entry for entry in self.measured if entry.way == "plain")
        return effort_for(error, sorted((entry.samples, entry.error) for entry in plain))

    def reaches(self, entry: Candidate) -> bool:
        """Return whether the error is at most the target, without hiding fireflies."""
        keeps_fireflies = entry.way == "plain" or entry.whole_error <= self.most_whole_error
        return keeps_fireflies and entry.error <= self.target * (1 + _CLOSE)

    def choose(self) -> Candidate:
        """Return the cheapest candidate that reaches the target, or the one with least error."""
        eligible = self._eligible()
        good = [entry for entry in eligible if self.reaches(entry)]
        if good:
            return min(good, key=lambda entry: (entry.cost, entry.error))
        return min(eligible, key=lambda entry: entry.error)

    def _eligible(self) -> list[Candidate]:
        """Return the candidates within the limits."""
        return [
            entry
            for entry in self.measured
            if self.denoise in (None, entry.settings["denoise"])
            and entry.settings["samples"] <= self.limit
        ]

    def _affordable(self) -> float:
        """Return the least known cost that reaches the target.

        If there is none, return Cycles' largest number of samples. Under a limit return infinity
        instead, so that the limit itself is tried.
        """
        costs = [entry.cost for entry in self._eligible() if self.reaches(entry)]
        if not self.denoise and self._plain_samples_needed <= self.limit:
            costs.append(self._plain_samples_needed)
        return min(costs, default=MOST_SAMPLES if self.limit == math.inf else math.inf)

    def _climb_thresholds(self, name: str, fixed: Mapping[str, Any]) -> None:
        """Climb with ever lower thresholds of adaptive sampling. The effort is the inverse."""

        def with_threshold(effort: float) -> dict[str, Any]:
            threshold = float(f"{1 / effort:.3g}")
            samples = min(self.limit, _MOST_ADAPTIVE_SAMPLES)
            return {"samples": samples, "adaptive_threshold": threshold}

        self._climb(name, with_threshold, fixed, 1 / _FIRST_THRESHOLD, 1 / _LEAST_THRESHOLD)

    def _climb(
        self,
        name: str,
        settings_at: Callable[[float], Mapping[str, Any]],
        fixed: Mapping[str, Any],
        first: float,
        last: float,
    ) -> None:
        """Double a method's effort until it reaches the target. Then interpolate to meet it.

        ``settings_at`` returns the settings of an effort. ``fixed`` settings are added. Gives up at
        effort ``last``, or when the target will cost more than with another method.
        """
        points = self._double(name, settings_at, fixed, first, last)
        measured = [entry for _, entry in points]
        bracket = points[-2:]
        while len(bracket) == 2 and self.reaches(bracket[1][1]):
            if bracket[1][1].error >= self.target * (1 - _CLOSE):
                break
            effort = effort_for(self.target, [(at, entry.error) for at, entry in bracket])
            settings = {**PLAIN, **settings_at(effort), **fixed}
            if settings in [entry.settings for entry in measured]:
                break
            measured.append(self.measure(Method(name, settings)))
            bracket[self.reaches(measured[-1])] = (effort, measured[-1])
        self.measured += measured

    def _double(
        self,
        name: str,
        settings_at: Callable[[float], Mapping[str, Any]],
        fixed: Mapping[str, Any],
        first: float,
        last: float,
    ) -> list[tuple[float, Candidate]]:
        """Return (effort, candidate) of doubled efforts, until the target or until it gives up."""
        affordable = self._affordable()
        points: list[tuple[float, Candidate]] = []
        effort = first
        while True:
            candidate = self.measure(Method(name, {**settings_at(effort), **fixed}))
            points.append((effort, candidate))
            at_end = effort >= last or candidate.cost >= affordable
            if self.reaches(candidate) or at_end:
                return points
            # Every pixel already takes the most samples that it may.
            if len(points) > 1 and candidate.samples == points[-2][1].samples:
                return points
            if len(points) > 2 and self._is_hopeless(points[-2][1], candidate, affordable):
                return points
            effort = min(2 * effort, last)

    def _is_hopeless(self, before: Candidate, now: Candidate, affordable: float) -> bool:
        """Return whether the target will cost too much, extrapolated from the last doubling."""
        doublings = 0.0
        if before.error <= now.error:
            doublings = math.inf
        elif now.error > self.target:
            doublings = math.log(now.error / self.target) / math.log(before.error / now.error)
        return doublings > math.log2(2 * affordable / now.samples)


def write(job: Calibrate) -> None:
    """Write a scene's choice, and the seconds of each method. Warns if the choice is not good.

    Raises `UserError` if the scene has no target error.
    """
    lightfield = LightField.read(job.lightfield)
    if lightfield.render.target_error is None:
        raise UserError(f"{job.lightfield}: render: is missing the key target_error")
    renderer = Trials.of(job, lightfield)
    settings = job.settings
    record, seconds = calibrate(renderer, lightfield.render, settings.size, settings.probes)
    write_json(job.output, record)
    if job.seconds:
        write_json(job.seconds, seconds)
    print(_summary(absolute_path(job.lightfield).parent.name, record))
    warning = _problem(record, lightfield.render.most_samples)
    if warning:
        print(f"warning: render.target_error: {warning}", file=sys.stderr)


def _summary(name: str, record: Mapping[str, Any]) -> str:
    """Return the choice and its errors in one line."""
    wanted = f"{record['target_error']:.3g}"
    if "of_samples" in record:
        wanted += f", the error of {record['of_samples']} samples of plain path tracing"
    reached = (f"{stratum} {part['error']:.2g}" for stratum, part in record["strata"].items())
    return (
        f"note: {name}: {record['way']}, {record['choice']}: "
        f"error {record['probe_error']:.3g} on the probe views and "
        f"{record['held_out_error']:.3g} ± {record['held_out_standard_error']:.1g} on others, "
        f"wanted {wanted}; {record['times_fewer_samples']:.1f} times cheaper "
        "than plain path tracing at equal error; the worst thousandth of pixels left out, with "
        f"which it is {record['probe_error_of_all_pixels']:.3g}; {_bias_text(record['bias'])}; "
        f"by the light that pixels show most of: {', '.join(reached)}"
    )


def _bias_text(figures: Mapping[str, Any] | None) -> str:
    """Return a choice's bias, and how much of it neighbouring views share, as a clause."""
    if figures is None:
        return "all of it is noise"
    part = figures["squared_bias"] / figures["error"]
    text = f"bias² is {max(part, 0):.0%} of the error of all pixels, and the rest is noise"
    if figures["correlation"] is None:
        return text
    return (
        f"{text}; where neighbouring views see the same surface, their biases have the correlation "
        f"{figures['correlation']:.2f}"
    )


def _problem(record: Mapping[str, Any], most_samples: int | None) -> str | None:
    """Return what is wrong with the choice. None if it reaches the target and is confirmed."""
    target = record["target_error"]
    error = record["probe_error"]
    held_out_error = record["held_out_error"]
    if not record["reached"] and error <= target:
        return (
            f"{target:g} is reached, but the error of all pixels is "
            f"{record['probe_error_of_all_pixels']:.3g}: bright ones are missing"
        )
    if not record["reached"]:
        return (
            f"{target:g} is not reached within the preset's {most_samples} samples; "
            f"the best there is has {error:.3g}"
        )
    if not record["confirmed"] and held_out_error > target:
        return f"is {target:g}, but held-out views have the error {held_out_error:.3g}"
    return None


def calibrate(
    renderer: Trials, render: RenderBlock, size: int, count: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Choose how to render for ``render.target_error``, from ``count`` windows of ``size``².

    Returns the choice with its evidence, which is the same each time. Also returns the seconds that
    each method took on one core, or on the GPU, for a megapixel. They vary.
    """
    wanted = render.target_error
    assert wanted is not None
    windows = renderer.windows(size, count)
    unseen_windows = _held_out_windows(renderer, windows)
    # The pilot renders first, because it sets up Cycles for the parts of light.
    classes = strata.classes_of(renderer, [*windows, *unseen_windows])
    bench = Bench(renderer, windows, _PROBE_SEED, wanted)
    search = Search(bench.measure, wanted, render.most_samples, render.given_denoise)
    target = search.target
    choice = search.choose()
    held_out = Bench(
        renderer, unseen_windows, _HELD_OUT_SEED, wanted, bench.experiment.references[0].exposure
    )
    for each in (bench, held_out):
        each.measure(choice.method)
    # An error far below the references' own may be measured as 0 or less by chance.
    least_error = min(bench.own_error, target)
    plain_samples = search.plain_samples(max(choice.error, least_error))
    record: dict[str, Any] = {
        **_choice_evidence(search, choice, bench),
        **confirmation(held_out.errors(choice.method), target),
        "plain_samples_at_equal_error": plain_samples,
        "times_fewer_samples": plain_samples / choice.cost,
        "denoising_samples": DENOISING_SAMPLES,
        "size": size,
        "probes": [window.name for window in windows],
        "held_out": [
            {"probe": window.name, "error": error}
            for window, error in zip(unseen_windows, held_out.errors(choice.method), strict=True)
        ],
        "bias": _bias_of(choice, bench, held_out),
        "strata": _errors_by_stratum([bench, held_out], classes, choice.method),
        "references": {
            "samples": [each.reference_samples for each in (bench, held_out)],
            "own_error": [each.own_error for each in (bench, held_out)],
        },
        "candidates": [entry.evidence() for entry in search.measured],
    }
    if isinstance(wanted, MeasuredTargetError):
        record["of_samples"] = wanted.of_samples
    return record, _seconds_taken(search, choice, plain_samples)


def _bias_of(choice: Candidate, bench: Bench, held_out: Bench) -> dict[str, Any] | None:
    """Return the bias of the choice. None for plain path tracing, which has none.

    A window and its held-out window are neighbours.
    """
    if choice.way == "plain":
        return None
    affordable = int(BIAS_PART * bench.reference_samples / choice.samples)
    pair = bench.experiment, held_out.experiment
    return bias.measure(
        bench.experiment.renderer,
        list(zip(*(each.windows for each in pair), strict=True)),
        list(zip(*(each.references for each in pair), strict=True)),
        choice.method,
        min(MOST_BIAS_SEEDS, max(FEWEST_BIAS_SEEDS, affordable)),
    ).figures()


def _held_out_windows(renderer: Trials, windows: Sequence[ViewWindow]) -> list[ViewWindow]:
    """Return each window's place in the nearest view without a window, or else in its own view."""
    views_of_windows = [window.view for window in windows]
    views = [view for view in renderer.lightfield.views if view not in views_of_windows]
    held_out = []
    for window in windows:
        held_out.append(replace(window, view=nearest_view(views, window.view) or window.view))
    return held_out


def _choice_evidence(search: Search, choice: Candidate, bench: Bench) -> dict[str, Any]:
    """Return the choice, and its errors on the bench that chose it."""
    return {
        "target_error": search.target,
        "metric": "relative mean squared error of all but the worst thousandth of pixels",
        "choice": choice.settings,
        "way": choice.way,
        "reached": search.reaches(choice),
        "cost_samples": choice.cost,
        "probe_error": choice.error,
        "probe_error_of_all_pixels": choice.whole_error,
        "most_error_of_all_pixels": search.most_whole_error,
        "probe_standard_error": standard_error(bench.errors(choice.method)),
    }


def confirmation(errors: Sequence[float], target: float) -> dict[str, Any]:
    """Return whether the errors of held-out windows confirm the choice."""
    error = fmean(errors)
    return {
        "held_out_error": error,
        "held_out_ratio": error / target,
        "held_out_standard_error": standard_error(errors),
        "confirmed": abs(error / target - 1) <= _CONFIRMED,
    }


def _seconds_taken(search: Search, choice: Candidate, plain_samples: float) -> dict[str, Any]:
    """Return the seconds of the choice, of all candidates, and of ``plain_samples`` samples."""
    plain = max((e for e in search.measured if e.way == "plain"), key=lambda e: e.samples)
    plain_seconds = plain.seconds * plain_samples / plain.samples
    return {
        "choice": choice.seconds,
        "plain_at_equal_error": plain_seconds,
        "times_faster": plain_seconds / choice.seconds,
        "candidates": [
            {"way": entry.way, "settings": entry.settings, "seconds": entry.seconds}
            for entry in search.measured
        ],
    }


def _errors_by_stratum(
    benches: Sequence[Bench], classes: Sequence[strata.Classes], method: Method
) -> dict[str, dict[str, float]]:
    """Return the error of a measured method in each stratum of all windows, and the stratum's area.

    ``classes`` has the strata of the benches' windows, one bench after the other. The area is the
    part of the windows' pixels. The windows' errors are weighted by it, too.
    """
    references = [reference for bench in benches for reference in bench.experiment.references]
    trials = [trial for bench in benches for (trial,) in bench.experiment.renders(method)]
    total = sum(int((kinds != strata.NONE).sum()) for kinds in classes)
    errors = {}
    for stratum, parts in split_by_stratum(references, classes).items():
        pixels = [int(reference.counted.sum()) for reference in parts.values()]
        by_window = [
            metrics.relative_mse(trials[number].colour, reference)
            for number, reference in parts.items()
        ]
        errors[stratum] = {"area": sum(pixels) / total, "error": fmean(by_window, weights=pixels)}
    return errors


def _with_samples(effort: float) -> dict[str, Any]:
    return {"samples": whole_samples(effort)}


def _print_progress(text: str) -> None:
    print(f"calibration: {text}", file=sys.stderr, flush=True)
