"""A still life on a round walnut board: an object to walk around, of all that is hard to render.

Copper, brass and silver, glass with wine in it, linen, wax, porcelain, fruit, pearls, and a chick
of down. The middle of the board's top is the world's origin; the board's radius is 0.3 m, and
nothing is higher than 0.25 m. Lamps are seen by no camera.
"""

from collections.abc import Mapping
from typing import Any

from scenes.library.scene import Scene
from scenes.still_life.board import board, cloth, pearls
from scenes.still_life.chick import chick
from scenes.still_life.fruit import grapes, lemons, pears
from scenes.still_life.lamps import lamps
from scenes.still_life.materials import palette
from scenes.still_life.vessels import bowl, candle, carafe, kettle, knife, wineglass

ELEMENTS = (
    *(lamps, board, cloth, pearls, kettle, carafe, wineglass, candle, bowl, knife),
    *(pears, grapes, lemons, chick),
)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int), `detail` (1.0 is all of it)."""
    scene = Scene(int(parameters["seed"]), float(parameters["detail"]), palette())
    for element in ELEMENTS:
        element(scene)
