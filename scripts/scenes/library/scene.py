"""`Scene`, the context that every element of a scene is a function of."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library import objects, shapes
from scenes.library.points import Points, smooth_path
from scenes.library.shapes import Shape


@dataclass(frozen=True)
class Scene:
    """The seed, the level of detail (1 is full), and the scene's materials by name.

    An element is a function of it that puts objects into Blender's scene. Shapes that Scene makes
    have fewer segments at less detail: triangles go with `detail`, segments with its square root.
    """

    seed: int
    detail: float
    materials: Mapping[str, bpy.types.Material]

    def random(self, element: str) -> np.random.Generator:
        """Random numbers of an element's own, so that a change to it leaves the others alone."""
        return np.random.default_rng([self.seed, zlib.crc32(element.encode())])

    def segments(self, full: float, least: int = 3) -> int:
        """How many segments to divide a curve into that has `full` at detail 1."""
        return max(least, round(full * self.detail**0.5))

    def count(self, full: float, least: int = 1) -> int:
        """How many small things (leaves, blades, props) to make of `full` at detail 1."""
        return max(least, round(full * self.detail))

    def lathe(self, profile: Points, segments: float = 24, capped: bool = True) -> Shape:
        """`shapes.lathe` with segments by detail."""
        return shapes.lathe(profile, self.segments(segments, 6), capped)

    def tube(self, path: Points, radius: ArrayLike, sides: float = 8, capped: bool = True) -> Shape:
        """`shapes.tube` with sides by detail."""
        return shapes.tube(path, radius, self.segments(sides, 4), capped)

    def bend(self, path: Points, radius: float, steps: float = 24, sides: float = 8) -> Shape:
        """A tube along a smooth curve through the points."""
        return self.tube(smooth_path(path, self.segments(steps, 5)), radius, sides)

    def ball(self, radius: float, segments: float = 16) -> Shape:
        """A sphere of meridians and parallels."""
        angle = np.linspace(-np.pi / 2, np.pi / 2, self.segments(segments / 2, 4) + 1)
        return self.lathe(radius * np.column_stack([np.cos(angle), np.sin(angle)]), segments)

    def ring(
        self, radius: float, thickness: float, segments: float = 24, sides: float = 8
    ) -> Shape:
        """A torus about Z: the radius of its middle and of its tube."""
        angle = np.linspace(0, 2 * np.pi, self.segments(sides, 4) + 1)
        section = np.column_stack([radius + thickness * np.cos(angle), thickness * np.sin(angle)])
        return self.lathe(section, segments, capped=False)

    def mesh(
        self, name: str, shape: Shape, *materials: str, smooth: bool | float = True
    ) -> bpy.types.Mesh:
        """`objects.mesh` with the materials, one for each of the shape's slots, by name."""
        made = (self.materials[each] for each in materials)
        return objects.mesh(name, shape, *made, smooth=smooth)

    def add(
        self,
        name: str,
        shape: Shape,
        *materials: str,
        matrix: Matrix | None = None,
        smooth: bool | float = True,
    ) -> bpy.types.Object:
        """One object of a mesh of its own."""
        return objects.place(name, self.mesh(name, shape, *materials, smooth=smooth), matrix)
