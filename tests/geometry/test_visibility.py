"""A view sees a point that lies on its surface. A nearer surface hides the point."""

import numpy as np

from lightfield.geometry import lenses
from lightfield.geometry.visibility import lies_on, nothing_hides, pixel_indices

NAN, INF = np.nan, np.inf
# The distance of the view's surface, and of the point: on it, in front of it, behind it, at a miss,
# at a miss in front of a point, and where the view knows nothing.
SURFACE = np.array([2.0, 2.0, 2.0, INF, INF, NAN])
POINT = np.array([2.01, 1.9, 2.1, INF, 5.0, 2.0])


def test_a_point_lies_on_the_surface_only_within_the_tolerance():
    expected = [True, False, False, False, False, False]
    assert lies_on(SURFACE, POINT, part=0.01).tolist() == expected
    # Ten centimetres of two metres are a twentieth.
    assert lies_on(SURFACE, POINT, part=0.06).tolist() == [True, True, True, False, False, False]


def test_only_a_nearer_surface_hides_a_point():
    assert nothing_hides(SURFACE, POINT, part=0.01).tolist() == [
        True,
        True,
        False,
        True,
        True,
        False,
    ]
    assert nothing_hides(SURFACE, POINT, part=0.06).tolist() == [
        True,
        True,
        True,
        True,
        True,
        False,
    ]


def test_rays_have_the_pixels_that_they_pass():
    lens = lenses.from_camera({"lens": "rectilinear", "resolution": [4, 2], "fov": 90.0})
    # The frame reaches to 45 degrees on both sides. The camera looks along −Z.
    rays = np.array([[-0.9, 0.1, -1.0], [1.8, -0.2, -2.0], [2.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    column, row, inside = pixel_indices(lens, rays)
    assert inside.tolist() == [True, True, False, False]
    assert column.tolist() == [0, 3, 0, 0]
    assert row.tolist() == [0, 1, 0, 0]
