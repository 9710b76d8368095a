"""Shader node trees, built by expressions, and materials that several scenes use."""

from collections.abc import Iterable, Mapping
from typing import Any

import bpy

from scenes.library.points import Points, points

Color = tuple[float, float, float]  # linear red, green and blue


class Graph:
    """A shader node tree that is built by expressions.

    An input of a method may be a value, a socket, or a node (its first output).
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        tree.nodes.clear()

    def add(
        self, kind: str, inputs: Mapping[str | int, Any] | None = None, **properties: Any
    ) -> bpy.types.Node:
        """A node of type `kind` with these properties, and inputs by name or number."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in properties.items():
            setattr(node, name, value)
        for key, value in (inputs or {}).items():
            socket = node.inputs[key]
            if isinstance(value, bpy.types.Node):
                value = value.outputs[0]
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            elif socket.type == "RGBA" and len(value) == 3:
                socket.default_value = (*value, 1.0)
            else:
                socket.default_value = value
        return node

    def coordinates(self, *scale: float) -> bpy.types.NodeSocket:
        """The object's own coordinates, scaled along its axes."""
        where = self.add("TexCoord").outputs["Object"]
        return self.add("Mapping", {"Vector": where, "Scale": scale or (1, 1, 1)}).outputs[0]

    def geometry(self, name: str) -> bpy.types.NodeSocket:
        """A property of the visible point: its world Position or Normal, Random Per Island, …"""
        return self.add("NewGeometry").outputs[name]

    def noise(self, vector: Any, *numbers: float, **properties: Any) -> bpy.types.NodeSocket:
        """Noise in 0..1, around 0.5. numbers: scale, detail (4), roughness, distortion, and W."""
        names = ("Scale", "Detail", "Roughness", "Distortion", "W")
        inputs = {"Vector": vector, "Detail": 4.0} | dict(zip(names, numbers, strict=False))
        return self.add("TexNoise", inputs, **properties).outputs[0]

    def voronoi(self, vector: Any, scale: float, feature: str = "F1") -> bpy.types.NodeOutputs:
        """Voronoi cells: outputs Distance, Color and Position."""
        return self.add("TexVoronoi", {"Vector": vector, "Scale": scale}, feature=feature).outputs

    def ramp(self, factor: Any, stops: Points) -> bpy.types.NodeSocket:
        """Colours by position: stops (n, 4) are position 0..1, red, green, blue."""
        node = self.add("ValToRGB", {0: factor})
        elements = node.color_ramp.elements
        rows = points(stops)
        while len(elements) < len(rows):
            elements.new(1.0)
        for element, (position, *color) in zip(elements, rows, strict=True):
            element.position = position
            element.color = (*color, 1.0)
        return node.outputs[0]

    def span(
        self, value: Any, to_min: float, to_max: float, from_min: float = 0.0, from_max: float = 1.0
    ) -> bpy.types.NodeSocket:
        """A value mapped linearly from one range to another, clamped."""
        inputs = {0: value, 1: from_min, 2: from_max, 3: to_min, 4: to_max}
        return self.add("MapRange", inputs).outputs[0]

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Arithmetic of one to three values: ADD, MULTIPLY, MULTIPLY_ADD, COSINE, …"""
        return self.add("Math", dict(enumerate(values)), operation=operation).outputs[0]

    def vector_math(self, operation: str, *values: Any) -> bpy.types.NodeOutputs:
        """Arithmetic of vectors: outputs Vector, and Value for LENGTH."""
        return self.add("VectorMath", dict(enumerate(values)), operation=operation).outputs

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> bpy.types.NodeSocket:
        """Two colours mixed: a at factor 0, b at factor 1."""
        inputs = {0: factor, 6: a, 7: b}
        return self.add("Mix", inputs, data_type="RGBA", blend_type=blend).outputs[2]

    def xyz(self, vector: Any) -> bpy.types.NodeOutputs:
        """The components of a vector: outputs "X", "Y", "Z"."""
        return self.add("SeparateXYZ", {0: vector}).outputs

    def bump(self, height: Any, distance: float) -> bpy.types.NodeSocket:
        """A normal bent by heights in units of `distance` metres."""
        return self.add("Bump", {"Height": height, "Distance": distance}).outputs[0]

    def object_random(self) -> bpy.types.NodeSocket:
        """A number in 0..1, another one for each object or instance."""
        return self.add("ObjectInfo").outputs["Random"]

    def shifted(self, *scale: float) -> bpy.types.NodeSocket:
        """Coordinates with another offset for each connected piece of a mesh."""
        shift = self.math("MULTIPLY", self.geometry("Random Per Island"), 50.0)
        return self.vector_math("ADD", self.coordinates(*scale), shift)[0]

    def piece_tint(self, dark: Color, light: Color) -> bpy.types.NodeSocket:
        """A colour between two, another one for each connected piece of each object."""
        total = self.math("ADD", self.geometry("Random Per Island"), self.object_random())
        return self.mix(self.math("FRACT", total), dark, light)

    def principled(self, **inputs: Any) -> bpy.types.Node:
        """A Principled BSDF. Inputs by name with underscores: Base_Color, Roughness, IOR, …"""
        named = {name.replace("_", " "): value for name, value in inputs.items()}
        return self.add("BsdfPrincipled", named)

    def plain_when_diffuse(self, surface: Any, color: Color) -> bpy.types.Node:
        """A shader that is a flat diffuse `color` to rays that come from a diffuse surface.

        Cycles then skips the textures for light that is already blurred. `color` should be the
        surface's mean colour.
        """
        blurred = self.add("LightPath").outputs["Is Diffuse Ray"]
        return self.mix_shaders(blurred, surface, self.diffuse(color))

    def diffuse(self, color: Any, **normal: Any) -> bpy.types.Node:
        """A diffuse BSDF. Its Normal may be bent (see `bump`)."""
        return self.add("BsdfDiffuse", {"Color": color} | normal)

    def thin(self, color: Any, through: float) -> bpy.types.Node:
        """A shader of leaves or paper: some of the light comes out on the other side."""
        back = self.add("BsdfTranslucent", {"Color": color})
        return self.mix_shaders(through, self.diffuse(color), back)

    def mix_shaders(self, factor: Any, a: Any, b: Any) -> bpy.types.Node:
        """Two shaders mixed: a at factor 0, b at factor 1."""
        return self.add("MixShader", {0: factor, 1: a, 2: b})


class SkyGraph(Graph):
    """The graph of the scene's world. End it with `finish`."""

    def __init__(self) -> None:
        self.world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
        super().__init__(self.world.node_tree)

    def finish(self, color: Any, strength: float) -> None:
        background = self.add("Background", {"Color": color, "Strength": strength})
        self.add("OutputWorld", {"Surface": background})


