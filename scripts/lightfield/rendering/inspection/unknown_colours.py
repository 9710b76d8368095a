"""Finds the colour settings of a .blend that Blender's OpenColorIO does not have.

Programs with another configuration of OpenColorIO, such as one of ACES, write such files. Blender
replaces the settings when it opens the file. Only the lines that it prints have their names.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import bpy

from lightfield.rendering.scenes.quiet import quiet

Unknown = Mapping[str, Sequence[str]]
"""The unknown names by the setting that has them, each sorted."""

# What Blender prints. Each name may hold quotes.
_LINES = {
    "display": re.compile(r'Display "(.*)" used by scene not found, setting to "'),
    "view_transform": re.compile(r'scene view "(.*)" not found, setting to "'),
    "look": re.compile(r'scene look "(.*)" not found, setting default "'),
    "texture": re.compile(r'image colorspace "(.*)" not found, will use default instead'),
    # Blender prints the name that it takes, and not the file's.
    "working_space": re.compile("(Unknown) scene linear working space"),
}


def named_in(printed: str) -> Unknown:
    """Return the unknown names in what Blender ``printed`` while it opened a .blend."""
    names = {setting: sorted({*line.findall(printed)}) for setting, line in _LINES.items()}
    return {setting: found for setting, found in names.items() if found}


def of_scene(unknown: Unknown) -> dict[str, list[str]]:
    """Return the names in ``unknown`` that the current scene may have had.

    The names may be another scene's if the current scene has another setting than Blender puts in
    their place.
    """
    scene = bpy.context.scene
    replaced = {
        "display": scene.display_settings.display_device == "sRGB",
        "view_transform": scene.view_settings.view_transform == "Standard",
        "look": scene.view_settings.look == "None",
        "working_space": True,
    }
    return {
        setting: list(unknown[setting])
        for setting, is_replaced in replaced.items()
        if is_replaced and setting in unknown
    }


def textures(unknown: Unknown, shaded: Collection[str]) -> list[dict[str, str]]:
    """Return the images in use whose colour space is unknown, as entries of ``missing``.

    ``shaded`` are the full names of the images that shading reads. Modifiers may read others.
    """
    if "texture" not in unknown:
        return []
    users = bpy.data.user_map(subset=list(bpy.data.images))
    modifiers = (bpy.types.Texture, bpy.types.GeometryNodeTree)
    problem = f"with a colour space that Blender lacks ({' or '.join(unknown['texture'])})"
    # Blender prints a warning for each setting without a name.
    with quiet():
        images = [image for image in users if not image.colorspace_settings.name]
    return [
        {"kind": "texture", "name": image.name, "path": _file_name(image), "problem": problem}
        for image in sorted(images, key=lambda image: str(image.name_full))
        if image.name_full in shaded or any(isinstance(user, modifiers) for user in users[image])
    ]


def refusal(path: Path, entries: Sequence[Mapping[str, str]], unknown: Unknown) -> str | None:
    """Return why the colours of the .blend at ``path`` would be wrong, or None.

    ``entries`` are of `textures`.
    """
    if "working_space" in unknown:
        return (
            f"{path}: its working space is one that Blender's OpenColorIO lacks, so all colours "
            "would be other ones; choose a working space of Blender, or accept this: scene: "
            "{allow_missing: true}"
        )
    if not entries:
        return None
    names = ", ".join(entry["name"] for entry in entries[:8])
    return (
        f"{path}: {names}{' …' if len(entries) > 8 else ''}: {_plural(len(entries))} "
        f"{entries[0]['problem']}, so the pixels would be taken as they are, without a conversion; "
        "choose a colour space of Blender for each image, or accept this: scene: "
        "{allow_missing: true}"
    )


def _plural(count: int) -> str:
    return "a texture" if count == 1 else f"{count} textures"


def _file_name(image: Any) -> str:
    """Return the name of an image's file. A packed image may have none."""
    return Path(image.filepath.removeprefix("//")).name or str(image.name)
