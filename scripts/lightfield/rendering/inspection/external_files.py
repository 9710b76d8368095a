"""Lists the files that a .blend reads for its pixels, and finds what is wrong with them."""

import glob
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable, listed, special_kind
from lightfield.core.paths import files_below
from lightfield.rendering.inspection import point_caches
from lightfield.rendering.inspection.file_readers import DamagedError, check
from lightfield.rendering.inspection.needed_files import (
    Needed,
    format_of,
    is_shader,
    paths_of_inputs,
)
from lightfield.rendering.inspection.point_caches import cache_folder, caches_of
from lightfield.rendering.scenes import sequences
from lightfield.rendering.scenes.blend_file import new_scene, path_of
from lightfield.rendering.scenes.quiet import quiet

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


# A file that is missing or cannot be read: its kind, name, path and problem.
Missing = dict[str, str]


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


def refuse_damaged_alembic(blend: Path) -> None:
    """Raise `UserError` if an Alembic file of a .blend is damaged. Blender crashes on opening it.

    Reads nothing else from the .blend. Opens an empty scene.
    """
    check_readable(blend)
    new_scene()
    try:
        with quiet(), bpy.data.libraries.load(str(blend)) as (content, wanted):
            wanted.cache_files = content.cache_files
    except (OSError, RuntimeError):
        # Opening it says what is wrong.
        return
    caches = [
        (cache.name, Path(os.path.normpath(bpy.path.abspath(cache.filepath))))
        for cache in bpy.data.cache_files
    ]
    # Blender would read them when it updates the scene.
    bpy.data.batch_remove(bpy.data.cache_files)
    for name, file in caches:
        if file.suffix.lower() != ".abc" or not file.is_file():
            continue
        try:
            check("abc", file)
        except DamagedError as error:
            raise UserError(
                f"{blend}: the cache {name} at {file} ({error.problem}); Blender would crash on "
                "it; export it again"
            ) from None


def problems(shaders: Sequence[Any], frames: Sequence[float]) -> list[Missing]:
    """Return the files that are missing or cannot be read, and that a render reads.

    Each entry has the ``kind`` and ``name`` of the data-block that reads the file. It also has the
    ``path`` from the .blend's folder, and the ``problem``. ``shaders`` are the materials, worlds
    and lights that are rendered, at the ``frames``.
    """
    home = Path(bpy.data.filepath).parent
    problem_entries = {
        (kind, _from(home, file), block.name): problem
        for kind, block, file in [*_rendered_files(shaders, frames), *_cached_frames(frames)]
        if (problem := _problem(block, file))
    }
    for block in bpy.data.user_map():
        if block.library and block.is_missing and path_of(block.library).is_file():
            kind = f"linked {type(block).__name__.lower()}"
            path = _from(home, path_of(block.library))
            problem_entries[kind, path, block.name] = "not in its library"
    return [
        {"kind": kind, "name": name, "path": path, "problem": problem}
        for (kind, path, name), problem in sorted(problem_entries.items())
    ]


def _rendered_files(
    shaders: Sequence[Any], frames: Sequence[float]
) -> Iterator[tuple[str, Any, Path]]:
    """Yield the files that a render reads, with their kinds and the data-blocks that name them."""
    needed = Needed(shaders)
    for block, path in _blocks_and_paths():
        if needed.includes(block, path) and not _is_external_cache(block, path):
            absolute = bpy.path.abspath(path, library=block.library)
            kind = "shader" if is_shader(block, path) else KINDS[type(block).__name__]
            for file in _files_at(block, absolute, frames, needed):
                yield kind, block, file
    for obj, folder in _baked_folders():
        for file in _files(obj, folder):
            # The folder may hold caches of other objects.
            if file.suffix == ".json":
                yield KINDS["Object"], obj, file


def _is_external_cache(block: Any, path: str) -> bool:
    """Return whether a path is the folder of a simulation, of which only some files are read."""
    return isinstance(block, bpy.types.Object) and any(
        cache.use_external and cache.filepath == path for cache in caches_of(block)
    )


def _cached_frames(frames: Sequence[float]) -> Iterator[tuple[str, Any, Path]]:
    """Yield the frames of simulations that a render reads from the disk."""
    for obj in bpy.data.objects:
        for file in point_caches.files(obj, frames):
            # One folder stands for all that it lacks.
            yield "simulation", obj, file if file.parent.is_dir() else file.parent


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
            for path in paths_of_inputs(modifier):
                yield obj, path


def _node_modifiers(obj: Any) -> list[Any]:
    return [modifier for modifier in obj.modifiers if modifier.type == "NODES"]


def _blocks_and_absolute_paths() -> Iterator[tuple[Any, str]]:
    """Yield each data-block that reads a file or a cache's folder, and the absolute path."""
    for block, path in _blocks_and_paths():
        yield block, bpy.path.abspath(path, library=block.library)
    yield from _baked_folders()
    for obj in bpy.data.objects:
        if any(cache.use_disk_cache and not cache.use_external for cache in caches_of(obj)):
            yield obj, str(cache_folder(obj))


def _baked_folders() -> Iterator[tuple[Any, str]]:
    """Yield each object with geometry nodes that are baked on the disk, and the bakes' folders."""
    for obj in bpy.data.objects:
        for modifier in _node_modifiers(obj):
            bake_folders = {modifier.bake_directory}
            bake_folders.update(bake.directory for bake in modifier.bakes)
            bake_folders.discard("")
            if modifier.bakes:
                bake_folders.add(str(cache_folder(obj)))
            for bake_folder in sorted(bake_folders):
                path = bpy.path.abspath(bake_folder, library=obj.library)
                # A bake may be in the .blend itself.
                if Path(path).is_dir():
                    yield obj, path


def _is_cache_folder(obj: Any, path: str) -> bool:
    absolute = bpy.path.abspath(path, library=obj.library)
    return bool(os.path.normpath(absolute) == os.path.normpath(cache_folder(obj)))


def _is_packed(block: Any) -> bool:
    if isinstance(block, bpy.types.Image):
        return bool(block.packed_files) or block.source in ("GENERATED", "VIEWER")
    return isinstance(block, bpy.types.Library) or bool(getattr(block, "packed_file", None))


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


def _files_at(block: Any, path: str, frames: Sequence[float], needed: Needed) -> list[Path]:
    """Return the files that a path stands for at the rendered ``frames``."""
    if isinstance(block, bpy.types.Image) and block.source == "SEQUENCE":
        users = needed.image_users(block)
        return sequences.files_of_image(users, Path(path), frames) or _files(block, path)
    if isinstance(block, bpy.types.Volume) and block.is_sequence:
        return sequences.files_of_volume(block, Path(path), frames)
    files = _files(block, path)
    if Path(path).is_dir():
        # It holds the cache of a fluid.
        wholes = {math.floor(frame) for frame in frames}
        return [file for file in files if sequences.number_of(file) in {None, *wholes}]
    return files


def _problem(block: Any, path: Path) -> str | None:
    """Return the problem of a file, or None. Blender itself would only print it."""
    if not path.exists():
        return "missing"
    if path.is_dir():
        return None if isinstance(block, bpy.types.Object) else "is a folder"
    try:
        check(format_of(block, path), path)
    except DamagedError as error:
        return error.problem
    return None


def _from(home: Path, path: Path) -> str:
    return Path(os.path.relpath(path, home)).as_posix()
