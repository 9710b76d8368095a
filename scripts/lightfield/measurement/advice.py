"""Finds changes of a scene's settings that reach the same error in less time, on probe windows.

An `Experiment` renders windows of the scene's strata with each change. It also renders them
unchanged, with half, the same and twice the samples. The saving is a factor: the unchanged scene's
time to the change's error, over the change's time. Changes of the denoiser are compared with
denoised renders.

A change that makes a different picture is not a saving. The bias of a change is the mean of the
differences that it makes to renders of equal seeds. If the square of the bias, over all pixels, is
above the variance of the reference, the picture differs. Then the change is not advised. The light
tree and path guiding choose other paths to the same mean, so they are exempt. Changes of a clamp
are reported with their bias, and never advised.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean, median
from typing import Any

import numpy as np

from lightfield.formats.render_block import RenderBlock
from lightfield.measurement import metrics
from lightfield.measurement.effort import effort_for
from lightfield.measurement.experiment import WHOLE_VIEWS, Experiment, Method, References
from lightfield.planning.sampling import DENOISED, TRACED, standard_error

# Changes are rendered with this many samples a pixel, the unchanged scene also with half and twice.
SAMPLES = 8
SEEDS = range(1, 5)
# Adaptive sampling has no effect below about thirty samples.
ADAPTIVE = {"samples": 64, "adaptive_threshold": 0.2}
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
    is known to keep the picture. A change that is not ``may_be_advised`` is only reported.
    """

    compared_with: str
    change: Mapping[str, Any]
    settings: Mapping[str, Any]
    unbiased: bool = False
    may_be_advised: bool = True

    @property
    def method(self) -> Method:
        """The method of the experiment that renders this change."""
        return Method(self.compared_with, self.settings)


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

    @property
    def same_picture(self) -> bool:
        """Whether the bias is within the noise of the reference."""
        return self.bias <= self.noise


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
    changes += [Change(TRACED, change, traced | change, may_be_advised=False) for change in clamps]
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
    sampling = {**inventory["sampling"], **render.to_json()}
    changes = changes_to_try(sampling, experiment.device == "CPU")
    unchanged = [method for methods in _UNCHANGED.values() for method in methods]
    experiment.run([*unchanged, *(change.method for change in changes)], SEEDS, title)
    measured = [(change, savings(experiment, change)) for change in changes]
    advised = _advised_changes(measured)
    combined = _combination([change for change in advised if change.compared_with == TRACED])
    if combined:
        experiment.run([combined.method], SEEDS, title)
        measured.append((combined, savings(experiment, combined)))
    return {
        "seeds": len(SEEDS),
        "device": experiment.device,
        "strata": experiment.areas,
        "own": {"samples": render.samples, "denoise": render.denoise},
        "unchanged": {
            of: [_unchanged_figures(experiment, method) for method in methods]
            for of, methods in _UNCHANGED.items()
        },
        "tried": [
            {
                "of": change.compared_with,
                "change": dict(change.change),
                "advised": change in advised,
                "savings": {
                    stratum: {**asdict(saving), "same_picture": saving.same_picture}
                    for stratum, saving in by_stratum.items()
                },
            }
            for change, by_stratum in measured
        ],
        "yaml": {key: value for change in advised for key, value in change.change.items()},
        "costly": {"lights": inventory["lights"]}
        | {feature: inventory[feature] for feature in COSTLY if inventory[feature]},
    }


def _advised_changes(measured: Sequence[tuple[Change, Mapping[str, Saving]]]) -> list[Change]:
    """Return the advised changes. Of several values of a key, only the one that saves most."""
    good = [
        (saved[WHOLE_VIEWS].times, change)
        for change, saved in measured
        if is_advised(change, saved.get(WHOLE_VIEWS))
    ]
    good.sort(key=lambda pair: pair[0])
    # Later changes, which save more, replace earlier ones of the same keys.
    by_keys = {tuple(change.change): change for _, change in good}
    return list(by_keys.values())


def _combination(changes: Sequence[Change]) -> Change | None:
    """Return several changes as one, which is only reported. None for fewer than two."""
    if len(changes) < 2:
        return None
    combined: dict[str, Any] = {}
    settings: dict[str, Any] = {}
    for part in changes:
        combined |= part.change
        settings |= part.settings
    return Change(TRACED, combined, settings, may_be_advised=False)


def is_advised(change: Change, saving: Saving | None) -> bool:
    """Return whether a change surely saves time and keeps the picture.

    A denoiser defines its own picture, so its bias is part of its error.
    """
    return (
        saving is not None
        and change.may_be_advised
        and saving.times - _SURE * saving.uncertainty >= _WORTH
        # A change must not save by hiding rare bright pixels.
        and saving.times_of_all_pixels + _SURE * saving.uncertainty_of_all_pixels >= 1
        and (change.compared_with == DENOISED or change.unbiased or saving.same_picture)
    )


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
        "guiding are exempt, because their mean is the same. — is as good as the reference.",
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
                f"{whole_views['bias'] / whole_views['noise']:.2g}",
                f"{whole_views['light']:+.2%}",
            ]
        cells = [
            f"`{_yaml(entry['change'])}`",
            entry["of"],
            "yes" if entry["advised"] else "no",
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
            "Nothing is advised: no change surely saves time and keeps the picture.",
        ]
    return [
        "",
        "To use the advised changes:",
        "",
        "```yaml",
        "render:",
        *(f"  {_yaml({key: value})}" for key, value in content["yaml"].items()),
        "```",
    ]


def _times(saving: Mapping[str, Any] | None) -> str:
    return f"{saving['times']:.2f} ± {saving['uncertainty']:.2f}" if saving else "—"


def _yaml(change: Mapping[str, Any]) -> str:
    return ", ".join(f"{key}: {str(value).lower()}" for key, value in change.items())
