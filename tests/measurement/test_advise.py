"""Advice on cheaper settings: from simulated renders with known answers."""

import json
from dataclasses import replace

import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PARTS_OF_LIGHT
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import lenses
from lightfield.measurement import advice, calibration, error_vs_time, strata, trials
from lightfield.measurement.experiment import Experiment
from lightfield.measurement.metrics import make_reference
from lightfield.stages.measurement import ErrorVsTimeSettings

CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
RIG = {"type": "plane", "cameras": [4, 1], "size": 0.3, "center": [0, 0, 1.5]}
RENDER = {"samples": 256, "adaptive_threshold": 0, "denoise": False, "seed": 0}
RENDER |= {"depth_precision": "float"}
SAMPLING = {"max_bounces": 8, "clamp_indirect": 10, "light_tree": True, "guiding": False}
INVENTORY = {name: [] for name in ("lights", *advice.COSTLY)} | {"sampling": SAMPLING}
INVENTORY |= {"lights": ["sun"], "volumes": ["Fog"]}


def lightfield():
    lens = lenses.from_camera(CAMERA)
    return LightField.from_rig(RIG, lens, depth="z", frame=1, render=RENDER)


class Simulated:
    """Simulated renders: the noise of N paths on an even picture, in known times.

    Without the light tree a path takes half the time. With guiding too, but one pixel is sixty
    times too bright. With fewer bounces a tenth of the light is missing.
    """

    has_volumes = False
    inventory = INVENTORY

    def __init__(self):
        self.lightfield = lightfield()
        self.lens = self.lightfield.lens
        self.mask = trials.Trials("none.blend", "none.json", self.lightfield, "cpu", 1, "none").mask

    def pilot(self, lens=None):
        return self

    def reference(self, window, seeds, samples):
        made = [self.render(window, 1000 + seed, {"samples": samples}) for seed in range(seeds)]
        return make_reference([trial.colour for trial in made], None, self.mask(window))

    def render(self, window, seed, sampling):
        shape = (window.height, window.width)
        random = np.random.default_rng([seed, window.x, window.y])
        samples = sampling["samples"]
        noise = random.gamma(samples, 1 / samples, (*shape, 3))
        light = 0.2 * noise
        if sampling.get("denoise"):
            light = 0.8 * light + 0.05
        if "max_bounces" in sampling:
            light *= 0.9
        if sampling.get("guiding"):
            light[tuple(random.integers(32, size=2))] *= 60
        fast = sampling.get("light_tree") is False or sampling.get("guiding")
        seconds = samples * 1e-3 / (2 if fast else 1)
        parts = {name: np.zeros(shape) for name in (*PARTS_OF_LIGHT, *trials.SURFACES)}
        parts["diffuse_light"] += 1
        return trials.Trial(light.astype(np.float32), None, samples, seconds, "CPU", parts)


def experiment_of(renderer, size, windows, reference_samples):
    chosen, areas = strata.choose(renderer, size, windows)
    return Experiment.stratified(renderer, chosen, areas, reference_samples, "room")


def advice_of(renderer, windows, reference_samples):
    experiment = experiment_of(renderer, 32, windows, reference_samples)
    return advice.measure(experiment, RenderBlock(**RENDER), INVENTORY, "room")


@pytest.fixture(scope="module")
def simulated():
    advice_content = advice_of(Simulated(), 2, 512)
    return advice_content, {json.dumps(entry["change"]): entry for entry in advice_content["tried"]}


def test_windows_too_small_for_a_stratum_are_refused():
    with pytest.raises(
        UserError, match=r"room: its windows of 7 × 7 pixels have no 64 pixels.*--size"
    ):
        experiment_of(Simulated(), 7, 1, 64)


@pytest.mark.parametrize(("asked", "rendered"), [(1, 8), (8, 8), (12, 16)])
def test_a_reference_has_at_least_the_samples_that_are_asked_for(asked, rendered):
    samples = []

    class Recorded(Simulated):
        def reference(self, window, seeds, samples_of_seed):
            samples.append(seeds * samples_of_seed)
            return super().reference(window, seeds, samples_of_seed)

    content = error_vs_time.measure(
        Recorded(),
        RenderBlock(**RENDER),
        ErrorVsTimeSettings(size=32, octaves=1, reference=asked),
        "room",
    )
    assert set(samples) == {content["measured_on"]["reference_samples"]} == {rendered}


class SimulatedProbes(Simulated):
    def windows(self, size, count):
        return trials.Trials.windows(self, size, count)


