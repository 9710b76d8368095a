"""The lenses, compared with Cycles, OpenCV, mpmath, SILVR's files, and their own inverses."""

import json
import math
import pickle
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import forks
import mpmath
import numpy as np
import pycolmap
import pytest
import yaml
from conftest import BLENDER
from pydantic import TypeAdapter
from scipy.spatial.transform import Rotation

from lightfield import open_dataset
from lightfield.core.errors import UserError
from lightfield.geometry.depth import conventional_depth, z_from_distance
from lightfield.geometry.lenses import (
    LENSES,
    CameraSettings,
    Lens,
    from_camera,
    from_lightfield,
)
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.lenses.division import Division
from lightfield.geometry.lenses.double_sphere import DoubleSphere
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.equisolid import Equisolid
from lightfield.geometry.lenses.extended_unified import ExtendedUnified
from lightfield.geometry.lenses.f_theta import FTheta
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.fov_model import FovModel
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.orthographic import Orthographic
from lightfield.geometry.lenses.polynomial import Polynomial
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.stereographic import Stereographic
from lightfield.geometry.lenses.thin_prism_fisheye import ThinPrismFisheye
from lightfield.geometry.lenses.unified import Unified

BLENDER_POLYNOMIAL = (-1.17e-05, -0.0199887, -3.3525e-06, 3.09927e-06, -2.60646e-08)
OPENCV = (-0.01, 0.03, -0.02, 0.003)
RATIONAL = (8.1, 4.2, 1e-3, -8e-4, 0.2, 8.4, 6.1, 1.0)
THIN_PRISM = (-0.01, 0.03, 2e-3, -1e-3, -0.02, 0.003, 3e-3, -2e-3)
OF_624 = (-0.027, 0.102, -0.072, 0.0125, 1.2e-3, -4e-4, 5e-3, -4e-3, -2e-3, -4e-4, 3e-3, 1e-4)
SIZE = {"width": 2048, "height": 1536}
SHIFTED = {**SIZE, "principal_point": (900.25, 1000.5)}

EXAMPLES: dict[str, Lens] = {
    "rectilinear": Rectilinear(**SIZE, focal_length=18),
    "rectilinear shifted": Rectilinear(**SHIFTED, focal_length=18, sensor_size=(36, 20)),
    "rectilinear 0.01°": Rectilinear(**SIZE, focal_length=18 / math.tan(math.radians(0.005))),
    "rectilinear 179.9°": Rectilinear(**SIZE, focal_length=18 / math.tan(math.radians(89.95))),
    "equidistant 180°": Equidistant(**SIZE, fov=math.pi),
    "equidistant 0.01°": Equidistant(**SIZE, fov=math.radians(0.01)),
    "equidistant shifted 220°": Equidistant(**SHIFTED, fov=math.radians(220)),
    "equidistant 359°": Equidistant(**SIZE, fov=math.radians(359)),
    "equisolid 180°": Equisolid(**SIZE, focal_length=10.5, fov=math.pi),
    "equisolid shifted 359°": Equisolid(**SHIFTED, focal_length=7, fov=math.radians(359)),
    "stereographic 180°": Stereographic(**SIZE, fov=math.pi),
    "stereographic shifted 340°": Stereographic(**SHIFTED, fov=math.radians(340)),
    "orthographic 180°": Orthographic(**SIZE, fov=math.pi),
    "orthographic shifted 100°": Orthographic(**SHIFTED, fov=math.radians(100)),
    "polynomial": Polynomial(**SIZE, coefficients=BLENDER_POLYNOMIAL, fov=math.pi),
    "polynomial turned": Polynomial(
        **SHIFTED, coefficients=(0, 0.08, 1e-4, -1e-5, 0), fov=math.radians(200)
    ),
    "kannala_brandt": KannalaBrandt(**SIZE, focal_length=11, coefficients=OPENCV, fov=3.5),
    "kannala_brandt shifted": KannalaBrandt(
        **SHIFTED, focal_length=11, coefficients=(0, 0, 0, 0), fov=math.radians(300)
    ),
    "brown_conrady": BrownConrady(**SIZE, focal_length=11, coefficients=RATIONAL),
    "brown_conrady shifted": BrownConrady(
        **SHIFTED, focal_length=17, coefficients=(-0.25, 0.09, 1e-3, -8e-4, -0.014, 0, 0, 0)
    ),
    "thin_prism_fisheye": ThinPrismFisheye(**SIZE, focal_length=11, coefficients=THIN_PRISM),
    "fisheye624": Fisheye624(**SIZE, focal_length=11, coefficients=OF_624),
    "fisheye624 shifted": Fisheye624(**SHIFTED, focal_length=11, coefficients=OF_624, fov=3.5),
    "division": Division(**SIZE, focal_length=11, coefficients=(-0.35,)),
    "division k > 0": Division(**SHIFTED, focal_length=30, coefficients=(0.2,)),
    "division k = 0": Division(**SIZE, focal_length=18, coefficients=(0.0,)),
    "fov_model": FovModel(**SIZE, focal_length=14, coefficients=(0.93,)),
    "fov_model shifted": FovModel(**SHIFTED, focal_length=14, coefficients=(1e-6,)),
    "unified": Unified(**SIZE, focal_length=20, coefficients=(0.9,)),
    "unified xi > 1": Unified(**SHIFTED, focal_length=40, coefficients=(1.6,)),
    "unified xi = 1": Unified(**SIZE, focal_length=12, coefficients=(1.0,), fov=5.5),
    "extended_unified": ExtendedUnified(**SIZE, focal_length=9, coefficients=(0.628, 1.023)),
    "extended_unified alpha < 0.5": ExtendedUnified(
        **SHIFTED, focal_length=14, coefficients=(0.3, 4.0)
    ),
    "double_sphere": DoubleSphere(**SIZE, focal_length=9, coefficients=(-0.172, 0.593)),
    "double_sphere alpha < 0.5": DoubleSphere(
        **SHIFTED, focal_length=14, coefficients=(0.4, 0.3), fov=3.3
    ),
    "f_theta": FTheta(**SIZE, focal_length=11, coefficients=(0.01, -0.02, 0.003, -0.001)),
    "f_theta shifted": FTheta(**SHIFTED, focal_length=11, coefficients=(0, 0.1, 0, 0), fov=3),
    "equirectangular": Equirectangular(**SIZE),
    "equirectangular part": Equirectangular(**SIZE, longitude=(-1, 2.5), latitude=(-0.5, 1.2)),
    "equirectangular part ahead": Equirectangular(**SIZE, longitude=(-1.2, 1.2)),
    "equirectangular part to the left": Equirectangular(**SIZE, longitude=(-2, 1)),
    "cube map": CubeMap(width=6 * 512, height=512),
}

# An example of each lens of calibrated cameras. All but one may see behind them.
CALIBRATED = [name for name, lens in LENSES.items() if issubclass(lens, CalibratedLens)]
SEEING_BEHIND = [name for name in CALIBRATED if name != "brown_conrady"]

LANDSCAPE, PORTRAIT = {"width": 96, "height": 64}, {"width": 64, "height": 96}
CAMERAS: dict[str, Lens] = {
    "perspective": Rectilinear(**LANDSCAPE, focal_length=20),
    "perspective shifted": Rectilinear(**PORTRAIT, focal_length=20, principal_point=(25.6, 43.52)),
    "equidistant": Equidistant(**LANDSCAPE, fov=math.pi),
    "equidistant 360°": Equidistant(width=64, height=80, fov=2 * math.pi),
    "equidistant shifted": Equidistant(**LANDSCAPE, fov=3, principal_point=(38.4, 28.16)),
    "equisolid": Equisolid(**LANDSCAPE, focal_length=9, fov=math.radians(220)),
    "equisolid portrait shifted": Equisolid(
        **PORTRAIT, focal_length=9, fov=3, principal_point=(25.6, 41.28)
    ),
    "polynomial": Polynomial(**LANDSCAPE, coefficients=BLENDER_POLYNOMIAL, fov=math.pi),
    "polynomial turned": Polynomial(**LANDSCAPE, coefficients=(0.05, 0.07, 0, 1e-5, 0), fov=3),
    "equirectangular": Equirectangular(**LANDSCAPE),
    "equirectangular part": Equirectangular(**LANDSCAPE, longitude=(-1, 2), latitude=(-0.5, 1)),
}
# Blender's shift_x and shift_y of the shifted cameras.
SHIFTS = {
    "perspective shifted": (0.1, -0.07),
    "equidistant shifted": (0.1, -0.06),
    "equisolid portrait shifted": (0.1, -0.07),
}


def blender_camera(name: str) -> dict[str, object]:
    """Return the attributes of Blender's camera, which lightfield.json names."""
    camera = CAMERAS[name].to_lightfield()["camera"]
    for key in camera.keys() & {"projection_matrix", "principal_point"}:
        del camera[key]
    if camera["type"] == "PERSP":
        camera["lens"] = camera.pop("focal_length")
    # Settings that the lenses fix: the sensor's width counts in images of any shape.
    camera |= {"sensor_fit": "HORIZONTAL", "sensor_width": 36}
    return camera | dict(zip(("shift_x", "shift_y"), SHIFTS.get(name, (0, 0)), strict=True))


