"""Finds changes of a scene's settings that reach the same error in less time, on probe windows.

An `Experiment` renders windows of the scene's strata with each change. It also renders them
unchanged, with half, the same and twice the samples. The saving is a factor: the unchanged scene's
time to the change's error, over the change's time. Changes of the denoiser are compared with
denoised renders.

A change that makes a different picture is not a saving. The bias of a change is the mean of the
differences that it makes to renders of equal seeds. If the square of the bias, over all pixels, is
above the variance of the reference, the picture differs. Then the change is not advised. The light
tree and path guiding choose other paths to the same mean, so they are exempt. Changes of a clamp
are reported with their bias, and never advised. Nor are changes without an effect on the scene's
views. `verdict` holds all of this.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean, median
from typing import Any

import numpy as np

from lightfield.configuration.render_settings import CALIBRATED_KEYS
from lightfield.formats.render_block import RenderBlock
from lightfield.measurement import metrics
from lightfield.measurement.effort import effort_for
from lightfield.measurement.experiment import WHOLE_VIEWS, Experiment, Method, References
from lightfield.planning.sampling import DENOISED, DENOISER_KEYS, TRACED, standard_error

# Changes are rendered with this many samples a pixel, the unchanged scene also with half and twice.
SAMPLES = 8
SEEDS = range(1, 5)
# Adaptive sampling has no effect below about thirty samples.
ADAPTIVE = {"samples": 64, "adaptive_threshold": 0.2}
# The verdict on a change that is advised. All others begin with "no", and give the reason.
ADVISED = "yes"
_SAVES_LESS = "no: another change saves more"
# A change is advised if it saves at least the factor WORTH, by SURE standard errors.
_WORTH = 1.03
_SURE = 2.0
# A render slower than this times the median of its seeds was slowed by another load.
_DISTURBED = 1.5

# The methods that changes are compared with: path traced and denoised, at rising samples.
_UNCHANGED = {
    name: [
        Method(name, {"samples": samples, "denoise": name == DENOISED})
        for samples in (SAMPLES // 2, SAMPLES, 2 * SAMPLES)
    ]
    for name in (TRACED, DENOISED)
}

# The keys of an inventory that may cost time.
COSTLY = (
    "volumes",
    "transmission",
    "translucency",
    "transparency",
    "hair",
    "subsurface",
    "emission",
    "procedural",
    "displacement",
)
# The table names at most this many materials, objects or lights of a kind.
_MOST_NAMES = 8


@dataclass(frozen=True)
class Change:
    """A change of a scene's ``render`` block, and the ``settings`` that render it.

    ``compared_with`` names the unchanged renders in `_UNCHANGED`. ``unbiased`` says that the change
    is known to keep the picture.
    """

    compared_with: str
    change: Mapping[str, Any]
    settings: Mapping[str, Any]
    unbiased: bool = False

    @property
    def method(self) -> Method:
        """The method of the experiment that renders this change."""
        return Method(self.compared_with, self.settings)

    def keeps_picture(self, saving: "Saving") -> bool:
        """Return whether the picture stays the same, by what is known or measured."""
        return self.unbiased or saving.bias <= saving.noise


@dataclass(frozen=True)
class Saving:
    """The saving of a change: the unchanged scene takes ``times`` as long to reach the same error.

    - ``uncertainty``: the standard error of ``times`` over seeds.
    - ``times_of_all_pixels``: the same with the worst thousandth of pixels.
    - ``bias`` (squared) and the reference's own ``noise``: relative mean squared errors of all
      pixels.
    - ``light``: the relative change of all light.
    """

    times: float
    uncertainty: float
    times_of_all_pixels: float
    uncertainty_of_all_pixels: float
    bias: float
    noise: float
    light: float


@dataclass(frozen=True)
class Tried:
    """A change, its savings by stratum and of whole views, and the `verdict` on it."""

    change: Change
    savings: Mapping[str, Saving]
    verdict: str

    @property
    def is_advised(self) -> bool:
        """Whether the change is advised."""
        return self.verdict == ADVISED

    @property
    def times(self) -> float:
        """How many times as long whole views take without the change. Only of an advised one."""
        return self.savings[WHOLE_VIEWS].times

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the report."""
        return {
            "of": self.change.compared_with,
            "change": dict(self.change.change),
            "advised": self.is_advised,
            "verdict": self.verdict,
            "savings": {
                stratum: {
                    **asdict(saving),
                    "same_picture": self.change.keeps_picture(saving),
                }
                for stratum, saving in self.savings.items()
            },
        }


