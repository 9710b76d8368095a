"""Gives rigs with ``size: fit`` or ``center: fit`` a size and a place that fit a scene's box.

Cameras that look at the middle stand so far away that each sees the whole box. Cameras that look
outward stand in the inner half of the box. Cameras that all look one way stand before the box.
"""

import itertools
import math
from typing import TypeVar

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rigs.plane import Plane
from lightfield.geometry.rigs.rig import FIT, Rig
from lightfield.geometry.rotations import Floats

AnyRig = TypeVar("AnyRig", bound=Rig)

# So much farther than necessary, so that nothing touches the edge of a view.
_MARGIN = 1.05
# Cameras before a box need not see it at wider angles than this from their axis.
_WIDEST = math.radians(60)


def fitted(rig: AnyRig, box: Floats) -> AnyRig:
    """Return a rig with numbers for its size and center, which fit a scene's ``box`` (2, 3).

    All are in metres. Raises `UserError` for a flat box that has no room for cameras.
    """
    if not rig.is_fitted:
        return rig
    corners = np.array(list(itertools.product(*box.T)))
    if rig.looks == "ahead":
        sides, center = _before(rig, corners)
    else:
        center = box.mean(axis=0) if rig.center == FIT else rig.middle
        is_turned = rig.looks == "outward" and (rig.face_inside or rig.look_at is not None)
        is_inward = rig.looks == "inward" or is_turned
        sides = _around(rig, corners, center) if is_inward else _within(rig, corners)
    values: dict[str, object] = {}
    if rig.size == FIT:
        values["size"] = sides[0] if len({*sides}) == 1 else tuple(sides)
    if rig.center == FIT:
        values["center"] = tuple(_plain(center))
    return rig.model_copy(update=values)


def _around(rig: Rig, corners: Floats, center: Floats) -> list[float]:
    """Return the diameter from which a camera sees all ``corners`` (8, 3), for each side."""
    radius = float(np.max(np.linalg.norm(corners - center, axis=1)))
    if rig.look_at is not None:
        radius += float(np.linalg.norm(np.array(rig.look_at) - center))
    angle = math.pi / 2 if rig.cube_map else min(_half_angles(rig.camera.make()))
    return _plain(np.full(3, 2 * _MARGIN * radius / math.sin(min(angle, math.pi / 2))))


def _within(rig: Rig, corners: Floats) -> list[float]:
    """Return half the sides of the box, along the rig's axes. Round rigs stay round."""
    sides = np.ptp(corners @ rig.turn, axis=0)
    if not sides.all():
        text = " × ".join(f"{side:.4g}" for side in sides)
        raise UserError(
            f"size: fit: the scene's box is flat, {text} m, so no cameras fit into it; give the "
            "size in metres"
        )
    return _plain(np.full(3, np.min(sides) / 2) if rig.is_round else sides / 2)


def _before(rig: Rig, corners: Floats) -> tuple[list[float], Floats]:
    """Return the sides and the center of a rig that stands before the box, and sees all of it."""
    middle = corners.mean(axis=0)
    width, depth, height = np.ptp(corners @ rig.turn, axis=0).tolist()
    # A plane has no depth.
    thickness = 0.0 if isinstance(rig, Plane) else depth
    sides = np.array([width, thickness, height]) / 2 if rig.size == FIT else rig.sides
    across, down = (min(angle, _WIDEST) for angle in _half_angles(rig.camera.make()))
    distance = _MARGIN * max(
        (width + sides[0]) / 2 / math.tan(across), (height + sides[2]) / 2 / math.tan(down)
    )
    away = depth / 2 + distance + sides[1] / 2
    ahead = rig.turn @ np.array([0.0, -1.0 if rig.face_inside else 1.0, 0.0])
    return _plain(sides), middle - away * ahead


def _half_angles(lens: Lens) -> tuple[float, float]:
    """Return the smallest angles from the axis to the image's edges, across and down, in radians.

    An edge outside the image circle has π/2.
    """
    x, y = lens.width / 2, lens.height / 2
    edges = lens.rays(np.array([0, lens.width, x, x]), np.array([y, y, 0, lens.height]))
    angles = np.arccos(np.clip(-edges[:, 2], -1, 1))
    angles = np.where(np.isfinite(angles), angles, math.pi / 2)
    return float(angles[:2].min()), float(angles[2:].min())


def _plain(values: Floats) -> list[float]:
    """Return numbers with six digits, as a person would write them."""
    return [float(f"{value:.6g}") + 0.0 for value in values.tolist()]
