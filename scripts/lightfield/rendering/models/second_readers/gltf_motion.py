"""Says where the nodes of a glTF are at a time: matrices of nodes, and weights of morph targets."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lightfield.rendering.models.second_readers.gltf_data import Array, Document

# Frame 0 is the begin of an animation.
FRAMES_PER_SECOND = 24


def animated(document: Document, frame: float) -> list[dict[str, Any]]:
    """Return the nodes with the values of the first animation at a frame."""
    nodes = [dict(node) for node in document.all("nodes")]
    for animation in document.all("animations")[:1]:
        for channel in animation["channels"]:
            target = channel["target"]
            if "node" in target and target["path"] in (
                "translation",
                "rotation",
                "scale",
                "weights",
            ):
                sampler = animation["samplers"][channel["sampler"]]
                is_rotation = target["path"] == "rotation"
                value = sampled(document, sampler, [frame / FRAMES_PER_SECOND], is_rotation)[0]
                nodes[target["node"]][target["path"]] = value.tolist()
    return nodes


def sampled(
    document: Document,
    sampler: Mapping[str, Any],
    times: Sequence[float] | Array,
    is_rotation: bool,
) -> Array:
    """Return the values (N, width) of a sampler at N times in seconds.

    Before the first key and after the last, the key's value counts.
    """
    keys: Array = document.numbers(sampler["input"]).ravel()
    interpolation = sampler.get("interpolation", "LINEAR")
    parts = 3 if interpolation == "CUBICSPLINE" else 1
    values = document.numbers(sampler["output"]).reshape(len(keys), parts, -1)
    clipped = np.clip(times, keys[0], keys[-1])
    after = np.clip(np.searchsorted(keys, clipped, "right"), 1, max(1, len(keys) - 1))
    before = after - 1
    if len(keys) == 1:
        return np.repeat(values[:, parts // 2], len(clipped), axis=0)
    length = keys[after] - keys[before]
    part: Array = ((clipped - keys[before]) / np.where(length, length, 1))[:, None]
    if interpolation == "STEP":
        stepped: Array = np.where(part < 1, values[before, 0], values[after, 0])
        return stepped
    if interpolation == "CUBICSPLINE":
        return _on_spline(values, before, part, length[:, None], is_rotation)
    if is_rotation:
        return np.asarray(Slerp(keys, Rotation.from_quat(values[:, 0]))(clipped).as_quat())
    return np.asarray(values[before, 0] * (1 - part) + values[after, 0] * part)


def _on_spline(values: Array, before: Any, part: Array, length: Array, is_rotation: bool) -> Array:
    """Return values on a cubic spline. Each key has an incoming tangent, a value and another."""
    leaving, arriving = values[before, 2] * length, values[before + 1, 0] * length
    start, end = values[before, 1], values[before + 1, 1]
    square, cube = part**2, part**3
    result: Array = (2 * cube - 3 * square + 1) * start + (cube - 2 * square + part) * leaving
    result += (3 * square - 2 * cube) * end + (cube - square) * arriving
    return result / np.linalg.norm(result, axis=1, keepdims=True) if is_rotation else result


def local_matrix(node: Mapping[str, Any]) -> Array:
    """Return the matrix (4, 4) of a node in its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    return composed(
        node.get("translation", (0, 0, 0)),
        node.get("rotation", (0, 0, 0, 1)),
        node.get("scale", (1, 1, 1)),
    )


def composed(translation: Any, rotation: Any, scale: Any) -> Array:
    """Return the matrix (4, 4) of a translation, a quaternion (x, y, z, w) and a scale."""
    matrix = np.eye(4)
    # A quaternion of zeros turns nothing.
    turn = Rotation.from_quat(rotation).as_matrix() if np.any(rotation) else np.eye(3)
    matrix[:3, :3] = turn * np.asarray(scale, float)
    matrix[:3, 3] = translation
    return matrix


def world_matrices(nodes: Sequence[Mapping[str, Any]], roots: Sequence[int]) -> dict[int, Array]:
    """Return the matrix (4, 4) in the world of each node below ``roots``."""
    matrices: dict[int, Array] = {}
    left = [(root, np.eye(4)) for root in roots]
    while left:
        number, parent = left.pop()
        # A node in a cycle is placed once.
        if number not in matrices:
            matrices[number] = parent @ local_matrix(nodes[number])
            children = nodes[number].get("children", ())
            left += [(child, matrices[number]) for child in children]
    return matrices
