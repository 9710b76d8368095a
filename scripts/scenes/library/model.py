"""`Model`: shapes of several materials that are gathered into one mesh."""

import re
from collections.abc import Sequence

import bpy
import numpy as np

from scenes.library.architecture import frame
from scenes.library.lettering import lettering
from scenes.library.objects import transform
from scenes.library.points import Points, points, rectangle, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, box, join, prism, sheet

SHARP = np.radians(35)
"""The usual angle between faces above which an edge stays sharp."""


class Model:
    """Shapes, each with the name of its material, that become one mesh."""

    def __init__(self, scene: Scene, parts: str = "") -> None:
        """A model that is empty, or of the parts that a text lists (see `draw`)."""
        self.scene = scene
        self.parts: list[Shape] = []
        self.materials: list[str] = []
        self.draw(parts)

    def add(
        self,
        shape: Shape,
        material: str,
        at: Points = (0, 0, 0),
        degrees: Sequence[float] = (0, 0, 0),
        scale: float | Sequence[float] = 1.0,
    ) -> None:
        """Add a shape: scaled, turned by XYZ Euler angles, and moved to a place or to each of n.

        at: a place (3,) or places (n, 3).
        """
        if material not in self.materials:
            self.materials.append(material)
        painted = shape.painted(self.materials.index(material))
        for place in np.atleast_2d(points(at)):
            self.parts.append(painted.transformed(transform(place, np.radians(degrees), scale)))

    def box(
        self,
        size: Sequence[float],
        material: str,
        at: Points = (0, 0, 0),
        degrees: Sequence[float] = (0, 0, 0),
        bevel: float = 0.0,
        segments: int = 1,
    ) -> None:
        """Add a box given by its size and its centre, or one at each of n centres."""
        self.add(box(size, bevel, segments), material, at, degrees)

    def draw(self, parts: str) -> None:
        """Add parts that a text lists, one a line; a line without a colon continues the last one.

        "Brass: lathe 0.04 0, 0 0.02 at ±0.3 0 1 turned 90 0 0 scaled 1 2 1" is a cone of brass at
        two places, turned by degrees and scaled; what follows the shape may be left out. Shapes:

            box      width depth height [bevel [segments]]
            ball     radius
            ring     radius thickness
            lathe    profile                    (radius and height; `pipe` is one without caps)
            tube     radius, path               (`bend` makes the path a smooth curve)
            prism    height, outline
            frame    width height, profile      (see `architecture.frame`)
            plane    width height
            word     size depth letters
        """
        for line in re.sub(r"\n(?=[^:\n]*(\n|$))", ",", parts.strip()).splitlines():
            material, part = line.split(":")
            kind, data = part.split(maxsplit=1)
            data, *rest = re.split(r",?\s+(at|turned|scaled)\s", data)
            placed = dict(zip(rest[::2], rest[1::2], strict=True))
            self.add(
                self._shape(kind, data),
                material.strip(),
                placed.get("at", "0 0 0"),
                points(placed.get("turned", "0 0 0"))[0],
                points(placed.get("scaled", "1 1 1"))[0],
            )

    def _shape(self, kind: str, data: str) -> Shape:
        scene = self.scene
        if kind == "word":
            size, depth, letters = data.split(maxsplit=2)
            word = lettering(letters, float(depth))
            return word.reshaped(word.vertices * (float(size), float(size), 1))
        if kind in ("lathe", "pipe"):
            profile = points(data)
            return scene.lathe(profile, _segments(profile[:, 0].max()), capped=kind == "lathe")
        head, _, rest = data.partition(",")
        numbers = points(head)[0].tolist()
        match kind:
            case "box":
                *size, bevel, segments = *numbers, *(0, 1)[len(numbers) - 3 :]
                return box(size, bevel, int(segments))
            case "ball":
                return scene.ball(*numbers, _segments(numbers[0]))
            case "ring":
                return scene.ring(*numbers, _segments(numbers[0]))
            case "tube":
                return scene.tube(rest, *numbers, 4 + 60 * numbers[0] ** 0.5)
            case "bend":
                return scene.bend(rest, *numbers, 7 * rest.count(","), 4 + 60 * numbers[0] ** 0.5)
            case "prism":
                return prism(rest, *numbers)
            case "frame":
                return frame(*numbers, rest)
            case "plane":
                return sheet(xyz(*rectangle(*numbers)[[0, 1, 3, 2]].T).reshape(2, 2, 3))
        raise ValueError(f"no such shape: {kind}")

    def mesh(self, name: str, smooth: bool | float = SHARP) -> bpy.types.Mesh:
        """The mesh of all that was added; `objects.place` puts it into the scene."""
        return self.scene.mesh(name, join(self.parts), *self.materials, smooth=smooth)


def _segments(radius: float) -> float:
    """Segments of something round at detail 1: 16 for 2 cm, 37 for 20 cm."""
    return 6 + 70 * radius**0.5
