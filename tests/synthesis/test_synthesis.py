"""Synthesised views, compared with a scene whose points are all known: a ball inside a sphere."""

import csv
import json
import re
import shutil
import subprocess

import cv2
import numpy as np
import pytest
import yaml
from scipy.ndimage import binary_dilation, binary_erosion
from sphere import look, look_at_ball, write_views

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import PARTS_OF_LIGHT, PASSES
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.imaging.video import video
from lightfield.measurement import summaries, synthesis_quality
from lightfield.reading.dataset import OpenDataset
from lightfield.report import tables
from lightfield.synthesis.view import Sources, Synthesised

FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [96, 96]}
RIG = {"type": "sphere", "subdivisions": 2, "size": 1.0}
# The eye is off the centre, and looks along +Y.
EYE = np.array([[1, 0, 0, 0.2], [0, 0, -1, -0.1], [0, 1, 0, 0.1], [0, 0, 0, 1.0]])
EYES = {
    "perspective": {"lens": "rectilinear", "fov": 70, "resolution": [80, 64]},
    "fisheye": {"lens": "equidistant", "fov": 200, "resolution": [72, 72]},
    "panorama": {"lens": "equirectangular", "resolution": [128, 64]},
}


def sources(see, camera=FISHEYE, rig=RIG):
    lens = lenses.from_camera(camera)
    return Sources(
        lens, LightField.from_rig(rig, lens).views, lambda view: see(lens, view.world_from_camera)
    )


def errors(made, see, lens, matrix=EYE):
    """Return the differences in sRGB and the relative ones in distance of all pixels with both."""
    colour, distance = see(lens, matrix)
    seen = np.isfinite(distance) & ~made.holes
    difference = encode_srgb(made.colour[seen]) - encode_srgb(colour[seen])
    return difference, made.distance[seen] / distance[seen] - 1


@pytest.mark.slow
@pytest.mark.parametrize("name", EYES)
def test_a_view_between_the_cameras_shows_the_scene(name):
    lens = lenses.from_camera(EYES[name])
    made = sources(look).synthesise(EYE, lens, 12)
    colour, distance = errors(made, look, lens)
    # At the rim, the lens does not see a triangle's outer corner.
    outside = np.isnan(lens.pixel_rays()[..., 0])
    rim = binary_dilation(np.pad(outside, 1, constant_values=name == "fisheye"), np.ones((3, 3)))
    assert not (made.holes & ~rim[1:-1, 1:-1]).any()
    assert np.sqrt((colour**2).mean()) < 0.005
    assert np.abs(distance).max() < 0.005
    assert np.isnan(made.colour[outside]).all()


def test_surfaces_tear_where_depth_jumps():
    lens = lenses.from_camera(EYES["perspective"])
    made = sources(look_at_ball).synthesise(EYE, lens)
    colour, distance = errors(made, look_at_ball, lens)
    assert made.hole_fraction(lens.pixel_rays()) < 0.02
    # A pixel or two of the silhouette are on its other side. None is between ball and sphere.
    assert (np.abs(distance) > 0.02).mean() < 0.05
    between = (made.distance > 2.0) & (made.distance < 2.4)
    assert not between.any()
    assert np.median(np.abs(colour)) < 0.005


