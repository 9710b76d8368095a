"""Compares what a model file says with the scene that Blender has made of it."""

from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import (
    ROLES,
    Geometry,
    MaterialFacts,
    MeshFacts,
    ModelFacts,
    box_of,
)

# Places and areas may differ by this part of the model's size. Blender computes in 32 bits.
_TOLERANCE = 1e-4
# At this many times its size from the origin, 32 bits give a model steps.
_FAR = 100
# In bytes, Blender cuts longer names of materials.
_LONGEST_NAME = 63
# Colours and opacities may differ by this: a file may have 8 bits.
_COLOUR_TOLERANCE = 0.01


def shown_meshes(depsgraph: Any) -> list[MeshFacts]:
    """Return each mesh of a dependency graph that has faces, and that a render shows.

    Vertices without a face do not count.
    """
    geometries: dict[Any, Geometry] = {}
    meshes = []
    for obj, matrix in _mesh_objects(depsgraph):
        key = obj.data.as_pointer()
        if key not in geometries:
            geometries[key] = _geometry(obj.data)
        meshes.append(geometries[key].placed(obj.original.name, matrix))
    return meshes


def shown_boxes(depsgraph: Any) -> list[NDArray[np.float64]]:
    """Return the box (2, 3) of each of the `shown_meshes`."""
    points: dict[Any, NDArray[np.float32]] = {}
    boxes = []
    for obj, matrix in _mesh_objects(depsgraph):
        key = obj.data.as_pointer()
        if key not in points:
            places = _values(obj.data.vertices, "co", np.float32, 3).reshape(-1, 3)
            is_used = np.zeros(len(places), bool)
            is_used[_values(obj.data.loops, "vertex_index", np.int32)] = True
            points[key] = places[is_used]
        boxes.append(box_of(points[key], matrix))
    return boxes


def _mesh_objects(depsgraph: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Yield each object that a render shows as a mesh with faces, and its matrix (4, 4)."""
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "MESH" and instance.show_self and obj.data.polygons:
            yield obj, np.array(instance.matrix_world, np.float64)


def differences(facts: ModelFacts, shown: Sequence[MeshFacts]) -> list[str]:
    """Return what a file says and the open scene does not show, in words, mesh by mesh."""
    meshes = [] if facts.meshes is None else _of_meshes(facts.meshes, shown)
    return [*meshes, *_of_materials(facts.materials)]


def _geometry(mesh: Any) -> Geometry:
    sizes = _values(mesh.polygons, "loop_total", np.int32)
    corners = _values(mesh.loops, "vertex_index", np.int32)
    colours = _corner_colours(mesh, corners)
    return Geometry(
        _values(mesh.vertices, "co", np.float32, 3),
        corners,
        sizes,
        None if colours is None else colours[:, :3],
        None if colours is None else colours[:, 3],
    )


def _values(items: Any, name: str, kind: Any, width: int = 1) -> NDArray[Any]:
    """Return a property of all items of a collection of Blender, (N × width,)."""
    values = np.empty(len(items) * width, kind)
    items.foreach_get(name, values)
    return values


def _corner_colours(mesh: Any, corners: NDArray[np.int32]) -> NDArray[np.float32] | None:
    """Return the linear colours (C, 4) of a mesh's corners. None if it has none."""
    attribute = mesh.color_attributes.active_color
    if attribute is None:
        return None
    colours: NDArray[np.float32] = _values(attribute.data, "color", np.float32, 4).reshape(-1, 4)
    return colours[corners] if attribute.domain == "POINT" else colours


# ---- meshes ---------------------------------------------------------------------------------


def _of_meshes(said: Sequence[MeshFacts], shown: Sequence[MeshFacts]) -> Iterator[str]:
    """Yield the meshes that differ, and the meshes of only one side.

    A mesh of one place or one line does not count. Blender may change names, so equal meshes are
    found first, and then meshes of equal names.
    """
    said, shown = ([mesh for mesh in side if mesh.triangles != 0] for side in (said, shown))
    size = _size([*said, *shown])
    unlike, left = _unmatched(said, shown, size)
    by_name = {mesh.name: mesh for mesh in left}
    for mesh in unlike:
        other = by_name.pop(mesh.name, None)
        if other is None and len(unlike) == len(left) == 1:
            (other,) = left
            by_name.clear()
        if other is None:
            yield f"{_named(mesh)}, which Blender does not show"
        else:
            yield f"{_named(mesh)}: {', '.join(_unlike(mesh, other, size))}"
    for mesh in by_name.values():
        yield f"{_named(mesh)}, which Blender shows, but the file does not have there"


def _named(mesh: MeshFacts) -> str:
    return f"the mesh {printable(mesh.name)}" if mesh.name else "its mesh"


def _size(meshes: Sequence[MeshFacts]) -> float:
    """Return the largest side of the box around meshes."""
    if not meshes:
        return 0.0
    boxes = np.array([mesh.box for mesh in meshes])
    return float((boxes[:, 1].max(0) - boxes[:, 0].min(0)).max())


def _unmatched(
    said: Sequence[MeshFacts], shown: Sequence[MeshFacts], size: float
) -> tuple[list[MeshFacts], list[MeshFacts]]:
    """Return the meshes of each side that the other lacks."""
    free = dict(enumerate(shown))
    if not said or not shown:
        return list(said), list(shown)
    boxes = cKDTree([mesh.box.ravel() for mesh in shown])
    unlike = []
    for mesh in said:
        # A distance of infinite order is the largest difference of a coordinate.
        near = boxes.query_ball_point(mesh.box.ravel(), _reach(mesh, size), p=np.inf)
        alike = [i for i in near if i in free and not any(_unlike(mesh, free[i], size))]
        if alike:
            del free[next((i for i in alike if free[i].name == mesh.name), alike[0])]
        else:
            unlike.append(mesh)
    return unlike, list(free.values())


def _unlike(said: MeshFacts, shown: MeshFacts, size: float) -> Iterator[str]:
    """Yield in which figures a mesh of the file differs from a mesh of Blender."""
    if not np.abs(said.box - shown.box).max() <= _reach(said, size):
        is_far = np.abs(said.box).max() > _FAR * size
        reason = " in its 32 bits; move it to the origin" if is_far else ""
        yield f"it reaches {_corners(said)}, and Blender shows {_corners(shown)}{reason}"
    if said.triangles not in (None, shown.triangles):
        yield f"it has {said.triangles} triangles, of which Blender shows {shown.triangles}"
    elif not _have_equal_areas(said.area, shown.area, size):
        yield f"its area is {said.area:.6g} m², and Blender shows {shown.area:.6g} m²"
    if said.colour is not None and not _alike(said.colour, shown.colour):
        yield f"its colours are {_colour(said.colour)} on average, and {_shown(shown.colour)}"
    if said.opacity is not None and not _alike(said.opacity, shown.opacity):
        yield f"its opacity is {said.opacity:.3g} on average, and {_shown(shown.opacity)}"


def _reach(said: MeshFacts, size: float) -> float:
    """Return by how much each coordinate of a mesh's box may differ."""
    return _TOLERANCE * size + said.slack


def _have_equal_areas(said: float | None, shown: float | None, size: float) -> bool:
    if said is None or shown is None:
        return True
    return abs(said - shown) <= _TOLERANCE * max(said, size**2)


def _corners(mesh: MeshFacts) -> str:
    low, high = ("(" + ", ".join(f"{value:.8g}" for value in corner) + ")" for corner in mesh.box)
    return f"from {low} to {high}"


def _alike(said: Any, shown: Any) -> bool:
    if shown is None:
        return False
    return bool(np.abs(np.subtract(said, shown)).max() <= _COLOUR_TOLERANCE)


def _colour(colour: Any) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in np.ravel(colour)) + ")"


