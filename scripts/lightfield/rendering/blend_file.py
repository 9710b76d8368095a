"""Scenes from and to .blend files: opened with their scripts disabled, saved whole."""

import struct
from pathlib import Path
from typing import Any

import bpy

from lightfield.core.errors import UserError
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
    whole = content.endswith(b"\xb1\xea\x92\x8f")
    if whole:
        count = int.from_bytes(content[-9:-5], "little")
        lengths = struct.unpack(f"<{2 * count}I", content[-9 - 8 * count : -9])[::2]
        whole = len(content) == sum(lengths) + 8 + 8 * count + 9
    if not whole:
        raise OSError("the file is cut short")


def open_scene(path: Path) -> None:
    """Open a .blend with its scripts disabled.

    Raises `UserError` if Blender cannot read it, or would lose what it does not know: where a newer
    version saved it, or a library that it links.
    """
    here = bpy.app.version_string
    try:
        with quiet():
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
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


def path_of(block: Any) -> Path:
    """Return the absolute path of a data-block's file."""
    return Path(bpy.path.abspath(block.filepath, library=block.library))
