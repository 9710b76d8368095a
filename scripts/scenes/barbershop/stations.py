"""The barbers' stations along the left wall: cabinets, mirrors, basins, tools, and goods."""

import bpy
import numpy as np

from scenes.barbershop.cloth import folded_towel, rolled_towel
from scenes.barbershop.goods import Goods, shelf, stock
from scenes.barbershop.plan import COUNTER_TOP, TOWELS, Barbershop, put
from scenes.library.points import circle, evenly, lattice, mirrored, polar, xyz
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, prism, sheet, transform, tube

# Round the panel of a cabinet's door or drawer.
PANEL = [
    (-0.05, 0.004),
    (-0.03, 0.018),
    (0, 0.02),
    (0.015, 0.006),
    (0.02, 0),
]
CABINET = 0.64  # its width
KNOB = [(0.008, 0), (0.008, 0.014), (0.017, 0.02), (0.014, 0.03), (0, 0.032)]
BLADE = [(-0.005, -0.01), (0.006, -0.01), (0.007, 0.02), (0.001, 0.1), (-0.002, 0.1)]  # of scissors


def _cabinet(model: Model) -> None:
    """Add a cabinet's body on its plinth."""
    model.box(size=(0.64, 0.41, 0.73), at=(0, 0.205, 0.455), material="Mahogany")
    model.box(
        size=(0.05, 0.02, 0.73),
        bevel=0.006,
        at=mirrored(x=0.32, y=0.41, z=0.455),
        material="Mahogany",
    )
    model.box(size=(0.64, 0.35, 0.09), at=(0, 0.175, 0.045), material="Ebony")


def _cabinets(plan: Barbershop) -> list[float]:
    """Where the cabinets stand along their wall, side by side below all stations."""
    count = round((plan.pitch * len(plan.stations) + 0.4) / CABINET)
    half = CABINET * (count - 1) / 2
    return evenly(plan.counter_middle - half, plan.counter_middle + half, count)


