"""Writes copies of glTF files that Blender reads right, where it misreads the file itself.

Blender's objects have a place, a rotation and a scale, so a matrix with a shear becomes two nodes.
Blender knows no cubic splines of glTF, and turns unevenly between rotations that lie far apart, so
such curves get a key for each frame.
"""

import base64
import copy
import json
import os
import struct
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from scipy.spatial.transform import Rotation

from lightfield.rendering.models.second_readers.gltf_data import (
    BINARY,
    JSON,
    Array,
    CompressedError,
    Document,
    file_of,
    is_data,
)
from lightfield.rendering.models.second_readers.gltf_motion import FRAMES_PER_SECOND, sampled

# The columns of a matrix without a shear stand at right angles, up to this cosine.
_SHEAR = 1e-5
# Blender's rotations between keys are right up to this angle between the keys, in radians.
_WIDEST = 0.17
# What the inner one of two nodes takes over.
_CONTENT = ("mesh", "skin", "weights", "camera", "children", "extensions")


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Yield a glTF that Blender reads right: the file itself, or a copy if Blender misreads it."""
    document = Document(path)
    content = _corrected(document)
    if content is None:
        yield path
        return
    with tempfile.TemporaryDirectory() as name:
        file = Path(os.path.realpath(name)) / f"{path.stem}.glb"
        _write(file, content, document.binary)
        yield file


def _corrected(document: Document) -> dict[str, Any] | None:
    """Return the JSON that Blender reads right. None if it reads the file's own, or refuses it."""
    content = copy.deepcopy(document.content)
    try:
        moved = _split_sheared(content)
        _redirect(content, moved)
        if not _resample(document, content) and not moved:
            return None
        for entry in [*content.get("buffers", ()), *content.get("images", ())]:
            if "uri" in entry and not is_data(entry["uri"]):
                entry["uri"] = quote(str(file_of(document.path.absolute(), entry["uri"])))
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OSError):
        return None
    return content


def _write(path: Path, content: Mapping[str, Any], binary: bytes) -> None:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON) + text
    if binary:
        binary += bytes(-len(binary) % 4)
        chunks += struct.pack("<II", len(binary), BINARY) + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


# ---- shears ---------------------------------------------------------------------------------


def _split_sheared(content: dict[str, Any]) -> dict[int, int]:
    """Split nodes whose matrix has a shear. Return the number of each one's inner node."""
    nodes = content.get("nodes", [])
    # Bones cannot be sheared, nor split.
    joints = {joint for skin in content.get("skins", ()) for joint in skin["joints"]}
    inner: dict[int, int] = {}
    for number, node in enumerate(list(nodes)):
        if "matrix" in node and number not in joints and _is_sheared(_matrix(node)):
            inner[number] = len(nodes)
            nodes.append(_split(node, len(nodes)))
    return inner


def _matrix(node: Mapping[str, Any]) -> Array:
    return np.array(node["matrix"], float).reshape(4, 4).T


def _is_sheared(matrix: Array) -> bool:
    columns = matrix[:3, :3]
    lengths = np.linalg.norm(columns, axis=0)
    if not lengths.all():
        return False
    cosines = columns.T @ columns / np.outer(lengths, lengths)
    return bool(np.abs(cosines - np.eye(3)).max() > _SHEAR)


def _split(node: dict[str, Any], number: int) -> dict[str, Any]:
    """Turn a node's matrix into a rotation and a scale, and return an inner node that turns first.

    Their product is the matrix: its singular value decomposition.
    """
    matrix = _matrix(node)
    outer, scale, inner = np.linalg.svd(matrix[:3, :3])
    # Rotations do not mirror, but a scale may.
    for rotation, axis in ((outer, np.s_[:, 2]), (inner, np.s_[2])):
        if np.linalg.det(rotation) < 0:
            rotation[axis] *= -1
            scale[2] *= -1
    del node["matrix"]
    child = {key: node.pop(key) for key in _CONTENT if key in node}
    child["rotation"] = Rotation.from_matrix(inner).as_quat().tolist()
    if "name" in node:
        child["name"] = node["name"]
    node |= {
        "translation": matrix[:3, 3].tolist(),
        "rotation": Rotation.from_matrix(outer).as_quat().tolist(),
        "scale": scale.tolist(),
        "children": [number],
    }
    return child


def _redirect(content: Mapping[str, Any], inner: Mapping[int, int]) -> None:
    """Let animations of weights move the inner nodes, which have the meshes."""
    for animation in content.get("animations", ()):
        for channel in animation["channels"]:
            target = channel["target"]
            if target.get("node") in inner:
                target["node"] = inner[target["node"]]


# ---- animations -----------------------------------------------------------------------------


def _resample(document: Document, content: dict[str, Any]) -> bool:
    """Give the curves of the first animation keys at each frame, where Blender needs them."""
    is_changed = False
    for animation in content.get("animations", ())[:1]:
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            path = channel["target"]["path"]
            if path != "pointer" and _is_misread(document, sampler, path):
                channel["sampler"] = len(animation["samplers"])
                animation["samplers"].append(_with_all_keys(document, content, sampler, path))
                is_changed = True
    return is_changed


def _is_misread(document: Document, sampler: Mapping[str, Any], path: str) -> bool:
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation != "LINEAR" or path != "rotation":
        return bool(interpolation == "CUBICSPLINE")
    try:
        turns = Rotation.from_quat(document.numbers(sampler["output"]))
    except CompressedError:
        return False
    return len(turns) > 1 and bool((turns[:-1].inv() * turns[1:]).magnitude().max() > _WIDEST)


def _with_all_keys(
    document: Document, content: dict[str, Any], sampler: Mapping[str, Any], path: str
) -> dict[str, Any]:
    """Return a sampler with the keys of another, and one at each frame between them."""
    keys = document.numbers(sampler["input"]).ravel()
    first, last = np.ceil(keys[0] * FRAMES_PER_SECOND), np.floor(keys[-1] * FRAMES_PER_SECOND)
    times = np.union1d(keys, np.arange(first, last + 1) / FRAMES_PER_SECOND)
    values = sampled(document, sampler, times, path == "rotation")
    kind = {"rotation": "VEC4", "weights": "SCALAR"}.get(path, "VEC3")
    return {
        "input": _added(content, times, "SCALAR"),
        "output": _added(content, values.ravel() if kind == "SCALAR" else values, kind),
        "interpolation": "LINEAR",
    }


def _added(content: dict[str, Any], values: Array, kind: str) -> int:
    """Add an accessor with values to a document, and return its number."""
    data = values.astype("<f4").tobytes()
    address = f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
    content["buffers"].append({"byteLength": len(data), "uri": address})
    view = {"buffer": len(content["buffers"]) - 1, "byteLength": len(data)}
    content["bufferViews"].append(view)
    content["accessors"].append(
        {
            "bufferView": len(content["bufferViews"]) - 1,
            "componentType": 5126,
            "count": len(values),
            "type": kind,
        }
    )
    return len(content["accessors"]) - 1
