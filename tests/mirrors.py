"""A wall with a pattern on it or behind it, which cameras with few pixels can tell apart."""

import numpy as np

CAMERA = {"lens": "rectilinear", "fov": 70, "resolution": [96, 96]}
# All cameras look along +Y at the wall. The reflected pattern seems to be so far behind it.
WALL, BEHIND = 2.0, 3.0


def see(lens, matrix, pattern):
    """Return the linear colour and the distance of the wall, with a pattern at y = ``pattern``."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    points = matrix[:3, 3] + rays * ((pattern - matrix[1, 3]) / rays[..., 1])[..., None]
    waves = np.sin(points[..., [0]] * [7.0, 5.0, 9.0]) * np.sin(points[..., [2]] * [6.0, 8.0, 5.0])
    return 0.3 + 0.25 * waves, (WALL - matrix[1, 3]) / rays[..., 1]


def see_framed_mirror(lens, matrix):
    """Return what a camera sees of the wall: a mirror between x = −0.5 and 0.5, else paint."""
    reflection, distance = see(lens, matrix, WALL + BEHIND)
    paint, _ = see(lens, matrix, WALL)
    points = matrix[:3, 3] + (lens.pixel_rays() @ matrix[:3, :3].T) * distance[..., None]
    is_mirror = np.abs(points[..., [0]]) < 0.5
    return np.where(is_mirror, reflection, paint), distance