both = pytest.mark.parametrize("dtype", [np.float32, np.float64])


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle between unit rays, accurate even for tiny angles."""
    return 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def grid(lens: Lens, dtype: type, steps: int = 129) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the whole frame: its edges, its exact centre, and odd points between."""
    x = np.linspace(0, lens.width, steps).astype(dtype)
    y = np.linspace(0, lens.height, steps).astype(dtype)
    return np.meshgrid(x, y)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_opened_dataset_has_the_rays_and_pixels_of_each_lens(name: str, tmp_path: Path) -> None:
    lens = EXAMPLES[name].fitted(48)
    turn = Rotation.from_euler("xyz", (0.3, 1.1, -0.7)).as_matrix()
    pose = [[*row, place] for row, place in zip(turn.tolist(), (1, 2, -1.5), strict=True)]
    frame = {"name": "view", "world_matrix": [*pose, [0, 0, 0, 1]]}
    content = {**lens.to_lightfield(), "lf_type": "test", "frames": [frame]}
    (tmp_path / "lightfield.json").write_text(json.dumps(content))
    view = open_dataset(tmp_path).views[0]
    origins, directions = view.rays()
    rays = lens.pixel_rays()
    seen = np.isfinite(rays).all(axis=-1)
    assert seen.any()
    assert (origins == (1, 2, -1.5)).all()
    assert angle(directions[seen] @ turn, rays[seen]).max() < 1e-12
    assert np.isnan(directions[~seen]).all()
    pixels, visible = view.project(origins[seen] + 2 * directions[seen])
    row, column = np.nonzero(seen)
    assert visible.all()
    np.testing.assert_allclose(pixels, np.stack([column, row], axis=-1) + 0.5, atol=1e-6)


@pytest.fixture(scope="module")
def cycles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """What Cycles' cameras see, by their names in `CAMERAS`."""
    output = tmp_path_factory.mktemp("cycles") / "positions.npz"
    cases = [
        {"name": name, "resolution": [lens.width, lens.height], "camera": blender_camera(name)}
        for name, lens in CAMERAS.items()
    ]
    program = BLENDER / "cycles_positions.py"
    subprocess.run(
        [forks.python(), program, output],
        input=json.dumps(cases),
        text=True,
        check=True,
        capture_output=True,
    )
    return dict(np.load(output))


@pytest.mark.parametrize("name", CAMERAS)
def test_rays_and_pixels_are_those_of_cycles(name: str, cycles: dict[str, np.ndarray]) -> None:
    lens = CAMERAS[name]
    hit = cycles[name + ".rays"]
    rays = lens.pixel_rays()
    seen = np.isfinite(rays).all(axis=-1)
    np.testing.assert_array_equal(seen, np.isfinite(hit).all(axis=-1))
    # Positions are float32: errors are a few 1e-7 in the median, some 1e-6 at grazing angles.
    difference = angle(rays, hit)[seen]
    assert np.median(difference) < 1e-6
    assert difference.max() < 2e-5
    y, x = np.mgrid[: lens.height, : lens.width] + 0.5
    assert np.abs(lens.pixels(hit) - np.stack([x, y], axis=-1))[seen].max() < 1e-3


@pytest.mark.parametrize("name", CAMERAS)
def test_cycles_depth_is_z_for_perspective_and_distance_otherwise(
    name: str, cycles: dict[str, np.ndarray]
) -> None:
    rays, distance = cycles[name + ".rays"], cycles[name + ".distance"]
    seen = np.isfinite(distance)
    meaning = conventional_depth(CAMERAS[name])
    assert meaning == ("z" if name.startswith("perspective") else "distance")
    depth = z_from_distance(distance, rays) if meaning == "z" else distance
    np.testing.assert_allclose(cycles[name + ".depth"][seen], depth[seen], rtol=1e-5)


@pytest.mark.parametrize("name", [name for name in CAMERAS if name.startswith("perspective")])
def test_projection_matrix_is_blenders(name: str, cycles: dict[str, np.ndarray]) -> None:
    matrix = CAMERAS[name].to_lightfield()["camera"]["projection_matrix"]
    np.testing.assert_allclose(matrix, cycles[name + ".matrix"], rtol=1e-6, atol=1e-7)


def test_kannala_brandt_is_opencvs_fisheye() -> None:
    lens = KannalaBrandt(
        width=640,
        height=480,
        focal_length=12,
        sensor_size=(36, 30),
        principal_point=(310, 250),
        coefficients=OPENCV,
    )
    matrix = np.array([[12 / 36 * 640, 0, 310], [0, 12 / 30 * 480, 250], [0, 0, 1]])
    random = np.random.default_rng(4)
    theta, phi = random.uniform(0, 1.5, 1000), random.uniform(-np.pi, np.pi, 1000)
    # OpenCV's cameras look along +Z with +Y down.
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None] * 3, np.zeros(3), np.zeros(3), matrix, np.array(OPENCV)
    )
    rays = points * [1, -1, -1]
    np.testing.assert_allclose(lens.pixels(rays), expected[:, 0], atol=1e-9)
    assert angle(lens.rays(expected[:, 0, 0], expected[:, 0, 1]), rays).max() < 1e-12


COLMAP = {
    "division": ("DIVISION", Division, (-0.35,), 1.55, 170),
    "division k > 0": ("DIVISION", Division, (0.2,), 0.84, 47.9),
    "simple division": ("SIMPLE_DIVISION", Division, (-0.05,), 1.55, 120),
    "fov_model": ("FOV", FovModel, (0.93,), 1.55, 89.9),
    "fov_model narrow": ("FOV", FovModel, (2.5,), 1.55, 89.9),
    "extended_unified": ("EUCM", ExtendedUnified, (0.628, 1.023), 1.55, 89.9),
    "extended_unified alpha < 0.5": ("EUCM", ExtendedUnified, (0.3, 4.0), 1.55, 89.9),
}


@pytest.mark.parametrize("name", COLMAP)
def test_lenses_of_colmap_have_its_pixels_and_rays(name: str) -> None:
    model, lens_class, coefficients, inverted_to, degrees = COLMAP[name]
    is_simple = model == "SIMPLE_DIVISION"
    sensor = (36, 27 if is_simple else 30)
    focal_lengths = [12 / sensor[0] * 640, 12 / sensor[1] * 480][: 1 if is_simple else 2]
    lens = lens_class(
        width=640,
        height=480,
        focal_length=12,
        sensor_size=sensor,
        principal_point=(310, 250),
        coefficients=coefficients,
    )
    numbers = [*focal_lengths, 310, 250, *coefficients]
    camera = pycolmap.Camera(model=model, width=640, height=480, params=numbers)
    random = np.random.default_rng(4)
    # Within 0.6° of the axis, COLMAP's FOV is a series, which is off by up to 2e-6 pixels.
    theta, phi = np.radians(random.uniform(1, degrees, 1000)), random.uniform(-np.pi, np.pi, 1000)
    # COLMAP's cameras look along +Z with +Y down, and its first pixel's centre is at 0.5.
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
    rays = points * [1, -1, -1]
    expected = camera.img_from_cam(points * 3)
    np.testing.assert_allclose(lens.pixels(rays), expected, rtol=1e-12, atol=1e-9)
    # Where COLMAP's own inverse has the sign of z, it agrees, too.
    seen = theta < inverted_to
    back = camera.cam_ray_from_img(expected[seen]) * [1, -1, -1]
    assert angle(lens.rays(*expected[seen].T), back).max() < 1e-10


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_lens_that_was_used_goes_to_another_process(name: str) -> None:
    lens = EXAMPLES[name].fitted(48)
    rays = lens.pixel_rays()
    lens.pixels(rays)
    sent = pickle.loads(pickle.dumps(lens))
    assert sent == lens
    np.testing.assert_array_equal(sent.pixel_rays(), rays)


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name.startswith("rectilinear")])
def test_k_projects_in_opencv_to_the_lenss_pixels(name: str) -> None:
    lens = EXAMPLES[name]
    rays = lens.rays(*np.random.default_rng(6).uniform(0, (lens.width, lens.height), (100, 2)).T)
    # OpenCV's cameras look along +Z with +Y down.
    points = rays * [1, -1, -1] * 3
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), lens.K, np.zeros(4))
    np.testing.assert_allclose(lens.pixels(rays), expected[:, 0], atol=1e-9)


def test_k_is_in_pixels_and_the_first_centre_is_at_a_half() -> None:
    lens = from_camera({"lens": "rectilinear", "fov": 90, "resolution": [40, 30]})
    np.testing.assert_allclose(lens.K, [[20, 0, 20], [0, 20, 15], [0, 0, 1]])
    direction = np.linalg.inv(lens.K) @ (0.5, 0.5, 1)
    ray = lens.pixel_rays()[0, 0] * [1, -1, -1]
    np.testing.assert_allclose(direction / np.linalg.norm(direction), ray, atol=1e-12)


@pytest.mark.parametrize("name", [name for name in EXAMPLES if "rectilinear" not in name])
def test_other_lenses_have_no_k_and_say_what_to_use(name: str) -> None:
    lens = EXAMPLES[name]
    with pytest.raises(UserError) as raised:
        lens.K  # noqa: B018
    message = str(raised.value)
    assert "\n" not in message
    assert lens.title in message
    assert "rays" in message
    assert "perspective reprojection" in message


