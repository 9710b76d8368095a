"""A Zen garden at sunrise: the elements that light-field methods find hard, all round the viewer.

The rigs stand in the middle of a raked gravel court. The fire and the pond's ripples move with the
frame number, all else is still.
"""

from functools import partial

from scenes.garden import court, distance, fire, lanterns, monuments, pond, trees, undergrowth
from scenes.garden.materials import palette
from scenes.garden.place import drawn
from scenes.garden.plan import ORIGINAL
from scenes.library.scene import fill

ELEMENTS = (
    distance.sky,
    distance.mountains,
    distance.fog,
    court.terrain,
    court.gravel,
    court.flagstones,
    court.kerb,
    court.rocks,
    monuments.statue,
    monuments.mirror,
    monuments.torii,
    lanterns.stone_lanterns,
    lanterns.paper_globes,
    lanterns.floor_lanterns,
    fire.fire,
    fire.candles,
    pond.water,
    pond.water_lilies,
    pond.carp,
    pond.iris,
    trees.bamboo,
    trees.maple,
    trees.pines,
    trees.woods,
    undergrowth.shrubs,
    undergrowth.grass,
    undergrowth.fallen_leaves,
)
build = partial(fill, palette, ELEMENTS, drawn=drawn, original=ORIGINAL)
