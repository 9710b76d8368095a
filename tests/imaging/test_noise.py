"""Noise estimated from a picture alone, compared with known noise and patterns."""

import numpy as np
import pytest

from lightfield.imaging import noise


def test_noise_is_measured_and_smooth_light_has_none():
    random = np.random.default_rng(2)
    y, x = np.mgrid[:256, :256]
    smooth = 2.0 + 0.01 * x + 0.02 * y
    assert np.nanmax(noise.relative_noise(smooth, 16)) < 1e-12
    edge = smooth + 5.0 * (x > 100)
    noisy = edge * (1 + random.normal(0, 0.03, smooth.shape))
    measured = noise.relative_noise(noisy, 16)
    assert np.median(measured) == pytest.approx(0.03, rel=0.04)
    assert measured.max() < 0.045
    assert np.isnan(noise.relative_noise(np.zeros((40, 40)), 8)).all()


@pytest.mark.parametrize(
    "pattern, expected",
    [
        # The mask passes changes along x and y at once. Here they have 16 times the amplitude.
        (lambda x, y: (-1) ** (x + y), 16 / 6 / 0.6745),
        (lambda x, y: (-1) ** x, 0),
        (lambda x, y: (-1) ** y, 0),
        (lambda x, y: x**2, 0),
        (lambda x, y: x * y, 0),
        # Both second differences of (x² y²) / 4 are 1 at the same pixel.
        (lambda x, y: x**2 * y**2 / 4, 1 / 6 / 0.6745),
    ],
)
def test_the_mask_is_immerkaers(pattern, expected):
    y, x = np.mgrid[:18, :18].astype(float)
    light = pattern(x, y)
    measured = noise.relative_noise(light + 1e6)
    np.testing.assert_allclose(measured * 1e6, expected, atol=1e-2)


def test_noise_is_relative_to_the_light_of_its_own_block():
    random = np.random.default_rng(4)
    light = np.repeat([1.0, 100.0], 65)[np.newaxis, :] * (1 + random.normal(0, 0.05, (66, 130)))
    measured = noise.relative_noise(light, 64)
    assert measured.shape == (1, 2)
    np.testing.assert_allclose(measured, 0.05, rtol=0.1)
    np.testing.assert_allclose(noise.relative_noise(light * 7, 64), measured)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_block_with_a_value_that_is_not_a_number_has_no_noise(bad):
    light = np.ones((18, 34))
    light[4, 5] = bad
    measured = noise.relative_noise(light)
    assert np.isnan(measured[0, 0])
    np.testing.assert_array_equal(measured[:, 2:], 0)


def test_only_complete_blocks_within_the_border_count():
    # The border of one pixel has no estimate, so 8 × 8 blocks need 10 × 10 pixels.
    assert noise.relative_noise(np.ones((10, 17))).shape == (1, 1)
    assert noise.relative_noise(np.ones((26, 18))).shape == (3, 2)
    assert np.isnan(noise.relative_noise(np.full((10, 10), -0.5))).all()
    # A block whose mean light is 0 has none either.
    assert np.isnan(noise.relative_noise(np.zeros((10, 10)))).all()
    assert np.isnan(noise.relative_noise(np.indices((10, 10)).sum(axis=0) % 2 * 2 - 1)).all()


def test_the_light_of_a_block_is_that_of_its_own_pixels():
    y, x = np.mgrid[:18, :26]
    plane = 1.0 + 10 * y + 3 * x
    measured = noise.relative_noise(plane + 0.1 * (-1) ** (x + y))
    # The border has no estimate, so the first block begins at the second row and column.
    light = plane[1:17, 1:25].reshape(2, 8, 3, 8).mean(axis=(1, 3))
    np.testing.assert_allclose(measured, 0.1 * 16 / 6 / 0.6745 / light)
