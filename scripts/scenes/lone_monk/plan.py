"""The plan of the cloister, in metres from the middle of its court.

The rigs stand round the world's origin, on the south-eastern lawn. They are a cuboid of 4 × 4 × 3 m
and a sphere of 4 m, both centred 2.2 m above the ground. Only grass is in them. The four sides of
the court have the same parts. Each side has its own frame. Its origin is the court's middle with
the well, x runs along the side, and y points out of the court.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library.materials import Color
from scenes.library.points import Array
from scenes.library.scene import place
from scenes.library.shapes import transform
from scenes.library.variation import Variation

ARCADE_WALL = 0.5
BACK_WALL = 0.5
CROSS_PATH = 0.95  # half width of the paths to the well
PLAZA = 2.3  # radius of the paving round the well

WALK_FLOOR = 0.14
STYLOBATE = 0.6  # the low wall that carries the columns
SPRINGING = 2.45  # of arches and vaults
VAULT_RISE = 0.95
ARCADE_TOP = 3.86
EAVE = 3.8  # of the lean-to roofs over the walks
EAVE_OUT = 0.42  # its overhang in front of the arcade's wall
SLOPE = np.radians(24)

SIDES = NORTH, WEST, SOUTH, EAST = range(4)  # each a quarter turn on from the north


class House(NamedTuple):
    """The storeys over the walk of a side: the heights of their tops, from below."""

    side: int
    tops: tuple[float, ...]


@dataclass(frozen=True)
class Cloister(Variation):
    """The measures of a cloister. Without arguments they are the original's.

    A bay of an arcade reaches from column to column. The middle one is the gate. A side has the
    church, a house, or a low wall over its walk. middle: what stands in the court's middle, a name
    in `middles.MIDDLES`. ground: of the four quarters of the court, "lawn", "gravel" or "paved".
    arcade_stuff, walk_stuff, house_stuff: materials of the arcades over the columns, of the walls
    behind the walks, and of the storeys.
    """

    center: tuple[float, float] = (
        -1.2,
        3.6,
    )  # of the court, so that the rigs stand beside the well
    bay: float = 2.2
    bays: int = 7
    walk: float = 2.7  # clear width of the vaulted walks
    church_side: int = EAST
    houses: tuple[House, ...] = (House(NORTH, (7.7,)), House(SOUTH, (7.2,)))
    middle: str = "well"
    ground: str = "lawn"
    has_hedges: bool = False
    arcade_stuff: str = "Plaster"
    walk_stuff: str = "Whitewash"
    house_stuff: str = "Plaster"
    ivy_side: int = SOUTH
    # In the court's frame: x, y, and turn in degrees.
    olives: tuple[tuple[float, float], ...] = ((-3.5, 3.5),)
    cypresses: tuple[tuple[float, float], ...] = ((3.6, 3.7),)
    chair: tuple[float, float] = (4.5, -2.2)
    monk: tuple[float, float, float] = (4.35, -0.25, 177)
    sun_azimuth: float = np.radians(204)
    sun_elevation: float = np.radians(30)
    sun: float = 16.0
    sun_color: Color = (1.0, 0.80, 0.56)
    sky: float = 0.34
    cloud_color: Color = (9.0, 8.6, 8.2)  # before the sky's strength
    clouds: tuple[float, float] = (0.50, 0.78)  # the noise at which they begin and are full

    @property
    def low_sides(self) -> tuple[int, ...]:
        """The sides with neither church nor house."""
        built = {house.side for house in self.houses}
        if "church" not in self.absent:
            built.add(self.church_side)
        return tuple(side for side in SIDES if side not in built)

    @property
    def arch_radius(self) -> float:
        return round(self.bay / 2 - 0.18, 4)

    @property
    def arcade(self) -> float:
        """Axis of the arcade's wall."""
        return self.bay * self.bays / 2

    @property
    def back(self) -> float:
        """Front of the buildings' walls."""
        return self.arcade + ARCADE_WALL / 2 + self.walk

    @property
    def walk_middle(self) -> float:
        return self.back - self.walk / 2

    @property
    def front(self) -> float:
        """Front of the arcade's wall."""
        return self.arcade - ARCADE_WALL / 2

    @property
    def lawn(self) -> float:
        """Outer edge of the lawns: there runs a path along the arcades."""
        return self.arcade - 1.95

    @property
    def bay_axes(self) -> Array:
        return (np.arange(self.bays) - (self.bays - 1) / 2) * self.bay

    @property
    def columns(self) -> Array:
        """Where the columns stand. The first and the last are piers."""
        return np.linspace(-self.arcade, self.arcade, self.bays + 1)

    @property
    def lean_to_top(self) -> float:
        return EAVE + (self.back - self.front + EAVE_OUT) * float(np.tan(SLOPE))

    def side(
        self, number: int, at: Sequence[float] = (0, 0, 0), turn: float = 0, size: float = 1
    ) -> Matrix:
        """To the world from a place in a side's frame; turn: degrees about Z."""
        frame = transform((*self.center, 0), (0, 0, number * np.pi / 2))
        return frame @ transform(at, (0, 0, np.radians(turn)), float(size))

    def on_sides(
        self,
        name: str,
        meshes: Sequence[bpy.types.Mesh],
        *at: ArrayLike,
        sides: Iterable[int] = SIDES,
    ) -> None:
        """Instances of the meshes, taken in turn, at the same places in each of the sides' frames.

        at: up to five of x, y, z (metres), turn (degrees about Z) and size. Each is one number for
        all places, or one for each. Missing values leave the mesh as it is.
        """
        columns = np.atleast_1d(*at, *(0.0, 0.0, 0.0, 0.0, 1.0)[len(at) :])
        for number in sides:
            for i, (*spot, turn, size) in enumerate(np.broadcast(*columns)):
                place(
                    f"{name}.{number}.{i}",
                    meshes[i % len(meshes)],
                    self.side(number, spot, turn, size),
                )


ORIGINAL = Cloister()
