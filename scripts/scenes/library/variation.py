"""Places: what a number draws anew in a scene, besides its leaves and its scatter.

A plan holds what varies. `Variation` is the part that all scenes share: absent elements, moved
elements, and tinted materials. A scene adds the measures and lamps that its elements read. `Draw`
draws the values.
"""

import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import bpy
import numpy as np
from mathutils import Matrix

Factors = tuple[float, float, float]  # of linear red, green and blue
Option = TypeVar("Option")


class Draw:
    """The random values of a place, each from a generator of its own name.

    A new value thus leaves the others as they are. Values are rounded, so that they are equal on
    every machine.
    """

    def __init__(self, place: int) -> None:
        self.place = place

    def generator(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self.place, zlib.crc32(name.encode())])

    def uniform(self, name: str, low: float, high: float) -> float:
        """A number between low and high, rounded to 0.1 mm if it is in metres."""
        return round(float(self.generator(name).uniform(low, high)), 4)

    def count(self, name: str, least: int, most: int) -> int:
        """A whole number from least to most, both included."""
        return int(self.generator(name).integers(least, most + 1))

    def chance(self, name: str, probability: float) -> bool:
        return bool(self.generator(name).random() < probability)

    def choice(self, name: str, options: Sequence[Option]) -> Option:
        return options[int(self.generator(name).integers(len(options)))]

    def absent(self, probabilities: Mapping[str, float]) -> frozenset[str]:
        """The names that are not drawn, each by the probability with which it is there."""
        return frozenset(
            name
            for name, probability in probabilities.items()
            if not self.chance(f"{name} is there", probability)
        )

    def tints(self, table: Mapping[str, Sequence[Factors]]) -> dict[str, Factors]:
        """One of its factors for each material of a table. Materials with a comma share theirs."""
        chosen: dict[str, Factors] = {}
        for names, options in table.items():
            factors = self.choice(f"tint of {names}", options)
            chosen |= dict.fromkeys(names.split(", "), factors)
        return chosen


@dataclass(frozen=True)
class Move:
    """A move of some elements: turned about Z at `start`, scaled there, and brought to `end`.

    start, end: x and y in metres. turned: degrees.
    """

    start: tuple[float, float] = (0.0, 0.0)
    end: tuple[float, float] = (0.0, 0.0)
    turned: float = 0.0
    scale: float = 1.0

    def matrix(self) -> Matrix:
        there = Matrix.Translation((*self.end, 0.0))
        turn = Matrix.Rotation(np.radians(self.turned), 4, "Z") @ Matrix.Scale(self.scale, 4)
        return there @ turn @ Matrix.Translation((-self.start[0], -self.start[1], 0.0))


@dataclass(frozen=True)
class Variation:
    """What a place changes in any scene. Without arguments it changes nothing.

    absent: names of elements. moves: by the names of elements. tints: by the names of materials.
    """

    absent: frozenset[str] = frozenset()
    moves: Mapping[str, Move] = field(default_factory=dict)
    tints: Mapping[str, Factors] = field(default_factory=dict)

    def arrange(self, element: str, objects: Iterable[bpy.types.Object]) -> None:
        """Bring the objects of an element to where this place has them."""
        if element in self.moves:
            move(objects, self.moves[element].matrix())


AS_IT_IS = Variation()


def move(objects: Iterable[bpy.types.Object], matrix: Matrix) -> None:
    """Move objects that have no parent."""
    for obj in objects:
        obj.matrix_world = matrix @ obj.matrix_world


def tint(name: str, factors: Factors) -> None:
    """Multiply the colours of a material's surfaces and glow, textures too. None exceeds 1."""
    tree = bpy.data.materials[name].node_tree
    for node in list(tree.nodes):
        if not node.bl_idname.startswith(("ShaderNodeBsdf", "ShaderNodeEmission")):
            continue
        socket = node.inputs.get("Base Color") or node.inputs.get("Color")
        if socket is None:
            continue
        if not socket.is_linked:
            color = np.minimum(np.array(socket.default_value[:3]) * factors, 1.0)
            socket.default_value = (*color.tolist(), 1.0)
            continue
        source = socket.links[0].from_socket
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        mix.blend_type = "MULTIPLY"
        mix.clamp_result = True
        mix.inputs[0].default_value = 1.0
        mix.inputs[7].default_value = (*factors, 1.0)
        tree.links.new(source, mix.inputs[6])
        tree.links.new(mix.outputs[2], socket)


Disc = tuple[float, float, float]  # x, y, radius


def discs_apart(first: Iterable[Disc], second: Sequence[Disc]) -> bool:
    """Whether no disc of the first covers a part of one of the second."""
    return all(
        np.hypot(x - other_x, y - other_y) > radius + other_radius
        for x, y, radius in first
        for other_x, other_y, other_radius in second
    )


def turned_discs(discs: Iterable[Disc], how: Move) -> list[Disc]:
    """Discs about a group's start, as they lie after its move."""
    turn = np.radians(how.turned)
    cosine = np.cos(turn)
    sine = np.sin(turn)
    return [
        (
            float(how.end[0] + how.scale * (cosine * x - sine * y)),
            float(how.end[1] + how.scale * (sine * x + cosine * y)),
            how.scale * radius,
        )
        for x, y, radius in discs
    ]
