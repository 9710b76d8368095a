"""`Scene`, the argument of every element of a scene, and `Model`, a mesh of several shapes."""

import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypedDict, TypeVar, Unpack

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library import shapes
from scenes.library.architecture import frame
from scenes.library.points import Points, points, rectangle, smooth_path, xyz
from scenes.library.shapes import Shape, box, join, lettering, prism, sheet, transform
from scenes.library.variation import AS_IT_IS, Variation, tint

Plan = TypeVar("Plan", bound=Variation)
SHARP = np.radians(35)  # the usual angle between faces above which an edge stays sharp


@dataclass(frozen=True)
class Scene(Generic[Plan]):
    """The seed, the level of detail (1 is full), and the plan of the place.

    An element is a function that takes a Scene and puts objects into Blender's scene. The shapes of
    a Scene have fewer segments at less detail. The number of triangles is proportional to `detail`,
    that of segments to its square root.
    """

    seed: int
    detail: float
    plan: Plan = AS_IT_IS  # type: ignore[assignment]  # changes nothing

    def random(self, element: str) -> np.random.Generator:
        """An element's own random numbers, so that its changes do not affect other elements."""
        return np.random.default_rng([self.seed, zlib.crc32(element.encode())])

    def segments(self, full: float, least: int = 3) -> int:
        """The number of segments of a curve that has `full` segments at detail 1."""
        return max(least, round(full * self.detail**0.5))

    def count(self, full: float, least: int = 1) -> int:
        """The number of small objects (leaves, blades, props). Detail 1 has `full`."""
        return max(least, round(full * self.detail))

    def lathe(self, profile: Points, segments: float = 24, capped: bool = True) -> Shape:
        """`shapes.lathe` with the number of segments by detail."""
        return shapes.lathe(profile, self.segments(segments, 6), capped)

    def tube(self, path: Points, radius: ArrayLike, sides: float = 8) -> Shape:
        """`shapes.tube` with the number of sides by detail."""
        return shapes.tube(path, radius, self.segments(sides, 4))

    def bend(self, path: Points, radius: float, steps: float = 24, sides: float = 8) -> Shape:
        """A tube along a smooth curve through the points."""
        return self.tube(smooth_path(path, self.segments(steps, 5)), radius, sides)

    def ball(self, radius: float, segments: float = 16) -> Shape:
        """A sphere of meridians and parallels."""
        angle = np.linspace(-np.pi / 2, np.pi / 2, self.segments(segments / 2, 4) + 1)
        return self.lathe(radius * np.column_stack([np.cos(angle), np.sin(angle)]), segments)

    def ring(self, radius: float, thick: float, segments: float = 24, sides: float = 8) -> Shape:
        """A torus about Z: the radius of its middle and of its tube."""
        angle = np.linspace(0, 2 * np.pi, self.segments(sides, 4) + 1)
        section = np.column_stack([radius + thick * np.cos(angle), thick * np.sin(angle)])
        return self.lathe(section, segments, capped=False)

    def mesh(
        self, name: str, shape: Shape, *materials: str, smooth: bool | float = True
    ) -> bpy.types.Mesh:
        """A mesh of a shape with its materials, one for each of the shape's slots, by name.

        `smooth` may be an angle in radians, above which edges stay sharp.
        """
        data = bpy.data.meshes.new(name)
        quads = len(shape.quads)
        triangles = len(shape.triangles)
        corners = np.concatenate([shape.quads.ravel(), shape.triangles.ravel()]).astype(np.int32)
        triangle_starts = quads * 4 + np.arange(triangles) * 3
        starts = np.concatenate([np.arange(quads) * 4, triangle_starts]).astype(np.int32)
        data.vertices.add(len(shape.vertices))
        data.vertices.foreach_set("co", shape.vertices.astype(np.float32).ravel())
        data.loops.add(len(corners))
        data.loops.foreach_set("vertex_index", corners)
        data.polygons.add(quads + triangles)
        data.polygons.foreach_set("loop_start", starts)
        for material in materials:
            data.materials.append(bpy.data.materials[material])
        data.polygons.foreach_set("material_index", shape.face_slots().astype(np.int32))
        data.update(calc_edges=True)
        if smooth:
            data.shade_smooth()
        else:
            data.shade_flat()
        if not isinstance(smooth, bool):
            data.set_sharp_from_angle(angle=float(smooth))
        return data

    def add(
        self, name: str, shape: Shape, *materials: str, matrix: Matrix | None = None, **smooth: Any
    ) -> bpy.types.Object:
        """An object with its own mesh (see `mesh`)."""
        return place(name, self.mesh(name, shape, *materials, **smooth), matrix)


