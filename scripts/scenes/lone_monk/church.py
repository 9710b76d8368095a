"""The church: its flank over the eastern walk, and the bell tower in the north-east corner."""

import numpy as np

from scenes.library.architecture import arch_outline, blocks, filled, panel, stones, upright
from scenes.library.points import Array, circle, polar, xyz
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import box, join, lathe, transform
from scenes.lone_monk.plan import SIDES, Cloister
from scenes.lone_monk.roofs import EXPOSED, PITCH, house, lay_tiles
from scenes.lone_monk.walls import glaze, wall

TOP = 9.4
BAYS = 7
LANCET = (0.42, 6.2, 7.75, 0.62)  # an arch, as in `walls`
ROSE = (1.15, 7.3)  # its radius and height

# half the tower's width, and where its parts begin
HALF = 2.3
BELFRY = 12.4
TOWER_TOP = 15.6
ROOF_HALF = HALF + 0.4
ROOF_SLOPE = np.radians(33)
ROOF_HEIGHT = ROOF_HALF * np.tan(ROOF_SLOPE)
BELL = [
    (0.55, -1.15),
    (0.53, -1.12),
    (0.44, -0.95),
    (0.36, -0.7),
    (0.31, -0.4),
    (0.26, -0.22),
    (0.12, -0.15),
    (0.05, -0.1),
]
# Parts of the clock: middle x, y, z and width, depth, height.
MARK = [(0, -0.035, 0.58, 0.05, 0.02, 0.14)]
HOUR_HAND = [(0, -0.05, 0.13, 0.035, 0.015, 0.36)]
MINUTE_HAND = [(0, -0.05, 0.22, 0.035, 0.015, 0.54)]


