"""Furnished rooms: each place is another room, with pieces of the other scenes in it.

The rigs stand round the world's origin. No furniture comes into x, y in ±0.6 m, nor a lamp below
2.1 m there. Without a place, the room is that of place 0.
"""

from functools import partial

from scenes.library.scene import fill
from scenes.rooms import furniture, lamps, shell
from scenes.rooms.materials import palette
from scenes.rooms.place import drawn

ELEMENTS = (
    lamps.daylight,
    lamps.ceiling_lamps,
    shell.floor,
    shell.ceiling,
    shell.walls,
    shell.skirting,
    shell.windows,
    shell.door,
    furniture.furniture,
    furniture.pictures,
)
build = partial(fill, palette, ELEMENTS, drawn=drawn, original=drawn(0))