def fill(
    palette: Callable,
    elements: Iterable[Callable],
    parameters: Mapping[str, Any],
    drawn: Callable[[int], Variation] = lambda place: AS_IT_IS,
    original: Variation = AS_IT_IS,
) -> None:
    """Fill the empty scene.

    drawn: draws the plan of a place. original: the plan without a place. parameters: `seed` (int),
    `detail` (1.0 is full), and `place` (int, or None for the original).
    """
    number = parameters.get("place")
    plan = original if number is None else drawn(int(number))
    palette()
    for material, factors in plan.tints.items():
        tint(material, factors)
    scene = Scene(int(parameters["seed"]), float(parameters["detail"]), plan)
    for element in elements:
        if element.__name__ not in plan.absent:
            earlier = set(bpy.data.objects)
            element(scene)
            plan.arrange(element.__name__, set(bpy.data.objects) - earlier)


def place(name: str, data: bpy.types.ID | None, matrix: Matrix | None = None) -> bpy.types.Object:
    """Put an object with a mesh, light or curve into the scene, by default at the origin.

    Objects that share one mesh are instances: Cycles keeps it in memory once.
    """
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    if matrix is not None:
        obj.matrix_world = matrix
    return obj


def scatter(name: str, meshes: Sequence[bpy.types.Mesh], matrices: Iterable[Matrix]) -> None:
    """Instances of the meshes, taken in turn, one at each matrix."""
    for i, matrix in enumerate(matrices):
        place(f"{name}.{i:04d}", meshes[i % len(meshes)], matrix)


def animate(owner: bpy.types.bpy_struct, path: str, per_frame: float, index: int = -1) -> None:
    """Make a property grow by `per_frame` each frame, from its present value at frame 1.

    owner: the struct that holds it, such as a node's input socket with path "default_value", or an
    object with "location" and an index. Uses keyframes, because drivers need enabled scripts.
    """
    start = np.array(getattr(owner, path))
    step = per_frame if index < 0 else per_frame * np.eye(3)[index]
    for after in (1, 0):
        setattr(owner, path, (start + after * step).tolist())
        owner.keyframe_insert(path, index=index, frame=1 + after)
    action = owner.id_data.animation_data.action
    for curve in action.layers[0].strips[0].channelbags[0].fcurves:
        curve.extrapolation = "LINEAR"
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


class Placement(TypedDict, total=False):
    """The placement of a part of a model. Each key is optional.

    at: a place (3,), or places (n, 3) of n copies. turned: XYZ Euler angles in degrees. scaled: one
    factor, or one for each axis. A part is scaled first, then turned, then moved.
    """

    at: Points
    turned: Sequence[float]
    scaled: float | Sequence[float]