def church(scene: Scene[Cloister]) -> None:
    """Seven bays of brick between pilaster strips, with lancets and a rose, under a frieze."""
    side = scene.plan.church_side
    width = _bay_width(scene)
    area = (width, scene.plan.lean_to_top, TOP, 0.5)
    hole = arch_outline(*LANCET, scene.segments(20))
    lancet = wall(scene, "Brick", area, hole, (0.14, 0.04))
    lancet.add(stones([(0, -0.04, 6.12, 1.2, 0.2, 0.1)], 0.02), "Limestone")
    glaze(lancet, hole, 0.3, 2, "Lead")
    radius, height = ROSE
    hole = circle(radius, scene.segments(40, 8)) + np.array((0, height))
    rose = wall(scene, "Brick", area, hole, (0.2, 0.06))
    parts = [scene.ring(0.3, 0.045), scene.ring(1.12, 0.05)]
    circlet = scene.ring(0.25, 0.03)
    foil = scene.ring(0.09, 0.015, 12)
    for angle in np.arange(8) * np.pi / 4:
        parts.append(scene.tube(polar([0.3, 1.12], angle), 0.035))
        parts.append(circlet.moved(*polar(0.84, angle + np.pi / 8)))
        parts.append(foil.moved(*polar(0.14, angle)))
    rose.add(upright(join(parts)), "Limestone", (0, 0.16, height))
    rose.add(filled(hole, 0.3), "Glass")
    x = np.delete(in_row(scene, BAYS), BAYS // 2)
    scene.plan.on_sides("Lancet bay", [lancet.mesh("Lancet bay")], x, scene.plan.back, sides=[side])
    scene.plan.on_sides("Rose bay", [rose.mesh("Rose bay")], 0, scene.plan.back, sides=[side])
    frieze = Model(scene)
    strip = Model(scene)
    low = TOP - 0.62
    arch = arch_outline(0.17, low, TOP - 0.45, 0.17, scene.segments(10))
    frieze.add(panel(width / 7, low, TOP - 0.1, arch, 0.14), "Brick")
    frieze.add(stones([(-width / 14, 0.04, low - 0.05, 0.1, 0.14, 0.12)], 0.02), "Limestone")
    scene.plan.on_sides(
        "Frieze",
        [frieze.mesh("Frieze")],
        in_row(scene, 7 * BAYS) / 7,
        scene.plan.back - 0.13,
        sides=[side],
    )
    height = TOP - scene.plan.lean_to_top - 0.1
    strip.add(
        box((0.42, 0.16, height)),
        "Brick",
        (0, scene.plan.back - 0.06, scene.plan.lean_to_top + height / 2),
    )
    scene.plan.on_sides(
        "Pilaster strip", [strip.mesh("Pilaster strip")], in_row(scene, BAYS + 1), sides=[side]
    )
    house(scene, side, (-scene.plan.back, scene.plan.back + 3.5), TOP, 14, "Brick")


def in_row(scene: Scene[Cloister], count: int) -> Array:
    """The x of `count` objects a bay's width apart, symmetric about 0."""
    return (np.arange(count) - (count - 1) / 2) * _bay_width(scene)


def _bay_width(scene: Scene[Cloister]) -> float:
    return 2 * scene.plan.back / BAYS


def tower(scene: Scene[Cloister]) -> None:
    """The tower: four sides alike about one core, under a pyramid of tiles."""
    beside_church = (scene.plan.church_side + 1) % 4
    at = scene.plan.side(beside_church, (scene.plan.back + HALF, scene.plan.back + HALF, 0))
    place("Tower", core(scene).mesh("Tower"), at)
    opening = arch_outline(0.62, BELFRY + 0.5, TOWER_TOP - 1.3, 0.62, scene.segments(20))
    belfry = wall(scene, "Brick", (HALF, BELFRY, TOWER_TOP, 0.45), opening, (0.14, 0.05))
    belfry.add(stones([(0, 0.2, BELFRY + 0.47, 1.5, 0.62, 0.08)], 0.015), "Limestone")
    bay = belfry.mesh("Belfry bay")
    trim = tower_side(scene).mesh("Tower side")
    x = np.arange(PITCH / 2 - ROOF_HALF, ROOF_HALF, PITCH)
    rows = np.round((ROOF_HALF - np.abs(x)) / (EXPOSED * np.cos(ROOF_SLOPE)))
    x, rows = x[rows > 0], rows[rows > 0]
    for number in SIDES:
        turned = at @ transform(rotation=(0, 0, number * np.pi / 2))
        place(f"Tower side.{number}", trim, turned)
        for end in (-1, 1):
            place(f"Belfry.{number}.{end}", bay, turned @ transform((end * HALF / 2, -HALF, 0)))
        slope = turned @ transform((0, -ROOF_HALF, TOWER_TOP + 0.02), (ROOF_SLOPE, 0, 0))
        lay_tiles(scene, f"Tower tiles {number}", slope, x, 0, rows)


def tower_side(scene: Scene) -> Model:
    """The parts of each side, facing −Y: strings, quoins, a clock, and the tiles on a hip."""
    model = Model(scene)
    clock = (0, -HALF, 11.1)
    for z, out, height in ((9.9, 0.07, 0.14), (BELFRY, 0.12, 0.2), (TOWER_TOP - 0.1, 0.14, 0.16)):
        string = [(0, -HALF, z, 2 * HALF + 2 * out, 2 * out, height)]
        model.add(stones(string, 0.03), "Limestone")
    z = np.arange(0.2, TOWER_TOP - 0.5, 0.4)
    size = xyz(*np.where(np.arange(len(z)) % 2, [[0.38], [0.62]], [[0.62], [0.38]]), 0.385)
    corner = size / 2 - HALF - 0.025
    model.add(blocks(xyz(corner[:, 0], corner[:, 1], z), size, 0.015), "Limestone")
    face = scene.lathe([(0.8, 0), (0.8, 0.05), (0.72, 0.06), (0.7, 0.03)], 40)
    model.add(upright(face), "Limestone", clock)
    for bar, turn in ((HOUR_HAND, 57), (MINUTE_HAND, 195), *((MARK, 30 * h) for h in range(12))):
        model.add(stones(bar, 0.002), "Iron", clock, (0, turn, 0))
    hip = np.linspace((ROOF_HALF, ROOF_HALF, 0.06), (0, 0, ROOF_HEIGHT + 0.1), 16)
    tiles = scene.tube(hip, 0.085 + 0.02 * (np.arange(16) % 2))
    model.add(tiles, "Roof tile", (0, 0, TOWER_TOP))
    return model


def core(scene: Scene) -> Model:
    """The parts that the tower has once: its shaft, the bell, the roof's boards, and a cross."""
    model = Model(scene)
    yoke = (0, 0, BELFRY + 2.3)
    summit = (0, 0, TOWER_TOP + ROOF_HEIGHT - 0.05)
    model.add(box((2 * HALF, 2 * HALF, BELFRY)), "Brick", (0, 0, BELFRY / 2))
    clapper = scene.tube([(0, 0, -0.5), (0, 0, -0.9), (0, 0, -1.25)], [0.02, 0.03, 0.08])
    model.add(join([scene.lathe(BELL, 28), clapper]), "Bronze", yoke)
    model.add(stones([(0, 0, 0.02, 4.2, 0.22, 0.26)], 0.03), "Wood", yoke)
    boards = lathe([(ROOF_HALF * 2**0.5, 0), (0, ROOF_HEIGHT)], 4)
    model.add(boards, "Wood", (0, 0, TOWER_TOP), (0, 0, 45))
    ball = scene.lathe([(0.16, 0), (0.06, 0.2), (0.15, 0.32), (0.15, 0.42), (0.05, 0.55)], 16)
    cross = [
        scene.tube([(0, 0, 0.4), (0, 0, 1.7)], 0.03),
        scene.tube([(-0.35, 0, 1.3), (0.35, 0, 1.3)], 0.03),
    ]
    model.add(join([ball, *cross]), "Iron", summit)
    return model
