"""The arcades: on each side a low wall, twin columns, round arches; and the vaults behind them."""

import numpy as np

from scenes.library.architecture import arch_outline, arch_stones, blocks, cut, panel, stones
from scenes.library.points import Points, points, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import Shape, copies, grid, join, sheet
from scenes.lone_monk import plan
from scenes.lone_monk.plan import ARCADE_WALL, SPRINGING, VAULT_RISE, Cloister

# A column's base, shaft and neck, and the bell of its capital: radius and height.
SHAFT = [
    (0.125, 0.115),
    (0.119, 0.116),
    (0.129, 0.122),
    (0.136, 0.133),
    (0.136, 0.147),
    (0.129, 0.158),
    (0.119, 0.164),
    (0.112, 0.17),
    (0.104, 0.185),
    (0.106, 0.2),
    (0.113, 0.203),
    (0.116, 0.214),
    (0.113, 0.225),
    (0.098, 0.235),
    (0.098, 0.24),
    (0.096, 0.51),
    (0.092, 0.78),
    (0.086, 1.20),
    (0.084, 1.32),
    (0.094, 1.324),
    (0.098, 1.335),
    (0.094, 1.346),
    (0.085, 1.35),
]
BELL = [(0.085, 1.34), (0.087, 1.40), (0.092, 1.456), (0.103, 1.514), (0.119, 1.572), (0.14, 1.63)]
# Its leaves: how many, where between two the first is, their foot, height, and reach.
LEAVES = [(8, 0.5, 1.345, 0.15, 0.035), (4, 0, 1.40, 0.2, 0.05), (4, 0.5, 1.40, 0.2, 0.08)]
# Plinth and abacus: middle x, y, z and width, depth, height.
COLUMN_BLOCKS = [(0, 0, 0.088, 0.27, 0.27, 0.06), (0, 0, 1.665, 0.285, 0.285, 0.07)]
# Masonry of rectangular plan: width, depth, height; the pier's head and top from the springing.
IMPOST = [
    (0.26, 0.50, 1.70),
    (0.36, 0.58, 1.77),
    (0.37, 0.60, 1.77),
    (0.37, 0.60, 1.84),
    (0.35, 0.58, 1.85),
]
PIER_FOOT = [
    (0.80, 0.80, -0.03),
    (0.80, 0.80, 0.41),
    (0.76, 0.76, 0.43),
    (0.66, 0.66, 0.50),
    (0.66, 0.66, 0.51),
]
PIER = [(0.66, 0.66, -1.95), (0.66, 0.66, -0.2), (0.56, 0.56, -0.2), (0.56, 0.56, 1.41)]
PIER_HEAD = [
    (0.66, 0.66, -0.22),
    (0.76, 0.76, -0.12),
    (0.78, 0.78, -0.11),
    (0.78, 0.78, -0.01),
    (0.75, 0.75, 0),
]
# Courses of the low wall: stones, how far they reach into the gate's bay, depth, middle z, height.
LOW_WALL = [
    (10, 0.2, 0.54, 0.13, 0.246),
    (10, 0.2, 0.54, 0.38, 0.246),
    (6, 0.23, 0.66, 0.552, 0.096),
]


def arcades(scene: Scene[Cloister]) -> None:
    """Low walls with columns, open at the gates, and piers where two arcades meet."""
    # The wall over one arch, with voussoirs and hood moulds; its origin is at the springing.
    bay = Model(scene)
    n = scene.segments(24)
    radius = scene.plan.arch_radius
    opening = arch_outline(radius, 0.0, 0.0, radius, n)
    wall = panel(scene.plan.bay, 0.0, plan.ARCADE_TOP - SPRINGING, opening, ARCADE_WALL - 0.06)
    bay.add(wall, scene.plan.arcade_stuff, (0, 0.03 - ARCADE_WALL / 2, 0))
    bay.add(arch_stones(radius - 0.015, ARCADE_WALL + 0.02, 15), "Limestone")
    x, z = arch_outline(scene.plan.bay / 2 - 0.001, 0.0, 0.0, scene.plan.bay / 2 - 0.001, n).T
    hood = scene.tube(xyz(x, 0, z), 0.035)
    for face in (0.01 - ARCADE_WALL / 2, ARCADE_WALL / 2 - 0.01):
        bay.add(hood, "Limestone", (0, face, 0))
    scene.plan.on_sides(
        "Arcade", [bay.mesh("Arcade bay")], scene.plan.bay_axes, scene.plan.arcade, SPRINGING
    )
    column = Model(scene)
    pier = Model(scene)
    long = Model(scene)
    column.add(twin_column(scene), "Carved stone")
    scene.plan.on_sides(
        "Column",
        [column.mesh("Column")],
        scene.plan.columns[1:-1],
        scene.plan.arcade,
        plan.STYLOBATE,
    )
    pier.add(pillar(PIER_FOOT), "Carved stone")
    pier.add(pillar(PIER), "Ashlar", (0, 0, SPRINGING))
    pier.add(pillar(PIER_HEAD), "Carved stone", (0, 0, SPRINGING))
    scene.plan.on_sides("Pier", [pier.mesh("Pier")], -scene.plan.arcade, scene.plan.arcade)
    random = scene.random("low wall")
    for count, into_gate, depth, z, height in points(LOW_WALL):
        gate = round(scene.plan.bay / 2 - into_gate, 4)
        for sign in (-1, 1):
            middle, length = cut(random, gate, scene.plan.arcade - 0.38, int(count))
            places = xyz(sign * middle, scene.plan.arcade, z)
            sizes = xyz(length - 0.007, depth, height)
            long.add(blocks(places, sizes, 0.016), "Limestone")
    front = (0, scene.plan.front, plan.ARCADE_TOP)
    strings = [
        (0, 0, -0.28, 2 * scene.plan.front, 0.13, 0.06),
        (0, 0, -0.1, 2 * scene.plan.front, 0.2, 0.07),
    ]
    dentils = xyz(np.arange(0.12 - scene.plan.front, scene.plan.front - 0.05, 0.2), -0.03, -0.19)
    long.add(stones(strings), "Limestone", front)
    long.add(blocks(dentils, (0.09, 0.12, 0.11), 0.008), "Limestone", front)
    scene.plan.on_sides("Low wall", [long.mesh("Low wall and cornice")])


