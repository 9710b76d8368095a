"""The fire in its bowl, and candles. The flames glow, and lamps beside them give their light."""

import bpy
import numpy as np

from scenes.garden.plan import CANDLE_COLOR, TAU, GardenPlan
from scenes.library.lights import point_light
from scenes.library.points import noise, points, polar, xyz
from scenes.library.scene import Scene, animate, place
from scenes.library.shapes import icosphere, join, transform, tube

FLAME_TONGUES = 6
FLAME_SHELLS = (1.0, 0.78, 0.5)


def fire(scene: Scene[GardenPlan]) -> None:
    """An iron bowl with burning logs."""
    x, y = scene.plan.fire
    outside = [
        (0.05, 0.30),
        (0.24, 0.34),
        (0.36, 0.46),
        (0.40, 0.60),
        (0.43, 0.60),
        (0.43, 0.58),
        (0.41, 0.575),
    ]
    inside = [(0, 0.36), (0.22, 0.38), (0.34, 0.48), (0.40, 0.60)]
    faces = points(outside)[::-1], points(inside)
    bowl = [scene.lathe(face, 48, capped=False) for face in faces]
    legs = [polar([0.30, 0.36, 0.44], 0.4 + k * TAU / 3, [0.42, 0.2, -0.05]) for k in range(3)]
    bowl += [scene.tube(leg, 0.022) for leg in legs]
    scene.add("Fire bowl", join(bowl), "Iron", matrix=transform((x, y, 0)))
    random = scene.random("fire")
    logs = []
    for k in range(9):
        angle = k * 2.4 + random.normal(0, 0.2)
        tip = random.uniform(0.05, 0.14)
        reach = 0.27 * np.array([1, -tip])
        rise = [0.44, 0.58 + 0.2 * random.random()]
        path = np.linspace(*polar(reach, angle, rise), 6)
        logs.append(scene.tube(path, 0.045 * random.uniform(0.7, 1.1, 6), 12))
    bed = icosphere(scene.segments(4, 2))
    lumps = 1 + 0.25 * noise(bed.vertices * 4, 71, 2)[:, None]
    logs.append(bed.reshaped(bed.vertices * (0.3, 0.3, 0.06) * lumps).moved(0, 0, 0.47))
    scene.add("Logs", join(logs), "Embers", matrix=transform((x, y, 0)))
    flames(scene, x, y, 0.48)
    point_light("Fire light", (x, y, 0.95), 90.0, (1.0, 0.42, 0.12), 0.16)


def flames(scene: Scene, x: float, y: float, z: float) -> None:
    """Tongues of glowing gas, up to 1 m high, bent by noise that rises with the frames.

    Each consists of a few nested shells of evenly glowing gas, which Cycles integrates exactly. For
    a flame of procedural density, Cycles would make a new grid for each view.
    """
    random = scene.random("flames")
    licks = []
    for axis in "XY":
        texture = bpy.data.textures.new(f"Flame noise {axis}", "CLOUDS")
        texture.noise_scale = 0.3
        texture.noise_depth = 1
        carrier = place(f"Flame carrier {axis}", None, transform((x, y + ord(axis), z)))
        animate(carrier, "location", 0.05, 2)
        licks.append((axis, texture, carrier))
    t = np.linspace(0, 1, scene.segments(40, 8))
    body = np.sin(np.pi * t**0.55) * (1 - 0.45 * t) + 0.002
    for k in range(FLAME_TONGUES):
        angle = 2.4 * k
        reach = 0.0
        height = 1.0
        width = 0.15
        if k:
            reach, height, width = random.uniform((0.09, 0.45, 0.07), (0.17, 0.8, 0.11))
        spot = transform(np.add((x, y, z), polar(reach, angle)), (0, 0, angle))
        for shell, size in enumerate(FLAME_SHELLS):
            profile = np.column_stack([width * size**1.3 * body, height * size * t])
            gas = scene.lathe(profile, 28)
            tongue = scene.add(f"Flame.{k}.{shell}", gas, f"Flame gas {shell}", matrix=spot)
            tongue.visible_diffuse = False
            tongue.visible_shadow = False
            higher = tongue.vertex_groups.new(name="Height")
            for vertex in tongue.data.vertices:
                higher.add([vertex.index], min(1.0, vertex.co.z + 0.1), "REPLACE")
            for axis, texture, carrier in licks:
                bend = tongue.modifiers.new(f"Lick {axis}", "DISPLACE")
                bend.texture = texture
                bend.vertex_group = higher.name
                bend.direction = axis
                bend.space = "GLOBAL"
                bend.strength = 0.6
                bend.texture_coords = "OBJECT"
                bend.texture_coords_object = carrier


def candles(scene: Scene[GardenPlan]) -> None:
    """Candles, 0.2 m high, at the statue's feet, by the rocks, and afloat on the pond."""
    random = scene.random("candles")
    wax = scene.lathe(
        [(0.036, 0), (0.033, 0.01), (0.032, 0.19), (0.029, 0.20), (0.024, 0.193), (0, 0.185)], 28
    )
    drips = 0.06 * noise(wax.vertices * (40, 40, 9), 81, 2)
    wax = wax.reshaped(wax.vertices * (1 + xyz(drips, drips, 0)))
    wick = tube([(0, 0, 0.18), (0, 0.001, 0.2), (0.003, 0.002, 0.212)], 0.0017, 5).painted(1)
    candle = scene.mesh("Candle", join([wax, wick]), "Wax", "Wick", smooth=0.7)
    t = np.linspace(0, 1, scene.segments(14, 6))
    width = 0.0105 * np.sin(np.pi * t**0.62) * (1 - 0.3 * t)
    flame = scene.lathe(np.column_stack([width, 0.2 + 0.052 * t]), 14)
    burning = scene.mesh("Candle flame", flame, "Candle flame")
    rim = [(0.03, -0.015), (0.075, 0), (0.095, 0.035), (0.09, 0.035), (0.07, 0.012), (0, 0.01)]
    cup = scene.mesh("Candle cup", scene.lathe(rim, 28), "Candle cup")
    for i, (x, y, base) in enumerate(points(scene.plan.candles)):
        afloat = base < 0
        size = random.uniform(0.8, 1.15)
        tall = size * (0.35 if afloat else random.uniform(0.5, 1.3))
        turn = (0, 0, random.uniform(0, TAU))
        place(f"Candle.{i:02d}", candle, transform((x, y, base), turn, (size, size, tall)))
        foot = transform((x, y, base + 0.2 * (tall - 1.0)))
        flame_object = place(f"Candle flame.{i:02d}", burning, foot)
        flame_object.visible_diffuse = False
        flame_object.visible_shadow = False
        if afloat:
            place(f"Candle cup.{i:02d}", cup, transform((x, y, base)))
    for i, spot in enumerate(points(scene.plan.candle_lights)):
        point_light(f"Candle light.{i}", spot, 3.0, CANDLE_COLOR, 0.03)