def _shown(value: Any) -> str:
    return "Blender reads none" if value is None else f"Blender shows {_colour(value)}"


# ---- materials ------------------------------------------------------------------------------


def _of_materials(materials: Sequence[MaterialFacts]) -> Iterator[str]:
    for said in materials:
        name = printable(said.name)
        if not _is_text(said.name):
            continue
        shown = bpy.data.materials.get(said.name)
        if shown is None:
            yield f"the material {name}, which Blender does not have"
            continue
        for role, picture in said.textures.items():
            if not _shows(_pictures(shown, role), picture):
                yield f"the texture {printable(picture)} for the {role} of the material {name}"
        colour, opacity = _value(shown, "base colour"), _value(shown, "opacity")
        if said.colour is not None and colour is not None and not _alike(said.colour, colour[:3]):
            yield (
                f"the base colour {_colour(said.colour)} of the material {name}, of which Blender "
                f"makes {_colour(colour[:3])}"
            )
        if said.opacity is not None and opacity is not None and not _alike(said.opacity, opacity):
            yield (
                f"the opacity {said.opacity:.3g} of the material {name}, of which Blender makes "
                f"{opacity:.3g}"
            )


def _is_text(name: str) -> bool:
    """Return whether Blender has a name as it is. It cuts long ones, and changes other bytes."""
    return printable(name) == name and len(name.encode()) < _LONGEST_NAME


def _shows(pictures: Sequence[str], picture: str) -> bool:
    return _file_name(picture) in pictures if picture else bool(pictures)


def _file_name(path: str) -> str:
    """Return a path without its folders. Some programs write backslashes."""
    return path.replace("\\", "/").rpartition("/")[2]


def _input(material: Any, role: str) -> Any:
    """Return the socket of a material that has a role. None if it has no Principled BSDF."""
    for node in material.node_tree.nodes if material.node_tree else ():
        if node.bl_idname == "ShaderNodeBsdfPrincipled":
            return node.inputs[ROLES[role]]
    return None


def _value(material: Any, role: str) -> Any:
    """Return the number or the colour of a role. None if nodes give it."""
    socket = _input(material, role)
    if socket is None or socket.links:
        return None
    value = socket.default_value
    return float(value) if isinstance(value, float) else tuple(value)


def _pictures(material: Any, role: str) -> list[str]:
    """Return the names of the pictures that a role depends on, without their folders.

    A material without a Principled BSDF shows all its pictures by its colour.
    """
    socket = _input(material, role)
    nodes = material.node_tree.nodes if socket is None else _nodes_before(socket)
    images = [node.image for node in nodes if node.bl_idname == "ShaderNodeTexImage" and node.image]
    return [_file_name(image.filepath) or image.name for image in images]


def _nodes_before(socket: Any) -> list[Any]:
    """Return the nodes on which the value of a socket depends."""
    nodes: dict[str, Any] = {}
    sockets = [socket]
    while sockets:
        for link in sockets.pop().links:
            if link.from_node.name not in nodes:
                nodes[link.from_node.name] = link.from_node
                sockets += link.from_node.inputs
    return list(nodes.values())