@both
@pytest.mark.parametrize("name", EXAMPLES)
def test_pixels_undo_rays_and_rays_undo_pixels_over_the_whole_frame(name: str, dtype: type) -> None:
    lens = EXAMPLES[name]
    exact, tolerance = dtype == np.float64, 4 * np.finfo(dtype).eps
    for in_whole_frame in (True, False):
        x, y = grid(lens, dtype)
        if not in_whole_frame:
            x, y = x[1:-1, 1:-1] + dtype(0.25), y[1:-1, 1:-1] + dtype(0.25)
        rays = lens.rays(x, y)
        seen = np.isfinite(rays[..., 0])
        assert seen.mean() > 0.3
        np.testing.assert_allclose(np.linalg.norm(rays[seen], axis=-1), 1, rtol=tolerance)
        pixels = lens.pixels(rays)
        assert rays.dtype == pixels.dtype == dtype
        again = lens.rays(*pixels[seen].T)
        assert angle(again, rays[seen]).max() < (1e-9 if exact else 2e-5)
        # A pixel on a border between faces, at a pole or on the seam shares its ray with another.
        if not in_whole_frame or not isinstance(lens, CubeMap | Equirectangular):
            error = np.abs(pixels - np.stack([x, y], axis=-1))[seen]
            assert error.max() < (1e-9 if exact else 0.01)


@pytest.mark.parametrize("name", EXAMPLES)
def test_lightfield_json_restores_the_lens(name: str) -> None:
    lens = EXAMPLES[name]
    text = json.dumps(lens.to_lightfield(), allow_nan=False)
    assert from_lightfield(json.loads(text)) == replace(lens, sensor_size=lens.sensor)


