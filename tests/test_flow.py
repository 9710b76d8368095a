"""Flow between views: what it leads to has the same colour, and is hidden where rays say so.

The scene is the inside of a textured sphere, with a ball in it.
"""

import numpy as np
import pytest
from sphere import RADIUS, colour_of, look, write_views

from lightfield.geometry import lenses
from lightfield.geometry.flow import flow
from lightfield.imaging import images

BALL, SIZE = np.array([0.3, 1.5, 0.1]), 0.5
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [96, 96]},
    "fisheye": {"lens": "equidistant", "fov": 200, "resolution": [96, 96]},
    "panorama": {"lens": "equirectangular", "resolution": [128, 64]},
}
# Looking along +Y, at the ball.
TURN = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def camera(x, z):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN, (x, 0, z)
    return matrix


def ball(origin, rays):
    """Return how far along unit rays (..., 3) the ball is; inf where they miss it."""
    along = rays @ (BALL - origin)
    under = SIZE**2 - np.sum((BALL - origin) ** 2) + along**2
    with np.errstate(invalid="ignore"):
        return np.where((under > 0) & (along > 0), along - np.sqrt(under), np.inf)


@pytest.mark.parametrize("name", LENSES)
def test_flow_leads_to_the_same_point_unless_it_is_hidden(name):
    lens = lenses.from_camera(LENSES[name])
    here, there = camera(-0.2, 0), camera(0.2, 0.1)
    distances = []
    for matrix in (here, there):
        rays = lens.pixel_rays() @ matrix[:3, :3].T
        distances.append(np.fmin(look(lens, matrix)[1], ball(matrix[:3, 3], rays)))
    found, visible = flow(lens, here, there, *distances)
    points = here[:3, 3] + lens.pixel_rays() @ here[:3, :3].T * distances[0][..., None]
    offset = points - there[:3, 3]
    expected = np.linalg.norm(offset, axis=-1)
    to_point = offset / expected[..., None]
    # By rays to the points themselves, of which those on the ball's own rim are doubtful.
    hidden = ball(there[:3, 3], to_point) < expected - 0.02
    inside = np.isfinite(found[..., 0])
    pixels = np.indices(expected.shape)[::-1].transpose(1, 2, 0) + 0.5 + found
    inside &= ((pixels >= 0) & (pixels < (lens.width, lens.height))).all(axis=-1) | (
        name == "panorama"
    )
    assert hidden[inside].sum() > 20 and not visible[~inside].any()
    assert (visible[inside] == ~hidden[inside]).mean() > 0.98
    # Warped: the colour there is that of the point here, to what a pixel's rounding moves it.
    rays = lens.rays(*np.moveaxis(pixels, -1, 0)) @ there[:3, :3].T
    seen = inside & ~hidden
    error = np.linalg.norm(np.cross(rays, to_point), axis=-1)[seen]
    assert error.max() < 1e-6
    wall = seen & (np.linalg.norm(points, axis=-1) > RADIUS - 0.01)
    assert np.ptp(colour_of(points[wall])) > 50


def test_the_program_writes_flow_to_the_nearest_view(tmp_path, run_program):
    rig = {"type": "lattice", "cameras": [3, 1, 1], "size": 0.4}
    write_views(tmp_path / "dataset", LENSES["fisheye"] | {"resolution": [48, 48]}, rig)
    run_program("flow.py", tmp_path / "dataset", "--output", tmp_path / "flow")
    files = sorted(path.name for path in (tmp_path / "flow").iterdir())
    assert files[0] == "view_0000f_to_view_0001f.exr" and len(files) == 3
    there = images.read_image(tmp_path / "flow" / files[0]).channels
    assert {name: str(plane.dtype) for name, plane in there.items()} == {
        "X": "float32",
        "Y": "float32",
        "V": "float16",
    }
    # Warped by bilinear interpolation, away from the rim.
    views = [
        images.read_image(tmp_path / "dataset" / "exr" / f"view_000{n}f.exr").colour for n in (0, 1)
    ]
    rows, columns = np.nonzero(there["V"] == 1)
    x = columns + there["X"][rows, columns]
    y = rows + there["Y"][rows, columns]
    j, i = np.floor(x).astype(int).clip(0, 46), np.floor(y).astype(int).clip(0, 46)
    fx, fy = (x - j)[:, None], (y - i)[:, None]
    top = views[1][i, j] * (1 - fx) + views[1][i, j + 1] * fx
    bottom = views[1][i + 1, j] * (1 - fx) + views[1][i + 1, j + 1] * fx
    error = np.abs(top * (1 - fy) + bottom * fy - views[0][rows, columns])
    assert len(rows) > 1000
    assert np.median(error) < 1e-3
