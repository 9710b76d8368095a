"""Focal stacks, quilts and epipolar volumes of planes whose points are all known."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter
from sphere import LENSES, make_transparent, write_views

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.export import camera_grid
from lightfield.export.refocus import disc_weights
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS, focal_stack
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.rotations import euler_to_matrix
from lightfield.imaging import images
from lightfield.imaging.tonemap import decode_srgb, encode_srgb
from lightfield.products import exports

CAMERA = {"lens": "rectilinear", "fov": 50, "resolution": [64, 48]}
# No number of a pose is round, and steps across and down differ.
TURN = (10, 20, 30)
CENTRE = (0.3, -0.2, 0.1)
RIG = {
    "type": "plane",
    "cameras": [5, 4],
    "size": [0.4, 1, 0.24],
    "rotation": list(TURN),
    "center": list(CENTRE),
}


def exported(folder, name, tmp_path, suffix=".exr", source="views", **options):
    settings = TypeAdapter(EXPORTERS[name]).validate_python({"sources": [source], **options})
    target = tmp_path / name
    developed = {key: options[key] for key in ("exposure", "reinhard") if key in options}
    views = "" if source == "views" else source
    exports.run(SourceDataset(folder, views, suffix, **developed), settings, target)
    return target


def plane_at(distance, light_of, turn=TURN, centre=CENTRE):
    """Return what a camera sees of an endless plane in front of the rig, parallel to it.

    ``light_of`` returns the light (..., 3) of places right and up of the rig's middle, in metres.
    """
    axes = euler_to_matrix(np.radians(turn))

    def see(lens, world_from_camera):
        rays = lens.pixel_rays() @ world_from_camera[:3, :3].T @ axes
        start = axes.T @ (world_from_camera[:3, 3] - centre)
        # The rig looks along its own +Y.
        length = (distance - start[1]) / rays[..., 1]
        x, _, z = np.moveaxis(start + length[..., np.newaxis] * rays, -1, 0)
        return light_of(x, z), length

    return see


def waves(x, y):
    """Return light that changes smoothly from pixel to pixel."""
    return np.stack(
        [1 + 0.5 * np.sin(9 * x + 2), 1 + 0.5 * np.cos(7 * y + x), 2 + np.sin(8 * x - 5 * y)], -1
    )


def middle_pose():
    """Return the camera-to-world matrix of a camera in the rig's middle, that looks along +Y."""
    pose = np.eye(4)
    pose[:3, :3] = euler_to_matrix(np.radians(TURN)) @ euler_to_matrix(np.array([np.pi / 2, 0, 0]))
    pose[:3, 3] = CENTRE
    return pose


@pytest.mark.parametrize("camera", [CAMERA, LENSES["shifted"]])
def test_a_plane_in_focus_is_what_a_camera_in_the_middle_sees(camera, tmp_path):
    see = plane_at(1.7, waves)
    write_views(tmp_path / "dataset", camera, RIG, see=see)
    options = {"distances": [1.7, 3.4], "format": "exr"}
    folder = exported(tmp_path / "dataset", "focal_stack", tmp_path, **options)
    content = read_json(folder / "focal_stack.json")
    pose = np.array(content["camera"]["world_matrix"])
    np.testing.assert_allclose(pose, middle_pose(), atol=1e-9)
    expected, _ = see(lenses.from_camera(camera), pose)
    entries = [(entry["file"], entry["distance"]) for entry in content["pictures"]]
    assert entries == [("focus_000.exr", 1.7), ("focus_001.exr", 3.4)]
    sharp, blurred = (images.read_image(folder / name).colour for name, _ in entries)
    # Half floats, and the cubic interpolation between pixels.
    inner = np.s_[10:-10, 10:-10]
    assert np.abs(sharp - expected)[inner].max() < 2e-3
    # Linear interpolation, at the rims of the views.
    assert np.abs(sharp - expected).max() < 1e-2
    assert np.abs(blurred - expected)[inner].max() > 0.1
    assert content["camera"]["resolution"] == [64, 48]
    assert sum(content["views"].values()) == pytest.approx(1)
    assert len(content["views"]) == 20


