"""Files beside a .blend of which its pixels are made, and what is wrong with them."""

import glob
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.dataset.view_store import ViewStore
from lightfield.imaging.images import is_readable
from lightfield.rendering.blend_file import path_of
from lightfield.rendering.quiet import quiet

# What a file is called by the type of the data-block that reads it. Sounds, texts (scripts) and
# movie clips make no pixel.
KINDS = {
    "Image": "texture",
    "Volume": "volume",
    "VectorFont": "font",
    "Library": "library",
    "CacheFile": "cache",
    "Object": "modifier's file",
    # What its nodes import, such as an STL.
    "GeometryNodeTree": "geometry",
    # Of a multiresolution modifier.
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

    A file that is not there has None for these: that it has come is noticed, too.
    """
    home = Path(bpy.data.filepath).parent
    files = {file for block, path in _read() for file in _files(block, path)}
    return [_entry(file, home) for file in sorted(files)]


def problems(images: Collection[Any]) -> list[dict[str, str]]:
    """Return what of the scene's files is missing or cannot be read.

    Each has ``kind`` and ``name`` of what reads it, its ``path`` from the .blend's folder, and
    ``problem``. Of images count those that shading reads, ``images``, and those of modifiers.
    """
    home = Path(bpy.data.filepath).parent
    users = bpy.data.user_map()
    problem_entries = []

    def note(block: Any, kind: str, path: Path, problem: str) -> None:
        name = {"kind": kind, "name": block.name}
        problem_entries.append(name | {"path": _from(home, path), "problem": problem})

    for block, path in _read():
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


def put(blend: Path, files: Iterable[Mapping[str, Any]], store: ViewStore) -> None:
    """Put the ``files`` of `external_files` into a view store, for who opens a copy of ``blend``.

    Raises `UserError` where a copy, which lies in another folder at the same path, would not find
    them: the open .blend names one from the root of the disk, or one is outside this folder.
    """
    there = [file for file in files if file["bytes"]]
    far = [path for block, path in _named() if _is_far(block, path)]
    paths = (os.path.normpath(blend.parent / file["path"]) for file in there)
    far += [path for path in paths if path.startswith("..")]
    if far:
        raise UserError(
            f"{blend}: reads {far[0]}{f' and {len(far) - 1} more' if far[1:] else ''}; with a "
            "storage, what a .blend reads must lie in this folder and be named from the .blend (in "
            "Blender: File, External Data, Make Paths Relative), or be packed into it"
        )
    for file in there:
        store.put(blend.parent / file["path"], file["sha256"])


def _is_far(block: Any, path: str) -> bool:
    """Whether a file that is there is named from the root of the disk."""
    return not path.startswith("//") and any(file.is_file() for file in _files(block, path))


def _named() -> Iterator[tuple[Any, str]]:
    """Yield each data-block that reads a file, and the path as it stands in the .blend."""
    for library in bpy.data.libraries:
        if not library.packed_file:
            yield library, library.filepath
    for block, paths in bpy.data.file_path_map().items():
        if type(block).__name__ in KINDS and not _is_packed(block):
            for path in sorted(paths):
                # Blender lists it for all particles, also where their cache is in the .blend.
                if not (isinstance(block, bpy.types.Object) and _is_cache_folder(block, path)):
                    yield block, path
    # Blender lists the names that stand in a node, and not those that a modifier gives to it.
    for thing in bpy.data.objects:
        for modifier in _nodes(thing):
            tree = modifier.node_group
            for item in tree.interface.items_tree if tree else ():
                is_path = getattr(item, "subtype", None) == "FILE_PATH"
                if is_path and (path := _given(modifier, item.identifier)):
                    yield thing, path


def _nodes(thing: Any) -> list[Any]:
    return [modifier for modifier in thing.modifiers if modifier.type == "NODES"]


def _given(modifier: Any, identifier: str) -> str:
    """Return the text that a geometry nodes modifier has for an input."""
    # Blender 5.2 has its inputs in a place of their own.
    inputs = getattr(modifier, "properties", None)
    return str(getattr(inputs.inputs, identifier).value if inputs else modifier[identifier])


def _read() -> Iterator[tuple[Any, str]]:
    """Yield each data-block that reads a file, and the path as Blender has it, absolute."""
    for block, path in _named():
        yield block, bpy.path.abspath(path, library=block.library)
    for thing in bpy.data.objects:
        folder = _cache_folder(thing)
        caches = [getattr(modifier, "point_cache", None) for modifier in thing.modifiers]
        caches += [system.point_cache for system in thing.particle_systems]
        if any(cache and cache.use_disk_cache and not cache.use_external for cache in caches):
            yield thing, str(folder)
        for modifier in _nodes(thing):
            baked = {modifier.bake_directory, *(bake.directory for bake in modifier.bakes)} - {""}
            baked |= {str(folder)} if modifier.bakes else set()
            for path in (bpy.path.abspath(path, library=thing.library) for path in sorted(baked)):
                # A bake may be in the .blend itself.
                if Path(path).is_dir():
                    yield thing, path


def _cache_folder(thing: Any) -> Path:
    """Return the folder beside an object's .blend where Blender keeps its caches on disk."""
    blend = path_of(thing.library) if thing.library else Path(bpy.data.filepath)
    return blend.parent / f"blendcache_{blend.stem}"


def _is_cache_folder(thing: Any, path: str) -> bool:
    absolute = bpy.path.abspath(path, library=thing.library)
    return bool(os.path.normpath(absolute) == os.path.normpath(_cache_folder(thing)))


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
    """Return the files that a path stands for: itself, where there is none of them."""
    folder = Path(path)
    if folder.is_dir():
        return sorted(file for file in folder.rglob("*") if file.is_file()) or [folder]
    if isinstance(block, bpy.types.Image) and block.source == "TILED":
        return [_tile(path, tile.number) for tile in block.tiles]
    sequence = getattr(block, "source", "") == "SEQUENCE" or getattr(block, "is_sequence", False)
    if sequence:
        stem = glob.escape(re.sub(r"\d+$", "", folder.stem))
        return sorted(folder.parent.glob(f"{stem}*{folder.suffix}")) or [folder]
    return [folder]


def _tile(path: str, number: int) -> Path:
    """Return the file of one tile, of which there are ten in a row from 1001 on."""
    row, column = divmod(number - 1001, 10)
    name = path.replace("<UDIM>", str(number))
    return Path(name.replace("<UVTILE>", f"u{column + 1}_v{row + 1}"))


def _problem(block: Any, path: Path) -> str | None:
    """Return what is wrong with a file, as far as Blender would only say it to its terminal."""
    if not path.exists():
        return "missing"
    readable = True
    if isinstance(block, bpy.types.Image) and block.source != "MOVIE":
        # Not by Blender: 5.0 crashes at some broken EXRs.
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


def _entry(path: Path, home: Path) -> dict[str, Any]:
    entry: dict[str, Any] = {"path": _from(home, path)}
    if not path.is_file():
        return entry | dict.fromkeys(("bytes", "mtime_ns", "sha256"))
    status = path.stat()
    return entry | {
        "bytes": status.st_size,
        "mtime_ns": status.st_mtime_ns,
        "sha256": sha256(path),
    }


def _from(home: Path, path: Path) -> str:
    return Path(os.path.relpath(path, home)).as_posix()