@pytest.mark.parametrize("name", EXAMPLES)
def test_resized_keeps_the_field_of_view(name: str) -> None:
    lens = EXAMPLES[name]
    small = lens.resized(lens.width // 8, lens.height // 8)
    x, y = grid(small, np.float64, 33)
    np.testing.assert_allclose(small.rays(x, y), lens.rays(x * 8, y * 8), atol=1e-12)


@both
@pytest.mark.parametrize("name", EXAMPLES)
def test_rays_of_any_length_and_of_none(name: str, dtype: type) -> None:
    lens = EXAMPLES[name]
    narrow = 1e-3 if "0.01°" in name else 1
    ray = np.array([0.02 * narrow, -0.03 * narrow, -0.9], dtype)
    tiny, huge = np.finfo(dtype).tiny * 1e6, np.finfo(dtype).max / 4
    expected = lens.pixels(ray)
    assert np.isfinite(expected).all()
    for length in (tiny, huge):
        np.testing.assert_allclose(lens.pixels(ray * dtype(length)), expected, rtol=1e-5)
    no_rays = ([0, 0, 0], [np.nan, 0, -1], [0, np.inf, -1], [-np.inf, np.inf, np.nan])
    for bad in no_rays:
        assert np.isnan(lens.pixels(np.array(bad, dtype))).all()
    among = lens.pixels(np.array([ray, *no_rays], dtype))
    np.testing.assert_array_equal(np.isnan(among), [[i > 0] * 2 for i in range(5)])
    for x, y in ((np.nan, 5), (5, np.inf)):
        assert np.isnan(lens.rays(np.array(x, dtype), np.array(y, dtype))).all()


@pytest.mark.parametrize("name", EXAMPLES)
def test_shapes(name: str) -> None:
    lens = EXAMPLES[name]
    x, y = lens.width / 2 + 3, lens.height / 2 + 2
    assert lens.rays(x, y).shape == (3,)
    assert lens.rays(np.full((4, 1), x), np.full(5, y)).shape == (4, 5, 3)
    assert lens.pixels(np.empty((0, 3))).shape == (0, 2)
    np.testing.assert_allclose(lens.pixels(lens.rays(x, y)), [x, y], atol=1e-9)


@pytest.mark.parametrize("name", EXAMPLES)
def test_z_depth_is_for_lenses_within_180_degrees(name: str) -> None:
    lens = EXAMPLES[name]
    cos = -lens.rays(*grid(lens, np.float64))[..., 2]
    if lens.has_z_depth:
        assert np.nanmin(cos) > -1e-6
    # A lens without Z-depth may still have a frame that ends earlier.
    elif "kannala" not in name and "polynomial" not in name:
        assert np.nanmin(cos) < 0


def fisheyes(fov: float) -> list[Lens]:
    """Return one of every fisheye of at least 180 degrees, completely in the frame."""
    size = {"width": 64, "height": 48, "fov": fov}
    calibration: dict[str, Any] = {"focal_length": 4, "coefficients": (0.0,) * 4}
    return [
        Equidistant(**size),
        Equisolid(**size, focal_length=4),
        Stereographic(**size),
        Polynomial(**size, coefficients=(0, -0.25, 0, 0, 0)),
        KannalaBrandt(**size, **calibration),
        FTheta(**size, **calibration),
        Division(**size, focal_length=4, coefficients=(-1,)),
        Unified(**size, focal_length=4, coefficients=(1,)),
        ExtendedUnified(**size, focal_length=4, coefficients=(0.6, 1.1)),
        DoubleSphere(**size, focal_length=4, coefficients=(-0.2, 0.6)),
    ]


def test_depth_is_z_up_to_exactly_180_degrees_and_distance_beyond() -> None:
    half, beyond = math.pi / 2, math.radians(90.01)
    for lens in (*fisheyes(math.pi), Orthographic(width=64, height=48, fov=math.pi)):
        assert lens.usual_depth == "z"
        # The ray at 90 degrees is on the rim, and the lens sees it.
        for ray in ([1.0, 0, 0], [0, -1.0, 0]):
            np.testing.assert_allclose(lens.rays(*lens.pixels(np.array(ray))), ray, atol=1e-7)
    for lens in fisheyes(2 * beyond):
        assert lens.usual_depth == "distance"
    for longitude, meaning in (
        ((-half, half), "z"),
        ((-half, beyond), "distance"),
        ((-beyond, half), "distance"),
    ):
        assert Equirectangular(**SIZE, longitude=longitude).usual_depth == meaning
    assert EXAMPLES["rectilinear 179.9°"].usual_depth == "z"
    assert EXAMPLES["cube map"].usual_depth == "distance"


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_lens_has_exactly_the_mirrors_that_it_declares(name: str) -> None:
    lens = EXAMPLES[name]
    x, y = grid(lens, np.float64, 30)
    rays = lens.rays(x, y)
    for mirrors, mirrored, axis in (
        (lens.mirrors[0], lens.rays(x, lens.height - y), [1, -1, 1]),
        (lens.mirrors[1], lens.rays(lens.width - x, y), [-1, 1, 1]),
    ):
        assert np.allclose(mirrored * axis, rays, atol=1e-9, equal_nan=True) == mirrors


def test_a_frame_without_an_image_circle_is_seen_to_its_edges() -> None:
    for name, lens in EXAMPLES.items():
        if isinstance(lens, CubeMap | Equirectangular | Rectilinear):
            assert np.isfinite(lens.rays(*grid(lens, np.float64))).all(), name
    cube, panorama = EXAMPLES["cube map"], EXAMPLES["equirectangular"]
    for x, y in ((-0.01, 5), (cube.width + 0.01, 5), (5, -0.01), (5, cube.height + 0.01)):
        assert np.isnan(cube.rays(x, y)).all()
    for y in (-0.01, panorama.height + 0.01):
        assert np.isnan(panorama.rays(5, y)).all()


def test_a_turn_of_a_panorama_is_360_degrees() -> None:
    assert EXAMPLES["equirectangular"].turn == 2048
    assert Equirectangular(**SIZE, longitude=(-0.5, 1)).turn == pytest.approx(
        2048 * 2 * math.pi / 1.5
    )


def test_exact_centre_looks_along_the_axis() -> None:
    for lens in EXAMPLES.values():
        if not isinstance(lens, CubeMap | Equirectangular | Polynomial):
            np.testing.assert_array_equal(lens.rays(*lens.center), [0, 0, -1])
            np.testing.assert_array_equal(lens.pixels(np.array([0.0, 0, -1])), lens.center)


def test_beyond_the_field_of_view_is_nan() -> None:
    size = {"width": 64, "height": 48}
    for lens, limit in (
        (Rectilinear(**size, focal_length=18), 90),
        (Equidistant(**size, fov=math.radians(130)), 65),
        (Equidistant(**size, fov=math.radians(360)), 180),
        (Equisolid(**size, focal_length=10, fov=math.radians(250)), 125),
        (Stereographic(**size, fov=math.radians(290)), 145),
        (Orthographic(**size, fov=math.radians(180)), 90),
        (Orthographic(**size, fov=math.radians(120)), 60),
        (Polynomial(**size, coefficients=(0, -0.1, 0, 0, 0), fov=math.radians(210)), 105),
        (
            KannalaBrandt(**size, focal_length=10, coefficients=(0, 0, 0, 0), fov=3),
            math.degrees(1.5),
        ),
        (Division(**size, focal_length=10, coefficients=(0.75,)), 30),
        (Division(**size, focal_length=10, coefficients=(-0.75,)), 180),
        (FovModel(**size, focal_length=10, coefficients=(1,)), 90),
        (FovModel(**size, focal_length=10, coefficients=(1,), fov=3), math.degrees(1.5)),
        (Unified(**size, focal_length=10, coefficients=(0.5,)), 120),
        (Unified(**size, focal_length=10, coefficients=(2,)), 120),
        (Unified(**size, focal_length=10, coefficients=(-0.5,)), 60),
        (ExtendedUnified(**size, focal_length=10, coefficients=(1 / 3, 1)), 120),
        (ExtendedUnified(**size, focal_length=10, coefficients=(2 / 3, 1)), 120),
        (DoubleSphere(**size, focal_length=10, coefficients=(0, 1 / 3)), 120),
        (DoubleSphere(**size, focal_length=10, coefficients=(0, 2 / 3)), 120),
        # Both spheres see 90°, and the second sphere's centre lies ξ behind the first.
        (DoubleSphere(**size, focal_length=10, coefficients=(0.5, 1)), 120),
        (DoubleSphere(**size, focal_length=10, coefficients=(-0.5, 1)), 60),
        (Equirectangular(**size), 180),
        (CubeMap(width=96, height=16), 180),
    ):
        # Just inside and just outside, and further out to the backward axis.
        degrees = np.array([*np.linspace(0, 180, 361), limit - 1e-4, limit + 1e-4])
        degrees = degrees[(degrees <= 180) & (degrees != limit)]
        theta = np.radians(degrees)
        rays = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
        seen = np.isfinite(lens.pixels(rays)).all(axis=-1)
        np.testing.assert_array_equal(seen, degrees < limit, err_msg=str(lens))


def test_image_circle_of_a_non_square_fisheye_touches_all_four_edges() -> None:
    for lens in (
        Equidistant(width=96, height=64, fov=2),
        Stereographic(width=96, height=64, fov=2),
        Orthographic(width=96, height=64, fov=2),
    ):
        for x, y in ((0, 32), (96, 32), (48, 0), (48, 64)):
            assert math.isclose(math.acos(-lens.rays(x, y)[2]), 1, rel_tol=1e-12)
        assert np.isnan(lens.rays(0, 0)).all()


@pytest.mark.parametrize("turning", [(0.1, -1e-3), (0.05, -5e-4)])
def test_a_polynomial_ends_at_its_turning_point(turning: tuple[float, float]) -> None:
    # θ = a r + b r³ turns at r = √(−a / 3b).
    a, b = turning
    radius = math.sqrt(-a / (3 * b))
    lens = Polynomial(width=200, height=200, coefficients=(0, -a, 0, -b, 0), fov=math.pi)
    millimetre = 200 / 36
    inside, outside = 100 + radius * (1 - 1e-6) * millimetre, 100 + radius * 1.01 * millimetre
    assert np.isfinite(lens.rays(inside, 100)).all()
    assert np.isnan(lens.rays(outside, 100)).all()
    largest = a * radius + b * radius**3
    for theta, seen in ((largest * 0.999999, True), (largest * 1.0001, False)):
        pixel = lens.pixels(np.array([math.sin(theta), 0, -math.cos(theta)]))
        assert np.isfinite(pixel).all() == seen
        if seen:
            root = mpmath.polyroots([-theta, a, 0, b], maxsteps=500, extraprec=200, asc=True)
            expected = min(float(r.real) for r in root if r.real > 0)
            assert math.isclose((pixel[0] - 100) / millimetre, expected, rel_tol=1e-9)


def test_a_polynomial_that_turns_twice_ends_at_its_first_turning_point() -> None:
    # t³ / 3 − 7 t² / 2 + 12 t turns at 3 and at 4.
    rising = IncreasingPolynomial((0, 12, -3.5, 1 / 3), math.inf)
    assert math.isclose(rising.end, 3)
    values = rising.value(np.array([0, 1.5, 3 - 1e-3]))
    np.testing.assert_allclose(rising.inverse(values), [0, 1.5, 3 - 1e-3], atol=1e-9)
    assert np.isnan(rising.inverse(np.array([14.0]))).all()
    # A parabola has one turning point.
    assert math.isclose(IncreasingPolynomial((0, 0.1, -0.01)).end, 5)


def test_kannala_brandt_ends_at_its_turning_point() -> None:
    # r = f (θ − θ³ / 3) turns at θ = 1, r = 2 f / 3.
    lens = KannalaBrandt(
        width=200, height=200, focal_length=12, coefficients=(-1 / 3, 0, 0, 0), fov=math.pi
    )
    scale = 12 * 200 / 36
    assert np.isfinite(lens.rays(100 + scale * 0.6666, 100)).all()
    assert np.isnan(lens.rays(100 + scale * 0.6667, 100)).all()
    assert np.isnan(lens.pixels(np.array([math.sin(1.001), 0, -math.cos(1.001)]))).all()


@pytest.mark.parametrize(
    ("lens", "degrees", "radius"),
    [
        # r = θ − θ³ / 3 turns at 1 rad.
        (KannalaBrandt(**LANDSCAPE, focal_length=9, coefficients=(-1 / 3, 0, 0, 0)), 57.3, 0.6667),
        # r = t − t³ / 3 turns at t = 1, and θ = 45°.
        (
            BrownConrady(**LANDSCAPE, focal_length=18, coefficients=(-1 / 3, *[0.0] * 7)),
            45,
            0.6667,
        ),
        (
            ThinPrismFisheye(**LANDSCAPE, focal_length=9, coefficients=(-1 / 3, *[0.0] * 7)),
            57.3,
            0.6667,
        ),
        # The prism alone folds the image: 2 s r = 1, before r = θ reaches 360° / 2.
        (
            Fisheye624(**LANDSCAPE, focal_length=9, coefficients=(*[0.0] * 8, 0.5, 0, 0, 0)),
            57.3,
            1,
        ),
        # r = θ − θ² / 4 turns at 2 rad.
        (FTheta(**LANDSCAPE, focal_length=9, coefficients=(-0.25, 0, 0, 0)), 114.6, 1),
        # tan θ = r / (1 + r²) is at most 1 / 2.
        (Division(**LANDSCAPE, focal_length=9, coefficients=(1,)), 26.57, 1),
        (FovModel(**LANDSCAPE, focal_length=9, coefficients=(math.pi / 2,)), 90, 1),
        # cos θ = −1 / ξ, r = 1 / √(ξ² − 1).
        (Unified(**LANDSCAPE, focal_length=9, coefficients=(1.25,)), 143.1, 4 / 3),
        # The unit sphere, seen from infinity.
        (ExtendedUnified(**LANDSCAPE, focal_length=9, coefficients=(1, 1)), 90, 1),
        (DoubleSphere(**LANDSCAPE, focal_length=9, coefficients=(0, 1)), 90, 1),
    ],
    ids=lambda lens: getattr(lens, "name", ""),
)
def test_a_lens_that_ends_inside_its_image_says_where_and_how_much_has_no_ray(
    lens: CalibratedLens, degrees: float, radius: float
) -> None:
    assert lens.clipped is not None
    assert "\n" not in lens.clipped
    assert f"the {lens.title} ends at {degrees:.4g}°, {radius:.4g} focal lengths" in lens.clipped
    blank = np.isnan(lens.pixel_rays()).any(axis=-1).mean()
    assert f"{100 * blank:.2g} % of the image has no ray" in lens.clipped
    assert "fov" in lens.clipped
    # A user's limit is no surprise. Neither is a frame inside the limit.
    assert replace(lens, fov=2 * math.radians(degrees) - 0.01).clipped is None
    assert replace(lens, fov=2 * math.radians(degrees) + 0.01).clipped == lens.clipped
    assert replace(lens, focal_length=90).clipped is None


def test_lenses_without_an_end_are_not_clipped() -> None:
    for name in ("rectilinear", "equidistant 180°", "division", "unified xi = 1", "polynomial"):
        assert EXAMPLES[name].clipped is None


@pytest.mark.parametrize(
    ("lens", "coefficients", "message"),
    [
        (FovModel, (0.0,), "omega = 0.0 must be above 0 and below π"),
        (FovModel, (math.pi,), "omega = 3.14.* must be above 0 and below π"),
        (Unified, (-1.0,), "xi = -1.0 must be above -1"),
        (ExtendedUnified, (-0.1, 1.0), "alpha = -0.1 must be from 0 to 1"),
        (ExtendedUnified, (1.1, 1.0), "alpha = 1.1 must be from 0 to 1"),
        (ExtendedUnified, (0.5, 0.0), "beta = 0.0 must be above 0"),
        (DoubleSphere, (1.0, 0.5), "xi = 1.0 must be above -1 and below 1"),
        (DoubleSphere, (-1.0, 0.5), "xi = -1.0 must be above -1 and below 1"),
        (DoubleSphere, (0.0, 1.1), "alpha = 1.1 must be from 0 to 1"),
    ],
)
def test_a_coefficient_outside_its_range_is_named(
    lens: type[CalibratedLens], coefficients: tuple[float, ...], message: str
) -> None:
    with pytest.raises(UserError, match=f"coefficients: {message}"):
        lens(**LANDSCAPE, focal_length=9, coefficients=coefficients)


@pytest.mark.parametrize(
    ("other", "name"),
    [
        ("ucm", "unified"),
        ("mei", "unified"),
        ("omni", "unified"),
        ("eucm", "extended_unified"),
        ("ds", "double_sphere"),
        ("atan", "fov_model"),
        ("ftheta", "f_theta"),
        ("radtan", "brown_conrady"),
    ],
)
def test_the_names_of_other_programs_for_a_lens_suggest_it(other: str, name: str) -> None:
    with pytest.raises(UserError, match=f"did you mean {name}"):
        from_camera({"lens": other, "resolution": [96, 64], "focal_length": 9})


# r in focal lengths at θ, as the models are published.
PUBLISHED: dict[type[CalibratedLens], Any] = {
    Division: lambda c, s, k: 2 * s / (c + mpmath.sqrt(c * c - 4 * k * s * s)),
    FovModel: lambda c, s, omega: mpmath.atan(2 * s / c * mpmath.tan(omega / 2)) / omega,
    Unified: lambda c, s, xi: s / (c + xi),
    ExtendedUnified: lambda c, s, alpha, beta: (
        s / (alpha * mpmath.sqrt(beta * s * s + c * c) + (1 - alpha) * c)
    ),
    DoubleSphere: lambda c, s, xi, alpha: (
        s / (alpha * mpmath.sqrt(s * s + (xi + c) ** 2) + (1 - alpha) * (xi + c))
    ),
    FTheta: lambda c, s, *k: mpmath.polyval([0, 1, *k], mpmath.atan2(s, c), asc=True),
}
EXTREMES = [
    *((Division, (k,)) for k in (-1e6, -0.3, -1e-12, 1e-12, 0.3, 1e6)),
    *((FovModel, (omega,)) for omega in (1e-9, 0.9, 3.14)),
    *((Unified, (xi,)) for xi in (-0.999, 0.0, 1e-9, 0.9, 1.0, 1 + 1e-9, 1e6)),
    *((ExtendedUnified, pair) for pair in ((0, 1), (1, 1e-6), (0.5, 1e6), (0.5 + 1e-9, 1))),
    *((DoubleSphere, pair) for pair in ((-0.999, 0.01), (0.999, 0.99), (0, 0), (-0.2, 0.6))),
    *((FTheta, k) for k in ((-0.1, 0, 0, 0), (1e-9, 0, 0, -1e-9), (0, 0, 0, 1e3))),
]


@pytest.mark.parametrize(
    ("lens_class", "coefficients"), EXTREMES, ids=lambda part: getattr(part, "name", part)
)
def test_a_calibrated_lens_has_its_published_radius_at_50_digits(
    lens_class: type[CalibratedLens], coefficients: tuple[float, ...]
) -> None:
    # A pixel is 1 / 1000 of the focal length.
    lens = lens_class(width=1000, height=1000, focal_length=36, coefficients=coefficients)
    published, eps = PUBLISHED[lens_class], np.finfo(np.float64).eps
    seen = 0
    with mpmath.workdps(50):
        exact = [mpmath.mpf(float(number)) for number in coefficients]
        for angle_from_axis in (1e-12, 1e-6, 0.3, 1.2, 1.57, 1.6, 2.0, 2.5, 3.1):
            s, c = math.sin(angle_from_axis), math.cos(angle_from_axis)
            theta = mpmath.atan2(mpmath.mpf(s), mpmath.mpf(c))

            def radius(t: Any) -> Any:
                return published(mpmath.cos(t), mpmath.sin(t), *exact)

            expected, slope = radius(theta), mpmath.diff(radius, theta)
            pixel = lens.pixels(np.array([0, s, -c]))
            is_real = all(isinstance(number, mpmath.mpf) for number in (expected, slope))
            assert np.isfinite(pixel).all() == bool(is_real and expected > 0 and slope > 0)
            if np.isnan(pixel).any():
                continue
            seen += 1
            # Rounding moves each number of the chain by up to one eps.
            allowed = 16 * eps * (expected + slope * min(theta, 1) + abs(slope * c * s))
            assert abs((500 - mpmath.mpf(float(pixel[1]))) / 1000 - expected) < allowed + eps
            # And back: the pixel's own rounding moves θ by this much.
            back = lens.rays(*pixel)
            moved = 16 * eps * (1 + (1 + 1 / 2 + expected) / slope)
            assert abs(mpmath.atan2(float(back[1]), -float(back[2])) - theta) < moved
    assert seen >= 2


def test_a_pixel_that_float32_cannot_hold_is_a_miss() -> None:
    lens = Division(**LANDSCAPE, focal_length=9, coefficients=(-1e-98,))
    ray = np.array([1e-3, 0, 1])
    assert lens.pixels(ray)[0] > 1e90
    with np.errstate(all="raise"):
        assert np.isnan(lens.pixels(ray.astype(np.float32))).all()


def test_hole_of_a_polynomial_lens() -> None:
    # θ = 0.01 + 0.1 r leaves a hole. A hole narrower than a pixel belongs to the centre.
    axis = np.array([0.0, 0, -1])
    for width, height, closed in (
        (100, 100, True),
        (340, 340, True),
        (400, 400, False),
        (2000, 100, True),
    ):
        lens = Polynomial(
            width=width,
            height=height,
            sensor_size=(36, 36),
            coefficients=(-0.01, -0.1, 0, 0, 0),
            fov=math.pi,
        )
        pixel = lens.pixels(axis)
        assert (pixel == lens.center).all() if closed else np.isnan(pixel).all()
        # The centre itself looks up, as in Cycles.
        up = [0, math.sin(0.01), -math.cos(0.01)]
        np.testing.assert_allclose(lens.rays(*lens.center), up, atol=1e-15)


@pytest.mark.parametrize(
    ("coefficients", "radius"),
    [
        # θ = 0.5 where −k0 + 0.1 r is 0.5.
        ((0.01, -0.1, 0, 0, 0), 5.1),
        ((-0.01, -0.1, 0, 0, 0), 4.9),
        # Turned by 180 degrees.
        ((-0.01, 0.1, 0, 0, 0), -5.1),
        # The lens sees only within 0.4 mm: 0.1 r + 10 r² is 0.5.
        ((0, -0.1, -10, 0, 0), (math.sqrt(0.01 + 20) - 0.1) / 20),
        ((0, 0, -2, 0, 0), 0.5),
        ((0, 0, 0, -4, 0), 0.5),
    ],
)
def test_a_polynomials_rays_solve_its_equation(
    coefficients: tuple[float, ...], radius: float
) -> None:
    lens = Polynomial(width=360, height=360, coefficients=coefficients, fov=math.pi)
    ray = np.array([math.sin(0.5), 0, -math.cos(0.5)])
    np.testing.assert_allclose(lens.pixels(ray), [180 + 10 * radius, 180], rtol=1e-12)
    rim = lens.pixels(np.array([1.0, 0, 0]))
    np.testing.assert_allclose(lens.rays(*rim), [1, 0, 0], atol=1e-9)
    assert np.isnan(lens.pixels(np.array([1.0, 0, 0.01]))).all()


def test_wide_lenses_are_precise_near_the_rim() -> None:
    # At 1e-6 rad from the backward axis, θ alone would be 10 % off in float32.
    gap = np.float32(1e-6)
    ray = np.array([gap, 0, 1], np.float32)
    with mpmath.workdps(30):
        theta = mpmath.pi - mpmath.atan(mpmath.mpf(float(gap)))
        fov = math.radians(359.9995)
        expected = 1000 + 1000 * float(mpmath.tan(theta / 2) / mpmath.tan(mpmath.mpf(fov) / 4))
    lens = Stereographic(width=2000, height=2000, fov=math.radians(359.9999))
    x = lens.pixels(ray)[0] - 1000
    ratio = math.tan(math.radians(359.9999) / 4) / math.tan(fov / 4)
    assert math.isclose(x * ratio, expected - 1000, rel_tol=1e-6)


@both
def test_backward_axis_is_on_the_rim_of_a_lens_of_360_degrees(dtype: type) -> None:
    # Blender's angles are a little too large.
    size = {"width": 200, "height": 100, "fov": 2 * math.pi + 5e-7}
    for lens, radius in (
        (Equidistant(**size), 50),
        (Equisolid(**size, focal_length=4.5), 50),
        (KannalaBrandt(**size, focal_length=4, coefficients=(0, 0, 0, 0)), 4 * math.pi / 36 * 200),
        (Polynomial(**size, coefficients=(0, -0.25, 0, 0, 0)), 4 * math.pi / 36 * 200),
    ):
        pixel = lens.pixels(np.array([0, 0, 1], dtype))
        # Any azimuth is right, but the lens's centre is not.
        np.testing.assert_allclose(pixel, [100, 50 - radius], atol=1e-4)
        np.testing.assert_allclose(lens.rays(*pixel), [0, 0, 1], atol=1e-6)


def test_equirectangular_poles_and_seam() -> None:
    lens = Equirectangular(width=360, height=180)
    for dtype in (np.float32, np.float64):
        rays = np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, -1]], dtype)
        expected = [[180, 0], [180, 180], [270, 90], [180, 90]]
        np.testing.assert_allclose(lens.pixels(rays), expected, atol=1e-4)
        backward = lens.pixels(np.array([[0, 0, 1], [-1e-30, 0, 1], [1e-30, 0, 1]], dtype))[:, 0]
        np.testing.assert_allclose(backward, [360, 0, 360], atol=1e-4)
    part = Equirectangular(width=100, height=100, longitude=(0, 1), latitude=(0, 1))
    east = np.array([math.sin(-0.1), 0, -math.cos(-0.1)])
    np.testing.assert_allclose(part.pixels(east), [-10, 100], atol=1e-12)


