"""Adds calibration boards to the open scene: one flat face for each cell, with exact corners."""

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.geometry.boards import Board, Pattern

# How thick a board is, in metres. Its back and its sides are white.
_THICKNESS = 0.003
# How much light the cells reflect: about as printer's ink and paper do.
_BLACK, _WHITE = 0.03, 0.8
# The corners of a board's back and sides: of a box, from the front's upper left corner clockwise,
# and then from the back's.
_BACK_AND_SIDES = ((4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def add(boards: dict[str, Board]) -> None:
    """Add boards to the open scene, as objects with their names.

    Raises `UserError` if the scene has another object with such a name.
    """
    for name in boards:
        if name in bpy.data.objects:
            raise UserError(
                f"targets.{name}: the scene has an object {name}; give the board another name"
            )
    if not boards:
        return
    materials = [_material("target_black", _BLACK), _material("target_white", _WHITE)]
    for name, board in boards.items():
        obj = bpy.data.objects.new(name, _mesh(name, board.pattern(), materials))
        obj.location = board.position
        obj.rotation_euler = np.radians(np.asarray(board.rotation, float))
        bpy.context.scene.collection.objects.link(obj)


def _material(name: str, reflected: float) -> Any:
    material = bpy.data.materials.new(name)
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (reflected, reflected, reflected, 1)
    shader.inputs["Roughness"].default_value = 1
    shader.inputs["Specular IOR Level"].default_value = 0
    return material


def _mesh(name: str, pattern: Pattern, materials: list[Any]) -> Any:
    """Return the mesh of a board. Its front faces +Z, its upper edge is towards +Y."""
    vertices, faces, is_white = _surface(pattern)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    for material in materials:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", is_white.astype(np.int32))
    mesh.update()
    return mesh


def _surface(
    pattern: Pattern,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return the vertices (n, 3) of a board, its faces (m, 4), and which of them are white (m,)."""
    right = pattern.columns[-1] / 2
    top = pattern.rows[-1] / 2
    y, x = np.meshgrid(top - pattern.rows, pattern.columns - right, indexing="ij")
    cells = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    number = np.arange(len(cells)).reshape(x.shape)
    # Counter-clockwise, as seen from the front.
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    fronts = np.stack(corners, axis=-1).reshape(-1, 4)
    outline = np.array([[-right, top], [right, top], [right, -top], [-right, -top]])
    box = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (0.0, -_THICKNESS)])
    others = np.array(_BACK_AND_SIDES) + len(cells)
    is_white = np.append(pattern.is_white.ravel(), np.ones(len(others), np.bool_))
    return np.concatenate([cells, box]), np.concatenate([fronts, others]), is_white