@dataclass(frozen=True)
class Figures:
    """The figures of one seed's renders.

    ``error`` leaves out the worst thousandth of pixels. ``seconds`` count for a megapixel.
    """

    error: float
    error_of_all_pixels: float
    seconds: float


@dataclass(frozen=True)
class _PictureDifference:
    """How a change moves the picture: ``bias``, ``noise`` and ``light`` of a `Saving`."""

    bias: float
    noise: float
    light: float


def changes_to_try(sampling: Mapping[str, Any], on_cpu: bool) -> list[Change]:
    """Return the changes to try. ``sampling`` is the scene's current one, by `render` keys."""
    # Cycles guides paths only on processors.
    switches = ("light_tree", "guiding") if on_cpu else ("light_tree",)
    most_bounces = sampling["max_bounces"]
    bounces = [{"max_bounces": n} for n in (most_bounces // 2, most_bounces // 4) if n]
    clamp = sampling["clamp_indirect"]
    clamps = [{"clamp_indirect": n} for n in ((0, clamp / 4) if clamp else (10,))]
    denoisers: list[dict[str, Any]] = [
        {"denoise_quality": "balanced"},
        {"denoise_quality": "fast"},
        {"denoise_prefilter": "fast"},
        {"denoise_prefilter": "none"},
    ]
    traced = {"samples": SAMPLES}
    denoised = {"samples": SAMPLES, "denoise": True}
    changes = []
    for name in switches:
        switched = {name: not sampling[name]}
        changes.append(Change(TRACED, switched, traced | switched, unbiased=True))
    changes += [Change(TRACED, change, traced | change) for change in bounces]
    changes += [Change(TRACED, change, traced | change) for change in clamps]
    threshold = {"adaptive_threshold": ADAPTIVE["adaptive_threshold"]}
    changes.append(Change(TRACED, threshold, ADAPTIVE))
    changes.append(Change(TRACED, {"denoise": True}, denoised))
    changes += [Change(DENOISED, change, denoised | change) for change in denoisers]
    return changes


def measure(
    experiment: Experiment, render: RenderBlock, inventory: Mapping[str, Any], name: str
) -> dict[str, Any]:
    """Try changes that could be cheaper than a scene's ``render`` settings.

    ``inventory`` says what the scene contains, and how its .blend samples. ``name`` starts the
    progress lines.
    """
    title = f"{name}: trials"
    own = own_settings(render, inventory["sampling"])
    changes = changes_to_try(own, experiment.device == "CPU")
    unchanged = [method for methods in _UNCHANGED.values() for method in methods]
    experiment.run([*unchanged, *(change.method for change in changes)], SEEDS, title)
    tried = _best_of_keys([_tried(experiment, change, own) for change in changes])
    for compared_with in _UNCHANGED:
        tried = _together(experiment, tried, compared_with, own, title)
    return {
        "seeds": len(SEEDS),
        "device": experiment.device,
        "strata": experiment.areas,
        "own": {"samples": render.samples, "denoise": render.denoise},
        "unchanged": {
            of: [_unchanged_figures(experiment, method) for method in methods]
            for of, methods in _UNCHANGED.items()
        },
        "tried": [entry.to_json() for entry in tried],
        "yaml": {
            key: value
            for entry in tried
            if entry.is_advised
            for key, value in entry.change.change.items()
        },
        "costly": {"lights": inventory["lights"]}
        | {feature: inventory[feature] for feature in COSTLY if inventory[feature]},
    }


def own_settings(render: RenderBlock, sampling: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scene's settings: its ``render`` block, the .blend's ``sampling``, defaults."""
    defaults = {"denoise_quality": "high", "denoise_prefilter": "accurate"}
    return {**defaults, **sampling, "denoise": render.denoise, **render.to_json()}


def verdict(change: Change, saving: Saving | None, own: Mapping[str, Any]) -> str:
    """Return `ADVISED`, or "no" and why a change is not advised.

    An advised change takes effect in a scene with its `own_settings`, keeps the picture, and surely
    saves time. ``saving`` is the saving in whole views, or None without noise.
    """
    if reason := _without_effect(change.change, own):
        return f"no: {reason}"
    if "clamp_indirect" in change.change:
        return "no: a clamp is only reported"
    if saving is None:
        return "no: the renders have no noise"
    if not change.keeps_picture(saving):
        return "no: another picture"
    if saving.times - _SURE * saving.uncertainty < _WORTH:
        return "no: does not surely save time"
    if saving.times_of_all_pixels + _SURE * saving.uncertainty_of_all_pixels < 1:
        return "no: hides rare bright pixels"
    return ADVISED


def _without_effect(change: Mapping[str, Any], own: Mapping[str, Any]) -> str | None:
    """Return why a scene YAML with a change renders the same, or is refused. None if neither."""
    if all(own.get(key) == value for key, value in change.items()):
        return "your own setting"
    if "target_error" in own and not change.keys().isdisjoint(CALIBRATED_KEYS):
        return "your target_error chooses it"
    if "light_groups" in own and "denoise" in change:
        return "your light_groups must add up to the colour"
    if not own["denoise"] and not change.keys().isdisjoint(DENOISER_KEYS):
        return "your views are not denoised"
    return None


def _tried(experiment: Experiment, change: Change, own: Mapping[str, Any]) -> Tried:
    """Return a change that was rendered, with its savings and the verdict."""
    by_stratum = savings(experiment, change)
    return Tried(change, by_stratum, verdict(change, by_stratum.get(WHOLE_VIEWS), own))


def _best_of_keys(tried: Sequence[Tried]) -> list[Tried]:
    """Advise only the value that saves most of several values of a key."""
    best: dict[tuple[str, ...], Tried] = {}
    for entry in tried:
        keys = tuple(entry.change.change)
        if entry.is_advised and (keys not in best or entry.times > best[keys].times):
            best[keys] = entry
    return _only_advised(tried, list(best.values()))


def _together(
    experiment: Experiment,
    tried: Sequence[Tried],
    compared_with: str,
    own: Mapping[str, Any],
    title: str,
) -> list[Tried]:
    """Try the advised changes of one comparison together, if they are two or more.

    If they are not advised together, only the one that saves most is.
    """
    others = [entry for entry in tried if entry.change.compared_with != compared_with]
    parts = [entry for entry in tried if entry.is_advised and entry not in others]
    if len(parts) < 2:
        return list(tried)
    combined = _combination([entry.change for entry in parts])
    experiment.run([combined.method], SEEDS, title)
    together = _tried(experiment, combined, own)
    if not together.is_advised:
        best = max(parts, key=lambda entry: entry.times)
        tried = _only_advised(tried, [best, *others])
    return [*tried, together]


def _only_advised(tried: Sequence[Tried], advised: Sequence[Tried]) -> list[Tried]:
    """Take back the advice of all entries but ``advised``."""
    return [
        entry if entry in advised or not entry.is_advised else replace(entry, verdict=_SAVES_LESS)
        for entry in tried
    ]


def _combination(changes: Sequence[Change]) -> Change:
    """Return several changes of one comparison as one."""
    combined: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    for part in changes:
        combined |= part.change
        settings |= part.settings
    unbiased = all(part.unbiased for part in changes)
    return Change(changes[0].compared_with, combined, settings, unbiased)


def savings(experiment: Experiment, change: Change) -> dict[str, Saving]:
    """Return the saving of a change, by stratum and of whole views.

    Leaves out a stratum whose renders are no worse than the reference.
    """
    changed = figures(experiment, change.method)
    unchanged = [figures(experiment, method) for method in _UNCHANGED[change.compared_with]]
    differences = _picture_differences(experiment, change)
    saved = {}
    for stratum, of_seeds in changed.items():
        rising = [by_stratum[stratum] for by_stratum in unchanged]
        difference = differences[stratum]
        least_error = min(seed.error for seeds in (of_seeds, *rising) for seed in seeds)
        if least_error <= difference.noise:
            continue
        times = []
        times_of_all_pixels = []
        for seed, now in enumerate(of_seeds):
            by_error = [(before[seed].seconds, before[seed].error) for before in rising]
            times.append(effort_for(now.error, by_error, before=True) / now.seconds)
            by_error = [
                (before[seed].seconds, before[seed].error_of_all_pixels) for before in rising
            ]
            seconds = effort_for(now.error_of_all_pixels, by_error, before=True)
            times_of_all_pixels.append(seconds / now.seconds)
        saved[stratum] = Saving(
            *_geometric_mean(times), *_geometric_mean(times_of_all_pixels), **asdict(difference)
        )
    return saved


def figures(experiment: Experiment, method: Method) -> dict[str, list[Figures]]:
    """Return the figures of each seed, by stratum and of whole views."""
    by_stratum = {
        stratum: _stratum_figures(experiment, method, references)
        for stratum, references in experiment.strata.items()
    }
    whole_views = []
    for figures_of_seed in zip(*by_stratum.values(), strict=True):
        of_seed = dict(zip(by_stratum, figures_of_seed, strict=True))
        whole_views.append(
            Figures(
                error=experiment.over_views({s: f.error for s, f in of_seed.items()}),
                error_of_all_pixels=experiment.over_views(
                    {s: f.error_of_all_pixels for s, f in of_seed.items()}
                ),
                seconds=experiment.over_views({s: f.seconds for s, f in of_seed.items()}),
            )
        )
    by_stratum[WHOLE_VIEWS] = whole_views
    return by_stratum


def _stratum_figures(
    experiment: Experiment, method: Method, references: References
) -> list[Figures]:
    """Return the figures of each seed: means over the windows of a stratum."""
    errors = experiment.errors(method, references)
    errors_of_all_pixels = experiment.errors(method, references, left_out=0)
    seconds = []
    for of_window in experiment.seconds(method, references):
        limit = _DISTURBED * median(of_window)
        seconds.append([min(value, limit) for value in of_window])
    return [
        Figures(
            fmean(of_window[seed] for of_window in errors),
            fmean(of_window[seed] for of_window in errors_of_all_pixels),
            fmean(of_window[seed] for of_window in seconds),
        )
        for seed in range(len(errors[0]))
    ]


def _unchanged_figures(experiment: Experiment, method: Method) -> dict[str, Any]:
    """Return the samples, the error and the seconds of the unchanged scene in whole views."""
    of_seeds = figures(experiment, method)[WHOLE_VIEWS]
    return {
        "samples": method.settings["samples"],
        "error": fmean(seed.error for seed in of_seeds),
        "seconds": fmean(seed.seconds for seed in of_seeds),
    }


def _picture_differences(experiment: Experiment, change: Change) -> dict[str, _PictureDifference]:
    """Return how a change moves the picture, by stratum and of whole views."""
    changed = experiment.renders(change.method)
    unchanged = experiment.renders(_UNCHANGED[change.compared_with][1])
    by_stratum = {}
    for stratum, references in experiment.strata.items():
        biases = []
        noises = []
        lights = []
        for number, reference in references.items():
            pairs = list(zip(changed[number], unchanged[number], strict=True))
            moved = [
                (reference.colour + now.colour - before.colour).astype(np.float32)
                for now, before in pairs
            ]
            # The reference is its own truth here: only the differences have a variance.
            exact = replace(reference, variance=np.zeros_like(reference.variance))
            biases.append(metrics.bias_and_variance(moved, exact)[0])
            counted = reference.counted
            noises.append(float((reference.variance[counted] * reference.weights).mean()))
            light = fmean(float(now.colour[counted].mean()) for now, _ in pairs)
            light_before = fmean(float(before.colour[counted].mean()) for _, before in pairs)
            lights.append(light / light_before - 1 if light_before else 0.0)
        by_stratum[stratum] = _PictureDifference(fmean(biases), fmean(noises), fmean(lights))
    by_stratum[WHOLE_VIEWS] = _PictureDifference(
        bias=experiment.over_views({s: d.bias for s, d in by_stratum.items()}),
        noise=experiment.over_views({s: d.noise for s, d in by_stratum.items()}),
        light=experiment.over_views({s: d.light for s, d in by_stratum.items()}),
    )
    return by_stratum


def _geometric_mean(factors: Sequence[float]) -> tuple[float, float]:
    """Return the geometric mean of some factors, and its standard error."""
    logarithms = [math.log(factor) for factor in factors]
    mean = math.exp(fmean(logarithms))
    return mean, mean * standard_error(logarithms)


def table(content: Mapping[str, Any]) -> list[str]:
    """Return the lines of the results of `measure`, in Markdown."""
    return [
        *_savings_table(content),
        *_unchanged_table(content),
        *_costly_list(content),
        *_advised_yaml(content),
    ]


def _savings_table(content: Mapping[str, Any]) -> list[str]:
    columns = [WHOLE_VIEWS, *content["strata"]]
    lines = [
        "",
        "## What could be cheaper at equal error",
        "",
        "Each figure is a factor: the unchanged scene takes that many times as long to the same",
        f"error. ± is the standard error over {content['seeds']} seeds. The columns are whole "
        "views,",
        "all their pixels with the worst thousandth, and what pixels show. The bias counts all",
        "pixels, over the noise of the reference. Light is the relative change of all light. A",
        "bias above 1 means another picture, and the change is not advised. The light tree and",
        "guiding are exempt, because their mean is the same. A denoiser is not exempt: its times",
        "are those to the same error, but its picture differs. — is as good as the reference.",
        "",
        f"| change | of | advised | {columns[0]} | all pixels | bias | light "
        f"| {' | '.join(columns[1:])} |",
        "| --- | --- | --- " + "| ---: " * (3 + len(columns)) + "|",
    ]
    for entry in content["tried"]:
        savings_by_stratum = entry["savings"]
        times = [_times(savings_by_stratum.get(stratum)) for stratum in columns]
        whole_views = savings_by_stratum.get(WHOLE_VIEWS)
        details = ["—"] * 3
        if whole_views:
            details = [
                f"{whole_views['times_of_all_pixels']:.2f}",
                f"{whole_views['bias'] / whole_views['noise']:.3g}",
                f"{whole_views['light']:+.2%}",
            ]
        cells = [
            f"`{yaml_of(entry['change'])}`",
            entry["of"],
            entry["verdict"],
            times[0],
            *details,
            *times[1:],
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _unchanged_table(content: Mapping[str, Any]) -> list[str]:
    unit = "a core" if content["device"] == "CPU" else "the GPU"
    return [
        "",
        "Unchanged, in whole views:",
        "",
        f"| of | samples | s of {unit} a megapixel | error |",
        "| --- | ---: | ---: | ---: |",
        *(
            f"| {of} | {point['samples']} | {point['seconds']:.3g} | {point['error']:.2g} |"
            for of, points in content["unchanged"].items()
            for point in points
        ),
    ]


def _costly_list(content: Mapping[str, Any]) -> list[str]:
    lines = ["", "What may cost time in the scene:", ""]
    for kind, names in content["costly"].items():
        more = " …" if len(names) > _MOST_NAMES else ""
        lines.append(f"- {kind}: {len(names)}, {', '.join(names[:_MOST_NAMES])}{more}")
    return lines


def _advised_yaml(content: Mapping[str, Any]) -> list[str]:
    if not content["yaml"]:
        return [
            "",
            "Keep your settings: no change of them surely saves time and keeps the picture.",
        ]
    return [
        "",
        "To use the advised changes:",
        "",
        "```yaml",
        "render:",
        *(f"  {yaml_of({key: value})}" for key, value in content["yaml"].items()),
        "```",
    ]


def _times(saving: Mapping[str, Any] | None) -> str:
    return f"{saving['times']:.2f} ± {saving['uncertainty']:.2f}" if saving else "—"


def yaml_of(change: Mapping[str, Any]) -> str:
    """Return a change as YAML in one line."""
    return ", ".join(f"{key}: {str(value).lower()}" for key, value in change.items())
