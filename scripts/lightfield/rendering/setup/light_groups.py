"""Renders the light of each light group of a scene into a pass of its own."""

from collections.abc import Mapping, Sequence
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.formats.light_groups import WORLD
from lightfield.rendering.setup import shadow_catchers


def set_up(layer: Any, groups: Mapping[str, Sequence[str]]) -> None:
    """Render the light of each of the ``groups`` into a pass of its own.

    An object's group contains its instances, its glowing volume, and all its materials. Raises
    `UserError` for a scene whose groups would not add up to the colour.
    """
    if catchers := shadow_catchers.names():
        raise UserError(
            f"render.light_groups: {catchers[0]} is a shadow catcher, whose shadow is in no "
            "light group; make it an ordinary object, or leave light_groups out"
        )
    group_of = {emitter: group for group, emitters in groups.items() for emitter in emitters}
    for group in groups:
        layer.lightgroups.add(name=group)
    for obj in bpy.data.objects:
        obj.lightgroup = group_of.get(str(obj.name_full), "")
    for world in bpy.data.worlds:
        world.lightgroup = group_of.get(WORLD, "")
