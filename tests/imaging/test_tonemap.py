"""Tone mapping against published values and scikit-image's sRGB."""

import numpy as np
import pytest
from skimage.color import xyz2rgb

from lightfield.imaging import pictures
from lightfield.imaging.primaries import PRIMARIES, from_rec_709, to_rec_709
from lightfield.imaging.tonemap import decode_srgb, encode_srgb, to_8_bit, to_16_bit, tone_map


def test_reinhard_makes_its_maximum_white_and_keeps_order():
    values = np.array([0.0, 0.5, 1.0, 2.0, 5.0], np.float32)
    # v (1 + v / 25) / (1 + v), calculated by hand.
    expected = [0.0, 0.34, 0.52, 0.72, 1.0]
    assert np.allclose(tone_map(values, 0.0, 5.0), expected, atol=1e-6)


def test_exposure_counts_in_stops_and_a_maximum_of_one_changes_nothing():
    values = np.array([[0.25, 3.0, 60000.0]], np.float32)
    assert np.allclose(tone_map(values, -1.0, 1.0), values / 2, rtol=1e-6)
    assert np.allclose(tone_map(values, 3.0, 1.0), values * 8, rtol=1e-6)
    assert tone_map(values, 0.0, 1.0) is values


def test_exposure_keeps_colours_outside_rec_709():
    # The green of ACEScg. Without its negative part, it would become another colour.
    green = to_rec_709(np.array([[0.0, 1.0, 0.0]], np.float32), PRIMARIES["acescg"])
    brighter = from_rec_709(tone_map(green, 1.0, 1.0), "acescg")
    assert np.allclose(brighter, [[0, 2, 0]], atol=1e-5)


def test_no_negative_value_passes_the_pole_of_the_curve():
    values = np.array([-0.5, -1.0, -2.0, np.nan], np.float32)
    out = tone_map(values, 0.0, 5.0)
    assert out[:3].tolist() == [0, 0, 0] and np.isnan(out[3])


@pytest.mark.parametrize("white", [1e-9, 1, 5, 1e9])
def test_infinite_light_is_white_and_no_light_is_black(white):
    values = np.array([0, 3e38, np.inf], np.float32)
    assert to_8_bit(tone_map(values, 1, white)).tolist() == [0, 255, 255]


def reference_srgb(linear):
    """Encode grey with scikit-image, from the XYZ of the same grey."""
    white = np.array([0.412453 + 0.357580 + 0.180423, 1.0, 0.019334 + 0.119193 + 0.950227])
    return xyz2rgb(np.asarray(linear)[:, None] * white)[:, 1]


def test_srgb_is_scikit_images():
    linear = np.concatenate([np.linspace(0, 1, 5001), np.geomspace(1e-6, 1, 500)])
    assert np.abs(encode_srgb(linear) - reference_srgb(linear)).max() < 1e-5
    assert np.abs(decode_srgb(encode_srgb(linear)) - linear).max() < 1e-12


def test_8_bit_codes_are_the_nearest_ones():
    linear = np.random.default_rng(0).random((400, 400, 3), np.float32) ** 2
    codes = to_8_bit(linear).astype(int)
    exact = 255 * reference_srgb(linear.ravel()).reshape(linear.shape)
    assert np.abs(codes - exact).max() < 0.5 + 1e-3


@pytest.mark.parametrize("step", [-1, 0, 1])
def test_every_8_bit_code_survives_decoding_and_encoding(step):
    codes = np.arange(256)
    linear = np.nextafter(decode_srgb(codes / 255).astype(np.float32), np.float32(step))
    assert np.array_equal(to_8_bit(linear), codes)


@pytest.mark.parametrize("beside", [-0.4, 0, 0.4])
def test_16_bit_codes_are_the_nearest_ones(beside):
    codes = np.arange(1000, 65000, 7)
    assert np.array_equal(to_16_bit(decode_srgb((codes + beside) / 65535)), codes)


def test_values_out_of_range_are_clipped():
    values = np.array([-1.0, -0.0, 1.0, 7.0, np.inf, -np.inf, np.nan], np.float32)
    assert to_8_bit(values).tolist() == [0, 0, 255, 255, 255, 0, 0]


def test_pictures_are_white_from_five_times_the_middle_on():
    grey = np.array([[0, 1, 4, 5, 9]], np.float32)[..., None].repeat(3, axis=-1)
    # v (1 + v / 25) / (1 + v) and sRGB's curve, by hand.
    expected = [0, 191, 247, 255, 255]
    assert pictures.develop(grey, 0)[0, :, 1].tolist() == pytest.approx(expected, abs=1)
    assert pictures.develop(grey / 2, 1)[0, :, 1].tolist() == pytest.approx(expected, abs=1)
