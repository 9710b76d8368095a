"""Calls the second reader of a model's format."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.names import UP
from lightfield.rendering.models.second_readers import fbx, gltf, obj, ply, stl, usd
from lightfield.rendering.models.second_readers.facts import ModelFacts, upright

# Formats whose files say which axis points up, and what moves. Readers take the path and the frame.
_MOVING: dict[str, Callable[[Path, int], ModelFacts]] = {
    ".fbx": fbx.read,
    **dict.fromkeys((".glb", ".gltf"), gltf.read),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), usd.read),
}
# The formats of `UP`.
_STILL: dict[str, Callable[[Path], ModelFacts]] = {
    ".obj": obj.read,
    ".ply": ply.read,
    ".stl": stl.read,
}


def read(path: Path, up: str, frame: int) -> ModelFacts | None:
    """Return what a model file says at a frame. None if its format has no second reader.

    ``up`` is y, z, or auto: as usual in the format. Raises `UserError` if the file is broken.
    """
    suffix = path.suffix.lower()
    if suffix in _MOVING:
        facts = _MOVING[suffix](path, frame)
    elif suffix in _STILL:
        facts = _STILL[suffix](path)
        if (UP[suffix] if up == "auto" else up) == "y":
            facts = upright(facts)
    else:
        return None
    if not all(np.isfinite(mesh.box).all() for mesh in facts.meshes or ()):
        raise UserError(f"{path}: has vertices whose places are not numbers; export it again")
    return facts
