"""Walls with doors and windows: behind the walks, and the storeys above them."""

from collections.abc import Sequence

import bpy
import numpy as np

from scenes.library.architecture import arch_outline, blocks, filled, panel, stones, upright
from scenes.library.points import Array, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, join, sheet, transform
from scenes.lone_monk import plan
from scenes.lone_monk.plan import BACK_WALL, WALK_FLOOR, Cloister
from scenes.lone_monk.roofs import house, ridge

# Arched openings: half their width, and the heights of sill, springing, and the arch over it.
DOORWAY = (0.56, WALK_FLOOR, 1.85, 0.42)
WINDOW = (0.38, 1.15, 1.80, 0.38)
UPPER_WINDOW = (0.42, 6.0, 6.62, 0.12)
STOREY = 2.4  # from storey to storey
# A shutter's frame: middle x, y, z and width, depth, height.
SHUTTER = [
    (-0.19, 0, 0, 0.05, 0.035, 0.74),
    (0.19, 0, 0, 0.05, 0.035, 0.74),
    (0, 0, 0.34, 0.34, 0.035, 0.06),
    (0, 0, -0.34, 0.34, 0.035, 0.06),
    (0, 0, 0, 0.34, 0.035, 0.06),
]


def wall(
    scene: Scene, stuff: str, area: Sequence[float], opening: Array, frame: Sequence[float]
) -> Model:
    """A wall round an opening that is framed in stone, its front at y = 0.

    area: its width, foot, top and thickness. frame: how wide it is, and how far it stands out.
    """
    model = Model(scene)
    wide, proud = frame
    model.add(panel(*area[:3], opening, area[3]), stuff)
    middle = (opening.min(0) + opening.max(0)) / 2
    around = middle + (opening - middle) * (1 + 2 * wide / np.ptp(opening, axis=0))
    section = ((around, 0.02), (around, -proud), (opening, -proud), (opening, 0.02))
    rings = [xyz(outline[:, 0], y, outline[:, 1]) for outline, y in section]
    model.add(sheet(rings, closed=True), "Limestone")
    return model


def glaze(model: Model, opening: Array, y: float, bars: int, stuff: str) -> None:
    """Put a pane into an opening at depth y, with a lattice before it."""
    (left, low), (right, high) = opening.min(0), opening.max(0)
    x = np.linspace(left, right, bars + 2)[1:-1]
    z = np.arange(low + 0.25, high - 0.1, 0.25)
    model.add(filled(opening, y), "Glass")
    posts = blocks(xyz(x, y - 0.03, (low + high) / 2), (0.02, 0.025, high - low), 0.003)
    model.add(join([posts, blocks(xyz(0, y - 0.03, z), (right - left, 0.025, 0.02), 0.003)]), stuff)


def _walk_wall(scene: Scene[Cloister]) -> tuple[float, float, float, float]:
    """The wall of a bay of a walk: its width, foot, top and thickness."""
    return scene.plan.bay, 0.0, scene.plan.lean_to_top, BACK_WALL


def doorway(scene: Scene, y: float) -> Model:
    """A wall of the walks with a door of planks, iron straps, nails and a ring at depth y."""
    half, sill, springing, rise = DOORWAY
    hole = arch_outline(*DOORWAY, scene.segments(16))
    model = wall(scene, scene.plan.walk_stuff, _walk_wall(scene), hole, (0.16, 0.05))
    model.add(filled(hole, y + 0.03), "Wood")
    edges = np.linspace(-half, half, 8)
    for x in zip(edges[:-1] + 0.004, edges[1:] - 0.004, strict=True):
        left, right = springing + rise * np.sqrt(1 - np.square(x) / half**2)
        plank = [(x[0], sill), (x[1], sill), (x[1], right), (x[0], left)]
        model.add(filled(np.array(plank), y, 0.05), "Wood")
    middles = (edges[1:] + edges[:-1]) / 2
    for z in (0.55, 1.50):
        model.add(stones([(0, y - 0.055, z, 1.72 * half, 0.012, 0.06)], 0.004), "Iron")
        model.add(blocks(xyz(middles, y - 0.064, z), (0.022, 0.014, 0.022), 0.006), "Iron")
    model.add(upright(scene.ring(0.05, 0.008, 16, 6)), "Iron", (0.3, y - 0.075, sill + 0.95))
    return model


