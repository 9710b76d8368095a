"""A still life on a round walnut board: an object to walk around, of materials hard to render.

It has copper, brass and silver, glass with wine, linen, wax, porcelain, fruit, pearls, and a downy
chick. The middle of the board's top is the world's origin. The board's radius is 0.3 m. Nothing is
higher than 0.25 m. No camera sees the lamps.
"""

from functools import partial

from scenes.library.scene import fill
from scenes.still_life import board, chick, fruit, vessels
from scenes.still_life.materials import palette
from scenes.still_life.plan import ORIGINAL, drawn

ELEMENTS = (
    board.lamps,
    board.board,
    board.cloth,
    board.pearls,
    vessels.kettle,
    vessels.carafe,
    vessels.wineglass,
    vessels.candle,
    vessels.bowl,
    vessels.knife,
    fruit.pears,
    fruit.grapes,
    fruit.lemons,
    chick.chick,
)
build = partial(fill, palette, ELEMENTS, drawn=drawn, original=ORIGINAL)
