"""Writes what OpenDIBR plays: a JSON of cameras, and for each its colour and normalised disparity.

Both are PNG (8 and 16 bit) or H.265 (10 and 12 bit, lossless). Depth is Z for perspective views and
distance for fisheyes and panoramas. Poses are in OpenGL's axes, y up: world coordinates (x, y, z)
are (x, z, −y) there. A camera has one range of depth for all frames of a video. Source: OpenDIBR's
ioHelper.h, NvDecoder.cpp and vertex.fs.
"""

import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import cameras, yuv
from lightfield.export.disparity import FARTHEST, DisparityFrames, Farther
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, Developed, odd_size_refusal
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import matrix_to_euler
from lightfield.imaging import images

# Rows: the axes of OpenGL's world in ours.
TO_OPENGL = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
# Suffix, bits of colour, and bits of depth.
_PICTURES = {"png": (".png", 8, 16), "h265": (".mp4", 10, 12)}
LOADER = "./RealtimeDIBR -i {} -j {}/cameras.json"


class OpenDibrViews(Developed):
    """The options of exports that OpenDIBR plays."""

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant):
            if lens.center != (lens.width / 2, lens.height / 2):
                return "has its axis off centre, which OpenDIBR's fisheye cannot have"
        elif not isinstance(lens, Rectilinear | Equirectangular):
            return f"has a lens that OpenDIBR lacks; {TO_RECTILINEAR}, equidistant or a panorama"
        return None if has_depth else NO_DEPTH

    def write_views(
        self,
        frames: Sequence[SourceDataset],
        pictures: Literal["png", "h265"],
        folder: Path,
        rate: float | None = None,
    ) -> list[dict[str, Any]]:
        """Write the views of the ``frames`` of still cameras into ``folder``. Return their entries.

        Several frames must be H.265, with ``rate`` of them a second.
        """
        suffix, *bits = _PICTURES[pictures]
        lightfield = frames[0].lightfield
        camera_entries: list[dict[str, Any]] = [viewport(lightfield.world_from_cameras)]
        farther = Farther()
        progress = Progress(len(lightfield.views), self.name, "views")
        for view in lightfield.views:
            disparity = DisparityFrames(frames, view, farther)
            texture, depth_map = (f"{view.name}_{kind}{suffix}" for kind in ("texture", "depth"))
            if pictures == "png":
                frames[0].write_image(view, folder / texture)
                (levels,) = disparity.levels(bits[1], 0)
                images.write_png(folder / depth_map, levels)
            else:
                _write_videos(frames, view, disparity, rate, folder / texture, folder / depth_map)
            camera_entries.append(
                {
                    "NameColor": texture,
                    "NameDepth": depth_map,
                    **pose(view.world_from_camera),
                    "Depth_range": list(disparity.limits),
                    "Resolution": [lightfield.lens.width, lightfield.lens.height],
                    **projection(lightfield.lens),
                    "BitDepthColor": bits[0],
                    "BitDepthDepth": bits[1],
                }
            )
            progress.done()
        farther.report(folder)
        write_json(folder / "cameras.json", {"Axial_system": "OPENGL", "cameras": camera_entries})
        return camera_entries[1:]


class OpenDibr(OpenDibrViews):
    """The views and list that OpenDIBR plays."""

    name = "opendibr"
    summary = "Views for OpenDIBR."
    rank = 5
    loader = LOADER

    format: Literal["png", "h265"] = Field(
        "png", description="Form of the colour and disparity images. h265 needs ffmpeg."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        refusal = super().refusal(lens, has_depth)
        if self.format == "png" or refusal:
            return refusal
        return odd_size_refusal(lens) or hevc_refusal("; or give format: png")

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        self.write_views([source], self.format, folder)


def hevc_refusal(remedy: str = "") -> str | None:
    """Return why no H.265 can be written, with another ``remedy``. None if it can."""
    if shutil.which("ffmpeg") is None:
        return f"becomes H.265, for which ffmpeg must be installed{remedy}"
    return None


def _write_videos(
    frames: Sequence[SourceDataset],
    view: View,
    disparity: DisparityFrames,
    rate: float | None,
    texture: Path,
    depth_map: Path,
) -> None:
    """Write the colour and the disparity of a view in all ``frames`` as H.265."""
    _, colour_bits, depth_bits = _PICTURES["h265"]
    size = (frames[0].lens.width, frames[0].lens.height)
    colours = (yuv.of_colour(frame.encoded(view), colour_bits) for frame in frames)
    yuv.write_hevc(texture, colours, size, colour_bits, rate)
    depths = (yuv.of_levels(levels, depth_bits) for levels in disparity.levels(depth_bits, 0))
    yuv.write_hevc(depth_map, depths, size, depth_bits, rate)


def pose(world_from_camera: Floats) -> dict[str, list[float]]:
    """Return the keys of a camera-to-world matrix (4, 4): metres, and XYZ Euler degrees."""
    angles = matrix_to_euler(TO_OPENGL @ world_from_camera[:3, :3])
    return {
        "Position": (TO_OPENGL @ world_from_camera[:3, 3]).tolist(),
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