def panel_before_wall(lens, matrix):
    """Return what cameras along +Y see of a red panel at y = 2, and of a wall 0.3 m behind it."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    panel = 2.0 - matrix[1, 3]
    plane = panel if panel > 0 else panel + 0.3
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[..., 1] > 0, plane / rays[..., 1], np.inf)
    colour = np.zeros((*distance.shape, 3)) + ([0.8, 0, 0] if panel > 0 else [0, 0.8, 0])
    return colour, np.where(np.isnan(rays[..., 0]), np.nan, distance)


def views_along_y(places):
    """Return views that look along +Y, at places on that axis."""
    views = []
    for number, y in enumerate(places):
        matrix = EYE.copy()
        matrix[:3, 3] = (0, y, 0)
        views.append(View.placed(f"view_{number:04}f", matrix))
    return views


def test_the_view_nearest_to_the_surface_counts_most():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [48, 48]})
    views = views_along_y([0.0, -6.0])

    def wall(view):
        """A wall at y = 2, which the first view sees in red and the other in green."""
        distance = (2 - view.world_from_camera[1, 3]) / -lens.pixel_rays()[..., 2]
        return np.full((48, 48, 3), [0.8, 0, 0] if view is views[0] else [0, 0.8, 0]), distance

    field = Sources(lens, views, wall)
    (target,) = (view.world_from_camera for view in views_along_y([-2.0]))
    made = field.blended(target, lenses.from_camera(EYES["perspective"] | {"fov": 20}), [0, 1])
    middle = made.colour[30:34, 38:42]
    assert (middle[..., 0] > 10 * middle[..., 1]).all()


def test_a_view_from_farther_away_than_the_eye_counts_little():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [48, 48]})
    views = views_along_y([-2.0, -6.0])

    def wall(view):
        """A wall at y = 2, which is brighter in the first view, from the eye's place."""
        distance = (2 - view.world_from_camera[1, 3]) / -lens.pixel_rays()[..., 2]
        return np.full((48, 48, 3), 0.8 if view is views[0] else 0.2), distance

    made = Sources(lens, views, wall).blended(views[0].world_from_camera, lens, [0, 1])
    assert (made.colour[20:28, 20:28] > 0.7).all()


def test_the_colour_of_an_edge_counts_a_quarter_of_a_surfaces():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [48, 48]})
    views = views_along_y([0.0, 0.0])
    edge_column = 23

    def edge(view):
        """One view sees a grey wall. For the other it ends with a brighter column."""
        depth = np.full((48, 48), 2.0)
        colour = np.full((48, 48, 3), 0.4)
        if view is views[0]:
            depth[:, edge_column + 1 :] = 4
            colour[:, edge_column] = 0.8
        return colour, depth / -lens.pixel_rays()[..., 2]

    made = Sources(lens, views, edge).blended(views[0].world_from_camera, lens, [0, 1])
    # The harmonic mean of square roots. Equal weights would give 0.55.
    expected = (1 / (0.2 / 0.8**0.5 + 0.8 / 0.4**0.5)) ** 2
    assert made.colour[8:40, edge_column] == pytest.approx(expected, abs=0.03)


def test_the_colour_of_an_edge_counts_only_without_other_views():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [48, 48]})
    views = views_along_y([0.0, 0.0])
    green_column = 23

    def edge(view):
        """One view sees a red wall. For the other it ends, and its last pixels are green."""
        depth = np.full((48, 48), 2.0)
        colour = np.full((48, 48, 3), [0.8, 0, 0])
        if view is views[0]:
            depth[:, green_column + 1 :] = 4
            colour[:, green_column] = [0, 0.8, 0]
        return colour, depth / -lens.pixel_rays()[..., 2]

    field = Sources(lens, views, edge)
    alone = field.blended(views[0].world_from_camera, lens, [0]).colour[8:40, green_column]
    assert (alone[:, 1] > 0.6).all()
    # Inside the pixel colours blend towards its neighbour on the wall, which is red.
    assert (alone[:, 1] > 10 * alone[:, 0]).all()
    both = field.blended(views[0].world_from_camera, lens, [0, 1]).colour[8:40, green_column]
    # The harmonic mean darkens where views disagree, but the wall shows.
    assert (both[:, 0] > 100 * both[:, 1]).all()
    assert (both[:, 0] > 0.02).all()


def test_a_single_leaf_is_a_soft_splat():
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [48, 48]})

    def leaf(view):
        """A white leaf, a pixel wide, before a black wall."""
        depth = np.full((48, 48), 4.0)
        colour = np.zeros((48, 48, 3))
        depth[24, 24] = 2
        colour[24, 24] = 1
        return colour, depth / -lens.pixel_rays()[..., 2]

    views = views_along_y([0.0])
    made = Sources(lens, views, leaf).blended(
        views[0].world_from_camera, lens.resized(768, 768), [0]
    )
    assert not made.holes[300:500, 300:500].any()
    # From the leaf's middle, at 392, its footprint reaches 8 pixels in each direction.
    light = made.colour[..., 0]
    assert light[390:394, 390:394].mean() > 0.95
    for edge in (light[391:393, 396:404], light[380:388, 391:393]):
        assert 0.3 < edge.mean() < 0.8
    # It fades beyond its edges, and its corners are round.
    assert 0.1 < light[391:393, 400:404].mean() < 0.5
    assert light[398:400, 398:400].mean() < 0.6
    for outside in (light[391:393, 406:408], light[376:378, 391:393], light[400:402, 400:402]):
        assert outside.mean() < 0.1


