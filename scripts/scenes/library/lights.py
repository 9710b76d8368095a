"""Lamps and skies."""

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from scenes.library.materials import Color, SkyGraph
from scenes.library.scene import place
from scenes.library.shapes import transform


def point_light(
    name: str, location: Sequence[float], watts: float, color: Color, radius: float
) -> bpy.types.Object:
    """A spherical lamp that is invisible itself. Put a visible flame or bulb beside it."""
    light = bpy.data.lights.new(name, "POINT")
    light.energy = watts
    light.color = color
    light.shadow_soft_size = radius
    lamp = place(name, light, transform(location))
    lamp.visible_camera = False
    lamp.visible_glossy = False
    lamp.visible_transmission = False
    return lamp


def area_light(
    name: str, matrix: Matrix, size: tuple[float, float], watts: float, color: Color
) -> bpy.types.Object:
    """A rectangular lamp that shines along its −Z."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape = "RECTANGLE"
    light.size = size[0]
    light.size_y = size[1]
    light.energy = watts
    light.color = color
    return place(name, light, matrix)


def sun_light(
    name: str, azimuth: float, elevation: float, strength: float, color: Color, angle: float
) -> bpy.types.Object:
    """A sun. azimuth: from +X towards +Y. angle: its diameter. All angles are in radians."""
    light = bpy.data.lights.new(name, "SUN")
    light.energy = strength
    light.color = color
    light.angle = angle
    return place(name, light, transform(rotation=(np.pi / 2 - elevation, 0, azimuth + np.pi / 2)))


def hdri_world(
    filename: str, strength: float, rotation: float, brightest: float | None = None
) -> None:
    """The scene's world: an environment that ships with bpy, packed into the .blend.

    filename: a file in datafiles/studiolights/world, such as "sunrise.exr". rotation: radians about
    Z. brightest: an upper limit of the radiance, so that the sun's reflections make no fireflies.
    """
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    image = bpy.data.images.load(str(folder / filename))
    image.pack()
    image.filepath = f"//{filename}"  # keep the building machine's path out of the .blend
    graph = SkyGraph()
    coordinates = graph.add("TexCoord").outputs["Generated"]
    turned = graph.add("Mapping", {"Vector": coordinates, "Rotation": (0.0, 0.0, -rotation)})
    color = graph.add("TexEnvironment", {"Vector": turned}, image=image).outputs["Color"]
    if brightest is not None:
        color = graph.vector_math("MINIMUM", color, (brightest,) * 3)[0]
    graph.finish(color, strength)