def spread(picture):
    """Return the sum of a picture (height, width), and its middle and variance (x, y) in pixels."""
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    total = picture.sum()
    middle = np.array([(picture * axis).sum() / total for axis in (x, y)])
    variance = [
        (picture * (axis - at) ** 2).sum() / total for axis, at in zip((x, y), middle, strict=True)
    ]
    return total, middle, np.array(variance)


@pytest.mark.parametrize(("distance", "focus"), [(1.5, 6.0), (2.5, 1.0)])
def test_a_point_out_of_focus_spreads_to_the_disc_of_the_aperture(distance, focus, tmp_path):
    camera = {"lens": "rectilinear", "fov": 40, "resolution": [80, 80]}
    rig = {"type": "plane", "cameras": [17, 17], "size": 0.24}
    focal = 40 / math.tan(math.radians(20))
    # A dot that is smooth from pixel to pixel.
    sigma = 1.5 * distance / focal
    dot = plane_at(
        distance,
        lambda x, y: np.exp(-(x**2 + y**2) / (2 * sigma**2))[..., np.newaxis] * [1, 2, 4.0],
        (0, 0, 0),
        (0, 0, 0),
    )
    write_views(tmp_path / "dataset", camera, rig, see=dot)
    aperture = 0.24
    options = {"distances": [distance, focus], "aperture": aperture, "format": "exr"}
    folder = exported(tmp_path / "dataset", "focal_stack", tmp_path, **options)
    sharp, blurred = (
        images.read_image(folder / f"focus_00{n}.exr").colour[..., 2] for n in range(2)
    )
    (light, middle, width), (blurred_light, blurred_middle, blurred_width) = map(
        spread, (sharp, blurred)
    )
    np.testing.assert_allclose([middle, blurred_middle], 40, atol=0.01)
    assert blurred_light == pytest.approx(light, rel=2e-3)
    diameter = aperture * abs(1 / distance - 1 / focus) * focal
    assert diameter > 8
    # The variance of a disc along each axis is a sixteenth of its squared diameter.
    np.testing.assert_allclose(blurred_width - width, diameter**2 / 16, rtol=0.02)
    # The disc is even, and ends at its rim.
    away = np.hypot(*(np.mgrid[:80, :80] + 0.5 - 40))
    inside = blurred[away < diameter / 2 - 4.5]
    assert inside.size > 4
    expected = light / (math.pi * diameter**2 / 4)
    np.testing.assert_allclose(inside, expected, rtol=0.02)
    assert blurred[away > diameter / 2 + 5].max() < 0.01 * expected


def test_without_distances_they_span_the_surfaces_evenly_in_their_inverses(tmp_path):
    def see(lens, world_from_camera):
        near, near_z = plane_at(1.2, waves)(lens, world_from_camera)
        far, far_z = plane_at(6, waves)(lens, world_from_camera)
        left = np.arange(lens.width)[np.newaxis, :] < lens.width / 2
        return np.where(left[..., np.newaxis], near, far), np.where(left, near_z, far_z)

    write_views(tmp_path / "dataset", CAMERA, RIG, see=see)
    folder = exported(tmp_path / "dataset", "focal_stack", tmp_path)
    pictures = read_json(folder / "focal_stack.json")["pictures"]
    distances = [entry["distance"] for entry in pictures]
    np.testing.assert_allclose(1 / np.array(distances), np.linspace(1 / 1.2, 1 / 6, 12), rtol=1e-3)
    assert {path.name for path in folder.glob("*.png")} == {entry["file"] for entry in pictures}