def test_path_tracing_is_as_cheap_as_itself_below_the_references_own_error():
    """Only plain path tracing reaches the target, because the simulated denoiser is biased."""
    render = RenderBlock(**RENDER, target_error=1e-5)
    record, _ = calibration.calibrate(SimulatedProbes(), render, 32, 2)
    assert record["choice"]["denoise"] is False
    assert record["references"]["own_error"][0] > 10 * render.target_error
    assert record["times_fewer_samples"] == pytest.approx(1, abs=0.5)


def test_a_change_that_saves_is_advised_with_its_yaml(simulated):
    advice_content, changes = simulated
    entry = changes['{"light_tree": false}']
    whole_views = entry["savings"]["whole views"]
    assert whole_views["times"] == pytest.approx(2, abs=2 * whole_views["uncertainty"] + 0.02)
    assert abs(whole_views["light"]) < 1e-6 and whole_views["same_picture"] and entry["advised"]
    assert entry["savings"]["diffuse"] == whole_views and entry["verdict"] == advice.ADVISED
    assert advice_content["yaml"] == {"light_tree": False}
    text = "\n".join(advice.table(advice_content))
    assert "render:\n  light_tree: false\n" in text
    assert "- lights: 1, sun" in text and "- volumes: 1, Fog" in text
    assert "| `light_tree: false` | path tracing | yes | 2.0" in text


@pytest.mark.parametrize(
    "change", ['{"max_bounces": 4}', '{"max_bounces": 2}', '{"denoise": true}']
)
def test_a_change_of_the_picture_is_not_advised(simulated, change):
    entry = simulated[1][change]
    assert not entry["savings"]["whole views"]["same_picture"] and not entry["advised"]
    if "max_bounces" in change:
        assert entry["savings"]["whole views"]["light"] == pytest.approx(-0.1, abs=1e-3)


def test_a_change_that_hides_fireflies_is_not_advised(simulated):
    entry = simulated[1]['{"guiding": true}']
    assert "bright pixels" in entry["verdict"]
    whole_views = entry["savings"]["whole views"]
    assert whole_views["times"] > 1.5 > 1 > whole_views["times_of_all_pixels"]
    assert not entry["advised"]


def test_a_clamp_is_reported_and_never_advised():
    changes = advice.changes_to_try(SAMPLING, on_cpu=True)
    none, quarter = (change for change in changes if "clamp_indirect" in change.change)
    assert (none.change["clamp_indirect"], quarter.change["clamp_indirect"]) == (0, 2.5)
    assert "clamp" in verdict_on(quarter.change, advice.TRACED, 0.0)
    on_gpu = advice.changes_to_try(SAMPLING, on_cpu=False)
    assert not any("guiding" in change.change for change in on_gpu)


DENOISED_RENDER = RENDER | {"denoise": True}


def verdict_on(change, of, bias, render=RENDER, times=1.5, of_all_pixels=1.5):
    """Return the verdict on one of the changes that are tried, from a row of figures."""
    own = advice.own_settings(RenderBlock(**render), SAMPLING)
    tried = {json.dumps(c.change): c for c in advice.changes_to_try(SAMPLING, on_cpu=True)}
    of_table = tried[json.dumps(change)]
    assert of_table.compared_with == of
    saving = advice.Saving(times, 0.05, of_all_pixels, 0.05, bias, 1.0, 0.0)
    return advice.verdict(of_table, saving, own)


@pytest.mark.parametrize(
    ("change", "of", "bias", "advised"),
    [
        ({"denoise_prefilter": "fast"}, advice.DENOISED, 3.3, False),
        ({"denoise_quality": "balanced"}, advice.DENOISED, 2.5, False),
        ({"denoise_quality": "balanced"}, advice.DENOISED, 0.9, True),
        ({"adaptive_threshold": 0.2}, advice.TRACED, 1.6, False),
        ({"adaptive_threshold": 0.2}, advice.TRACED, 1.0, True),
        ({"max_bounces": 4}, advice.TRACED, 1.6, False),
        ({"light_tree": False}, advice.TRACED, 1.6, True),
        ({"guiding": True}, advice.TRACED, 1.6, True),
    ],
)
def test_the_bias_decides_for_every_change_without_a_known_mean(change, of, bias, advised):
    verdict = verdict_on(change, of, bias, DENOISED_RENDER)
    assert (verdict == advice.ADVISED) == advised
    assert advised or "another picture" in verdict


