"""Masonry and joinery: blocks, rings of stones, arches, walls round an opening, frames."""

from typing import Any

import numpy as np

from scenes.library.points import Array, Points, points, polar, rectangle, xyz
from scenes.library.shapes import Shape, box, copies, join, prism, sheet, transform


def blocks(centers: Any, sizes: Any, bevel: Any = 0.012) -> Shape:
    """Boxes with chamfered edges: centers and sizes (n, 3), bevel a number or one per axis."""
    centers, sizes = np.broadcast_arrays(np.atleast_2d(centers), np.atleast_2d(sizes))
    cube = box((1, 1, 1), bevel=0.25, segments=1)
    inset = (np.abs(cube.vertices) < 0.4) * np.broadcast_to(bevel, 3)
    vertices = np.sign(cube.vertices) * (sizes[:, None] / 2 - inset) + centers[:, None]
    return copies(cube, centers).reshaped(vertices.reshape(-1, 3))


def stones(table: Points, bevel: Any = 0.012) -> Shape:
    """`blocks` by a table (n, 6) of their centres x, y, z and their width, depth and height."""
    rows = points(table)
    return blocks(rows[:, :3], rows[:, 3:], bevel)


def cut(random: np.random.Generator, start: float, stop: float, count: int) -> tuple[Array, Array]:
    """A length cut into pieces not quite alike: the middles (count) and lengths of the stones."""
    edges = np.linspace(start, stop, count + 1)
    edges[1:-1] += random.uniform(-0.22, 0.22, count - 1) * (stop - start) / count
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)


def ring_of_stones(
    count: int, radius: float, width: float, z: float, height: float, span: float = 2 * np.pi
) -> Shape:
    """Wedge-shaped stones side by side round the Z axis, from angle 0 to `span`."""
    step = span / count
    gap = 0.006 / radius
    places = xyz((np.arange(count) + 0.5) * step, radius, z)
    flat = blocks(places, (step - gap, width, height), (0.012 / radius, 0.012, 0.012))
    angle, reach, z = flat.vertices.T
    return flat.reshaped(polar(reach, angle, z))


def upright(shape: Shape) -> Shape:
    """A shape in the XY plane turned upright into the XZ plane. Its +Z then points to −Y."""
    return shape.transformed(transform(rotation=(np.pi / 2, 0, 0)))


def arch_stones(radius: float, depth: float, count: int) -> Shape:
    """The voussoirs of a round arch about the origin, 0.2 m wide, its depth along y."""
    return upright(ring_of_stones(count, radius + 0.1, 0.2, 0.0, depth, np.pi))


def arch_outline(
    half_width: float, sill: float, springing: float, rise: float, segments: int
) -> Array:
    """An arched opening (n, 2), counter-clockwise from its lower right corner."""
    angle = np.linspace(0, np.pi, segments + 1)
    arc = np.column_stack([half_width * np.cos(angle), springing + rise * np.sin(angle)])
    if sill >= springing:
        return arc
    return np.concatenate([[[half_width, sill]], arc, [[-half_width, sill]]])


def panel(width: float, bottom: float, top: float, opening: Array, thickness: float) -> Shape:
    """A wall round an opening: width along x about 0, front at y = 0, back at y = thickness.

    opening: an outline (n, 2) in x and z, counter-clockwise. Every ray from its middle meets it
    once. It may touch the panel's edge. The shape has both faces and the reveal.
    """
    middle = np.array([0.0, (opening[:, 1].min() + opening[:, 1].max()) / 2])
    corners = np.array([[1, bottom], [1, top], [-1, top], [-1, bottom]]) * [width / 2, 1] - middle
    inner = opening - middle
    inner = np.concatenate([inner, [_ray_meets(inner, corner) for corner in corners]])
    inner = inner[np.argsort(np.arctan2(inner[:, 1], inner[:, 0]), kind="stable")]
    across = np.abs(inner[:, 0]) / (width / 2)
    along = inner[:, 1] / (np.where(inner[:, 1] > 0, top, bottom) - middle[1])
    outer = inner / np.maximum(across, along)[:, None]
    inner_x, inner_z = (inner + middle).T
    outer_x, outer_z = (outer + middle).T
    front = [xyz(inner_x, 0, inner_z), xyz(outer_x, 0, outer_z)]
    back = [xyz(inner_x, thickness, inner_z), xyz(outer_x, thickness, outer_z)]
    reveal = [back[0], front[0]]
    faces = [sheet(np.stack(pair), closed=True) for pair in (front, back[::-1], reveal)]
    on_edge = np.isclose(np.maximum(across, along), 1)
    walled = ~(on_edge & np.roll(on_edge, -1))  # no wall where the opening runs along the edge
    return join(Shape(face.vertices, face.quads[walled]) for face in faces)


def _ray_meets(outline: Array, direction: Array) -> Array:
    """Where the ray from the origin crosses an outline round it."""
    start = outline
    along = np.roll(outline, -1, axis=0) - outline
    cross = direction[0] * along[:, 1] - direction[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        where = (start[:, 0] * direction[1] - start[:, 1] * direction[0]) / cross
    hit = (reach > 0) & (where >= -1e-9) & (where <= 1 + 1e-9)
    return direction * reach[hit][0]


def filled(outline: Array, y: float, thickness: float = 0.02) -> Shape:
    """A board or pane of an outline in x and z, its back at y."""
    return upright(prism(outline, thickness)).moved(0, y, 0)


def frame(width: float, height: float, profile: Points) -> Shape:
    """A mitred frame round an opening, flat, of a profile of (outwards, towards the viewer)."""
    out, up = points(profile).T[:, :, None]
    corners = rectangle(width, height)
    rows = xyz(*(corners.T[:, None] + np.sign(corners).T[:, None] * out), up)
    return sheet(rows[::-1], closed=True)
