"""Writes a dataset for LichtFeld Studio: perspective views, fisheyes and full panoramas.

- ``transforms.json``: camera-to-world matrices as in lightfield.json (OpenGL axes, Z up).
- ``images/``: the views as 8-bit PNG, or the EXR views themselves.
- ``masks/``: 0 means ignored. Only for views with pixels that show nothing.
- ``depth/``: 16-bit Z, if the settings ask for it. The farthest point of a view has 65535. 0 for
  none. LichtFeld fits the scale of each view.
- ``normals/``: 8-bit (n + 1) / 2 in the camera's axes, x right, y down and z forward, if the
  settings ask for it. Grey for none.
- ``points.ply``: a point cloud.
- ``train.txt``, ``test.txt``: the names of the images to train and to test with.

LichtFeld finds masks, depth and normals by the image's name without its suffix. Source: LichtFeld
Studio's transforms.cpp, blender_loader.cpp, filesystem_utils.hpp and image_exr.cpp.
"""

from functools import partial
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lightfield.core.files import link_or_copy, write_json, write_text
from lightfield.export import cameras
from lightfield.export.pictures import normal_colours, write_pictures
from lightfield.export.points import lift, write_ply
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import (
    NO_DEPTH,
    NOT_EXR,
    TO_RECTILINEAR,
    ForTraining,
    PointCount,
    sideways_refusal,
)
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images

POINT_CLOUD = "points.ply"
MOST = np.iinfo(np.uint16).max


class LichtFeld(ForTraining):
    """A dataset for LichtFeld Studio."""

    name = "lichtfeld"
    summary = "Dataset for LichtFeld Studio."
    rank = 10
    loader = "LichtFeld-Studio --data-path {} --output-path output"
    chooses_tests = True
    needs_surfaces = True

    format: Literal["png", "exr"] = Field(
        "png", description="Format of the images. exr keeps linear light, for HDR training."
    )
    points: PointCount = Field(50000, description="Largest number of points in the point cloud.")
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")
    normals: bool = Field(
        False, description="Also write normals. The source must have the pass normal."
    )

    @model_validator(mode="after")
    def _look_is_of_png(self) -> Self:
        if self.look and self.format == "exr":
            raise ValueError("look: is only for format png; an EXR keeps the light")
        return self

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("normal",) if self.normals else ()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant | KannalaBrandt):
            if refusal := sideways_refusal(lens, "LichtFeld's"):
                return refusal
            if isinstance(lens, KannalaBrandt) and lens.coefficients[3] != 0:
                return "has a fourth coefficient, which LichtFeld drops; reproject to equidistant"
        elif isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; LichtFeld takes whole ones; {TO_RECTILINEAR}"
            if self.depth:
                return "is a panorama, which has no depth along an axis; leave out depth: true"
        elif not isinstance(lens, Rectilinear):
            return f"has a lens that LichtFeld lacks; {TO_RECTILINEAR}, equidistant or a panorama"
        if self.format == "exr" and not has_depth:
            return NOT_EXR
        return NO_DEPTH if self.depth and not has_depth else None

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        views = sorted(source.lightfield.views, key=lambda view: view.name)
        suffix = f".{self.format}"
        frames = []
        picture = f"images/{{}}{suffix}"
        for view, _ in write_pictures(
            source,
            folder,
            "lichtfeld",
            picture=picture,
            mask="masks/{}.png",
            views=views,
            write=partial(_write_exr, source) if self.format == "exr" else None,
        ):
            if self.depth:
                images.write_png(folder / "depth" / f"{view.name}.png", _depth(source, view))
            if self.normals:
                images.write_png(
                    folder / "normals" / f"{view.name}.png", normal_colours(source, view)
                )
            path = picture.format(view.name)
            frames.append({"file_path": path, "transform_matrix": view.world_from_camera.tolist()})
        write_ply(folder / POINT_CLOUD, lift(source, count=self.points))
        parts = splits(source.lightfield)
        for part, part_views in (("train", parts.train), ("test", parts.test)):
            names = "".join(f"{view.name}{suffix}\n" for view in part_views)
            write_text(folder / f"{part}.txt", names)
        content = {**camera(source.lens), "ply_file_path": POINT_CLOUD, "frames": frames}
        write_json(folder / "transforms.json", content)


def camera(lens: Lens) -> dict[str, Any]:
    """Return the keys that describe a lens to LichtFeld."""
    size = {"w": lens.width, "h": lens.height}
    if isinstance(lens, Equirectangular):
        return {"camera_model": "EQUIRECTANGULAR", **size}
    center = {"cx": lens.center[0], "cy": lens.center[1]}
    if isinstance(lens, Rectilinear):
        fx, fy = cameras.focal_pixels(lens)
        return {"camera_model": "PINHOLE", "fl_x": fx, "fl_y": fy, **center, **size}
    fx, fy, k1, k2, k3, _ = cameras.opencv_fisheye(lens)
    distortion = {"k1": k1, "k2": k2, "k3": k3}
    focal = {"fl_x": fx, "fl_y": fy}
    return {"camera_model": "OPENCV_FISHEYE", **focal, **center, **size, **distortion}


def _write_exr(source: SourceDataset, view: View, target: Path) -> None:
    """Make a hard link to an EXR. If it stores other pixels than it shows, write what it shows."""
    path = source.path(view)
    if images.read_header(path).window.is_stored_whole:
        link_or_copy(path, target)
        return
    shown = images.read_image(path)
    colour = {name: plane for name, plane in shown.channels.items() if name in "RGBA"}
    images.write_exr(target, colour, chromaticities=shown.chromaticities)


def _depth(source: SourceDataset, view: View) -> np.ndarray[Any, np.dtype[np.uint16]]:
    """Return a view's Z (h, w) in steps of the farthest surface / 65535. 0 for none."""
    depth = source.depth(view, "z")
    has_depth = np.isfinite(depth) & (depth > 0)
    farthest = float(np.max(depth, where=has_depth, initial=0))
    if farthest == 0:
        return np.zeros(depth.shape, np.uint16)
    # A surface that rounds to 0 would have none.
    steps = np.maximum(np.round(depth / farthest * MOST), 1)
    return np.where(has_depth, steps, 0).astype(np.uint16)
