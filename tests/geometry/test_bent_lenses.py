"""The lenses that are not quite radial, compared with OpenCV, COLMAP and mpmath."""

import math
from typing import Any

import cv2
import mpmath
import numpy as np
import pycolmap
import pytest

from lightfield.geometry.lenses import LENSES, Lens, from_camera
from lightfield.geometry.lenses.bent import BentLens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.thin_prism_fisheye import ThinPrismFisheye


def calibrated(
    lens_class: type[BentLens],
    size: tuple[int, int],
    focal_lengths: tuple[float, float],
    center: tuple[float, float],
    coefficients: tuple[float, ...],
    **keys: Any,
) -> BentLens:
    """Return a lens whose focal lengths are in pixels."""
    (width, height), (fx, fy) = size, focal_lengths
    return lens_class(
        width=width,
        height=height,
        sensor_size=(width / 10, fx / fy * height / 10),
        focal_length=fx / 10,
        principal_point=center,
        coefficients=coefficients,
        **keys,
    )


# The calibration of cam0 in the EuRoC MAV dataset (Burri et al. 2016), whose first pixel's centre
# is at 0.
EUROC = calibrated(
    BrownConrady,
    (752, 480),
    (458.654, 457.296),
    (367.715, 248.875),
    (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0, 0, 0, 0),
)
# It turns over at 60.7°, inside its frame.
TURNING = (-0.25, 0.09, 0, 0, -0.014, 0, 0, 0)
STRONG = calibrated(
    BrownConrady,
    (640, 480),
    (300, 300),
    (321.5, 238.2),
    (-0.25, 0.09, 1e-3, -8e-4, -0.014, 0, 0, 0),
)
RATIONAL = calibrated(
    BrownConrady, (640, 480), (200, 210), (310, 250), (8.1, 4.2, 1e-3, -8e-4, 0.2, 8.4, 6.1, 1)
)
THIN_PRISM = calibrated(
    ThinPrismFisheye,
    (640, 480),
    (200, 210),
    (310, 250),
    (-0.01, 0.03, 2e-3, -1e-3, -0.02, 0.003, 3e-3, -2e-3),
)
# A SLAM camera of Project Aria's glasses, from the tests of projectaria_tools, whose first pixel's
# centre is at 0.
ARIA = calibrated(
    Fisheye624,
    (640, 480),
    (242.0503165415735, 242.0503165415735),
    (320.3053191211108, 241.4679064324467),
    (
        *(-0.02689165420917155, 0.1019919163316408, -0.07180862612716554),
        *(0.01245898233008245, 0.001242086400994195, -0.0004149914187376608),
        *(0.0005499786009926172, 0.0005819661606400815),
        *(-0.001232007804086031, -0.0003868334860997226),
        *(-0.0005963449586486949, 1.071922498768078e-05),
    ),
)
TENFOLD = calibrated(
    Fisheye624,
    (640, 480),
    (242, 243),
    (321, 239),
    (0.02, -0.03, 0.01, -0.002, 0, 0, 4e-3, -3e-3, 6e-3, -1e-3, -5e-3, 2e-3),
)
EXAMPLES = {
    "euroc": EUROC,
    "strong": STRONG,
    "rational": RATIONAL,
    "thin prism": THIN_PRISM,
    "aria": ARIA,
    "tenfold prism": TENFOLD,
}
COLMAP = {
    "brown_conrady": "FULL_OPENCV",
    "thin_prism_fisheye": "THIN_PRISM_FISHEYE",
    "fisheye624": "RAD_TAN_THIN_PRISM_FISHEYE",
}


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle between unit rays, accurate even for tiny angles."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def matrix(lens: Any, first_center: float) -> np.ndarray:
    """Return OpenCV's camera matrix, for pixels whose first centre is at ``first_center``."""
    fx, fy = 1 / lens._unit[0], 1 / lens._unit[1]
    x, y = np.array(lens.center) - 0.5 + first_center
    return np.array([[fx, 0, x], [0, fy, y], [0, 0, 1]])


def points(degrees: float) -> np.ndarray:
    """Return directions up to an angle from the axis, with z ahead and y down, as OpenCV has."""
    random = np.random.default_rng(4)
    theta, phi = np.radians(random.uniform(0, degrees, 2000)), random.uniform(-np.pi, np.pi, 2000)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)


FLIP = np.array([1, -1, -1])


