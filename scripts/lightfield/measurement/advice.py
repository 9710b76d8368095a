"""What a scene could be rendered with that is cheaper at equal error: changes tried on its probes.

The probes are the windows of the strata by which `lightfield.measurement.error_vs_time` measures,
with references as its own. Each change of the scene's settings is rendered with the seeds of the
unchanged scene, which is rendered with half and with twice as many samples, too: how much longer
that takes to the change's error is what the change saves. Of a denoiser's settings the same is
asked of denoised renders.

What makes another picture shall not pass for a saving. The mean of the differences that a change
makes, of renders with equal seeds, is its bias. Where the square of that, of all pixels, is above
the variance of the reference, the picture is another one, and the change is not advised. The light
tree and guiding only choose other paths, to the same mean. Of a clamp the bias is said, and nothing
is advised.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean, median
from typing import Any

import numpy as np

from lightfield.core.progress import Progress
from lightfield.measurement import metrics, strata
from lightfield.measurement.calibration import effort_for
from lightfield.measurement.error_vs_time import Renders, referenced, weighted
from lightfield.measurement.sampling import DENOISED, TRACED, standard_error
from lightfield.measurement.trials import Trial, Trials

# Of a pixel in what is tried, and how often; the unchanged scene has half and twice as many, too.
SAMPLES, SEEDS = 8, 4
# Adaptive sampling decides nothing before some thirty samples.
ADAPTIVE = {"samples": 64, "adaptive_threshold": 0.2}
# What saves less is not worth a line, and it must save that by so many standard errors.
WORTH, SURE = 1.03, 2.0
# Of one that takes so many times as long as its other seeds do, the rest is other load.
DISTURBED = 1.5
WHOLE = "whole views"

# What a change is compared with.
BASES: dict[str, list[dict[str, Any]]] = {
    of: [{"samples": n, "denoise": of == DENOISED} for n in (SAMPLES // 2, SAMPLES, 2 * SAMPLES)]
    for of in (TRACED, DENOISED)
}

# Of an inventory what may cost time, and how many names of each are said.
COSTLY = (
    *("volumes", "transmission", "translucency", "transparency", "hair", "subsurface"),
    *("emission", "procedural", "displacement"),
)
MOST_NAMES = 8


@dataclass(frozen=True)
class Try:
    """A change of a scene's ``render`` block, rendered as ``settings`` have it.

    ``of`` says what it is compared with, ``unbiased`` that the picture is known to stay, and
    ``may_be_advised`` is False where it is tried to be reported alone.
    """

    of: str
    change: Mapping[str, Any]
    settings: Mapping[str, Any]
    unbiased: bool = False
    may_be_advised: bool = True


@dataclass(frozen=True)
class Saving:
    """What a change saves: ``times`` as long the unchanged scene takes to the change's error.

    ``uncertainty`` is its standard error over seeds, and ``times_of_all_pixels`` counts the worst
    thousandth of pixels, too. ``bias``, squared, and the reference's own ``noise`` are relative
    mean squared errors of all pixels; ``light`` is by what part all light changes.
    """

    times: float
    uncertainty: float
    times_of_all_pixels: float
    uncertainty_of_all_pixels: float
    bias: float
    noise: float
    light: float

    @property
    def same_picture(self) -> bool:
        """Whether the bias is within the noise of the reference."""
        return self.bias <= self.noise


def tries(own: Mapping[str, Any], on_cpu: bool) -> list[Try]:
    """Return what is tried of a scene whose paths are traced as ``own`` says, by `render` keys."""
    # Elsewhere Cycles has no guiding.
    switches = ("light_tree", "guiding") if on_cpu else ("light_tree",)
    bounces = [{"max_bounces": n} for n in (own["max_bounces"] // 2, own["max_bounces"] // 4) if n]
    clamp = own["clamp_indirect"]
    clamps = [{"clamp_indirect": n} for n in ((0, clamp / 4) if clamp else (10,))]
    denoisers = [{"denoise_quality": quality} for quality in ("balanced", "fast")]
    denoisers += [{"denoise_prefilter": prefilter} for prefilter in ("fast", "none")]
    count = {"samples": SAMPLES}
    return [
        *(
            Try(TRACED, {name: not own[name]}, count | {name: not own[name]}, unbiased=True)
            for name in switches
        ),
        *(Try(TRACED, change, count | change) for change in bounces),
        *(Try(TRACED, change, count | change, may_be_advised=False) for change in clamps),
        Try(TRACED, {"adaptive_threshold": ADAPTIVE["adaptive_threshold"]}, ADAPTIVE),
        Try(TRACED, {"denoise": True}, count | {"denoise": True}),
        *(Try(DENOISED, change, count | {"denoise": True} | change) for change in denoisers),
    ]


# A render's errors, without the worst thousandth of pixels and of all, and seconds a megapixel.
Figures = tuple[float, float, float]


class Probes:
    """The windows of a scene's strata with their references, and what was rendered of them."""

    def __init__(
        self, maker: Trials, size: int, windows: int, reference_samples: int, name: str
    ) -> None:
        self.maker, self.name = maker, name
        self.windows, areas = strata.choose(maker, size, windows)
        _, self.parts = referenced(maker, self.windows, areas, reference_samples, name)
        self.areas = {stratum: areas[stratum] for stratum in self.parts}
        self._renders: dict[str, list[list[Trial]]] = {}

    def render(self, ways: Sequence[Mapping[str, Any]]) -> None:
        """Render all windows in some ways: side by side, so that other load is in all alike."""
        each = {json.dumps(settings): settings for settings in ways}
        self._renders |= {key: [[] for _ in self.windows] for key in each}
        progress = Progress(
            SEEDS * len(self.windows) * len(each), f"{self.name}: trials", "renders"
        )
        for seed in range(1, 1 + SEEDS):
            for number, window in enumerate(self.windows):
                for key, settings in each.items():
                    self._renders[key][number].append(self.maker.render(window, seed, settings))
                    progress.done()

    def of(self, settings: Mapping[str, Any]) -> Renders:
        """Return what `render` has made in one way, by window and seed."""
        return self._renders[json.dumps(settings)]

    def figures(self, settings: Mapping[str, Any]) -> dict[str, list[Figures]]:
        """Return the figures of each seed's renders, by stratum and of whole views."""
        renders = self.of(settings)
        found = {}

        def error(places: Mapping[int, metrics.Reference], seed: int, left_out: float) -> float:
            return fmean(
                metrics.relative_mse(renders[place][seed].colour, reference, left_out)
                for place, reference in places.items()
            )

        def seconds(place: int, seed: int) -> float:
            usual = median(trial.seconds for trial in renders[place])
            return min(renders[place][seed].seconds, DISTURBED * usual)

        for stratum, places in self.parts.items():
            megapixels = next(iter(places.values())).mask.size / 1e6
            found[stratum] = [
                (
                    error(places, seed, metrics.OUTLIERS),
                    error(places, seed, 0),
                    fmean(seconds(place, seed) for place in places) / megapixels,
                )
                for seed in range(SEEDS)
            ]
        found[WHOLE] = []
        for seed in range(SEEDS):
            least, whole, each = (
                weighted({s: found[s][seed][figure] for s in self.parts}, self.areas)
                for figure in range(3)
            )
            found[WHOLE].append((least, whole, each))
        return found

    def saved(self, one: Try) -> dict[str, Saving]:
        """Return what a change saves, by stratum and of whole views.

        A stratum is left out where renders are no worse than their references.
        """
        changed = self.figures(one.settings)
        base = [self.figures(w) for w in BASES[one.of]]
        apart = self._apart(one)
        found = {}
        for stratum, figures in changed.items():
            unchanged = [points[stratum] for points in base]
            errors = [point[0] for points in unchanged for point in points]
            if min(*errors, *(point[0] for point in figures)) <= apart[stratum]["noise"]:
                continue
            times, of_all = (
                [
                    _seconds_for(now[error], [(p[seed][2], p[seed][error]) for p in unchanged])
                    / now[2]
                    for seed, now in enumerate(figures)
                ]
                for error in (0, 1)
            )
            found[stratum] = Saving(*_mean(times), *_mean(of_all), **apart[stratum])
        return found

    def _apart(self, one: Try) -> dict[str, dict[str, float]]:
        """Return bias, noise and light of a change, as `Saving` has them."""
        changed = self.of(one.settings)
        unchanged = self.of(BASES[one.of][1])
        found = {}
        for stratum, places in self.parts.items():
            biases, noises, lights = [], [], []
            for place, reference in places.items():
                pairs = list(zip(changed[place], unchanged[place], strict=True))
                moved = [
                    (reference.colour + n.colour - b.colour).astype(np.float32) for n, b in pairs
                ]
                known = replace(reference, variance=np.zeros_like(reference.variance))
                biases.append(metrics.bias_and_variance(moved, known)[0])
                counted = reference.counted
                noises.append(float((reference.variance[counted] * reference.weights).mean()))
                now, before = (
                    fmean(float(trial.colour[counted].mean()) for trial in trials)
                    for trials in zip(*pairs, strict=True)
                )
                lights.append(now / before - 1 if before else 0.0)
            found[stratum] = {"bias": fmean(biases), "noise": fmean(noises), "light": fmean(lights)}
        found[WHOLE] = {
            figure: weighted({s: found[s][figure] for s in self.parts}, self.areas)
            for figure in ("bias", "noise", "light")
        }
        return found