def test_a_panorama_has_no_seam_where_a_leaf_is_drawn():
    """Leaves look alike in the middle of a panorama, and across its left and right edge."""
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [49, 49]})

    def leaves(view):
        """White leaves, a pixel wide, before a black wall."""
        depth = np.full((49, 49), 4.0)
        colour = np.zeros((49, 49, 3))
        for row in (12, 24, 36):
            depth[row, 24] = 2
            colour[row, 24] = 1
        return colour, depth / -lens.pixel_rays()[..., 2]

    (view,) = views_along_y([0.0])
    field = Sources(lens, [view], leaves)
    panorama = lenses.from_camera({"lens": "equirectangular", "resolution": [512, 256]})
    in_front = view.world_from_camera
    behind = in_front @ np.diag([-1, 1, -1, 1])
    middle, seam = (field.blended(matrix, panorama, [0]) for matrix in (in_front, behind))
    # Each leaf covers at least one pixel.
    assert (middle.colour[..., 0] > 0.9).sum() >= 3
    np.testing.assert_allclose(seam.colour, np.roll(middle.colour, 256, axis=1), atol=1e-3)
    np.testing.assert_array_equal(seam.holes, np.roll(middle.holes, 256, axis=1))


def test_a_wall_does_not_shine_through_a_panel_close_in_front():
    lens = lenses.from_camera(FISHEYE | {"fov": 120})
    # The second camera stands between the panel and the wall, and sees the wall alone.
    views = views_along_y([0.0, 2.1])
    field = Sources(lens, views, lambda view: panel_before_wall(lens, view.world_from_camera))
    target = lenses.from_camera({"lens": "rectilinear", "fov": 30, "resolution": [48, 48]})
    made = field.blended(field.world_from_cameras[0], target, [0, 1])
    assert not made.holes.any()
    np.testing.assert_allclose(made.colour[..., 0], 0.8, atol=1e-3)
    np.testing.assert_allclose(made.colour[..., 1:], 0, atol=1e-6)
    np.testing.assert_allclose(made.distance * -target.pixel_rays()[..., 2], 2, rtol=1e-3)


def test_pixels_that_no_view_sees_are_holes():
    single_camera = {"type": "plane", "cameras": [1, 1], "size": 0}
    made = sources(look_at_ball, rig=single_camera).synthesise(
        EYE, lenses.from_camera(EYES["panorama"])
    )
    lens = lenses.from_camera(EYES["panorama"])
    colour, _ = errors(made, look_at_ball, lens)
    # A single fisheye of 180 degrees sees half. The part behind the ball is a hole too.
    assert 0.4 < made.hole_fraction(lens.pixel_rays()) < 0.6
    assert np.median(np.abs(colour)) < 0.01


@pytest.mark.parametrize("times", [1, 256])
def test_a_view_at_a_cameras_place_equals_the_cameras_view(times):
    field = sources(look_at_ball)
    made = field.blended(field.world_from_cameras[3], field.lens, [3] * times)
    colour, distance = look_at_ball(field.lens, field.world_from_cameras[3])
    torn = binary_dilation(field.surface(3).torn, np.ones((3, 3)))
    # At the rim, not all samples of a pixel are seen.
    inside = binary_erosion(np.isfinite(field.rays[..., 0]), np.ones((3, 3)))
    amid = inside & ~torn & ~made.holes
    assert amid.mean() > 0.6
    # The difference is less than half an 8-bit step.
    difference = encode_srgb(made.colour[amid]) - encode_srgb(colour[amid])
    assert np.abs(difference).max() < 0.5 / 255
    np.testing.assert_allclose(made.distance[amid], distance[amid], rtol=1e-4)


def test_the_mixed_colours_beside_a_tear_are_not_sharpened():
    field = sources(look_at_ball)
    surface = field.surface(3)
    colour, _ = look_at_ball(field.lens, field.world_from_cameras[3])
    roots = np.sqrt(np.nan_to_num(colour))
    np.testing.assert_allclose(surface.shade[surface.torn][:, :3], roots[surface.torn], atol=1e-6)
    # All other colours are, a little, because they are smooth.
    others = np.abs(surface.shade[..., :3] - roots)[~surface.torn & np.isfinite(surface.inverse)]
    assert others.max() > 0.001