@pytest.mark.parametrize(("name", "degrees"), [("euroc", 75), ("strong", 60.5), ("rational", 85)])
def test_brown_conrady_projects_as_opencv(name: str, degrees: float) -> None:
    lens = EXAMPLES[name]
    directions = points(degrees)
    # OpenCV counts from the first pixel's centre.
    expected, _ = cv2.projectPoints(
        directions * 3, np.zeros(3), np.zeros(3), matrix(lens, 0), np.array(lens.coefficients)
    )
    pixels = lens.pixels(directions * FLIP)
    np.testing.assert_allclose(pixels, expected[:, 0] + 0.5, rtol=1e-12, atol=1e-9)
    assert angle(lens.rays(*pixels.T), directions * FLIP).max() < 1e-11


def test_every_pixel_of_euroc_is_undistorted_as_by_opencv() -> None:
    x, y = np.meshgrid(np.arange(752.0), np.arange(480.0))
    pixels = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    # OpenCV 5 has no name of its own for the iterations.
    undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)
    camera = matrix(EUROC, 0), np.array(EUROC.coefficients)
    plane = undistort(pixels, *camera, R=None, P=None, criteria=stop)[:, 0]
    expected = np.column_stack([plane, np.ones(len(plane))]) * FLIP
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    rays = EUROC.pixel_rays().reshape(-1, 3)
    assert angle(rays, expected).max() < 1e-13
    # float32 loses no pixel, and a thousandth of a pixel at most.
    single = EUROC.pixel_rays(np.float32)
    assert single.dtype == np.float32
    assert angle(single.reshape(-1, 3).astype(np.float64), expected).max() < 1e-3 / 458


@pytest.mark.parametrize(
    ("name", "degrees"),
    [
        ("euroc", 75),
        ("strong", 60.5),
        ("rational", 85),
        ("thin prism", 89.9),
        ("aria", 89.9),
        ("tenfold prism", 89.9),
    ],
)
def test_bent_lenses_project_as_colmap(name: str, degrees: float) -> None:
    lens = EXAMPLES[name]
    directions = points(degrees)
    fx, fy, (x, y) = 1 / lens._unit[0], 1 / lens._unit[1], lens.center
    camera = pycolmap.Camera(
        model=COLMAP[lens.name],
        width=640,
        height=480,
        params=[fx, fy, x, y, *lens.coefficients],
    )
    expected = camera.img_from_cam(directions * 3)
    pixels = lens.pixels(directions * FLIP)
    np.testing.assert_allclose(pixels, expected, rtol=1e-12, atol=1e-9)
    assert angle(lens.rays(*pixels.T), directions * FLIP).max() < 1e-10


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("SIMPLE_RADIAL", [-0.1]),
        ("RADIAL", [-0.1, 0.02]),
        ("OPENCV", [-0.1, 0.02, 1e-3, -2e-3]),
        ("FULL_OPENCV", [-0.1, 0.02, 1e-3, -2e-3, 0.01, 0.05, -0.01, 2e-3]),
    ],
)
def test_a_scene_yaml_takes_the_coefficients_of_each_perspective_model_of_colmap(
    model: str, coefficients: list[float]
) -> None:
    lens = from_camera(
        {
            "lens": "brown_conrady",
            "resolution": [640, 480],
            "focal_length": 18,
            "coefficients": coefficients,
        }
    )
    focal_lengths = [320] if "RADIAL" in model else [320, 320]
    camera = pycolmap.Camera(
        model=model, width=640, height=480, params=[*focal_lengths, 320, 240, *coefficients]
    )
    directions = points(50)
    expected = camera.img_from_cam(directions)
    np.testing.assert_allclose(lens.pixels(directions * FLIP), expected, rtol=1e-12, atol=1e-9)


def exact_pixel(lens: Any, theta: Any, phi: Any) -> list[Any]:
    """Return the pixel of a ray at θ from the axis and φ from right to down, to 50 digits.

    It is written as the sums of COLMAP's and Project Aria's documentation.
    """
    numbers = [mpmath.mpf(c) for c in lens.coefficients]
    if lens.name == "fisheye624":
        k, (p0, p1, s0, s1, s2, s3) = numbers[:6], numbers[6:]
        r = theta * (1 + sum(c * theta ** (2 * i + 2) for i, c in enumerate(k)))
        x, y, q = r * mpmath.cos(phi), r * mpmath.sin(phi), r**2
        u = x + 2 * p1 * x * y + p0 * (q + 2 * x**2) + s0 * q + s1 * q**2
        v = y + 2 * p0 * x * y + p1 * (q + 2 * y**2) + s2 * q + s3 * q**2
    else:
        k1, k2, p1, p2, k3, k4, sx, sy = numbers
        x, y, q = theta * mpmath.cos(phi), theta * mpmath.sin(phi), theta**2
        radial = 1 + k1 * q + k2 * q**2 + k3 * q**3 + k4 * q**4
        u = x * radial + 2 * p1 * x * y + p2 * (q + 2 * x**2) + sx * q
        v = y * radial + 2 * p2 * x * y + p1 * (q + 2 * y**2) + sy * q
    return [lens.center[0] + u / lens._unit[0], lens.center[1] + v / lens._unit[1]]


