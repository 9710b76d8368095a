"""What a view's pixels follow from: the scene's fingerprint, the render key, and the seed.

Two views with equal keys have equal pixels, so a finished view is recognised by its key and
never rendered twice, and a change of settings is never mistaken for a finished view. What pruning
leaves out changes no byte (see `lightfield.rendering.pruning`) and is therefore not in the key. Nor
is the machine, which changes last digits (see `lightfield.core.machine`): a build goes on wherever
it is resumed, each view names the machine that rendered it, and validation says if these differ.
"""

import hashlib
import json
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from typing import Any

from lightfield.core.errors import UserError
from lightfield.dataset import published
from lightfield.dataset.config import BUILDERS, SceneSource
from lightfield.dataset.lightfield import MACHINE, LightField, View

# Raised when the program that renders changes what it writes for the same settings, and that which
# computes flow.
RENDER_VERSION = 4
FLOW_VERSION = 1


# Looked up in the package's files, which takes a millisecond.
version = cache(metadata.version)


def scene_fingerprint(source: SceneSource, external: Sequence[tuple[str, str | None]] = ()) -> str:
    """Return what identifies a scene YAML's ``scene`` block: 64 hexadecimal digits.

    A .blend is identified by its bytes and those of the ``external`` files that it reads, each
    given by its path and SHA-256, None where it is missing; raises `UserError` while its own
    SHA-256 is not known. Somebody else's views are by their lightfield.json. A built scene differs
    from build to build (it holds memory addresses), so it is identified by the text of the builder
    and of the library that all builders have in common, its parameters, and bpy's version.
    """
    if source.blend:
        if source.sha256 is None:
            raise UserError(f"{source.blend}: its sha256 is not known; check_blend.py records it")
        return _digest([source.sha256, external]) if external else source.sha256
    if source.dataset:
        return _digest(published.fingerprint(source.dataset))
    assert source.builder
    files = [
        [file.relative_to(BUILDERS).as_posix(), _hash(file.read_bytes())]
        for folder in ("library", source.builder)
        for file in sorted((BUILDERS / folder).rglob("*.py"))
    ]
    return _digest([files, source.parameters.model_dump(), version("bpy")])


def render_key(lightfield: LightField, view: View) -> str:
    """Return the key of one of the views of a light field: 64 hexadecimal digits."""
    pose = view.matrix.tolist()
    content = {key: value for key, value in lightfield.content.items() if key != MACHINE}
    return _digest([RENDER_VERSION, version("bpy"), content, view.name, pose])


def names_key(lightfield: LightField) -> str:
    """Return the key of the numbers that a light field's objects and materials have."""
    return _digest([RENDER_VERSION, version("bpy"), lightfield.content.get("scene")])


def flow_key(lightfield: LightField, view: View, other: View, sums: Sequence[str]) -> str:
    """Return the key of the flow between two views of these SHA-256 checksums."""
    poses = [view.matrix.tolist(), other.matrix.tolist()]
    return _digest([FLOW_VERSION, lightfield.lens.to_lightfield(), poses, list(sums)])


def view_seed(seed: int, name: str) -> int:
    """Return the Cycles seed, 0 to 2^31 − 1, of the view ``name`` under the scene's ``seed``."""
    return int(_digest([seed, name])[:8], 16) & 0x7FFFFFFF


def _digest(content: Any) -> str:
    return _hash(json.dumps(content, sort_keys=True, allow_nan=False).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
