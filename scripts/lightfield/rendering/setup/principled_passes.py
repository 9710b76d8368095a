"""Writes the inputs of Principled BSDFs into passes, where a surface is one Principled BSDF alone.

A Diffuse BSDF counts as one without reflections. Its roughness is 1.

Materials write them into AOVs, which are Cycles' name for passes that nodes write. The nodes are
added to the open scene, not to its file. A ray passes through what transparency cuts out, and each
layer adds its values. So a layer that is cut out writes nothing. A surface that is anything else
than one opaque Principled BSDF writes into `INEXACT`.
"""

from collections.abc import Collection
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.formats.passes import AOV_PREFIX, INEXACT, Pass
from lightfield.rendering.setup import shadow_catchers

_PRINCIPLED = "ShaderNodeBsdfPrincipled"
_DIFFUSE = "ShaderNodeBsdfDiffuse"

# The inputs of the Principled BSDF by the names of their passes. Their values are from 0 to 1.
_VALUES = {
    "roughness": "Roughness",
    "metallic": "Metallic",
    "transmission": "Transmission Weight",
}
# The inputs of the Principled BSDF that looks like a Diffuse BSDF, beside its colour.
_MATT = {
    "Alpha": 1.0,
    "Roughness": 1.0,
    "Metallic": 0.0,
    "Transmission Weight": 0.0,
    "Emission Color": (0.0, 0.0, 0.0),
    "Emission Strength": 0.0,
}
# With at least this alpha a surface counts as opaque, and with at most 1 less it is cut out.
_OPAQUE = 0.999


def set_up(layer: Any, passes: Collection[Pass]) -> None:
    """Make every material of the scene write the surface passes among the ``passes``.

    Raises `UserError` for shadow catchers: Cycles adds their values twice.
    """
    of_surfaces = {each.name: each for each in passes if each.unless}
    if not of_surfaces:
        return
    if catchers := shadow_catchers.names():
        raise UserError(
            f"render.passes: {catchers[0]} is a shadow catcher, whose values are wrong in "
            f"{', '.join(of_surfaces)}; make it an ordinary object, or leave these passes out"
        )
    for view_pass in of_surfaces.values():
        for name in view_pass.cycles:
            _add_aov(layer, name, "VALUE" if view_pass.kind == "value" else "COLOR")
    _add_aov(layer, INEXACT, "VALUE")
    for material in bpy.data.materials:
        tree = material.node_tree
        output = tree.get_output_node("CYCLES") if tree else None
        if output is None or _source(output.inputs["Surface"]) is None:
            continue
        bsdf = _single_bsdf(output)
        if bsdf is None:
            _NodeWriter(tree).write(INEXACT, "Value", 1.0)
        else:
            _write_inputs(bsdf, of_surfaces)


def _add_aov(layer: Any, name: str, kind: str) -> None:
    aov = layer.aovs.add()
    aov.name = name
    aov.type = kind


def _source(socket: Any) -> Any:
    """Return the socket that gives a node's input its value. None if no link does."""
    links = [link for link in socket.links if not link.is_muted and link.is_valid]
    return links[0].from_socket if links else None


def _single_bsdf(output: Any) -> Any | None:
    """Return the Principled or Diffuse BSDF that a material's output shows unchanged, or None.

    It may lie in groups. Other materials may use a group in another way, so this one gets a copy.
    """
    socket = output.inputs["Surface"]
    while source := _source(socket):
        node = source.node
        if node.mute:
            return None
        if node.bl_idname in (_PRINCIPLED, _DIFFUSE):
            return node
        if node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree:
            node.node_tree = node.node_tree.copy()
            outputs = [n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput"]
            active = next((n for n in outputs if n.is_active_output), None)
            if active is None:
                return None
            socket = next(s for s in active.inputs if s.identifier == source.identifier)
        else:
            return None
    return None


def _write_inputs(bsdf: Any, passes: Collection[str]) -> None:
    """Write the inputs of a BSDF into the AOVs of ``passes``."""
    writer = _NodeWriter(bsdf.id_data)
    opaque: Any = 1.0
    alpha = _input(bsdf, "Alpha")
    if not isinstance(alpha, float) or alpha < _OPAQUE:
        opaque = writer.math("GREATER_THAN", alpha, _OPAQUE)
        visible = writer.math("GREATER_THAN", alpha, 1 - _OPAQUE)
        writer.write(INEXACT, "Value", writer.math("SUBTRACT", visible, opaque))
    if "surface_mask" in passes:
        writer.write(f"{AOV_PREFIX}surface_mask", "Value", opaque)
    for name, title in _VALUES.items():
        if name in passes:
            # Cycles clamps these inputs.
            value = writer.math("ADD", _input(bsdf, title), 0.0, clamped=True)
            writer.write(f"{AOV_PREFIX}{name}", "Value", writer.math("MULTIPLY", value, opaque))
    if "base_colour" in passes:
        colour = writer.scaled(_input(bsdf, "Base Color"), opaque)
        writer.write(f"{AOV_PREFIX}base_colour", "Color", colour)
    if "surface_emission" in passes:
        strength = writer.math("MULTIPLY", _input(bsdf, "Emission Strength"), opaque)
        emission = writer.scaled(_input(bsdf, "Emission Color"), strength)
        writer.write(f"{AOV_PREFIX}surface_emission", "Color", emission)


def _input(bsdf: Any, name: str) -> Any:
    """Return an input of a BSDF, by the Principled BSDF's ``name``.

    It is another node's output, or a number or colour.
    """
    if bsdf.bl_idname == _DIFFUSE:
        if name in _MATT:
            return _MATT[name]
        name = "Color"
    socket = bsdf.inputs[name]
    source = _source(socket)
    if source is not None:
        return source
    value = socket.default_value
    return float(value) if isinstance(value, float) else tuple(value)[:3]


class _NodeWriter:
    """Adds nodes to a material's or group's node tree. A value is a number or an output socket."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree

    def math(self, operation: str, first: Any, second: Any, clamped: bool = False) -> Any:
        """Return the output of a new math node."""
        node = self._tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        node.use_clamp = clamped
        self._give(node.inputs[0], first)
        self._give(node.inputs[1], second)
        return node.outputs[0]

    def scaled(self, colour: Any, factor: Any) -> Any:
        """Return the output of a new node that multiplies a colour by a number."""
        node = self._tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "SCALE"
        self._give(node.inputs["Vector"], colour)
        self._give(node.inputs["Scale"], factor)
        return node.outputs["Vector"]

    def write(self, aov: str, socket: str, value: Any) -> None:
        """Write a value into an AOV. ``socket`` is Color or Value."""
        node = self._tree.nodes.new("ShaderNodeOutputAOV")
        node.aov_name = aov
        self._give(node.inputs[socket], value)

    def _give(self, socket: Any, value: Any) -> None:
        if isinstance(value, float | tuple):
            socket.default_value = value
        else:
            self._tree.links.new(value, socket)