def pillar(section: Points) -> Shape:
    """Masonry of rectangular plan with chamfered corners: rows of width, depth and height."""
    width, depth, z = points(section).T[:, :, None]
    # two points for each corner
    x, y = points([(1, 1), (1, 1), (-1, 1), (-1, 1), (-1, -1), (-1, -1), (1, -1), (1, -1)]).T
    inset = 0.012 * np.array([0, 1, 1, 0, 0, 1, 1, 0])
    ring = xyz(x * (width / 2 - inset), y * (depth / 2 - 0.012 + inset), z)
    return sheet(ring, closed=True, capped=True)


def twin_column(scene: Scene) -> Shape:
    """Two slender columns, one behind the other, under one impost. They stand on the origin."""
    column = [scene.lathe(SHAFT, 20), scene.lathe(BELL, 16), stones(COLUMN_BLOCKS, 0.009)]
    for count, first, foot, height, reach in points(LEAVES):
        out = polar(1, (np.arange(count) + first) * 2 * np.pi / count)
        column.append(copies(leaf(scene, height, reach), out * 0 + (0, 0, foot), out))
    pair = [join(column).moved(0, y, 0) for y in (-0.15, 0.15)]
    return join([*pair, stones([(0, 0, 0.03, 0.32, 0.60, 0.06)]), pillar(IMPOST)])


def leaf(scene: Scene, height: float, reach: float) -> Shape:
    """A carved leaf on a capital's bell that leans out along +Y and curls over at its tip."""
    t = np.linspace(0, 1, scene.segments(7) + 1)[:, None]
    across = np.linspace(1, -1, 5)
    x = across * (0.034 * np.sin(np.pi * (0.25 + 0.75 * t)) ** 0.5 + 0.004)
    out = 0.088 + 0.05 * t**2.2 + reach * t**3 + 0.006 * (1 - np.abs(across))
    return sheet(xyz(x, out - 0.3 * np.abs(x), height * (t - 0.42 * t**4)))


def vaults(scene: Scene[Cloister]) -> None:
    """A vault for each bay and each corner of the walks, and the brackets that carry them."""
    middle = scene.plan.walk_middle
    before = scene.plan.arcade - scene.plan.walk_middle - ARCADE_WALL / 2
    scene.plan.on_sides(
        "Vault",
        [vault(scene, scene.plan.bay).mesh("Vault")],
        scene.plan.bay_axes,
        middle,
        SPRINGING,
    )
    corner = vault(scene, scene.plan.walk)
    corbel = Model(scene)
    rise = arch_outline(scene.plan.walk / 2 - 0.12, 0.0, 0.0, VAULT_RISE - 0.08, scene.segments(20))
    arch = panel(scene.plan.walk, 0.0, 1.2, rise, ARCADE_WALL)
    corner.add(arch, "Limestone", (before, 0, 0), (0, 0, -90))
    corner.add(arch, "Limestone", (0, before, 0))
    scene.plan.on_sides("Corner vault", [corner.mesh("Corner vault")], middle, middle, SPRINGING)
    bell = scene.lathe(
        [(0.02, -0.34), (0.05, -0.31), (0.07, -0.2), (0.13, -0.1), (0.14, -0.09)], 12
    )
    corbel.add(join([bell, stones([(0, 0, -0.045, 0.34, 0.34, 0.09)])]), "Carved stone")
    scene.plan.on_sides(
        "Corbel", [corbel.mesh("Corbel")], scene.plan.columns, scene.plan.back, SPRINGING
    )


def vault(scene: Scene[Cloister], length: float) -> Model:
    """The higher of two crossing elliptic barrels over a bay, with ribs along its groins."""
    model = Model(scene)
    n = scene.segments(20, 6) // 2 * 2
    a = length / 2
    b = scene.plan.walk / 2
    t = np.sin(np.linspace(-np.pi / 2, np.pi / 2, n + 1))
    barrel = VAULT_RISE * np.sqrt(1 - t**2)
    model.add(grid(a * t, b * t, np.maximum(barrel, barrel[:, None])), "Whitewash")
    t = np.linspace(-1, 1, 2 * n + 1)
    rise = VAULT_RISE * np.sqrt(1 - t**2) - 0.02
    for sign in (-1, 1):
        model.add(scene.tube(xyz(a * t, sign * b * t, rise), 0.05), "Limestone")
        model.add(scene.tube(xyz(sign * a, b * t, rise), 0.07), "Limestone")
    boss = scene.lathe([(0.03, -0.1), (0.08, -0.09), (0.12, -0.05), (0.13, 0)], 16)
    model.add(boss, "Limestone", (0, 0, VAULT_RISE - 0.02))
    return model
