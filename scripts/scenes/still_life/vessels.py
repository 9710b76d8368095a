"""Things of metal, glass and porcelain."""

import numpy as np

from scenes.library.lights import point_light
from scenes.library.points import Array, mirrored, points, polar, smooth_path
from scenes.library.scene import Model, Scene, place
from scenes.library.shapes import transform

KETTLE = [
    (0.0, 0),
    (0.03, 0),
    (0.05, 0.0002),
    (0.06, 0.0016),
    (0.074, 0.009),
    (0.086, 0.03),
    (0.0885, 0.055),
    (0.082, 0.085),
    (0.064, 0.108),
    (0.045, 0.12),
    (0.038, 0.1245),
]
SPOUT = [
    (0.07, 0, 0.048),
    (0.094, 0, 0.056),
    (0.112, 0, 0.078),
    (0.122, 0, 0.106),
    (0.138, 0, 0.127),
    (0.15, 0, 0.133),
]
SPOUT_RADII = (0.024, 0.0195, 0.0145, 0.0115, 0.0095, 0.009)

CARAFE = [
    (0.02, 0),
    (0.032, 0),
    (0.04, 0.0004),
    (0.0465, 0.0025),
    (0.0515, 0.008),
    (0.0555, 0.04),
    (0.051, 0.08),
    (0.034, 0.118),
    (0.0205, 0.148),
    (0.0175, 0.175),
    (0.0205, 0.205),
    (0.028, 0.226),
]
GLASS_FOOT = [
    (0.004, 0),
    (0.03, 0),
    (0.033, 0.0006),
    (0.0336, 0.0016),
    (0.032, 0.0024),
    (0.024, 0.0034),
    (0.014, 0.0052),
    (0.008, 0.0078),
    (0.005, 0.012),
    (0.0038, 0.018),
    (0.0034, 0.028),
    (0.0034, 0.05),
]
GLASS_CUP = [
    (0.0034, 0.05),
    (0.0075, 0.064),
    (0.022, 0.074),
    (0.033, 0.092),
    (0.0365, 0.115),
    (0.0335, 0.142),
    (0.031, 0.155),
]
BOWL = [
    (0.006, 0.004),
    (0.031, 0.004),
    (0.033, 0),
    (0.0355, 0),
    (0.036, 0.006),
    (0.052, 0.013),
    (0.074, 0.03),
    (0.087, 0.05),
    (0.094, 0.066),
]
# Down the candle: azimuth in degrees, from and to heights.
DRIPS = [
    (20, 0.165, 0.118),
    (75, 0.164, 0.142),
    (160, 0.165, 0.09),
    (215, 0.164, 0.13),
    (300, 0.165, 0.105),
]


def kettle(scene: Scene) -> None:
    """A hammered copper kettle with brass fittings and an ebony grip."""
    model = Model(scene)
    _lid_and_handle(model)
    model.add(scene.lathe(smooth_path(KETTLE, scene.segments(40, 10)), 96), "Copper")
    path = smooth_path(SPOUT, scene.segments(40, 8))
    radii = np.interp(np.linspace(0, 1, len(path)), np.linspace(0, 1, 6), SPOUT_RADII)
    model.add(scene.tube(path, radii, 28), "Copper")
    mesh = model.mesh("Kettle", np.radians(50))
    place("Kettle", mesh, transform((-0.115, 0.075, 0), (0, 0, np.radians(205))))


def _lid_and_handle(kettle: Model) -> None:
    """The lid with its knob, and a handle on two brass arms."""
    kettle.ring(radius=0.0385, thickness=0.0022, at=(0, 0, 0.1255), material="Brass")
    kettle.lathe(
        profile=[
            (0.037, 0.1265),
            (0.0345, 0.133),
            (0.026, 0.139),
            (0.013, 0.1425),
            (0.006, 0.1435),
        ],
        material="Copper",
    )
    kettle.lathe(
        profile=[
            (0.005, 0.143),
            (0.0048, 0.148),
            (0.009, 0.153),
            (0.0105, 0.159),
            (0.0085, 0.165),
            (0.003, 0.168),
        ],
        material="Ebony",
    )
    kettle.ring(radius=0.0058, thickness=0.0014, at=(0, 0, 0.1445), material="Brass")
    kettle.ring(
        radius=0.006,
        thickness=0.0022,
        at=mirrored(x=0.057, z=0.122),
        turned=(90, 0, 0),
        material="Brass",
    )
    kettle.bend(
        radius=0.0032,
        path=[(-0.057, 0, 0.124), (-0.064, 0, 0.165), (-0.052, 0, 0.2), (-0.024, 0, 0.219)],
        material="Brass",
    )
    kettle.bend(
        radius=0.0032,
        path=[(0.057, 0, 0.124), (0.064, 0, 0.165), (0.052, 0, 0.2), (0.024, 0, 0.219)],
        material="Brass",
    )
    grip = [
        (-0.034, 0, 0.2135),
        (-0.018, 0, 0.2215),
        (0, 0, 0.224),
        (0.018, 0, 0.2215),
        (0.034, 0, 0.2135),
    ]
    sides = 4 + 60 * 0.0062**0.5
    kettle.add(kettle.scene.bend(grip, 0.0062, 35, sides), "Ebony")


def carafe(scene: Scene) -> None:
    outside = smooth_path(CARAFE, scene.segments(60, 12))
    matrix = transform((0.135, 0.125, 0))
    scene.add("Carafe", scene.lathe(_wall(outside, 0.0022), 88), "Glass", matrix=matrix)
    wine = _wine(outside, 0.0022, 0.083)
    scene.add("Wine in the carafe", scene.lathe(wine, 72), "Wine", matrix=matrix)


