"""The room: its floor with mosaic, rug and hair, walls, panels, friezes, ceiling and beams."""

import bpy
import numpy as np
from mathutils import Matrix
from numpy.random import Generator

from scenes.barbershop.plan import (
    DOOR_WIDTH,
    HAIR,
    TAU,
    TILE,
    WALLS,
    WINDOW_HEIGHT,
    WINDOW_MIDDLE,
    Barbershop,
    Wall,
    against,
    hanging,
    position,
    put,
    standing,
)
from scenes.library.architecture import blocks, frame
from scenes.library.points import Array, circle, evenly, lattice, mirrored, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, grid, lettering, prism, tube

THICK = 0.15  # of the walls
MOSAIC_HEIGHT = 0.0015
GREEN = ["Green glaze 0", "Green glaze 1", "Green glaze 2"]
CREAM = ["Cream glaze 0", "Cream glaze 1", "Cream glaze 2"]
MOSAIC_RINGS = (  # inner and outer radius, glazes
    (0.74, 0.79, GREEN),
    (0.68, 0.735, CREAM),
    (0.47, 0.515, CREAM),
    (0.42, 0.465, GREEN),
    (0.36, 0.415, ["Red", "Ochre"]),
)
PALMETTE = 0.2083  # its width
PETAL = [(0.03, 0), (0.03, 0.0005)]  # of a palmette, before it is narrowed


def walls(scene: Scene[Barbershop]) -> None:
    """The walls round the windows and the doors, and the ceiling."""
    plan = scene.plan
    width, length, height = plan.room
    middle = height / 2
    across = (width, THICK, height)
    side = (THICK, length + 2 * THICK, height)
    model = Model(scene)
    for wall, size, at in (
        ("right", side, (width / 2 + THICK / 2, 0, middle)),
        ("back", across, (0, -length / 2 - THICK / 2, middle)),
        ("left", side, (-width / 2 - THICK / 2, 0, middle)),
    ):
        material = plan.paper if wall in plan.papered else "Plaster"
        model.box(size=size, at=at, material=material)
    _front_wall(model, plan)
    ceiling_size = (width + 2 * THICK, length + 2 * THICK, 0.1)
    model.box(size=ceiling_size, at=(0, 0, height + 0.051), material="Plaster")
    put(model.mesh(name="Walls"), where=standing())


def _front_wall(model: Model, plan: Barbershop) -> None:
    """The wall between, below and above the windows and the door."""
    material = plan.paper if "front" in plan.papered else "Plaster"
    height = plan.room[2]
    sill = WINDOW_MIDDLE - WINDOW_HEIGHT / 2
    top = WINDOW_MIDDLE + WINDOW_HEIGHT / 2
    openings = [(window.along, window.width, sill) for window in plan.windows]
    openings = sorted([*openings, (plan.door, DOOR_WIDTH, 0.0)])
    ends = [-plan.half_x]
    for middle, width, _ in openings:
        ends += [middle - width / 2, middle + width / 2]
    ends.append(plan.half_x)
    blocks_of_wall = [(ends[i], ends[i + 1], 0.0, height) for i in range(0, len(ends), 2)]
    lintels = []
    for middle, width, bottom in openings:
        left = middle - width / 2
        right = middle + width / 2
        if bottom:
            lintels.append((left, right, 0.0, bottom))
        lintels.append((left, right, top, height))
    for left, right, low, high in [*blocks_of_wall[:-1], *lintels, blocks_of_wall[-1]]:
        model.box(
            size=(round(right - left, 6), THICK, round(high - low, 6)),
            at=(round((left + right) / 2, 6), plan.half_y + THICK / 2, (low + high) / 2),
            material=material,
        )


def wall_lettering(scene: Scene[Barbershop]) -> None:
    """The shop's services, over the mirrors."""
    lettering = Model(scene)
    lettering.word(
        letters="HAIRCUTS  ·  HOT TOWELS  ·  SHAVES", size=0.18, depth=0.018, material="Gilt"
    )
    where = scene.plan.over_counter(scene.plan.counter_middle, away=0.01, z=2.545)
    put(lettering.mesh(name="Wall lettering"), where)


