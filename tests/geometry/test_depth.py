"""Depth conversions against the analytic depth of a plane and of a sphere."""

import math

import mpmath
import numpy as np
import pytest

from lightfield.geometry.depth import distance_from_z, with_precision, z_from_distance
from lightfield.geometry.lenses.equidistant import Equidistant


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("depth", [1e-6, 1.0, 3.5, 1e9])
def test_plane_and_sphere(dtype: type, depth: float) -> None:
    lens = Equidistant(width=65, height=65, fov=math.radians(178))
    x, y = np.meshgrid(np.arange(65, dtype=dtype) + 0.5, np.arange(65, dtype=dtype) + 0.5)
    rays = lens.rays(x.astype(dtype), y.astype(dtype))
    seen = np.isfinite(rays[..., 0])
    theta = np.hypot(x - 32.5, y - 32.5)[seen] / 65 * math.radians(178)
    # A plane across the axis has one Z-depth, a sphere around the camera one distance.
    plane = distance_from_z(np.full(x.shape, depth, dtype), rays)
    sphere = z_from_distance(np.full(x.shape, depth, dtype), rays)
    assert plane.dtype == sphere.dtype == dtype
    rtol = 1e-4 if dtype == np.float32 else 1e-12
    np.testing.assert_allclose(plane[seen], depth / np.cos(theta), rtol=rtol)
    np.testing.assert_allclose(sphere[seen], depth * np.cos(theta), rtol=rtol)
    assert np.isnan(plane[~seen]).all()
    assert np.isnan(sphere[~seen]).all()


def test_conversions_undo_each_other_to_the_last_digits() -> None:
    random = np.random.default_rng(1)
    theta = random.uniform(0, 1.5707, 1000)
    rays = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
    distance = 10 ** random.uniform(-6, 9, 1000)
    again = distance_from_z(z_from_distance(distance, rays), rays)
    np.testing.assert_allclose(again, distance, rtol=1e-15)
    exact = [
        float(mpmath.mpf(d) * mpmath.mpf(-z)) for d, z in zip(distance, rays[:, 2], strict=True)
    ]
    np.testing.assert_allclose(z_from_distance(distance, rays), exact, rtol=2e-16)


@pytest.mark.parametrize("convert", [z_from_distance, distance_from_z])
def test_misses_stay_misses_and_nan_stays_nan(convert) -> None:
    rays = np.array([[0, 0, -1], [1, 0, 0], [0, 0.6, -0.8], [np.nan, np.nan, np.nan]])
    misses = convert(np.full(4, np.inf), rays)
    np.testing.assert_array_equal(misses, [np.inf, np.inf, np.inf, np.nan])
    assert np.isnan(convert(np.full(4, np.nan), rays)).all()


def test_no_distance_where_a_z_depth_says_nothing() -> None:
    beside, behind, ahead = np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.array([0, 0, -1.0])
    assert np.isnan(distance_from_z(np.array(0.0), beside))
    for level in (0.0, -0.0):
        assert np.isnan(distance_from_z(np.array(2.0), np.array([1.0, 0, level])))
    assert np.isnan(distance_from_z(np.array(2.0), behind))
    # This holds even for a point just behind the plane. In the camera itself, the distance is 0.
    for z, ray in ((-2.0, ahead), (-0.5, ahead), (-1e-9, ahead), (0.5, behind), (1e-9, behind)):
        assert np.isnan(distance_from_z(np.array(z), ray))
    assert distance_from_z(np.array(0.0), ahead) == 0
    assert z_from_distance(np.array(2.0), behind) == -2
    assert distance_from_z(np.array(-2.0), behind) == 2


def test_half_depths_become_as_precise_as_the_rays() -> None:
    rays = np.array([[0, 0.6, -0.8]], np.float32)
    z = z_from_distance(np.array([65504], np.float16), rays)
    assert z.dtype == np.float32
    np.testing.assert_allclose(z, 65504 * 0.8, rtol=1e-6)


def test_depths_beyond_the_half_limit_become_misses() -> None:
    stored_depth = with_precision(np.array([1e6, 2, -1e6], np.float32), "half")
    assert stored_depth.dtype == np.float16
    np.testing.assert_array_equal(stored_depth, [np.inf, 2, -np.inf])


def test_rounded_depth_is_the_nearest_float_of_17_digits() -> None:
    depth = (10 ** np.random.default_rng(2).uniform(-6, 9, 1000)).astype(np.float32)
    rounded = with_precision(depth, "rounded")
    mantissa, exponent = np.frexp(depth.astype(np.float64))
    np.testing.assert_array_equal(rounded, np.ldexp(np.rint(mantissa * 2**17), exponent - 17))
    assert rounded.dtype == np.float32 and with_precision(depth.astype("f8"), "float").dtype == "f4"
    tie = np.float32(1 + 2.0**-17)  # Midway between two floats of 17 digits, one of them even.
    odd = np.array([tie, np.inf, -np.inf, 0, -2.5], np.float32)
    np.testing.assert_array_equal(with_precision(odd, "rounded"), [1, np.inf, -np.inf, 0, -2.5])
    assert np.isnan(with_precision(np.array([0xFFFFFFFF], "u4").view("f4"), "rounded")).all()
