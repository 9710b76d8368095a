"""What a view's pixels follow from: the scene's fingerprint, the render key, and the seed.

Two views with equal keys have equal pixels, so a finished view is recognised by its key and
never rendered twice, and a change of settings is never mistaken for a finished view. What pruning
leaves out changes no byte (see `lightfield.pruning`) and is therefore not in the key.
"""

import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from lightfield.config import BUILDERS

# Raised when the program that renders changes what it writes for the same settings.
RENDER_VERSION = 1


def scene_fingerprint(source: Mapping[str, Any]) -> str:
    """Return what identifies a scene YAML's ``scene`` block: 64 hexadecimal digits.

    A .blend is identified by its bytes; raises KeyError while their SHA-256 is not known. A built
    one differs from build to build (it holds memory addresses), so it is identified by the
    text of the builder and of the library that all builders share, its parameters, and bpy's
    version.
    """
    if "blend" in source:
        return str(source["sha256"])
    files = [
        [file.relative_to(BUILDERS).as_posix(), _hash(file.read_bytes())]
        for folder in ("library", source["builder"])
        for file in sorted((BUILDERS / folder).rglob("*.py"))
    ]
    return _digest([files, source["parameters"], version("bpy")])


def render_key(lightfield: Mapping[str, Any], frame: Mapping[str, Any]) -> str:
    """Return the key of one of the ``frames`` of a lightfield.json: 64 hexadecimal digits."""
    whole = {key: value for key, value in lightfield.items() if key != "frames"}
    return _digest([RENDER_VERSION, version("bpy"), whole, frame["name"], frame["world_matrix"]])


def view_seed(seed: int, name: str) -> int:
    """Return the Cycles seed, 0 to 2^31 − 1, of the view ``name`` under the scene's ``seed``."""
    return int(_digest([seed, name])[:8], 16) & 0x7FFFFFFF


def _digest(content: Any) -> str:
    return _hash(json.dumps(content, sort_keys=True, allow_nan=False).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
