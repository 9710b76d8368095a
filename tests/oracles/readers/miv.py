"""A sequence of MPEG immersive video, read as TMIV does its sequence configurations.

Axes are OMAF's: a camera has x forward, y left, z up; its rotation is yaw, pitch and roll in
degrees, Rz · Ry · Rx. The world is that of lightfield.json.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from lightfield.geometry.rotations import euler_to_matrix
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Floats,
    development,
    numbers,
)
from oracles.readers.omaf import depth_range_of, lens_of

# Columns: the axes of lightfield.json's camera in OMAF's.
_CAMERA = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
# A frame of YUV 4:2:0 has one and a half samples a pixel, of two bytes.
_BYTES_A_PIXEL = 3


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the sequence.json of an export."""
    path = listing.parent / "sequence.json"
    exported = Exported()
    with reading(path, "sequence of MIV"):
        content = read_json(path)
        names = [str(camera["Name"]) for camera in content["cameras"]]
        if content["sourceCameraNames"] != names:
            exported.faults.append(f"{path}: sourceCameraNames: are not those of its cameras")
        exported.expect(f"{path}: Version", content["Version"], "3.0")
        exported.expect(f"{path}: lengthsInMeters", content["lengthsInMeters"], True)
        for index, camera in enumerate(content["cameras"]):
            place = f"cameras[{index}]"
            with reading(f"{path}: {place}", "camera"):
                where = f"{path}: {place} ({names[index]})"
                exported.views.append(ExportedView(path, place, names[index], _matrix(camera)))
                exported.cameras.append(ExportedCamera(where, lens_of(camera)))
                exported.ranges.append(depth_range_of(where, names[index], camera))
                exported.expect(f"{where}: HasInvalidDepth", camera["HasInvalidDepth"], True)
                _check_videos(where, listing.parent, camera, content["Frames_number"], exported)
                _add_pictures(listing.parent, camera, options, exported)
        middle = np.mean([view.world_from_camera[:3, 3] for view in exported.views], axis=0)
        center = content["BoundingBox_center"]
        exported.expect(f"{path}: BoundingBox_center", center, middle.tolist())
    return exported


def _matrix(camera: dict[str, Any]) -> Floats:
    """Return the camera-to-world matrix (4, 4)."""
    matrix = np.eye(4)
    yaw, pitch, roll = np.radians(numbers(camera["Rotation"], (3,)))
    matrix[:3, :3] = euler_to_matrix(np.array([roll, pitch, yaw])) @ _CAMERA
    matrix[:3, 3] = numbers(camera["Position"], (3,))
    return matrix


def _add_pictures(
    folder: Path, camera: dict[str, Any], options: dict[str, Any], exported: Exported
) -> None:
    """Add the texture and the depth of the camera that was read last. Level 0 means no depth."""
    width, height = camera["Resolution"]
    depth_range = exported.ranges[-1]
    for kind, bits in (("texture", camera["BitDepthColor"]), ("depth", camera["BitDepthDepth"])):
        exported.add_picture(
            folder / f"{camera['Name']}_{kind}_{width}x{height}_yuv420p{bits}le.yuv",
            depth_range.view,
            "luma" if kind == "texture" else "levels",
            meaning=depth_range.meaning,
            limits=(depth_range.near, depth_range.far),
            lowest=1,
            bits=bits,
            size=(width, height),
            development=development(options),
        )


def _check_videos(
    where: str, folder: Path, camera: dict[str, Any], frames: int, exported: Exported
) -> None:
    """Check that the videos of colour and depth exist, and have the camera's size."""
    width, height = camera["Resolution"]
    for kind, bits, space in (
        ("texture", "BitDepthColor", "ColorSpace"),
        ("depth", "BitDepthDepth", "DepthColorSpace"),
    ):
        exported.expect(f"{where}: {space}", camera[space], "YUV420")
        name = f"{camera['Name']}_{kind}_{width}x{height}_yuv420p{camera[bits]}le.yuv"
        path = folder / name
        if not path.is_file():
            exported.faults.append(f"{where}: {bits} or Resolution: there is no file {path}")
        else:
            expected = frames * width * height * _BYTES_A_PIXEL
            exported.expect(f"{path}: bytes", path.stat().st_size, expected)