def grout(scene: Scene[Barbershop]) -> None:
    """The bed of the tiles over the counter, with two black strips."""
    model = Model(scene)
    length = scene.plan.wall_length(scene.plan.counter_wall)
    model.box(size=(length, 0.004, 2.3), at=(0, 0.002, 1.15), material="Grout")
    model.box(
        size=(length, 0.02, 0.022),
        bevel=0.008,
        segments=2,
        at=lattice(y=0.01, z=(scene.plan.green_rows / 10, 2.3)),
        material="Black tile",
    )
    put(model.mesh(name="Grout"), where=scene.plan.at_counter(0))


def beam(scene: Scene[Barbershop]) -> None:
    """Five beams with small brackets."""
    model = Model(scene)
    width, length, height = scene.plan.room
    model.box(size=(width, 0.15, 0.14), bevel=0.012, segments=2, material="Mahogany x")
    model.box(
        size=(0.12, 0.016, 0.05),
        bevel=0.005,
        at=lattice(x=evenly(0.25 - width / 2, width / 2 - 0.25, 10), y=(-0.083, 0.083), z=0.04),
        material="Mahogany x",
    )
    rows = evenly(0.75 - length / 2, length / 2 - 0.75, 5)
    put(model.mesh(name="Beam"), where=[standing(y=y, z=height - 0.07) for y in rows])


def picture_rail(scene: Scene[Barbershop]) -> None:
    rail = Model(scene)
    rail.frame(
        size=scene.plan.room[:2],
        profile=[(0, 0), (-0.03, 0), (-0.038, 0.012), (-0.03, 0.035), (0, 0.045)],
        material="Mahogany",
    )
    put(rail.mesh(name="Picture rail"), where=standing(z=2.675))


def palmette(scene: Scene[Barbershop]) -> None:
    """A frieze of palmettes round the room."""
    model = Model(scene)
    model.lathe(
        profile=PETAL,
        at=(-0.0329, -0.018, 0),
        turned=(0, 0, 70),
        scaled=(0.37, 1, 1),
        material="Green",
    )
    model.lathe(
        profile=PETAL,
        at=(-0.0201, -0.0013, 0),
        turned=(0, 0, 35),
        scaled=(0.37, 1, 1),
        material="Red",
    )
    model.lathe(profile=PETAL, at=(0, 0.005, 0), scaled=(0.37, 1, 1), material="Green")
    model.lathe(
        profile=PETAL,
        at=(0.0201, -0.0013, 0),
        turned=(0, 0, -35),
        scaled=(0.37, 1, 1),
        material="Red",
    )
    model.lathe(
        profile=PETAL,
        at=(0.0329, -0.018, 0),
        turned=(0, 0, -70),
        scaled=(0.37, 1, 1),
        material="Green",
    )
    model.lathe(profile=[(0.012, 0), (0.012, 0.001)], at=(0, -0.03, 0), material="Ochre")
    model.bend(
        radius=0.003,
        path=[
            (0, -0.045, 0),
            (0.05, -0.055, 0),
            (0.085, -0.03, 0),
            (0.075, 0, 0),
            (0.055, -0.005, 0),
            (0.06, -0.022, 0),
        ],
        material="Ochre",
    )
    model.bend(
        radius=0.003,
        path=[
            (0, -0.045, 0),
            (-0.05, -0.055, 0),
            (-0.085, -0.03, 0),
            (-0.075, 0, 0),
            (-0.055, -0.005, 0),
            (-0.06, -0.022, 0),
        ],
        material="Ochre",
    )
    put(model.mesh(name="Palmette"), where=_frieze(scene.plan))


def _frieze(plan: Barbershop) -> list[Matrix]:
    """Frames side by side over the picture rail, on all four walls."""
    frames = []
    for wall in WALLS:
        length = plan.wall_length(wall)
        end = length / 2 - 0.104
        for along in evenly(-end, end, round(length / PALMETTE)):
            frames.append(hanging(wall, along, away=0.001, z=2.765, room=plan.room))
    return frames