def back_walls(scene: Scene[Cloister]) -> None:
    """The walls behind the walks: whitewashed, with doors and windows by turns."""
    hole = arch_outline(*WINDOW, scene.segments(16))
    window = wall(scene, scene.plan.walk_stuff, _walk_wall(scene), hole, (0.1, 0.03))
    window.add(stones([(0, -0.02, 1.11, 1.0, 0.16, 0.08)]), "Limestone")
    glaze(window, hole, 0.3, 3, "Lead")
    bays = window.mesh("Wall with window"), doorway(scene, 0.22).mesh("Wall with door")
    for number in plan.SIDES:
        for i, x in enumerate(scene.plan.bay_axes):
            bay = bays[i in (scene.plan.bays // 2, number * 2 % scene.plan.bays)]
            scene.plan.on_sides(f"Wall.{i}", [bay], x, scene.plan.back, sides=[number])
    ends = Model(scene)
    width = scene.plan.back - scene.plan.arcade
    top = scene.plan.lean_to_top
    y = scene.plan.back + BACK_WALL / 2
    for x in (-scene.plan.arcade - width / 2, scene.plan.arcade + width / 2):
        ends.add(box((width, BACK_WALL, top)), scene.plan.walk_stuff, (x, y, top / 2))
    ends.add(
        stones([(0, scene.plan.back - 0.02, WALK_FLOOR + 0.1, 2 * scene.plan.back, 0.06, 0.2)]),
        "Limestone",
    )
    scene.plan.on_sides("Wall ends", [ends.mesh("Wall ends")])


def upper_storeys(scene: Scene[Cloister]) -> None:
    """The storeys over the walks, with shutters at their windows: in the north and south."""
    walk = scene.plan.back
    bays = 8
    x = (np.arange(bays) + 0.5) * (2 * walk / bays) - walk
    for number, tops in scene.plan.houses:
        foot = scene.plan.lean_to_top
        for storey, top in enumerate(tops):
            meshes = [
                upper_wall(scene, 2 * walk / bays, (foot, top), storey * STOREY, swing)
                for swing in (21, 7, 7, 7)
            ]
            scene.plan.on_sides("Upper wall", meshes, x, walk, sides=[number])
            foot = top
        # The house covers the ends of low walls beside it.
        left = -walk - 0.5 * ((number + 1) % 4 in scene.plan.low_sides)
        right = walk + 0.5 * ((number - 1) % 4 in scene.plan.low_sides)
        house(scene, number, (left, right), tops[-1], 12, scene.plan.house_stuff)


def upper_wall(
    scene: Scene[Cloister],
    width: float,
    between: tuple[float, float],
    raised: float,
    swing: float,
) -> bpy.types.Mesh:
    """A bay of a storey's wall, and its window, `raised` over the lowest storey's.

    between: foot and top of the wall. swing: degrees by which the shutters stand off the wall.
    """
    half, sill, springing, rise = UPPER_WINDOW
    outline = (half, sill + raised, springing + raised, rise)
    hole = arch_outline(*outline, scene.segments(16))
    bay = wall(scene, scene.plan.house_stuff, (width, *between, 0.4), hole, (0.1, 0.03))
    bay.add(stones([(0, -0.03, 5.95 + raised, 1.1, 0.18, 0.1)], 0.015), "Limestone")
    glaze(bay, hole, 0.22, 1, "Wood")
    slat = box((0.34, 0.01, 0.05)).transformed(transform(rotation=(0.6, 0, 0)))
    slats = copies(slat, xyz(0, 0, np.linspace(-0.28, 0.28, 14)))
    shutter = join([stones(SHUTTER, 0.006), slats])  # one wing, 0.42 by 0.72 m, about its middle
    for sign in (-1, 1):
        wing = shutter.moved(0.22 * sign, 0, 0)
        bay.add(wing, "Wood", (0.53 * sign, -0.05, 6.36 + raised), (0, 0, sign * swing))
    return bay.mesh("Upper wall")


def low_walls(scene: Scene[Cloister]) -> None:
    """Low walls, over which the sun comes in, under a row of ridge tiles: in the west."""
    model = Model(scene)
    y = scene.plan.back + BACK_WALL / 2
    z = scene.plan.lean_to_top + 0.2
    model.add(box((2 * scene.plan.back + 1, BACK_WALL, 0.4)), "Plaster", (0, y, z - 0.1))
    coping = ridge(scene, (-scene.plan.back - 0.3, scene.plan.back + 0.3), 0.28)
    model.add(coping, "Roof tile", (0, y, z + 0.1), scale=(1, 1, 0.55))
    scene.plan.on_sides("West wall", [model.mesh("West wall")], sides=scene.plan.low_sides)
