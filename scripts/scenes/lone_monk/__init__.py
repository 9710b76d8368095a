"""Lone Monk: the courtyard of a cloister with a well, four vaulted walks, and one monk.

It follows the scene of that name by Carlo Bergonzini that SILVR used. Code makes every stone here.
"""

from functools import partial

from scenes.library.scene import fill
from scenes.lone_monk import (
    arcades,
    church,
    court,
    furniture,
    middles,
    monk,
    plants,
    roofs,
    sky,
    walls,
)
from scenes.lone_monk.materials import palette
from scenes.lone_monk.place import drawn
from scenes.lone_monk.plan import ORIGINAL

ELEMENTS = (
    sky.sky,
    sky.swallows,
    court.paving,
    court.lawns,
    middles.middle,
    arcades.arcades,
    arcades.vaults,
    walls.back_walls,
    roofs.lean_to_roofs,
    walls.upper_storeys,
    walls.low_walls,
    church.church,
    church.tower,
    furniture.benches,
    furniture.lanterns,
    furniture.jars,
    furniture.chair,
    furniture.broom,
    plants.shrubs,
    plants.hedges,
    plants.olive_tree,
    plants.cypresses,
    plants.ivy,
    plants.geraniums,
    plants.fallen_leaves,
    monk.monk,
)
build = partial(fill, palette, ELEMENTS, drawn=drawn, original=ORIGINAL)
