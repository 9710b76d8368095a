"""Choose the cheapest way to render that reaches a scene's target error.

Each way (plain, adaptive, denoised, both) is tried on probe views with ever more effort until it
reaches the target, and its effort is then interpolated to meet the target, not to surpass it. The
cheapest is chosen, and held-out views, the nearest other cameras under other seeds, confirm it.

Cost is counted in samples a pixel, not in seconds, so that a scene makes the same choice each time:
the bytes of its views follow from it. `lightfield.measurement.metrics` defines the error.
"""

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from lightfield.core.cli import run
from lightfield.core.files import write_json
from lightfield.dataset.lightfield import LightField
from lightfield.measurement import metrics, trials
from lightfield.measurement.calibration import DENOISING_SAMPLES, cost_in_samples

# A reference takes renders of so many samples until its own error is this part of the target.
REFERENCE_SAMPLES = 16
REFERENCE_PART = 0.2
FEWEST_SEEDS, MOST_SEEDS = 4, 256

PROBE_SEED, HELD_OUT_SEED = 1, 2

# Plain path tracing is measured to here; beyond, its error is inversely proportional to samples.
MOST_PLAIN_SAMPLES = 64
# What adaptive sampling may take; of it, the threshold is chosen.
MOST_ADAPTIVE_SAMPLES = 4096
FIRST_THRESHOLD, LEAST_THRESHOLD = 0.4, 1e-4

# Within this part of the target a way is as good as on it.
CLOSE = 0.05
# Within this part of the target, held-out views confirm the choice.
CONFIRMED = 0.2


@dataclass(frozen=True)
class Measurement:
    """One way at one effort, on the probe views: means over these.

    ``samples`` are those that a pixel took, ``cost`` adds the denoiser's, and ``error`` is the
    relative mean squared error. ``seconds`` are those of one core or of the GPU, a megapixel.
    """

    way: str
    settings: Mapping[str, Any]
    samples: float
    cost: float
    error: float
    seconds: float

    def evidence(self) -> dict[str, Any]:
        """Return what is the same every time."""
        return {key: value for key, value in asdict(self).items() if key != "seconds"}


