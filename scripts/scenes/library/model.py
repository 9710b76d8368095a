"""`Model`: shapes of several materials that are gathered into one mesh."""

from collections.abc import Sequence

import bpy
import numpy as np

from scenes.library.objects import transform
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, box, join

SHARP = np.radians(35)
"""The usual angle between faces above which an edge stays sharp."""


class Model:
    """Shapes, each with the name of its material, that become one mesh."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.parts: list[Shape] = []
        self.materials: list[str] = []

    def add(
        self,
        shape: Shape,
        material: str,
        at: Sequence[float] = (0, 0, 0),
        degrees: Sequence[float] = (0, 0, 0),
        scale: float | Sequence[float] = 1.0,
    ) -> None:
        """Add a shape: scaled, turned by XYZ Euler angles in degrees, and moved."""
        if material not in self.materials:
            self.materials.append(material)
        painted = shape.painted(self.materials.index(material))
        self.parts.append(painted.transformed(transform(at, np.radians(degrees), scale)))

    def box(
        self,
        size: Sequence[float],
        material: str,
        at: Sequence[float] = (0, 0, 0),
        degrees: Sequence[float] = (0, 0, 0),
        bevel: float = 0.0,
        segments: int = 1,
    ) -> None:
        """Add a box given by its size and its centre."""
        self.add(box(size, bevel, segments), material, at, degrees)

    def mesh(self, name: str, smooth: bool | float = SHARP) -> bpy.types.Mesh:
        """The mesh of all that was added; `objects.place` puts it into the scene."""
        return self.scene.mesh(name, join(self.parts), *self.materials, smooth=smooth)