def test_a_view_from_a_cameras_place_has_no_holes():
    field = sources(look_at_ball)
    made = field.blended(field.world_from_cameras[3], field.lens, [3])
    # At the rim, the lens does not see a triangle's outer corner.
    seen = binary_erosion(np.isfinite(field.rays[..., 0]), np.ones((3, 3)), 2)
    assert not made.holes[seen].any()


def test_a_single_near_pixel_leaves_no_gap_around_it():
    # The wall's diagonal neighbours of a near pixel have no triangle towards it.
    def see(lens, matrix):
        colour, distance = look(lens, matrix)
        distance[30:60:6, 30:60:6] = 0.5
        return colour, distance

    field = sources(see)
    made = field.blended(field.world_from_cameras[3], field.lens, [3])
    assert not made.holes[28:62, 28:62].any()


def test_holes_are_filled_mostly_from_the_background():
    def see(lens, matrix):
        """A blue wall, and a red strip in front of its middle."""
        x = np.linspace(-1, 1, lens.width)
        strip = np.broadcast_to(np.abs(x) < 0.2, (lens.height, lens.width))
        ahead = -lens.pixel_rays()[..., 2]
        return np.where(strip[..., None], [0.8, 0, 0], [0, 0, 0.8]), np.where(strip, 1, 3) / ahead

    camera = {"lens": "rectilinear", "fov": 90, "resolution": [64, 64]}
    field = sources(see, camera, {"type": "plane", "cameras": [1, 1], "size": 0})
    beside = field.world_from_cameras[0].copy()
    beside[:3, 3] += 0.4 * beside[:3, 0]
    made = field.synthesise(beside, field.lens)
    middle = made.holes[32]
    assert middle[:48].sum() > 4
    row = made.colour[32, :48][middle[:48]]
    # The filling is between strip and wall, and closer to the wall.
    assert row[:, 2].mean() > 1.5 * row[:, 0].mean()
    assert row[-1, 2] > 5 * row[-1, 0] or row[0, 2] > 5 * row[0, 0]
    channels = made.channels("z", field.rays)
    assert (channels["A"][32][middle] == 0).all()
    assert np.isnan(channels["Z"][32][middle]).all()
    # Without a background, unseen pixels most likely show nothing.
    field.fills_holes = False
    black = field.synthesise(beside, field.lens)
    assert (black.holes == made.holes).all()
    assert (black.colour[made.holes] == 0).all()
    np.testing.assert_array_equal(black.colour[~made.holes], made.colour[~made.holes])


def test_a_highlight_that_one_view_sees_counts_little():
    rig = {"type": "plane", "cameras": [3, 1], "size": 0.2}

    def see(lens, matrix):
        colour, distance = look(lens, matrix)
        return (50 * colour if matrix[0, 3] < -0.05 else colour), distance

    target = sources(look, FISHEYE, rig).world_from_cameras[1]
    lens = lenses.from_camera(EYES["perspective"])
    made = sources(see, FISHEYE, rig).blended(target, lens, [0, 1, 2])
    colour, _ = look(lens, target)
    # In the mean it would be ten times as bright.
    assert np.median(made.colour / colour) < 2


def test_a_slanted_plane_does_not_tear():
    field = sources(look)
    surface = field.surface(0)
    seen = np.isfinite(surface.inverse)
    assert (surface.torn[1:-1, 1:-1] & seen[1:-1, 1:-1]).mean() < 0.05


def test_the_best_views_look_where_the_eye_does():
    field = sources(look)
    for index in field.best(EYE, lenses.from_camera(EYES["perspective"]), 4):
        ahead = -field.world_from_cameras[index, :3, 2]
        assert ahead @ -EYE[:3, 2] > 0.4
    assert len(set(field.best(EYE, lenses.from_camera(EYES["panorama"]), 6))) == 6


