"""Validation of datasets with analytic truth: a room of planes, spheres and thin rods.

Each dataset is correct, and then spoiled in one way. Validation must report it and name the view.
Depth is traced at jittered sub-pixel positions, as Cycles samples it.
"""

import json
import math
import re
import shutil
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from conftest import BLENDER
from PIL import Image
from scipy.ndimage import binary_dilation, binary_erosion

from lightfield.core.errors import UserError
from lightfield.core.files import Stamp, read_json, sha256, write_json, write_text
from lightfield.engine.receipts import made_in
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.formats.passes import NAMES, PASSES, matte_header
from lightfield.geometry import lenses, rotations
from lightfield.imaging import images
from lightfield.imaging.tonemap import to_8_bit
from lightfield.validation import consistency, files, geometry
from lightfield.validation.cameras import grain_of
from lightfield.validation.result import Check, Result
from lightfield.validation.validate import validate

CYCLES_ROOM = BLENDER / "cycles_room.py"

SPHERE = {"type": "sphere", "subdivisions": 1, "size": 1.7}
FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
BAD = 2  # the view that most tests spoil


def trace(origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distance (...) and albedo (...) of the room's points that unit rays (..., 3) hit."""
    low, high = np.array([-3, -2.5, -1.4]), np.array([3, 2.5, 1.8])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(rays > 0, (high - origin) / rays, (low - origin) / rays)
        nearest = np.where(rays == 0, np.inf, away).min(axis=-1)
        for center, radius in (
            ((1.6, 1.2, -0.7), 0.6),
            ((-1.5, 1.5, 0.2), 0.45),
            ((-1.2, -1.4, -0.8), 0.55),
            ((2.0, -1.2, 0.8), 0.35),
            ((0.2, 2.0, -1.0), 0.4),
        ):
            offset = origin - np.array(center)
            half = (offset * rays).sum(axis=-1)
            distance = -half - np.sqrt(half**2 - (offset @ offset - radius**2))
            nearest = np.where((distance > 0) & (distance < nearest), distance, nearest)
        for x, y, radius in ((1.5, -0.3, 0.02), (-1.4, 0.2, 0.03), (0.3, -1.6, 0.015)):
            offset = (origin - np.array([x, y, 0.0]))[:2]
            across = (rays[..., :2] ** 2).sum(axis=-1)
            half = (offset * rays[..., :2]).sum(axis=-1)
            root = np.sqrt(half**2 - across * (offset @ offset - radius**2))
            distance = (-half - root) / across
            nearest = np.where((distance > 0) & (distance < nearest), distance, nearest)
        hit = origin + rays * nearest[..., None]
        albedo = np.where(np.floor(hit * 2.5).sum(axis=-1) % 2 == 0, 0.2, 0.7)
    return nearest, np.where(np.isfinite(nearest), albedo, 0.0)


def blackman_harris(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw positions in pixels under Cycles' default filter, 1.5 pixels wide."""
    x = np.linspace(-0.5, 0.5, 2001)
    terms = zip((0.35875, 0.48829, 0.14128, 0.01168), range(4), strict=True)
    cumulative = np.cumsum(sum(a * np.cos(2 * np.pi * k * x) for a, k in terms))
    cumulative = (cumulative - cumulative[0]) / (cumulative[-1] - cumulative[0])
    return np.interp(rng.random(shape), cumulative, 1.5 * x)


def render(
    lens: lenses.Lens, matrix: np.ndarray, depth: str | None, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Return the channels of one view of the room."""
    y, x = np.mgrid[: lens.height, : lens.width] + 0.5
    centre_rays = lens.rays(x, y)
    rays = lens.rays(x + blackman_harris(rng, x.shape), y + blackman_harris(rng, x.shape))
    rays = np.where(np.isnan(centre_rays), np.nan, rays)
    distance, albedo = trace(matrix[:3, 3], rays @ matrix[:3, :3].T)
    channels = {
        name: (albedo * gain).astype(np.float16)
        for name, gain in zip("RGB", (1.0, 0.8, 0.6), strict=True)
    }
    if depth:
        # The renderer knows only the ray of the pixel's centre.
        value = distance * -centre_rays[..., 2] if depth == "z" else distance
        channels["Z"] = np.where(np.isnan(value), np.inf, value).astype(np.float32)
    return channels


def make_dataset(
    folder: Path, rig: Mapping[str, Any], camera: Mapping[str, Any], depth: str | None = "z"
) -> Path:
    lens = lenses.from_camera(camera)
    lightfield = LightField.from_rig(rig, lens, depth=depth)
    rng = np.random.default_rng(1)
    for view in lightfield.views:
        attributes = {images.NAN_ATTRIBUTE: 0, images.CLAMPED_ATTRIBUTE: 0}
        if depth:
            attributes[images.DEPTH_ATTRIBUTE] = depth
        channels = render(lens, view.world_from_camera, depth, rng)
        images.write_exr(folder / "exr" / f"{view.name}.exr", channels, attributes)
    lightfield.write(folder / NAME)
    return folder


@pytest.fixture(scope="session")
def right_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_dataset(tmp_path_factory.mktemp("room") / "room" / "sphere", SPHERE, FISHEYE)


@pytest.fixture
def dataset(right_dataset: Path, tmp_path: Path) -> Path:
    """A copy of the correct dataset of 12 views, to be spoiled."""
    return Path(shutil.copytree(right_dataset, tmp_path / "room" / "sphere"))


@pytest.fixture(scope="session")
def right_small_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rig = {"type": "plane", "cameras": [3, 1], "size": 0.4}
    return make_dataset(tmp_path_factory.mktemp("room") / "room" / "plane", rig, FISHEYE)


@pytest.fixture
def small_dataset(right_small_dataset: Path, tmp_path: Path) -> Path:
    """A copy of a correct dataset of 3 views, for faults of a single file."""
    return Path(shutil.copytree(right_small_dataset, tmp_path / "room" / "plane"))


@pytest.fixture
def one_view(tmp_path: Path) -> Path:
    """A correct dataset of one view, for faults of an image."""
    rig = {"type": "plane", "cameras": [1, 1]}
    return make_dataset(tmp_path / "room" / "one", rig, FISHEYE)


def check(result: Result, name: str) -> Check:
    return next(check for check in result.checks if check.name == name)


def failed(result: Result) -> list[str]:
    return [check.name for check in result.checks if check.passed is False]


def names(dataset: Path) -> list[str]:
    return [view.name for view in LightField.read(dataset / NAME).views]


def rewrite(dataset: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the content of lightfield.json."""
    content = read_json(dataset / NAME)
    change(content)
    write_json(dataset / NAME, content)


def relist(dataset: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change lightfield.json. Positions and rotations then follow the matrices."""
    rewrite(dataset, change)
    lightfield = LightField.read(dataset / NAME)
    views = [
        View.placed(view.name, view.world_from_camera, view.others) for view in lightfield.views
    ]
    lightfield.changed(views=views).write(dataset / NAME)


def repaint(
    dataset: Path,
    name: str,
    change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]] = dict,
    header: Mapping[str, Any] | None = None,
) -> None:
    """Change the channels of one view and its header."""
    path = dataset / "exr" / f"{name}.exr"
    image = images.read_image(path)
    kept = {key: value for key, value in image.attributes.items() if key.startswith("plenoforge:")}
    images.write_exr(path, change(dict(image.channels)), kept | dict(header or {}))


def recamera(camera: Mapping[str, Any]) -> Callable[[dict[str, Any]], None]:
    lens = lenses.from_camera({**FISHEYE, **camera}).to_lightfield()
    return lambda content: content.update(lens)


def move(view: int, offset: Any) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        matrix = np.array(content["frames"][view]["world_matrix"])
        matrix[:3, 3] += offset
        content["frames"][view]["world_matrix"] = matrix.tolist()

    return change


def turn(views: list[int], turned: np.ndarray, local: bool = True) -> Callable[[Any], None]:
    def change(content: dict[str, Any]) -> None:
        for view in views:
            matrix = np.array(content["frames"][view]["world_matrix"])
            rotation = matrix[:3, :3]
            matrix[:3, :3] = rotation @ turned if local else turned @ rotation
            content["frames"][view]["world_matrix"] = matrix.tolist()

    return change


def degrees(axis: int, angle: float) -> np.ndarray:
    euler = np.zeros(3)
    euler[axis] = math.radians(angle)
    return rotations.euler_to_matrix(euler)


def swap(one: int, other: int) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        first, second = content["frames"][one], content["frames"][other]
        first["name"], second["name"] = second["name"], first["name"]

    return change


# ---- right datasets pass, with margin -------------------------------------------------------

WIDE = {"lens": "equidistant", "fov": 220, "resolution": [64, 64]}
RIGHT = {
    "sphere of fisheyes": (SPHERE, FISHEYE, "z"),
    "sphere with distances": (SPHERE, FISHEYE, "distance"),
    "sphere of 220 degrees": (SPHERE, WIDE, "distance"),
    "sphere of equisolids": (
        SPHERE,
        {"lens": "equisolid", "fov": 180, "focal_length": 12, "resolution": [64, 64]},
        "z",
    ),
    "sphere of perspectives": (
        {"type": "sphere", "subdivisions": 1, "size": 0.5},
        {"lens": "rectilinear", "focal_length": 15, "resolution": [48, 48]},
        "z",
    ),
    "plane": ({"type": "plane", "cameras": [3, 3]}, FISHEYE, "z"),
    "cuboid": ({"type": "cuboid", "cameras": [2, 2, 1], "size": [1.6, 1, 0.8]}, FISHEYE, "z"),
    "panoramas": (
        {"type": "lattice", "cameras": [2, 2, 2], "size": 1},
        {"lens": "equirectangular", "resolution": [96, 48]},
        "distance",
    ),
    "cube maps": (
        {"type": "lattice", "cameras": [2, 1, 1], "size": 1, "cube_map": True},
        {"lens": "rectilinear", "fov": 90, "resolution": [32, 32]},
        "z",
    ),
}


@pytest.mark.parametrize("case", RIGHT)
def test_right_dataset_is_valid_with_margin(case: str, tmp_path: Path) -> None:
    result = validate(make_dataset(tmp_path / "room" / "rig", *RIGHT[case]))
    assert failed(result) == []
    geometry_check = check(result, "geometry")
    assert geometry_check.passed
    assert not geometry_check.warnings
    figures = geometry_check.figures
    assert figures["worst_contradiction"] < geometry.CONTRADICTIONS_LIMIT / 3
    assert figures["worst_displacement_pixels"] < geometry.DISPLACEMENT_LIMIT / 1.5
    for key in ("angle", "depth"):
        if figures.get(f"{key}_scale_deviation", 1) < geometry.SCALE_DEVIATION_LIMIT:
            assert abs(figures[f"{key}_scale_error"]) < geometry.SCALE_LIMIT / 2


def two_views_of_a_ball(folder: Path, fov: float, angle: float, recorded_fov: float) -> Result:
    """Validate two views of 64², 4 m from a ball of 1 m, with ``angle`` degrees between them."""
    angle = math.radians(angle)
    places = [[0, -4, 0], [4 * math.sin(angle), -4 * math.cos(angle), 0]]
    rig = {"type": "path", "count": 2, "keys": [{"position": place} for place in places]}
    camera = {"lens": "rectilinear", "fov": fov, "resolution": [64, 64]}
    seen = LightField.from_rig({**rig, "look_at": [0, 0, 0]}, lenses.from_camera(camera), depth="z")
    for view in seen.views:
        rays = seen.lens.pixel_rays()
        half = rays @ view.world_from_camera[:3, :3].T @ view.world_from_camera[:3, 3]
        with np.errstate(invalid="ignore"):
            distance = -half - np.sqrt(half**2 - 15)
        z = np.where(np.isnan(distance), np.inf, distance * -rays[..., 2]).astype(np.float32)
        light = np.where(np.isinf(z), 0.1, z / 8).astype(np.float16)
        images.write_exr(
            folder / "exr" / f"{view.name}.exr",
            {**dict.fromkeys("RGB", light), "Z": z},
            {images.NAN_ATTRIBUTE: 0, images.CLAMPED_ATTRIBUTE: 0, images.DEPTH_ATTRIBUTE: "z"},
        )
    recorded = lenses.from_camera({**camera, "fov": recorded_fov})
    seen.changed(lens=recorded, views=seen.views, depth="z").write(folder / NAME)
    return validate(folder)


@pytest.mark.parametrize(("fov", "angle"), [(50, 40), (35, 60), (35, 20)])
def test_two_small_views_of_a_ball_are_not_taken_for_scaled(
    fov: float, angle: float, tmp_path: Path
) -> None:
    result = two_views_of_a_ball(tmp_path, fov, angle, fov)
    assert failed(result) == []
    figures = check(result, "geometry").figures
    assert figures["agree"] == 1
    assert abs(figures["angle_scale_error"]) < geometry.SCALE_LIMIT / 5
    assert abs(figures["depth_scale_error"]) < geometry.SCALE_LIMIT / 5


@pytest.mark.parametrize("recorded_fov", [34.6, 35.5])
def test_two_small_views_of_a_ball_through_another_lens_fail(
    recorded_fov: float, tmp_path: Path
) -> None:
    assert not check(two_views_of_a_ball(tmp_path, 35, 20, recorded_fov), "geometry").passed


# ---- wrong geometry fails -------------------------------------------------------------------

Spoil = Callable[[Path], None]


def listed(*changes: Callable[[dict[str, Any]], None]) -> Spoil:
    return lambda dataset: [relist(dataset, change) for change in changes] and None


def painted(
    change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]], views: slice = slice(None)
) -> Spoil:
    return lambda dataset: (
        [repaint(dataset, name, change) for name in names(dataset)[views]] and None
    )


def scaled(factor: float) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    return lambda channels: {**channels, "Z": channels["Z"] * np.float32(factor)}


def each(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], dict[str, np.ndarray]]:
    return lambda channels: {name: change(pixels) for name, pixels in channels.items()}


def distance_in_z(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    y, x = np.mgrid[:64, :64] + 0.5
    sine = np.minimum(np.hypot(x - 32, y - 32) / 32, 1) * np.pi / 2
    return {**channels, "Z": (channels["Z"] / np.cos(sine).clip(1e-3)).astype(np.float32)}


def depth_of(other: int, view: int) -> Spoil:
    def spoil(dataset: Path) -> None:
        z = images.read_image(dataset / "exr" / f"{names(dataset)[other]}.exr").channels["Z"]
        repaint(dataset, names(dataset)[view], lambda channels: {**channels, "Z": z})

    return spoil


ALL = list(range(12))
ONE = slice(BAD, BAD + 1)

WRONG_SETS: dict[str, Spoil] = {
    "field of view 3 % too small": listed(recamera({"fov": 174.6})),
    "equisolid for equidistant": listed(
        recamera({"lens": "equisolid", "focal_length": 9 / math.sin(math.pi / 4)})
    ),
    "stereographic for equidistant": listed(recamera({"lens": "stereographic"})),
    "distance in Z": painted(distance_in_z),
    "depth 3 % too large": painted(scaled(1.03)),
    "depth 3 % too small": painted(scaled(0.97)),
    "cameras look backwards": listed(turn(ALL, degrees(1, 180))),
    "cameras upside down": listed(turn(ALL, degrees(2, 180))),
    "rotations for Y up": listed(turn(ALL, degrees(0, 90), local=False)),
    "images mirrored": painted(each(np.fliplr)),
    "images upside down": painted(each(np.flipud)),
    "images transposed": painted(each(np.transpose)),
}

WRONG_VIEWS: dict[str, Spoil] = {
    **{f"5 cm off along {'xyz'[i]}": listed(move(BAD, 0.05 * np.eye(3)[i])) for i in range(3)},
    **{f"1 degree off about {'xyz'[i]}": listed(turn([BAD], degrees(i, 1))) for i in range(3)},
    "upside down": listed(turn([BAD], degrees(2, 180))),
    "quarter turn": listed(turn([BAD], degrees(2, 90))),
    "distance in Z": painted(distance_in_z, ONE),
    "depth 3 % too large": painted(scaled(1.03), ONE),
    "depth 3 % too small": painted(scaled(0.97), ONE),
    "depth of another view": depth_of(9, BAD),
    "depth of a neighbour": depth_of(BAD - 1, BAD),
    "mirrored": painted(each(np.fliplr), ONE),
    "flipped": painted(each(np.flipud), ONE),
    "transposed": painted(each(np.transpose), ONE),
    "nothing but sky": painted(scaled(np.inf), ONE),
}


@pytest.mark.parametrize("case", WRONG_SETS)
def test_wrong_set_fails_its_geometry(case: str, dataset: Path) -> None:
    WRONG_SETS[case](dataset)
    result = validate(dataset)
    assert failed(result) == ["geometry"]
    assert len(check(result, "geometry").views) > len(ALL) / 2


@pytest.mark.parametrize("case", WRONG_VIEWS)
@pytest.mark.slow
def test_only_the_wrong_view_is_named(case: str, dataset: Path) -> None:
    WRONG_VIEWS[case](dataset)
    result = validate(dataset)
    assert failed(result) == ["geometry"]
    geometry = check(result, "geometry")
    assert geometry.views == [names(dataset)[BAD]]
    assert [problem.split(": ")[0] for problem in geometry.problems] == [
        f"exr/{names(dataset)[BAD]}.exr"
    ]


SMALL_SPIRAL = (
    {"type": "spiral", "count": 12, "turns": 2, "elevation": [10, 70], "size": 2.4},
    {"lens": "rectilinear", "fov": 60, "resolution": [24, 24]},
)


@pytest.mark.parametrize("precision", [np.float32, np.float16])
def test_with_few_pixels_a_curved_surface_passes_and_a_turn_of_a_pixel_fails(
    precision: type, tmp_path: Path
) -> None:
    dataset = make_dataset(tmp_path / "room" / "spiral", *SMALL_SPIRAL)
    painted(lambda channels: {**channels, "Z": channels["Z"].astype(precision)})(dataset)
    assert check(validate(dataset), "geometry").passed
    for axis in range(3):
        copy = Path(shutil.copytree(dataset, tmp_path / str(axis) / "spiral"))
        relist(copy, turn([BAD], degrees(axis, 60 / 24)))
        assert check(validate(copy), "geometry").views == [names(copy)[BAD]]


def test_swapped_views_are_both_named(dataset: Path) -> None:
    right_names = names(dataset)
    relist(dataset, swap(2, 7))
    result = validate(dataset)
    assert failed(result) == ["geometry"]
    assert sorted(check(result, "geometry").views) == [right_names[2], right_names[7]]


@pytest.mark.parametrize(("fov", "center"), [(185.4, [0, 0, 0]), (174.6, [0.6, -1, 0.4])])
def test_a_small_error_of_the_lens_shows_in_all_pairs_together(
    fov: float, center: list[float], tmp_path: Path
) -> None:
    # Near parallel views hardly disagree under a lens that is 3 % wrong. Only the mean shows it.
    rig = {"type": "plane", "cameras": [3, 3], "size": 0.5, "center": center}
    dataset = make_dataset(tmp_path / "room" / "plane", rig, FISHEYE, "distance")
    relist(dataset, recamera({"fov": fov}))
    geometry = check(validate(dataset), "geometry")
    assert geometry.passed is False
    assert geometry.views == []
    assert len(geometry.problems) == 1
    assert "all angles" in geometry.problems[0]


def test_geometry_does_not_depend_on_the_worlds_origin(small_dataset: Path) -> None:
    relist(small_dataset, recamera({"fov": 177}))
    here = check(validate(small_dataset), "geometry").figures
    for view in range(3):
        relist(small_dataset, move(view, (3, -2, 1)))
    elsewhere = check(validate(small_dataset), "geometry").figures
    assert elsewhere == pytest.approx(here, rel=1e-3)


def test_two_views_that_disagree_are_both_named(tmp_path: Path) -> None:
    rig = {"type": "plane", "cameras": [2, 1], "size": 0.5}
    dataset = make_dataset(tmp_path / "room" / "pair", rig, FISHEYE)
    assert validate(dataset).valid
    relist(dataset, move(0, (0, 0.1, 0)))
    assert check(validate(dataset), "geometry").views == names(dataset)


def test_the_view_that_disagrees_with_both_others_is_named(
    small_dataset: Path,
) -> None:
    # Each of the others disagrees with one of its two neighbours, which is not its own fault.
    relist(small_dataset, move(0, (0, 0.1, 0)))
    assert check(validate(small_dataset), "geometry").views == names(small_dataset)[:1]


# ---- what cannot be checked is said ---------------------------------------------------------

UNCHECKED = {
    "no depth": (SPHERE, FISHEYE, None, "no depth"),
    "one view": ({"type": "plane", "cameras": [1, 1]}, FISHEYE, "z", "no neighbours"),
    "nothing seen twice": (
        {"type": "plane", "cameras": [1, 1], "cube_map": True},
        {"lens": "rectilinear", "fov": 90, "resolution": [32, 32]},
        "z",
        "no two views see enough",
    ),
}


@pytest.mark.parametrize("case", UNCHECKED)
def test_a_check_without_data_does_not_pass(case: str, tmp_path: Path) -> None:
    *made, reason = UNCHECKED[case]
    result = validate(make_dataset(tmp_path / "room" / "rig", *made))
    assert result.valid
    geometry = check(result, "geometry")
    assert geometry.passed is None
    assert reason in geometry.detail
    assert re.search("not applicable: .*geometry", result.summary())


# ---- files ----------------------------------------------------------------------------------


def pixel(channel: str, value: float) -> Spoil:
    def change(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        channels[channel] = channels[channel].copy()
        channels[channel][30, 31] = value
        return channels

    return painted(change, ONE)


def headed(key: str, value: Any) -> Spoil:
    return lambda dataset: repaint(dataset, names(dataset)[BAD], header={key: value})


def on_file(change: Callable[[Path], Any]) -> Spoil:
    return lambda dataset: change(dataset / "exr" / f"{names(dataset)[BAD]}.exr")


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def cut_tail(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


def flip_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


def outside(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {**channels, "R": np.where(channels["R"] == 0, np.float16(1), channels["R"])}


def wide_circle(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {**channels, "Z": np.where(np.isinf(channels["Z"]), np.float32(2), channels["Z"])}


def small(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: pixels[:32] for name, pixels in channels.items()}


def bad_frame(key: str, value: Any) -> Spoil:
    return lambda dataset: rewrite(dataset, lambda held: held["frames"][BAD].update({key: value}))


BROKEN_VIEWS: dict[str, tuple[Spoil, str, str]] = {
    "missing": (on_file(Path.unlink), "views", "is missing"),
    "a folder": (on_file(lambda path: path.unlink() or path.mkdir()), "views", "is missing"),
    "a dead link": (
        on_file(lambda path: path.unlink() or path.symlink_to("nowhere")),
        "views",
        "is missing",
    ),
    "truncated": (on_file(truncate), "images", "cannot be read"),
    "end cut off": (on_file(cut_tail), "images", "cannot be read"),
    "no image": (on_file(lambda path: path.write_bytes(b"no image")), "images", "not an image"),
    "empty file": (on_file(lambda path: path.write_bytes(b"")), "images", "not an image"),
    "wrong size": (painted(small, ONE), "images", "is 64 × 32; must be 64 × 64"),
    "no blue": (
        painted(lambda c: {name: c[name] for name in "RGZ"}, ONE),
        "images",
        "must have B:float16 G:float16 R:float16 Z:float32",
    ),
    "no depth": (painted(lambda c: {name: c[name] for name in "RGB"}, ONE), "images", "channels"),
    "one channel more": (painted(lambda c: {**c, "A": c["R"]}, ONE), "images", "channels"),
    "full floats": (painted(each(lambda x: x.astype(np.float32)), ONE), "images", "R:float32"),
    "colour not a number": (pixel("G", np.nan), "colour", "1 values are not a number"),
    "infinite colour": (pixel("B", -np.inf), "colour", "1 values are infinite"),
    "black": (painted(lambda c: {**c, **{n: c[n] * 0 for n in "RGB"}}, ONE), "colour", "is black"),
    "colour outside the circle": (painted(outside, ONE), "colour", "sees nothing"),
    "depth outside the circle": (painted(wide_circle, ONE), "depth", "sees nothing"),
    "depth not a number": (pixel("Z", np.nan), "depth", "1 depths are not a number"),
    "depth zero": (pixel("Z", 0), "depth", "1 depths are not positive"),
    "depth negative": (pixel("Z", -2), "depth", "1 depths are not positive"),
    "depth minus infinity": (pixel("Z", -np.inf), "depth", "1 depths are not positive"),
    "another meaning of depth": (
        headed(images.DEPTH_ATTRIBUTE, "distance"),
        "depth",
        "is 'distance' by its header",
    ),
    "rendered NaN": (headed(images.NAN_ATTRIBUTE, 7), "counts", "7 rendered values"),
}


@pytest.mark.parametrize("case", BROKEN_VIEWS)
def test_broken_view_is_named(case: str, small_dataset: Path) -> None:
    spoil, name, text = BROKEN_VIEWS[case]
    spoil(small_dataset)
    result = validate(small_dataset)
    assert failed(result) == [name]
    broken_check = check(result, name)
    assert broken_check.views == [names(small_dataset)[BAD]]
    assert len(broken_check.problems) == 1
    assert broken_check.problems[0].startswith(f"exr/{names(small_dataset)[BAD]}.exr: ")
    assert text in broken_check.problems[0]
    assert str(small_dataset) not in json.dumps(result.to_json())


def grey(but: int, level: float = 0.3) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Give a view one colour, except for a number of pixels."""

    def change(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        colour = (channels["R"] > 0) * np.float16(level)
        colour[30, 20 : 20 + but] = 0.4
        return {**channels, **dict.fromkeys("RGB", colour)}

    return change


def light_outside(
    value: float, part: float = 1, within: int = 64
) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Light a part of the pixels outside the image circle, within a distance of its rim."""

    def change(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        seen = np.isfinite(channels["Z"])
        lit = ~seen & binary_dilation(seen, np.ones((3, 3)), within)
        lit &= np.arange(64 * 64).reshape(64, 64) % 100 < 100 * part
        return {
            **channels,
            **{name: np.where(lit, np.float16(value), channels[name]) for name in "RGB"},
        }

    return change


def depth_outside(within: int) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """Give pixels within a distance beyond the image circle a depth."""

    def change(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        seen = np.isfinite(channels["Z"])
        near = ~seen & binary_dilation(seen, np.ones((3, 3)), within)
        return {**channels, "Z": np.where(near, np.float32(2), channels["Z"])}

    return change


@pytest.mark.parametrize(
    ("change", "check_name", "passed"),
    [
        # A five-hundredth of the lens's pixels is 5 pixels here.
        (grey(4, level=0), "colour", False),
        (grey(8, level=0), "colour", True),
        (light_outside(0.0009), "colour", True),
        (light_outside(0.0011), "colour", False),
        (light_outside(1, part=0.04), "colour", True),
        (light_outside(1, part=0.06), "colour", False),
        # Two pixels at the rim may hold light from both sides of it.
        (light_outside(1, within=2), "colour", True),
        (light_outside(1, within=3), "colour", False),
        (depth_outside(2), "depth", True),
        (depth_outside(3), "depth", False),
    ],
)
def test_the_limits_of_how_many_pixels_may_deviate(
    change: Callable[[Any], Any], check_name: str, passed: bool, one_view: Path
) -> None:
    painted(change)(one_view)
    assert failed(validate(one_view)) == ([] if passed else [check_name])


def test_the_first_view_is_checked_too(small_dataset: Path) -> None:
    first = names(small_dataset)[0]
    repaint(small_dataset, first, lambda c: {**c, **{n: c[n] * 0 for n in "RGB"}})
    assert check(validate(small_dataset), "colour").views == [first]


def test_a_pose_is_compared_within_blenders_precision(small_dataset: Path) -> None:
    """float32 holds a position 1 km away to 0.03 mm. Nearby, a deviation of 0.1 mm is a fault."""

    def displaced(by: float, away: float) -> Callable[[dict[str, Any]], None]:
        def change(content: dict[str, Any]) -> None:
            for frame in content["frames"]:
                frame["world_matrix"][0][3] = away
                frame["position"] = [away, *(row[3] for row in frame["world_matrix"][1:3])]
            content["frames"][BAD]["position"][0] += by

        return change

    for by, away, passed in ((5e-3, 1e3, True), (2e-2, 1e3, False), (1e-4, 0.0, False)):
        rewrite(small_dataset, displaced(by, away))
        assert check(validate(small_dataset), "lightfield").passed is passed


INTEL, AMD = "GenuineIntel AVX2, glibc 2.36", "AuthenticAMD AVX2, glibc 2.36"
GPU = f"OPTIX NVIDIA H200, {INTEL}"


@pytest.mark.parametrize(
    ("machines", "warned"),
    [
        ([INTEL, INTEL, INTEL], []),
        ([GPU, GPU, GPU], []),
        ([INTEL, AMD, INTEL], [f"1 on {AMD}", f"2 on {INTEL}"]),
        ([INTEL, INTEL, GPU], [f"2 on {INTEL}", f"1 on {GPU}"]),
        # Another kind of node rendered some of the views.
        ([AMD, AMD, AMD], [f"3 on {AMD}", f"lightfield.json names {INTEL}"]),
    ],
)
def test_machines_with_possibly_different_last_digits_are_named(
    machines: list[str], warned: list[str], small_dataset: Path
) -> None:
    rewrite(small_dataset, lambda content: content.update(machine=INTEL))
    for name, machine in zip(names(small_dataset), machines, strict=True):
        repaint(small_dataset, name, header={images.MACHINE_ATTRIBUTE: machine})
    result = validate(small_dataset)
    assert result.valid
    machine_check = check(result, "machines")
    assert machine_check.figures == Counter(machines)
    assert len(machine_check.warnings) == bool(warned)
    assert all(text in result.summary() for text in warned)


def test_views_without_a_machine_are_not_checked_for_it(small_dataset: Path) -> None:
    assert "machines" not in [check.name for check in validate(small_dataset).checks]


def test_clamped_values_are_a_warning(small_dataset: Path) -> None:
    headed(images.CLAMPED_ATTRIBUTE, 9)(small_dataset)
    result = validate(small_dataset)
    assert result.valid
    assert "9 values in 1 views were clamped" in result.summary()


def test_the_terminal_is_told_of_clamped_light(small_dataset: Path, run_program) -> None:
    headed(images.CLAMPED_ATTRIBUTE, 9)(small_dataset)
    shown = run_program("validate.py", small_dataset)
    said = "warning: 9 values in 1 views were clamped to the half range"
    assert said in shown.stderr.splitlines()


BROKEN_LISTS: dict[str, tuple[Spoil, str]] = {
    "no file": (
        lambda small_dataset: (small_dataset / "lightfield.json").unlink(),
        "cannot be read",
    ),
    "no JSON": (
        lambda small_dataset: (small_dataset / "lightfield.json").write_text("{"),
        "is not JSON",
    ),
    "no frames": (
        lambda small_dataset: rewrite(small_dataset, lambda held: held["frames"].clear()),
        "frames: is empty",
    ),
    "no camera": (
        lambda small_dataset: write_json(small_dataset / "lightfield.json", {"frames": []}),
        "camera: is missing",
    ),
    "a name twice": (bad_frame("name", "view_0000f"), "view_0000f: is the name of two frames"),
    "rotation of another": (bad_frame("rotation", [0, 0, 0]), "world_matrix"),
    "a part that no split has": (
        bad_frame("split", "val"),
        "split: is 'val'; must be train, validation, test, or missing",
    ),
    "poses of another exposure": (
        bad_frame("exposure", {"start": np.eye(4).tolist(), "end": np.eye(4).tolist()}),
        "exposure: has not the pose",
    ),
    "no poses of an exposure": (bad_frame("exposure", {"start": 1}), "exposure: has not the pose"),
    "mirrored axis": (
        bad_frame("world_matrix", np.diag([-1.0, 1.0, 1.0, 1.0]).tolist()),
        "world_matrix: its first 3 × 3 must be a rotation, and mirrors",
    ),
    "Z-depth beyond 180 degrees": (
        lambda small_dataset: rewrite(small_dataset, recamera({"fov": 190})),
        "depth: is 'z'",
    ),
}


@pytest.mark.parametrize("case", BROKEN_LISTS)
def test_broken_lightfield_json_fails(case: str, small_dataset: Path) -> None:
    spoil, text = BROKEN_LISTS[case]
    spoil(small_dataset)
    result = validate(small_dataset)
    assert "lightfield" in failed(result)
    problems = check(result, "lightfield").problems
    assert problems[0].startswith("lightfield.json: ")
    assert text in problems[0]
    assert str(small_dataset) not in problems[0]


def test_a_video_has_a_size_of_its_own_and_must_be_as_its_list_says(small_dataset: Path) -> None:
    video = small_dataset / "video" / "walk.webp"
    video.parent.mkdir()
    Image.new("RGB", (50, 36)).save(video)
    files_of_video = {"walk.webp": sha256(video)}
    write_json(video.with_name("export.json"), {"format": "video", "files": files_of_video})
    assert not failed(validate(small_dataset))
    Image.new("RGB", (50, 36), "red").save(video)
    result = validate(small_dataset)
    problems = [line for name in failed(result) for line in check(result, name).problems]
    assert problems
    assert all("walk.webp" in problem for problem in problems), problems


def test_stray_files_fail(small_dataset: Path) -> None:
    (small_dataset / "exr" / "view_9999f.exr").write_bytes(b"")
    (small_dataset / "old").mkdir()
    (small_dataset / "old" / "notes.txt").write_text("?")
    (small_dataset / "report").mkdir()
    (small_dataset / "report" / "index.html").write_text("not published")
    result = validate(small_dataset)
    assert failed(result) == ["files"]
    assert check(result, "files").problems == [
        "exr/view_9999f.exr: is not a file of this dataset",
        "old/notes.txt: is not a file of this dataset",
    ]


def test_an_unpacked_dataset_is_valid_with_its_packages_files(small_dataset: Path) -> None:
    for name in ("README.md", "card.json", "read.py", "__pycache__/read.cpython-313.pyc"):
        (small_dataset / name).parent.mkdir(exist_ok=True)
        (small_dataset / name).write_text("{}")
    assert not failed(validate(small_dataset))


# ---- records, clearance, exports ------------------------------------------------------------


def write_receipt(dataset: Path) -> Path:
    """Write a receipt of the views, which have a key, and of lightfield.json. Return its path."""
    job = "room/sphere/render/0-12"
    lines: list[dict[str, Any]] = [
        {"job": job, "stage": "", "version": None, "settings": {}, "inputs": {}}
    ]
    for path in sorted((dataset / "exr").glob("view_*")):
        lines.append({"file": str(path), **Stamp.of(path)._asdict(), "key": "key"})
    lines.append({"file": str(dataset / NAME), **Stamp.of(dataset / NAME)._asdict()})
    receipt = dataset.parent / f"work/receipts/{job}.jsonl"
    write_text(receipt, "".join(json.dumps(line) + "\n" for line in lines))
    return receipt


def test_receipts_must_agree(small_dataset: Path) -> None:
    made = made_in(small_dataset, [write_receipt(small_dataset)], None)
    assert check(validate(small_dataset, made=made), "checksums").passed
    on_file(flip_byte)(small_dataset)
    first = validate(small_dataset, made=made)
    assert check(first, "checksums").views == [names(small_dataset)[BAD]]
    del made["exr/view_0000f.exr"]
    made["exr/gone.exr"] = made["exr/view_0001f.exr"]
    lightfield = small_dataset / NAME
    lightfield.write_text(lightfield.read_text() + " ")
    second = check(validate(small_dataset, made=made), "checksums")
    assert second.passed is False
    assert second.views == ["gone", "lightfield", "view_0000f", names(small_dataset)[BAD]]


def test_camera_inside_geometry_fails(small_dataset: Path, tmp_path: Path) -> None:
    around = {name: {"distance": None, "inside": False} for name in names(small_dataset)}
    around["view_0001f"] = {"distance": 0.25, "inside": False}
    write_json(tmp_path / "clearance.json", {"views": around})
    right = validate(small_dataset, clearance=tmp_path / "clearance.json")
    assert check(right, "cameras").passed
    assert check(right, "cameras").figures == {"nearest_metres": 0.25}
    around[names(small_dataset)[BAD]] = {"distance": 0.0, "inside": True}
    del around["view_0000f"]
    write_json(tmp_path / "clearance.json", {"views": around})
    wrong = validate(small_dataset, clearance=tmp_path / "clearance.json")
    assert failed(wrong) == ["cameras"]
    assert sorted(check(wrong, "cameras").views) == ["view_0000f", names(small_dataset)[BAD]]


def test_misses_are_counted_in_a_scene_with_volumes(small_dataset: Path, tmp_path: Path) -> None:
    view_path = small_dataset / "exr" / f"{names(small_dataset)[BAD]}.exr"
    image = images.read_image(view_path)
    attributes = {k: v for k, v in image.attributes.items() if k.startswith("plenoforge:")}
    depth = image.channels["Z"].copy()
    depth[20:36, 24:40] = np.inf
    images.write_exr(view_path, image.channels | {"Z": depth}, attributes)
    write_json(tmp_path / "inventory.json", {"volumes": ["Fog", "Smoke"]})
    result = validate(small_dataset, inventory=tmp_path / "inventory.json")
    assert result.valid
    (warning,) = check(result, "depth").warnings
    part, text = warning.split("% of the depths are inf; ")
    assert text == "volumes are no surfaces: Fog, Smoke"
    rays = LightField.read(small_dataset / NAME).lens.pixel_rays()
    # The rim of the image circle does not count.
    seen = binary_erosion(np.pad(np.isfinite(rays[..., 0]), 2, "edge"), np.ones((5, 5)))[2:-2, 2:-2]
    views = [images.read_image(path).channels["Z"] for path in (small_dataset / "exr").iterdir()]
    missed = np.mean([np.isposinf(depth[seen]).mean() for depth in views])
    assert missed > 0.01
    assert float(part) / 100 == pytest.approx(missed, abs=0.0005)
    for count, end in ((8, "V6, V7"), (9, "V6, V7 …")):
        write_json(tmp_path / "inventory.json", {"volumes": [f"V{i}" for i in range(count)]})
        many = validate(small_dataset, inventory=tmp_path / "inventory.json")
        assert check(many, "depth").warnings[0].endswith(end)
    write_json(tmp_path / "inventory.json", [])
    with pytest.raises(UserError, match=r"inventory\.json: volumes: is missing"):
        validate(small_dataset, inventory=tmp_path / "inventory.json")
    write_json(tmp_path / "inventory.json", {"volumes": []})
    clear = validate(small_dataset, inventory=tmp_path / "inventory.json")
    assert check(clear, "depth").warnings == []


@pytest.mark.parametrize("name", ["clearance", "splits"])
def test_a_wrong_list_is_named_before_images_are_read(small_dataset, capsys, name) -> None:
    path = small_dataset.parent / "list.json"
    write_json(path, [])
    with pytest.raises(UserError, match=r"list\.json: "):
        validate(small_dataset, **{name: path})
    assert not capsys.readouterr().err


def test_listed_files_belong_to_their_export(small_dataset: Path) -> None:
    picture = np.zeros((64, 64, 3), np.uint8)
    images.write_png(small_dataset / "exr" / "dynamic_mask_view_0001f.png", picture[..., 0])
    images.write_png(small_dataset / "pictures" / "one.png", picture)
    images.write_png(small_dataset / "depth.png", picture[..., 0].astype(np.uint16))
    frames = [
        {"file_path": "pictures/one.png", "depth_path": "depth.png"},
        {"file_path": "exr/view_0000f.exr"},
    ]
    write_json(small_dataset / "transforms.json", {"frames": frames})
    result = validate(small_dataset)
    assert check(result, "exports").passed
    assert {"depth.png", "pictures/one.png", "transforms.json"} <= result.checksums.keys()
    assert check(result, "exports").detail == "1 lists of frames, 3 pictures beside the views"
    write_json(
        small_dataset / "transforms_test.json", {"frames": [{"file_path": "pictures/two.png"}]}
    )
    (small_dataset / "transforms_train.json").write_text('{"frames": [{}]}')
    images.write_png(small_dataset / "pictures" / "one.png", picture[:10])
    problems = check(validate(small_dataset), "exports").problems
    assert problems == [
        "transforms_test.json: pictures/two.png is not a file of the dataset",
        "transforms_train.json: is not JSON with frames, each with a file_path",
        "pictures/one.png: is 64 × 10; must be 64 × 64",
    ]


# ---- transparent views ----------------------------------------------------------------------


def alpha(value: float) -> Callable[[Any], dict[str, np.ndarray]]:
    """Give a view an alpha of 1, except for one pixel."""

    def change(channels: Any) -> dict[str, np.ndarray]:
        covered = np.ones((64, 64), np.float16)
        covered[30, 31] = value
        return {**channels, "A": covered}

    return change


def nothing_seen(channels: Any) -> dict[str, np.ndarray]:
    black = {name: np.zeros((64, 64), np.float16) for name in "RGBA"}
    return {**black, "Z": np.full((64, 64), np.inf, np.float32)}


def opaque_rim(channels: Any) -> dict[str, np.ndarray]:
    """Show nothing, except for the opaque rim that Cycles gives an image circle."""
    y, x = np.mgrid[:64, :64] + 0.5
    rim = np.abs(np.hypot(x - 32, y - 32) - 31.5) < 0.5
    return {**nothing_seen(channels), "A": (0.5 * rim).astype(np.float16)}


def one_speck(channels: Any) -> dict[str, np.ndarray]:
    """Show an object that covers one pixel."""
    seen = nothing_seen(channels)
    for name, value in zip("RGBAZ", (0.3, 0.2, 0.1, 1, 7), strict=True):
        seen[name][40, 20] = value
    return seen


def black_object(channels: Any) -> dict[str, np.ndarray]:
    """Show a black object that covers half of the view."""
    seen = nothing_seen(channels)
    seen["A"][:, :32] = 1
    seen["Z"][:, :32] = 7
    return seen


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (alpha(0.5), None),
        (nothing_seen, None),
        (opaque_rim, None),
        (one_speck, None),
        (black_object, None),
        (alpha(1.001), "1 values of alpha are not between 0 and 1"),
        (alpha(-0.001), "1 values of alpha are not between 0 and 1"),
        (alpha(np.nan), "1 values of alpha are not between 0 and 1"),
        (lambda c: {**alpha(1)(c), **{n: c[n] * 0 for n in "RGB"}}, "is black"),
        (dict, "must have A:float16 B:float16"),
    ],
)
def test_transparent_views_have_alpha_and_may_be_empty(
    change: Any, problem: str | None, small_dataset: Path
) -> None:
    rewrite(small_dataset, lambda held: held.update(render={"transparent": True}))
    painted(alpha(1), slice(BAD))(small_dataset)
    painted(change, ONE)(small_dataset)
    result = validate(small_dataset)
    problems = [
        problem_line
        for name in ("images", "colour")
        for problem_line in check(result, name).problems
    ]
    assert [problem in problem_line for problem_line in problems] == ([True] if problem else [])


# ---- passes ---------------------------------------------------------------------------------


def add_passes(dataset: Path) -> None:
    """Add valid passes of one object that covers everything."""
    wanted = [PASSES[name] for name in ("normal", "object", "cryptomatte", "emission")]
    render = {"passes": [render_pass.name for render_pass in wanted]}
    rewrite(dataset, lambda held: held.update(render=render))
    write_json(dataset / "object" / NAMES, {"thing": 1})
    for view, render_pass in product(names(dataset), wanted):
        planes = {
            channel: np.zeros((64, 64), render_pass.dtype) for channel in render_pass.channels
        }
        header = {}
        if render_pass.name in ("normal", "object"):
            depth = images.read_image(dataset / "exr" / f"{view}.exr").channels["Z"]
            planes["B" if render_pass.name == "normal" else "Y"][np.isfinite(depth)] = 1
        if render_pass.name == "cryptomatte":
            planes["CryptoObject00.R"][:], planes["CryptoObject00.G"][:] = 1, 0.6
            planes["CryptoObject00.B"][:], planes["CryptoObject00.A"][:] = 2, 0.4
            # The last two hold integers, not floats, and are written with other functions.
            hashes = ("3f800000", "40000000", "00000001", "ff800001")
            header = matte_header(dict(zip("abcd", hashes, strict=True)))
        images.write_exr(render_pass.path(dataset, view), planes, header)


def in_pass(name: str, **pixels: float) -> Spoil:
    """Change one pixel of a pass."""

    def spoil(dataset: Path) -> None:
        path = PASSES[name].path(dataset, names(dataset)[BAD])
        image = images.read_image(path)
        planes = {channel: plane.copy() for channel, plane in image.channels.items()}
        for channel, value in pixels.items():
            planes[channel.replace("_", ".")][30, 31] = value
        kept = {key: value for key, value in image.attributes.items() if "cryptomatte" in key}
        images.write_exr(path, planes, kept)

    return spoil


def of_pass(name: str, change: Callable[[Path], Any]) -> Spoil:
    return lambda dataset: change(PASSES[name].path(dataset, names(dataset)[BAD]))


OUT_OF_ORDER = "1 pixels have parts below 0 or not in order"
BROKEN_PASSES: dict[str, tuple[Spoil, str]] = {
    "missing": (of_pass("emission", Path.unlink), "is missing"),
    "truncated": (of_pass("emission", truncate), "not an image that can be read"),
    "small": (
        of_pass("object", lambda path: images.write_exr(path, {"Y": np.zeros((64, 32), "u4")})),
        "is 32 × 64; must be 64 × 64",
    ),
    "other channels": (
        of_pass("object", lambda path: images.write_exr(path, {"Y": np.zeros((64, 64), "f4")})),
        "has the channels Y:float32; must have Y:uint32",
    ),
    "not finite": (in_pass("emission", R=np.nan, G=np.inf), "2 values are not finite"),
    "long normal": (in_pass("normal", B=1.00012), "1 normals are not unit vectors"),
    "short normal": (in_pass("normal", B=0.99988), "1 normals are not unit vectors"),
    "unknown object": (in_pass("object", Y=7), "has [7], which object/names.json does not have"),
    "no object": (in_pass("object", Y=0), "1 pixels have a depth or an object, and not both"),
    "unknown matte": (
        in_pass("cryptomatte", CryptoObject00_R=3),
        "has 1 objects that its manifest does not have",
    ),
    "negative part": (in_pass("cryptomatte", CryptoObject02_A=-0.1), OUT_OF_ORDER),
    "parts out of order": (in_pass("cryptomatte", CryptoObject00_A=0.7), OUT_OF_ORDER),
}


@pytest.mark.parametrize("case", BROKEN_PASSES)
def test_a_broken_pass_is_named(case: str, small_dataset: Path) -> None:
    spoil, text = BROKEN_PASSES[case]
    add_passes(small_dataset)
    spoil(small_dataset)
    result = validate(small_dataset)
    assert failed(result) == ["passes"]
    assert check(result, "passes").detail == "11 of 12 are there and hold what they must"
    (problem,) = check(result, "passes").problems
    path, said = problem.split(": ", 1)
    assert Path(path).name == f"{names(small_dataset)[BAD]}.exr"
    assert text in said


def test_correct_passes_are_valid_with_a_warning_for_clamped_numbers(
    small_dataset: Path,
) -> None:
    add_passes(small_dataset)
    in_pass("normal", B=1.00009)(small_dataset)
    for_floats = np.array([0x00800001, 0xFF000001], np.uint32).view(np.float32)
    own_channels = dict(zip(("CryptoObject00_R", "CryptoObject00_B"), for_floats, strict=True))
    in_pass("cryptomatte", **own_channels)(small_dataset)
    # A name that covers nothing may be missing.
    in_pass("cryptomatte", CryptoObject01_R=3)(small_dataset)
    for view in names(small_dataset)[:2]:
        path = PASSES["normal"].path(small_dataset, view)
        images.write_exr(path, images.read_image(path).channels, {images.NAN_ATTRIBUTE: 3})
    result = validate(small_dataset)
    assert failed(result) == []
    passes_check = check(result, "passes")
    assert passes_check.detail == "12 of 12 are there and hold what they must"
    (warning,) = passes_check.warnings
    assert warning.startswith("6 values in normal were not numbers to Cycles and are 0")
    assert {"normal/view_0000f.exr", f"object/{NAMES}"} <= result.checksums.keys()
    (small_dataset / "object" / NAMES).unlink()
    problems = check(validate(small_dataset), "passes").problems
    assert f"object/view_0000f.exr: has [0, 1], which object/{NAMES} does not have" in problems


# ---- reprojections --------------------------------------------------------------------------


def add_panoramas(dataset: Path, spoil: Callable[[dict[str, np.ndarray]], Any] = dict) -> None:
    """Add the fisheyes' views as equirectangular panoramas, which end beside the camera."""
    folder = dataset / "panorama"
    lens = lenses.from_camera({"lens": "equirectangular", "resolution": [96, 48]})
    lightfield = LightField.read(dataset / NAME).changed(lens=lens, depth="distance")
    behind = np.abs(np.mgrid[:48, :96][1] + 0.5 - 48) > 24
    for view in lightfield.views:
        channels = render(lens, view.world_from_camera, "distance", np.random.default_rng(2))
        channels = {name: np.where(behind, 0, pixels) for name, pixels in channels.items()}
        channels["Z"] = np.where(behind, np.float32(np.nan), channels["Z"])
        channels = spoil(channels)
        images.write_exr(folder / f"{view.name}.exr", channels)
        colour = np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float32)
        alpha = np.where(np.isnan(channels["Z"]), 0, 255).astype(np.uint8)
        images.write_png(folder / f"{view.name}.png", np.dstack([to_8_bit(colour), alpha]))
        images.write_png(folder / f"dynamic_mask_{view.name}.png", 255 - alpha)
    lightfield.write(folder / NAME)


def test_right_reprojection_is_valid(small_dataset: Path) -> None:
    add_panoramas(small_dataset)
    result = validate(small_dataset, ["panorama"])
    assert failed(result) == []
    assert check(result, "panorama/geometry").passed
    assert check(result, "panorama/marks").passed
    assert check(result, "panorama/views").detail == "6 of 6 images are there"
    assert "panorama/dynamic_mask_view_0001f.png" in result.checksums
    # Masks exist, and no list names them.
    assert check(result, "exports").passed
    assert failed(validate(small_dataset)) == ["files"]


def test_reprojected_views_are_as_coarse_as_their_source(small_dataset: Path) -> None:
    add_panoramas(small_dataset)
    (rendered_set, reprojected), _ = files.read_sets(small_dataset, ["panorama"])
    assert grain_of(rendered_set) == 0
    assert grain_of(reprojected) == pytest.approx(math.pi / 64)


def test_a_view_of_a_flat_wall_is_a_warning(small_dataset: Path) -> None:
    """No failed render has a colour: Cycles leaves black."""
    painted(grey(0), ONE)(small_dataset)
    colour_check = check(validate(small_dataset), "colour")
    assert colour_check.passed
    assert colour_check.warnings == ["1 images in exr have one colour"]


@pytest.mark.parametrize("sees_surfaces", [True, False])
def test_a_black_view_may_show_a_black_sky_but_no_surface(
    sees_surfaces: bool, small_dataset: Path
) -> None:
    def night(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        depth = channels["Z"] if sees_surfaces else np.full_like(channels["Z"], np.inf)
        return {**grey(0, level=0)(channels), "Z": depth}

    painted(night, ONE)(small_dataset)
    colour_check = check(validate(small_dataset), "colour")
    assert colour_check.passed is not sees_surfaces
    assert colour_check.warnings == ([] if sees_surfaces else ["1 images in exr have one colour"])


def test_a_reprojected_view_may_show_the_black_part_of_its_source(small_dataset: Path) -> None:
    def black(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return channels | {name: np.zeros_like(channels[name]) for name in "RGB"}

    def find(*failing: str) -> None:
        result = validate(small_dataset, ["panorama"])
        for name in ("colour", "panorama/colour", "panorama/source"):
            assert check(result, name).passed is (name not in failing), name

    add_panoramas(small_dataset, black)
    find("panorama/colour")
    reprojection = {"reprojection": {"exposure": 0}}
    rewrite(small_dataset / "panorama", lambda held: held.update(reprojection))
    find("panorama/source")
    painted(lambda c: black({**c, "Z": np.full_like(c["Z"], np.inf)}), slice(None))(small_dataset)
    add_panoramas(small_dataset, lambda c: black({**c, "Z": c["Z"] * np.float32(np.inf)}))
    rewrite(small_dataset / "panorama", lambda held: held.update(reprojection))
    find()


def test_a_reprojected_view_of_one_colour_is_a_warning(small_dataset: Path) -> None:
    add_panoramas(small_dataset)
    right = validate(small_dataset, ["panorama"])
    add_panoramas(
        small_dataset, lambda c: {**c, **{name: np.full_like(c[name], 0.5) for name in "RGB"}}
    )
    one_colour = validate(small_dataset, ["panorama"])
    for result, warnings in ((right, []), (one_colour, ["6 images in panorama have one colour"])):
        assert check(result, "panorama/colour").warnings == warnings
        assert check(result, "colour").warnings == []


WRONG_REPROJECTIONS: dict[str, tuple[Callable[[dict[str, np.ndarray]], Any], str]] = {
    "unmarked": (lambda c: {**c, "Z": np.nan_to_num(c["Z"], nan=3.0)}, "marks"),
    "unmarked at the edge": (
        lambda c: {**c, "Z": np.where(np.arange(48)[:, None] * 96 + np.arange(96) < 4, 3, c["Z"])},
        "marks",
    ),
    "smeared": (lambda c: {**c, "R": np.where(c["R"] == 0, np.float16(0.1), c["R"])}, "marks"),
    "marked too much": (
        lambda c: {**c, "Z": np.where(np.arange(96) < 60, c["Z"], np.float32(np.nan))},
        "marks",
    ),
    "mirrored": (lambda c: {name: np.fliplr(pixels) for name, pixels in c.items()}, "geometry"),
    "depth not converted": (
        lambda c: {
            **c,
            "Z": c["Z"] * np.cos((np.mgrid[:48, :96][1] - 47.5) / 48 * np.pi).astype(np.float32),
        },
        "geometry",
    ),
}


@pytest.mark.parametrize("case", WRONG_REPROJECTIONS)
def test_wrong_reprojection_fails(case: str, small_dataset: Path) -> None:
    spoil, name = WRONG_REPROJECTIONS[case]
    add_panoramas(small_dataset, spoil)
    result = validate(small_dataset, ["panorama"])
    assert f"panorama/{name}" in failed(result)
    assert all(check.startswith("panorama/") for check in failed(result))


@pytest.fixture(scope="session")
def right_magnified_dataset(
    right_small_dataset: Path, tmp_path_factory: Any, run_program: Any
) -> Path:
    """A dataset with a reprojection that has four pixels across each pixel of its source."""
    dataset = tmp_path_factory.mktemp("magnified") / "room" / "plane"
    shutil.copytree(right_small_dataset, dataset)
    files = ["--input-cfg", dataset / NAME, "-i", dataset / "exr", "-o", dataset / "flat"]
    files += ["--output-cfg", dataset / "flat" / NAME]
    development = ["--exr", "--png", "--exposure", "-1", "--reinhard", "4"]
    optics = ["--rectilinear", "18,36", "--output-resolution", "128,128"]
    result = run_program("reproject.py", *files, *development, *optics)
    assert result.returncode == 0, result.stderr
    return dataset


@pytest.fixture
def magnified_dataset(right_magnified_dataset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(right_magnified_dataset, tmp_path / "room" / "plane"))


def test_a_magnified_reprojection_is_valid(right_magnified_dataset: Path) -> None:
    result = validate(right_magnified_dataset, ["flat"])
    assert failed(result) == []
    agreement = check(result, "flat/geometry").figures
    assert agreement["contradict"] < 0.005
    assert agreement["points"] > 1000
    assert check(result, "flat/source").detail.startswith("6 of 6 ")


def repaint_flat(
    dataset: Path, suffix: str, change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]
) -> None:
    """Change the channels of the first reprojected view."""
    path = dataset / "flat" / f"{names(dataset)[0]}{suffix}"
    image = images.read_image(path)
    channels = change(dict(image.channels))
    if suffix == ".exr":
        images.write_exr(path, channels, {images.DEPTH_ATTRIBUTE: "z"})
    else:
        images.write_png(path, np.stack([channels[name] for name in image.channels], axis=-1))


WRONG_PIXELS: dict[str, tuple[str, Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]]] = {
    "mirrored": (".exr", each(np.fliplr)),
    "upside down": (".exr", each(np.flipud)),
    "transposed": (".exr", each(np.transpose)),
    "depth 2 % too large": (".exr", scaled(1.02)),
    "depth in millimetres": (".exr", scaled(1000)),
    "red for blue": (".exr", lambda c: {**c, "R": c["B"], "B": c["R"]}),
    "twice as bright": (".exr", lambda c: {**c, **{name: 2 * c[name] for name in "RGB"}}),
    "red for blue in 8 bits": (".png", lambda c: {**c, "R": c["B"], "B": c["R"]}),
    "half as bright in 8 bits": (".png", each(lambda pixels: pixels // 2)),
}


@pytest.mark.parametrize("case", WRONG_PIXELS)
def test_a_reprojected_view_that_shows_something_else_is_named(
    case: str, magnified_dataset: Path
) -> None:
    suffix, change = WRONG_PIXELS[case]
    repaint_flat(magnified_dataset, suffix, change)
    result = validate(magnified_dataset, ["flat"])
    view = names(magnified_dataset)[0]
    assert check(result, "flat/source").views == [view]
    (problem,) = check(result, "flat/source").problems
    assert problem.startswith(f"flat/{view}{suffix}: ")
    assert problem.endswith(f" exr/{view}.exr")


def test_negative_light_as_of_saturated_colours_may_be_reprojected(magnified_dataset: Path) -> None:
    def negative(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {**channels, "R": np.full_like(channels["R"], -0.2)}

    repaint(magnified_dataset, names(magnified_dataset)[0], negative)
    repaint_flat(magnified_dataset, ".exr", negative)
    repaint_flat(magnified_dataset, ".png", lambda channels: {**channels, "R": 0 * channels["R"]})
    assert check(validate(magnified_dataset, ["flat"]), "flat/source").passed


def test_two_reprojected_views_that_are_swapped_are_named(magnified_dataset: Path) -> None:
    first, _, last = (magnified_dataset / "flat" / f"{n}.exr" for n in names(magnified_dataset))
    first_bytes = first.read_bytes()
    first.write_bytes(last.read_bytes())
    last.write_bytes(first_bytes)
    result = validate(magnified_dataset, ["flat"])
    assert check(result, "flat/source").views == sorted([first.stem, last.stem])


def marked_from(columns: float) -> Callable[[dict[str, np.ndarray]], Any]:
    """Mark pixels from a number of columns beside the middle on. The source sees up to 24."""
    away = np.abs(np.arange(96) + 0.5 - 48)
    return lambda c: {
        **c,
        "Z": np.where(away > columns, np.float32(np.nan), np.nan_to_num(c["Z"], nan=3)),
    }


@pytest.mark.parametrize(("columns", "passed"), [(22, True), (21, False), (26, True), (27, False)])
def test_marks_may_be_two_pixels_off(columns: float, passed: bool, one_view: Path) -> None:
    add_panoramas(one_view, marked_from(columns))
    assert check(validate(one_view, ["panorama"]), "panorama/marks").passed is passed


def test_one_coloured_pixel_without_a_source_is_named(one_view: Path) -> None:
    def coloured(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        channels["G"][20, 5] = 0.5
        return channels

    add_panoramas(one_view, coloured)
    (problem,) = check(validate(one_view, ["panorama"]), "panorama/marks").problems[:1]
    assert problem.endswith(": has colour in pixels without a source")


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (move(0, (0, 5e-6, 0)), None),
        (move(0, (0, 2e-5, 0)), "is not at the place of view_0000f"),
        (lambda held: held["frames"][0].update(name="b"), "is made of no view of the dataset's"),
    ],
)
def test_a_reprojected_view_has_the_place_of_its_source(
    change: Callable[[dict[str, Any]], None], fault: str | None, one_view: Path
) -> None:
    add_panoramas(one_view)
    relist(one_view / "panorama", change)
    lightfield_check = check(validate(one_view, ["panorama"]), "panorama/lightfield")
    assert lightfield_check.passed is (fault is None)
    assert fault is None or fault in lightfield_check.problems[0]


def test_a_transparent_view_of_nothing_may_be_reprojected(one_view: Path) -> None:
    rewrite(one_view, lambda held: held.update(render={"transparent": True}))
    painted(opaque_rim)(one_view)

    def nothing_but_rim(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        covered = np.where(np.isnan(channels["Z"]), 0, 0.25).astype(np.float16)
        depth = np.where(np.isnan(channels["Z"]), np.nan, np.inf).astype(np.float32)
        return {**dict.fromkeys("RGB", covered * 0), "A": covered, "Z": depth}

    add_panoramas(one_view, nothing_but_rim)
    result = validate(one_view, ["panorama"])
    # The view is right, but a dataset of nothing else is not.
    assert failed(result) == ["surfaces"]
    assert check(result, "panorama/colour").warnings == []


@pytest.mark.parametrize("transparent", [True, False])
def test_only_pixels_of_transparent_views_may_be_clear_although_the_source_sees_them(
    transparent: bool, one_view: Path
) -> None:
    rewrite(one_view, lambda held: held.update(render={"transparent": transparent}))
    if transparent:
        painted(alpha(1))(one_view)
    add_panoramas(one_view, lambda c: {**c, "A": (~np.isnan(c["Z"])).astype(np.float16)})
    path = one_view / "panorama" / "view_0000f.png"
    channels = images.read_image(path).channels
    pixels = np.dstack([channels[name] for name in "RGBA"])
    pixels[10:30, 40:60] = 0
    images.write_png(path, pixels)
    result = validate(one_view, ["panorama"])
    assert check(result, "panorama/marks").passed is transparent
    assert check(result, "panorama/images").passed
    # Depth tells the two apart: a clear pixel is a miss, and NaN has no source.
    path = path.with_suffix(".exr")
    channels = images.read_image(path).channels
    depth = channels["Z"].copy()
    depth[10:30, 40:60] = np.nan
    images.write_exr(path, {**channels, "Z": depth})
    assert check(validate(one_view, ["panorama"]), "panorama/marks").passed is False


def test_the_faces_of_a_cube_map_are_compared_with_their_view(one_view: Path) -> None:
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 90, "resolution": [32, 32]})
    lightfield_of_view = LightField.read(one_view / NAME)
    for face, side in (("l", 1), ("r", -1)):
        turned = np.eye(4)
        turned[:3, :3] = degrees(1, 90 * side)
        views = [
            View.placed(f"{view.name}_{face}", view.world_from_camera @ turned)
            for view in lightfield_of_view.views
        ]
        lightfield = lightfield_of_view.changed(lens=lens, views=views, depth="distance")
        # The fisheyes see only what is in front, which is half of each face.
        unseen = (np.arange(32) < 16) == (side > 0)
        for view in views:
            channels = render(lens, view.world_from_camera, "distance", np.random.default_rng(3))
            channels = {name: np.where(unseen, 0, pixels) for name, pixels in channels.items()}
            channels["Z"] = np.where(unseen, np.float32(np.nan), channels["Z"])
            images.write_exr(one_view / face / f"{view.name}.exr", channels)
        lightfield.write(one_view / face / NAME)
    result = validate(one_view, ["l", "r"])
    assert failed(result) == []
    assert check(result, "l/marks").passed and check(result, "r/marks").passed
    path = one_view / "r" / f"{views[0].name}.exr"
    channels = images.read_image(path).channels
    images.write_exr(path, {**channels, "Z": np.nan_to_num(channels["Z"], nan=2)})
    assert "r/marks" in failed(validate(one_view, ["l", "r"]))


def test_missing_picture_of_a_reprojection_is_named(small_dataset: Path) -> None:
    add_panoramas(small_dataset)
    (small_dataset / "panorama" / "view_0001f.png").unlink()
    result = validate(small_dataset, ["panorama"])
    assert failed(result) == ["panorama/views"]
    assert check(result, "panorama/views").problems == ["panorama/view_0001f.png: is missing"]


# ---- the program ----------------------------------------------------------------------------


def run(run_program: Any, dataset: Path, *more: Any) -> Any:
    receipt = dataset.parent / "work/receipts/room/sphere/validate.jsonl"
    arguments = (dataset, "--output", dataset / "validation.json", "--receipt", receipt)
    return run_program("validate.py", *arguments, *more)


def publish(run_program: Any, dataset: Path, *inputs: Path) -> Any:
    receipts = dataset.parent / "work/receipts/room/sphere"
    write_json(receipts / "settings.json", {"inputs": [*map(str, inputs)]})
    arguments = ("--validation", dataset / "validation.json", "--page", "the page")
    arguments += ("--settings", receipts / "settings.json", "--output", dataset / "sha256sums.txt")
    arguments += ("--receipt", receipts / "checksums.jsonl")
    return run_program("publish_checksums.py", *arguments, check=False)


def test_the_program_needs_only_the_dataset(small_dataset: Path, run_program: Any) -> None:
    add_panoramas(small_dataset)
    before = {path: path.stat().st_mtime_ns for path in small_dataset.rglob("*")}
    assert ": valid: " in run_program("validate.py", small_dataset).stdout
    assert before == {path: path.stat().st_mtime_ns for path in small_dataset.rglob("*")}
    (small_dataset / "panorama" / "view_0001f.png").unlink()
    arguments = (small_dataset, "--reprojection", "panorama/")
    result = run_program("validate.py", *arguments, check=False)
    assert result.returncode == 1
    assert result.stderr.endswith(f"error: {small_dataset}: is not valid\n")
    assert "panorama/view_0001f.png: is missing" in result.stderr
    assert "failed: panorama/views; " in result.stdout


def test_the_program_says_which_other_program_compares_the_checksums(
    small_dataset: Path, run_program: Any
) -> None:
    sums = small_dataset / "sha256sums.txt"
    sums.write_text(f"{'0' * 64}  lightfield.json\n")
    result = run_program("validate.py", small_dataset)
    assert ": valid: " in result.stdout
    said = f"note: {sums}: is compared only by python scripts/verify.py {small_dataset}\n"
    assert said in result.stderr
    found = run_program("verify.py", small_dataset, check=False)
    assert found.returncode == 1
    assert re.search(r"lightfield\.json: .*sha256", found.stdout)
    sums.unlink()
    assert "verify.py" not in run_program("validate.py", small_dataset).stderr


def test_the_program_writes_reproducible_bytes_and_correct_checksums(
    dataset: Path, tmp_path: Path, run_program: Any
) -> None:
    leftover = dataset / "exr" / ".view_0000f.123.tmp.exr"
    leftover.write_bytes(b"half a view")
    of_report = dataset / "report" / ".page.123.tmp.html"
    of_report.parent.mkdir()
    of_report.write_bytes(b"half a page, which another job may be writing")
    other = Path(shutil.copytree(dataset, tmp_path / "elsewhere" / "room" / "sphere"))
    receipts = {folder: write_receipt(folder) for folder in (dataset, other)}
    first = run(run_program, dataset, "--receipts", receipts[dataset])
    second = run(run_program, other, "--receipts", receipts[other])
    assert first.stdout == second.stdout
    assert re.fullmatch(
        r"room/sphere: valid: 12 views; 12 views × [\d.]+ neighbours agree 9\d.\d % .*\n",
        first.stdout,
    )
    assert not leftover.exists()
    assert of_report.exists()
    for folder in (dataset, other):
        published = publish(run_program, folder, receipts[folder])
        assert published.returncode == 0, published.stderr
    for name in ("validation.json", "sha256sums.txt"):
        assert (dataset / name).read_bytes() == (other / name).read_bytes()
    sums = (dataset / "sha256sums.txt").read_text().splitlines()
    listed_paths = [line.split("  ")[1] for line in sums]
    assert listed_paths == sorted(listed_paths)
    assert len(listed_paths) == 12 + 2
    subprocess.run(["sha256sum", "-c", "--strict", "sha256sums.txt"], cwd=dataset, check=True)


def test_a_failed_check_without_a_problem_is_named_by_its_detail(
    tmp_path: Path, run_program: Any
) -> None:
    dataset = tmp_path / "room/sphere"
    checks = [Check("exports", False, "2 of 3 are there"), Check("files", False, "9 files")]
    result = Result("room/sphere", 3, checks, {})
    write_json(dataset / "validation.json", result.to_json())
    published = publish(run_program, dataset)
    assert published.returncode == 1
    assert "exports: 2 of 3 are there; files: 9 files: see the page" in published.stderr
    assert "Traceback" not in published.stderr
    assert result.failures() == [
        "room/sphere: exports: 2 of 3 are there",
        "room/sphere: files: 9 files",
    ]


@pytest.mark.parametrize("size", [(1, 40), (40, 1), (40, 2)])
def test_an_image_without_inner_pixels_has_no_surfaces(size: tuple[int, int]) -> None:
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": size})
    camera = consistency.Camera(lens, np.eye(4), "z")
    depth = np.full((lens.height, lens.width), 2, np.float32)
    assert len(consistency.sample(camera, depth, 400)) == 0


def kill_workers() -> None:
    """Kill the processes that this one starts, as soon as they exist."""
    workers: list[psutil.Process] = []
    while not workers:
        children = psutil.Process().children()
        workers = [child for child in children if "spawn_main" in " ".join(child.cmdline())]
        time.sleep(0.01)
    for worker in workers:
        worker.kill()


@pytest.fixture
def eager_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let even tiny datasets be read by several processes."""
    monkeypatch.setattr("lightfield.validation.validate.BYTES_PER_PROCESS", 1)


@pytest.mark.usefixtures("eager_processes")
def test_two_processes_find_what_one_finds(dataset: Path) -> None:
    flip_byte(dataset / "exr" / "view_0003f.exr")
    first = validate(dataset)
    second = validate(dataset, processes=2)
    assert first == second
    assert any(check.passed is False for check in first.checks)


@pytest.mark.usefixtures("eager_processes")
def test_a_killed_worker_is_an_error_of_one_line(dataset: Path) -> None:
    killer = threading.Thread(target=kill_workers, daemon=True)
    killer.start()
    with pytest.raises(UserError, match="a process that reads it was killed; most likely"):
        validate(dataset, processes=2)
    killer.join()


def test_stray_files_are_moved_before_they_make_a_dataset_invalid(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("room/sphere")
    shutil.copytree(folder / "exr", folder / "former")
    shutil.copy(folder / NAME, folder / "former" / NAME)
    shutil.copy(folder / "exr" / f"{names(dataset)[0]}.exr", folder / "exr" / "view_9999f.exr")
    before = len(list((folder / "exr").iterdir()))
    (folder / "report").mkdir()
    for name in ("index.html", "panorama.png"):
        (folder / "report" / name).write_text("drawn")
    assert not check(validate(folder), "files").passed
    assert files.remove_strays(folder, [], Path("removed")) == before + 2
    assert [path.name for path in (folder / "report").iterdir()] == ["index.html"]
    assert check(validate(folder), "files").passed
    assert not (folder / "former").exists()
    assert Path("removed/room/sphere/exr/view_9999f.exr").is_file()
    assert len(list((folder / "exr").iterdir())) == before - 1
    assert files.remove_strays(folder, [], Path("removed")) == 0


def test_views_behind_a_link_are_published_and_nothing_there_is_moved(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("room/sphere")
    published = validate(folder).checksums
    disk = tmp_path / "disk"
    shutil.move(folder / "exr", disk)
    (folder / "exr").symlink_to(disk)
    assert validate(folder).checksums == published
    (disk / "mine.txt").write_text("mine")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes/a.txt").write_text("mine")
    (folder / "notes").symlink_to(tmp_path / "notes")
    # The link itself is moved, and not the notes.
    assert files.remove_strays(folder, [], Path("removed")) == 1
    assert Path("removed/room/sphere/notes").is_symlink()
    assert (tmp_path / "notes/a.txt").is_file()
    (problem,) = check(validate(folder), "files").problems
    assert problem == (
        "exr/mine.txt: is not a file of this dataset; remove it, because nothing is moved out of "
        "the folder that exr links to"
    )
    (disk / "mine.txt").unlink()
    assert validate(folder).checksums == published


def test_a_single_linked_view_is_published_and_a_loop_is_refused(
    dataset: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "room/sphere"
    published = validate(folder).checksums
    view = folder / "exr" / f"{names(dataset)[0]}.exr"
    shutil.move(view, tmp_path / "one.exr")
    view.symlink_to(tmp_path / "one.exr")
    assert validate(folder).checksums == published
    (folder / "exr/loop").symlink_to("..")
    with pytest.raises(UserError, match="exr/loop: is a link to a folder that it lies in; remove"):
        validate(folder)


def test_an_export_that_is_no_longer_requested_is_moved_away(
    small_dataset: Path, tmp_path: Path
) -> None:
    picture = np.full((64, 64, 3), 128, np.uint8)
    images.write_png(small_dataset / "exr" / "dynamic_mask_view_0001f.png", picture[..., 0])
    images.write_png(small_dataset / "pictures" / "one.png", picture)
    frames = {"frames": [{"file_path": "pictures/one.png"}]}
    for name in ("transforms.json", "transforms_train.json"):
        write_json(small_dataset / name, frames)
    manifest = small_dataset / "exports" / "poses_csv" / "export.json"
    manifest.parent.mkdir(parents=True)
    (manifest.parent / "poses.csv").write_text("name\n")
    write_json(manifest, {"files": {"poses.csv": sha256(manifest.parent / "poses.csv")}})
    # All existing exports, the requested ones, and none.
    for lists, moved in ((None, 0), ([small_dataset / "transforms.json", manifest], 1), ([], 5)):
        assert check(validate(small_dataset, export_lists=lists), "files").passed == (not moved)
        removed = tmp_path / "removed"
        assert files.remove_strays(small_dataset, [], removed, lists) == moved
        assert check(validate(small_dataset, export_lists=lists), "files").passed
    assert len(list((tmp_path / "removed").rglob("poses.csv"))) == 1


@pytest.mark.parametrize("broken", [NAME, "transforms.json", f"panorama/{NAME}", None])
def test_nothing_is_moved_from_a_dataset_that_cannot_be_read(
    broken: str | None, small_dataset: Path, tmp_path: Path
) -> None:
    add_passes(small_dataset)
    add_panoramas(small_dataset)
    (small_dataset / "stray").touch()
    if broken:
        (small_dataset / broken).write_text("{")
    sets = [] if broken == NAME else ["panorama"]
    moved = files.remove_strays(small_dataset, sets, tmp_path / "removed")
    assert moved == (0 if broken else 1)
    assert (small_dataset / "stray").exists() == bool(broken)


def test_the_program_names_faults_and_publishes_no_checksums(
    dataset: Path, run_program: Any
) -> None:
    (dataset / "sha256sums.txt").write_text("of an earlier validation")
    on_file(truncate)(dataset)
    (dataset / "exr" / "view_0009f.exr").unlink()
    (dataset / "stray").touch()
    result = run(run_program, dataset)
    assert not (dataset / "sha256sums.txt").exists()
    content = json.loads((dataset / "validation.json").read_text())
    assert content["valid"] is False
    assert "Traceback" not in result.stderr
    assert re.search(r"^room/sphere: images: exr/view_0002f.exr: .+$", result.stderr, re.M)
    assert "room/sphere: views: exr/view_0009f.exr: is missing\n" in result.stderr
    assert result.stdout.startswith("room/sphere: INVALID: ")
    published = publish(run_program, dataset)
    assert published.returncode == 1
    assert re.fullmatch(
        r"error: room/sphere is not valid, and so gets no checksums: "
        r"views: exr/view_0009f.exr: is missing; "
        r"images: exr/view_0002f.exr: .+; files: stray: is not a file of this dataset: "
        r"see the page\n",
        published.stderr,
    )
    assert not (dataset / "sha256sums.txt").exists()


# ---- Cycles ---------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def cycles_dataset(tmp_path_factory: pytest.TempPathFactory, run_program: Any) -> Path:
    """A dataset that Cycles renders: thin stalks and leaves, a fence, spheres, a wall, open sky."""
    dataset = tmp_path_factory.mktemp("cycles") / "yard" / "sphere"
    lens = lenses.from_camera({**FISHEYE, "resolution": [96, 96]})
    rig = {**SPHERE, "center": [0, 0, 1.2]}
    LightField.from_rig(rig, lens, depth="z").write(dataset / NAME)
    run_program(CYCLES_ROOM, dataset)
    return dataset


def test_cycles_dataset_is_valid_with_margin(cycles_dataset: Path) -> None:
    result = validate(cycles_dataset)
    assert failed(result) == []
    figures = check(result, "geometry").figures
    assert figures["points"] > 3000
    assert figures["worst_contradiction"] < geometry.CONTRADICTIONS_LIMIT / 3
    assert figures["worst_displacement_pixels"] < geometry.DISPLACEMENT_LIMIT / 2


@pytest.mark.parametrize("change", [move(BAD, (0, 0.05, 0)), turn([BAD], degrees(0, 1))])
def test_cycles_view_off_its_pose_is_named(
    change: Callable[[dict[str, Any]], None], cycles_dataset: Path, tmp_path: Path
) -> None:
    dataset = Path(shutil.copytree(cycles_dataset, tmp_path / "yard" / "sphere"))
    relist(dataset, change)
    assert check(validate(dataset), "geometry").views == [names(dataset)[BAD]]