class MaterialGraph(Graph):
    """The graph of a new material. End it with `finish`."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        super().__init__(self.material.node_tree)

    def finish(self, surface: Any = None, volume: Any = None, is_lamp: bool = True) -> None:
        """Connect the shaders to the material's output.

        is_lamp: whether Cycles samples an emission as a lamp. Without it the emission is only
        visible, which converges sooner if lamps give its light.
        """
        inputs = {"Surface": surface, "Volume": volume}
        self.add("OutputMaterial", {k: v for k, v in inputs.items() if v is not None})
        if not is_lamp:
            self.material.cycles.emission_sampling = "NONE"


def plain(name: str, color: Color, **inputs: Any) -> None:
    """A material of one Principled BSDF: plain("Brass", (0.6, 0.4, 0.1), Metallic=1.0)."""
    graph = MaterialGraph(name)
    graph.finish(graph.principled(Base_Color=color, **inputs))


def plains(table: Iterable[tuple[str, Color, float]], **inputs: Any) -> None:
    """Materials of one Principled BSDF each: name, colour and roughness."""
    for name, color, roughness in table:
        plain(name, color, Roughness=roughness, **inputs)


def emissive(name: str, color: Color, strength: float) -> None:
    """A glowing surface that lights nothing: lamps give its light, and converge much sooner."""
    graph = MaterialGraph(name)
    glow = {"Emission_Color": color, "Emission_Strength": strength}
    graph.finish(graph.principled(Base_Color=color, Roughness=0.3, **glow), is_lamp=False)


def foliage(table: Iterable[tuple[str, Color, Color, float]]) -> None:
    """Thin leaves, each of its own tint: name, dark colour, light colour, and transmitted part."""
    for name, dark, light, through in table:
        graph = MaterialGraph(name)
        graph.finish(graph.thin(graph.piece_tint(dark, light), through))


def wood(name: str, dark: Color, light: Color, roughness: float, along: str = "Z") -> None:
    """Grain along one of the object's axes, different in each piece of a mesh."""
    graph = MaterialGraph(name)
    stretched = graph.shifted(*(0.06 if axis == along else 1.0 for axis in "XYZ"))
    color = graph.ramp(graph.noise(stretched, 24.0, 1.0), [(0.3, *dark), (0.7, *light)])
    graph.finish(graph.principled(Base_Color=color, Roughness=roughness))
