"""Finds the frames of simulations that are baked into files."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy

from lightfield.rendering.inspection.needed_files import shown_modifiers
from lightfield.rendering.scenes.blend_file import path_of


def point_caches(modifier: Any) -> Iterator[tuple[str, Any]]:
    """Yield the kind and the cache of each simulation of a modifier that has a point cache."""
    if modifier.type in ("CLOTH", "SOFT_BODY"):
        yield modifier.name, modifier.point_cache
    elif modifier.type == "PARTICLE_SYSTEM":
        system = modifier.particle_system
        settings = system.settings
        # Hair without dynamics stands still, and particles without physics need no past.
        is_hair = settings.type == "HAIR"
        if system.use_hair_dynamics if is_hair else settings.physics_type != "NO":
            yield f"{'hair' if is_hair else 'particles'} {system.name}", system.point_cache
    elif modifier.type == "DYNAMIC_PAINT" and modifier.canvas_settings:
        for surface in modifier.canvas_settings.canvas_surfaces:
            if surface.is_active and surface.is_cache_user:
                yield f"dynamic paint {surface.name}", surface.point_cache


def caches_of(obj: Any) -> list[Any]:
    """Return the point caches of an object."""
    return [cache for modifier in obj.modifiers for _, cache in point_caches(modifier)]


def cache_folder(obj: Any, is_in_library: bool = True) -> Path:
    """Return the folder beside an object's .blend where Blender keeps its caches on disk."""
    is_linked = obj.library and is_in_library
    blend = path_of(obj.library) if is_linked else Path(bpy.data.filepath)
    return blend.parent / f"blendcache_{blend.stem}"


def files(obj: Any, frames: Sequence[float]) -> list[Path]:
    """Return the files of an object's baked simulations that are read at the ``frames``."""
    caches = [cache for modifier in shown_modifiers(obj) for _, cache in point_caches(modifier)]
    return sorted({file for cache in caches for file in _files(obj, cache, frames)})


def _files(obj: Any, cache: Any, frames: Sequence[float]) -> Iterator[Path]:
    if not cache.use_external and not (cache.use_disk_cache and cache.is_baked):
        return
    folder = cache_folder(obj, cache.use_library_path)
    if cache.use_external:
        folder = Path(bpy.path.abspath(cache.filepath, library=obj.library))
    # Blender names files without a name by the bytes of the object's name.
    name = cache.name or ("" if cache.use_external else obj.name.encode().hex().upper())
    index = f"_{cache.index:02}" if cache.index >= 0 else ""
    for number in _numbers(cache, frames):
        yield folder / f"{name}_{number:06}{index}.bphys"


def _numbers(cache: Any, frames: Sequence[float]) -> set[int]:
    """Return the cached frames beside each frame: the one before or at it, and the one after."""
    step = cache.frame_step
    last = (cache.frame_end - cache.frame_start) // step
    places = [min(max((frame - cache.frame_start) / step, 0), last) for frame in frames]
    steps = {round_off(place) for place in places for round_off in (math.floor, math.ceil)}
    return {cache.frame_start + step * place for place in steps}
