"""Writes views of a scene whose points are all known: the inside of a sphere, or a ball in it.

A point's colour follows from its place.
"""

import json

import numpy as np

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import images
from lightfield.imaging.tonemap import decode_srgb, to_8_bit

RADIUS = 3.0
BALL, BALL_RADIUS = np.array([0.0, 1.8, 0.0]), 0.5
RED = np.array([0.8, 0.05, 0.05])

# A camera of each kind of lens that a consumer reads, with few pixels.
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 70, "resolution": [64, 48]},
    "shifted": {
        "lens": "rectilinear",
        "focal_length": 20,
        "sensor_size": [36, 30],
        "principal_point": [29.5, 26.25],
        "resolution": [64, 48],
    },
    "fisheye": {"lens": "equidistant", "fov": 170, "resolution": [64, 60]},
    "opencv": {
        "lens": "kannala_brandt",
        "focal_length": 9,
        "coefficients": [0.02, -0.01, 0.003, -0.001],
        "fov": 150,
        "resolution": [64, 64],
    },
    "wide": {"lens": "equidistant", "fov": 220, "resolution": [64, 64]},
    "panorama": {"lens": "equirectangular", "resolution": [64, 32]},
    "half": {"lens": "equirectangular", "longitude": [-90, 90], "resolution": [32, 32]},
    # Neither side of it mirrors the other.
    "left": {
        "lens": "equirectangular",
        "longitude": [-130, 50],
        "latitude": [-40, 70],
        "resolution": [36, 22],
    },
}
# Calibrated cameras of which COLMAP has a model, with the model's name.
CALIBRATED = {
    "OPENCV": {"lens": "brown_conrady", "coefficients": [-0.2, 0.05, 0.004, -0.003]},
    "FULL_OPENCV": {
        "lens": "brown_conrady",
        "coefficients": [0.3, 0.05, 0.004, -0.003, 0.01, 0.5, 0.04, 0.002],
    },
    "FOV": {"lens": "fov_model", "coefficients": [0.9]},
    "DIVISION": {"lens": "division", "coefficients": [-0.3]},
    "EUCM": {"lens": "extended_unified", "coefficients": [0.6, 1.1]},
    "THIN_PRISM_FISHEYE": {
        "lens": "thin_prism_fisheye",
        "coefficients": [-0.02, 0.01, 0.004, -0.003, 0.002, -0.001, 0.005, -0.004],
    },
    "RAD_TAN_THIN_PRISM_FISHEYE": {
        "lens": "fisheye624",
        "coefficients": [
            *(-0.03, 0.05, -0.03, 0.006, 0.002, -0.001),
            *(0.004, -0.003, 0.003, -0.001, -0.004, 0.001),
        ],
    },
}
for _camera in CALIBRATED.values():
    _camera |= {
        "focal_length": 22,
        "sensor_size": [36, 25],
        "principal_point": [30.5, 25.25],
        "resolution": [64, 48],
    }


def enlarged(camera, factor):
    """Return a camera with ``factor`` times the pixels along each side."""
    pixels = {key: camera[key] for key in ("resolution", "principal_point") if key in camera}
    return camera | {key: [factor * side for side in pair] for key, pair in pixels.items()}


def colour_of(points):
    """The sRGB colour, 0 to 255, of places on the sphere."""
    return 40 + 175 * (points / RADIUS / 2 + 0.5)


def look(lens, matrix):
    """Return linear colour, and distance, of what a camera inside the sphere sees."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    along = (rays * matrix[:3, 3]).sum(axis=-1)
    distance = -along + np.sqrt(along**2 + RADIUS**2 - matrix[:3, 3] @ matrix[:3, 3])
    colour = decode_srgb(colour_of(matrix[:3, 3] + rays * distance[..., None]) / 255)
    return np.nan_to_num(colour), distance


def make_transparent(folder, alpha):
    """Say that a scene covers this part of all pixels of the views in ``folder``."""
    path = folder / "lightfield.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"render": {"transparent": True}}))
    for view in [*folder.glob("*.exr"), *folder.glob("exr/*.exr")]:
        image = images.read_image(view)
        covered = np.full(image.channels["Z"].shape, alpha, np.float16)
        images.write_exr(view, image.channels | {"A": covered}, image.attributes)


def look_at_ball(lens, matrix, place=BALL):
    """Return linear colour, and distance, that a camera sees of the sphere with a ball in it."""
    colour, distance = look(lens, matrix)
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    to_ball = place - matrix[:3, 3]
    along = rays @ to_ball
    with np.errstate(invalid="ignore"):
        nearest = along - np.sqrt(BALL_RADIUS**2 - (to_ball @ to_ball - along**2))
        hit = nearest > 0
    return np.where(hit[..., None], RED, colour), np.where(hit, nearest, distance)


def look_at_ball_alone(lens, matrix):
    """Return what a camera sees of the ball before an empty background."""
    colour, distance = look_at_ball(lens, matrix)
    ball = (colour == RED).all(axis=-1)
    return np.where(ball[..., None], colour, 0), np.where(ball, distance, np.inf)


def write_views(folder, camera, rig, suffix=".exr", see=look):
    lens = lenses.from_camera(camera)
    depth = "z" if lens.has_z_depth else "distance"
    lightfield = LightField.from_rig(rig, lens, depth=depth)
    images_folder = folder / "exr" if folder.name == "dataset" else folder
    images_folder.mkdir(parents=True)
    lightfield.write(folder / "lightfield.json")
    for view in lightfield.views:
        colour, distance = see(lens, view.world_from_camera)
        z = z_from_distance(distance, lens.pixel_rays()) if depth == "z" else distance
        channels = {name: colour[..., i].astype(np.float16) for i, name in enumerate("RGB")}
        if suffix == ".png":
            alpha = np.isfinite(distance).astype(np.uint8)[..., None] * 255
            pixels = np.concatenate([to_8_bit(colour.astype(np.float32)), alpha], axis=-1)
            images.write_png(images_folder / f"{view.name}.png", pixels)
        else:
            attributes = {images.DEPTH_ATTRIBUTE: depth}
            channels["Z"] = z.astype(np.float32)
            images.write_exr(images_folder / f"{view.name}.exr", channels, attributes)