@pytest.mark.parametrize(
    ("name", "degrees"), [("thin prism", 170), ("aria", 102.9), ("tenfold prism", 103.3)]
)
def test_bent_fisheyes_beyond_90_degrees_follow_their_equation(name: str, degrees: float) -> None:
    lens = EXAMPLES[name]
    random = np.random.default_rng(5)
    with mpmath.workdps(50):
        for _ in range(100):
            theta = mpmath.radians(random.uniform(80, degrees))
            phi = mpmath.mpf(random.uniform(-math.pi, math.pi))
            sine = mpmath.sin(theta)
            ray = [sine * mpmath.cos(phi), -sine * mpmath.sin(phi), -mpmath.cos(theta)]
            ray = np.array([float(part) for part in ray])
            pixel = np.array([float(part) for part in exact_pixel(lens, theta, phi)])
            np.testing.assert_allclose(lens.pixels(ray), pixel, rtol=0, atol=1e-10)
            assert angle(lens.rays(*pixel), ray) < 1e-12


def test_bent_lenses_without_a_bend_are_the_radial_ones() -> None:
    size = {"width": 160, "height": 120, "focal_length": 11.0, "principal_point": (70, 66.5)}
    terms = (-0.01, 0.03, -0.02, 0.003)
    k1, k2, k3, k4 = terms
    for lens, radial in (
        (
            ThinPrismFisheye(**size, coefficients=(k1, k2, 0, 0, k3, k4, 0, 0)),
            KannalaBrandt(**size, coefficients=terms),
        ),
        (
            Fisheye624(**size, coefficients=(*terms, *[0.0] * 8)),
            KannalaBrandt(**size, coefficients=terms),
        ),
        (BrownConrady(**size, coefficients=(0.0,) * 8), Rectilinear(**size)),
    ):
        rays = radial.pixel_rays()
        assert angle(lens.pixel_rays(), rays).max() < 1e-14
        np.testing.assert_allclose(lens.pixels(rays), radial.pixels(rays), atol=1e-11)
        assert lens.mirrors == radial.mirrors


def test_a_lens_ends_where_it_turns_over() -> None:
    # The equation's own turning point: 1 + 3 k1 t² + 5 k2 t⁴ + 7 k3 t⁶ = 0.
    (square,) = (root.real for root in np.roots([-0.098, 0.45, -0.75, 1]) if root.imag == 0)
    turning = math.atan(math.sqrt(square))
    assert math.degrees(turning) == pytest.approx(60.780, abs=1e-3)
    lens = BrownConrady(width=640, height=480, focal_length=0.47 * 36, coefficients=TURNING)
    rays = lens.pixel_rays()
    seen = np.isfinite(rays[..., 0])
    assert 1 - seen.mean() == pytest.approx(0.028, abs=2e-3)
    theta = np.arccos(-rays[seen][:, 2])
    # No pixel has a ray of the second branch, which lies beyond the turning point.
    assert turning - 0.05 < theta.max() <= turning
    for gap, visible in ((-1e-6, True), (1e-6, False), (0.3, False)):
        ray = np.array([math.sin(turning + gap), 0, -math.cos(turning + gap)])
        assert np.isfinite(lens.pixels(ray)).all() == visible
    message = lens.clipped
    assert message is not None
    assert "ends at 60.78°" in message
    assert "1.186 focal lengths" in message
    assert "2.7 % of the image" in message
    clipped = BrownConrady(
        width=640, height=480, focal_length=17, coefficients=TURNING, fov=math.radians(100)
    )
    largest = np.nanmax(np.arccos(-clipped.pixel_rays()[..., 2]))
    assert math.radians(49.5) < largest <= math.radians(50)


