"""Resampling, compared with analytic truth, OpenCV and OpenImageIO."""

import itertools
import math
from functools import cache

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.equisolid import Equisolid
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.stereographic import Stereographic
from lightfield.imaging.halves import narrow, widen
from lightfield.reprojection import kernels, lens_map
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.filters import FILTERS

IDENTITY = np.eye(3)


def rays_of(lens: Lens, offset=(0.0, 0.0)):
    x, y = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    return lens.rays(x + offset[0], y + offset[1])


class Waves:
    """A band-limited function on the sphere: a sum of plane waves, between 0 and 2."""

    def __init__(self, most: float, count: int = 24, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        length = np.exp(rng.uniform(math.log(most / 20), math.log(most), count))
        direction = rng.standard_normal((count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self.vectors = direction * length[:, None]
        self.phases = rng.uniform(0, 2 * math.pi, count)

    def __call__(self, rays):
        waves = np.cos(rays @ self.vectors.T + self.phases)
        return 1 + waves.mean(axis=-1)

    def pixels(self, lens: Lens, rotation=IDENTITY, nodes: int = 3):
        """Return the mean over each pixel's area, by Gauss–Legendre quadrature."""
        places, weights = np.polynomial.legendre.leggauss(nodes)
        total = 0
        for y, v in zip(places / 2, weights / 2, strict=True):
            for x, u in zip(places / 2, weights / 2, strict=True):
                total = total + u * v * self(rays_of(lens, (x, y)) @ rotation.T)
        return total


@cache
def source_of_waves(most: float, lens: Lens, angles=(0, 0, 0), nodes: int = 3):
    """Return an image (h, w, 4) of `Waves` that several tests read. It is read-only."""
    source = as_source(Waves(most).pixels(lens, lens_map.rotation_matrix(*angles), nodes))
    source.flags.writeable = False
    return source


def as_source(gray):
    return np.ascontiguousarray(np.repeat(gray[..., None], 4, axis=2), np.float32)


def apply(source, made):
    """Resample a whole image (h, w, 4). The map reads a window of it."""
    row, end_row, column, end_column = made.window
    return resample_colour(np.ascontiguousarray(source[row:end_row, column:end_column]), made)


def apply_depth(depth, made, source_is_z=True, target_is_z=True):
    row, end_row, column, end_column = made.window
    return resample_depth(
        np.ascontiguousarray(depth[row:end_row, column:end_column]), source_is_z, target_is_z, made
    )


FISHEYE = Equidistant(width=256, height=256, fov=math.pi)
PANORAMA = Equirectangular(width=512, height=256)


def narrow_lens(size: int, focal_length: float = 18) -> Rectilinear:
    return Rectilinear(width=size, height=size, focal_length=focal_length, sensor_size=(36, 36))


# Colour


def test_halves_become_floats_as_in_numpy():
    halves = np.arange(65536, dtype=np.uint16).view(np.float16).reshape(4, 128, 128)
    expected = np.moveaxis(halves.astype(np.float32), 0, -1)
    assert np.array_equal(widen(*halves), expected, equal_nan=True)
    mixed = widen(halves[0], halves[1].astype(np.float32), halves[2])
    assert np.array_equal(mixed[..., :3], expected[..., :3], equal_nan=True)
    assert not mixed[..., 3].any()


def test_floats_become_halves_as_in_numpy_within_the_limits():
    rng = np.random.default_rng(0)
    values = (rng.standard_normal((64, 64, 4)) * 10.0 ** rng.uniform(-9, 4, (64, 64, 4))).astype(
        "f4"
    )
    expected = np.moveaxis(values.astype(np.float16), -1, 0)[:3]
    out = np.empty((3, 64, 64), np.float16)
    narrow(values, out)
    assert np.array_equal(out, expected)
    extreme = np.full((1, 1, 4), [1e9, -1e9, 65519.9, 0], np.float32)
    # Only some rows of an image.
    narrow(extreme, out[:, :1, :1])
    assert out[:, 0, 0].tolist() == [65504, -65504, 65504]
    assert np.array_equal(out[:, 1:], expected[:, 1:])


def test_bilinear_equals_opencv_on_the_same_coordinates():
    # Shifted by multiples of 1/32 pixel, because OpenCV rounds its coordinates to these.
    source = narrow_lens(64)
    target = Rectilinear(
        width=32,
        height=32,
        focal_length=18,
        sensor_size=(36, 36),
        principal_point=(16 + 5 / 64, 16 - 11 / 64),
    )
    made = lens_map.compute(source, target, IDENTITY, "bilinear")
    image = np.random.default_rng(1).random((64, 64, 4), np.float32)
    row, _, column, _ = made.window
    x, y = made.centers[..., 0] + column - 0.5, made.centers[..., 1] + row - 0.5
    assert np.allclose(x * 32, np.round(x * 32), atol=1e-3)
    expected = cv2.remap(image, x.astype("f4"), y.astype("f4"), cv2.INTER_LINEAR)
    assert np.abs(apply(image, made) - expected)[made.flags == kernels.INSIDE].max() < 1e-5
    assert (made.flags == kernels.INSIDE).mean() > 0.9


def test_bicubic_equals_openimageio():
    made = {
        name: lens_map.compute(FISHEYE, narrow_lens(200), IDENTITY, name)
        for name in ("bicubic", "st_warp")
    }
    image = as_source(Waves(60).pixels(FISHEYE, nodes=1))
    image[~np.isfinite(image)] = 0
    difference = apply(image, made["bicubic"]) - apply(image, made["st_warp"])
    assert np.abs(difference).max() < 1e-4


def test_lanczos_weights_are_the_windowed_sinc():
    for t in (0.0, 1e-6, 0.1, 0.5, 0.77, 0.999):
        distance = t + 2 - np.arange(6)
        expected = np.sinc(distance) * np.sinc(distance / 3)
        weights = kernels.lanczos_weights(np.float32(t))
        assert np.abs(np.array(weights) - expected / expected.sum()).max() < 1e-6


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(
    ("size", "focal_length", "bounds"),
    [
        # Minified by 2.5 to 5: a filter that does not cover the pixel aliases.
        (32, 18, {"bicubic": (2e-2, 1), "adaptive": (0, 8e-4)}),
        # About the same size.
        (160, 18, {"bilinear": (5e-3, 1), "bicubic": (0, 2e-3), "adaptive": (0, 2e-3)}),
        # Magnified by 3: an adaptive filter must not blur.
        (128, 67, {"bilinear": (7e-3, 1), "bicubic": (0, 3.5e-3), "adaptive": (0, 3.5e-3)}),
    ],
)
def test_error_against_the_mean_of_an_analytic_function_over_each_pixel(size, focal_length, bounds):
    # The function reaches half the source's Nyquist frequency.
    most = math.pi / 2 * FISHEYE.width / math.pi
    function = Waves(most)
    source = source_of_waves(most, FISHEYE)
    rotation = lens_map.rotation_matrix(20, 10, 25)
    target = narrow_lens(size, focal_length)
    truth = function.pixels(target, rotation, nodes=10 if size < 100 else 3)
    for name, (low, high) in bounds.items():
        made = lens_map.compute(FISHEYE, target, rotation, name)
        error = rms(apply(source, made)[..., 0] - truth)
        assert low < error < high, name


def test_samples_cover_the_whole_pixel():
    # A source pixel column is brighter the further right it is, and so is its reprojection. The
    # mean of n × n samples of a straight ramp is the ramp at the pixel's centre.
    source, target = narrow_lens(64), narrow_lens(8)
    ramp = as_source(np.tile(np.arange(64) + 0.5, (64, 1)))
    for samples in (1, 2, 3, 8):
        made = lens_map.compute(source, target, IDENTITY, "bilinear", samples)
        assert np.allclose(apply(ramp, made)[..., 0], np.arange(8) * 8 + 4, atol=1e-4)
    # Stripes as wide as a source pixel average out only if no sample is missing at the rim.
    stripes = as_source(np.tile(np.arange(64) % 2 == 0, (64, 1)).astype(float))
    made = lens_map.compute(source, target, IDENTITY, "nearest", 8)
    assert np.array_equal(apply(stripes, made)[..., 0], np.full((8, 8), 0.5))


@pytest.mark.parametrize("name", FILTERS)
def test_pixels_outside_the_image_circle_are_marked_without_smearing(name):
    source = np.full((256, 256, 4), 0.5, np.float32)
    source[np.isnan(rays_of(FISHEYE)[..., 0])] = 1e4
    target = narrow_lens(64)
    rotation = lens_map.rotation_matrix(70, 0, 0)
    made = lens_map.compute(FISHEYE, target, rotation, name)
    seen = (rays_of(target) @ rotation.T)[..., 2] <= 0
    out = apply(source, made)
    assert np.isnan(out[~seen]).all()
    assert np.isfinite(out[seen]).mean() > 0.97
    assert np.nanmax(np.abs(out - 0.5)) < 1e-5


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_a_number_does_not_spread(name, bad):
    clean = source_of_waves(20, FISHEYE, nodes=1).copy()
    clean[~np.isfinite(clean)] = 0
    dirty = clean.copy()
    dirty[100, 120, 1] = bad
    dirty[130:142, 120:132] = bad
    made = lens_map.compute(FISHEYE, narrow_lens(128), IDENTITY, name)
    before, after = apply(clean, made), apply(dirty, made)
    assert not np.isinf(after).any()
    x, y = made.centers[..., 0] + made.window[2], made.centers[..., 1] + made.window[0]
    deep = (x > 121) & (x < 131) & (y > 131) & (y < 141)
    assert deep.any() and np.isnan(after[deep]).all()
    block = (x >= 120) & (x <= 132) & (y >= 130) & (y <= 142)
    pixel = (np.abs(x - 120.5) <= 0.5) & (np.abs(y - 100.5) <= 0.5)
    lost = np.isnan(after[..., 0])
    assert not lost[~(block | pixel)].any()
    far = (np.abs(x - 126) > 11) | (np.abs(y - 136) > 11)
    far &= (np.abs(x - 120.5) > 5) | (np.abs(y - 100.5) > 5)
    assert np.array_equal(before[far], after[far])
    assert np.nanmax(np.abs(before - after)) < 0.2


@pytest.mark.parametrize("name", ["bicubic", "lanczos", "adaptive"])
def test_a_bright_pixel_makes_no_light_negative(name):
    source = np.full((256, 256, 4), 0.1, np.float32)
    source[128, 128] = 60000
    made = lens_map.compute(FISHEYE, narrow_lens(256), IDENTITY, name)
    assert apply(source, made).min() >= 0


@pytest.mark.parametrize("name", [name for name in FILTERS if name != "st_warp"])
def test_a_panorama_has_no_seam(name):
    image = np.random.default_rng(2).random((256, 512, 4), np.float32)
    target = narrow_lens(96)
    behind = lens_map.compute(PANORAMA, target, lens_map.rotation_matrix(180, 0, 0), name)
    ahead = lens_map.compute(PANORAMA, target, IDENTITY, name)
    turned = np.roll(image, 256, axis=1)
    assert np.abs(apply(image, behind) - apply(turned, ahead)).max() < 2e-3


@pytest.mark.parametrize("pitch", [-90, 90])
@pytest.mark.parametrize("size", [24, pytest.param(256, marks=pytest.mark.slow)])
def test_a_panorama_is_complete_at_its_poles(pitch, size):
    function = Waves(25)
    source = source_of_waves(25, PANORAMA)
    rotation = lens_map.rotation_matrix(17, pitch, 0)
    target = narrow_lens(size)
    truth = function.pixels(target, rotation, nodes=6 if size < 100 else 3)
    made = lens_map.compute(PANORAMA, target, rotation, "adaptive")
    error = np.abs(apply(source, made)[..., 0] - truth)
    assert error.max() < 0.02
    assert rms(error) < 2e-3


def test_openimageio_agrees_on_a_rotated_view():
    # OpenImageIO's own affine warp turns about the image's centre.
    lens = narrow_lens(128)
    image = as_source(Waves(15).pixels(lens, nodes=1))
    made = lens_map.compute(lens, lens, lens_map.rotation_matrix(0, 0, 30), "bicubic")
    buffer = oiio.ImageBuf(oiio.ImageSpec(128, 128, 4, "float"))
    buffer.set_pixels(oiio.ROI(0, 128, 0, 128, 0, 1, 0, 4), image)
    # If a camera turns clockwise, its image turns counterclockwise.
    turned = oiio.ImageBufAlgo.rotate(buffer, math.radians(-30), 64.0, 64.0, "cubic", 0.0)
    inner = np.s_[40:88, 40:88, 0]
    difference = apply(image, made)[inner] - np.asarray(turned.get_pixels(oiio.FLOAT))[inner]
    assert np.abs(difference).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (9, 7)])
def test_every_pair_of_lenses_and_every_value_gives_an_answer(size):
    width, height = size
    rng = np.random.default_rng(width)
    common = {"width": width, "height": height}
    lenses = [
        Rectilinear(**common, focal_length=18),
        Rectilinear(**common, focal_length=1e-3),
        Rectilinear(**common, focal_length=1e6),
        Equidistant(**common, fov=math.pi),
        Equidistant(**common, fov=2 * math.pi),
        Equisolid(**common, focal_length=10, fov=2 * math.pi),
        Stereographic(**common, fov=6),
        Equirectangular(**common),
        Equirectangular(**common, longitude=(-0.3, 0.4), latitude=(0.1, 1.5)),
        CubeMap(width=6 * height, height=height),
    ]
    for source, target in itertools.product(lenses, lenses):
        rotation = lens_map.rotation_matrix(*rng.choice([0, 90, -90, 180, 33], 3))
        for name, samples in (("nearest", 1), ("bicubic", 3), ("lanczos", 1), ("adaptive", 1)):
            made = lens_map.compute(source, target, rotation, name, samples)
            image = rng.random((source.height, source.width, 4), np.float32)
            image[rng.random(image.shape[:2]) < 0.1] = rng.choice([np.nan, np.inf, 65504, 1e-40])
            out = apply(image, made)
            blocks = made.flags.reshape(target.height, samples, target.width, samples)
            assert np.isnan(out[blocks.max(axis=(1, 3)) == kernels.NOTHING]).all()
            assert not np.isinf(out).any() and not (out < 0).any()
        depth = 10 ** rng.uniform(-6, 9, image.shape[:2])
        depth[0, 0] = np.inf
        resampled_depth = apply_depth(depth.astype("f4"), made, False, False)
        finite = resampled_depth[np.isfinite(resampled_depth)]
        assert ((finite > 0.99e-6) & (finite < 1.01e9)).all()


@pytest.mark.parametrize("name", ["bicubic", "lanczos", "adaptive"])
@pytest.mark.parametrize("pixels", [96, 12])
@pytest.mark.parametrize("angles", [(45, 0, 10), (0, 45, -20), (-135, 0, 0)])
def test_a_cube_map_is_as_exact_at_its_faces_borders_as_inside(name, pixels, angles):
    cube = CubeMap(width=6 * 64, height=64)
    most = 16
    # A view of the middle of an edge.
    target = Rectilinear(width=pixels, height=pixels, focal_length=60, sensor_size=(36, 36))
    rotation = lens_map.rotation_matrix(*angles)
    truth = Waves(most).pixels(target, rotation, 5)

    # The same pixels in a single face, so wide that the edge is in its middle.
    wide = Rectilinear(width=192, height=192, focal_length=6, sensor_size=(36, 36))
    angles_ahead = (*(90 * round(angle / 90 + 0.1) for angle in angles[:2]), 0)
    ahead = lens_map.rotation_matrix(*angles_ahead)
    # On its own side of the edge, within 3 pixels. Beyond, the wide face has finer pixels.
    side = np.abs(rays_of(target) @ (ahead.T @ rotation).T)
    away = (1 - side[..., :2].max(axis=-1) / side[..., 2]) * 32
    near = (away > 0) & (away < 3)

    def rms(source, turned_angles):
        turned = lens_map.rotation_matrix(*turned_angles)
        made = lens_map.compute(source, target, turned.T @ rotation, name)
        error = apply(source_of_waves(most, source, turned_angles), made)[..., 0] - truth
        return np.sqrt(np.mean(error[near] ** 2))

    assert rms(cube, (0, 0, 0)) < 1.1 * rms(wide, angles_ahead)


# Depth


def plane_distance(rays, normal, offset):
    """Return the distance along each ray to the plane normal · p = offset, inf for a miss."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = offset / (rays @ normal)
    return np.where(distance > 0, distance, np.inf)


def sphere_distance(rays, center, radius):
    """Return the distance along each ray to a sphere in front of the camera, inf for a miss."""
    along = rays @ center
    with np.errstate(invalid="ignore"):
        distance = along - np.sqrt(along**2 - center @ center + radius**2)
    return np.where(distance > 0, distance, np.inf)


def as_depth(distance, lens, dtype=np.float32):
    rays = rays_of(lens)
    if lens.has_z_depth:
        distance = np.where(np.isinf(distance), np.inf, distance * -rays[..., 2])
    return distance.astype(dtype)


SOURCES = [
    Equidistant(width=384, height=384, fov=math.pi),
    Equidistant(width=512, height=512, fov=math.radians(270)),
    Equirectangular(width=768, height=384),
]
TARGETS = [narrow_lens(100), Equidistant(width=96, height=96, fov=math.radians(240))]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("turn", [-20, 85])
def test_the_depth_of_planes_and_a_sphere_is_exact_away_from_edges(source, target, turn):
    rotation = lens_map.rotation_matrix(35, turn, 15)
    made = lens_map.compute(source, target, rotation, "adaptive")
    rays = rays_of(target)
    covered = 0
    for surface in (
        lambda rays: plane_distance(rays, np.array([0.2, 0.1, -1.0]), 3.0),
        lambda rays: plane_distance(rays, np.array([0.0, -1.0, 0.0]), 1.7),
        lambda rays: sphere_distance(rays, np.array([-0.7, 0.4, -2.5]), 1.5),
    ):
        distance = surface(rays_of(source))
        resampled = apply_depth(
            as_depth(distance, source), made, source.has_z_depth, target.has_z_depth
        )
        expected = surface(rays @ rotation.T)
        seen = ~np.isnan(made.centers[..., 0])
        assert np.isnan(resampled[~seen]).all()
        if target.has_z_depth:
            expected = expected * -rays[..., 2]
        # Leave out three source pixels around the surface's end.
        hit = np.isfinite(distance) & (distance < 100)
        # A panorama has no border, neither at its seam nor at its poles.
        beyond = 1 if isinstance(source, Equirectangular) else 0
        inside = cv2.erode(hit.astype(np.uint8), np.ones((7, 7)), borderValue=beyond) > 0
        row, column = (
            np.clip(np.nan_to_num(made.centers[..., i]).astype(int) + made.window[2 * j], 0, limit)
            for i, j, limit in ((1, 0, source.height - 1), (0, 1, source.width - 1))
        )
        tested = seen & inside[row, column]
        covered += tested.sum()
        assert np.abs(resampled[tested] / expected[tested] - 1).max(initial=0) < 1e-4
    assert covered > 2000


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_no_depth_lies_between_two_surfaces(dtype):
    source = Equidistant(width=384, height=384, fov=math.pi)
    rays = rays_of(source)
    # A comb of bars at z = 2 before a wall at z = 6, and nothing above.
    near, far = (plane_distance(rays, np.array([0, 0, -1.0]), z) for z in (2.0, 6.0))
    slope = rays[..., 0] / -rays[..., 2]
    distance = np.where(np.floor(slope * 7) % 2 == 0, near, far)
    distance = np.where(rays[..., 1] > 0.4, np.inf, distance)
    made = lens_map.compute(source, narrow_lens(300), IDENTITY, "adaptive")
    depth = apply_depth(as_depth(distance, source, dtype), made)
    assert set(np.round(depth[np.isfinite(depth)], 1)) == {2.0, 6.0}
    assert np.isinf(depth).mean() > 0.1
    assert not np.isnan(depth).any()


def test_depth_stays_within_its_neighbourhood_and_missing_values_stay_in_place():
    source = Equidistant(width=256, height=256, fov=math.pi)
    rng = np.random.default_rng(3)
    distance = rng.uniform(1, 9, (256, 256))
    distance[60:90, 60:90] = np.inf
    distance[120:150, 60:90] = np.nan
    made = lens_map.compute(source, narrow_lens(200), IDENTITY, "adaptive")
    resampled = apply_depth(distance.astype("f4"), made, False, False)
    low, high = (morphology(distance, np.ones((3, 3))) for morphology in (cv2.erode, cv2.dilate))
    row, column = (
        np.floor(made.centers[..., i] + made.window[2 * j]).astype(int) for i, j in ((1, 0), (0, 1))
    )
    finite = np.isfinite(low[row, column]) & np.isfinite(high[row, column])
    assert finite.mean() > 0.8
    assert (resampled >= low[row, column] * (1 - 1e-6))[finite].all()
    assert (resampled <= high[row, column] * (1 + 1e-6))[finite].all()
    assert np.array_equal(np.isinf(resampled), np.isinf(distance[row, column]))
    assert np.array_equal(np.isnan(resampled), np.isnan(distance[row, column]))


def test_the_top_of_a_ridge_is_no_nearer_than_its_pixels():
    # The top lies between two pixels. A curve through them would come nearer than both.
    from_top = np.minimum(np.abs(np.arange(256) - 127.5), 3)
    distance = np.broadcast_to(1 / (1 - 0.05 * from_top**2), (256, 256))
    made = lens_map.compute(FISHEYE, narrow_lens(900, focal_length=90), IDENTITY, "adaptive")
    resampled = apply_depth(distance.astype("f4"), made, False, False)
    assert resampled.max() > 1.5
    assert resampled.min() == pytest.approx(distance.min(), rel=1e-6)


def test_depth_is_taken_at_the_pixel_centre_for_any_samples():
    source = Equidistant(width=256, height=256, fov=math.pi)
    depth = as_depth(plane_distance(rays_of(source), np.array([0.3, 0, -1.0]), 2.0), source)
    single, many = (
        lens_map.compute(source, narrow_lens(64), IDENTITY, "bicubic", n) for n in (1, 4)
    )
    assert np.allclose(apply_depth(depth, single), apply_depth(depth, many), rtol=1e-6)


@pytest.mark.parametrize("filter_name", sorted(FILTERS))
def test_the_filter_of_colour_does_not_change_depth_at_the_edge_of_the_image(filter_name):
    # The map reads only a part of the source. The target's border lies near the part's own border.
    source, target = narrow_lens(200), narrow_lens(61, focal_length=70)
    rotation = lens_map.rotation_matrix(11, 7, 3)
    normal = np.array([0.5, 0.3, -1.0])
    made = lens_map.compute(source, target, rotation, filter_name)
    distance = plane_distance(rays_of(source), normal, 3.0).astype("f4")
    resampled = apply_depth(distance, made, False, False)
    expected = plane_distance(rays_of(target) @ rotation.T, normal, 3.0)
    assert np.abs(resampled / expected - 1).max() < 1e-5


@pytest.mark.parametrize("filter_name", ["nearest", "bilinear", "bicubic", "lanczos"])
def test_a_map_that_reads_a_part_of_the_source_gives_what_the_whole_gives(filter_name):
    """A narrow target has the middle pixels of a wide one with the same focal length."""
    source = narrow_lens(200)
    # 61 pixels of 36 mm, and 305 of 180 mm.
    targets = [
        Rectilinear(width=size, height=size, focal_length=70, sensor_size=(width, width))
        for size, width in ((61, 36), (305, 180))
    ]
    rotation = lens_map.rotation_matrix(11, 7, 3)
    part, whole = (lens_map.compute(source, lens, rotation, filter_name) for lens in targets)
    middle = np.s_[122:183, 122:183]
    noise = np.random.default_rng(0).random((200, 200, 4), np.float32)
    # Coordinates in float32 are off by up to 1.5e-5 of a pixel.
    assert np.allclose(apply(noise, part), apply(noise, whole)[middle], rtol=0, atol=1e-4)
    curved = (2 + 0.2 * Waves(60)(rays_of(source))).astype("f4")
    depths = [apply_depth(curved, made, False, False) for made in (part, whole)]
    assert np.allclose(depths[0], depths[1][middle], rtol=1e-5)


@pytest.mark.parametrize("filter_name", sorted(FILTERS))
def test_an_image_of_which_the_source_sees_nothing_is_empty(filter_name):
    behind = lens_map.rotation_matrix(180, 0, 0)
    made = lens_map.compute(narrow_lens(16), narrow_lens(8), behind, filter_name)
    assert np.isnan(apply(as_source(np.full((16, 16), 0.5)), made)).all()


@pytest.mark.parametrize("value", [3e38, -3e38, 1.7e38])
def test_nearest_keeps_the_largest_hashes_of_a_cryptomatte(value):
    # Their sum is beyond the range of float32.
    source, target = narrow_lens(8), narrow_lens(4)
    made = lens_map.compute(source, target, IDENTITY, "nearest")
    pixels = np.full((8, 8, 4), value, np.float32)
    assert np.array_equal(apply(pixels, made), np.full((4, 4, 4), value, np.float32))


def test_depth_reaches_as_far_as_colour_at_the_rim_of_the_image_circle():
    # The rim cuts pixels of the source in two.
    fisheye = Equidistant(width=64, height=64, fov=2.5)
    target = Equidistant(width=400, height=400, fov=2.6)
    rays = rays_of(fisheye)
    distance = 3 + rays[..., 0] + (rays[..., 1] > 0.2)
    made = lens_map.compute(fisheye, target, IDENTITY)
    color = apply(as_source(np.nan_to_num(distance)), made)[..., 0]
    depth = apply_depth(np.nan_to_num(distance).astype("f4"), made, False, False)
    seen = np.isfinite(color)
    assert 0.8 < seen.mean() / (math.pi / 4 * (2.5 / 2.6) ** 2) < 1.2
    assert np.array_equal(np.isfinite(depth), seen)
    # Every depth occurs in the source within a pixel and a half.
    points = fisheye.pixels(rays_of(target)[seen])
    column, row = np.clip(points.astype(int), 0, 63).T
    padded = np.pad(distance, 1, constant_values=np.nan)
    around = np.stack(
        [padded[row + i, column + j] for i, j in itertools.product(range(3), repeat=2)]
    )
    assert (depth[seen] >= np.nanmin(around, axis=0) * (1 - 1e-6)).all()
    assert (depth[seen] <= np.nanmax(around, axis=0) * (1 + 1e-6)).all()


@pytest.mark.parametrize("dtype", ["f2", "f4"])
def test_a_depth_of_zero_is_kept(dtype):
    made = lens_map.compute(FISHEYE, FISHEYE, IDENTITY)
    depth = np.full((256, 256), 3, dtype)
    depth[100:104, 90] = 0
    for is_z in (False, True):
        resampled = apply_depth(depth, made, is_z, is_z)
        assert not resampled[100:104, 90].any()
        assert np.allclose(resampled[110:140, 80:100], 3, rtol=1e-6)