class Bench:
    """Some views, their references, and what was measured on them."""

    def __init__(
        self,
        maker: trials.Trials,
        probes: Sequence[trials.Probe],
        seed: int,
        target: float,
        exposure: float | None = None,
    ) -> None:
        self.maker, self.probes, self.seed = maker, probes, seed
        self._exposure = exposure
        self.seeds = FEWEST_SEEDS
        self._make_references()
        while self.own_error > REFERENCE_PART * target and self.seeds < MOST_SEEDS:
            self.seeds *= 2
            self._make_references()

    def _make_references(self) -> None:
        found = []
        for number, probe in enumerate(self.probes, 1):
            found.append(self.maker.reference(probe, self.seeds, REFERENCE_SAMPLES))
            tell(f"reference {number} of {len(self.probes)}, {self.seeds * REFERENCE_SAMPLES} spp")
        self.references = metrics.exposed_alike(found, self._exposure)
        self.own_error = fmean(reference.own_error for reference in self.references)

    def measure(self, way: str, settings: Mapping[str, Any]) -> tuple[Measurement, list[float]]:
        """Render every view under ``settings``; also return the error of each."""
        renders = [self.maker.render(probe, self.seed, settings) for probe in self.probes]
        errors = [
            metrics.relative_mse(render.colour, reference)
            for render, reference in zip(renders, self.references, strict=True)
        ]
        samples = fmean(render.samples for render in renders)
        megapixels = self.probes[0].width * self.probes[0].height / 1e6
        found = Measurement(
            way=way,
            settings={**trials.PLAIN, **settings},
            samples=samples,
            cost=cost_in_samples(samples, settings.get("denoise", False)),
            error=fmean(errors),
            seconds=fmean(render.seconds for render in renders) / megapixels,
        )
        tell(f"{way} {settings}: error {found.error:.3g} at cost {found.cost:.4g}")
        return found, errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--inventory", required=True, type=Path, help="what the scene contains")
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json with render.target_error"
    )
    parser.add_argument(
        "--probes", type=int, default=16, help="windows of views, as many held out (default: 16)"
    )
    parser.add_argument("--size", type=int, default=64, help="of their sides (default: 64)")
    parser.add_argument("--device", default="auto", help="what Cycles renders on (default: auto)")
    parser.add_argument("--threads", type=int, default=1, help="CPU threads (default: 1)")
    parser.add_argument("--cache", required=True, type=Path, help="folder of what was rendered")
    parser.add_argument("--output", required=True, type=Path, help="JSON of choice and evidence")
    parser.add_argument("--seconds", type=Path, help="JSON of the seconds that each way took")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    render = lightfield.render
    target = render["target_error"]
    maker = trials.Trials(
        arguments.blend,
        arguments.inventory,
        lightfield,
        arguments.device,
        arguments.threads,
        arguments.cache,
    )
    known = maker.probes(arguments.size, arguments.probes)
    views = [view for view in lightfield.views if view not in [p.view for p in known]]
    others = [
        replace(probe, view=trials.neighbour(views, probe.view) or probe.view) for probe in known
    ]
    probes = Bench(maker, known, PROBE_SEED, target)
    limits = render.get("most_samples"), render.get("denoise")
    measured = search(probes, target, *limits)
    choice = choose(eligible(measured, *limits), target)
    equal = plain_samples(measured, choice.error)
    _, known_errors = probes.measure(choice.way, choice.settings)
    held_out = Bench(maker, others, HELD_OUT_SEED, target, probes.references[0].exposure)
    _, errors = held_out.measure(choice.way, choice.settings)
    error = fmean(errors)
    confirmed = abs(error / target - 1) <= CONFIRMED
    record = {
        "target_error": target,
        "metric": "relative mean squared error",
        "choice": choice.settings,
        "way": choice.way,
        "reached": reaches(choice, target),
        "cost_samples": choice.cost,
        "probe_error": choice.error,
        "probe_standard_error": stdev(known_errors) / math.sqrt(len(known_errors)),
        "held_out_error": error,
        "held_out_ratio": error / target,
        "held_out_standard_error": stdev(errors) / math.sqrt(len(errors)),
        "confirmed": confirmed,
        "plain_samples_at_equal_error": equal,
        "times_fewer_samples": equal / choice.cost,
        "denoising_samples": DENOISING_SAMPLES,
        "size": arguments.size,
        "probes": [probe.name for probe in known],
        "held_out": [
            {"probe": probe.name, "error": value}
            for probe, value in zip(others, errors, strict=True)
        ],
        "references": {
            "samples": [bench.seeds * REFERENCE_SAMPLES for bench in (probes, held_out)],
            "own_error": [bench.own_error for bench in (probes, held_out)],
        },
        "candidates": [entry.evidence() for entry in measured],
    }
    write_json(arguments.output, record)
    if arguments.seconds:
        write_json(arguments.seconds, seconds(measured, choice, equal))
    print(
        f"{choice.way}, {choice.settings}: error {choice.error:.3g} on the probe views and "
        f"{error:.3g} ± {record['held_out_standard_error']:.1g} on others, wanted {target:g}; "
        f"{record['times_fewer_samples']:.1f} times cheaper than plain path tracing at equal error"
    )
    if not record["reached"]:
        print(
            f"warning: render.target_error: {target:g} is not reached within the preset's "
            f"{render.get('most_samples')} samples; the best there is has {choice.error:.3g}",
            file=sys.stderr,
        )
    elif not confirmed:
        print(
            f"warning: render.target_error: is {target:g}, and views that the choice does not know "
            f"have {error:.3g}",
            file=sys.stderr,
        )


def search(
    bench: Bench, target: float, most: int | None, denoise: bool | None
) -> list[Measurement]:
    """Try every way, and return what was measured.

    ``most`` limits a pixel's samples, ``denoise``, unless None, rules out the other half.
    """
    limit = math.inf if most is None else most
    found = [
        bench.measure("plain", {"samples": 4**step})[0]
        for step in range(int(math.log(MOST_PLAIN_SAMPLES, 4)) + 1)
    ]
    needed = plain_samples(found, target)
    tell(f"plain path tracing needs {needed:.3g} samples")

    def affordable() -> float:
        costs = [e.cost for e in eligible(found, most, denoise) if reaches(e, target)]
        return min(
            [*costs, *([needed] if not denoise and needed <= limit else [])], default=math.inf
        )

    def counted(effort: float) -> dict[str, Any]:
        return {"samples": math.ceil(effort)}

    def adaptive(effort: float) -> dict[str, Any]:
        threshold = float(f"{1 / effort:.3g}")
        return {"samples": min(limit, MOST_ADAPTIVE_SAMPLES), "adaptive_threshold": threshold}

    for also, counts, thresholds in (
        ({"denoise": True}, "denoised", "adaptive, denoised"),
        ({"denoise": False}, "plain", "adaptive"),
    ):
        if denoise not in (None, also["denoise"]):
            continue
        if counts != "plain":
            found += climb(bench, counts, counted, also, 1, limit, target, affordable())
        found += climb(
            bench,
            thresholds,
            adaptive,
            also,
            1 / FIRST_THRESHOLD,
            1 / LEAST_THRESHOLD,
            target,
            affordable(),
        )
    if not denoise and needed <= affordable():
        found.append(bench.measure("plain", counted(min(needed, limit)))[0])
    return found