def test_the_mean_is_of_linear_light(tmp_path):
    """Two views of black and white: half of the light, which is not half of an sRGB pixel."""
    rig = {"type": "plane", "cameras": [2, 1], "size": 0.2}
    write_views(tmp_path / "dataset", CAMERA, rig)
    write_views(tmp_path / "dataset/png", CAMERA, rig, ".png")
    for level, view in enumerate(("view_0000f", "view_0001f")):
        light = dict.fromkeys("RGB", np.full((48, 64), level, np.float16))
        images.write_exr(tmp_path / f"dataset/exr/{view}.exr", light)
        pixels = np.full((48, 64, 3), 255 * level, np.uint8)
        images.write_png(tmp_path / f"dataset/png/{view}.png", pixels)
    options = {"distances": [1e6]}
    of_light = exported(tmp_path / "dataset", "focal_stack", tmp_path / "exr", **options)
    as_exr = exported(
        tmp_path / "dataset", "focal_stack", tmp_path / "linear", format="exr", **options
    )
    of_png = exported(
        tmp_path / "dataset", "focal_stack", tmp_path / "png", ".png", "png", **options
    )
    brighter = exported(
        tmp_path / "dataset", "focal_stack", tmp_path / "stops", exposure=1, **options
    )
    inner = np.s_[2:-2, 2:-2]
    np.testing.assert_array_equal(images.read_image(as_exr / "focus_000.exr").colour[inner], 0.5)
    for folder, value in ((of_light, 188), (of_png, 188), (brighter, 255)):
        assert (images.read_image(folder / "focus_000.png").srgb[inner] == value).all()


def test_a_pixel_that_is_no_number_spoils_no_picture(tmp_path, monkeypatch):
    """It is left out. Nor does the picture depend on how many are made at a time."""
    see = plane_at(1.7, waves)
    write_views(tmp_path / "dataset", CAMERA, RIG, see=see)
    options = {"distances": [1.7, 3.4, 2], "format": "exr"}
    right = exported(tmp_path / "dataset", "focal_stack", tmp_path / "right", **options)
    path = tmp_path / "dataset/exr/view_0007f.exr"
    image = images.read_image(path)
    red = image.channels["R"].copy()
    red[20, 30:32] = [np.nan, np.inf]
    images.write_exr(path, image.channels | {"R": red}, image.attributes)
    monkeypatch.setattr(focal_stack, "_MOST_BYTES", 1)
    spoilt = exported(tmp_path / "dataset", "focal_stack", tmp_path / "spoilt", **options)
    for number in range(3):
        name = f"focus_00{number}.exr"
        expected, actual = (images.read_image(f / name).colour for f in (right, spoilt))
        changed = np.abs(actual - expected).max(axis=-1) > 0
        assert 0 < changed.sum() <= 5 * 6
        if number == 0:
            np.testing.assert_allclose(actual, expected, atol=0.01)


def test_transparent_views_keep_their_alpha(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG, see=plane_at(1.7, waves))
    make_transparent(tmp_path / "dataset", 0.25)
    for name in ("exr", "png"):
        options = {"distances": [1.7], "format": name}
        folder = exported(tmp_path / "dataset", "focal_stack", tmp_path / name, **options)
        alpha = images.read_image(folder / f"focus_000.{name}").channels["A"]
        np.testing.assert_allclose(alpha, 0.25 if name == "exr" else 64, rtol=1e-5)


def test_the_aperture_chooses_and_weighs_views():
    rig = {"type": "plane", "cameras": [9, 9], "size": 0.8}
    lens = lenses.from_camera(CAMERA)
    grid = camera_grid.plane_of(LightField.from_rig(rig, lens))
    assert disc_weights(grid, None) == pytest.approx(1 / 81)
    # A disc in one camera's cell.
    alone = disc_weights(grid, 0.05)
    assert (alone > 0).sum() == 1
    assert alone[4, 4] == 1
    weights = disc_weights(grid, 0.5)
    cell = 0.1**2 / (math.pi * 0.25**2)
    np.testing.assert_allclose(weights[4, 2:7], cell * np.array([1, 1, 1, 1, 1]), rtol=0.02)
    # Only one corner of this cell is in the disc.
    assert 0 < weights[2, 2] < cell / 2
    np.testing.assert_array_equal(weights, weights[::-1])
    np.testing.assert_array_equal(weights, weights.T)
    np.testing.assert_array_equal(weights[[0, 1, 7, 8]], 0)


def numbered(number):
    """Return what a camera sees of a plane whose red channel is its place, 100 levels a metre."""
    return plane_at(
        number, lambda x, y: np.stack([0.5 + x, 0.5 + y, 0 * x], -1), (0, 0, 0), (0, 0, 0)
    )


QUILT_RIG = {"type": "plane", "cameras": [6, 3], "size": [0.3, 0, 0.2]}


