"""Roofs of half-round tiles, hollow side up and down in turn, with their eaves and gutters."""

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import ArrayLike

from scenes.library.architecture import blocks, stones, upright
from scenes.library.points import Array, circle, points, polar, xyz
from scenes.library.scene import SHARP, Model, Scene, place
from scenes.library.shapes import Shape, copies, join, prism, sheet, transform
from scenes.lone_monk import plan
from scenes.lone_monk.plan import EAVE, EAVE_OUT, SLOPE, Cloister

PITCH = 0.215  # from cover to cover
EXPOSED = 0.36  # the visible length of a tile
LENGTH = 0.43  # of a tile

UP = EXPOSED * np.cos(SLOPE)  # from row to row, seen from above
# A column's covers and pans: outer radius below and above, x, z, lift, and which side is up. The
# lift is the height of the lower end over the row below.
TILES = [(0.09, 0.072, 0, 0.11, 0.035, 1), (0.074, 0.088, PITCH / 2, 0.13, 0.03, -1)]
# A downpipe from the trough: how far towards the pier, and how far below the eaves or above ground.
PIPE_HEAD = [(0, -0.05), (0, -0.16), (0.29, -0.5)]
PIPE = [(0.29, 3), (0.29, 0.3), (0.23, 0.17), (0.13, 0.12)]


def half_pipe(
    scene: Scene, low: float, high: float, length: float, thick: float, segments: float = 10
) -> Shape:
    """A roof tile along y, arched upwards: outer radius low at y = 0 and high at y = length."""
    count = scene.segments(segments, 2) + 1
    edge = 0.06
    outer = circle(low, count, edge, np.pi - edge)
    inner = circle(low - thick, count, np.pi - edge, edge)
    pipe = upright(prism(np.concatenate([outer, inner]), length)).moved(0, length, 0)
    x, y, z = pipe.vertices.T
    wider = 1 + (high / low - 1) * y / length
    return pipe.reshaped(xyz(x * wider, y, z * wider))


def ridge(scene: Scene, ends: tuple[float, float], radius: float) -> Shape:
    """A row of half pipes along x that overlap."""
    tile = half_pipe(scene, radius + 0.01, radius - 0.01, 0.43, 0.018)
    return copies(tile, xyz(np.arange(*ends, 0.38), 0, 0), (1, 0, 0))


def tile_column(scene: Scene, first: int, rows: int, variant: int) -> bpy.types.Mesh:
    """Covers and pans, rows first to rows − 1, in a roof's frame: y up the slope, z its normal.

    Roofs share the columns: each is made once.
    """
    name = f"Tiles.{first}.{rows}.{variant}"
    if name in bpy.data.meshes:
        return bpy.data.meshes[name]
    random = scene.random(name)
    row = np.arange(first, rows)
    parts = []
    for low, high, x, z, lift, upwards in points(TILES):
        wobble = random.normal(0, (0.004, 0.008, 0.014, 0.02), (len(row), 4)).T
        at = xyz(x + wobble[0], row * EXPOSED + wobble[1], z)
        forward = xyz(wobble[2], 1, -lift / EXPOSED)
        up = xyz(wobble[3], 0, upwards)
        parts.append(copies(half_pipe(scene, low, high, LENGTH, 0.014, 7), at, forward, up))
    return scene.mesh(name, join(parts), "Roof tile", smooth=SHARP)


def lay_tiles(
    scene: Scene, name: str, slope: Matrix, x: Array, first: ArrayLike, rows: ArrayLike
) -> None:
    """Columns of tiles on a roof, each from its first row up."""
    for i, (at, low, high) in enumerate(np.broadcast(x, first, rows)):
        column = tile_column(scene, int(low), int(high), 0 if low else i % 4)
        place(f"{name}.{i:03d}", column, slope @ transform((at, 0, 0)))


def deck(corners: ArrayLike) -> Shape:
    """Boards under four corners, counter-clockwise from above."""
    top = np.asarray(corners, float)
    return sheet([top - (0, 0, 0.06), top], closed=True, capped=True)


def eaves(model: Model, ends: tuple[float, float], y: float, z: float) -> None:
    """The rafters' tails that carry the eaves at y, z, and the fascia before them."""
    x = np.arange(ends[0] + 0.2, ends[1], 0.46)
    length = (EAVE_OUT + 0.1) / np.cos(SLOPE)
    tails = blocks(xyz(x, length / 2 + 0.03, -0.105), (0.08, length, 0.09), 0.01)
    model.add(tails, "Wood", (0, y, z), (np.degrees(SLOPE), 0, 0))
    fascia = [(sum(ends) / 2, y + 0.01, z - 0.04, ends[1] - ends[0], 0.03, 0.12)]
    model.add(stones(fascia, 0.005), "Wood")


