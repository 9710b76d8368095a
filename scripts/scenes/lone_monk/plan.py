"""The plan of the cloister, in metres from the middle of its court.

The rigs stand round the world's origin, on the south-eastern lawn. They are a cuboid of 4 × 4 × 3 m
and a sphere of 4 m, both centred 2.2 m above the ground. Only grass is in them. The four sides of
the court have the same parts. Each side has its own frame. Its origin is the court's middle with
the well, x runs along the side, and y points out of the court.
"""

from collections.abc import Iterable, Sequence

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library.scene import place
from scenes.library.shapes import transform

CENTER = (-1.2, 3.6)  # in the world, so that the rigs at the origin stand beside the well
# A bay of an arcade, from column to column. The middle one is the gate.
BAY = 2.2
BAYS = 7
ARCADE = BAY * BAYS / 2  # axis of the arcade's wall
ARCADE_WALL = 0.5
WALK = 2.7  # clear width of the vaulted walks
BACK = ARCADE + ARCADE_WALL / 2 + WALK  # front of the buildings' walls
BACK_WALL = 0.5
WALK_MIDDLE = BACK - WALK / 2
FRONT = ARCADE - ARCADE_WALL / 2  # of the arcade's wall
CROSS_PATH = 0.95  # half width of the paths to the well
PLAZA = 2.3  # radius of the paving round the well
LAWN = ARCADE - 1.95  # outer edge of the lawns: there runs a path along the arcades
BAY_AXES = (np.arange(BAYS) - (BAYS - 1) / 2) * BAY
COLUMNS = np.linspace(-ARCADE, ARCADE, BAYS + 1)  # the first and the last are piers

WALK_FLOOR = 0.14
STYLOBATE = 0.6  # the low wall that carries the columns
SPRINGING = 2.45  # of arches and vaults
VAULT_RISE = 0.95
ARCADE_TOP = 3.86
EAVE = 3.8  # of the lean-to roofs over the walks
EAVE_OUT = 0.42  # its overhang in front of the arcade's wall
SLOPE = np.radians(24)
LEAN_TO_TOP = EAVE + (BACK - FRONT + EAVE_OUT) * np.tan(SLOPE)

SIDES = NORTH, WEST, SOUTH, EAST = range(4)  # each a quarter turn on from the north


def side(number: int, at: Sequence[float] = (0, 0, 0), turn: float = 0, size: float = 1) -> Matrix:
    """To the world from a place in a side's frame; turn: degrees about Z."""
    frame = transform((*CENTER, 0), (0, 0, number * np.pi / 2))
    return frame @ transform(at, (0, 0, np.radians(turn)), float(size))


def on_sides(
    name: str, meshes: Sequence[bpy.types.Mesh], *at: ArrayLike, sides: Iterable[int] = SIDES
) -> None:
    """Instances of the meshes, taken in turn, at the same places in each of the sides' frames.

    at: up to five of x, y, z (metres), turn (degrees about Z) and size. Each is one number for all
    places, or one for each. Missing values leave the mesh as it is.
    """
    columns = np.atleast_1d(*at, *(0.0, 0.0, 0.0, 0.0, 1.0)[len(at) :])
    for number in sides:
        for i, (*spot, turn, size) in enumerate(np.broadcast(*columns)):
            place(f"{name}.{number}.{i}", meshes[i % len(meshes)], side(number, spot, turn, size))
