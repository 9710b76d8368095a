"""Views of a scene whose every point is known: the inside of a sphere around the origin.

Its colour follows from the place.
"""

import numpy as np

from lightfield.dataset.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import images
from lightfield.imaging.tonemap import decode_srgb, to_8_bit

RADIUS = 3.0


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


def write_views(folder, camera, rig, suffix=".exr"):
    lens = lenses.from_camera(camera)
    depth = "z" if lens.has_z_depth else "distance"
    lightfield = LightField.from_rig(rig, lens, depth=depth)
    images_folder = folder / "exr" if folder.name == "dataset" else folder
    images_folder.mkdir(parents=True)
    lightfield.write(folder / "lightfield.json")
    for view in lightfield.views:
        colour, distance = look(lens, view.matrix)
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
