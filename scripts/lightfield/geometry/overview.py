"""What shows best what a rig sees: a panorama from its centre, or else the view in its middle."""

import numpy as np

from lightfield.geometry.rigs import BlendCamera, Path, Poses, Random, Rig
from lightfield.geometry.rigs.hemisphere import GOLDEN_ANGLE
from lightfield.geometry.rigs.orbit import on_sphere

# Of so many directions, evenly spread, so large a part must be seen by some of the cameras.
DIRECTIONS, PART = 200, 0.75
# More cameras than this tell no more.
MOST_CAMERAS = 200


def sees_all_round(rig: Rig) -> bool:
    """Return whether the views show what a panorama from the rig's centre would.

    They do if most directions are seen by a camera on that side of the centre. The cameras of a
    plane see half of them at most, those that look at an object none: its inside would be the
    panorama's place. Of loose poses, paths and random places nobody knows what is in the middle.
    """
    if isinstance(rig, Poses | Path | Random | BlendCamera):
        return False
    lens = rig.camera.make()
    number = np.arange(DIRECTIONS, dtype=np.float64)
    directions = on_sphere(GOLDEN_ANGLE * number, 1 - (2 * number + 1) / DIRECTIONS)
    cameras = np.array([pose.matrix() for pose in rig.thinned(MOST_CAMERAS).poses()])
    x, y = np.moveaxis(lens.pixels(directions @ cameras[:, :3, :3]), -1, 0)
    side = (cameras[:, :3, 3] - np.array(rig.center)) @ directions.T
    seen = (x >= 0) & (x <= lens.width) & (y >= 0) & (y <= lens.height) & (side >= -1e-9)
    return bool(seen.any(axis=0).mean() >= PART)


def middle_view(rig: Rig) -> int:
    """Return the number of a view in the middle of the rig.

    It is that in the middle of the rig's middle row or, where this goes round, the one that looks
    ahead, along +Y. Of a rig without rows it is that in the middle of the order.
    """
    poses = rig.poses()[:: rig.views_a_position]
    places = (np.array([pose.position for pose in poses]) - np.array(rig.center)) @ rig.turn
    row = rig.middle_row(places) or range(len(poses))
    middle = row[len(row) // 2]
    if rig.is_round and len(row) < len(poses):
        middle = max(row, key=lambda number: -poses[number].matrix()[1, 2])
    return middle * rig.views_a_position
