"""A Zen garden at sunrise: the elements that light-field methods find hard, all round the viewer.

The rigs stand in the middle of a raked gravel court. The fire and the pond's ripples move with the
frame number, all else is still.
"""

from collections.abc import Mapping
from typing import Any

from scenes.garden.court import flagstones, gravel, kerb, terrain
from scenes.garden.distance import fog, mountains, sky
from scenes.garden.fire import candles, fire
from scenes.garden.lanterns import floor_lanterns, paper_globes, stone_lanterns
from scenes.garden.materials import palette
from scenes.garden.pond import carp, iris, water, water_lilies
from scenes.garden.rocks import rocks
from scenes.garden.statue import mirror, statue
from scenes.garden.torii import torii
from scenes.garden.trees import bamboo, maple, pines, woods
from scenes.garden.undergrowth import fallen_leaves, grass, shrubs
from scenes.library.scene import Scene

ELEMENTS = (
    *(sky, mountains, fog),
    *(terrain, gravel, flagstones, kerb, rocks),
    *(statue, mirror, torii),
    *(stone_lanterns, paper_globes, floor_lanterns, fire, candles),
    *(water, water_lilies, carp, iris),
    *(bamboo, maple, pines, woods, shrubs, grass, fallen_leaves),
)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int), `detail` (1.0 is the full garden)."""
    scene = Scene(int(parameters["seed"]), float(parameters["detail"]), palette())
    for element in ELEMENTS:
        element(scene)