def test_infinitely_far_points_are_drawn():
    def sky(lens, matrix):
        rays = lens.pixel_rays() @ matrix[:3, :3].T
        return np.nan_to_num(0.5 + 0.4 * rays), np.where(np.isnan(rays[..., 0]), np.nan, np.inf)

    lens = lenses.from_camera(EYES["perspective"])
    made = sources(sky).synthesise(EYE, lens)
    assert np.isposinf(made.distance).all()
    expected, _ = sky(lens, EYE)
    np.testing.assert_allclose(made.colour, expected, atol=0.002)


def test_only_a_few_views_stay_in_memory():
    field = sources(look)
    field.most = 3
    for index in range(10):
        field.surface(index)
    assert list(field._held) == [7, 8, 9]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("synthesis") / "dataset"
    write_views(folder, FISHEYE, RIG | {"subdivisions": 1})
    return folder


def test_the_program_writes_a_dataset_and_a_video(dataset, tmp_path, run_program):
    keys = [{"position": [0, 0, 0]}, {"position": [0.2, 0.1, 0]}]
    rig = {"type": "path", "count": 3, "keys": keys, "camera": EYES["perspective"]}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    arguments = [dataset, "--poses", tmp_path / "rig.yaml", "--output", tmp_path / "walk"]
    result = run_program("synthesize.py", *arguments)
    assert "3 views of 6 each; holes: 0.000%" in result.stdout
    lightfield = LightField.read(tmp_path / "walk" / "lightfield.json")
    for view in lightfield.views:
        image = images.read_image(tmp_path / "walk" / "exr" / f"{view.name}.exr")
        assert set(image.channels) == {*"RGBAZ"}
        colour, distance = look(lightfield.lens, view.world_from_camera)
        z = distance * -lightfield.lens.pixel_rays()[..., 2]
        np.testing.assert_allclose(image.channels["Z"], z, rtol=0.02)
        assert np.abs(image.colour - colour).max() < 0.05
        assert (tmp_path / "walk" / "png" / f"{view.name}.png").is_file()


def test_the_test_views_of_a_split_are_synthesised_from_the_others(dataset, tmp_path, run_program):
    result = run_program("synthesize.py", dataset, "--output", tmp_path)
    held_out = json.loads((tmp_path / "lightfield.json").read_text())["frames"]
    assert f"{len(held_out)} views" in result.stdout
    assert 0 < len(held_out) < len(LightField.read(dataset / "lightfield.json").views)


@pytest.fixture(scope="module")
def measured(tmp_path_factory, run_program):
    """The quality of a sphere of views, measured with a ring inside it: its rows and their file."""
    folder = tmp_path_factory.mktemp("measured")
    around, ring, out = (folder / name / "dataset" for name in ("around", "ring", "out"))
    write_views(around, FISHEYE, RIG, see=look_at_ball)
    keys = [{"position": [x, -0.1, 0], "rotation": [90, 0, 0]} for x in (0.05, 0.3)]
    path = {"type": "path", "count": 2, "keys": keys}
    write_views(ring, EYES["perspective"], path, see=look_at_ball)
    field = LightField.read(ring / "lightfield.json")
    field.changed(render={"passes": [*PARTS_OF_LIGHT]}).write(field.path)
    for view in field.views:
        # The ball is a mirror.
        _, distance = look_at_ball(field.lens, view.world_from_camera)
        ball = distance < look(field.lens, view.world_from_camera)[1] - 1e-6
        for name in PARTS_OF_LIGHT:
            lit = {"glossy_light": ball, "diffuse_light": ~ball}.get(name, np.zeros_like(ball))
            light = dict.fromkeys("RGB", lit.astype(np.float16))
            images.write_exr(PASSES[name].path(ring, view.name), light)
    stem = out.with_name("quality")
    arguments = [around, "--truth", ring, "--output", stem]
    run_program("synthesis_quality.py", *arguments)
    assert stem.with_suffix(".svg").is_file()
    with stem.with_suffix(".csv").open() as file:
        return list(csv.DictReader(file)), stem.with_suffix(".csv")


def test_fewer_views_and_the_controls_are_worse(measured):
    means = summaries.means(measured[0])
    mean_of = {(row["variant"], row["value"]): row for row in means}
    plain = mean_of["all", "42"]
    assert plain["psnr"] > mean_of["views", "12"]["psnr"] + 0.5
    assert plain["source_bytes"] > 3 * mean_of["views", "12"]["source_bytes"]
    for control in ("nearest view alone", "shuffled depth"):
        assert plain["psnr"] > mean_of["control", control]["psnr"] + 2