def entrance_mat(scene: Scene[Barbershop]) -> None:
    """A mat that says welcome."""
    mat = Model(scene)
    mat.box(size=(0.9, 0.55, 0.014), bevel=0.005, at=(0, 0, 0.007), material="Bristle")
    mat.box(size=(0.84, 0.49, 0.004), bevel=0.001, at=(0, 0, 0.0145), material="Rug navy")
    mat.word(
        letters="WELCOME",
        size=0.17,
        depth=0.0005,
        at=(0, 0, 0.0168),
        turned=(0, 0, 180),
        material="Rug sand",
    )
    put(mat.mesh(name="Entrance mat"), where=scene.plan.at_front(scene.plan.door, away=0.42))


def floor_drain(scene: Scene) -> None:
    """A drain with holes."""
    drain = Model(scene)
    drain.lathe(profile=[(0.07, 0), (0.068, 0.003), (0, 0.003)], material="Brass")
    drain.lathe(
        profile=[(0.006, 0), (0.006, 0.0006)],
        at=[
            *mirrored(x=0.045, z=0.003),
            *lattice(x=(-0.039, 0.039), y=(-0.0225, 0.0225), z=0.003),
            *lattice(x=(-0.0225, 0.0225), y=(-0.039, 0.039), z=0.003),
            *lattice(y=(-0.045, 0.045), z=0.003),
        ],
        material="Black",
    )
    put(drain.mesh(name="Floor drain"), where=standing(x=-0.62, y=-2.5))


def tiles(scene: Scene[Barbershop]) -> None:
    """Bevelled cream and black tiles over a bed of grout."""
    model = Model(scene)
    width, length, _ = scene.plan.room
    model.box(size=(width, length, 0.05), at=(0, 0, -0.028), material="Grout")
    i, j = np.indices((round(width / TILE), round(length / TILE)))
    centers = xyz((i + 0.5) * TILE - width / 2, (j + 0.5) * TILE - length / 2, -0.01)
    is_black = tile_pattern(scene.plan.floor, i, j)
    for color, material in ((False, "Cream tile"), (True, "Black tile")):
        size = (TILE - 0.004, TILE - 0.004, 0.02)
        model.add(blocks(centers[is_black == color], size, 0.003), material)
    put(model.mesh("Floor"), where=standing())


