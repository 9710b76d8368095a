"""Extreme depths, rotations, places and pixels: errors stay within the condition number's bound."""

import math
from collections.abc import Iterable

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import stability
from lightfield.configuration.reprojections import DEFAULT_FILTER
from lightfield.geometry import rigs
from lightfield.geometry.depth import distance_from_z, z_from_distance
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.reprojection import lens_map
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.filters import FILTERS
from stability import ROUNDINGS

EPS = float(np.finfo(np.float64).eps)


@pytest.fixture(autouse=True)
def digits() -> None:
    mpmath.mp.dps = stability.DIGITS


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("degrees", [0, 1e-3, 45, 89, 89.99, 89.9999999])
def test_depths_of_all_sizes_convert_even_close_to_90_degrees(degrees, dtype) -> None:
    theta = math.radians(degrees)
    distance = (10.0 ** np.arange(-6, 10)).astype(dtype)
    ray = np.array([math.sin(theta), 0, -math.cos(theta)], dtype)
    rays = np.broadcast_to(ray, (len(distance), 3))
    z = z_from_distance(distance, rays)
    # The ray is given: a product and a quotient of given numbers have condition number 2.
    bound = 2 * ROUNDINGS * float(np.finfo(dtype).eps)
    for got, metres in zip(z, distance, strict=True):
        exact = mpf(float(metres)) * -mpf(float(ray[2]))
        assert abs(mpf(float(got)) - exact) <= bound * exact
    again = distance_from_z(z, rays).astype(np.float64)
    assert np.abs(again / distance.astype(np.float64) - 1).max() <= bound


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("kind", ["infinity", "NaN", "largest", "denormal"])
def test_depths_at_the_ends_of_a_number_format_convert(kind, dtype) -> None:
    info = np.finfo(dtype)
    value = {
        "infinity": math.inf,
        "NaN": math.nan,
        "largest": float(info.max),
        "denormal": float(info.smallest_subnormal) * 1000,
    }[kind]
    # A half depth is converted in the precision of the rays.
    ray = np.array([[0.6, 0, -0.8]], np.float64 if dtype == np.float64 else np.float32)
    (z,) = z_from_distance(np.array([value], dtype), ray)
    (again,) = distance_from_z(np.array([z]), ray)
    if math.isfinite(value):
        bound = 2 * ROUNDINGS * mpf(float(np.spacing(np.asarray(value / 2, ray.dtype))))
        assert abs(mpf(float(z)) - mpf(value) * -mpf(float(ray[0, 2]))) <= bound
        assert abs(mpf(float(again)) - mpf(value)) <= bound
    else:
        np.testing.assert_array_equal([z, again], [value, value])


def rotation(axis: int, angle: mpf) -> mpmath.matrix:
    """Return the exact rotation by ``angle`` radians about x (0), y (1) or z (2)."""
    matrix = mpmath.eye(3)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix[i, i] = matrix[j, j] = mpmath.cos(angle)
    matrix[j, i], matrix[i, j] = mpmath.sin(angle), -mpmath.sin(angle)
    return matrix


def exact_euler(euler: Iterable[float]) -> mpmath.matrix:
    x, y, z = (rotation(axis, mpf(angle)) for axis, angle in enumerate(euler))
    return z * y * x


@pytest.mark.parametrize("turn", [0, 30, -123.4, 180])
@pytest.mark.parametrize("pitch", [90, -90, 90 - 1e-9, 90 - 1e-8, 90 - 1e-7, -90 + 1e-5, 89.9, 0])
def test_a_rigs_rotation_survives_gimbal_lock(pitch, turn) -> None:
    rig = {"type": "plane", "cameras": [1, 1], "rotation": [turn, pitch, 2 * turn]}
    matrix = rigs.from_settings(rig).poses()[0].world_from_camera()[:3, :3]
    turned = exact_euler(float(np.radians(angle)) for angle in rig["rotation"])
    exact = turned * rotation(0, mpf(math.pi / 2))
    # A rig publishes its angles rounded to 12 decimals, so each of three angles may be off by half
    # a unit of the last. The rotation itself is perfectly conditioned.
    bound = ROUNDINGS * (EPS + 1.5e-12)
    assert max(abs(mpf(matrix[i, j]) - exact[i, j]) for i in range(3) for j in range(3)) <= bound
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=bound)


def smallest_move(lens, pixel) -> mpf:
    """Return the least motion of the ray per motion of the pixel, in radians per pixel."""
    ray = mpmath.matrix(stability.exact_ray(lens, pixel))
    step = stability.STEP * 1000
    beside = [(pixel[0] + step, pixel[1]), (pixel[0], pixel[1] + step)]
    moved = (mpmath.matrix(stability.exact_ray(lens, place)) - ray for place in beside)
    return min(mpmath.norm(move, mpmath.inf) for move in moved) / step


