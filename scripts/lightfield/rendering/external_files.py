"""Lists the files that a .blend reads for its pixels, and finds what is wrong with them."""

import glob
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.core.files import listed, special_kind
from lightfield.core.paths import files_below
from lightfield.imaging.images import is_readable
from lightfield.rendering.blend_file import path_of
from lightfield.rendering.quiet import quiet

# The kind of a file by the type of the data-block that reads it. Sounds, texts (scripts) and movie
# clips affect no pixel.
KINDS = {
    "Image": "texture",
    "Volume": "volume",
    "VectorFont": "font",
    "Library": "library",
    "CacheFile": "cache",
    "Object": "modifier's file",
    # Files that its nodes import, such as an STL.
    "GeometryNodeTree": "geometry",
    # A multiresolution modifier saves its details in a file.
    "Mesh": "sculpted detail",
    # Light profiles (IES).
    "PointLight": "light profile",
    "SpotLight": "light profile",
    "SunLight": "light profile",
    "AreaLight": "light profile",
    "Material": "light profile",
    "World": "light profile",
    "ShaderNodeTree": "light profile",
}


def external_files() -> list[dict[str, Any]]:
    """Return each file that the open .blend reads: ``path`` from its folder, size, time, SHA-256.

    A missing file is listed with None for these, so that its arrival is noticed.
    """
    home = Path(bpy.data.filepath).parent
    files: set[Path] = set()
    for block, path in _blocks_and_absolute_paths():
        files.update(_files(block, path))
    return [listed(file, home) for file in sorted(files)]


def refuse_special(blend: Path) -> None:
    """Raise `UserError` if a .blend names a FIFO or a device. Blender might read it without end."""
    for block, path in _blocks_and_absolute_paths():
        for file in _files(block, path):
            if kind := special_kind(file):
                raise UserError(
                    f"{blend}: the {KINDS[type(block).__name__]} {block.name} is at {file}, which "
                    f"is {kind}; put a file there"
                )


def problems(images: Collection[Any]) -> list[dict[str, str]]:
    """Return the scene's files that are missing or cannot be read.

    Each entry has the ``kind`` and ``name`` of the data-block that reads the file. It also has the
    ``path`` from the .blend's folder, and the ``problem``. An image counts only if it is in
    ``images`` (read by shading), or if a modifier reads it.
    """
    home = Path(bpy.data.filepath).parent
    users = bpy.data.user_map()
    problem_entries = []

    def note(block: Any, kind: str, path: Path, problem: str) -> None:
        name = {"kind": kind, "name": block.name}
        problem_entries.append(name | {"path": _from(home, path), "problem": problem})

    for block, path in _blocks_and_absolute_paths():
        if not _is_needed(block, images, users):
            continue
        for file in _files(block, path):
            problem = _problem(block, file)
            if problem:
                note(block, KINDS[type(block).__name__], file, problem)
    for block in users:
        if block.library and block.is_missing and path_of(block.library).is_file():
            library = path_of(block.library)
            note(block, f"linked {type(block).__name__.lower()}", library, "not in its library")
    return sorted(problem_entries, key=lambda entry: (entry["kind"], entry["path"], entry["name"]))


def check_reachable(blend: Path, files: Iterable[Mapping[str, Any]]) -> None:
    """Check that jobs on other machines find the ``files`` of `external_files`.

    They open a copy of ``blend`` in another folder, at the same relative path. Raises `UserError`
    if the copy would not find a file: its path in the .blend is absolute, or it lies outside this
    folder.
    """
    unreachable = [path for block, path in _blocks_and_paths() if _is_absolute(block, path)]
    paths = (os.path.normpath(blend.parent / file["path"]) for file in files if file["bytes"])
    unreachable += [path for path in paths if path.startswith("..")]
    if unreachable:
        count = f" and {len(unreachable) - 1} more" if unreachable[1:] else ""
        raise UserError(
            f"{blend}: reads {unreachable[0]}{count}; with a "
            "storage, what a .blend reads must lie in this folder and be named from the .blend (in "
            "Blender: File, External Data, Make Paths Relative), or be packed into it"
        )


def _is_absolute(block: Any, path: str) -> bool:
    """Return whether the path of an existing file is absolute in the .blend."""
    return not path.startswith("//") and any(file.is_file() for file in _files(block, path))


def _blocks_and_paths() -> Iterator[tuple[Any, str]]:
    """Yield each data-block that reads a file, and the path as the .blend has it."""
    for library in bpy.data.libraries:
        # Packed data-blocks are in an archive, which keeps the name of the file. Nothing reads it.
        is_packed = library.packed_file or library.is_archive
        if library.users_id and not is_packed:
            yield library, library.filepath
    for block, paths in bpy.data.file_path_map().items():
        if type(block).__name__ in KINDS and not _is_packed(block):
            for path in sorted(paths):
                # Blender lists this folder for all particles, even if their cache is in the .blend.
                if not (isinstance(block, bpy.types.Object) and _is_cache_folder(block, path)):
                    yield block, path
    # Blender lists paths inside nodes, but no paths in the inputs of a modifier.
    for obj in bpy.data.objects:
        for modifier in _node_modifiers(obj):
            tree = modifier.node_group
            for item in tree.interface.items_tree if tree else ():
                if getattr(item, "subtype", None) != "FILE_PATH":
                    continue
                path = _modifier_input(modifier, item.identifier)
                if path:
                    yield obj, path


