"""The cheapest way to render that reaches a scene's target error.

Cost is counted in samples a pixel, not in seconds, so that a scene makes the same choice each time:
the bytes of its views follow from it. `lightfield.measurement.metrics` defines the error.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean
from typing import Any

from lightfield.measurement import metrics, strata
from lightfield.measurement.sampling import (
    DENOISING_SAMPLES,
    FEWEST_SEEDS,
    MOST_SEEDS,
    PLAIN,
    PLAIN_SAMPLES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
    cost_in_samples,
    standard_error,
)
from lightfield.measurement.trials import Trials, Window, nearest_view

PROBE_SEED, HELD_OUT_SEED = 1, 2

# Cycles takes no more.
MOST_SAMPLES = 2**24
# What adaptive sampling may take; of it, the threshold is chosen.
MOST_ADAPTIVE_SAMPLES = 4096
FIRST_THRESHOLD, LEAST_THRESHOLD = 0.4, 1e-4

# A way that reaches the target, which leaves out the worst thousandth of pixels, may have so many
# times the error of all pixels that plain path tracing has there: one with more hides fireflies.
MOST_OF_PLAIN = 2

# Within this part of the target a way is as good as on it.
CLOSE = 0.05
# Within this part of the target, held-out views confirm the choice.
CONFIRMED = 0.2


@dataclass(frozen=True)
class Candidate:
    """One way at one effort, on some windows: means over these.

    ``samples`` are those that a pixel took, ``cost`` adds the denoiser's, and ``error`` is the
    relative mean squared error, ``whole_error`` that of all pixels, the worst thousandth too.
    ``seconds`` are those of one core or of the GPU, a megapixel.
    """

    way: str
    settings: Mapping[str, Any]
    samples: float
    cost: float
    error: float
    whole_error: float
    seconds: float

    def evidence(self) -> dict[str, Any]:
        """Return what is the same every time."""
        return {key: value for key, value in asdict(self).items() if key != "seconds"}


class Bench:
    """Some windows, their references, and what is measured on them."""

    def __init__(
        self,
        maker: Trials,
        windows: Sequence[Window],
        seed: int,
        target: float,
        exposure: float | None = None,
    ) -> None:
        self.maker = maker
        self.windows = windows
        self.seed = seed
        self.seeds = FEWEST_SEEDS
        while True:
            self.references = metrics.exposed_alike(self._references(), exposure)
            self.own_error = fmean(reference.own_error for reference in self.references)
            if self.own_error <= REFERENCE_PART * target or self.seeds >= MOST_SEEDS:
                break
            self.seeds *= 2

    def _references(self) -> list[metrics.Reference]:
        found = []
        for number, window in enumerate(self.windows, 1):
            found.append(self.maker.reference(window, self.seeds, REFERENCE_SAMPLES))
            _say(f"reference {number} of {len(self.windows)}, {self.seeds * REFERENCE_SAMPLES} spp")
        return found

    def measure(self, way: str, settings: Mapping[str, Any]) -> tuple[Candidate, list[float]]:
        """Render every window under ``settings``; also return the error of each."""
        renders = [self.maker.render(window, self.seed, settings) for window in self.windows]
        errors, whole = (
            [
                metrics.relative_mse(render.colour, reference, left_out)
                for render, reference in zip(renders, self.references, strict=True)
            ]
            for left_out in (metrics.OUTLIERS, 0)
        )
        samples = fmean(render.samples for render in renders)
        megapixels = self.windows[0].width * self.windows[0].height / 1e6
        found = Candidate(
            way=way,
            settings={**PLAIN, **settings},
            samples=samples,
            cost=cost_in_samples(samples, settings.get("denoise", False)),
            error=fmean(errors),
            whole_error=fmean(whole),
            seconds=fmean(render.seconds for render in renders) / megapixels,
        )
        _say(f"{way} {settings}: error {found.error:.3g} at cost {found.cost:.4g}")
        return found, errors


class Search:
    """Tries every way on a bench, so that ``measured`` holds what to choose from.

    ``most`` limits a pixel's samples, ``denoise``, unless None, rules out the other half.
    """

    def __init__(
        self, bench: Bench, target: float, most: int | None = None, denoise: bool | None = None
    ) -> None:
        self.bench = bench
        self.target = target
        self.denoise = denoise
        self.limit = math.inf if most is None else most
        self.measured = [self._measure("plain", {"samples": n}) for n in PLAIN_SAMPLES]
        self._needed = self.plain_samples(target)
        _say(f"plain path tracing needs {self._needed:.3g} samples")
        # Of all pixels its error is inversely proportional to its samples.
        whole = fmean(entry.whole_error * entry.samples for entry in self.measured)
        self.most_whole_error = MOST_OF_PLAIN * whole / self._needed
        for denoised, counts, thresholds in (
            (True, "denoised", "adaptive, denoised"),
            (False, "plain", "adaptive"),
        ):
            if denoise in (None, denoised):
                also = {"denoise": denoised}
                if denoised:
                    self._climb(counts, _counted, also, 1, self.limit)
                efforts = 1 / FIRST_THRESHOLD, 1 / LEAST_THRESHOLD
                self._climb(thresholds, self._adaptive, also, *efforts)
        if not denoise and self._needed <= self._affordable():
            plain = _counted(min(self._needed, self.limit))
            self.measured.append(self._measure("plain", plain))

    def _measure(self, way: str, settings: Mapping[str, Any]) -> Candidate:
        return self.bench.measure(way, settings)[0]

    def _adaptive(self, effort: float) -> dict[str, Any]:
        threshold = float(f"{1 / effort:.3g}")
        samples = min(self.limit, MOST_ADAPTIVE_SAMPLES)
        return {"samples": samples, "adaptive_threshold": threshold}

    def plain_samples(self, error: float) -> float:
        """Return how many samples plain path tracing needs for an error."""
        plain = (entry for entry in self.measured if entry.way == "plain")
        return effort_for(error, sorted((entry.samples, entry.error) for entry in plain))

    def reaches(self, entry: Candidate) -> bool:
        """Return whether the error is on the target, or below it, and not by hiding fireflies."""
        honest = entry.way == "plain" or entry.whole_error <= self.most_whole_error
        return honest and entry.error <= self.target * (1 + CLOSE)

    def _eligible(self) -> list[Candidate]:
        """Return what the limits leave to choose from."""
        return [
            entry
            for entry in self.measured
            if self.denoise in (None, entry.settings["denoise"])
            and entry.settings["samples"] <= self.limit
        ]

    def _affordable(self) -> float:
        """Return the least cost that is known to reach the target; without any, that of the limit.

        A preset's limit is tried out, whether it is known to suffice or not.
        """
        costs = [entry.cost for entry in self._eligible() if self.reaches(entry)]
        if not self.denoise and self._needed <= self.limit:
            costs.append(self._needed)
        return min(costs, default=MOST_SAMPLES if self.limit == math.inf else math.inf)

    def choose(self) -> Candidate:
        """Return the cheapest that reaches the target; if none does, that of the least error."""
        eligible = self._eligible()
        good = [entry for entry in eligible if self.reaches(entry)]
        if good:
            return min(good, key=lambda entry: (entry.cost, entry.error))
        return min(eligible, key=lambda entry: entry.error)

    def _climb(
        self,
        way: str,
        settings_at: Callable[[float], Mapping[str, Any]],
        also: Mapping[str, Any],
        first: float,
        last: float,
    ) -> None:
        """Double a way's effort until it reaches the target, then interpolate to meet it.

        Gives up at effort ``last``, at a cost that another way reaches the target with, or where
        the last two errors, drawn out, would take more than that.
        """
        affordable = self._affordable()
        points: list[tuple[float, Candidate]] = []
        effort = first
        while True:
            points.append((effort, self._measure(way, {**settings_at(effort), **also})))
            now = points[-1][1]
            if self.reaches(now) or effort >= last or now.cost >= affordable:
                break
            # Every pixel takes the most that it may.
            if len(points) > 1 and now.samples == points[-2][1].samples:
                break
            if len(points) > 2:
                before = points[-2][1].error
                doublings = 0.0
                if before <= now.error:
                    doublings = math.inf
                elif now.error > self.target:
                    doublings = math.log(now.error / self.target) / math.log(before / now.error)
                if doublings > math.log2(2 * affordable / now.samples):
                    break
            effort = min(2 * effort, last)
        measured = [entry for _, entry in points]
        bracket = points[-2:]
        while len(bracket) == 2 and self.reaches(bracket[1][1]):
            if bracket[1][1].error >= self.target * (1 - CLOSE):
                break
            effort = effort_for(self.target, [(at, entry.error) for at, entry in bracket])
            settings = {**PLAIN, **settings_at(effort), **also}
            if settings in [entry.settings for entry in measured]:
                break
            measured.append(self._measure(way, settings))
            bracket[self.reaches(measured[-1])] = (effort, measured[-1])
        self.measured += measured


def calibrate(
    maker: Trials, render: Mapping[str, Any], size: int, count: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Choose how to render for ``render.target_error``, from ``count`` windows of ``size``².

    Returns the choice with its evidence, which is the same each time, and the seconds that each way
    took, which are not: those of one core or of the GPU, a megapixel.
    """
    target = render["target_error"]
    windows = maker.windows(size, count)
    views = [view for view in maker.lightfield.views if view not in [w.view for w in windows]]
    others = [replace(w, view=nearest_view(views, w.view) or w.view) for w in windows]
    # Before all others: Cycles is set up for the parts of light.
    pilot = maker.pilot()
    kinds = [strata.classes(pilot, window)[0] for window in (*windows, *others)]
    known = Bench(maker, windows, PROBE_SEED, target)
    search = Search(known, target, render.get("most_samples"), render.get("denoise"))
    choice = search.choose()
    # By chance, what is far below the references' own error is measured as nothing, or less.
    equal = search.plain_samples(max(choice.error, known.own_error))
    _, known_errors = known.measure(choice.way, choice.settings)
    held_out = Bench(maker, others, HELD_OUT_SEED, target, known.references[0].exposure)
    _, errors = held_out.measure(choice.way, choice.settings)
    error = fmean(errors)
    record = {
        "target_error": target,
        "metric": "relative mean squared error of all but the worst thousandth of pixels",
        "choice": choice.settings,
        "way": choice.way,
        "reached": search.reaches(choice),
        "cost_samples": choice.cost,
        "probe_error": choice.error,
        "probe_error_of_all_pixels": choice.whole_error,
        "most_error_of_all_pixels": search.most_whole_error,
        "probe_standard_error": standard_error(known_errors),
        "held_out_error": error,
        "held_out_ratio": error / target,
        "held_out_standard_error": standard_error(errors),
        "confirmed": abs(error / target - 1) <= CONFIRMED,
        "plain_samples_at_equal_error": equal,
        "times_fewer_samples": equal / choice.cost,
        "denoising_samples": DENOISING_SAMPLES,
        "size": size,
        "probes": [window.name for window in windows],
        "held_out": [
            {"probe": window.name, "error": value}
            for window, value in zip(others, errors, strict=True)
        ],
        "strata": by_stratum([known, held_out], kinds, choice.settings),
        "references": {
            "samples": [bench.seeds * REFERENCE_SAMPLES for bench in (known, held_out)],
            "own_error": [bench.own_error for bench in (known, held_out)],
        },
        "candidates": [entry.evidence() for entry in search.measured],
    }
    plain = max((e for e in search.measured if e.way == "plain"), key=lambda e: e.samples)
    plain_seconds = plain.seconds * equal / plain.samples
    seconds = {
        "choice": choice.seconds,
        "plain_at_equal_error": plain_seconds,
        "times_faster": plain_seconds / choice.seconds,
        "candidates": [
            {"way": entry.way, "settings": entry.settings, "seconds": entry.seconds}
            for entry in search.measured
        ],
    }
    return record, seconds


