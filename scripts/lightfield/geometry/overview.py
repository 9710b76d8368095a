"""Chooses the picture that shows a rig best: a panorama from its centre, or its middle view."""

import numpy as np

from lightfield.geometry.rigs import BlendCamera, Path, Poses, Random, Rig
from lightfield.geometry.rigs.hemisphere import GOLDEN_ANGLE
from lightfield.geometry.rigs.orbit import on_sphere
from lightfield.geometry.rotations import euler_to_matrix

# The number of directions to test, which are spread evenly.
DIRECTIONS = 200
# The cameras must see at least this part of the directions.
_SEEN_PART = 0.75
# Cameras look inward if the mean cosine between their directions and the way outward is below this.
_INWARD = -0.5
# More cameras than this would not change the answer.
MOST_CAMERAS = 200


def sees_all_round(rig: Rig) -> bool:
    """Return whether the views show what a panorama from the rig's centre would.

    They do if for most directions a camera on that side of the centre sees the direction. The
    cameras of a plane see at most half of the directions. Cameras that look at an object show what
    is around it only from the other side, and the panorama would lie inside the object. Loose
    poses, paths and random places have no meaningful centre.
    """
    if isinstance(rig, Poses | Path | Random | BlendCamera):
        return False
    lens = rig.camera.make()
    number = np.arange(DIRECTIONS, dtype=np.float64)
    directions = on_sphere(GOLDEN_ANGLE * number, 1 - (2 * number + 1) / DIRECTIONS)
    poses = rig.thinned(MOST_CAMERAS).poses()
    places = np.array([pose.position for pose in poses])
    turns = euler_to_matrix(np.array([pose.rotation for pose in poses]))
    x, y = np.moveaxis(lens.pixels(directions @ turns), -1, 0)
    outward = places - rig.middle
    lengths = np.linalg.norm(outward, axis=1)
    cosines = (outward * -turns[:, :, 2]).sum(axis=1) / np.where(lengths > 0, lengths, 1)
    if cosines.mean() < _INWARD:
        return False
    side = outward @ directions.T
    seen = (x >= 0) & (x <= lens.width) & (y >= 0) & (y <= lens.height) & (side >= -1e-9)
    return bool(seen.any(axis=0).mean() >= _SEEN_PART)


def middle_view(rig: Rig) -> int:
    """Return the number of a view in the middle of the rig.

    This is the middle view of the rig's middle row. If the row goes round, it is the row's view
    that looks along +Y. A rig without rows has the middle view of its order.
    """
    poses = rig.poses()[:: rig.views_a_position]
    places = (np.array([pose.position for pose in poses]) - rig.middle) @ rig.turn
    row = rig.middle_row(places) or range(len(poses))
    middle = row[len(row) // 2]
    if rig.is_round and len(row) < len(poses):
        middle = max(row, key=lambda number: -poses[number].world_from_camera()[1, 2])
    return middle * rig.views_a_position