def _node_modifiers(obj: Any) -> list[Any]:
    return [modifier for modifier in obj.modifiers if modifier.type == "NODES"]


def _modifier_input(modifier: Any, identifier: str) -> str:
    """Return the text of an input of a geometry nodes modifier."""
    # Blender 5.2 keeps the inputs in `properties`.
    inputs = getattr(modifier, "properties", None)
    return str(getattr(inputs.inputs, identifier).value if inputs else modifier[identifier])


def _blocks_and_absolute_paths() -> Iterator[tuple[Any, str]]:
    """Yield each data-block that reads a file or a cache's folder, and the absolute path."""
    for block, path in _blocks_and_paths():
        yield block, bpy.path.abspath(path, library=block.library)
    for obj in bpy.data.objects:
        folder = _cache_folder(obj)
        caches = [getattr(modifier, "point_cache", None) for modifier in obj.modifiers]
        caches += [system.point_cache for system in obj.particle_systems]
        if any(cache and cache.use_disk_cache and not cache.use_external for cache in caches):
            yield obj, str(folder)
        for modifier in _node_modifiers(obj):
            bake_folders = {modifier.bake_directory}
            bake_folders.update(bake.directory for bake in modifier.bakes)
            bake_folders.discard("")
            if modifier.bakes:
                bake_folders.add(str(folder))
            for bake_folder in sorted(bake_folders):
                path = bpy.path.abspath(bake_folder, library=obj.library)
                # A bake may be in the .blend itself.
                if Path(path).is_dir():
                    yield obj, path


def _cache_folder(obj: Any) -> Path:
    """Return the folder beside an object's .blend where Blender keeps its caches on disk."""
    blend = path_of(obj.library) if obj.library else Path(bpy.data.filepath)
    return blend.parent / f"blendcache_{blend.stem}"


def _is_cache_folder(obj: Any, path: str) -> bool:
    absolute = bpy.path.abspath(path, library=obj.library)
    return bool(os.path.normpath(absolute) == os.path.normpath(_cache_folder(obj)))


def _is_packed(block: Any) -> bool:
    if isinstance(block, bpy.types.Image):
        return bool(block.packed_files) or block.source in ("GENERATED", "VIEWER")
    return isinstance(block, bpy.types.Library) or bool(getattr(block, "packed_file", None))


def _is_needed(block: Any, images: Collection[Any], users: Mapping[Any, Any]) -> bool:
    if isinstance(block, bpy.types.Image):
        modifiers = (bpy.types.Texture, bpy.types.GeometryNodeTree)
        return block in images or any(isinstance(user, modifiers) for user in users[block])
    return isinstance(block, bpy.types.Library) or block.users > block.use_fake_user


def _files(block: Any, path: str) -> list[Path]:
    """Return the files that a path stands for. Return the path itself if they do not exist."""
    folder = Path(path)
    # Only a modifier has a folder, for its cache.
    if isinstance(block, bpy.types.Object) and folder.is_dir():
        return [*files_below(folder)] or [folder]
    if isinstance(block, bpy.types.Image) and block.source == "TILED":
        return [_tile(path, tile.number) for tile in block.tiles]
    sequence = getattr(block, "source", "") == "SEQUENCE" or getattr(block, "is_sequence", False)
    if sequence:
        stem = glob.escape(re.sub(r"\d+$", "", folder.stem))
        return sorted(folder.parent.glob(f"{stem}*{folder.suffix}")) or [folder]
    return [folder]


def _tile(path: str, number: int) -> Path:
    """Return the file of a UDIM tile. The numbers begin at 1001, with ten tiles in a row."""
    row, column = divmod(number - 1001, 10)
    name = path.replace("<UDIM>", str(number))
    return Path(name.replace("<UVTILE>", f"u{column + 1}_v{row + 1}"))


def _problem(block: Any, path: Path) -> str | None:
    """Return the problem of a file, or None. Blender itself would only print it."""
    if not path.exists():
        return "missing"
    if path.is_dir() and not isinstance(block, bpy.types.Object):
        return "is a folder"
    readable = True
    if isinstance(block, bpy.types.Image) and block.source != "MOVIE":
        # Do not let Blender read it: 5.0 crashes on some broken EXRs.
        readable = is_readable(path)
    elif isinstance(block, bpy.types.Volume):
        readable = block.grids.load()
    elif isinstance(block, bpy.types.VectorFont):
        try:
            with quiet():
                bpy.data.fonts.remove(bpy.data.fonts.load(str(path)))
        except RuntimeError:
            readable = False
    return None if readable else "cannot be read"


def _from(home: Path, path: Path) -> str:
    return Path(os.path.relpath(path, home)).as_posix()
