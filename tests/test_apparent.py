"""Mirrors in synthesised views: what they show moves as if it were behind them."""

import numpy as np
import pytest

from lightfield.dataset.lightfield import View
from lightfield.geometry import lenses
from lightfield.imaging.tonemap import encode_srgb
from lightfield.synthesis.view import Sources

CAMERA = {"lens": "rectilinear", "fov": 70, "resolution": [96, 96]}
# A wall that all cameras look at, and how far behind it the reflected pattern seems to be.
WALL, BEHIND = 2.0, 3.0
PLACES = [(x, 0.0, z) for x in (-0.3, 0.0, 0.3) for z in (-0.3, 0.0, 0.3)]


def placed(place):
    """Return the matrix of a camera at ``place`` that looks along +Y."""
    matrix = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    matrix[:3, 3] = place
    return matrix


def see(lens, matrix, pattern):
    """Return the linear colour and the distance of the wall, with a pattern at y = ``pattern``."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    points = matrix[:3, 3] + rays * ((pattern - matrix[1, 3]) / rays[..., 1])[..., None]
    waves = np.sin(points[..., [0]] * [7.0, 5.0, 9.0]) * np.sin(points[..., [2]] * [6.0, 8.0, 5.0])
    return 0.3 + 0.25 * waves, (WALL - matrix[1, 3]) / rays[..., 1]


def psnr_of_synthesis(pattern):
    lens = lenses.from_camera(CAMERA)
    views = [View.placed(f"view_{n:04}f", placed(place)) for n, place in enumerate(PLACES)]
    field = Sources(lens, views, lambda view: see(lens, view.matrix, pattern))
    target = placed((0.14, 0.1, -0.16))
    made = field.synthesise(target, lens)
    colour, _ = see(lens, target, pattern)
    middle = (slice(16, -16), slice(16, -16))
    error = encode_srgb(made.colour[middle]) - encode_srgb(colour[middle])
    return -10 * np.log10((error**2).mean())


@pytest.mark.parametrize("behind", [0.0, BEHIND], ids=["paint", "mirror"])
def test_a_wall_shows_what_is_painted_on_it_and_what_it_reflects(behind):
    assert psnr_of_synthesis(WALL + behind) > 30


def see_framed_mirror(lens, matrix):
    """Return what a camera sees of the wall: a mirror between x = −0.5 and 0.5, else paint."""
    reflection, distance = see(lens, matrix, WALL + BEHIND)
    paint, _ = see(lens, matrix, WALL)
    points = matrix[:3, 3] + (lens.pixel_rays() @ matrix[:3, :3].T) * distance[..., None]
    is_mirror = np.abs(points[..., [0]]) < 0.5
    return np.where(is_mirror, reflection, paint), distance


def test_a_reflection_stays_on_its_mirror_and_z_is_that_of_the_mirror():
    lens = lenses.from_camera(CAMERA)
    views = [View.placed(f"view_{n:04}f", placed(place)) for n, place in enumerate(PLACES)]
    field = Sources(lens, views, lambda view: see_framed_mirror(lens, view.matrix))
    target = placed((0.14, 0.1, -0.16))
    made = field.synthesise(target, lens)
    colour, distance = see_framed_mirror(lens, target)
    middle = (slice(16, -16), slice(16, -16))
    error = encode_srgb(made.colour[middle]) - encode_srgb(colour[middle])
    assert -10 * np.log10((error**2).mean()) > 30
    np.testing.assert_allclose(made.distance[middle], distance[middle], rtol=0.01)
