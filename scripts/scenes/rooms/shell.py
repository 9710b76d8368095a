"""Floor, ceiling, walls, windows and door of a room."""

import numpy as np

from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform
from scenes.rooms.plan import DOOR, THICK, WALLS, Room

Hole = tuple[float, float, float, float]  # left, right, bottom and top


def floor(scene: Scene[Room]) -> None:
    """Boards, or one slab of the floor's material."""
    plan = scene.plan
    width, length, _ = plan.size
    model = Model(scene)
    if plan.floor == "Floor boards":
        for left in np.arange(0, width, 0.14):
            board = min(0.138, width - left)
            at = (left + board / 2 - width / 2, 0, -0.02)
            model.box(size=(board, length, 0.04), at=at, material=plan.floor)
    else:
        model.box(size=(width, length, 0.04), at=(0, 0, -0.02), material=plan.floor)
    place("Floor", model.mesh("Floor"), transform((*plan.center, 0)))


def ceiling(scene: Scene[Room]) -> None:
    width, length, height = scene.plan.size
    model = Model(scene)
    size = (width + 2 * THICK, length + 2 * THICK, THICK)
    model.box(size=size, at=(0, 0, height + THICK / 2), material="Ceiling paint")
    place("Ceiling", model.mesh("Ceiling"), transform((*scene.plan.center, 0)))


def holes(plan: Room, wall: int) -> list[Hole]:
    """The openings of a wall, from left to right in its frame."""
    openings = [
        (
            each.along - each.width / 2,
            each.along + each.width / 2,
            each.sill,
            each.sill + each.height,
        )
        for each in plan.windows
        if each.wall == wall
    ]
    if wall == plan.door_wall:
        width, height = DOOR
        openings.append((plan.door_along - width / 2, plan.door_along + width / 2, 0.0, height))
    return sorted(openings)


def walls(scene: Scene[Room]) -> None:
    """Each wall as blocks between, below and above its openings."""
    plan = scene.plan
    height = plan.size[2]
    for wall in WALLS:
        model = Model(scene)
        half = plan.wall_length(wall) / 2 + THICK
        start = -half
        for left, right, bottom, top in [*holes(plan, wall), (half, half, 0.0, height)]:
            _block(model, (start, left), (0, height), plan.wall)
            _block(model, (left, right), (0, bottom), plan.wall)
            _block(model, (left, right), (top, height), plan.wall)
            start = right
        place(f"Wall.{wall}", model.mesh("Wall"), plan.at_wall(wall))


def _block(model: Model, x: tuple[float, float], z: tuple[float, float], material: str) -> None:
    """A part of a wall. Its front is y = 0."""
    if x[1] - x[0] > 1e-6 and z[1] - z[0] > 1e-6:
        at = ((x[0] + x[1]) / 2, -THICK / 2, (z[0] + z[1]) / 2)
        model.box(size=(x[1] - x[0], THICK, z[1] - z[0]), at=at, material=material)


def skirting(scene: Scene[Room]) -> None:
    plan = scene.plan
    for wall in WALLS:
        model = Model(scene)
        start = -plan.wall_length(wall) / 2
        doors = [(left, right) for left, right, bottom, _ in holes(plan, wall) if bottom == 0]
        for left, right in [*doors, (-start, -start)]:
            at = ((start + left) / 2, 0.0075, 0.05)
            model.box(size=(left - start, 0.015, 0.1), at=at, material="Joinery")
            start = right
        place(f"Skirting.{wall}", model.mesh("Skirting"), plan.at_wall(wall))


def windows(scene: Scene[Room]) -> None:
    """Casements with a bar, a pane, and a sill."""
    for number, window in enumerate(scene.plan.windows):
        model = Model(scene)
        width, height = window.width, window.height
        for x in (-width / 2 + 0.03, 0, width / 2 - 0.03):
            model.box(size=(0.06, 0.06, height), at=(x, -0.1, height / 2), material="Joinery")
        for z in (0.03, 0.62 * height, height - 0.03):
            model.box(size=(width, 0.05, 0.06), at=(0, -0.1, z), material="Joinery")
        model.box(size=(width, 0.004, height), at=(0, -0.11, height / 2), material="Pane")
        if window.sill > 0.2:
            model.box(size=(width + 0.1, 0.3, 0.03), at=(0, -0.06, -0.005), material="Joinery")
        matrix = scene.plan.at_wall(window.wall, window.along, 0, window.sill)
        place(f"Window.{number}", model.mesh("Window"), matrix)


def door(scene: Scene[Room]) -> None:
    """A panelled door in its frame."""
    model = Model(scene)
    width, height = DOOR
    model.box(size=(width, 0.045, height), at=(0, -0.08, height / 2), material="Joinery")
    for z, tall in ((0.55, 0.7), (1.5, 0.9)):
        for x in (-0.21, 0.21):
            model.box(size=(0.3, 0.02, tall), bevel=0.008, at=(x, -0.055, z), material="Joinery")
    for x in (-width / 2 - 0.04, width / 2 + 0.04):
        model.box(size=(0.1, 0.03, height + 0.08), at=(x, 0.01, height / 2), material="Joinery")
    model.box(size=(width + 0.18, 0.03, 0.1), at=(0, 0.01, height + 0.05), material="Joinery")
    model.ball(radius=0.03, at=(0.4, -0.02, 1.02), material="Brass")
    place(
        "Door", model.mesh("Door"), scene.plan.at_wall(scene.plan.door_wall, scene.plan.door_along)
    )
