"""Lens maps: geometry compared with closed forms, and the file."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.reprojection import lens_map
from lightfield.reprojection.fold import Fold

FISHEYE = Equidistant(width=101, height=101, fov=math.pi)
IDENTITY = np.eye(3)


def rectilinear(size: int, focal_length: float = 18) -> Rectilinear:
    return Rectilinear(width=size, height=size, focal_length=focal_length, sensor_size=(36, 36))


def full_centers(made):
    return made.centers + np.array([made.window[2], made.window[0]])


@pytest.mark.parametrize(
    ("angles", "forward", "up"),
    [
        ((90, 0, 0), (-1, 0, 0), (0, 1, 0)),  # left
        ((0, 90, 0), (0, -1, 0), (0, 0, -1)),  # down
        ((0, 0, 90), (0, 0, -1), (1, 0, 0)),  # clockwise: the camera's up points right
    ],
)
def test_rotations_turn_left_down_and_clockwise(angles, forward, up):
    matrix = lens_map.rotation_matrix(*angles)
    assert np.allclose(matrix @ [0, 0, -1], forward, atol=1e-12)
    assert np.allclose(matrix @ [0, 1, 0], up, atol=1e-12)


def test_rotation_is_the_published_tools():
    # R_y(pan) R_x(pitch) R_z(roll), in a frame with Y down.
    pan, pitch, roll = 31.0, -17.0, 58.0
    published = Rotation.from_euler("YXZ", [pan, pitch, roll], degrees=True).as_matrix()
    flip = np.diag([1, -1, 1])
    assert np.allclose(lens_map.rotation_matrix(pan, pitch, roll), flip @ published @ flip)


def test_a_pixel_of_a_perspective_view_finds_its_place_in_the_fisheye():
    made = lens_map.compute(FISHEYE, rectilinear(64), IDENTITY)
    centers = full_centers(made)
    for column, row in ((0, 0), (40, 7), (63, 32)):
        x, y = (column + 0.5 - 32) / 32, (row + 0.5 - 32) / 32  # half the width
        angle = math.atan(math.hypot(x, y))
        radius = angle / (math.pi / 2) * 50.5 / math.hypot(x, y)
        assert np.allclose(centers[row, column], [50.5 + radius * x, 50.5 + radius * y], atol=1e-4)
    assert np.allclose(made.target_cos[7, 40], math.cos(math.atan(math.hypot(8.5, 24.5) / 32)))


def test_a_lens_maps_onto_itself():
    made = lens_map.compute(FISHEYE, FISHEYE, IDENTITY)
    x, y = np.meshgrid(np.arange(101) + 0.5, np.arange(101) + 0.5)
    inside = np.hypot(x - 50.5, y - 50.5) <= 50.5
    seen = ~np.isnan(made.centers[..., 0])
    assert np.array_equal(seen, inside)
    assert made.summary["covered"] == pytest.approx(inside.mean())
    assert np.abs(full_centers(made) - np.stack([x, y], axis=-1))[seen].max() < 1e-4
    for name in ("min", "median", "max"):
        assert made.summary[name] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        (200, "upsampling: up to 2 target pixels to one of the source (median 2)"),
        (160, "upsampling: up to 1.6 "),
        (140, None),
        (75, None),
        (60, "aliasing: one target pixel spans up to 1.67 of the source's"),
        (30, "--samples 4 helps"),
    ],
)
def test_the_magnification_of_a_change_of_size(size, expected):
    made = lens_map.compute(rectilinear(100), rectilinear(size), IDENTITY, "bicubic")
    assert made.summary == pytest.approx(
        {"min": size / 100, "median": size / 100, "max": size / 100, "covered": 1.0}, rel=1e-5
    )
    warnings = lens_map.warnings(made)
    assert len(warnings) == (expected is not None)
    assert expected is None or expected in warnings[0]


def test_several_targets_are_reported_as_one(capsys):
    targets = [rectilinear(160), rectilinear(120), rectilinear(100)]
    away = lens_map.rotation_matrix(180, 0, 0)
    rotations = [IDENTITY, IDENTITY, away]
    maps = [
        lens_map.compute(rectilinear(100), target, rotation, "bicubic")
        for target, rotation in zip(targets, rotations, strict=True)
    ]
    lens_map.report(maps)
    said = capsys.readouterr().err.splitlines()
    assert said[0] == (
        "magnification: 1.2 to 1.6, median 1.4 target pixels to one of the source; "
        "66.7% of the image has a source"
    )
    assert [line.split(":")[1] for line in said[1:]] == [" upsampling"]
    lens_map.report(maps[2:])
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("magnification: 0 to 0, median 0 ")
    assert said[1:] == ["warning: the source sees nothing of the target image"]


def test_a_filter_that_covers_the_pixel_gives_no_warning_of_aliasing():
    for name, samples in (("adaptive", 1), ("bicubic", 4)):
        made = lens_map.compute(rectilinear(128), rectilinear(32), IDENTITY, name, samples)
        assert lens_map.warnings(made) == []


def test_sources_continue_beyond_their_borders():
    def topology(lens):
        return lens_map.compute(lens, rectilinear(4), IDENTITY).topology

    low = Equirectangular(width=64, height=16, latitude=(-math.pi / 2, 0))
    slice_ = Equirectangular(width=64, height=32, longitude=(-1, 1))
    high_slice = Equirectangular(width=64, height=1024, longitude=(-1, 1))
    assert topology(Equirectangular(width=64, height=32)) == (True, True, True)
    assert topology(low) == (True, False, True)
    assert topology(slice_) == topology(high_slice) == (False, False, False)
    assert topology(FISHEYE) == (False, False, False)
    assert topology(CubeMap(width=96, height=16)) == (False, False, False)
    telescope = Rectilinear(width=64, height=64, focal_length=1e6, sensor_size=(5, 5))
    assert topology(telescope) == (False, False, False)


def test_the_window_holds_all_that_is_read_and_little_more():
    made = lens_map.compute(
        Equidistant(width=400, height=400, fov=math.pi), rectilinear(50), IDENTITY, "bicubic"
    )
    # 90 degrees of 180, and the kernel's reach.
    assert made.window == pytest.approx((100, 300, 100, 300), abs=6)
    assert made.source_cos.shape == (
        made.window[1] - made.window[0],
        made.window[3] - made.window[2],
    )


def test_pixels_without_a_source_are_marked():
    away = lens_map.rotation_matrix(180, 0, 0)
    made = lens_map.compute(FISHEYE, rectilinear(16), away)
    assert not made.flags.any() and np.isnan(made.centers).all()
    assert made.summary == dict.fromkeys(("min", "median", "max", "covered"), 0)
    assert "sees nothing" in lens_map.warnings(made)[0]


@pytest.mark.parametrize("size", [1, 2, 3, 7])
@pytest.mark.parametrize("name", ["bicubic", "adaptive"])
def test_the_smallest_images(size, name):
    made = lens_map.compute(FISHEYE, rectilinear(size), IDENTITY, name)
    assert made.summary["covered"] == 1
    assert 0 < made.summary["min"] <= made.summary["max"] < 100
    fisheye = Equidistant(width=size, height=size, fov=2)
    assert lens_map.compute(fisheye, rectilinear(9), IDENTITY).centers.shape == (9, 9, 2)
    made = lens_map.compute(FISHEYE, fisheye, IDENTITY, name)
    assert made.summary["covered"] == np.isfinite(fisheye.pixel_rays()[..., 0]).mean()
    assert not any("nothing" in warning for warning in lens_map.warnings(made))


@pytest.mark.parametrize(("name", "samples"), [("adaptive", 1), ("bicubic", 3), ("nearest", 1)])
def test_a_saved_map_is_read_back(tmp_path, name, samples):
    path = tmp_path / "map.npy"
    made = lens_map.compute(
        FISHEYE, rectilinear(20), lens_map.rotation_matrix(10, 0, 0), name, samples
    )
    lens_map.save(path, made)
    loaded = lens_map.load(path)
    assert loaded.settings == made.settings and loaded.summary == made.summary
    assert loaded.window == made.window
    for key, value in vars(made).items():
        if isinstance(value, np.ndarray):
            array = getattr(loaded, key)
            assert np.array_equal(array, value, equal_nan=True), key
            assert isinstance(array, np.memmap) and array.flags.aligned, key
    first = path.read_bytes()
    for again in (path, tmp_path / "of another name"):
        lens_map.save(again, made)
        assert again.read_bytes() == first


@pytest.mark.parametrize("target", [rectilinear(20), rectilinear(21), rectilinear(1)])
@pytest.mark.parametrize("angles", [(0, 0, 0), (90, 0, 0), (0, -40, 0), (180, 0, 0)])
@pytest.mark.parametrize("source", [FISHEYE, Equirectangular(width=512, height=256)])
def test_a_mirrored_map_equals_one_computed_completely(monkeypatch, source, target, angles):
    rotation = lens_map.rotation_matrix(*angles)
    assert any(Fold.of_map(source, target, rotation).mirrors)
    folded = lens_map.compute(source, target, rotation)
    top, bottom, left, right = folded.window
    cosines = -source.pixel_rays()[top:bottom, left:right, 2]
    np.testing.assert_allclose(folded.source_cos, cosines, atol=1e-6)
    np.testing.assert_allclose(folded.target_cos, -target.pixel_rays()[..., 2], atol=1e-6)
    monkeypatch.setattr(Fold, "of_map", lambda *_: Fold((target.height, target.width)))
    complete = lens_map.compute(source, target, rotation)
    assert folded.window == complete.window and folded.summary == pytest.approx(complete.summary)
    for name, array in vars(complete).items():
        if isinstance(array, np.ndarray):
            computed_array = getattr(folded, name)
            assert np.allclose(computed_array, array, rtol=0, atol=1e-6, equal_nan=True), name


@pytest.mark.parametrize("name", ["nearest", "bicubic"])
def test_a_cube_maps_faces_continue_beyond_their_borders(name):
    cube = CubeMap(width=6 * 16, height=16)
    made = lens_map.compute(cube, rectilinear(20), lens_map.rotation_matrix(40, 30, 0), name)
    side = made.strip.shape[0]
    border = (side - 16) // 2
    assert border >= 2 and made.strip.shape == (side, 6 * side, 2)
    assert made.source_cos.shape == made.strip.shape[:2]
    places = np.arange(side) + 0.5 - border
    ahead = cube.face.rays(places[None, :], places[:, None])
    edge = -ahead[..., 2][np.ix_(*[np.arange(side).clip(border, side - border - 1)] * 2)]
    for index, turn in enumerate(CUBE_FACES.values()):
        columns = slice(index * side, (index + 1) * side)
        # The place in the strip without borders that has the ray of a pixel in this face's plane.
        rays_of_cube = cube.rays(*np.moveaxis(made.strip[:, columns].astype(float), -1, 0))
        np.testing.assert_allclose(rays_of_cube, ahead @ turn.T, atol=1e-5)
        np.testing.assert_allclose(made.source_cos[:, columns], edge, atol=1e-6)
    # A map's coordinates count in the strip with borders.
    rays = rectilinear(20).pixel_rays() @ lens_map.rotation_matrix(40, 30, 0).T
    face = made.centers[..., 0] // side
    plain = made.centers - np.stack([(2 * face + 1) * border, border + 0 * face], axis=-1)
    np.testing.assert_allclose(cube.rays(*np.moveaxis(plain.astype(float), -1, 0)), rays, atol=1e-5)


def test_the_magnification_of_a_cube_map_is_that_of_its_faces_across_their_borders():
    # It is (cos θ of the source / cos θ of the target)^1.5, with its least value at the seam ahead.
    cube = CubeMap(width=6 * 64, height=64)
    made = lens_map.compute(cube, rectilinear(64), lens_map.rotation_matrix(45, 0, 0), "bicubic")
    assert made.summary["min"] == pytest.approx(2**-0.75, rel=0.03)
    assert made.summary["max"] == pytest.approx(2**0.75, rel=0.03)


@pytest.mark.parametrize(("size", "most"), [(100, None), (60, 2), (20, 4)])
def test_the_adaptive_filter_has_footprints_if_it_takes_several_samples(size, most):
    made = lens_map.compute(rectilinear(100), rectilinear(size), IDENTITY, "adaptive")
    if most is None:
        assert made.counts is None and made.footprints is None
    else:
        assert (made.counts == most).all()
        assert made.footprints.shape == (size, size, 2, 2)


@pytest.mark.parametrize("source", [FISHEYE, CubeMap(width=6 * 64, height=64), rectilinear(64, 36)])
def test_samples_are_the_pixels_of_a_finer_target(source):
    rotation = lens_map.rotation_matrix(20, 30, 0)
    made = lens_map.compute(source, rectilinear(20), rotation, "bicubic", 3)
    finer = lens_map.compute(source, rectilinear(60), rotation, "bicubic")
    assert made.coordinates.shape == (60, 60, 2) and made.centers.shape == (20, 20, 2)
    np.testing.assert_allclose(made.centers, made.coordinates[1::3, 1::3], atol=1e-4)
    corners = [
        np.array([computed_map.window[2], computed_map.window[0]]) for computed_map in (made, finer)
    ]
    np.testing.assert_allclose(
        made.coordinates + corners[0], finer.coordinates + corners[1], atol=1e-4
    )


@pytest.mark.parametrize(
    ("name", "reach"), [("nearest", 0), ("bilinear", 1), ("bicubic", 2), ("lanczos", 3)]
)
def test_a_window_reaches_as_far_as_its_filter(name, reach):
    # Half of the tangents: the pixels from 25.25 to 74.75 of 100.
    made = lens_map.compute(rectilinear(100), rectilinear(100, 36), IDENTITY, name)
    top, bottom, left, right = made.window
    assert (top, bottom) == (left, right) == (100 - bottom, 100 - top)
    assert 25 - reach - 2 <= top <= 25 - reach
    assert np.isfinite(made.source_cos).all() and made.source_cos.shape == (bottom - top,) * 2


def test_a_map_without_mirror_symmetry_is_computed_completely():
    lens, cube = rectilinear(20), CubeMap(width=96, height=16)
    shifted = Rectilinear(width=20, height=20, focal_length=18, principal_point=(9, 10))
    turned = lens_map.rotation_matrix(10, 20, 30)
    assert Fold.of_map(FISHEYE, lens, turned).mirrors == (False, False)
    assert Fold.of_map(FISHEYE, shifted, IDENTITY).mirrors == (True, False)
    assert Fold.of_map(cube, lens, IDENTITY).mirrors == (False, False)


def test_a_file_with_other_arrays_is_refused_and_may_be_deleted(tmp_path):
    path = tmp_path / "map.npy"
    made = lens_map.compute(FISHEYE, rectilinear(4), IDENTITY)
    # This array is written like the others.
    object.__setattr__(made, "magnification", made.target_cos)
    lens_map.save(path, made)
    assert "magnification" in np.load(path).dtype.names
    with pytest.raises(UserError, match=r"map\.npy: is not a lens map .* delete it"):
        lens_map.load(path)


def test_maps_of_other_lenses_rotations_filters_or_samples_have_other_settings():
    asked = (FISHEYE, rectilinear(20), IDENTITY, "bicubic", 1)
    others = (rectilinear(9), rectilinear(21), -IDENTITY, "nearest", 2)
    other_settings = [asked, *(asked[:i] + others[i : i + 1] + asked[i + 1 :] for i in range(5))]
    settings = [json.dumps(lens_map.settings(*arguments)) for arguments in other_settings]
    assert len(set(settings)) == 6
    assert lens_map.compute(*asked).settings == lens_map.settings(*asked)


def test_any_other_file_is_refused(tmp_path):
    path = tmp_path / "map.npy"
    for content in (b"", b"no map", np.arange(3).tobytes()):
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"map\.npy: is not a lens map"):
            lens_map.load(path)
    np.save(path, np.arange(3))
    with pytest.raises(UserError, match="is not a lens map"):
        lens_map.load(path)


def test_a_changed_number_is_found(tmp_path):
    path = tmp_path / "map.npy"
    made = lens_map.compute(FISHEYE, rectilinear(20), IDENTITY)
    lens_map.save(path, made)
    content = path.read_bytes()
    first = content.index(made.centers.tobytes())
    for place in (first, first + made.centers.nbytes // 2, len(content) - 1):
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with pytest.raises(UserError, match=r"map\.npy: is not .*: it is damaged: its checksum"):
            lens_map.load(path)


def test_senseless_settings_are_refused():
    with pytest.raises(UserError, match="samples"):
        lens_map.compute(FISHEYE, rectilinear(4), IDENTITY, "bicubic", 0)
    with pytest.raises(UserError, match="covers the whole pixel"):
        lens_map.compute(FISHEYE, rectilinear(4), IDENTITY, "adaptive", 2)
    with pytest.raises(UserError, match="'cubic' is not one of"):
        lens_map.compute(FISHEYE, rectilinear(4), IDENTITY, "cubic")
