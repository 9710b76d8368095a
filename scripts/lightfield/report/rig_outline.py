"""The surface or volume that a rig's cameras are placed on, as lines to draw."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.geometry import rigs

Array = NDArray[Any]

CIRCLE = np.linspace(0, 2 * np.pi, 73)


def outline(rig: Mapping[str, Any]) -> list[Array]:
    """Return polylines (n, 3) in world coordinates; none for a rig of loose poses."""
    size = np.broadcast_to(np.asarray(rig.get("size", 1.0), dtype=float), 3)
    turn = rigs.euler_to_matrix(np.radians(np.asarray(rig.get("rotation", (0, 0, 0)), float)))
    center = np.asarray(rig.get("center", (0, 0, 0)), dtype=float)
    return [line * size @ turn.T + center for line in _unit_lines(rig["type"])]


def _unit_lines(kind: str) -> list[Array]:
    """Return the lines of a shape in the unit box."""
    cosine, sine, zero = np.cos(CIRCLE) / 2, np.sin(CIRCLE) / 2, np.zeros_like(CIRCLE)
    if kind == "sphere":
        return [
            np.stack(axes, axis=-1)
            for axes in ((cosine, sine, zero), (cosine, zero, sine), (zero, cosine, sine))
        ]
    if kind == "cylinder":
        rings = [np.stack([cosine, sine, zero + z], axis=-1) for z in (-0.5, 0.5)]
        sides = [
            np.array([[x, y, -0.5], [x, y, 0.5]])
            for x, y in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5))
        ]
        return rings + sides
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]])
    if kind == "plane":
        return [np.stack([square[:, 0], np.zeros(5), square[:, 1]], axis=-1)]
    if kind in ("cuboid", "lattice"):
        faces = [np.column_stack([square, np.full(5, z)]) for z in (-0.5, 0.5)]
        edges = [np.array([[x, y, -0.5], [x, y, 0.5]]) for x, y in square[:4]]
        return faces + edges
    return []