def test_cube_faces_are_turned_as_the_sides_of_a_cuboid_rig() -> None:
    # Blender's XYZ Euler angles of each side of SILVR's cuboid.
    half = math.pi / 2
    sides = {
        "f": (half, 0, 0),
        "b": (half, 0, math.pi),
        "l": (half, 0, half),
        "r": (half, 0, -half),
        "u": (math.pi, 0, 0),
        "d": (0, 0, 0),
    }
    assert list(sides) == list(CUBE_FACES)
    front = Rotation.from_euler("xyz", sides["f"]).as_matrix()
    lens = CubeMap(width=60, height=10)
    for i, (face, euler) in enumerate(sides.items()):
        rotation = front.T @ Rotation.from_euler("xyz", euler).as_matrix()
        np.testing.assert_allclose(CUBE_FACES[face], rotation, atol=1e-15)
        pinhole = Rectilinear(width=10, height=10, focal_length=18)
        y, x = np.mgrid[:10, :10] + 0.5
        expected = pinhole.pixel_rays() @ rotation.T
        np.testing.assert_allclose(lens.rays(x + 10 * i, y), expected, atol=1e-15)
        np.testing.assert_allclose(
            lens.pixels(expected), np.stack([x + 10 * i, y], axis=-1), atol=1e-12
        )


