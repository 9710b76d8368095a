"""The board, a cloth over its edge, and a string of pearls."""

import numpy as np

from scenes.library.noise import noise, smoothstep
from scenes.library.points import polar, smooth_path, unit, xyz
from scenes.library.scene import Scene
from scenes.library.shapes import copies, sheet

RADIUS = 0.3
PROFILE = """0.262 -0.044, 0.284 -0.042, 0.296 -0.036, 0.3 -0.026, 0.3 -0.016, 0.297 -0.007,
    0.291 -0.002, 0.283 0"""
# On the board, from the kettle round the chick, over itself, to the rim.
STRING = """-0.215 -0.035, -0.2 -0.09, -0.17 -0.135, -0.19 -0.185, -0.145 -0.215, -0.095 -0.23,
    -0.05 -0.205, -0.045 -0.16"""


def board(scene: Scene) -> None:
    scene.add("Board", scene.lathe(PROFILE, 160), "Walnut", smooth=np.radians(40))


def cloth(scene: Scene) -> None:
    """Striped linen that lies under the bowl and hangs over the board's edge in folds."""
    start, along = np.array([0.05, 0.02]), unit([0.42, -0.9])
    width, bend = 0.21, 0.012
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
    wrinkles = noise(np.dstack([flat * 26, np.zeros(flat.shape[:2])]), scene.seed, 2)
    rise = 0.0022 + 0.0028 * (wrinkles + 0.6) * smoothstep(0.13, 0.2, s) * (1 - angle / 2)
    z = np.maximum(rise, 0.0008) - bend * (1 - np.cos(angle)) - fall
    body = sheet(xyz(flat[..., 0], flat[..., 1], z))
    rows, columns = s.shape[0] - 1, len(v) - 1
    middle = (np.arange(columns) + 0.5) / columns
    blue = (np.abs(np.abs(middle - 0.5) - 0.36) < 0.03) | (
        np.abs(np.abs(middle - 0.5) - 0.43) < 0.012
    )
    ends = np.isin(np.arange(rows), np.round(rows * np.array([0.9, 0.91, 0.92, 0.95])).astype(int))
    body = body.painted(0)
    body.slots[(blue | ends[:, None]).ravel()] = 1
    scene.add("Cloth", body, "Linen", "Blue linen")


def pearls(scene: Scene) -> None:
    """Pearls on a thread, each a little larger towards the middle of the string."""
    path = smooth_path(STRING, 400)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    count = 52
    along = np.linspace(0, length[-1], count)
    radius = 0.0037 + 0.0012 * np.sin(np.linspace(0, np.pi, count))
    x, y = (np.interp(along, length, axis) for axis in path.T)
    shape = copies(scene.ball(1.0, 20), xyz(x, y, radius), size=radius)
    scene.add("Pearls", shape, "Pearl")
    thread = scene.tube(xyz(x, y, radius), 0.0006, 5)
    scene.add("Thread", thread, "Linen")
    clasp = scene.ring(0.004, 0.0012, 20, 8).moved(*polar(0.0, 0.0, 0.0012))
    scene.add("Clasp", clasp.moved(x[0] - 0.004, y[0] + 0.004, 0), "Brass")