def test_regions_follow_the_light_that_pixels_show(measured):
    rows, _ = measured
    assert {row["region"] for row in rows} == {"all", "diffuse", "glossy"}
    (everywhere,), (diffuse,), (glossy,) = (
        summaries.means([row for row in rows if row["variant"] == "all"], region)
        for region in ("all", "diffuse", "glossy")
    )
    assert everywhere["part"] == 1
    assert diffuse["part"] + glossy["part"] == pytest.approx(1)
    assert 0.02 < glossy["part"] < 0.5
    # In each view, the errors of all pixels are the weighted mean of the regions'.
    for view in {row["view"] for row in rows}:
        part = {
            row["region"]: (float(row["part"]), 10 ** (-float(row["psnr"]) / 10))
            for row in rows
            if row["view"] == view and row["variant"] == "all"
        }
        sides = [part[name][0] * part[name][1] for name in ("diffuse", "glossy")]
        assert sum(sides) == pytest.approx(part["all"][1])


def test_places_are_inside_or_at_the_edge(measured):
    rows, _ = measured
    places = {row["view"]: (row["place"], float(row["to_edge"])) for row in rows}
    (near, near_part), (far, far_part) = (places[name] for name in sorted(places))
    assert (near, far) == ("inside", "edge")
    assert near_part < 0.5 < far_part < 1


def synthesis_rows(folder, camera, rig, run_program):
    """Return the rows of the quality of a dataset's test views, synthesised from its others."""
    write_views(folder / "dataset", camera, rig)
    run_program("synthesis_quality.py", folder / "dataset", "--output", folder / "quality")
    with (folder / "quality.csv").open() as file:
        return list(csv.DictReader(file))


def test_variants_have_no_more_views_and_no_fewer_pixels_than_there_are(tmp_path, run_program):
    camera = {"lens": "equidistant", "fov": 90, "resolution": [12, 3]}
    rig = {"type": "plane", "cameras": [4, 1], "size": 0.2}
    rows = synthesis_rows(tmp_path, camera, rig, run_program)
    values = {(row["variant"], row["value"]) for row in rows}
    assert {value for variant, value in values if variant == "best"} == {"1", "2"}
    assert {value for variant, value in values if variant == "resolution"} == {"6 × 1"}


@pytest.mark.parametrize("width", [48, 51])
def test_smaller_views_have_the_depth_of_their_pixels(tmp_path, width):
    """A quarter of 51 pixels is rounded to 12, so not every fourth pixel is the right one."""
    camera = {"lens": "rectilinear", "fov": 70, "resolution": [width, width]}
    rig = {"type": "plane", "cameras": [2, 1], "size": 2.0}
    write_views(tmp_path / "dataset", camera, rig)
    source = OpenDataset.in_folder(tmp_path / "dataset")
    views = source.lightfield.views
    (small,) = (
        variant.sources
        for variant in synthesis_quality.variants(source, views)
        if variant.value == "12 × 12"
    )
    _, distance = small.read(views[0])
    _, truth = look(small.lens, views[0].world_from_camera)
    # From one small pixel to the next, the distance changes by up to 4 %.
    assert np.abs(distance / truth - 1).max() < 0.006


def test_errors_at_the_poles_of_a_panorama_count_by_their_solid_angle(tmp_path):
    rig = {"type": "plane", "cameras": [2, 2], "size": 0.2}
    write_views(tmp_path / "dataset", EYES["panorama"], rig)
    truth = OpenDataset.in_folder(tmp_path / "dataset")
    views = truth.lightfield.views
    variant = next(synthesis_quality.variants(truth, views))

    def row_of(rows_with_error):
        colour = truth.views[0].rgb.copy()
        colour[rows_with_error] *= 1.5
        height, width = colour.shape[:2]
        holes = np.zeros((height, width), bool)
        made = Synthesised(colour, np.ones((height, width)), holes)
        variant.sources.synthesise = lambda *_: made
        return next(synthesis_quality.compare(variant, views, views[:1], truth, 0.0))

    at_pole = row_of(np.s_[:8])
    at_equator = row_of(np.s_[28:36])
    # The eight rows at the pole have a fifth of the solid angle of those at the equator: 7 dB.
    gain = {name: at_pole[name] - at_equator[name] for name in ("psnr", "ws_psnr", "iv_psnr")}
    for metric in ("ws_psnr", "iv_psnr"):
        assert gain[metric] - gain["psnr"] > 4


