"""Errors of images, compared with known noise, other programs, and calculations by hand."""

from dataclasses import replace

import cv2
import flip_evaluator
import numpy as np
import pytest
from scipy import stats
from skimage.metrics import structural_similarity

from lightfield.geometry import lenses
from lightfield.measurement import metrics, summaries
from lightfield.measurement.effort import Line, fit, interpolated
from lightfield.measurement.picture_difference import (
    TO_YCBCR,
    depth_error,
    iv_psnr,
    solid_angles,
    ssim_map,
    ws_psnr,
)
from lightfield.planning.sampling import standard_error

SIZE = 64
MASK = np.hypot(*(np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2)) < SIZE / 2


def scene():
    """Return a smooth picture around middle grey, with different channels."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return np.stack([0.1 + 0.3 * x, 0.2 + 0.2 * y, 0.3 - 0.2 * x * y], axis=-1)


def noisy(truth, deviation, seed):
    noise = np.random.default_rng(seed).normal(0, deviation, truth.shape)
    return (truth + noise).astype(np.float32)


def reference(truth, deviation, renders, depths=None):
    colours = [noisy(truth, deviation, 100 + number) for number in range(renders)]
    return metrics.make_reference(colours, depths, MASK)


def expected(truth, deviation, exposure):
    """Return the exact relative MSE for noise of one deviation everywhere."""
    gain = 4**exposure
    return float((gain * deviation**2 / (gain * truth[MASK] ** 2 + 0.01)).mean())


def test_two_seeds_give_the_error_of_their_mean():
    truth, deviation = scene(), 0.02
    estimate = reference(truth, deviation, 2)
    # The variance of a mean of two is half that of one.
    wanted = expected(truth, deviation, estimate.exposure) / 2
    # The estimate deviates by √(2/n) for n values, and lacks the worst thousandth of squares.
    assert estimate.own_error == pytest.approx(wanted, rel=0.05)
    # The estimate also holds against the truth, which only a test knows.
    actual = float((((estimate.colour - truth)[MASK] ** 2) * estimate.weights).mean())
    assert estimate.own_error == pytest.approx(actual, rel=0.06)


@pytest.mark.parametrize("renders", [2, 8])
def test_the_references_own_error_is_not_counted(renders):
    truth = scene()
    estimate = reference(truth, 0.02, renders)
    # The image has half the noise of one of the reference's renders.
    image = noisy(truth, 0.01, 7)
    wanted = expected(truth, 0.01, estimate.exposure)
    assert metrics.relative_mse(image, estimate) == pytest.approx(wanted, rel=0.08)


def test_the_exposure_puts_the_typical_pixel_at_middle_grey():
    estimate = metrics.make_reference(
        [np.full((8, 8, 3), 0.72, np.float32)] * 2, None, MASK[28:36, 28:36]
    )
    assert estimate.exposure == pytest.approx(-2)
    # (0.72 · ¼)² + 0.01 under an error of 0.072 · ¼.
    image = np.full((8, 8, 3), 0.792, np.float32)
    assert metrics.relative_mse(image, estimate) == pytest.approx(0.018**2 / 0.0424, rel=1e-5)


def test_brightness_of_a_scene_does_not_change_its_error():
    truth = scene()
    dim, bright = (
        metrics.relative_mse(
            noisy(truth, 0.03, 1) * gain,
            metrics.make_reference(
                [c * gain for c in [noisy(truth, 0.01, 2), noisy(truth, 0.01, 3)]], None, MASK
            ),
        )
        for gain in (np.float32(1), np.float32(64))
    )
    assert dim == pytest.approx(bright, rel=1e-4)


def test_a_few_fireflies_do_not_decide_but_many_do():
    truth = scene()
    estimate = reference(truth, 1e-4, 4)
    image = noisy(truth, 0.02, 5)
    calm = metrics.relative_mse(image, estimate)
    few, many = image.copy(), image.copy()
    few[32, 30:32] = 50
    many[32, 16:48] = 50
    assert metrics.relative_mse(few, estimate) == pytest.approx(calm, rel=0.02)
    assert metrics.relative_mse(many, estimate) > 100 * calm
    # They do decide if all pixels count.
    assert metrics.relative_mse(few, estimate, left_out=0) > 100 * calm


def test_pixels_outside_the_image_circle_do_not_count():
    truth = scene()
    estimate = reference(truth, 0.01, 4)
    image = noisy(truth, 0.03, 5)
    spoilt = np.where(MASK[..., None], image, np.float32(9))
    assert metrics.compare(spoilt, None, estimate) == metrics.compare(image, None, estimate)


def test_pictures_are_compared_as_opencv_and_scikit_image_do():
    truth = scene()
    all_pixels = np.ones_like(MASK)
    estimate = metrics.make_reference([truth.astype(np.float32)] * 2, None, all_pixels)
    image = noisy(truth, 0.03, 5)
    errors = metrics.compare(image, None, estimate)
    shown, wanted = metrics.developed(image, estimate), metrics.developed(truth, estimate)
    assert errors.psnr == pytest.approx(cv2.PSNR(wanted, shown, R=1.0), abs=1e-6)
    # Its own mean leaves out the border.
    similarity = structural_similarity(
        wanted,
        shown,
        data_range=1,
        channel_axis=-1,
        gaussian_weights=True,
        use_sample_covariance=False,
    )
    assert errors.ssim == pytest.approx(similarity, abs=0.01)
    mean = flip_evaluator.evaluate(*(x.astype(np.float32) for x in (wanted, shown)), "LDR")[1]
    assert errors.flip == pytest.approx(mean, rel=1e-5)
    same = metrics.compare(truth.astype(np.float32), None, estimate)
    assert (same.psnr, same.ssim, same.flip) == (np.inf, pytest.approx(1), 0)


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (8, 8), (10, 64), (64, 48)])
def test_pictures_of_any_size_have_a_structural_similarity(shape):
    """Source: Wang et al. 2004, equation 13, without any variance."""
    truth = np.full((*shape, 3), 0.5)
    shown = np.full((*shape, 3), 0.25)
    similarity = ssim_map(truth, shown)
    assert similarity.shape == truth.shape
    expected = (2 * 0.5 * 0.25 + 0.01**2) / (0.5**2 + 0.25**2 + 0.01**2)
    np.testing.assert_allclose(similarity, expected, rtol=1e-9)


def test_common_metrics_use_unexposed_light():
    truth, all_pixels = np.full((16, 16, 3), 0.5, np.float32), np.ones((16, 16), bool)
    estimate = metrics.make_reference([truth] * 2, None, all_pixels)
    errors = metrics.compare(truth + np.float32(0.1), None, estimate)
    assert errors.relative_mse_unexposed == pytest.approx(0.01 / 0.26, rel=1e-5)
    assert errors.mrse == pytest.approx(0.01 / 0.51**2, rel=1e-5)


def test_bias_and_variance_are_separated_and_add_up():
    truth = scene()
    estimate = reference(truth, 0.01, 8)
    renders = [noisy(truth + 0.05, 0.03, seed) for seed in range(12)]
    bias, variance = metrics.bias_and_variance(renders, estimate)
    assert bias == pytest.approx(expected(truth, 0.05, estimate.exposure), rel=0.05)
    assert variance == pytest.approx(expected(truth, 0.03, estimate.exposure), rel=0.05)
    error_of_all_pixels = np.mean(
        [metrics.relative_mse(render, estimate, left_out=0) for render in renders]
    )
    assert bias + variance == pytest.approx(error_of_all_pixels, rel=1e-9)
    none, _ = metrics.bias_and_variance([noisy(truth, 0.03, seed) for seed in range(12)], estimate)
    assert abs(none) < variance / 12


@pytest.mark.parametrize(("sign", "correlation"), [(1, 1), (-1, -1), (0, None)])
def test_biases_of_neighbouring_views_correlate(sign, correlation):
    truth = scene()
    pair = reference(truth, 1e-3, 8), reference(truth, 1e-3, 8)
    everywhere = np.flatnonzero(MASK)
    renders = [
        [noisy(truth + bias, 0.02, seed) for seed in range(first, first + 8)]
        for first, bias in ((0, 0.05 * abs(sign)), (50, 0.05 * sign))
    ]
    agreed = metrics.bias_correlation(tuple(renders), pair, (everywhere, everywhere))
    # Without a bias there is only noise, so there is no correlation.
    assert agreed == (correlation and pytest.approx(correlation, abs=0.05))


def test_interpolation_is_a_power_law_between_points_only():
    points = [(4, 1 / 4), (1, 1), (16, 1 / 16)]
    assert interpolated(2, points) == pytest.approx(1 / 2)
    assert interpolated(16, points) == pytest.approx(1 / 16)
    assert interpolated(0.5, points) is interpolated(17, points) is None


def test_depth_counts_misses():
    truth = np.array([1.0, 2.0, np.inf, np.inf, 4.0, 1.0])
    depth = np.array([1.1, 2.0, np.inf, 7.0, np.inf, 9.0])
    assert depth_error(depth, truth) == pytest.approx((0.1 + 0 + 0 + 1 + 1 + 1) / 6)


def test_a_power_law_is_fitted_with_its_slopes_standard_error():
    x = [1, 2, 4, 8, 16]
    line = fit(x, [3 / value for value in x])
    assert (line.slope, line.factor) == (pytest.approx(-1), pytest.approx(3))
    assert line.at(32) == pytest.approx(3 / 32)
    assert line.inverse(3 / 32) == pytest.approx(32)
    # A denoiser's error may hardly fall. Then no number of samples is enough.
    assert Line(-1e-9, 0, 1.0).inverse(0.1) == Line(0, 0, 1.0).inverse(1) == 1e300
    y = [2.9, 1.6, 0.7, 0.4, 0.18]
    # Its import takes most of a second, in each process of the tests.
    from scipy.stats import linregress

    wanted = linregress(np.log(x), np.log(y))
    line = fit(x, y)
    assert line.slope == pytest.approx(wanted.slope)
    assert line.slope_error == pytest.approx(wanted.stderr)
    assert fit(x, [0.1] * 5) == Line(0, 0, 0.1)
    assert fit([5, 5, 5], [1, 2, 3]) is None
    assert fit([0, 1, 2], [1, 2, 3]) is fit([1, 2, 3], [1, 2, 0]) is None


def test_the_pareto_front_holds_the_points_that_none_beats():
    cost, error = [1, 2, 2, 3, 4, 5], [9, 5, 4, 6, 4, 1]
    assert metrics.pareto(cost, error) == [0, 2, 5]


def test_independent_errors_disagree_fully_and_common_ones_not_at_all():
    truth = scene()
    first, second = reference(truth, 1e-4, 4), reference(truth * 1.1, 1e-4, 4)
    everywhere = np.flatnonzero(MASK)
    common = np.random.default_rng(3).normal(0, 0.03, truth.shape)
    bias = [(picture + common).astype(np.float32) for picture in (truth, truth * 1.1)]
    noise = [noisy(truth, 0.03, 11), noisy(truth * 1.1, 0.03, 12)]
    alike = metrics.disagreement(tuple(bias), (first, second), (everywhere, everywhere))
    apart = metrics.disagreement(tuple(noise), (first, second), (everywhere, everywhere))
    assert alike.share == pytest.approx(0, abs=0.01)
    assert apart.share == pytest.approx(1, abs=0.05)
    # The error is a tenth of each pixel. The 0.01 in the denominator makes it smaller.
    assert 0.05 < apart.floor < 0.1
    assert apart.floor == pytest.approx(alike.floor, rel=0.01)
    assert apart.added**2 == pytest.approx(2 * expected(truth, 0.03, first.exposure), rel=0.1)
    assert apart.total**2 == pytest.approx(apart.added**2 + apart.floor**2, rel=0.05)
    assert alike.total == pytest.approx(alike.floor, rel=1e-3)


def test_pixels_have_the_solid_angles_of_their_lens():
    panorama = lenses.from_camera({"lens": "equirectangular", "resolution": [256, 128]})
    angles = solid_angles(panorama)
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-3)
    latitude = (np.arange(128) + 0.5 - 64) * np.pi / 128
    expected = np.cos(latitude) / np.cos(latitude).max()
    np.testing.assert_allclose(angles[:, 0] / angles.max(), expected, atol=1e-3)
    fisheye = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [200, 200]})
    angles = solid_angles(fisheye)
    assert angles.sum() == pytest.approx(2 * np.pi, rel=0.02)
    # sin θ / θ at 60 degrees from the axis.
    expected = np.sin(np.pi / 3) / (np.pi / 3)
    assert angles[100, 166] / angles[100, 100] == pytest.approx(expected, rel=0.02)


def test_ws_psnr_weights_by_solid_angle():
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [64, 32]})
    truth = np.full((32, 64, 3), 0.5)
    angles = solid_angles(lens)
    pole, equator = truth.copy(), truth.copy()
    pole[:2] += 0.1
    equator[15:17] += 0.1
    everywhere = truth + 0.1
    assert ws_psnr(truth, everywhere, angles) == pytest.approx(20)
    # A sixteenth of the rows has 1 − sin(90° · 14/16) of a hemisphere's height at a pole.
    part = (1 - np.sin(np.pi / 2 * 14 / 16)) / 2
    assert ws_psnr(truth, pole, angles) == pytest.approx(20 - 10 * np.log10(part), abs=0.05)
    part = np.sin(np.pi / 32)
    assert ws_psnr(truth, equator, angles) == pytest.approx(20 - 10 * np.log10(part), abs=0.05)


def test_iv_psnr_forgives_exactly_two_pixels_and_a_hundredth():
    random = np.random.default_rng(2)
    truth = random.uniform(0.2, 0.8, (40, 40, 3))
    counted = np.zeros((40, 40), bool)
    counted[4:-4, 4:-4] = True

    def measured(shown):
        return iv_psnr(truth, shown, counted)

    assert measured(truth) == 100
    assert measured(np.roll(truth, (2, -1), (0, 1))) > 50
    assert measured(np.roll(truth, 3, 0)) < 40
    assert measured(truth + 0.01) > 90
    # Of the 0.02, a hundredth is forgiven. Grey has no colour differences.
    grey = np.full((40, 40, 3), 0.5)
    luma = -10 * np.log10(0.02**2)
    expected = (4 * luma + 2 * 100) / 6
    assert iv_psnr(grey, grey + 0.03, counted) == pytest.approx(expected, abs=0.01)


def patterns(width, height):
    """Return a pattern, and the same shifted, brighter, and with an error that grows downward."""
    row, column = np.mgrid[:height, :width, :1][:2].astype(float)
    channel = np.arange(3)
    truth = 0.5 + 0.3 * np.sin(column / 5 + channel) * np.cos(row / 7 + 2 * channel)
    grain = np.sin(12.9898 * column + 78.233 * row + 37.719 * channel)
    shown = np.roll(truth, (1, 1), (0, 1)) + 0.006 + 0.05 * grain * row / height
    return truth, shown


# Printed by QMIV 3.0 for these pictures at 10 bits: WS-PSNR of Y, Cb and Cr, and IV-PSNR.
QMIV = {
    "rectilinear": ((30.514, 29.882, 27.432), 35.699),
    # Without its factor π / 2 (see `iv_psnr`).
    "equirectangular": ((31.671, 30.994, 29.701), 42.387 - 10 * np.log10(np.pi / 2)),
}


@pytest.mark.parametrize("name", QMIV)
def test_ws_psnr_and_iv_psnr_are_those_of_qmiv(name):
    width, height = (96, 64) if name == "rectilinear" else (96, 48)
    truth, shown = patterns(width, height)
    weights = np.ones((height, width))
    if name == "equirectangular":
        lens = lenses.from_camera({"lens": name, "resolution": [width, height]})
        weights = solid_angles(lens)
    of_pixels, of_shifts = QMIV[name]
    for component, expected in enumerate(of_pixels):
        true_component, shown_component = (
            (picture @ TO_YCBCR.T)[..., component : component + 1] for picture in (truth, shown)
        )
        measured = ws_psnr(true_component, shown_component, weights)
        assert measured == pytest.approx(expected, abs=0.01)
    counted = np.ones((height, width), bool)
    assert iv_psnr(truth, shown, counted, weights) == pytest.approx(of_shifts, abs=0.02)


def test_only_the_chosen_part_of_the_pixels_with_a_ray_counts():
    truth = scene()
    whole = reference(truth, 0.01, 4)
    left = np.zeros((SIZE, SIZE), bool)
    left[:, : SIZE // 2] = True
    image = noisy(truth, 0.03, 5)
    spoilt = np.where((left & MASK)[..., None], image, np.float32(9))
    part = replace(whole, part=left)
    assert metrics.relative_mse(spoilt, part) == metrics.relative_mse(image, part)
    assert metrics.relative_mse(spoilt, whole) > 100 * metrics.relative_mse(image, whole)


def test_a_standard_error_is_the_one_of_scipy():
    values = [1.0, 3.0, 4.0, 9.0]
    assert standard_error(values) == pytest.approx(stats.sem(values))
    assert standard_error(values[:1]) == 0


def test_means_over_views_count_each_by_its_part_of_the_region():
    columns = dict.fromkeys(summaries.MEANS, 0)
    rows = [
        {"truth": "a", "variant": "all", "value": "", "region": region, "part": part}
        | columns
        | {"psnr": psnr}
        for region, part, psnr in (
            ("all", 1, 10),
            ("rim", 0.75, 20),
            ("all", 1, 10),
            ("rim", 0.25, 40),
        )
    ]
    (mean,) = summaries.means(rows, "rim")
    assert mean["psnr"] == pytest.approx((3 * 20 + 40) / 4)
    assert mean["part"] == 0.5