@both
def test_no_ray_falls_between_cube_faces(dtype: type) -> None:
    lens = CubeMap(width=6 * 64, height=64)
    corners = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z],
        dtype,
    )
    corners /= np.linalg.norm(corners, axis=-1, keepdims=True)
    again = lens.rays(*np.moveaxis(lens.pixels(corners), -1, 0))
    assert angle(again, corners).max() < 10 * np.finfo(dtype).eps


README = {"resolution": [2048, 2048], "sensor_size": [36.0, 36.0]}


def test_reads_silvrs_documented_files() -> None:
    # The three examples in the README of https://github.com/IDLabMedia/image-lens-reproject.
    size = {"width": 2048, "height": 2048, "sensor_size": (36.0, 36.0)}
    fov = 3.1415927410125732
    rectilinear = {
        "camera": {
            "focal_length": 36.0,
            "lens_unit": "MILLIMETERS",
            "projection_matrix": [[2.0, 0, 0, 0], [0, 2.0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1.0]],
            "type": "PERSP",
        }
    }
    assert from_lightfield(README | rectilinear) == Rectilinear(**size, focal_length=36)
    equidistant = {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": fov}
    lens = from_lightfield(README | {"camera": equidistant})
    assert lens == Equidistant(**size, fov=fov)
    assert lens.has_z_depth
    equisolid = {
        "type": "PANO",
        "panorama_type": "FISHEYE_EQUISOLID",
        "lens": 12.5,
        "fisheye_fov": fov,
    }
    expected = Equisolid(**size, focal_length=12.5, fov=fov)
    assert from_lightfield(README | {"camera": equisolid}) == expected


def test_reads_files_of_silvrs_tools() -> None:
    # Source: config.py of the addon, config.cpp of the reprojection tool.
    equisolid = {"panorama_type": "FISHEYE_EQUISOLID", "fisheye_lens": 10.5, "fisheye_fov": 3.0}
    lens = from_lightfield({"resolution": [64, 64], "camera": {"type": "PANO", **equisolid}})
    assert lens == Equisolid(width=64, height=64, focal_length=10.5, fov=3.0)
    ranges = {"latitude_min": -1, "latitude_max": 1, "longitude_min": -2, "longitude_max": 2}
    for name in ("EQUIRECTANGULAR", "RECTILINEAR"):
        camera = {"type": "PANO", "panorama_type": name, **ranges}
        lens = from_lightfield({"resolution": [64, 32], "camera": camera})
        expected = Equirectangular(width=64, height=32, longitude=(-2, 2), latitude=(-1, 1))
        assert lens == expected
    # Blender's own matrix of a 50 mm lens on 36 mm, shift (0.1, −0.07), 96 × 64 pixels.
    matrix = [[2.7777777, 0, 0.2, 0], [0, 4.1666665, -0.21, 0], [0, 0, -1, -0.2], [0, 0, -1, 0]]
    for unit in ({"lens_unit": "MILLIMETERS", "focal_length": 50.0}, {"lens_unit": "FOV"}):
        camera = {"type": "PERSP", "projection_matrix": matrix, **unit}
        lens = from_lightfield({"resolution": [96, 64], "sensor_size": [36, 24], "camera": camera})
        assert isinstance(lens, Rectilinear)
        assert math.isclose(lens.focal_length, 50, rel_tol=1e-6)
        np.testing.assert_allclose(lens.center, [48 - 9.6, 32 - 0.07 * 96], rtol=1e-6)
    camera = {"type": "PERSP", "lens_unit": "FOV", "angle": 2 * math.atan(0.5)}
    lens = from_lightfield({"resolution": [64, 96], "sensor_size": [24, 36], "camera": camera})
    assert isinstance(lens, Rectilinear)
    assert math.isclose(lens.focal_length, 36)


def test_silvrs_readers_find_their_keys() -> None:
    # The keys that config.cpp reads for each of its lenses.
    size = {"width": 64, "height": 48}
    cfg = Rectilinear(**size, focal_length=18).to_lightfield()
    wanted = {"type": "PERSP", "lens_unit": "MILLIMETERS", "focal_length": 18}
    assert cfg["camera"].items() >= wanted.items()
    assert (cfg["resolution"], cfg["sensor_size"]) == ([64, 48], [36, 27])
    for lens, name, keys in (
        (Equidistant(**size, fov=3.0), "FISHEYE_EQUIDISTANT", {"fisheye_fov": 3.0}),
        (
            Equisolid(**size, focal_length=9, fov=3.0),
            "FISHEYE_EQUISOLID",
            {"fisheye_fov": 3.0, "fisheye_lens": 9, "lens": 9},
        ),
        (
            Equirectangular(**size, longitude=(-2, 1), latitude=(-1, 0.5)),
            "EQUIRECTANGULAR",
            {"longitude_min": -2, "longitude_max": 1, "latitude_min": -1, "latitude_max": 0.5},
        ),
    ):
        camera = {"type": "PANO", "panorama_type": name, **keys}
        assert lens.to_lightfield()["camera"] == camera


SENSOR = {**LANDSCAPE, "sensor_size": (24, 16)}
TERMS = (0, -0.1, 1e-4, -1e-5, 0)
CAMERA_YAML = [
    ("focal_length: 18, sensor_size: [24, 16]", Rectilinear(**SENSOR, focal_length=18)),
    (
        "fov: 90, sensor_size: 24, principal_point: [40, 30]",
        Rectilinear(**SENSOR, focal_length=12, principal_point=(40, 30)),
    ),
    (
        "fov: 90, sensor_size: [0.5, 0.6]",
        Rectilinear(**LANDSCAPE, focal_length=0.25, sensor_size=(0.5, 0.6)),
    ),
    ("fov: 90", Rectilinear(**LANDSCAPE, focal_length=18)),
    ("fov: 180", Equidistant(**LANDSCAPE, fov=math.pi)),
    ("fov: 180, focal_length: 10.5", Equisolid(**LANDSCAPE, fov=math.pi, focal_length=10.5)),
    ("fov: 180", Stereographic(**LANDSCAPE, fov=math.pi)),
    ("fov: 180", Orthographic(**LANDSCAPE, fov=math.pi)),
    (
        "fov: 180, coefficients: [0, -0.1, 0.0001, -0.00001, 0]",
        Polynomial(**LANDSCAPE, fov=math.pi, coefficients=TERMS),
    ),
    (
        "focal_length: 10, coefficients: [-0.01, 0.03, -0.02, 0.003]",
        KannalaBrandt(**LANDSCAPE, focal_length=10, coefficients=OPENCV),
    ),
    (
        "focal_length: 20, coefficients: [-0.2]",
        BrownConrady(**LANDSCAPE, focal_length=20, coefficients=(-0.2, *[0.0] * 7)),
    ),
    (
        "focal_length: 20, coefficients: [-0.2, 0.1, 0.001, 0.002, 0.01], fov: 80",
        BrownConrady(
            **LANDSCAPE,
            focal_length=20,
            coefficients=(-0.2, 0.1, 1e-3, 2e-3, 0.01, 0, 0, 0),
            fov=math.radians(80),
        ),
    ),
    (
        "focal_length: 10, coefficients: [0.1, 0, 0.001, 0.002, 0, 0, 0.003, -0.004]",
        ThinPrismFisheye(
            **LANDSCAPE, focal_length=10, coefficients=(0.1, 0, 1e-3, 2e-3, 0, 0, 3e-3, -4e-3)
        ),
    ),
    (
        "focal_length: 10, coefficients: [0.1, 0, 0, 0, 0, 0, 0.001, 0.002, 0.003, 0, 0, 0.004]",
        Fisheye624(
            **LANDSCAPE,
            focal_length=10,
            coefficients=(0.1, *[0.0] * 5, 1e-3, 2e-3, 3e-3, 0, 0, 4e-3),
        ),
    ),
    ("", Equirectangular(**LANDSCAPE)),
    (
        "longitude: [0, 180], latitude: [0, 90]",
        Equirectangular(**LANDSCAPE, longitude=(0, math.pi), latitude=(0, math.pi / 2)),
    ),
]


@pytest.mark.parametrize(("keys", "expected"), CAMERA_YAML)
def test_scene_yaml(keys: str, expected: Lens) -> None:
    content = f"{{lens: {expected.name}, resolution: [96, 64], {keys}}}"
    lens = from_camera(yaml.safe_load(content))
    assert type(lens) is type(expected)
    assert lens.sensor == expected.sensor
    x, y = grid(lens, np.float64, 17)
    np.testing.assert_allclose(lens.rays(x, y), expected.rays(x, y), atol=1e-12)


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name != "cube map"])
def test_a_scene_yaml_may_have_every_lens(name: str) -> None:
    lens = EXAMPLES[name]
    again = from_camera(lens.settings())
    assert type(again) is type(lens)
    x, y = grid(lens, np.float64, 17)
    np.testing.assert_allclose(again.rays(x, y), lens.rays(x, y), atol=1e-9)