def _seconds_for(error: float, points: Sequence[tuple[float, float]]) -> float:
    """Return the seconds to an error, from (seconds, error); beyond these in inverse proportion."""
    seconds, most = points[0]
    return seconds * most / error if error >= most else effort_for(error, points)


def _mean(times: Sequence[float]) -> tuple[float, float]:
    """Return the geometric mean of some factors, and its standard error."""
    logs = [math.log(value) for value in times]
    mean = math.exp(fmean(logs))
    return mean, mean * standard_error(logs)


def tried(
    maker: Trials, render: Mapping[str, Any], inventory: Mapping[str, Any], probes: Probes
) -> dict[str, Any]:
    """Try on ``probes`` what could be cheaper than a scene's ``render`` settings.

    ``inventory`` says what the scene contains, and how its .blend traces paths.
    """
    on_cpu = maker.render(probes.windows[0], 1, {"samples": 1}).device == "CPU"
    changes = tries({**inventory["sampling"], **render}, on_cpu)
    probes.render([*BASES[TRACED], *BASES[DENOISED], *(one.settings for one in changes)])
    savings = [(one, probes.saved(one)) for one in changes]
    good = [pair for pair in savings if is_advised(pair[0], pair[1].get(WHOLE))]
    # Of several values of one key that which saves most.
    good.sort(key=lambda pair: pair[1][WHOLE].times)
    taken = list({tuple(one.change): one for one, _ in good}.values())
    traced = [one for one in taken if one.of == TRACED]
    if len(traced) > 1:
        change = {key: value for one in traced for key, value in one.change.items()}
        settings = {key: value for one in traced for key, value in one.settings.items()}
        together = Try(TRACED, change, settings, may_be_advised=False)
        probes.render([settings])
        savings.append((together, probes.saved(together)))
    return {
        "probes": [window.name for window in probes.windows],
        "size": probes.windows[0].width,
        "resolution": [maker.lens.width, maker.lens.height],
        "seeds": SEEDS,
        "device": "CPU" if on_cpu else "GPU",
        "strata": probes.areas,
        "own": {key: render[key] for key in ("samples", "denoise")},
        "unchanged": {
            of: [
                {
                    "samples": way["samples"],
                    "error": fmean(error for error, _, _ in figures),
                    "seconds": fmean(seconds for _, _, seconds in figures),
                }
                for way in ways
                for figures in [probes.figures(way)[WHOLE]]
            ]
            for of, ways in BASES.items()
        },
        "tried": [
            {
                "of": one.of,
                "change": dict(one.change),
                "advised": one in taken,
                "savings": {
                    stratum: {**asdict(saving), "same_picture": saving.same_picture}
                    for stratum, saving in saved.items()
                },
            }
            for one, saved in savings
        ],
        "yaml": {key: value for one in taken for key, value in one.change.items()},
        "costly": {"lights": inventory["lights"]}
        | {feature: inventory[feature] for feature in COSTLY if inventory[feature]},
    }


