"""Reads the transforms.json of nerfstudio and of instant-ngp.

The centre of the first pixel is at (0.5, 0.5), as here. Sources: nerfstudio's
nerfstudio_dataparser.py and camera_utils.py; instant-ngp's nerf_loader.cu.
"""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

from lightfield.geometry.lenses.base import Pair
from lightfield.geometry.lenses.calibrations.base import Calibration, Hints, Keys, Reader, Size


def cameras(content: Mapping[str, Any]) -> dict[str, Reader]:
    """Return the cameras of a transforms.json: one, or one for each of its frames."""
    if any(key in content for key in ("fl_x", "camera_angle_x")):
        return {"": partial(_camera, Keys("", content))}
    frames = content.get("frames")
    if not isinstance(frames, list):
        return {}
    return {
        str(frame.get("file_path", index)): partial(
            _camera, Keys(f"frames[{index}].", {**content, **frame})
        )
        for index, frame in enumerate(frames)
        if isinstance(frame, Mapping) and "fl_x" in frame
    }


def _camera(keys: Keys, hints: Hints) -> Calibration:
    size = keys.size(hints, (), (("w", "h"),))
    name = keys.text("camera_model", _usual_model(keys))
    if name == "EQUIRECTANGULAR":
        return Calibration("equirectangular", size)
    focal_lengths = _focal_lengths(keys, size)
    center = keys.number("cx", size[0] / 2), keys.number("cy", size[1] / 2)
    if name == "FISHEYE624":
        coefficients = keys.numbers("distortion_params", 12)
        return Calibration("fisheye624", size, focal_lengths, center, coefficients)
    k1, k2, k3, k4, p1, p2 = (keys.number(key, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if name in ("OPENCV_FISHEYE", "FISHEYE"):
        if p1 or p2:
            raise keys.error("p1", f"must be 0, as p2: {name} has k1 to k4 alone")
        return Calibration("kannala_brandt", size, focal_lengths, center, (k1, k2, k3, k4))
    if name not in ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "RADIAL", "FULL_OPENCV"):
        raise keys.error("camera_model", f"is {name!r}, which is no lens of this program")
    if k4 or name == "FULL_OPENCV":
        # nerfstudio multiplies it by r⁸, and OpenCV has it in a denominator.
        raise keys.error("k4", "means different lenses in nerfstudio and in OpenCV; must be 0")
    coefficients = (k1, k2, p1, p2, k3, 0.0, 0.0, 0.0)
    return Calibration("brown_conrady", size, focal_lengths, center, coefficients)


def _usual_model(keys: Keys) -> str:
    """Return the camera model of a file that names none."""
    if key := keys.first(("ftheta_p0", "latlong", "equirectangular", "orthographic")):
        raise keys.error(key, "is a lens of instant-ngp that is not read here")
    return "OPENCV_FISHEYE" if keys.content.get("is_fisheye") is True else "OPENCV"


def _focal_lengths(keys: Keys, size: Size) -> Pair:
    if "fl_x" in keys.content:
        fx = keys.number("fl_x")
        return keys.focal_lengths("fl_x", fx, keys.number("fl_y", fx))
    angle = keys.number("camera_angle_x")
    if not 0 < angle < math.pi:
        raise keys.error("camera_angle_x", f"is {angle:g}; must be an angle of 0 to π in radians")
    fx = size[0] / 2 / math.tan(angle / 2)
    return fx, fx
