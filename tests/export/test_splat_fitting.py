"""Colours and opacities of a splat, fitted to the views that train."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sphere import look_at_ball, look_at_ball_alone, make_transparent, write_views

from lightfield.export import splats
from lightfield.export.source import SourceDataset
from lightfield.export.splat_drawing import draw, project
from lightfield.export.splat_fitting import fitted
from lightfield.export.trainer_splits import splits
from lightfield.formats import gaussians
from lightfield.formats.gaussians import HARMONIC_0, Gaussians
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import from_camera
from lightfield.imaging import images

FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
RIG = {"type": "cuboid", "cameras": [2, 2, 2], "size": 0.6}
MANY = 10**6


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Views of the inside of a sphere with a ball in it."""
    folder = tmp_path_factory.mktemp("fitting") / "dataset"
    write_views(folder, FISHEYE, RIG, see=look_at_ball)
    return SourceDataset(folder, "", ".exr")


@pytest.fixture(scope="module")
def made(source):
    return splats.make(source, MANY)


def quality(source, shown):
    """Return the PSNR in dB at the views that do not train."""
    squares = []
    for view in splits(source.lightfield).test:
        difference = draw(shown, view, source.lens).colour - source.encoded(view)
        squares.append((difference[source.valid(view)] ** 2).mean())
    return -10 * math.log10(np.mean(squares))


def test_fitted_colours_are_nearer_to_views_that_do_not_train(source, made):
    assert quality(source, fitted(made, source, MANY)) > quality(source, made) + 1


def test_wrong_colours_are_brought_back(source, made):
    random = np.random.default_rng(0)
    harmonics = made.harmonics + random.normal(0, 0.2 / HARMONIC_0, made.harmonics.shape)
    wrong = replace(made, harmonics=harmonics)
    assert quality(source, fitted(wrong, source, MANY)) > quality(source, wrong) + 6


def test_gaussians_where_nothing_is_fade(source, made):
    random = np.random.default_rng(0)
    count = 20
    names = made.__dataclass_fields__
    floating = Gaussians(
        random.uniform(-1, 1, (count, 3)) * (1, 1, 0) + (0, 0, 1.0),
        np.full((count, 3), 0.03),
        np.tile([1.0, 0, 0, 0], (count, 1)),
        np.zeros((count, 1, 3)),
        np.full(count, 0.9),
    )
    both = Gaussians(
        **{name: np.concatenate([getattr(made, name), getattr(floating, name)]) for name in names}
    )
    opacities = fitted(both, source, MANY).opacities
    assert (opacities[-count:] < 0.85).all()
    assert np.median(opacities[:-count]) > 0.95


def test_places_sizes_and_rotations_stay(source, made):
    after = fitted(made, source, MANY)
    for name in ("positions", "scales", "rotations"):
        np.testing.assert_array_equal(getattr(after, name), getattr(made, name))
    assert after.harmonics.shape == made.harmonics.shape


def test_gaussians_much_larger_than_pixels_are_fitted_to_smaller_views(source):
    """About 300 Gaussians for eight views of 64²."""
    coarse = splats.make(source, 300)
    assert quality(source, fitted(coarse, source, 300)) > quality(source, coarse) + 1


def test_colour_and_outline_of_a_ball_before_nothing_are_fitted(tmp_path):
    """Most pixels are empty, so there are few Gaussians. Still, none is larger than a pixel."""
    folder = tmp_path / "dataset"
    write_views(folder, FISHEYE | {"resolution": [192, 192]}, RIG, see=look_at_ball_alone)
    make_transparent(folder, 1)
    for path in folder.glob("exr/*.exr"):
        image = images.read_image(path)
        outline = np.isfinite(image.channels["Z"]).astype(np.float16)
        images.write_exr(path, image.channels | {"A": outline}, image.attributes)
    source = SourceDataset(folder, "", ".exr")
    before = splats.make(source, MANY)
    after = fitted(before, source, MANY)

    def wrong_coverage(shown):
        return np.mean(
            [
                (draw(shown, view, source.lens).coverage - source.alpha(view) / 255) ** 2
                for view in splits(source.lightfield).test
            ]
        )

    assert quality(source, after) > quality(source, before) + 0.5
    assert wrong_coverage(after) < 0.9 * wrong_coverage(before)


def test_corrections_are_the_derivatives_of_the_drawn_picture():
    """Against central differences of half the squared error."""
    random = np.random.default_rng(3)
    count = 40
    shown = Gaussians(
        np.column_stack([random.uniform(-1, 1, (count, 2)), random.uniform(-4, -1.5, count)]),
        np.exp(random.uniform(-3, -1.5, (count, 3))),
        Rotation.random(count, random).as_quat()[:, [3, 0, 1, 2]],
        random.normal(0, 0.3, (count, 1, 3)),
        random.uniform(0.1, 0.9, count),
    )
    view = View.placed("view", np.eye(4))
    lens = from_camera({"lens": "rectilinear", "fov": 70, "resolution": [48, 40]})
    target = random.uniform(0, 1, (40, 48, 4))
    counted = random.uniform(0, 1, (40, 48)) > 0.2

    def error(changed):
        drawn = draw(changed, view, lens)
        missing = target - np.dstack([drawn.colour, drawn.coverage])
        return (missing[counted] ** 2).sum() / 2

    def slope(of):
        step = 1e-6
        return (error(of(-step)) - error(of(step))) / (2 * step)

    seen = project(shown, view, lens)
    changes, weights = seen.corrections(seen.draw(lens.height, lens.width), target, counted)
    assert (weights[:, 3] > 0).sum() > count / 2
    for place, number in enumerate(seen.numbers):
        one = np.arange(count) == number
        opacity = slope(
            lambda step, one=one: replace(shown, opacities=shown.opacities + step * one)
        )
        assert changes[place, 3] == pytest.approx(opacity, rel=1e-3, abs=1e-3)
        red = one[:, None, None] * np.array([1.0, 0, 0]) / HARMONIC_0
        colour = slope(lambda step, red=red: replace(shown, harmonics=shown.harmonics + step * red))
        assert changes[place, 0] == pytest.approx(colour, rel=1e-3, abs=1e-3)


def test_an_export_with_fit_has_equal_bytes_each_time(source, tmp_path, run_program):
    exports = [tmp_path / name for name in ("first", "second", "plain")]
    for folder in exports:
        fit = {} if folder.name == "plain" else {"fit": "colours"}
        settings = tmp_path / f"{folder.name}.json"
        settings.write_text(json.dumps({"options": {"sources": ["views"], **fit}}))
        files = ["--settings", settings, "--dataset", source.dataset, "--output", folder]
        run_program("export.py", "splat", *files)
    first, second, plain = (folder / "splat.ply" for folder in exports)
    assert first.read_bytes() == second.read_bytes()
    read = [gaussians.read(path) for path in (first, plain)]
    np.testing.assert_array_equal(read[0].positions, read[1].positions)
    assert np.abs(read[0].harmonics - read[1].harmonics).max() > 0.05
    assert '"fit": "colours"' in (exports[0] / "export.json").read_text()
    assert "fit" not in (exports[2] / "export.json").read_text()
