"""The small scene of the smoke build: a closed room of plain shapes, rendered in no time."""

import math
from collections.abc import Mapping
from typing import Any

import bpy

# Inner size of the room in metres; its floor is at z = 0 and it is centred on x = y = 0.
SIZE = (6.0, 6.0, 3.0)


def build(parameters: Mapping[str, Any]) -> None:
    """Fill the empty scene; the room has nothing random, so the parameters change nothing."""
    shapes = {
        "room": _add_room(),
        "sphere": _add(bpy.ops.mesh.primitive_uv_sphere_add, radius=0.5, location=(2, 1, 0.5)),
        "torus": _add(
            bpy.ops.mesh.primitive_torus_add,
            major_radius=0.5,
            minor_radius=0.15,
            location=(-1.8, 1.8, 1.2),
            rotation=(math.radians(70), 0, 0.3),
        ),
        "pillar": _add(
            bpy.ops.mesh.primitive_cylinder_add, radius=0.2, depth=3, location=(-2, -2, 1.5)
        ),
        "cone": _add(bpy.ops.mesh.primitive_cone_add, radius1=0.5, depth=1, location=(1, -2, 0.5)),
        "box": _add(
            bpy.ops.mesh.primitive_cube_add,
            size=0.7,
            location=(2.2, -1.2, 0.35),
            rotation=(0, 0, 1),
        ),
    }
    colours = {
        "sphere": (0.7, 0.15, 0.1),
        "torus": (0.1, 0.5, 0.2),
        "pillar": (0.75, 0.7, 0.6),
        "cone": (0.1, 0.2, 0.7),
        "box": (0.8, 0.6, 0.1),
    }
    for name, shape in shapes.items():
        shape.name = shape.data.name = name
        material = _checker() if name == "room" else _diffuse(name, colours[name])
        shape.data.materials.append(material)
    _add_lamp()


def _add(operator: Any, **settings: Any) -> Any:
    operator(**settings)
    return bpy.context.object


def _add_room() -> Any:
    room = _add(bpy.ops.mesh.primitive_cube_add, size=1, location=(0, 0, SIZE[2] / 2))
    room.scale = SIZE
    # The walls are seen from inside.
    room.data.flip_normals()
    return room


def _diffuse(name: str, colour: tuple[float, float, float]) -> Any:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = 0.6
    return material


def _checker() -> Any:
    """Return a material of checks 0.5 m wide."""
    material = _diffuse("walls", (0.8, 0.8, 0.8))
    tree = material.node_tree
    position = tree.nodes.new("ShaderNodeNewGeometry")
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = 2
    checks.inputs["Color1"].default_value = (0.75, 0.72, 0.68, 1)
    checks.inputs["Color2"].default_value = (0.35, 0.42, 0.5, 1)
    tree.links.new(position.outputs["Position"], checks.inputs["Vector"])
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(checks.outputs["Color"], shader.inputs["Base Color"])
    return material


def _add_lamp() -> None:
    light = bpy.data.lights.new("lamp", "AREA")
    light.energy, light.size = 300, 2
    lamp = bpy.data.objects.new("lamp", light)
    lamp.location = (0, 0, SIZE[2] - 0.05)
    bpy.context.scene.collection.objects.link(lamp)