def wineglass(scene: Scene) -> None:
    """A stem of glass, and a cup with some wine."""
    cup = smooth_path(GLASS_CUP, scene.segments(40, 10))
    matrix = transform((0.215, 0.02, 0))
    body = np.concatenate([points(GLASS_FOOT), cup[1:2], _wall(cup[2:], 0.0011)])
    scene.add("Wine glass", scene.lathe(body, 72), "Glass", matrix=matrix)
    wine = _wine(cup[2:], 0.0011, 0.1)
    scene.add("Wine in the glass", scene.lathe(wine, 72), "Wine", matrix=matrix)


def _inside(outside: Array, thickness: float) -> Array:
    """A profile (n, 2) that is `thickness` within another, from its lower end up."""
    tangent = np.gradient(outside, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    inner = outside + thickness * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    return inner[inner[:, 0] > 0.0005]


def _wall(outside: Array, thickness: float) -> Array:
    """The profile of a vessel's wall: up outside, over a round lip, down inside."""
    inner = _inside(outside, thickness)
    lip = (outside[-1] + inner[-1]) / 2 + (0, thickness / 2)
    return np.concatenate([outside, [lip], inner[::-1]])


def _wine(outside: Array, thickness: float, level: float) -> Array:
    """The profile of a vessel's filling. It reaches into the wall, so that no air is between."""
    wet = _inside(outside, 0.6 * thickness)
    wet = wet[wet[:, 1] < level]
    return np.concatenate([wet, [[wet[-1, 0], level]]])


def candle(scene: Scene) -> None:
    """A burning candle on a chamberstick, with wax that ran down."""
    model = Model(scene)
    _chamberstick(model)
    for degrees, top, bottom in points(DRIPS):
        drip = polar(0.0108, np.radians(degrees), np.linspace(top, bottom, 9))
        heights = [bottom, bottom + 0.006, top]
        radii = np.interp(drip[:, 2], heights, [0.0026, 0.0021, 0.0012])
        model.add(scene.tube(drip, radii, 8), "Wax")
        model.add(scene.ball(0.0026, 10), "Wax", drip[-1])
    mesh = model.mesh("Candle", np.radians(60))
    x = 0.005
    y = 0.2
    place("Candle", mesh, transform((x, y, 0), (0, 0, 0.9)))
    point_light("Candle light", (x, y, 0.186), 0.8, (1.0, 0.58, 0.24), 0.006)


def _chamberstick(candle: Model) -> None:
    """The brass stick, the wax, the wick, and the flame."""
    candle.lathe(
        profile=[
            (0.044, 0),
            (0.055, 0.004),
            (0.06, 0.01),
            (0.0585, 0.0115),
            (0.05, 0.0065),
            (0.02, 0.006),
            (0.0135, 0.009),
            (0.0105, 0.02),
            (0.0125, 0.03),
            (0.0165, 0.034),
            (0.0165, 0.0365),
            (0.012, 0.037),
        ],
        material="Brass",
    )
    candle.ring(
        radius=0.013, thickness=0.0024, at=(0.068, 0, 0.0158), turned=(90, 0, 0), material="Brass"
    )
    candle.lathe(
        profile=[
            (0.0108, 0.034),
            (0.011, 0.15),
            (0.0112, 0.162),
            (0.0102, 0.1655),
            (0.0085, 0.1635),
            (0.004, 0.1615),
        ],
        material="Wax",
    )
    candle.bend(
        radius=0.0008, path=[(0, 0, 0.161), (0.0004, 0, 0.167), (0.0018, 0, 0.172)], material="Wick"
    )
    candle.lathe(
        profile=[
            (0.0006, 0.166),
            (0.0042, 0.171),
            (0.0056, 0.178),
            (0.0048, 0.187),
            (0.0024, 0.198),
            (0.0003, 0.209),
        ],
        material="Flame",
    )


def bowl(scene: Scene) -> None:
    """Porcelain with cobalt bands outside."""
    outside = smooth_path(BOWL, scene.segments(60, 16))
    shape = scene.lathe(_wall(outside, 0.0032), 96)
    x, y, z = shape.vertices[shape.quads].mean(axis=1).T
    outer = np.interp(z, outside[:, 1], outside[:, 0]) - np.hypot(x, y) < 0.001
    bands = ((z > 0.0565) & (z < 0.0615)) | ((z > 0.018) & (z < 0.0205))
    slots = np.append(bands & outer, np.zeros(len(shape.triangles))).astype(np.int32)
    matrix = transform((0.045, -0.035, 0.0045))
    scene.add("Bowl", shape._replace(slots=slots), "Porcelain", "Cobalt", matrix=matrix)


def knife(scene: Scene) -> None:
    """A silver fruit knife with an ebony handle."""
    matrix = transform((0.015, -0.2, 0.0075), np.radians((4, 0, 12)))
    model = Model(scene)
    model.prism(
        height=0.0016,
        outline=[
            (0, -0.008),
            (0.1, -0.0085),
            (0.128, -0.005),
            (0.142, 0.0055),
            (0.12, 0.008),
            (0, 0.0075),
        ],
        material="Silver",
    )
    model.lathe(
        profile=[(0.0062, 0), (0.007, 0.003), (0.0062, 0.006)],
        at=(0, 0, 0.0008),
        turned=(0, -90, 0),
        material="Silver",
    )
    model.lathe(
        profile=[(0.0058, 0.005), (0.0072, 0.03), (0.0066, 0.06), (0.0082, 0.085), (0.004, 0.092)],
        turned=(0, -90, 0),
        material="Ebony",
    )
    place("Knife", model.mesh("Knife"), matrix)