def tiles_of(path, columns, rows):
    """Return the tiles of a quilt, in the order of Looking Glass: from the lower left."""
    pixels = images.read_image(path).encoded
    height, width = pixels.shape[0] // rows, pixels.shape[1] // columns
    return [
        pixels[(rows - 1 - row) * height : (rows - row) * height, column * width :][:, :width]
        for row in range(rows)
        for column in range(columns)
    ]


def test_a_quilt_has_the_leftmost_view_at_the_lower_left(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, QUILT_RIG, see=numbered(2))
    folder = exported(tmp_path / "dataset", "quilt", tmp_path, focus=1e6, row=0)
    (path,) = folder.glob("*.png")
    # 64 × 48 pixels, less a pixel at each side.
    assert path.name == "quilt_qs3x2a1.292.png"
    tiles = tiles_of(path, 3, 2)
    assert tiles[0].shape == (48, 62, 3)
    for number, tile in enumerate(tiles):
        view = tmp_path / f"dataset/exr/view_{number:04}f.exr"
        expected = encode_srgb(images.read_image(view).colour)[:, 1:-1]
        assert np.abs(tile - expected).max() < 1.5 / 255
    # A camera that is farther to the right sees more of what is to the right.
    assert np.all(np.diff([tile[24, 30, 0] for tile in tiles]) > 0)


def test_the_views_of_a_quilt_agree_at_the_focus_and_lean_elsewhere(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, QUILT_RIG, see=numbered(2))
    folder = exported(tmp_path / "dataset", "quilt", tmp_path, focus=2)
    focal = 32 / math.tan(math.radians(25))
    margin = math.ceil(focal * 0.15 / 2)
    (path,) = folder.glob("*.png")
    tiles = tiles_of(path, 3, 2)
    assert tiles[0].shape == (48, 64 - 2 * margin, 3)
    for tile in tiles[1:]:
        assert np.abs(tile - tiles[0]).max() <= 1 / 255
    nearer = exported(tmp_path / "dataset", "quilt", tmp_path / "nearer", focus=1, tiles=[2, 1])
    left, right = tiles_of(*nearer.glob("*.png"), 2, 1)
    # The place in metres that both show in a pixel: apart by the distance of the outer cameras
    # times 1 − Z / F.
    places = [decode_srgb(tile[24, 20, 0]) for tile in (left, right)]
    assert places[1] - places[0] == pytest.approx(0.3 * (1 - 2 / 1), abs=0.01)


def test_a_quilt_is_cut_to_the_display(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, QUILT_RIG, see=numbered(2))
    folder = exported(tmp_path / "dataset", "quilt", tmp_path, focus=4, aspect=0.75)
    (path,) = folder.glob("*.png")
    assert path.name == "quilt_qs3x2a0.75.png"
    assert tiles_of(path, 3, 2)[0].shape == (48, 36, 3)
    listing = read_json(folder / "export.json")
    # The validation expects pictures of other sizes than the views'.
    assert listing["options"]["sizes"] == [[3 * 36, 2 * 48]]


@pytest.mark.parametrize(
    ("name", "options", "problem"),
    [
        ("quilt", {"focus": 0.05}, "focus: 0.05 m is so near that no pixel is in all views"),
        ("quilt", {"focus": 2, "row": 3}, "has 3 rows of cameras, from 0, but row is 3"),
        ("quilt", {"focus": 2, "tiles": [4, 2]}, "has 6 cameras in a row, and the quilt 8 tiles"),
        ("focal_stack", {"distances": [0.01]}, "distances: 0.01 m is so near that the views show"),
    ],
)
def test_what_a_plane_cannot_show_is_refused(name, options, problem, tmp_path):
    write_views(tmp_path / "dataset", CAMERA, QUILT_RIG)
    with pytest.raises(UserError, match=problem):
        exported(tmp_path / "dataset", name, tmp_path, **options)
    assert not (tmp_path / name).exists()


def test_refocusing_needs_a_plane_of_parallel_cameras(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, {"type": "lattice", "cameras": [2, 2, 2], "size": 1})
    for name, options in (("focal_stack", {}), ("quilt", {"focus": 2})):
        with pytest.raises(UserError, match="are not a grid of cameras in a plane that look in"):
            exported(tmp_path / "dataset", name, tmp_path, **options)


# ---- epipolar volumes -----------------------------------------------------------------------