def tile_pattern(pattern: str, i: Array, j: Array) -> Array:
    """Which tiles of a floor are black, by the tiles' columns and rows."""
    from_edge = np.minimum(np.minimum(i, i.max() - i), np.minimum(j, j.max() - j))
    patterns = {
        "checker": (i + j) % 2,
        "large checker": (i // 2 + j // 2) % 2,
        "stripes": i // 2 % 2,
        "diagonal": (i + j) % 4 // 2,
        "dots": (i % 2) * (j % 2),
        "rings": from_edge % 3 == 1,
    }
    return patterns[pattern].astype(bool)


def medallion(scene: Scene) -> None:
    """An inlaid mosaic in the middle of the floor: rings of stones, a star, and the shop's name."""
    random = scene.random("medallion")
    model = Model(scene)
    _mosaic_bed(model)
    _mosaic_stones(scene, model, random)
    text = "BARBER SHOP  ·  EST. 1927  ·  "
    for k, letter in enumerate(text):
        turn = -360 * k / len(text)
        if letter != " ":
            at = polar(0.595, np.radians(turn + 90), MOSAIC_HEIGHT + 0.0004)
            model.add(lettering(letter, 0.0005), "Brass", at, (0, 0, turn), (0.13, 0.13, 1))
    for k, (reach, top) in enumerate(((0.34, 0.0031), (0.24, 0.0023))):
        outwards = polar(1, (np.arange(8) + k / 2) * TAU / 8)
        for side, material in ((1, "Ochre"), (-1, "Navy")):
            ray = prism([(0, 0), (0.05 * side, 0.28 * reach), (0, reach)][::side], top)
            model.add(copies(ray, 0 * outwards, forward=outwards), material)
    put(model.mesh("Floor medallion"), where=standing())


def _mosaic_bed(model: Model) -> None:
    """The discs below and between the stones, and the brass boss with its letter."""
    model.lathe(profile=[(0.8, 0), (0.8, 0.0005)], material="Grout")
    model.pipe(profile=[(0.675, 0), (0.675, 0.0015), (0.52, 0.0015)], material="Black tile")
    model.lathe(profile=[(0.355, 0), (0.355, 0.0015)], material="Cream")
    model.lathe(profile=[(0.07, 0), (0.07, 0.0039)], material="Brass")
    model.word(letters="B", size=0.12, depth=0.0005, at=(0, 0, 0.0043), material="Black tile")


def _mosaic_stones(scene: Scene, model: Model, random: Generator) -> None:
    """Rings of stones, their glazes mixed."""
    for inner, outer, glazes in MOSAIC_RINGS:
        count = scene.segments(TAU * outer / 0.05, 12)
        arc = circle(1.0, 3, -0.93 * np.pi / count, 0.93 * np.pi / count)
        stone = prism(np.concatenate([arc * outer, arc[::-1] * inner]), MOSAIC_HEIGHT)
        glaze = random.integers(len(glazes), size=count)
        for i, material in enumerate(glazes):
            outwards = polar(1, np.flatnonzero(glaze == i) * TAU / count)
            model.add(copies(stone, 0 * outwards, forward=outwards), material)


def rug(scene: Scene) -> None:
    """A bordered rug with lozenges and a fringe, below the low table."""
    model = Model(scene)
    random = scene.random("rug")
    _rug_pattern(model)
    for end in lattice(x=evenly(-0.38, 0.38, scene.segments(60, 8)), y=(-0.975, 0.975), z=0.0025):
        model.add(box((0.006, 0.06, 0.003)), "Rug sand", end, (0, 0, random.uniform(-12, 12)))
    put(model.mesh("Rug"), where=standing(x=1.24, y=0.15))


def _rug_pattern(rug: Model) -> None:
    """Borders inside each other, and lozenges in a row."""
    rug.box(size=(0.78, 1.9, 0.004), bevel=0.001, at=(0, 0, 0.002), material="Rug red")
    rug.box(size=(0.7, 1.82, 0.004), bevel=0.001, at=(0, 0, 0.0032), material="Rug sand")
    rug.box(size=(0.64, 1.76, 0.004), bevel=0.001, at=(0, 0, 0.0044), material="Rug navy")
    rug.box(size=(0.5, 1.62, 0.004), bevel=0.001, at=(0, 0, 0.0056), material="Rug red")
    rug.box(
        size=(0.2, 0.2, 0.0015),
        at=lattice(y=evenly(-0.6, 0.6, 3), z=0.0078),
        turned=(0, 0, 45),
        material="Rug navy",
    )
    rug.box(
        size=(0.2, 0.2, 0.0015),
        at=lattice(y=(-0.3, 0.3), z=0.0078),
        turned=(0, 0, 45),
        material="Rug sand",
    )
    rug.box(
        size=(0.1, 0.1, 0.0015),
        at=lattice(y=evenly(-0.6, 0.6, 3), z=0.0088),
        turned=(0, 0, 45),
        material="Rug sand",
    )
    rug.box(
        size=(0.1, 0.1, 0.0015),
        at=lattice(y=(-0.3, 0.3), z=0.0088),
        turned=(0, 0, 45),
        material="Rug navy",
    )


def hair_clippings(scene: Scene[Barbershop]) -> None:
    """Cut hair on the floor round the chairs, as small tufts that are placed many times."""
    random = scene.random("hair clippings")
    plan = scene.plan
    for number, along in enumerate(plan.stations):
        hair = HAIR[number % len(HAIR)]
        model = Model(scene)
        for _ in range(scene.count(60, 6)):
            bow = random.uniform(0.004, 0.014)
            half = random.uniform(0.008, 0.022)
            curve = np.array([(-1, 0, 0), (-0.33, 0.7, 3), (0.5, 1, 3), (1, 0, 1)])
            path = curve * (half, bow, 0.0004)
            strand = tube(path, (0.0003, 0.0006, 0.0006, 0.0002), 3)
            at = (*random.normal(0, 0.05, 2), 0.0012)
            turn = (0, 0, random.uniform(0, 360))
            model.add(strand, hair, at, turn)
        tuft = model.mesh(f"Clippings {hair.lower()}")
        x, y = position(plan.counter_wall, along, away=1.1, room=plan.room)
        around = standing(x, y, z=0.001)
        for _ in range(scene.count(26, 2)):
            at = polar(random.uniform(0.62, 0.85), random.uniform(0, TAU))
            turn = (0, 0, random.uniform(0, 360))
            size = random.uniform(0.7, 1.3)
            put(tuft, around, at, turn, size)


def metro_tiles(scene: Scene[Barbershop]) -> None:
    """Glazed tiles in running bond over the counter's wall, green below and cream above."""
    random = scene.random("tiles")
    model = Model(scene)
    width = 0.2
    height = 0.1
    gap = 0.003
    length = scene.plan.wall_length(scene.plan.counter_wall)
    row, column = np.indices((23, int(length / width) + 2)).reshape(2, -1)
    left = (column - (row % 2) / 2) * width - length / 2
    x0, x1 = np.clip([left, left + width], -length / 2, length / 2)
    centers = xyz((x0 + x1) / 2, 0.006, (row + 0.5) * height)
    sizes = xyz(x1 - x0 - gap, 0.012, height - gap)
    glaze = random.integers(3, size=len(row))
    for k in range(6):
        is_green = k < 3
        of_glaze = (glaze == k % 3) & ((row < scene.plan.green_rows) == is_green) & (x1 - x0 > 0.02)
        material = f"{'Green' if is_green else 'Cream'} glaze {k % 3}"
        if of_glaze.any():
            model.add(blocks(centers[of_glaze], sizes[of_glaze], 0.004), material)
    put(model.mesh(name="Metro tiles"), where=scene.plan.at_counter(0))


def _wainscot_panel(scene: Scene) -> bpy.types.Mesh:
    """One panel, 0.6 m wide, with its chair rail."""
    panel = Model(scene)
    panel.box(size=(0.6, 0.018, 1), at=(0, 0.009, 0.5), material="Mahogany")
    panel.box(size=(0.6, 0.035, 0.14), bevel=0.006, at=(0, 0.0175, 0.07), material="Mahogany")
    panel.box(
        size=(0.07, 0.03, 0.86),
        bevel=0.004,
        at=mirrored(x=0.265, y=0.015, z=0.5),
        material="Mahogany",
    )
    panel.box(size=(0.46, 0.028, 0.08), bevel=0.004, at=(0, 0.014, 0.18), material="Mahogany")
    panel.box(size=(0.46, 0.028, 0.09), bevel=0.004, at=(0, 0.014, 0.91), material="Mahogany")
    panel.box(size=(0.31, 0.018, 0.49), at=(0, 0.012, 0.543), material="Mahogany")
    panel.frame(
        size=(0.42, 0.6),
        profile=[(-0.06, 0.02), (-0.02, 0.032), (0, 0.034), (0.012, 0.026), (0.02, 0.018)],
        at=(0, 0, 0.543),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    panel.prism(
        height=0.6,
        outline=[(0, 0), (0.05, 0), (0.05, 0.02), (0.038, 0.032), (0.02, 0.045), (0, 0.05)],
        at=(-0.3, 0, 0.97),
        turned=(90, 0, 90),
        material="Mahogany",
    )
    return panel.mesh(name="Wainscot")


def wainscot(scene: Scene[Barbershop]) -> None:
    """Raised mahogany panels below a chair rail, on the walls without the counter."""
    panel = _wainscot_panel(scene)
    size = 0.6
    for wall, start, stop in _wainscot_runs(scene.plan):
        count = max(1, round((stop - start) / size))
        width = (stop - start) / count
        for i in range(count):
            where = against(wall, along=start + (i + 0.5) * width, room=scene.plan.room)
            put(panel, where, scale=(width / size, 1, 1))


def _wainscot_runs(plan: Barbershop) -> list[tuple[Wall, float, float]]:
    """The parts of the walls beside the doors and their casings: from where to where."""
    runs: list[tuple[Wall, float, float]] = []
    for wall in ("left", "right", "back", "front"):
        if wall == plan.counter_wall:
            continue
        doors = [(plan.door, 0.565)] if wall == "front" else []
        if plan.staff_door and plan.staff_door[0] == wall:
            doors.append((plan.staff_door[1], 0.515))
        start = -plan.wall_length(wall) / 2
        for middle, half in sorted(doors):
            runs.append((wall, start, middle - half))
            start = middle + half
        runs.append((wall, start, plan.wall_length(wall) / 2))
    return [run for run in runs if run[2] - run[1] > 0.05]


def ceiling(scene: Scene[Barbershop]) -> None:
    """Pressed tin tiles or boards, and a cornice."""
    if scene.plan.ceiling == "tin":
        _tin_tiles(scene)
    else:
        _boards(scene)
    width, length, height = scene.plan.room
    cornice = Model(scene)
    t = np.linspace(0, np.pi / 2, scene.segments(8))
    cove = np.column_stack([-0.13 + 0.09 * np.sin(t), 0.035 + 0.10 * (1 - np.cos(t))])
    profile = [(-0.15, 0), (-0.15, 0.03), *cove, (-0.03, 0.16), (0, 0.16)]
    cornice.add(frame(width, length, profile), "Cream", (0, 0, height), (180, 0, 0))
    put(cornice.mesh("Cornice"), where=standing())


def _boards(scene: Scene[Barbershop]) -> None:
    """Boards about 0.25 m wide along the room, with beads between them."""
    width, length, height = scene.plan.room
    count = round(width / 0.25)
    size = width / count
    board = Model(scene)
    board.box(size=(size - 0.02, length, 0.02), bevel=0.004, material=scene.plan.ceiling)
    board.box(size=(0.02, length, 0.012), at=(size / 2, 0, 0.004), material="Gilt")
    across = [(i + 0.5) * size - width / 2 for i in range(count)]
    where = [standing(x=x, z=height - 0.01) for x in across]
    put(board.mesh(name="Ceiling board"), where)


def _tin_tiles(scene: Scene[Barbershop]) -> None:
    """Tiles about 0.5 m wide, with petals round a boss."""
    u = np.linspace(-1, 1, scene.segments(32, 6) + 1)
    v = u[:, None]
    square = np.maximum(np.abs(u), np.abs(v))
    r = np.hypot(u, v)
    petals = 0.5 + 0.5 * np.cos(8 * np.arctan2(v, u))
    relief = (
        0.020 * np.exp(-(((square - 0.92) / 0.05) ** 2))
        + 0.012 * np.exp(-(((square - 0.74) / 0.04) ** 2))
        + 0.022 * np.exp(-(((r - 0.42) / 0.14) ** 2)) * petals
        + 0.030 * np.exp(-((r / 0.13) ** 2))
    )
    tile = scene.mesh("Tin tile", grid(u / 4, u / 4, relief), "Tin")
    width, length, height = scene.plan.room
    columns = round(width / 0.5)
    rows = round(length / 0.5)
    size = (width / columns, length / rows)
    put(
        tile,
        [
            standing((i + 0.5) * size[0] - width / 2, (j + 0.5) * size[1] - length / 2, height)
            for i in range(columns)
            for j in range(rows)
        ],
        degrees=(180, 0, 0),
        scale=(size[0] / 0.5, size[1] / 0.5, 1.0),
    )
