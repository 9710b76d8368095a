"""The experiment behind all measurements of rendering: its renders and its comparisons."""

from dataclasses import replace

import numpy as np
import pytest

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.measurement.experiment import WHOLE_VIEWS, Experiment, Method, split_by_stratum
from lightfield.measurement.metrics import exposed_alike, make_reference
from lightfield.measurement.strata import FEWEST_PIXELS, STRATA
from lightfield.measurement.trials import Trial, ViewWindow

SIZE = 64
LIGHT = 0.2
SECONDS_PER_SAMPLE = 1e-3
CAMERA = {"lens": "equirectangular", "resolution": [2 * SIZE, SIZE]}


class SimulatedTrials:
    """Simulated renders of N samples with the error 1 / N: gamma distributed light at `LIGHT`."""

    def __init__(self):
        lens = lenses.from_camera(CAMERA)
        rig = {"type": "plane", "cameras": [2, 1], "size": 0.3}
        views = LightField.from_rig(rig, lens, render={"samples": 4}).views
        self.lens = lens
        self.windows = [ViewWindow(view, 0, 0, SIZE, SIZE) for view in views]
        self.rendered = []

    def render(self, window, seed, settings):
        self.rendered.append((window.name, seed, settings))
        samples = settings["samples"]
        random = np.random.default_rng([seed, samples, self.windows.index(window)])
        colour = LIGHT * random.gamma(samples, 1 / samples, (SIZE, SIZE, 3))
        seconds = samples * SECONDS_PER_SAMPLE
        return Trial(colour.astype(np.float32), None, samples, seconds, "CPU")

    def references(self):
        mask = np.ones((SIZE, SIZE), bool)
        renders = [
            [self.render(window, 100 + seed, {"samples": 4096}).colour for seed in range(2)]
            for window in self.windows
        ]
        return exposed_alike([make_reference(colours, None, mask) for colours in renders])


@pytest.fixture
def renderer():
    return SimulatedTrials()


def test_errors_fall_in_proportion_to_the_samples(renderer):
    few = Method("few", {"samples": 4})
    many = Method("many", {"samples": 64})
    experiment = Experiment(renderer, renderer.windows, renderer.references())
    experiment.run([few, many], [1, 2])
    errors = {
        method.name: np.mean(experiment.errors(method, experiment.all_windows, left_out=0))
        for method in (few, many)
    }
    assert errors["few"] / errors["many"] == pytest.approx(16, rel=0.1)
    assert experiment.reference_error < errors["many"] / 10
    assert np.array(experiment.errors(few, experiment.all_windows)).shape == (2, 2)


def test_seconds_are_those_of_a_megapixel(renderer):
    method = Method("plain", {"samples": 8})
    experiment = Experiment(renderer, renderer.windows, renderer.references())
    experiment.run([method], [1])
    expected = 8 * SECONDS_PER_SAMPLE * 1e6 / SIZE**2
    assert experiment.seconds(method) == [[pytest.approx(expected)]] * 2


def test_methods_take_turns_and_equal_settings_render_once(renderer):
    experiment = Experiment(renderer, renderer.windows, renderer.references())
    renderer.rendered.clear()
    methods = [Method(name, {"samples": n}) for name, n in (("a", 1), ("b", 2), ("again", 1))]
    experiment.run(methods, [1, 2])
    assert [settings["samples"] for _, _, settings in renderer.rendered] == [1, 2] * 4
    assert experiment.renders(methods[0]) == experiment.renders(methods[2])