def volumes(folder):
    return read_json(folder / "epipolar_volumes.json")["volumes"]


def test_the_volume_of_a_plane_has_its_rows_and_columns(tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG, see=plane_at(1.7, waves))
    folder = exported(tmp_path / "dataset", "epipolar_volumes", tmp_path, depth=True)
    (entry,) = volumes(folder)
    volume = np.load(folder / entry["file"], mmap_mode="r")
    depth = np.load(folder / entry["depth"], mmap_mode="r")
    assert entry["axes"] == ["row", "column", "y", "x", "channel"]
    assert (volume.shape, volume.dtype) == ((4, 5, 48, 64, 3), np.float16)
    assert (depth.shape, depth.dtype) == ((4, 5, 48, 64), np.float32)
    lightfield = LightField.read(tmp_path / "dataset/lightfield.json")
    for number, view in enumerate(lightfield.views):
        row, column = divmod(number, 5)
        assert entry["views"][row][column] == view.name
        np.testing.assert_array_equal(entry["positions"][row][column], view.position)
        image = images.read_image(tmp_path / f"dataset/exr/{view.name}.exr")
        np.testing.assert_array_equal(volume[row, column], image.colour.astype(np.float16))
        np.testing.assert_allclose(depth[row, column], image.channels["Z"], rtol=1e-6)
    # A slice is an epipolar-plane image: a surface at Z leans by b f / Z pixels from row to row.
    step = 0.1 * 32 / math.tan(math.radians(25)) / 1.7
    image = volume[2, :, 20, :, 0].astype(float)
    x = np.arange(20.0, 40)
    for column in range(5):
        moved = np.interp(x - column * step, np.arange(64), image[column])
        np.testing.assert_allclose(moved, image[0, 20:40], atol=2e-2)


def test_the_volumes_of_pictures_have_their_pixels(tmp_path):
    write_views(tmp_path / "dataset/png", CAMERA, RIG, ".png")
    folder = exported(tmp_path / "dataset", "epipolar_volumes", tmp_path, ".png", "png")
    content = read_json(folder / "epipolar_volumes.json")
    assert (content["channels"], content["colour"], content["depth"]) == ("RGBA", "sRGB", None)
    volume = np.load(folder / "volume_0.npy")
    assert (volume.shape, volume.dtype) == ((4, 5, 48, 64, 4), np.uint8)
    channels = images.read_image(tmp_path / "dataset/png/view_0007f.png").channels
    np.testing.assert_array_equal(volume[1, 2], np.stack([channels[c] for c in "RGBA"], -1))


@pytest.mark.parametrize(
    ("rig", "shapes"),
    [
        (
            {"type": "cuboid", "cameras": [3, 4, 2], "size": 1},
            {(2, 3): 2, (2, 4): 2, (4, 3): 2},
        ),
        ({"type": "cylinder", "cameras": [5, 3], "size": 1}, {(3, 5): 1}),
        ({"type": "lattice", "cameras": [4, 2, 3], "size": 1}, {(2, 3, 4): 1}),
        ({"type": "sphere", "subdivisions": 1, "size": 1}, {(12,): 1}),
        ({"type": "ring", "count": 7, "size": 1}, {(7,): 1}),
        ({"type": "plane", "cameras": [1, 6], "size": 1}, {(6, 1): 1}),
    ],
)
def test_every_rig_has_volumes_with_each_view_once(rig, shapes, tmp_path):
    write_views(tmp_path / "dataset", {**CAMERA, "resolution": [8, 6]}, rig)
    folder = exported(tmp_path / "dataset", "epipolar_volumes", tmp_path)
    entries = volumes(folder)
    found = [np.load(folder / entry["file"]).shape for entry in entries]
    assert {shape[:-3]: found.count(shape) for shape in found} == shapes
    names = [name for entry in entries for name in np.ravel(entry["views"])]
    views = LightField.read(tmp_path / "dataset/lightfield.json").views
    assert sorted(names) == sorted(view.name for view in views)
    places = {view.name: view.position for view in views}
    for entry in entries:
        positions = np.reshape(entry["positions"], (-1, 3))
        for name, position in zip(np.ravel(entry["views"]), positions, strict=True):
            np.testing.assert_array_equal(position, places[name])