def test_angles_in_a_scene_yaml_become_round() -> None:
    camera = {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT"}
    for fov, degrees in (
        *((np.float32(math.radians(round_one)), round_one) for round_one in (180, 170.125)),
        (1, math.degrees(1)),
    ):
        image = {"resolution": [64, 64], "camera": camera | {"fisheye_fov": float(fov)}}
        assert from_lightfield(image).settings()["fov"] == degrees


def test_the_registry_has_an_example_of_each_lens() -> None:
    assert {lens.name for lens in EXAMPLES.values()} == LENSES.keys()
    of_cycles = {name for name, lens in LENSES.items() if lens.in_cycles}
    assert {lens.name for lens in CAMERAS.values()} == of_cycles


def test_cycles_lenses_exist_as_blenders_cameras() -> None:
    names = {name for name, lens in LENSES.items() if lens.in_cycles}
    assert names == {"rectilinear", "equidistant", "equisolid", "polynomial", "equirectangular"}


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0, "height": 0}, "is not an image"),
        ({"width": 0}, "is not an image"),
        ({"height": 0}, "is not an image"),
        ({"sensor_size": (36, 0)}, "must be positive millimetres"),
        ({"sensor_size": (math.inf, 1)}, "must be positive millimetres"),
        ({"principal_point": (math.nan, 1)}, "must be finite pixels"),
        # An image of twice the size would have no finite one.
        ({"principal_point": (1, 1e308)}, "must be finite pixels, below 1e99"),
    ],
)
def test_every_lens_refuses_an_invalid_image(
    change: dict[str, Any], message: str, name: str
) -> None:
    with pytest.raises(UserError, match=message):
        replace(EXAMPLES[name], **change)


@pytest.mark.parametrize("bad", [0, -1, math.inf, math.nan])
@pytest.mark.parametrize("name", ["rectilinear", "equisolid 180°", *CALIBRATED])
def test_a_focal_length_is_positive_and_finite(name: str, bad: float) -> None:
    with pytest.raises(UserError, match=r"focal_length: .* must be positive millimetres"):
        replace(EXAMPLES[name], focal_length=bad)


@pytest.mark.parametrize("name", ["equisolid 180°", "polynomial", *SEEING_BEHIND])
def test_no_fisheye_sees_more_than_a_full_sphere(name: str) -> None:
    assert replace(EXAMPLES[name], fov=2 * math.pi)
    with pytest.raises(UserError, match=r"fov: 360\.001 degrees is not within"):
        replace(EXAMPLES[name], fov=math.radians(360.001))


@pytest.mark.parametrize("name", ["polynomial", *CALIBRATED])
def test_coefficients_are_complete_and_finite(name: str) -> None:
    right = EXAMPLES[name].coefficients
    ends = (math.nan, math.inf, 1e150, 1e-310)
    for wrong in (right[1:], (*right, 0.0), *((*right[1:], end) for end in ends)):
        with pytest.raises(UserError, match=f"coefficients: .* must be {len(right)} numbers"):
            replace(EXAMPLES[name], coefficients=wrong)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_smallest_image(name: str) -> None:
    size = (6, 1) if name == "cube map" else (1, 1)
    assert EXAMPLES[name].resized(*size).pixel_rays().shape == (size[1], size[0], 3)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"lens": "rectilinear", "fov": 90, "focal_length": 18}, "focal_length: does not go with"),
        ({"lens": "equidistant"}, "is missing the key fov"),
        ({"lens": "equidistant", "fov": 361}, "fov: is 361; must be"),
        ({"lens": "orthographic", "fov": 181}, "fov: is 181; must be"),
        ({"lens": "stereographic", "fov": 360}, "fov: is 360; must be"),
        ({"lens": "rectilinear", "fov": 180}, "fov: is 180; must be"),
        ({"lens": "rectilinear"}, "focal_length"),
        ({"lens": "equisolid", "fov": 180}, "focal_length"),
        ({"lens": "equisolid", "fov": 180, "focal_length": -1}, "focal_length: is -1; must be"),
        ({"lens": "polynomial", "fov": 180, "coefficients": [1, 2]}, "coefficients: is"),
        ({"lens": "polynomial", "fov": 180, "coefficients": [0.1, 0, 0, 0, 0]}, "k1 to k4"),
        ({"lens": "polynomial", "fov": 90, "coefficients": [1, 1, 0, 0, 0]}, "k0 = 1"),
        (
            {"lens": "kannala_brandt", "focal_length": 9, "coefficients": [1]},
            "coefficients: is",
        ),
        *(
            (
                {"lens": "brown_conrady", "focal_length": 9, "coefficients": wrong},
                "coefficients: is .*; must be a list of 1 to 8 values",
            )
            for wrong in ([], [0.1] * 9, 0.1)
        ),
        (
            {"lens": "thin_prism_fisheye", "focal_length": 9, "coefficients": [0.1]},
            "coefficients: is .*; must be a list of 8 values",
        ),
        (
            {"lens": "fisheye624", "focal_length": 9, "coefficients": [0.1] * 8},
            "coefficients: is .*; must be a list of 12 values",
        ),
        ({"lens": "equirectangular", "latitude": [10, -10]}, "latitude"),
        ({"lens": "equirectangular", "latitude": [-100, 0]}, "latitude"),
        ({"lens": "equirectangular", "longitude": [-180, 181]}, "longitude"),
        ({"lens": "equirectangular", "principal_point": [0, 0]}, "principal_point"),
        ({"lens": "cube_map"}, "cube_map"),
        ({"lens": "pinhole"}, "pinhole"),
        ({"lens": "equidistant", "fov": 180, "sensor_size": 0}, "sensor_size"),
    ],
)
def test_an_impossible_lens_is_refused(camera: dict[str, object], message: str) -> None:
    with pytest.raises(UserError, match=message):
        from_camera({"resolution": [96, 64], **camera})


OF_POLYNOMIAL = {"lens": "polynomial", "coefficients": [0, -0.1, 0, 0, 0]}
OF_OPENCV = {"lens": "kannala_brandt", "focal_length": 9, "coefficients": [0, 0, 0, 0]}
OF_BROWN = {"lens": "brown_conrady", "focal_length": 9, "coefficients": [-0.1]}
EQUISOLID, PINHOLE = {"lens": "equisolid", "focal_length": 9}, {"lens": "rectilinear"}


@pytest.mark.parametrize(
    ("camera", "key", "allowed", "refused"),
    [
        ({"lens": "equidistant", "fov": 9}, "resolution", [[1, 65536], [65536, 1]], []),
        ({"lens": "equidistant", "fov": 9}, "resolution", [], [[0, 9], [9, 65537], [65537, 9]]),
        (PINHOLE | {"fov": 9}, "principal_point", [[-1e6, 1e6]], [[-1e6 - 1, 0], [0, 1e6 + 1]]),
        (PINHOLE | {"fov": 9}, "sensor_size", [0.5, 1e6, [0.5, 1e6]], [0, 1e6 + 1, [9, 1e6 + 1]]),
        (PINHOLE, "focal_length", [0.5, 1e6], [0, -1, 1e6 + 1]),
        (PINHOLE, "fov", [0.5, 179.5], [0, -0.5, 180]),
        ({"lens": "equidistant"}, "fov", [0.5, 360], [0, -0.5, 360.5]),
        ({"lens": "orthographic"}, "fov", [0.5, 180], [0, 180.5]),
        ({"lens": "stereographic"}, "fov", [0.5, 359.9999], [0, 359.99995]),
        (EQUISOLID, "fov", [0.5, 360], [0, 360.5]),
        (OF_POLYNOMIAL, "fov", [0.5, 360], [0, 360.5]),
        (OF_OPENCV, "fov", [0.5, 360], [0, 360.5]),
        (OF_BROWN, "fov", [0.5, 180], [0, 180.5]),
        (OF_BROWN, "coefficients", [[0.1], [0.1] * 8], []),
        ({"lens": "equirectangular"}, "longitude", [[-180, 180]], [[-180.5, 0], [0, 180.5]]),
        ({"lens": "equirectangular"}, "latitude", [[-90, 90]], [[-90.5, 0], [0, 90.5]]),
    ],
)
def test_the_limits_of_a_scene_yamls_keys(
    camera: dict[str, Any], key: str, allowed: list[Any], refused: list[Any]
) -> None:
    for value in allowed:
        assert from_camera({"resolution": [96, 64], **camera, key: value})
    for value in refused:
        with pytest.raises(UserError, match=rf"{key}(\.\[\d\])?: is .*; must be"):
            from_camera({"resolution": [96, 64], **camera, key: value})


def test_defaults_of_a_scene_yamls_camera() -> None:
    size = {"resolution": [96, 64]}
    assert from_camera(OF_OPENCV | size) == KannalaBrandt(
        **LANDSCAPE, focal_length=9, coefficients=(0, 0, 0, 0), fov=2 * math.pi
    )
    with pytest.raises(UserError, match="is only for a rig of type blend_camera"):
        from_camera({"lens": "file", **size})


@pytest.mark.parametrize("name", ["rectilinear", "rectilinear shifted"])
def test_a_projection_matrix_projects_like_the_lens(name: str) -> None:
    lens = EXAMPLES[name]
    matrix = np.array(lens.to_lightfield()["camera"]["projection_matrix"])
    x, y = grid(lens, np.float64, 9)
    rays = lens.rays(x, y)
    # From −1 to 1 over the frame, up and to the right, and from the nearest to the farthest depth.
    for z, expected in ((0.1, -1), (1000, 1)):
        points = np.concatenate([rays * z / -rays[..., 2:], np.ones((9, 9, 1))], axis=-1)
        clip = points @ matrix.T
        projected = clip[..., :3] / clip[..., 3:]
        np.testing.assert_allclose(projected[..., 0], 2 * x / lens.width - 1, atol=1e-9)
        np.testing.assert_allclose(projected[..., 1], 1 - 2 * y / lens.height, atol=1e-9)
        np.testing.assert_allclose(projected[..., 2], expected, atol=1e-9)


