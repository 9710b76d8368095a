"""Light groups: which emitters of a scene share a pass, and how a relighting weighs their light.

An emitter is a lamp, an object with a glowing material, or the world. Its name is the object's full
name in the .blend, or `WORLD`. A group is a name and its emitters.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from lightfield.core.errors import UserError
from lightfield.settings.base import suggestion

EACH = "each"
"""The word in a scene YAML for a group of its own for each emitter."""

WORLD = "World"
"""The name of the world among the emitters."""

REST = "rest"
"""The group of all emitters that the scene YAML does not name."""

_MOST_GROUPS = 255
"""Cycles counts a path's light group in 8 bits, of which one value means none."""

LONGEST_NAME = 40

NAME_PATTERN = rf"^[A-Za-z0-9][A-Za-z0-9_-]{{0,{LONGEST_NAME - 1}}}$"

_KEY = "render.light_groups"

_Setting = str | Sequence[str] | Mapping[str, Sequence[str]]


def _group_name(emitter: str) -> str:
    """Return the name of the group of one emitter: its name with only letters, digits, _ and -."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", emitter).strip("_-")[:LONGEST_NAME]
    return name or "emitter"


def names_in(setting: _Setting | None) -> list[str] | None:
    """Return the names of the groups that a scene YAML names. None with `EACH`, or without groups.

    A scene may have the group `REST` besides.
    """
    if setting is None or setting == EACH:
        return None
    if isinstance(setting, Mapping):
        return [*setting]
    return [*_named_apart(setting)]


def resolved(setting: _Setting, emitters: Sequence[str]) -> dict[str, list[str]]:
    """Return the emitters of each group of a scene that has these ``emitters``.

    Raises `UserError` for an emitter that the scene lacks, and for too many groups.
    """
    if not emitters:
        raise UserError(f"{_KEY}: the scene has no emitter: no lamp, glowing object or world")
    if setting == EACH:
        groups = _named_apart(emitters)
    elif isinstance(setting, Mapping):
        groups = {name: [*members] for name, members in setting.items()}
    else:
        groups = _named_apart(setting)
    named = {emitter for members in groups.values() for emitter in members}
    for emitter in sorted(named):
        if emitter not in emitters:
            hint = suggestion(emitter, emitters) or f"; it has {_listed(emitters)}"
            raise UserError(f"{_KEY}: the scene has no emitter {emitter!r}{hint}")
    others = [emitter for emitter in emitters if emitter not in named]
    if others:
        groups[REST] = others
    if len(groups) > _MOST_GROUPS:
        raise UserError(
            f"{_KEY}: makes {len(groups)} groups, and Cycles can have {_MOST_GROUPS}; put several "
            "emitters into one group"
        )
    return groups


def _named_apart(emitters: Sequence[str]) -> dict[str, list[str]]:
    """Return a group for each emitter. Groups whose names would be equal are numbered.

    Counts names as equal if they differ in capitals alone, for filesystems that ignore case.
    """
    groups: dict[str, list[str]] = {}
    taken = {REST}
    for emitter in sorted(emitters, key=lambda name: (name != WORLD, name)):
        name = _group_name(emitter)
        number = 1
        while name.lower() in taken:
            number += 1
            suffix = f"_{number}"
            name = _group_name(emitter)[: LONGEST_NAME - len(suffix)] + suffix
        taken.add(name.lower())
        groups[name] = [emitter]
    return groups


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (" …" if len(names) > 8 else "")


def weights(light: Mapping[str, Any], groups: Sequence[str]) -> dict[str, list[float]]:
    """Return the factor of red, green and blue of each of the ``groups``. 1 if not in ``light``.

    Raises ValueError for a group that is none of them.
    """
    for name in light:
        if name not in groups:
            hint = suggestion(name, groups) or f"; there are {_listed(groups)}"
            raise ValueError(f"there is no light group {name!r}{hint}")
    factors = {}
    for name in groups:
        factor = light.get(name, 1.0)
        colour = factor if isinstance(factor, Sequence) else [factor] * 3
        factors[name] = [float(value) for value in colour]
    return factors