@pytest.mark.parametrize(
    "name",
    [
        "rectilinear 90° odd",
        "equidistant 180° odd",
        "equisolid 360°",
        "equirectangular",
        "cube map",
    ],
)
def test_cameras_a_million_metres_from_the_origin_see_the_same_point(name) -> None:
    lens = stability.extreme_lenses()[name]
    place, distance = (1e6, -1e6, 1e6), 2.0
    first = rigs.Pose("a", 0, place, (0.3, 1.2, -0.7), None)
    second = rigs.Pose("b", 1, (place[0] + 0.1, place[1], place[2] - 0.05), (0.35, 1.1, -0.6), None)
    x, y = 0.45 * lens.width, 0.55 * lens.height
    seen = (
        np.linalg.inv(second.world_from_camera())
        @ first.world_from_camera()
        @ np.append(lens.rays(x, y) * distance, 1)
    )
    back = np.linalg.inv(first.world_from_camera()) @ second.world_from_camera() @ seen

    turns = [exact_euler(pose.rotation) for pose in (first, second)]
    offset = [mpf(a) - mpf(b) for a, b in zip(first.position, second.position, strict=True)]
    exact_ray = mpmath.matrix(stability.exact_ray(lens, (mpf(x), mpf(y))))
    point = turns[1].T * (turns[0] * exact_ray * distance + mpmath.matrix(offset))
    exact = stability.exact_pixel(lens, list(point))
    # Three numbers of a million metres are each off by up to one eps. The pixel follows the angle.
    moves = 3 * mpf(place[0]) / mpmath.norm(point) / smallest_move(lens, exact)
    bound = ROUNDINGS * EPS * (moves + 2 * stability.extent(lens, exact))
    for projected, wanted in ((lens.pixels(seen[:3]), exact), (lens.pixels(back[:3]), (x, y))):
        assert max(abs(mpf(float(f)) - w) for f, w in zip(projected, wanted, strict=True)) <= bound


SOURCE = Equirectangular(width=64, height=32)
TARGET = Equidistant(width=33, height=33, fov=math.radians(220))
RAYS = TARGET.pixel_rays()
SEEN = np.isfinite(RAYS[..., 0])


def mapping_of(name):
    made = lens_map.compute(SOURCE, TARGET, np.eye(3), name)
    row, end_row, column, end_column = made.window
    return made, (end_row - row, end_column - column), (row, column)


@pytest.mark.parametrize("value", [65504.0, 1e-41, 0.0])
@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.slow
def test_an_even_image_stays_even_from_denormals_to_the_half_limit(name, value) -> None:
    made, shape, _ = mapping_of(name)
    out = resample_colour(np.full((*shape, 4), value, np.float32), made)
    error = np.abs(out[SEEN].astype(np.float64) - float(np.float32(value))).max()
    assert error <= ROUNDINGS * float(np.spacing(np.float32(value)))
    assert np.isnan(out[~SEEN]).all()


@pytest.mark.parametrize("value", [math.inf, math.nan])
@pytest.mark.parametrize("name", FILTERS)
def test_a_pixel_that_is_not_a_number_spoils_nothing_far_from_it(name, value) -> None:
    made, shape, (row, column) = mapping_of(name)
    bad = (shape[0] // 2, shape[1] // 2)
    # Eight source pixels are 45 degrees, farther than any filter reaches here.
    far = SEEN & (
        RAYS @ SOURCE.rays(column + bad[1] + 0.5, row + bad[0] + 0.5) < math.cos(math.pi / 4)
    )
    clean = np.random.default_rng(5).uniform(1, 2, (*shape, 4)).astype(np.float32)
    dirty = clean.copy()
    dirty[bad] = value
    after = resample_colour(dirty, made)
    np.testing.assert_array_equal(after[far], resample_colour(clean, made)[far])
    assert not np.isinf(after).any()


@pytest.mark.parametrize("depth", [1e-6, 1.0, 1e9, math.inf])
@pytest.mark.slow
def test_a_sphere_of_any_depth_stays_one(depth) -> None:
    made, shape, _ = mapping_of(DEFAULT_FILTER)
    out = resample_depth(np.full(shape, depth, np.float32), False, False, made)
    if math.isinf(depth):
        assert np.isposinf(out[SEEN]).all()
    else:
        allowed = ROUNDINGS * np.spacing(np.float32(depth))
        np.testing.assert_allclose(out[SEEN], np.float32(depth), rtol=0, atol=allowed)