@pytest.mark.parametrize("name", sorted(LENSES.keys() - {"cube_map"}))
def test_the_schema_describes_a_lens(name: str) -> None:
    schema = TypeAdapter(CameraSettings).json_schema()
    assert name in schema["discriminator"]["mapping"]
    own_schema = schema["$defs"][schema["discriminator"]["mapping"][name].rsplit("/", 1)[-1]]
    assert own_schema["properties"]["lens"]["const"] == name
    assert {"lens", "resolution"} <= set(own_schema["required"])
    assert all(
        "description" in part for key, part in own_schema["properties"].items() if key != "lens"
    )


@pytest.mark.parametrize(
    ("lens", "largest"),
    [(Equidistant, 360), (Stereographic, 359.9999), (Orthographic, 180)],
)
def test_all_readers_have_the_same_limit_for_a_field_of_view(
    lens: type[Equidistant], largest: float
) -> None:
    for make in (
        lambda fov: from_camera({"lens": lens.name, "resolution": [96, 64], "fov": fov}),
        lambda fov: lens.from_flag(f"{math.radians(fov)}", 96, 64),
        lambda fov: lens(**LANDSCAPE, fov=math.radians(fov)),
    ):
        assert make(largest) == lens(**LANDSCAPE, fov=math.radians(largest))
        for fov in (-1, 0, largest + 0.001):
            with pytest.raises(UserError, match=r"\bfov: "):
                make(fov)


@pytest.mark.parametrize(
    ("text", "lens"),
    [
        ("18,24", Rectilinear(**SENSOR, focal_length=18)),
        ("9,24,3", Equisolid(**SENSOR, focal_length=9, fov=3)),
        ("3.5", Equidistant(**LANDSCAPE, fov=3.5)),
        ("3.5", Stereographic(**LANDSCAPE, fov=3.5)),
        ("2.5", Orthographic(**LANDSCAPE, fov=2.5)),
        ("0,-.1,1e-4,-1e-5,0,24,3", Polynomial(**SENSOR, coefficients=TERMS, fov=3)),
        ("11,24,-.01,.03,-.02,.003", KannalaBrandt(**SENSOR, focal_length=11, coefficients=OPENCV)),
        (
            "11,24,-.01,.03,-.02,.003,3",
            KannalaBrandt(**SENSOR, focal_length=11, coefficients=OPENCV, fov=3),
        ),
        ("11,24,-.35", Division(**SENSOR, focal_length=11, coefficients=(-0.35,))),
        ("11,24,.9", FovModel(**SENSOR, focal_length=11, coefficients=(0.9,))),
        ("11,24,-.1,2", Unified(**SENSOR, focal_length=11, coefficients=(-0.1,), fov=2)),
        ("11,24,.6,1.1", ExtendedUnified(**SENSOR, focal_length=11, coefficients=(0.6, 1.1))),
        (
            "11,24,-.17,.6,100deg",
            DoubleSphere(
                **SENSOR, focal_length=11, coefficients=(-0.17, 0.6), fov=math.radians(100)
            ),
        ),
        ("11,24,-.1,0,.02,0", FTheta(**SENSOR, focal_length=11, coefficients=(-0.1, 0, 0.02, 0))),
        (
            "11,24,8.1,4.2,1e-3,-8e-4,.2,8.4,6.1,1",
            BrownConrady(**SENSOR, focal_length=11, coefficients=RATIONAL),
        ),
        (
            "11,24,8.1,4.2,1e-3,-8e-4,.2,8.4,6.1,1,120deg",
            BrownConrady(**SENSOR, focal_length=11, coefficients=RATIONAL, fov=math.radians(120)),
        ),
        (
            "11,24,-.01,.03,2e-3,-1e-3,-.02,.003,3e-3,-2e-3,3",
            ThinPrismFisheye(**SENSOR, focal_length=11, coefficients=THIN_PRISM, fov=3),
        ),
        (
            "11,24,-.027,.102,-.072,.0125,1.2e-3,-4e-4,5e-3,-4e-3,-2e-3,-4e-4,3e-3,1e-4",
            Fisheye624(**SENSOR, focal_length=11, coefficients=OF_624),
        ),
        ("180deg", Equidistant(**LANDSCAPE, fov=math.pi)),
        ("9,24,90deg", Equisolid(**SENSOR, focal_length=9, fov=math.pi / 2)),
        (
            "-180deg,90deg,-90deg,45deg",
            Equirectangular(
                **LANDSCAPE,
                longitude=(-math.pi, math.pi / 2),
                latitude=(-math.pi / 2, math.pi / 4),
            ),
        ),
        ("full", Equirectangular(**LANDSCAPE)),
        ("-1,2,-.5,1", Equirectangular(**LANDSCAPE, longitude=(-1, 2), latitude=(-0.5, 1))),
    ],
)
def test_flags(text: str, lens: Lens) -> None:
    assert type(lens).from_flag(text, 96, 64) == lens
    for wrong in ("", "wide", "1,2,3,4,5,6,7,8", text.replace("full", "") + ",nan", "20deg,24"):
        with pytest.raises(UserError, match="must have the form"):
            type(lens).from_flag(wrong, 96, 64)


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({"longitude": (-4, 3)}, "longitude: the range is more than 360 degrees"),
        ({"longitude": (1, 1)}, "longitude: 57.2958 to 57.2958 degrees is not a range"),
        ({"latitude": (-1.6, 0)}, "latitude: -91.6732 to 0 degrees is not a range"),
        ({"latitude": (0, 1.6)}, "latitude: 0 to 91.6732 degrees is not a range"),
    ],
)
def test_a_panorama_shows_no_place_twice(ranges: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Equirectangular(**SIZE, **ranges)
    assert not Equirectangular(**SIZE, longitude=(-4, 2)).is_full
    assert Equirectangular(**SIZE).is_full


def test_a_cube_map_is_six_squares_wide() -> None:
    with pytest.raises(UserError, match="width is 6 times its height"):
        CubeMap(width=96, height=64)


@pytest.mark.parametrize(
    ("lens", "description"),
    [
        ("rectilinear", "rectilinear, 18 mm"),
        ("orthographic shifted 100°", "orthographic fisheye, 100°"),
        ("kannala_brandt shifted", "Kannala–Brandt fisheye, 300°"),
        ("equirectangular", "equirectangular panorama"),
    ],
)
def test_a_lens_is_described_in_words(lens: str, description: str) -> None:
    assert EXAMPLES[lens].description == description


@both
def test_rays_of_all_pixel_centres(dtype: type) -> None:
    lens = Equidistant(width=5, height=3, fov=math.pi)
    y, x = np.mgrid[:3, :5].astype(dtype) + dtype(0.5)
    rays = lens.pixel_rays(dtype)
    assert rays.dtype == dtype
    np.testing.assert_array_equal(rays, lens.rays(x, y))
    # Of two types, the wider one is kept.
    assert lens.rays(x, y.astype(np.float64)).dtype == lens.rays(1, y).dtype == np.float64


USE_IT = """
import math
from lightfield.engine.flags import parsed
from lightfield.geometry import lenses
from lightfield.reprojection.geometry import ReprojectionGeometry
from lightfield.stages.lenses import ComputeLensMap

lens = lenses.from_camera({"lens": "halved", "fov": 60, "resolution": [8, 8]})
assert lenses.from_lightfield(lens.to_lightfield()).fov == math.radians(60)
words = ["map.npy", "--no-configs", "8,8", "--i-halved", "1", "--halved", "0.5"]
job = parsed(ComputeLensMap, None, words)
_, source = job.read()
geometry = ReprojectionGeometry.of(job.settings, source)
assert (geometry.source.fov, geometry.targets[0].lens.description) == (1, "halved fisheye, 28.65°")
"""


@pytest.mark.slow
def test_a_new_lens_is_one_file(tmp_path: Path) -> None:
    library = Path(__file__).parents[2] / "scripts" / "lightfield"
    shutil.copytree(library, tmp_path / "lightfield")
    folder = tmp_path / "lightfield" / "geometry" / "lenses"
    text = (folder / "equidistant.py").read_text()
    for old, new in (("equidistant", "halved"), ("EQUIDISTANT", "HALVED")):
        text = text.replace(old, new).replace(old.title(), new.title())
    (folder / "halved.py").write_text(text)
    subprocess.run([sys.executable, "-c", USE_IT], cwd=tmp_path, check=True)


OF_EQUIDISTANT = {"camera": {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT"}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"resolution": None}, "resolution"),
        ({"resolution": [96.5, 48]}, "resolution: is 96.5; must be two whole numbers"),
        ({"resolution": [True, 48]}, "resolution: is True; must be two whole numbers"),
        ({"camera": {"type": "ORTHO"}}, "ORTHO"),
        ({"camera": {"type": "PANO"}}, "panorama_type"),
        ({"camera": {"type": "PANO", "panorama_type": "MIRRORBALL"}}, "MIRRORBALL"),
        (OF_EQUIDISTANT, "fisheye_fov"),
        ({"camera": {"type": "PERSP", "lens_unit": "FOV"}}, "angle"),
        ({"camera": {"type": "PERSP", "lens_unit": "INCH"}}, "INCH"),
        ({"camera": {"type": "PERSP", "lens_unit": "MILLIMETERS"}}, "focal_length"),
        ({"camera": {"type": "PERSP", "lens_unit": "FOV", "angle": 0}}, "camera, resolution or"),
        ({"camera": {"type": "PERSP", "projection_matrix": [[1]]}}, "camera, resolution or"),
        (OF_EQUIDISTANT | {"resolution": [math.inf, 9]}, "resolution: is inf"),
    ],
)
def test_a_wrong_lightfield_json_names_its_key(change: dict[str, object], message: str) -> None:
    with pytest.raises(UserError, match=message):
        from_lightfield(README | {"camera": {"type": "PANO"}} | change)