def is_advised(one: Try, saving: Saving | None) -> bool:
    """Return whether a change saves, surely, and leaves the picture as it is.

    Of denoised renders the picture is what the denoiser makes, and its bias is in its error.
    """
    return (
        saving is not None
        and one.may_be_advised
        and saving.times - SURE * saving.uncertainty >= WORTH
        # Not by hiding what is bright and rare.
        and saving.times_of_all_pixels + SURE * saving.uncertainty_of_all_pixels >= 1
        and (one.of == DENOISED or one.unbiased or saving.same_picture)
    )


# What `table` reads.
SHOWN = ("device", "seeds", "strata", "tried", "unchanged", "threads", "costly", "yaml")


def table(name: str, found: Mapping[str, Any]) -> str:
    """Return what `tried` has found, in Markdown."""
    columns = [WHOLE, *found["strata"]]
    unit = "a core" if found["device"] == "CPU" else "the GPU"
    lines = [
        f"# {name}: what could be cheaper at equal error",
        "",
        "How many times as long the unchanged scene takes to the error of the changed one, ± the",
        f"standard error over {found['seeds']} seeds: of whole views, of all their pixels with the",
        "worst thousandth, and by what pixels show. The bias is that of all pixels, over the noise",
        "of the reference, and light is by what part the whole picture is brighter. Where the bias",
        "is above 1 it is another picture, and nothing is advised, but of the light tree and of",
        "guiding, whose mean is the same; — is as good as the reference.",
        "",
        f"| change | of | advised | {columns[0]} | all pixels | bias | light "
        f"| {' | '.join(columns[1:])} |",
        "| --- | --- | --- " + "| ---: " * (3 + len(columns)) + "|",
    ]
    for one in found["tried"]:
        savings = one["savings"]
        cells = [_times(savings.get(stratum)) for stratum in columns]
        whole = savings.get(WHOLE)
        if whole:
            all_pixels = f"{whole['times_of_all_pixels']:.2f}"
            cells[1:1] = [
                all_pixels,
                f"{whole['bias'] / whole['noise']:.2g}",
                f"{whole['light']:+.2%}",
            ]
        else:
            cells[1:1] = ["—"] * 3
        said = "yes" if one["advised"] else "no"
        lines.append(f"| `{_yaml(one['change'])}` | {one['of']} | {said} | {' | '.join(cells)} |")
    lines += [
        "",
        "Unchanged, of whole views:",
        "",
        f"| of | samples | s of {unit} a megapixel | error |",
    ]
    lines.append("| --- | ---: | ---: | ---: |")
    lines += [
        f"| {of} | {point['samples']} | {point['seconds']:.3g} | {point['error']:.2g} |"
        for of, points in found["unchanged"].items()
        for point in points
    ]
    if found["threads"]:
        lines += [
            "",
            "As processes that fill the same cores, in seconds of a core, idle ones counted:",
            "",
            "| threads a process | processes | s a small view | s to the first view | GB of all |",
            "| ---: | ---: | ---: | ---: | ---: |",
            *(
                f"| {one['threads']} | {one['processes']} | {one['view_core_seconds']:.3g} "
                f"| {one['start_up_core_seconds']:.3g} | {one['memory_bytes'] / 1e9:.2g} |"
                for one in found["threads"]
            ),
        ]
    lines += ["", "What may cost time in the scene:", ""]
    for kind, names in found["costly"].items():
        more = " …" if len(names) > MOST_NAMES else ""
        lines.append(f"- {kind}: {len(names)}, {', '.join(names[:MOST_NAMES])}{more}")
    if found["yaml"]:
        lines += ["", "To take what is advised:", "", "```yaml", "render:"]
        lines += [f"  {_yaml({key: value})}" for key, value in found["yaml"].items()]
        lines += ["```"]
    else:
        lines += [
            "",
            "Nothing is advised: no change saves anything for sure and leaves the picture.",
        ]
    return "\n".join([*lines, ""])


def _times(saving: Mapping[str, Any] | None) -> str:
    return f"{saving['times']:.2f} ± {saving['uncertainty']:.2f}" if saving else "—"


def _yaml(change: Mapping[str, Any]) -> str:
    return ", ".join(f"{key}: {str(value).lower()}" for key, value in change.items())
