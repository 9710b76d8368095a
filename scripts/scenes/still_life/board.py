"""The board, a cloth over its edge, a string of pearls, and the lamps around."""

import numpy as np

from scenes.library.lights import area_light, hdri_world
from scenes.library.points import noise, points, smooth_path, smoothstep, unit, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import copies, sheet, towards
from scenes.still_life.plan import RADIUS, STRING, StillLife

PROFILE = [
    (0.262, -0.044),
    (0.284, -0.042),
    (0.296, -0.036),
    (0.3, -0.026),
    (0.3, -0.016),
    (0.297, -0.007),
    (0.291, -0.002),
    (0.283, 0),
]


def lamps(scene: Scene[StillLife]) -> None:
    """Area lamps that look at the board's middle, in a dim room."""
    hdri_world(scene.plan.room, scene.plan.room_strength, np.radians(scene.plan.room_turned))
    for number, row in enumerate(points(scene.plan.lamps)):
        at, size, watts, color = np.split(row, [3, 5, 6])
        lamp = area_light(f"Lamp {number}", towards(at, -at), tuple(size), watts[0], color)
        lamp.visible_camera = False


def board(scene: Scene) -> None:
    scene.add("Board", scene.lathe(PROFILE, 160), "Walnut", smooth=np.radians(40))


def cloth(scene: Scene) -> None:
    """Striped linen that lies under the bowl and hangs over the board's edge in folds."""
    start = np.array([0.05, 0.02])
    along = unit([0.42, -0.9])
    width = 0.21
    bend = 0.012
    across = np.array([along[1], -along[0]])
    s = np.linspace(0, 0.47, scene.segments(150, 24))[:, None]
    v = np.linspace(-width / 2, width / 2, scene.segments(84, 14))
    on_top = start + v[:, None] * across
    # How far it is along the cloth, from each place of its upper end, to the edge.
    ahead = on_top @ along
    edge = -ahead + np.sqrt(ahead**2 - (on_top**2).sum(-1) + (RADIUS - 0.003) ** 2)
    beyond = np.maximum(s - edge, 0)
    angle = np.minimum(beyond / bend, np.pi / 2)
    fall = np.maximum(beyond - bend * np.pi / 2, 0)
    folds = 0.011 * (1 + np.sin(95 * v + 0.8 * np.sin(31 * v))) * smoothstep(0, 0.09, fall)
    out = np.minimum(s, edge) + bend * np.sin(angle) + folds
    flat = start + out[..., None] * along + v[:, None] * across * (1 - 0.6 * fall[..., None])
    x, y = np.moveaxis(flat, -1, 0)
    wrinkles = noise(xyz(x * 26, y * 26), scene.seed, 2)
    rise = 0.0022 + 0.0028 * (wrinkles + 0.6) * smoothstep(0.13, 0.2, s) * (1 - angle / 2)
    body = sheet(xyz(x, y, np.maximum(rise, 0.0008) - bend * (1 - np.cos(angle)) - fall))
    rows, columns = len(s) - 1, len(v) - 1
    off_middle = np.abs((np.arange(columns) + 0.5) / columns - 0.5)
    blue = (np.abs(off_middle - 0.36) < 0.03) | (np.abs(off_middle - 0.43) < 0.012)
    ends = np.isin(np.arange(rows), np.round(rows * np.array([0.9, 0.91, 0.92, 0.95])).astype(int))
    slots = (blue | ends[:, None]).ravel().astype(np.int32)
    scene.add("Cloth", body._replace(slots=slots), "Linen", "Blue linen")


def pearls(scene: Scene) -> None:
    """Pearls on a thread, each a little larger towards the middle of the string."""
    path = smooth_path(STRING, 400)
    count = 52
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    radius = 0.0037 + 0.0012 * np.sin(np.linspace(0, np.pi, count))
    x, y = (np.interp(np.linspace(0, length[-1], count), length, axis) for axis in path.T)
    string = xyz(x, y, radius)
    scene.add("Pearls", copies(scene.ball(1.0, 20), string, size=radius), "Pearl")
    scene.add("Thread", scene.tube(string, 0.0006, 5), "Linen")
    clasp = scene.ring(0.004, 0.0012, 20, 8).moved(0, 0, 0.0012)
    scene.add("Clasp", clasp.moved(x[0] - 0.004, y[0] + 0.004, 0), "Brass")