class Model:
    """Shapes, each with the name of its material, that become one mesh.

    Lengths are in metres. The scene's detail sets how many segments a round part has.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.parts: list[Shape] = []
        self.materials: list[str] = []

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
        for where in np.atleast_2d(points(at)):
            self.parts.append(painted.transformed(transform(where, np.radians(degrees), scale)))

    def box(
        self,
        *,
        size: Sequence[float],
        material: str,
        bevel: float = 0.0,
        segments: int = 1,
        **placement: Unpack[Placement],
    ) -> None:
        """Add a box of a size (3,) about the origin. `segments` round its bevelled edges."""
        self._put(box(tuple(size), bevel, segments), material, placement)

    def ball(self, *, radius: float, material: str, **placement: Unpack[Placement]) -> None:
        """Add a ball about the origin."""
        self._put(self.scene.ball(radius, _segments(radius)), material, placement)

    def ring(
        self, *, radius: float, thickness: float, material: str, **placement: Unpack[Placement]
    ) -> None:
        """Add a torus about Z: the radius of its middle, and `thickness`, its tube's radius."""
        ring = self.scene.ring(radius, thickness, _segments(radius))
        self._put(ring, material, placement)

    def lathe(self, *, profile: Points, material: str, **placement: Unpack[Placement]) -> None:
        """Add a solid of revolution about Z. profile (n, 2) is radius and height, upwards."""
        radius = points(profile)[:, 0].max()
        self._put(self.scene.lathe(profile, _segments(radius)), material, placement)

    def pipe(self, *, profile: Points, material: str, **placement: Unpack[Placement]) -> None:
        """Add a solid like `lathe`, but open at both ends."""
        radius = points(profile)[:, 0].max()
        pipe = self.scene.lathe(profile, _segments(radius), capped=False)
        self._put(pipe, material, placement)

    def tube(
        self, *, radius: float, path: Points, material: str, **placement: Unpack[Placement]
    ) -> None:
        """Add a tube along straight lines through the places (n, 3) of a path."""
        self._put(self.scene.tube(path, radius, _sides(radius)), material, placement)

    def bend(
        self, *, radius: float, path: Points, material: str, **placement: Unpack[Placement]
    ) -> None:
        """Add a tube along a smooth curve through the places (n, 3) of a path."""
        steps = 7 * (len(points(path)) - 1)
        self._put(self.scene.bend(path, radius, steps, _sides(radius)), material, placement)

    def prism(
        self, *, outline: Points, height: float, material: str, **placement: Unpack[Placement]
    ) -> None:
        """Add an outline (n, 2), counter-clockwise in x and y, extruded upwards from z = 0."""
        self._put(prism(outline, height), material, placement)

    def frame(
        self,
        *,
        size: tuple[float, float],
        profile: Points,
        material: str,
        **placement: Unpack[Placement],
    ) -> None:
        """Add a flat mitred frame round an opening of a size (see `architecture.frame`)."""
        self._put(frame(*size, profile), material, placement)

    def plane(
        self, *, size: tuple[float, float], material: str, **placement: Unpack[Placement]
    ) -> None:
        """Add a rectangle about the origin that faces +Z."""
        corners = rectangle(*size)[[0, 1, 3, 2]]
        self._put(sheet(xyz(*corners.T).reshape(2, 2, 3)), material, placement)

    def word(
        self,
        *,
        letters: str,
        size: float,
        depth: float,
        material: str,
        **placement: Unpack[Placement],
    ) -> None:
        """Add flat letters about the origin, `size` high and `depth` thick, that face +Z."""
        word = lettering(letters, depth).scaled(size, size, 1)
        self._put(word, material, placement)

    def _put(self, shape: Shape, material: str, placement: Placement) -> None:
        at = placement.get("at", (0, 0, 0))
        turned = placement.get("turned", (0, 0, 0))
        self.add(shape, material, at, turned, placement.get("scaled", 1.0))

    def mesh(self, name: str, smooth: bool | float = SHARP) -> bpy.types.Mesh:
        """The mesh of all added shapes. `place` puts it into the scene."""
        return self.scene.mesh(name, join(self.parts), *self.materials, smooth=smooth)


def _segments(radius: float) -> float:
    """Segments of something round at detail 1: 16 for 2 cm, 37 for 20 cm."""
    return 6 + 70 * radius**0.5


def _sides(radius: float) -> float:
    """Sides of a tube at detail 1: 8 for 5 mm, 12 for 2 cm."""
    return 4 + 60 * radius**0.5