def lean_to_roofs(scene: Scene[Cloister]) -> None:
    """The tiled roofs over the walks; they meet in valleys over the court's corners."""
    model = Model(scene)
    y = scene.plan.front - EAVE_OUT
    x = np.arange(-scene.plan.back + 0.1, scene.plan.back, PITCH)
    rows = round((scene.plan.back - y) / UP)
    first = np.maximum(0, np.ceil((np.abs(x) - y) / UP))
    is_laid = first < rows
    x = x[is_laid]
    first = first[is_laid]
    for number in plan.SIDES:
        slope = scene.plan.side(number, (0, y, EAVE + 0.01)) @ transform(rotation=(SLOPE, 0, 0))
        lay_tiles(scene, f"Lean-to {number}", slope, x, first, rows)
    top_left = (-scene.plan.back, scene.plan.back, scene.plan.lean_to_top)
    top_right = (scene.plan.back, scene.plan.back, scene.plan.lean_to_top)
    model.add(deck([(-y, y, EAVE), (y, y, EAVE), top_right, top_left]), "Wood")
    model.add(scene.tube([(0.05 - y, y - 0.05, EAVE + 0.03), top_left], 0.09), "Lead")
    flashing = [
        (0, scene.plan.back - 0.05, scene.plan.lean_to_top + 0.07, 2 * scene.plan.back, 0.14, 0.14)
    ]
    model.add(stones(flashing, 0.03), "Limestone")
    eaves(model, (0.2 - y, y - 0.2), y, EAVE)
    model.add(gutter(scene, y - 0.06), "Lead")
    scene.plan.on_sides("Lean-to", [model.mesh("Lean-to")])


def gutter(scene: Scene, y: float) -> Shape:
    """A gutter under the eaves at y, with brackets, and a downpipe in the court's corner."""
    trough = half_pipe(scene, 0.065, 0.065, 2 * y, 0.006)
    trough = trough.transformed(transform((-y, y, EAVE - 0.02), (0, np.pi, -np.pi / 2)))
    around = polar(0.072, np.linspace(np.pi, 2 * np.pi, 9)) - (0, 0.02, 0)
    hook = upright(scene.tube([*around, (0.12, 0, 0)], 0.007, 5))
    hooks = copies(hook, xyz(np.arange(0.6 - y, y, 1.1), y, EAVE), (-1, 0, 0))
    out, z = np.concatenate([points(PIPE_HEAD) + np.array((0, EAVE)), points(PIPE)]).T
    pipe = scene.tube(xyz(-y - out, y + out, z), 0.045, 10)
    clip = scene.lathe([(0.046, 0), (0.056, 0), (0.056, 0.05)], 10)
    clips = copies(clip, xyz(-y - 0.29, y + 0.29, [0.7, 1.9, 3.0]))
    return join([trough, hooks, pipe, clips])


def house(
    scene: Scene[Cloister],
    number: int,
    ends: tuple[float, float],
    top: float,
    rows: int,
    stuff: str,
) -> None:
    """The house behind an upper wall: its body, gables, tiled slope, ridge, and eaves."""
    model = Model(scene)
    left, right = ends
    edge = top - 0.02
    y = scene.plan.back - EAVE_OUT
    middle = (left + right) / 2
    length = right - left
    ridge_y = y + rows * UP
    ridge_z = edge + rows * EXPOSED * np.sin(SLOPE)
    near = scene.plan.back + 0.42
    far = 2 * ridge_y - scene.plan.back
    far_eave = 2 * ridge_y - y
    gable = [(near, 0), (far, 0), (far, top - 0.1), (ridge_y, ridge_z - 0.25), (near, top - 0.1)]
    model.add(prism(gable, length), stuff, (left, 0, 0), (90, 0, 90))
    for x0, x1, eave in ((left - 0.1, right + 0.1, y), (right + 0.1, left - 0.1, far_eave)):
        lower_edge = [(x0, eave, edge), (x1, eave, edge)]
        upper_edge = [(x1, ridge_y, ridge_z), (x0, ridge_y, ridge_z)]
        model.add(deck([*lower_edge, *upper_edge]), "Wood")
    eaves(model, ends, y, edge)
    model.add(ridge(scene, ends, 0.13), "Roof tile", (0, ridge_y, ridge_z))
    strings = [(scene.plan.back - 0.04, top - 0.2, length, 0.16, 0.12)]
    strings += [(scene.plan.back - 0.02, scene.plan.lean_to_top + 0.16, length, 0.10, 0.08)]
    model.add(stones([(middle, *string) for string in strings], 0.02), "Limestone")
    scene.plan.on_sides("House", [model.mesh("House")], sides=[number])
    slope = scene.plan.side(number, (0, y, top)) @ transform(rotation=(SLOPE, 0, 0))
    lay_tiles(scene, f"Roof {number}", slope, np.arange(left + 0.05, right, PITCH), 0, rows)
