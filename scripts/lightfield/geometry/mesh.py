"""The surface of a scene: triangle meshes, and the objects that place them in the world."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """A mesh in its own coordinates.

    ``vertices`` (n, 3) are float32. ``triangles`` (m, 3) int32 are indices of vertices,
    counter-clockwise as seen from outside.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]


@dataclass(frozen=True)
class Placed:
    """An object or an instance that shows a mesh.

    - ``name``: its name. An instance has the name that names.json of the id passes gives it.
    - ``original``: the name of the object that it shows.
    - ``mesh``: an index of `SceneSurface.meshes`.
    - ``world_from_object`` (4, 4): from the mesh's coordinates to the world, in metres with Z up.
    - ``numbers``: its values in the id passes "object" and "instance". Empty without such passes.
    """

    name: str
    original: str
    mesh: int
    world_from_object: Floats
    numbers: dict[str, int]


@dataclass(frozen=True)
class SceneSurface:
    """The surface of a scene that cameras can see at a frame, as meshes.

    ``left_out`` says why an object that cameras can see has no mesh, by the object's name.
    """

    meshes: Sequence[Mesh]
    placed: Sequence[Placed]
    left_out: dict[str, str]

    def in_world(self) -> Iterator[tuple[Placed, Floats, NDArray[np.int32]]]:
        """Yield each placed mesh with its vertices (n, 3) in the world, and its triangles (m, 3).

        A mirrored mesh keeps its outside: its triangles turn round.
        """
        for placed in self.placed:
            mesh = self.meshes[placed.mesh]
            is_mirrored = np.linalg.det(placed.world_from_object[:3, :3]) < 0
            triangles = mesh.triangles[:, ::-1] if is_mirrored else mesh.triangles
            yield placed, to_world(mesh, placed.world_from_object), triangles


@dataclass(frozen=True)
class OrientedBox:
    """A box: the ``center`` (3,) in metres, the full ``size`` (3,), and its axes in the world.

    The columns of ``rotation`` (3, 3) are the axes, a right-handed frame.
    """

    center: Floats
    size: Floats
    rotation: Floats


def to_world(mesh: Mesh, world_from_object: Floats) -> Floats:
    """Return the vertices (n, 3) of a mesh in the world."""
    return np.asarray(
        mesh.vertices.astype(np.float64) @ world_from_object[:3, :3].T + world_from_object[:3, 3]
    )


def box_around(mesh: Mesh, world_from_object: Floats) -> OrientedBox:
    """Return the tightest box around a mesh in the world, along the axes of its object.

    If ``world_from_object`` (4, 4) shears, the axes come from the nearest rotation, by polar
    decomposition.
    """
    left, _, right = np.linalg.svd(world_from_object[:3, :3])
    rotation = left @ right
    if np.linalg.det(rotation) < 0:
        # A mirrored object. The box of the opposite axes is the same.
        rotation = -rotation
    along_axes = to_world(mesh, world_from_object) @ rotation
    low = along_axes.min(axis=0)
    high = along_axes.max(axis=0)
    return OrientedBox(rotation @ ((low + high) / 2), high - low, rotation)