def test_an_error_in_one_stratum_stays_in_it(renderer):
    """The left half of each window is glossy, and twice too bright in the renders."""
    method = Method("plain", {"samples": 256})
    classes = np.full((SIZE, SIZE), STRATA.index("diffuse"))
    classes[:, : SIZE // 2] = STRATA.index("glossy")
    strata = split_by_stratum(renderer.references(), [classes, classes])
    areas = {"diffuse": 0.75, "glossy": 0.25}
    assert set(strata) == set(areas)
    experiment = Experiment(renderer, renderer.windows, renderer.references(), strata, areas)
    experiment.run([method], [1])
    for trials in experiment.renders(method):
        trials[0].colour[:, : SIZE // 2] *= 2
    errors = {name: np.mean(experiment.errors(method, strata[name])) for name in strata}
    assert errors["diffuse"] < 0.01 < 0.5 < errors["glossy"]
    expected = 0.75 * errors["diffuse"] + 0.25 * errors["glossy"]
    assert experiment.over_views(errors) == pytest.approx(expected)


def test_a_window_with_too_few_pixels_of_a_stratum_does_not_count_in_it(renderer):
    plain = np.full((SIZE, SIZE), STRATA.index("diffuse"))
    with_lamp = plain.copy()
    with_lamp.flat[:FEWEST_PIXELS] = STRATA.index("emission")
    with_spark = plain.copy()
    with_spark.flat[: FEWEST_PIXELS - 1] = STRATA.index("emission")
    strata = split_by_stratum(renderer.references(), [with_lamp, with_spark])
    assert {name: list(windows) for name, windows in strata.items()} == {
        "diffuse": [0, 1],
        "emission": [0],
    }


def test_without_strata_all_pixels_are_whole_views(renderer):
    experiment = Experiment(renderer, renderer.windows, renderer.references())
    assert list(experiment.strata) == [WHOLE_VIEWS]
    assert experiment.described() == {
        "probes": [window.name for window in renderer.windows],
        "size": SIZE,
        "resolution": [2 * SIZE, SIZE],
        "denoising": [],
    }


class DenoisingTrials(SimulatedTrials):
    """Simulated views of 512 × 256, whose denoiser takes longer for a pixel of a small window.

    A sample of a megapixel takes 6 s. Denoising takes 10 s and 0.5 s more for each window's side:
    18 s in windows of 64². The filter "fast" takes half the time.
    """

    def __init__(self):
        super().__init__()
        self.lens = lenses.from_camera(CAMERA | {"resolution": [512, 256]})
        views = [window.view for window in self.windows]
        self.windows = [ViewWindow(view, 440, 30, SIZE, SIZE) for view in views]
        self.timed = []

    def render(self, window, seed, settings):
        self.timed.append(window)
        megapixels = window.width * window.height / 1e6
        denoising = 10 + 8 * 64 / window.width
        if settings.get("denoise_prefilter") == "fast":
            denoising /= 2
        if not settings.get("denoise"):
            denoising = 0
        # The first render of a process takes longer.
        late = 0.1 if len(self.timed) == 1 else 0
        seconds = (6 * settings["samples"] + denoising) * megapixels + late
        colour = np.full((window.height, window.width, 3), LIGHT, np.float32)
        return Trial(colour, None, settings["samples"], seconds, "CPU")

    def experiment(self):
        mask = np.ones((SIZE, SIZE), bool)
        colour = np.full((SIZE, SIZE, 3), LIGHT, np.float32)
        references = [make_reference([colour] * 2, None, mask) for _ in self.windows]
        return Experiment(self, self.windows, references)


def test_the_denoisers_time_is_measured_in_a_window_as_large_as_the_denoiser_likes():
    """In a window of 256², denoising takes 12 s a megapixel. In the experiment's it takes 18."""
    renderer = DenoisingTrials()
    experiment = renderer.experiment()
    plain = Method("plain", {"samples": 2})
    denoised = Method("denoised", {"samples": 2, "denoise": True})
    fast = Method("fast", {"samples": 4, "denoise": True, "denoise_prefilter": "fast"})
    experiment.run([plain, denoised, fast], [1, 2])
    seconds = {m.name: experiment.seconds(m) for m in (plain, denoised, fast)}
    assert np.array(seconds["denoised"]) == pytest.approx(2 * 6 + 12)
    assert np.array(seconds["fast"]) == pytest.approx(4 * 6 + 6)
    assert seconds["plain"][1] == [pytest.approx(12)] * 2
    large = {w for w in renderer.timed if w.width == w.height == 256}
    assert {(w.x, w.y) for w in large} == {(256, 0)}
    accurate, of_fast = experiment.described()["denoising"]
    assert accurate["settings"] == {"denoise": True} and accurate["side"] == 256
    assert (accurate["seconds"], accurate["in_windows"]) == pytest.approx((12, 18))
    assert of_fast["settings"] == {"denoise": True, "denoise_prefilter": "fast"}
    assert (of_fast["seconds"], of_fast["in_windows"]) == pytest.approx((6, 9))


def test_a_large_window_that_was_slowed_leaves_no_time_below_zero():
    class Slowed(DenoisingTrials):
        def render(self, window, seed, settings):
            trial = super().render(window, seed, settings)
            is_large_and_plain = window.width > SIZE and not settings.get("denoise")
            return replace(trial, seconds=trial.seconds * (9 if is_large_and_plain else 1))

    experiment = Slowed().experiment()
    denoised = Method("denoised", {"samples": 1, "denoise": True})
    experiment.run([denoised], [1, 2])
    assert np.array(experiment.seconds(denoised)).min() > 0


def test_the_denoisers_time_stays_where_the_views_are_as_small_as_the_windows():
    renderer = DenoisingTrials()
    camera = {"lens": "rectilinear", "fov": 90, "resolution": [SIZE, SIZE]}
    renderer.lens = lenses.from_camera(camera)
    renderer.windows = [ViewWindow(window.view, 0, 0, SIZE, SIZE) for window in renderer.windows]
    experiment = renderer.experiment()
    denoised = Method("denoised", {"samples": 2, "denoise": True})
    experiment.run([denoised], [1, 2])
    assert experiment.seconds(denoised)[1] == [pytest.approx(2 * 6 + 18)] * 2
