"""Boulders: islands in the gravel, the pond's shore, and stones in the moss."""

import bpy
import numpy as np

from scenes.garden.placing import spread, standing
from scenes.garden.plan import (
    POND_CENTER,
    ROCK_ISLANDS,
    TAU,
    court_distance,
    path_distance,
    pond_distance,
)
from scenes.library.noise import noise
from scenes.library.objects import scatter, transform
from scenes.library.points import Array, points
from scenes.library.scene import Scene
from scenes.library.shapes import icosphere


def boulder(scene: Scene, number: int) -> bpy.types.Mesh:
    """A boulder about 1 m across, weathered and mossy on top."""
    ball = icosphere(scene.segments(5, 2))
    v, shift = ball.vertices, np.array([17.0 * number, 5.0, 3.0])
    ridges = 1 - 2 * np.abs(noise(v * 1.3 + shift, 62, 1))
    swell = 1 + 0.28 * noise(v * 0.9 + shift, 61, 2) + 0.16 * ridges
    swell += 0.05 * noise(v * 5 + shift, 63, 3)
    stretch = scene.random(f"rock{number}").uniform((0.4, 0.34, 0.3), (0.52, 0.48, 0.46))
    return scene.mesh(f"Rock.{number}", ball.reshaped(v * swell[:, None] * stretch), "Rock")


def rocks(scene: Scene) -> None:
    """Rock islands in the gravel, stones along the shore, and boulders in the moss."""
    random = scene.random("rocks")
    places = []
    for x, y, radius in ROCK_ISLANDS:
        for dx, dy, size in points("0 0 1.5, 0.62 0.25 0.85, -0.35 0.55 0.6, 0.15 -0.6 0.5"):
            spot = (x + dx * radius, y + dy * radius, 0.22 * size * radius)
            places.append(transform(spot, (0, 0, random.uniform(0, TAU)), size * radius))
    for angle in np.arange(0, TAU, 0.115):
        direction = np.array([np.cos(angle), np.sin(angle) / 0.8])
        reach = np.linspace(1.0, 4.0, 300)[:, None] * direction + POND_CENTER
        shore = reach[np.abs(pond_distance(*reach.T)).argmin()] + random.normal(0, 0.06, 2)
        size = random.uniform(0.34, 0.62) * (1.5 if random.random() < 0.12 else 1.0)
        turn = random.uniform((-0.2, -0.2, 0), (0.2, 0.2, TAU))
        places.append(transform((*shore, -0.02), turn, size))

    def allowed(x: Array, y: Array) -> Array:
        off_path = path_distance(x, y) > 1.2
        return off_path & (court_distance(x, y) > 0.7) & (pond_distance(x, y) > 0.6)

    spots = spread(random, 26, (-13, -13, 13, 13), 1.2, allowed)
    places += standing(random, spots, (0.4, 1.5), -0.05)
    scatter("Rock", [boulder(scene, i) for i in range(6)], places)
