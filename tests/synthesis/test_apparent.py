"""Mirrors in synthesised views: what they show moves as if it were behind them."""

import numpy as np
import pytest
from mirrors import BEHIND, CAMERA, WALL, see, see_framed_mirror

from lightfield.formats.lightfield import View
from lightfield.geometry import lenses
from lightfield.imaging.tonemap import encode_srgb
from lightfield.synthesis.view import Sources

PLACES = [(x, 0.0, z) for x in (-0.3, 0.0, 0.3) for z in (-0.3, 0.0, 0.3)]


def placed(place):
    """Return the matrix of a camera at ``place`` that looks along +Y."""
    matrix = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    matrix[:3, 3] = place
    return matrix


def psnr_of_synthesis(pattern):
    lens = lenses.from_camera(CAMERA)
    views = [View.placed(f"view_{n:04}f", placed(place)) for n, place in enumerate(PLACES)]
    field = Sources(lens, views, lambda view: see(lens, view.world_from_camera, pattern))
    target = placed((0.14, 0.1, -0.16))
    made = field.synthesise(target, lens)
    colour, _ = see(lens, target, pattern)
    middle = (slice(16, -16), slice(16, -16))
    error = encode_srgb(made.colour[middle]) - encode_srgb(colour[middle])
    return -10 * np.log10((error**2).mean())


@pytest.mark.parametrize("behind", [0.0, BEHIND], ids=["paint", "mirror"])
def test_a_wall_shows_what_is_painted_on_it_and_what_it_reflects(behind):
    assert psnr_of_synthesis(WALL + behind) > 30


def test_a_reflection_stays_on_its_mirror_and_z_is_that_of_the_mirror():
    lens = lenses.from_camera(CAMERA)
    views = [View.placed(f"view_{n:04}f", placed(place)) for n, place in enumerate(PLACES)]
    field = Sources(lens, views, lambda view: see_framed_mirror(lens, view.world_from_camera))
    target = placed((0.14, 0.1, -0.16))
    made = field.synthesise(target, lens)
    colour, distance = see_framed_mirror(lens, target)
    middle = (slice(16, -16), slice(16, -16))
    error = encode_srgb(made.colour[middle]) - encode_srgb(colour[middle])
    assert -10 * np.log10((error**2).mean()) > 30
    np.testing.assert_allclose(made.distance[middle], distance[middle], rtol=0.01)