def counter_drawers(scene: Scene[Barbershop]) -> None:
    """Cabinets of four drawers."""
    drawers = Model(scene)
    _cabinet(drawers)
    drawers.frame(
        size=(0.5, 0.11),
        profile=PANEL,
        at=lattice(y=0.41, z=evenly(0.18, 0.705, 4)),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    drawers.lathe(
        profile=KNOB,
        at=lattice(x=(-0.15, 0.15), y=0.412, z=evenly(0.18, 0.705, 4)),
        turned=(-90, 0, 0),
        material="Brass",
    )
    put(
        drawers.mesh(name="Counter drawers"),
        where=[scene.plan.at_counter(along) for along in _cabinets(scene.plan)[::2]],
    )


def counter_doors(scene: Scene[Barbershop]) -> None:
    """Cabinets of two doors."""
    doors = Model(scene)
    _cabinet(doors)
    doors.frame(
        size=(0.23, 0.6),
        profile=PANEL,
        at=mirrored(x=0.15, y=0.41, z=0.45),
        turned=(90, 0, 180),
        material="Mahogany",
    )
    doors.lathe(
        profile=KNOB, at=mirrored(x=0.0375, y=0.412, z=0.55), turned=(-90, 0, 0), material="Brass"
    )
    put(
        doors.mesh(name="Counter doors"),
        where=[scene.plan.at_counter(along) for along in _cabinets(scene.plan)[1::2]],
    )


def counter_top(scene: Scene[Barbershop]) -> None:
    """One marble top over all cabinets, with a ledge at the wall."""
    top = Model(scene)
    width = CABINET * len(_cabinets(scene.plan)) + 0.04
    top.box(
        size=(width, 0.44, 0.04), bevel=0.012, segments=3, at=(0, 0.22, -0.02), material="Marble"
    )
    top.box(size=(width, 0.022, 0.09), bevel=0.006, at=(0, 0.023, 0.045), material="Marble")
    where = scene.plan.at_counter(scene.plan.counter_middle, z=COUNTER_TOP)
    put(top.mesh(name="Counter top"), where)


def bulb_strip(scene: Scene[Barbershop]) -> None:
    """Strips of round bulbs beside the mirrors."""
    strip = Model(scene)
    strip.box(size=(0.07, 1.1, 0.03), bevel=0.008, segments=2, at=(0, 0, 0.015), material="Brass")
    strip.lathe(
        profile=[(0.028, 0), (0.024, 0.016), (0.018, 0.02)],
        at=lattice(y=evenly(-0.42, 0.42, 4), z=0.03),
        material="Brass",
    )
    strip.ball(radius=0.036, at=lattice(y=evenly(-0.42, 0.42, 4), z=0.075), material="Bulb")
    put(
        strip.mesh(name="Bulb strip"),
        where=[
            scene.plan.over_counter(along + aside, away=0.012, z=1.62)
            for aside in (-0.625, 0.625)
            for along in scene.plan.stations
        ],
    )


def mirror_tube(scene: Scene[Barbershop]) -> None:
    """A lamp above each mirror."""
    lamp = Model(scene)
    lamp.box(size=(0.98, 0.07, 0.05), bevel=0.012, segments=2, at=(0, 0, 0.025), material="Chrome")
    lamp.tube(radius=0.019, path=[(-0.46, 0, 0.075), (0.46, 0, 0.075)], material="Lamp tube")
    lamp.tube(
        radius=0.026,
        path=[(-0.02, 0, 0), (0.02, 0, 0)],
        at=mirrored(x=0.47, z=0.075),
        material="Chrome",
    )
    lamp.box(size=(0.03, 0.04, 0.06), at=mirrored(x=0.47, z=0.05), material="Chrome")
    where = [scene.plan.over_counter(along, z=2.41) for along in scene.plan.stations]
    put(lamp.mesh(name="Mirror tube"), where)


def basin(scene: Scene[Barbershop]) -> None:
    model = Model(scene)
    model.lathe(
        profile=[
            (0.09, 0),
            (0.14, 0.02),
            (0.185, 0.08),
            (0.2, 0.13),
            (0.205, 0.14),
            (0.19, 0.135),
            (0.17, 0.08),
            (0.12, 0.03),
            (0.02, 0.02),
            (0, 0.02),
        ],
        scaled=(1.15, 0.85, 1),
        material="Porcelain",
    )
    model.lathe(profile=[(0.026, 0.021), (0.026, 0.026), (0, 0.026)], material="Chrome")
    put(
        model.mesh(name="Basin"),
        where=[
            scene.plan.at_counter(along, away=0.24, z=COUNTER_TOP) for along in scene.plan.stations
        ],
    )


def tap(scene: Scene[Barbershop]) -> None:
    model = Model(scene)
    model.lathe(profile=[(0.028, 0), (0.028, 0.012), (0.014, 0.03)], material="Chrome")
    model.bend(
        radius=0.011,
        path=[(0, 0, 0.02), (0, 0, 0.2), (0, 0.03, 0.26), (0, 0.09, 0.27), (0, 0.13, 0.22)],
        material="Chrome",
    )
    model.lathe(
        profile=[(0.018, 0), (0.01, 0.02), (0.01, 0.05), (0, 0.052)],
        at=mirrored(x=0.07),
        material="Chrome",
    )
    model.tube(
        radius=0.006,
        path=[(-0.026, 0, 0.045), (0.026, 0, 0.045)],
        at=mirrored(x=0.07),
        material="Chrome",
    )
    model.tube(
        radius=0.006,
        path=[(0, -0.026, 0.045), (0, 0.026, 0.045)],
        at=mirrored(x=0.07),
        material="Chrome",
    )
    put(
        model.mesh(name="Tap"),
        where=[
            scene.plan.at_counter(along, away=0.06, z=COUNTER_TOP) for along in scene.plan.stations
        ],
    )


def tool_mat(scene: Scene[Barbershop]) -> None:
    mat = Model(scene)
    mat.box(size=(0.3, 0.2, 0.006), bevel=0.002, at=(0, 0, 0.003), material="White towel")
    put(
        mat.mesh(name="Tool mat"),
        where=[
            scene.plan.at_counter(along, away=0.26, z=COUNTER_TOP, x=0.44)
            for along in scene.plan.stations
        ],
    )


def towel_rail(scene: Scene[Barbershop]) -> None:
    """Rails at the counter's front."""
    rail = Model(scene)
    rail.bend(
        radius=0.007,
        path=[
            (-0.18, 0, 0),
            (-0.18, 0.06, 0),
            (-0.16, 0.07, 0),
            (0, 0.07, 0),
            (0.16, 0.07, 0),
            (0.18, 0.06, 0),
            (0.18, 0, 0),
        ],
        material="Brass",
    )
    put(
        rail.mesh(name="Towel rail"),
        where=[
            scene.plan.at_counter(along, away=0.43, z=0.72)
            for along in scene.plan.beside_stations[1:-1]
        ],
    )


def scissors(scene: Scene) -> bpy.types.Mesh:
    """Open scissors."""
    model = Model(scene)
    model.prism(
        height=0.0018, outline=BLADE, at=(0, 0, 0.002), turned=(0, 0, -11), material="Steel"
    )
    model.prism(height=0.0018, outline=BLADE, at=(0, 0, 0.004), turned=(0, 0, 11), material="Steel")
    model.tube(radius=0.003, path=[(0, -0.008, 0.004), (0.016, -0.05, 0.004)], material="Steel")
    model.tube(radius=0.003, path=[(0, -0.008, 0.004), (-0.016, -0.05, 0.004)], material="Steel")
    model.ring(
        radius=0.014, thickness=0.003, at=mirrored(x=0.02, y=-0.064, z=0.004), material="Steel"
    )
    model.lathe(profile=[(0.004, 0), (0.004, 0.007), (0, 0.0075)], material="Brass")
    return model.mesh("Scissors")


def razor(scene: Scene) -> bpy.types.Mesh:
    """A razor, half open."""
    model = Model(scene)
    model.box(size=(0.014, 0.14, 0.008), bevel=0.003, at=(0, 0, 0.004), material="Ebony")
    model.prism(
        height=0.0025,
        outline=[(0, 0), (0.02, 0.004), (0.02, 0.075), (0.004, 0.08), (0, 0.07)],
        at=(0.003, 0.068, 0.003),
        turned=(0, 0, -55),
        material="Chrome",
    )
    model.lathe(profile=[(0.004, 0), (0.004, 0.01), (0, 0.011)], at=(0, 0.062, 0), material="Brass")
    return model.mesh("Razor")


def hair_dryer(scene: Scene) -> bpy.types.Mesh:
    """A chromed hair dryer."""
    dryer = Model(scene)
    dryer.lathe(
        profile=[
            (0.02, -0.07),
            (0.038, -0.05),
            (0.04, 0.02),
            (0.026, 0.05),
            (0.024, 0.13),
            (0.028, 0.135),
        ],
        at=(0, 0, 0.041),
        turned=(90, 0, 0),
        material="Chrome",
    )
    dryer.box(
        size=(0.12, 0.034, 0.03),
        bevel=0.012,
        segments=3,
        at=(0.085, 0.02, 0.036),
        turned=(0, 4, -10),
        material="Black",
    )
    dryer.ring(
        radius=0.03, thickness=0.003, at=(0, -0.02, 0.041), turned=(90, 0, 0), material="Red"
    )
    return dryer.mesh("Hair dryer")


def clippers(scene: Scene) -> bpy.types.Mesh:
    """Electric clippers on their coiled cord."""
    model = Model(scene)
    model.box(
        size=(0.048, 0.14, 0.036), bevel=0.014, segments=3, at=(0, 0, 0.019), material="Black"
    )
    model.box(size=(0.044, 0.03, 0.006), at=(0, 0.082, 0.026), turned=(20, 0, 0), material="Steel")
    model.box(
        size=(0.0015, 0.012, 0.003),
        at=lattice(x=evenly(-0.02, 0.02, 14), y=0.101, z=0.032),
        turned=(20, 0, 0),
        material="Steel",
    )
    model.box(size=(0.03, 0.06, 0.003), bevel=0.001, at=(0, -0.005, 0.037), material="Gilt")
    s = np.linspace(0, 1, scene.segments(140, 16))
    cord = xyz(0.012 * np.cos(70 * s) + 0.1 * s, -0.08 - 0.13 * s, 0.014 + 0.01 * np.sin(70 * s))
    model.add(scene.tube(cord, 0.0022, 5), "Black")
    return model.mesh("Clippers")


def comb(scene: Scene, material: str) -> bpy.types.Mesh:
    """A comb with fine teeth on one half and coarse ones on the other."""
    model = Model(scene)
    model.box(size=(0.17, 0.01, 0.004), bevel=0.0015, at=(0, 0.012, 0.002), material=material)
    x = np.linspace(-0.083, 0.083, scene.count(46, 8))
    x = np.concatenate([x[: len(x) // 2], x[len(x) // 2 :: 2]])
    model.add(box((0.0018, 0.024, 0.0026)), material, xyz(x, -0.004, 0.002))
    return model.mesh(f"Comb {material.lower()}")


def hair_brush(scene: Scene) -> bpy.types.Mesh:
    """A round-backed brush, its bristles up."""
    model = Model(scene)
    model.box(
        size=(0.055, 0.1, 0.014), bevel=0.006, segments=3, at=(0, 0.05, 0.007), material="Oak"
    )
    handle = scene.tube(
        [(0, 0, 0.007), (0, -0.04, 0.007), (0, -0.10, 0.007)], (0.007, 0.010, 0.007), 12
    )
    model.add(handle, "Oak")
    columns, rows = scene.segments(6, 2), scene.segments(11, 3)
    roots = lattice(x=evenly(-0.02, 0.02, columns), y=evenly(0.01, 0.09, rows), z=0.013)
    upwards = roots * (6.7, 0, 0) + xyz(0, 0, 1)
    hairs = copies(
        tube([(0, 0, 0), (0, 0.015, 0)], 0.0016, 4), roots, forward=upwards, up=(0, 1, 0)
    )
    model.add(hairs, "Bristle")
    return model.mesh("Hair brush")


def mirrors(scene: Scene[Barbershop]) -> None:
    """A mirror at each station in a gilt frame with beads, a crest and scrolls."""
    model = Model(scene)
    model.plane(size=(0.92, 1.1), at=(0, 0, 0.026), material="Mirror")
    model.frame(
        size=(0.92, 1.1),
        profile=[
            (-0.006, 0.02),
            (-0.006, 0.034),
            (0.008, 0.04),
            (0.03, 0.03),
            (0.06, 0.05),
            (0.085, 0.05),
            (0.095, 0.03),
            (0.095, 0),
        ],
        material="Gilt",
    )
    model.ball(radius=0.04, at=(0, 0.675, 0.04), scaled=(1, 1, 0.5), material="Gilt")
    bead = scene.ball(0.008, 8)
    count = scene.segments(44)
    model.add(bead, "Gilt", lattice(x=evenly(-0.46, 0.46, count), y=(-0.58, 0.58), z=0.034))
    model.add(bead, "Gilt", lattice(x=(-0.49, 0.49), y=evenly(-0.55, 0.55, count), z=0.034))
    crest = circle(0.2, scene.segments(24, 8), np.radians(20), np.radians(160)) * (1.6, 0.6)
    model.add(prism(crest, 0.03), "Gilt", (0, 0.595, 0.012))
    k = np.arange(12)
    spiral = (1 - 0.075 * k)[:, None] * polar(1, 0.7 * k) * (0.055, 0.04, 1)
    spiral += xyz(0.10, 0.67, 0.045)
    for side in (-1, 1):
        model.add(scene.bend(spiral * (side, 1, 1), 0.008, 30), "Gilt")
    put(
        model.mesh("Station mirror"),
        [scene.plan.over_counter(along, away=0.012, z=1.62) for along in scene.plan.stations],
    )


def station_goods(scene: Scene[Barbershop], bottles: Goods, pots: Goods) -> None:
    """The tools, bottles and pots of the stations."""
    random = scene.random("station goods")
    cutter = scissors(scene)
    clipper = clippers(scene)
    dryer = hair_dryer(scene)
    kit = [cutter, comb(scene, "Black"), comb(scene, "Oak"), hair_brush(scene)]
    kit += [razor(scene), cutter]
    for along in scene.plan.stations:
        where = scene.plan.at_counter(along, z=COUNTER_TOP)
        for k, tool in enumerate(kit):
            put(tool, where, (0.33 + 0.045 * k, 0.26, 0.0065), (0, 0, random.uniform(-7, 7)))
        put(clipper, where, (-0.36, 0.27, 0), (0, 0, random.uniform(-15, 15)))
        put(dryer, where, (-0.52, 0.28, 0), (0, 0, random.uniform(60, 85)))
        for x, some in ((-0.42, bottles[:9]), (0.42, bottles[9:])):
            strip = where @ transform((x, 0.04, 0))
            stock(scene, random, [*pots, *some], strip, 0.42, 0.14)


def racks(scene: Scene[Barbershop], bottles: Goods, pots: Goods) -> None:
    """The shelves between the mirrors, with pots and towels below them, and towels over rails."""
    random = scene.random("racks")
    board = shelf(scene, 0.56, 0.14)
    folded = [folded_towel(scene, towel) for towel in TOWELS]
    rolled = [rolled_towel(scene, towel) for towel in TOWELS[:2]]
    for number, along in enumerate(scene.plan.beside_stations):
        for z, goods in ((1.24, 1), (1.58, 1), (1.92, 1), (2.26, 0)):
            rack = scene.plan.at_counter(along, away=0.012, z=z)
            put(board, rack)
            stock(scene, random, [*bottles, *pots] if goods else bottles, rack, 0.54, 0.125)
        side = scene.plan.at_counter(along, away=0.04, z=COUNTER_TOP)
        stock(scene, random, pots, side, 0.72, 0.14)
        for k in range(3):
            turn = (0, 0, random.uniform(-4, 4))
            put(folded[(k + 2 * number + 1) % 4], side, (-0.22, 0.26, 0.045 * k), turn)
        for k, (x, z) in enumerate(((0.13, 0), (0.225, 0), (0.1775, 0.076))):
            put(rolled[k % 2], side, (x, 0.26, z))
    x = np.linspace(-0.16, 0.16, scene.segments(28, 6))
    s = np.linspace(0.46, -0.36, scene.segments(48, 10))[:, None]
    bow = np.clip(s / 0.022, -np.pi / 2, np.pi / 2)
    y = 0.022 * np.sin(bow) + 0.016 * np.sin(38 * x + 2) * np.abs(s) / 0.4
    draped = sheet(xyz(x, y, 0.022 * np.cos(bow) - np.maximum(np.abs(s) - 0.0345, 0)))
    rails = scene.plan.beside_stations[1:-1]
    for number, color in enumerate(("red", "blue")):
        towel = scene.mesh(f"Draped {color} towel", draped, f"{color.capitalize()} towel")
        put(towel, [scene.plan.at_counter(along, away=0.5, z=0.706) for along in rails[number::2]])