def eligible(
    measured: Sequence[Measurement], most: int | None, denoise: bool | None
) -> list[Measurement]:
    """Return what a preset's limits leave to choose from."""
    return [
        entry
        for entry in measured
        if denoise in (None, entry.settings["denoise"])
        and (most is None or entry.settings["samples"] <= most)
    ]


def climb(
    bench: Bench,
    way: str,
    settings_at: Callable[[float], Mapping[str, Any]],
    also: Mapping[str, Any],
    first: float,
    last: float,
    target: float,
    affordable: float,
) -> list[Measurement]:
    """Double a way's effort until it reaches the target, then interpolate to meet it.

    Gives up at effort ``last``, at cost ``affordable``, or where the last two errors, drawn out,
    would take more than that.
    """
    points: list[tuple[float, Measurement]] = []
    effort = first
    while True:
        points.append((effort, bench.measure(way, {**settings_at(effort), **also})[0]))
        now = points[-1][1]
        if reaches(now, target) or effort >= last or now.cost >= affordable:
            break
        # Every pixel takes the most that it may.
        if len(points) > 1 and now.samples == points[-2][1].samples:
            break
        if len(points) > 2:
            before = points[-2][1]
            slope = math.log(now.error / before.error) / math.log(2)
            more = (target / now.error) ** (1 / slope) if slope < 0 else math.inf
            if now.samples * more > 2 * affordable:
                break
        effort = min(2 * effort, last)
    measured = [entry for _, entry in points]
    bracket = points[-2:]
    while len(bracket) == 2 and reaches(bracket[1][1], target):
        if bracket[1][1].error >= target * (1 - CLOSE):
            break
        effort = effort_for(target, [(at, entry.error) for at, entry in bracket])
        settings = {**trials.PLAIN, **settings_at(effort), **also}
        if settings in [entry.settings for entry in measured]:
            break
        measured.append(bench.measure(way, settings)[0])
        side = 1 if reaches(measured[-1], target) else 0
        bracket[side] = (effort, measured[-1])
    return measured


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
    part = math.log(e0 / target) / math.log(e0 / e1)
    return float(x0 * (x1 / x0) ** part)


def reaches(entry: Measurement, target: float) -> bool:
    """Tell whether the error is on the target, or below it."""
    return entry.error <= target * (1 + CLOSE)


def choose(measured: Sequence[Measurement], target: float) -> Measurement:
    """Return the cheapest that reaches the target; if none does, the one with the least error."""
    good = [entry for entry in measured if reaches(entry, target)]
    if good:
        return min(good, key=lambda entry: (entry.cost, entry.error))
    return min(measured, key=lambda entry: entry.error)


def plain_samples(measured: Sequence[Measurement], error: float) -> float:
    """Return how many samples plain path tracing needs for an error."""
    points = sorted((entry.samples, entry.error) for entry in measured if entry.way == "plain")
    return effort_for(error, points)


def seconds(measured: Sequence[Measurement], choice: Measurement, equal: float) -> dict[str, Any]:
    """Return the times, which differ from run to run: core or GPU seconds a megapixel."""
    plain = max((e for e in measured if e.way == "plain"), key=lambda e: e.samples)
    known = plain.seconds * equal / plain.samples
    return {
        "choice": choice.seconds,
        "plain_at_equal_error": known,
        "times_faster": known / choice.seconds,
        "candidates": [
            {"way": entry.way, "settings": entry.settings, "seconds": entry.seconds}
            for entry in measured
        ],
    }


def tell(text: str) -> None:
    print(f"calibration: {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    run(main)
