"""Opens scenes from .blend files, with their scripts disabled, and saves scenes."""

import os
import struct
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable
from lightfield.engine import receipts
from lightfield.geometry import boards
from lightfield.rendering.scenes import animation
from lightfield.rendering.scenes import boards as scene_boards
from lightfield.rendering.scenes.quiet import quiet, reading_quietly


def new_scene() -> None:
    """Open an empty scene without a world, with one empty view layer."""
    _reset_preferences()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)


@cache
def _reset_preferences() -> None:
    """Give Blender its factory settings. Only once, because each time leaks memory of add-ons."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


def save_scene(path: Path) -> None:
    """Save the current scene as a compressed .blend, without backups. Raises OSError."""
    bpy.context.preferences.filepaths.save_version = 0
    try:
        with quiet():
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, copy=True)
    except RuntimeError as error:
        raise OSError(str(error).strip()) from None
    _check_blend(path)


def _check_blend(path: Path) -> None:
    """Raise an OSError for a compressed .blend that is cut short. Blender itself does not.

    The file ends with a table of its Zstandard frames; see "Zstandard Seekable Format" of the zstd
    project. The table has a head of 8 bytes, 8 bytes for each frame, and a foot of 9 bytes. The
    first 4 bytes for a frame are its compressed length. The foot begins with the number of frames,
    and ends with a magic number.
    """
    content = path.read_bytes()
    is_complete = content.endswith(b"\xb1\xea\x92\x8f")
    if is_complete:
        count = int.from_bytes(content[-9:-5], "little")
        lengths = struct.unpack(f"<{2 * count}I", content[-9 - 8 * count : -9])[::2]
        is_complete = len(content) == sum(lengths) + 8 + 8 * count + 9
    if not is_complete:
        raise OSError("the file is cut short")


def open_scene(
    path: Path,
    scene_block: Mapping[str, Any] = MappingProxyType({}),
    inventory: Mapping[str, Any] | None = None,
    printed: Path = Path(os.devnull),
) -> list[str]:
    """Open a .blend with its scripts disabled. Return the names of the view layers to render.

    ``scene_block`` is the block ``scene`` of a scene YAML. Its ``scene_name`` and ``view_layers``
    choose the scene and its view layers, and its ``targets`` are added. ``inventory`` lists the
    files that the .blend reads, which become inputs of the job at work. The file ``printed`` gets
    what Blender prints.

    Raises `UserError` if Blender cannot read the file, or if the scene or a view layer is missing.
    Also raises it if a newer Blender saved the file or a linked library: this one would lose data.
    """
    check_readable(path)
    if inventory:
        # A texture that changes during a run must not end up in some views only.
        files = inventory.get("external_files", ())
        receipts.note_inputs(path.parent / file["path"] for file in files)
    this_version = bpy.app.version_string
    try:
        with reading_quietly(path, printed):
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        problem = str(error).strip()
        raise UserError(f"{path}: Blender {this_version} cannot open it: {problem}") from None
    libraries = [(path_of(library), library.version) for library in bpy.data.libraries]
    for file, saved in [(path, bpy.data.version), *libraries]:
        if tuple(saved[:2]) > bpy.app.version[:2]:
            newer = f"{saved[0]}.{saved[1]}"
            raise UserError(
                f"{file}: was saved by Blender {newer}, and Blender {this_version} would lose what "
                f"is new in it; build with bpy {newer}, or save it with Blender "
                f"{bpy.app.version[0]}.{bpy.app.version[1]}"
            )
    targets = boards.from_settings(scene_block.get("targets") or {}, "targets")
    try:
        layers = _choose(scene_block.get("scene_name"), scene_block.get("view_layers"))
        scene_boards.add(targets)
        return layers
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _choose(scene_name: str | None, view_layers: str | Sequence[str] | None) -> list[str]:
    """Make a scene the current one, and join its chosen view layers. Return their names."""
    window = bpy.context.window
    if scene_name is not None:
        if scene_name not in bpy.data.scenes:
            names = ", ".join(scene.name for scene in bpy.data.scenes)
            raise UserError(f"scene_name: is {scene_name!r}; must be one of {names}")
        window.scene = bpy.data.scenes[scene_name]
    all_layers = window.scene.view_layers
    layers = [layer for layer in all_layers if layer.use] or [all_layers[0]]
    if view_layers is None:
        layers = layers[:1]
    elif view_layers != "all":
        for name in view_layers:
            if name not in all_layers:
                names = ", ".join(layer.name for layer in all_layers)
                raise UserError(f"view_layers: {name!r} is not one of {names}")
        layers = [all_layers[name] for name in view_layers]
    _join(layers)
    # Keyframes may turn view layers on and off.
    animation.mute(window.scene, ("view_layers[",))
    for layer in all_layers:
        layer.use = layer == layers[0]
    window.view_layer = layers[0]
    return [layer.name for layer in layers]


def _join(layers: Sequence[Any]) -> None:
    """Make the first of some view layers show all collections that any of them shows.

    A collection is a holdout, or for indirect light only, if it is so in all layers that show it.
    """
    overrides = {(layer.material_override, layer.world_override) for layer in layers}
    if len(overrides) > 1:
        names = ", ".join(layer.name for layer in layers)
        raise UserError(f"view_layers: {names} differ in their overrides; render them one by one")
    settings: list[tuple[Any, bool, bool, bool]] = []

    def visit(parts: Sequence[Any]) -> None:
        shown = [part for part in parts if not part.exclude]
        settings.append(
            (
                parts[0],
                not shown,
                bool(shown) and all(part.holdout for part in shown),
                bool(shown) and all(part.indirect_only for part in shown),
            )
        )
        for children in zip(*(part.children for part in parts), strict=True):
            visit(children)

    if len(layers) > 1:
        visit([layer.layer_collection for layer in layers])
    # Outer collections first, because a collection changes the collections inside it.
    for part, exclude, holdout, indirect in settings:
        if part.exclude != exclude:
            part.exclude = exclude
        part.holdout = holdout
        part.indirect_only = indirect


def path_of(block: Any) -> Path:
    """Return the absolute path of a data-block's file."""
    return Path(bpy.path.abspath(block.filepath, library=block.library))