def by_stratum(
    benches: Sequence[Bench], kinds: Sequence[strata.Classes], settings: Mapping[str, Any]
) -> dict[str, dict[str, float]]:
    """Return the error that a choice has in each stratum of all windows, and its part of them."""
    places = [(bench, number) for bench in benches for number in range(len(bench.windows))]
    total = sum(int((kind != strata.NONE).sum()) for kind in kinds)
    found = {}
    for number, name in enumerate(strata.STRATA):
        errors, pixels = [], []
        for (bench, place), kind in zip(places, kinds, strict=True):
            reference = replace(bench.references[place], part=kind == number)
            count = int(reference.counted.sum())
            if count >= strata.FEWEST_PIXELS:
                render = bench.maker.render(bench.windows[place], bench.seed, settings)
                errors.append(metrics.relative_mse(render.colour, reference))
                pixels.append(count)
        if errors:
            error = fmean(errors, weights=pixels)
            found[name] = {"area": sum(pixels) / total, "error": error}
    return found


def effort_for(target: float, points: Sequence[tuple[float, float]]) -> float:
    """Return the effort at which the error is ``target``, from (effort, error) in rising order.

    Between points the error is a power of the effort; after the last it is inversely proportional.
    """
    below = next((i for i, (_, error) in enumerate(points) if error <= target), None)
    if below is None:
        effort, error = points[-1]
        return effort * error / target
    if below == 0:
        return points[0][0]
    (x0, e0), (x1, e1) = points[below - 1 : below + 1]
    # By chance an error far below the reference's own is measured as nothing, or less.
    part = math.log(e0 / target) / math.log(e0 / max(e1, 1e-6 * target))
    return float(x0 * (x1 / x0) ** part)


def _counted(effort: float) -> dict[str, Any]:
    return {"samples": math.ceil(effort)}


def _say(text: str) -> None:
    print(f"calibration: {text}", file=sys.stderr, flush=True)
