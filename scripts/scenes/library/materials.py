"""Materials that more than one scene is made of."""

from collections.abc import Iterable
from typing import Any

import bpy

from scenes.library.nodes import Color, MaterialGraph


def by_name(materials: Iterable[bpy.types.Material]) -> dict[str, bpy.types.Material]:
    """The materials of a scene as `Scene.materials` wants them."""
    return {material.name: material for material in materials}


def plain(name: str, color: Color, **inputs: Any) -> bpy.types.Material:
    """A material of one Principled BSDF: plain("Brass", (0.6, 0.4, 0.1), Metallic=1.0)."""
    graph = MaterialGraph(name)
    return graph.finish(graph.principled(Base_Color=color, **inputs))


def metal(name: str, color: Color, roughness: float) -> bpy.types.Material:
    return plain(name, color, Roughness=roughness, Metallic=1.0)


def emissive(name: str, color: Color, strength: float) -> bpy.types.Material:
    """A glowing surface that lights nothing by itself: lamps do, and converge much sooner."""
    graph = MaterialGraph(name)
    glow = {"Emission_Color": (*color, 1.0), "Emission_Strength": strength}
    surface = graph.principled(Base_Color=color, Roughness=0.3, **glow)
    return graph.finish(surface, is_lamp=False)


def foliage(name: str, dark: Color, light: Color, through: float = 0.4) -> bpy.types.Material:
    """Thin leaves, each of its own tint; `through` is how much of the light comes out behind."""
    graph = MaterialGraph(name)
    return graph.finish(thin(graph, graph.piece_tint(dark, light), through))


def thin(graph: MaterialGraph, color: Any, through: float) -> bpy.types.Node:
    """A shader of leaves or paper: some of the light comes out at the other side."""
    back = graph.add("ShaderNodeBsdfTranslucent", {"Color": color})
    return graph.mix_shaders(through, graph.diffuse(color), back)


def wood(
    name: str, dark: Color, light: Color, roughness: float = 0.3, along: str = "Z"
) -> bpy.types.Material:
    """Grain along one of the object's axes, different in each piece of a mesh."""
    graph = MaterialGraph(name)
    shift = graph.math("MULTIPLY", graph.island_random(), 50.0)
    stretch = tuple(0.06 if axis == along else 1.0 for axis in "XYZ")
    where = graph.add("ShaderNodeVectorMath", {0: graph.coordinates(scale=stretch), 1: shift})
    color = graph.ramp(graph.noise(where, 24.0, detail=1.0), [(0.3, *dark), (0.7, *light)])
    return graph.finish(graph.principled(Base_Color=color, Roughness=roughness))


def bark(name: str, tint: Color) -> bpy.types.Material:
    """Cracked bark, with some green on it."""
    graph = MaterialGraph(name)
    cracks = graph.noise(graph.coordinates("Object", (7.0, 7.0, 1.6)), 3.0, 5.0, 0.7, 0.6)
    dark = tuple(0.3 * c for c in tint)
    color = graph.ramp(cracks, [(0.35, *dark), (0.6, *tint), (0.75, 0.09, 0.11, 0.06)])
    return graph.finish(graph.diffuse(color, graph.bump(cracks, 0.03)))