@pytest.mark.parametrize(
    ("change", "of", "render", "reason"),
    [
        # Views that are not denoised have no use for another filter.
        ({"denoise_quality": "fast"}, advice.DENOISED, RENDER, "not denoised"),
        ({"denoise_prefilter": "none"}, advice.DENOISED, RENDER, "not denoised"),
        # The scene has these values already.
        ({"denoise": True}, advice.TRACED, DENOISED_RENDER, "your own"),
        (
            {"denoise_prefilter": "fast"},
            advice.DENOISED,
            DENOISED_RENDER | {"denoise_prefilter": "fast"},
            "your own",
        ),
        (
            {"adaptive_threshold": 0.2},
            advice.TRACED,
            RENDER | {"adaptive_threshold": 0.2},
            "your own",
        ),
        # A scene YAML with these would be refused.
        ({"denoise": True}, advice.TRACED, RENDER | {"target_error": 0.01}, "target_error"),
        (
            {"adaptive_threshold": 0.2},
            advice.TRACED,
            RENDER | {"target_error": 0.01},
            "target_error",
        ),
        ({"denoise": True}, advice.TRACED, RENDER | {"light_groups": {"a": ["A"]}}, "light_groups"),
    ],
)
def test_a_change_that_would_change_nothing_is_not_advised(change, of, render, reason):
    assert reason in verdict_on(change, of, 0.0, render)


@pytest.mark.parametrize(
    ("figures", "reason"),
    [
        ({"times": 1.12}, "time"),
        ({"times": 0.7}, "time"),
        ({"of_all_pixels": 0.8}, "bright pixels"),
    ],
)
def test_a_change_that_does_not_surely_save_says_so(figures, reason):
    assert reason in verdict_on({"max_bounces": 4}, advice.TRACED, 0.0, **figures)


def renderer_that_is_faster(factors):
    """Return simulated trials in which a change divides the time by its factor."""
    renderer = Simulated()
    render = renderer.render

    def faster(window, seed, sampling):
        trial = render(window, seed, sampling)
        for (key, value), factor in factors.items():
            if sampling.get(key) == value:
                trial = replace(trial, seconds=trial.seconds / factor)
        return trial

    renderer.render = faster
    return renderer


@pytest.mark.slow
def test_the_value_of_a_key_that_saves_most_is_advised():
    """The simulated filters make one picture. The prefilter "fast" is faster than "none"."""
    factors = {("denoise_prefilter", "fast"): 2, ("denoise_prefilter", "none"): 1.5}
    experiment = experiment_of(renderer_that_is_faster(factors), 32, 1, 64)
    content = advice.measure(experiment, RenderBlock(**DENOISED_RENDER), INVENTORY, "room")
    assert content["yaml"]["denoise_prefilter"] == "fast"
    verdicts = {json.dumps(entry["change"]): entry["verdict"] for entry in content["tried"]}
    assert "saves more" in verdicts['{"denoise_prefilter": "none"}']
    assert '"balanced"' not in json.dumps(content["yaml"])
    for entry in content["tried"]:
        saved = entry["savings"]["whole views"]
        assert saved["same_picture"] or not entry["advised"]


@pytest.mark.parametrize(("light_of_both", "advised"), [(1.0, True), (0.5, False)])
def test_changes_are_advised_together_only_if_they_keep_the_picture_together(
    light_of_both, advised
):
    renderer = renderer_that_is_faster({("adaptive_threshold", 0.2): 3})
    render = renderer.render

    def darker_with_both(window, seed, sampling):
        trial = render(window, seed, sampling)
        both = "light_tree" in sampling and "adaptive_threshold" in sampling
        return replace(trial, colour=trial.colour * (light_of_both if both else 1))

    renderer.render = darker_with_both
    content = advice_of(renderer, 2, 512)
    entries = {json.dumps(entry["change"]): entry for entry in content["tried"]}
    together = {"light_tree": False, "adaptive_threshold": 0.2}
    (both,) = (entry for entry in content["tried"] if len(entry["change"]) == 2)
    assert both["change"] == together and both["advised"] == advised
    assert entries['{"adaptive_threshold": 0.2}']["advised"]
    assert entries['{"light_tree": false}']["advised"] == advised
    assert content["yaml"] == (together if advised else {"adaptive_threshold": 0.2})


def test_without_light_nothing_is_advised(monkeypatch):
    lit = Simulated.render
    monkeypatch.setattr(
        Simulated, "render", lambda *arguments: replace(t := lit(*arguments), colour=0 * t.colour)
    )
    advice_content = advice_of(Simulated(), 1, 64)
    assert advice_content["yaml"] == {}
    assert "Keep your settings" in "\n".join(advice.table(advice_content))
