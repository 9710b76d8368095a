"""Lights a model, and puts a floor under it. All sizes follow from the model's box."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from lightfield.core.names import LIGHTS, SOFTBOXES
from lightfield.rendering.inspection.inventory import rendered_materials
from lightfield.rendering.scenes.node_trees import contributing

# Each lamp has a direction from the model, as azimuth (0 is +X) and elevation in degrees, and an
# irradiance at the model in W/m². The model's front is towards −Y.
_LAMPS = {"key": (-60, 45, 1.5), "fill": (-150, 20, 0.4), "rim": (80, 55, 0.7)}
# The distance and the size of a lamp in radii of the model.
_DISTANCE = 8
_SIZE = 5
# The radiance of the world around the lamps. With it, white paint facing the key light stays just
# below 1, so that no view is over-exposed.
_WORLD = 0.25
# The size of the floor in radii of the model.
_FLOOR = 20


def add(light: str, box: NDArray[np.float64]) -> None:
    """Light a model within ``box``, (2, 3) in metres, with one of `LIGHTS`, or a picture's path."""
    world = bpy.data.worlds.new("light")
    bpy.context.scene.world = world
    if light == SOFTBOXES:
        _background(world).inputs["Color"].default_value = (_WORLD, _WORLD, _WORLD, 1)
        for name, (azimuth, elevation, irradiance) in _LAMPS.items():
            _lamp(name, np.radians(azimuth), np.radians(elevation), irradiance, box)
        _speed_up()
        return
    path = Path(light)
    if light in LIGHTS:
        folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
        path = folder / f"{light}.exr"
    # Blender would take a path with // before it for one from the .blend.
    image = bpy.data.images.load(str(path.absolute()))
    image.pack()
    # Keep this machine's path out of the .blend.
    image.filepath = f"//{path.name}"
    background = _background(world)
    environment = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    environment.image = image
    world.node_tree.links.new(environment.outputs["Color"], background.inputs["Color"])


def _speed_up() -> None:
    """Choose the sampling that takes least time for equal noise in this light.

    Cycles' own choice takes 1.4 times as long, and 1.2 times for equal noise.
    """
    cycles = bpy.context.scene.cycles
    cycles.sampling_pattern = "TABULATED_SOBOL"
    # The tree costs more than it saves for three lamps. Glowing faces are many lamps.
    cycles.use_light_tree = any(_glows(material) for material in rendered_materials())


def _glows(material: Any) -> bool:
    """Return whether a material may emit light."""
    output = material.node_tree.get_output_node("CYCLES") if material.node_tree else None
    return output is not None and any(_emits(node) for node in contributing(output))


def _emits(node: Any) -> bool:
    """Return whether a shader node may emit light. Importers leave emissions of black or of 0."""
    if node.bl_idname != "ShaderNodeBsdfPrincipled":
        return str(node.bl_idname) == "ShaderNodeEmission"
    strength = node.inputs["Emission Strength"]
    colour = node.inputs["Emission Color"]
    has_colour = colour.is_linked or any(colour.default_value[:3])
    return has_colour and (strength.is_linked or strength.default_value != 0)


def _background(world: Any) -> Any:
    """Give a world a background shader of strength 1, and return it."""
    tree = world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return background


def _lamp(
    name: str, azimuth: float, elevation: float, irradiance: float, box: NDArray[np.float64]
) -> None:
    """Put a square lamp around the model. Cameras do not see it, but mirrors do."""
    radius = float(np.linalg.norm(box[1] - box[0])) / 2
    distance = _DISTANCE * radius
    level = np.cos(elevation)
    direction = Vector(
        (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation))
    ).normalized()
    light = bpy.data.lights.new(name, "AREA")
    light.size = _SIZE * radius
    # A lamp of power P gives P / (π d²) straight ahead, at a distance d that is large beside it.
    light.energy = irradiance * np.pi * distance**2
    lamp = bpy.data.objects.new(name, light)
    lamp.location = Vector(box.mean(0)) + distance * direction
    # A lamp shines along its −Z.
    lamp.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
    lamp.visible_camera = False
    bpy.context.scene.collection.objects.link(lamp)


def add_ground(box: NDArray[np.float64]) -> None:
    """Put a floor under a model within ``box``, (2, 3) in metres. Only its shadow is visible."""
    side = _FLOOR * float(np.linalg.norm(box[1] - box[0])) / 2
    x, y, _ = box.mean(0)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    vertices = [(x + right * side, y + back * side, box[0, 2]) for right, back in corners]
    mesh = bpy.data.meshes.new("ground")
    mesh.from_pydata(vertices, [], [(0, 1, 2, 3)])
    ground = bpy.data.objects.new("ground", mesh)
    ground.is_shadow_catcher = True
    bpy.context.scene.collection.objects.link(ground)
