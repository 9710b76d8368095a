"""Lone Monk: the courtyard of a cloister with a well, four vaulted walks, and one monk.

After the scene of that name by Carlo Bergonzini that SILVR used; every stone here is made by code.
"""

from collections.abc import Mapping
from typing import Any

from scenes.library.scene import Scene
from scenes.lone_monk.arcades import arcades, vaults
from scenes.lone_monk.church import church, tower
from scenes.lone_monk.court import lawns, paving
from scenes.lone_monk.furniture import benches, broom, chair, jars, lanterns
from scenes.lone_monk.materials import palette
from scenes.lone_monk.monk import monk
from scenes.lone_monk.plants import cypresses, fallen_leaves, geraniums, ivy, olive_tree, shrubs
from scenes.lone_monk.roofs import lean_to_roofs
from scenes.lone_monk.sky import sky, swallows
from scenes.lone_monk.walls import back_walls, upper_storeys, west_wall
from scenes.lone_monk.well import well

ELEMENTS = (
    *(sky, swallows, paving, lawns, well, arcades, vaults, back_walls, lean_to_roofs),
    *(upper_storeys, west_wall, church, tower, benches, lanterns, jars, chair, broom),
    *(shrubs, olive_tree, cypresses, ivy, geraniums, fallen_leaves, monk),
)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene. parameters: `seed` (int), `detail` (1.0 is the full cloister)."""
    scene = Scene(int(parameters["seed"]), float(parameters["detail"]), palette())
    for element in ELEMENTS:
        element(scene)
