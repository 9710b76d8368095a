"""Scenes from and to .blend files: opened with their scripts disabled, saved whole."""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable
from lightfield.dataset.view_store import ViewStore
from lightfield.rendering import animation
from lightfield.rendering.quiet import quiet


def new_scene() -> None:
    """Start from an empty scene with one empty world-less view layer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


def save_scene(path: Path) -> None:
    """Save the current scene as a compressed .blend without backup copies; OSError if it fails."""
    bpy.context.preferences.filepaths.save_version = 0
    try:
        with quiet():
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, copy=True)
    except RuntimeError as error:
        raise OSError(str(error).strip()) from None
    _check_blend(path)


def _check_blend(path: Path) -> None:
    """Raise an OSError for a compressed .blend that is cut short, of which Blender says nothing.

    It ends with the table of its Zstandard frames: see "Zstandard Seekable Format" of the zstd
    project. A head of 8 bytes, 8 bytes a frame of which the first 4 are its compressed length, and
    9 bytes, which begin with the number of frames and end with a magic number.
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
    chosen: Mapping[str, Any] = MappingProxyType({}),
    inventory: Mapping[str, Any] | None = None,
) -> list[str]:
    """Open a .blend with its scripts disabled, and return the names of the view layers rendered.

    These and the scene are those of ``scene_name`` and ``view_layers`` in ``chosen``, a scene
    YAML's ``scene`` block. With a view store the files that it reads, by its ``inventory``, are
    taken from there. Raises `UserError` if Blender cannot read the file, or would lose what it does
    not know: where a newer version saved it, or a library that it links; and where what is chosen
    is not there.
    """
    _take_files(path, inventory or {})
    here = bpy.app.version_string
    try:
        with quiet():
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        check_readable(path)
        raise UserError(f"{path}: Blender {here} cannot open it: {str(error).strip()}") from None
    libraries = [(path_of(library), library.version) for library in bpy.data.libraries]
    for file, saved in [(path, bpy.data.version), *libraries]:
        if tuple(saved[:2]) > bpy.app.version[:2]:
            newer = f"{saved[0]}.{saved[1]}"
            raise UserError(
                f"{file}: was saved by Blender {newer}, and Blender {here} would lose what is "
                f"new in it; build with bpy {newer}, or save it with Blender "
                f"{bpy.app.version[0]}.{bpy.app.version[1]}"
            )
    try:
        return _choose(chosen.get("scene_name"), chosen.get("view_layers"))
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _take_files(path: Path, inventory: Mapping[str, Any]) -> None:
    """Take from the view store, if there is one, the files that the .blend at ``path`` reads."""
    store = ViewStore.configured()
    if store is None:
        return
    for file in inventory.get("external_files", ()):
        if file["bytes"] and not store.take(file["sha256"], path.parent / file["path"]):
            raise UserError(
                f"{path}: reads {file['path']}, which is not in the view store {store.url}; "
                "the next run puts it there"
            )


def _choose(scene_name: str | None, view_layers: str | Sequence[str] | None) -> list[str]:
    """Make a scene the current one, and some of its view layers the only one that is in use."""
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
                raise UserError(f"view_layers: {name!r} is none of {names}")
        layers = [all_layers[name] for name in view_layers]
    _join(layers)
    # Keyframes may turn view layers on and off.
    animation.mute(window.scene, ("view_layers[",))
    for layer in all_layers:
        layer.use = layer == layers[0]
    window.view_layer = layers[0]
    return [layer.name for layer in layers]


def _join(layers: Sequence[Any]) -> None:
    """Let the first of some view layers show each collection that any of them shows.

    One is a holdout, or there for indirect light alone, where it is so in all that show it.
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
    # From the outside in, for a collection takes those inside it along.
    for part, exclude, holdout, indirect in settings:
        if part.exclude != exclude:
            part.exclude = exclude
        part.holdout, part.indirect_only = holdout, indirect


def path_of(block: Any) -> Path:
    """Return the absolute path of a data-block's file."""
    return Path(bpy.path.abspath(block.filepath, library=block.library))
