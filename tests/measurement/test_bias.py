"""Bias and its correlation between views, of a simulated denoiser whose bias is known."""

import numpy as np
import pytest

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.measurement import bias
from lightfield.measurement.experiment import Method
from lightfield.measurement.metrics import exposed_alike, make_reference
from lightfield.measurement.trials import Trial, Trials, ViewWindow

SIZE = 64
NOISE = 0.04
BIAS = 0.06
# Two cameras, half a metre apart, look at a wall that is 4 m away.
CAMERA = {"lens": "rectilinear", "fov": 90, "resolution": [SIZE, SIZE]}
RIG = {"type": "plane", "cameras": [2, 1], "size": 0.5}
DISTANCE = 4.0


class Wall:
    """Renders of a wall: a picture on it, noise, and a bias.

    ``shared`` is the part of the bias that belongs to places on the wall. The rest belongs to
    pixels of a view.
    """

    def __init__(self, deviation, shared=1.0):
        lens = lenses.from_camera(CAMERA)
        lightfield = LightField.from_rig(RIG, lens, depth="z", render={"samples": 4})
        self.trials = Trials(None, None, lightfield, "cpu", 1, None)
        self.windows = tuple(ViewWindow(view, 0, 0, SIZE, SIZE) for view in lightfield.views)
        self.deviation, self.shared = deviation, shared
        self.camera = self.trials.camera

    def truth(self, window):
        across, up = self._places(window)
        light = 0.3 + 0.1 * np.sin(3 * across) * np.cos(2 * up)
        return np.repeat(light[..., np.newaxis], 3, axis=-1)

    def bias(self, window):
        across, up = self._places(window)
        of_place = np.sign(np.sin(5 * across) * np.sin(5 * up))
        signs = np.random.default_rng(self.windows.index(window)).choice([-1, 1], (SIZE, SIZE))
        parts = np.sqrt(self.shared) * of_place + np.sqrt(1 - self.shared) * signs
        return self.deviation * parts[..., np.newaxis]

    def render(self, window, seed, _settings):
        random = np.random.default_rng([seed, self.windows.index(window)])
        noise = random.normal(0, NOISE, (SIZE, SIZE, 3))
        colour = self.truth(window) + self.bias(window) + noise
        return Trial(colour.astype(np.float32), None, 16.0, 1.0, "CPU")

    def references(self, depth=True):
        mask = np.ones((SIZE, SIZE), bool)
        depths = [np.full((SIZE, SIZE), DISTANCE, np.float32)] * 4
        references = []
        for number, window in enumerate(self.windows):
            random = np.random.default_rng(1000 + number)
            renders = [
                (self.truth(window) + random.normal(0, 1e-3, (SIZE, SIZE, 3))).astype(np.float32)
                for _ in depths
            ]
            references.append(make_reference(renders, depths if depth else None, mask))
        return tuple(exposed_alike(references))

    def measured(self, seeds=4, depth=True):
        pair, references = self.windows, self.references(depth)
        return bias.measure(self, [pair], [references], Method("denoised", {}), seeds)

    def _places(self, window):
        """Return the places on the wall that the pixels of a window see, in metres."""
        rows, columns = np.mgrid[:SIZE, :SIZE]
        depth = np.full(rows.size, DISTANCE)
        points = self.trials.camera(window.view).lift(depth, columns.ravel(), rows.ravel())
        return (axis.reshape(SIZE, SIZE) for axis in (points[:, 0], points[:, 2]))


def expected(wall, deviation):
    """Return the exact relative squared error of one deviation everywhere."""
    errors = []
    for window, reference in zip(wall.windows, wall.references(), strict=True):
        gain = 4**reference.exposure
        errors.append(gain * deviation**2 / (gain * wall.truth(window) ** 2 + 0.01))
    return float(np.mean(errors))


def test_a_denoisers_bias_and_noise_are_separated():
    wall = Wall(BIAS)
    found = wall.measured()
    assert found.squared_bias == pytest.approx(expected(wall, BIAS), rel=0.03)
    assert found.variance == pytest.approx(expected(wall, NOISE), rel=0.03)
    assert found.error == pytest.approx(found.squared_bias + found.variance)
    assert found.seeds == 4


@pytest.mark.parametrize("shared", [1.0, 0.5, 0.0])
def test_the_correlation_is_the_part_of_the_bias_that_belongs_to_the_surface(shared):
    found = Wall(BIAS, shared).measured()
    assert found.correlation == pytest.approx(shared, abs=0.1)
    # Both cameras see the wall but for the strips of half a metre at its sides.
    assert found.common_pixels == pytest.approx(SIZE**2 * (1 - 0.5 / (2 * DISTANCE)), rel=0.03)


def test_renders_without_bias_have_none_within_the_noise():
    wall = Wall(0.0)
    for seeds in (2, 4):
        found = wall.measured(seeds)
        assert abs(found.squared_bias) < 0.05 * expected(wall, NOISE)
        assert found.correlation is None


def test_views_without_a_common_surface_have_no_correlation():
    wall = Wall(BIAS)
    without_depth = wall.measured(depth=False)
    # Two windows of one view would always agree.
    pair = (wall.windows[0],) * 2
    references = (wall.references()[0],) * 2
    of_one_view = bias.measure(wall, [pair], [references], Method("denoised", {}), 2)
    for found in (without_depth, of_one_view):
        assert found.common_pixels == 0 and found.correlation is None
        assert found.squared_bias > 0
