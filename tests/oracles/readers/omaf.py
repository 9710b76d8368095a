"""The keys of a camera that OpenDIBR and MIV share.

Depth maps hold normalised disparity between the ends of ``Depth_range``. It is that of Z for
perspective views, and that of distance for all others.
"""

import math
from typing import Any

from lightfield.export.disparity import FARTHEST
from oracles.readers.cameras import Camera, OpenCVFisheye, Panorama, Pinhole
from oracles.readers.contents import DepthRange, number, numbers


def lens_of(camera: dict[str, Any]) -> Camera:
    """Return a camera's lens. A panorama's longitudes are positive to the left."""
    width, height = (int(side) for side in numbers(camera["Resolution"], (2,)))
    projection = camera["Projection"]
    if projection == "Perspective":
        fx, fy = numbers(camera["Focal"], (2,)).tolist()
        cx, cy = numbers(camera["Principle_point"], (2,)).tolist()
        return Pinhole(width, height, fx, fy, cx, cy)
    if projection == "Equirectangular":
        right_end, left_end = map(math.radians, numbers(camera["Hor_range"], (2,)).tolist())
        south, north = map(math.radians, numbers(camera["Ver_range"], (2,)).tolist())
        return Panorama(width, height, -left_end, -right_end, north, south)
    if projection == "Fisheye_Equidistant":
        fov = math.radians(number(camera["Fov"]))
        return OpenCVFisheye(width, height, width / fov, height / fov, width / 2, height / 2)
    raise ValueError(f"Projection: {projection!r} is not a projection of it")


def depth_range_of(place: str, view: str, camera: dict[str, Any]) -> DepthRange:
    """Return the range of a camera's depth map."""
    near, far = numbers(camera["Depth_range"], (2,)).tolist()
    meaning = "z" if camera["Projection"] == "Perspective" else "distance"
    return DepthRange(f"{place}: Depth_range", view, near, far, meaning, FARTHEST)