def test_a_rational_lens_ends_at_its_pole() -> None:
    # r = t (1 + t²) / (1 − t² / 4) is infinite at t = 2.
    lens = BrownConrady(
        width=64, height=48, focal_length=5, coefficients=(1, 0, 0, 0, 0, -0.25, 0, 0)
    )
    pole = math.atan(2)
    for theta, visible in ((pole - 1e-3, True), (pole + 1e-3, False), (1.5, False)):
        ray = np.array([math.sin(theta), 0, -math.cos(theta)])
        pixel = lens.pixels(ray)
        assert np.isfinite(pixel).all() == visible
        if visible:
            assert angle(lens.rays(*pixel), ray) < 1e-12


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", EXAMPLES)
def test_all_pixels_with_a_ray_get_it_back(name: str, dtype: type) -> None:
    lens = EXAMPLES[name]
    rays = lens.pixel_rays(dtype)
    seen = np.isfinite(rays[..., 0])
    # Three lenses turn over inside their frames.
    visible = {"strong": 0.97163, "aria": 0.99565, "tenfold prism": 0.99278}.get(name, 1)
    assert seen.mean() == pytest.approx(visible, abs=1e-5)
    y, x = np.mgrid[: lens.height, : lens.width] + 0.5
    error = np.hypot(*np.moveaxis(lens.pixels(rays) - np.stack([x, y], axis=-1), -1, 0))[seen]
    assert error.max() < (1e-10 if dtype == np.float64 else 1e-3)


@pytest.mark.parametrize(
    "lens",
    [
        *EXAMPLES.values(),
        # A bend so strong that it alone folds the image.
        calibrated(BrownConrady, (96, 64), (20, 20), (50, 30), (0, 0, 0.05, -0.08, 0, 0, 0, 0)),
        calibrated(Fisheye624, (96, 64), (15, 15), (50, 30), (*[0.0] * 8, 0.1, -0.01, 0.05, 0)),
    ],
)
def test_no_two_rays_share_a_pixel(lens: BentLens) -> None:
    # A triangle of neighbouring rays keeps its orientation, up to the rim.
    theta = np.linspace(1e-3, math.pi, 2001)[:, None]
    phi = np.linspace(-math.pi, math.pi, 181)
    rays = np.stack(
        np.broadcast_arrays(
            np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)
        ),
        axis=-1,
    )
    pixels = lens.pixels(rays)
    outwards = np.diff(pixels, axis=0)[:, :-1]
    around = np.diff(pixels, axis=1)[:-1]
    area = outwards[..., 0] * around[..., 1] - outwards[..., 1] * around[..., 0]
    assert np.isfinite(area).any()
    assert (area[np.isfinite(area)] < 0).all()


def test_the_bend_is_smooth_to_the_frames_edge_and_two_pixels_beyond() -> None:
    for lens in (EUROC, RATIONAL, THIN_PRISM):
        x, y = np.meshgrid(np.arange(-2.0, lens.width + 3), np.arange(-2.0, lens.height + 3))
        u = (x - lens.center[0]) * lens._unit[0]
        v = (lens.center[1] - y) * lens._unit[1]
        moved = np.stack(lens._unbent(u, v)) - [u, v]
        assert np.isfinite(moved).all()
        # A smooth function's third differences are small beside its first ones; a jump's are not.
        for axis in (1, 2):
            first, third = (np.abs(np.diff(moved, order, axis=axis)).max() for order in (1, 3))
            assert third < first / 100


def test_a_bend_that_is_not_zero_has_no_mirrors() -> None:
    for lens in EXAMPLES.values():
        assert lens.mirrors == (False, False)


def test_coefficients_of_any_size_give_rays_that_return_or_none() -> None:
    random = np.random.default_rng(11)
    bent = [lens for lens in LENSES.values() if issubclass(lens, BentLens)]
    assert len(bent) == 3
    rays_seen = 0
    for _ in range(40):
        for lens_class in bent:
            count = len(lens_class.coefficient_names)
            sizes = 10.0 ** random.uniform(-4, 0.5, count) * (random.random(count) < 0.7)
            lens: Lens = lens_class(
                width=32,
                height=24,
                focal_length=random.choice([6, 12, 30]),
                coefficients=tuple((random.normal(size=count) * sizes).tolist()),
                principal_point=tuple(random.uniform((10, 8), (22, 16)).tolist()),
            )
            rays = lens.pixel_rays()
            seen = np.isfinite(rays[..., 0])
            y, x = np.mgrid[:24, :32] + 0.5
            error = np.abs(lens.pixels(rays) - np.stack([x, y], axis=-1))[seen]
            assert error.max(initial=0) < 1e-8, lens
            rays_seen += seen.sum()
    assert rays_seen > 30_000