def test_black_pixels_belong_to_no_kind_of_light(tmp_path, run_program):
    rig = {"type": "plane", "cameras": [3, 3], "size": 0.2}
    camera = {"lens": "rectilinear", "fov": 70, "resolution": [16, 16]}
    folder = tmp_path / "dataset"
    write_views(folder, camera, rig)
    field = LightField.read(folder / "lightfield.json")
    field.changed(render={"passes": [*PARTS_OF_LIGHT]}).write(field.path)
    for view in field.views:
        for name in PARTS_OF_LIGHT:
            light = np.zeros((16, 16), np.float16)
            light[:4] = name == "glossy_light"
            images.write_exr(PASSES[name].path(folder, view.name), dict.fromkeys("RGB", light))
    run_program("synthesis_quality.py", folder, "--output", tmp_path / "quality")
    with (tmp_path / "quality.csv").open() as file:
        parts = {(row["region"], float(row["part"])) for row in csv.DictReader(file)}
    assert parts == {("all", 1.0), ("glossy", 0.25)}


def test_a_page_has_these_tables(measured):
    _, path = measured
    folder = path.parent / "synthesis" / "ball"
    folder.mkdir(parents=True)
    page_tables = tables.synthesis([shutil.copy(path, folder / "around.csv")], "ball/around")
    places, regions = list(page_tables.tables.values())[1:]
    assert [row[:2] for row in places.rows] == [["dataset", "inside"], ["dataset", "edge"]]
    assert [row[1] for row in regions.rows] == ["all", "diffuse", "glossy"]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--best", "0"], "--best: is 0; must be a whole number at least 1"),
        (["--poses", "rig.yaml"], "camera: is missing"),
        (["--poses", "none.json"], "none.json"),
    ],
)
def test_mistakes_are_one_line(dataset, tmp_path, run_program, arguments, problem):
    (tmp_path / "rig.yaml").write_text("type: plane\ncameras: [2, 2]\nsize: 1\n")
    arguments = [word.replace("rig.yaml", str(tmp_path / "rig.yaml")) for word in arguments]
    result = run_program("synthesize.py", dataset, *arguments, "--output", tmp_path, check=False)
    assert result.returncode
    assert problem in result.stderr.splitlines()[-1]
    assert "Traceback" not in result.stderr


def test_a_video_says_which_matrix_turns_it_back_into_its_colours(tmp_path):
    # Without the matrix in the file, players choose one by the size of the picture.
    path = tmp_path / "walk.mp4"
    with video(path, (1280, 720), 25) as add:
        add(np.full((720, 1280, 3), (200, 40, 30), np.uint8))
    described = subprocess.run(["ffmpeg", "-i", path], capture_output=True, check=False).stderr
    matrix = re.search(rb"yuv420p\(tv, (\w+)", described)[1].decode()
    command = ["ffmpeg", "-v", "error", "-i", path, "-vf", f"scale=in_color_matrix={matrix}"]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    shown = np.frombuffer(subprocess.check_output(command), np.uint8).reshape(-1, 3)
    assert np.abs(shown.astype(int) - (200, 40, 30)).max() <= 3
    _, read_by_opencv = cv2.VideoCapture(str(path)).read()
    assert np.abs(read_by_opencv[..., ::-1].astype(int) - (200, 40, 30)).max() <= 3


def test_a_video_needs_ffmpeg(tmp_path, monkeypatch):
    path = tmp_path / "walk.mp4"
    picture = np.full((5, 7, 3), 200, np.uint8)
    with video(path, (7, 5), 25) as add:
        for _ in range(4):
            add(picture)
    command = ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    frames = np.frombuffer(subprocess.check_output(command), np.uint8).reshape(4, 6, 8, 3)
    assert np.abs(frames[:, :5, :7].astype(int) - 200).max() <= 8
    path.unlink()
    monkeypatch.setenv("PATH", "")
    missing = pytest.raises(UserError, match="needs ffmpeg, which is not installed")
    with missing, video(path, (7, 5), 25):
        pass
    assert not list(tmp_path.iterdir())
