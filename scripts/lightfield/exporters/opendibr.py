"""Writes what OpenDIBR plays: a JSON of cameras, and for each its colour and normalised disparity.

Both are PNG (8 and 16 bit) or H.265 (10 and 12 bit, lossless). Depth is Z for perspective views and
distance for fisheyes and panoramas. Poses are in OpenGL's axes, y up: world coordinates (x, y, z)
are (x, z, −y) there. Source: OpenDIBR's ioHelper.h and vertex.fs.
"""

import math
import shutil
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras, yuv
from lightfield.export.disparity import FARTHEST, Farther, depth_range, levels
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, Developed, odd_size_refusal
from lightfield.geometry.depth import conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import matrix_to_euler
from lightfield.imaging import images

# Rows: the axes of OpenGL's world in ours.
_TO_OPENGL = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
# Bits of colour and of depth.
_BITS = {"png": (8, 16), "h265": (10, 12)}


class OpenDibr(Developed):
    """The views and list that OpenDIBR plays."""

    name = "opendibr"
    summary = "Views for OpenDIBR."
    rank = 5
    loader = "./RealtimeDIBR -i {} -j {}/cameras.json"

    format: Literal["png", "h265"] = Field(
        "png", description="Form of the colour and disparity images. h265 needs ffmpeg."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant):
            if lens.center != (lens.width / 2, lens.height / 2):
                return "has its axis off centre, which OpenDIBR's fisheye cannot have"
        elif not isinstance(lens, Rectilinear | Equirectangular):
            return f"has a lens that OpenDIBR lacks; {TO_RECTILINEAR}, equidistant or a panorama"
        if self.format == "h265" and shutil.which("ffmpeg") is None:
            return "becomes H.265, for which ffmpeg must be installed; or give format: png"
        refusal = odd_size_refusal(lens) if self.format == "h265" else None
        return refusal or (None if has_depth else NO_DEPTH)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        lens = source.lens
        meaning = conventional_depth(lens)
        colour_bits, depth_bits = _BITS[self.format]
        suffix = ".png" if self.format == "png" else ".mp4"
        views = source.lightfield.views
        camera_entries: list[dict[str, Any]] = [viewport(source.lightfield.world_from_cameras)]
        farther = Farther()
        progress = Progress(len(views), "opendibr", "views")
        for view in views:
            depth = source.depth(view, meaning)
            farther.count(depth)
            limits = depth_range(depth)
            disparity = levels(depth, limits, depth_bits, 0)
            names = [f"{view.name}_{kind}{suffix}" for kind in ("texture", "depth")]
            texture = folder / names[0]
            depth_map = folder / names[1]
            if self.format == "png":
                source.write_image(view, texture)
                images.write_png(depth_map, disparity)
            else:
                size = (lens.width, lens.height)
                frame = yuv.of_colour(source.encoded(view), colour_bits)
                yuv.write_hevc(texture, frame, size, colour_bits)
                yuv.write_hevc(depth_map, yuv.of_levels(disparity, depth_bits), size, depth_bits)
            camera_entries.append(
                {
                    "NameColor": names[0],
                    "NameDepth": names[1],
                    **pose(view.world_from_camera),
                    "Depth_range": list(limits),
                    "Resolution": [lens.width, lens.height],
                    **projection(lens),
                    "BitDepthColor": colour_bits,
                    "BitDepthDepth": depth_bits,
                }
            )
            progress.done()
        farther.report(folder)
        write_json(folder / "cameras.json", {"Axial_system": "OPENGL", "cameras": camera_entries})


def pose(world_from_camera: Floats) -> dict[str, list[float]]:
    """Return the keys of a camera-to-world matrix (4, 4): metres, and XYZ Euler degrees."""
    angles = matrix_to_euler(_TO_OPENGL @ world_from_camera[:3, :3])
    return {
        "Position": (_TO_OPENGL @ world_from_camera[:3, 3]).tolist(),
        "Rotation": np.degrees(angles).tolist(),
    }


def projection(lens: Lens) -> dict[str, Any]:
    """Return the keys of a lens. A panorama's longitudes are positive to the left."""
    if isinstance(lens, Rectilinear):
        focal = list(cameras.focal_pixels(lens))
        return {"Projection": "Perspective", "Focal": focal, "Principle_point": list(lens.center)}
    if isinstance(lens, Equirectangular):
        west, east = np.degrees(lens.longitude)
        return {
            "Projection": "Equirectangular",
            "Hor_range": [float(-east), float(-west)],
            "Ver_range": np.degrees(lens.latitude).tolist(),
        }
    assert isinstance(lens, Equidistant)
    return {"Projection": "Fisheye_Equidistant", "Fov": math.degrees(lens.fov)}


def viewport(world_from_cameras: Floats) -> dict[str, Any]:
    """Return the viewport at the start: the mean of the positions, the first view's rotation."""
    middle = world_from_cameras[0].copy()
    middle[:3, 3] = world_from_cameras[:, :3, 3].mean(axis=0)
    return {
        "NameColor": "viewport",
        **pose(middle),
        "Depth_range": [0.1, FARTHEST],
        "Resolution": [1920, 1080],
        "Projection": "Perspective",
        "Focal": [960.0, 960.0],
        "Principle_point": [960.0, 540.0],
    }
