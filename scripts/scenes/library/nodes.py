"""Shader node trees, built by expressions."""

from collections.abc import Mapping
from typing import Any

import bpy

from scenes.library.points import Points, points

Color = tuple[float, float, float]
"""Linear red, green and blue."""


class Graph:
    """A shader node tree that is built by expressions.

    Wherever a method takes an input it may be a value, a socket, or a node (its first output).
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        tree.nodes.clear()

    def add(
        self, kind: str, inputs: Mapping[str | int, Any] | None = None, **properties: Any
    ) -> bpy.types.Node:
        """A node of type `kind`, its properties set, its inputs (by name or number) given."""
        node = self.tree.nodes.new(kind)
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

    def coordinates(self, kind: str = "Object", scale: Any = 1.0) -> bpy.types.NodeSocket:
        """Texture coordinates: Object, Generated, Normal, UV, Window or Reflection."""
        socket = self.add("ShaderNodeTexCoord").outputs[kind]
        size = (scale,) * 3 if isinstance(scale, int | float) else scale
        return self.add("ShaderNodeMapping", {"Vector": socket, "Scale": size}).outputs[0]

    def noise(
        self,
        vector: Any,
        scale: float,
        detail: float = 4.0,
        roughness: float = 0.5,
        distortion: float = 0.0,
        w: float | None = None,
    ) -> bpy.types.NodeSocket:
        """Noise in 0..1, around 0.5. With `w` it is four-dimensional (see `animate`)."""
        inputs: dict[str | int, Any] = {
            "Vector": vector,
            "Scale": scale,
            "Detail": detail,
            "Roughness": roughness,
            "Distortion": distortion,
        }
        if w is None:
            return self.add("ShaderNodeTexNoise", inputs).outputs[0]
        inputs["W"] = w
        return self.add("ShaderNodeTexNoise", inputs, noise_dimensions="4D").outputs[0]

    def voronoi(self, vector: Any, scale: float, feature: str = "F1") -> bpy.types.Node:
        """Voronoi cells: outputs Distance and, but for DISTANCE_TO_EDGE, Color and Position."""
        inputs = {"Vector": vector, "Scale": scale}
        return self.add("ShaderNodeTexVoronoi", inputs, feature=feature)

    def ramp(self, factor: Any, stops: Points) -> bpy.types.NodeSocket:
        """Colours by position: stops (n, 4) are position 0..1, red, green, blue."""
        node = self.add("ShaderNodeValToRGB", {0: factor})
        elements, rows = node.color_ramp.elements, points(stops)
        while len(elements) < len(rows):
            elements.new(1.0)
        for element, (position, *color) in zip(elements, rows, strict=True):
            element.position, element.color = position, (*color, 1.0)
        return node.outputs[0]

    def span(
        self, value: Any, to_min: float, to_max: float, from_min: float = 0.0, from_max: float = 1.0
    ) -> bpy.types.NodeSocket:
        """A value mapped linearly from one range to another, clamped."""
        inputs = {0: value, 1: from_min, 2: from_max, 3: to_min, 4: to_max}
        return self.add("ShaderNodeMapRange", inputs).outputs[0]

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Arithmetic of one to three values: ADD, MULTIPLY, MULTIPLY_ADD, COSINE, …"""
        return self.add("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> bpy.types.NodeSocket:
        """Two colours mixed: a at factor 0, b at factor 1."""
        node = self.add(
            "ShaderNodeMix", {0: factor, 6: a, 7: b}, data_type="RGBA", blend_type=blend
        )
        return node.outputs[2]

    def xyz(self, vector: Any) -> bpy.types.NodeOutputs:
        """The components of a vector: outputs "X", "Y", "Z"."""
        return self.add("ShaderNodeSeparateXYZ", {0: vector}).outputs

    def bump(self, height: Any, distance: float, strength: float = 1.0) -> bpy.types.NodeSocket:
        """A normal bent by heights in units of `distance` metres."""
        return self.add(
            "ShaderNodeBump", {"Height": height, "Distance": distance, "Strength": strength}
        ).outputs[0]

    def object_random(self) -> bpy.types.NodeSocket:
        """A number in 0..1 that each object (instance) has of its own."""
        return self.add("ShaderNodeObjectInfo").outputs["Random"]

    def island_random(self) -> bpy.types.NodeSocket:
        """A number in 0..1 that each connected piece of a mesh has of its own."""
        return self.add("ShaderNodeNewGeometry").outputs["Random Per Island"]

    def piece_tint(self, dark: Color, light: Color) -> bpy.types.NodeSocket:
        """A colour between two that each connected piece of each object has of its own."""
        total = self.math("ADD", self.island_random(), self.object_random())
        return self.mix(self.math("FRACT", total), dark, light)

    def principled(self, **inputs: Any) -> bpy.types.Node:
        """A Principled BSDF; inputs by name with underscores: Base_Color, Roughness, IOR, …"""
        named = {name.replace("_", " "): value for name, value in inputs.items()}
        return self.add("ShaderNodeBsdfPrincipled", named)

    def plain_when_diffuse(self, surface: Any, color: Color) -> bpy.types.Node:
        """A shader that is a flat diffuse `color` to rays that come from a diffuse surface.

        Cycles then skips the textures wherever light has been blurred already: give it the
        surface's mean colour.
        """
        blurred = self.add("ShaderNodeLightPath").outputs["Is Diffuse Ray"]
        return self.mix_shaders(blurred, surface, self.diffuse(color))

    def diffuse(self, color: Any, normal: Any = None) -> bpy.types.Node:
        """A diffuse BSDF, its normal bent where one is given (see `bump`)."""
        inputs = {"Color": color} | ({} if normal is None else {"Normal": normal})
        return self.add("ShaderNodeBsdfDiffuse", inputs)

    def emission(self, color: Any, strength: Any) -> bpy.types.Node:
        """Light of its own: radiance from a surface, radiance a metre from a volume."""
        return self.add("ShaderNodeEmission", {"Color": color, "Strength": strength})

    def mix_shaders(self, factor: Any, a: Any, b: Any) -> bpy.types.Node:
        """Two shaders mixed: a at factor 0, b at factor 1."""
        return self.add("ShaderNodeMixShader", {0: factor, 1: a, 2: b})


class MaterialGraph(Graph):
    """The graph of a new material; end it with `finish`."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        super().__init__(self.material.node_tree)

    def finish(
        self, surface: Any = None, volume: Any = None, is_lamp: bool = True
    ) -> bpy.types.Material:
        """Connect the shaders to the material's output.

        is_lamp: whether Cycles samples what glows in it as a lamp. Without, it is only seen, which
        converges sooner where lamps give its light.
        """
        inputs = {"Surface": surface, "Volume": volume}
        self.add("ShaderNodeOutputMaterial", {k: v for k, v in inputs.items() if v is not None})
        if not is_lamp:
            self.material.cycles.emission_sampling = "NONE"
        return self.material
