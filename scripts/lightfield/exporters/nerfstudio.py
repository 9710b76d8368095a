"""Writes a nerfstudio dataset: perspective views, fisheyes past 180° too, and full panoramas.

- ``transforms.json``: camera-to-world matrices as in lightfield.json (OpenGL axes, Z up), and a
  list of files for each part.
- ``images/``: the views.
- ``masks/``: 0 means ignored. Either all frames have a mask, or none.
- ``depths/``: 16-bit millimetres, if the settings ask for them. Z for perspective views. Distance
  for all others, whose rays have unit length in nerfstudio. 0 for none, and beyond 65.535 m. The
  unit is an option of nerfstudio's parser, which no file can set.
- ``points.ply``: a point cloud.

Splatfacto treats every camera as a pinhole: give it perspective views. Brush reads the same files,
and refuses panoramas. Sources: nerfstudio's nerfstudio_dataparser.py and cameras.py,
and formats/nerfstudio.rs of Brush 1.0.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from lightfield.core.files import write_json
from lightfield.export import cameras
from lightfield.export.pictures import write_pictures
from lightfield.export.points import lift, write_ply
from lightfield.export.source import DepthMaps, SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import (
    NO_DEPTH,
    TO_RECTILINEAR,
    ForTraining,
    PointCount,
    sideways_refusal,
)
from lightfield.geometry.depth import conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear

POINT_CLOUD = "points.ply"
# In metres.
_DEPTH_UNIT = 0.001


class Nerfstudio(ForTraining):
    """A nerfstudio dataset, for nerfstudio and Brush."""

    name = "nerfstudio"
    summary = "Dataset for nerfstudio and Brush."
    rank = 3
    loader = (
        "ns-train nerfacto --data {} nerfstudio-data --orientation-method none "
        "--center-method none --auto-scale-poses False"
    )
    chooses_tests = True
    needs_surfaces = True

    points: PointCount = Field(50000, description="Largest number of points in the point cloud.")
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")
    # This changes no file.
    splatfacto: bool = Field(
        False, exclude=True, description="Whether to refuse lenses that splatfacto cannot train on."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        # splatfacto undistorts OPENCV.
        if self.splatfacto and not isinstance(lens, Rectilinear | BrownConrady):
            return f"would be taken for a pinhole by splatfacto; {TO_RECTILINEAR}"
        if isinstance(lens, BrownConrady):
            if cameras.has_denominator(lens):
                return f"has k4 to k6, which nerfstudio lacks; {TO_RECTILINEAR}"
        elif isinstance(lens, Fisheye624):
            if refusal := sideways_refusal(lens, "nerfstudio's FISHEYE624"):
                return refusal
        elif isinstance(lens, Equidistant | KannalaBrandt):
            has_pixel_on_axis = lens.center[0] % 1 == 0.5 and lens.center[1] % 1 == 0.5
            if has_pixel_on_axis:
                return "has a pixel on its optical axis, which is NaN to nerfstudio; use even sizes"
        elif isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; nerfstudio takes whole ones; {TO_RECTILINEAR}"
        elif not isinstance(lens, Rectilinear):
            return f"has a lens that nerfstudio lacks; {TO_RECTILINEAR}, equidistant or a panorama"
        return NO_DEPTH if self.depth and not has_depth else None

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        views = source.lightfield.views
        # These rays have length 1 along the axis.
        has_z_rays = isinstance(source.lens, BrownConrady | Fisheye624)
        meaning = "z" if has_z_rays else conventional_depth(source.lens)
        if isinstance(source.lens, BrownConrady) and cameras.distortion(source.lens)["k3"]:
            print(
                f"warning: {source.lightfield.path}: camera: has k3, which Brush leaves out; give "
                "Brush the export colmap",
                file=sys.stderr,
            )
        masked = any(not source.valid(view).all() for view in views)
        frames = []
        depth_maps = DepthMaps(_DEPTH_UNIT)
        for view, _ in write_pictures(
            source,
            folder,
            "nerfstudio",
            picture="images/{}.png",
            mask="masks/{}.png",
            mask_all=masked,
        ):
            name = f"{view.name}.png"
            frame: dict[str, Any] = {
                "file_path": f"images/{name}",
                "transform_matrix": view.world_from_camera.tolist(),
            }
            if masked:
                frame["mask_path"] = f"masks/{name}"
            if self.depth:
                frame["depth_file_path"] = f"depths/{name}"
                depth_maps.write(folder / "depths" / name, source.depth(view, meaning))
            frames.append(frame)
        depth_maps.report(folder)
        parts = splits(source.lightfield)
        write_ply(folder / POINT_CLOUD, lift(source, count=self.points))
        paths = {view.name: frame["file_path"] for view, frame in zip(views, frames, strict=True)}
        lists = {"train": parts.train, "val": parts.validation, "test": parts.test}
        content = {
            **camera(source.lens),
            "applied_transform": np.eye(4)[:3].tolist(),
            "ply_file_path": POINT_CLOUD,
        }
        for part, part_views in lists.items():
            content[f"{part}_filenames"] = [paths[view.name] for view in part_views]
        content["frames"] = frames
        write_json(folder / "transforms.json", content)


def camera(lens: Lens) -> dict[str, Any]:
    """Return the keys that describe a lens to nerfstudio."""
    size = {"w": lens.width, "h": lens.height}
    if isinstance(lens, Equirectangular):
        focal = {"fl_x": lens.width / 2, "fl_y": float(lens.height)}
        return {"camera_model": "EQUIRECTANGULAR", **focal, **_center(lens), **size}
    if isinstance(lens, Rectilinear):
        fx, fy = cameras.focal_pixels(lens)
        # nerfstudio takes OPENCV without distortion for PINHOLE, which Brush does not read.
        undistorted = dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
        focal = {"fl_x": fx, "fl_y": fy}
        return {"camera_model": "OPENCV", **focal, **_center(lens), **size, **undistorted}
    if isinstance(lens, BrownConrady):
        fx, fy = cameras.focal_pixels(lens)
        names = ("k1", "k2", "k3", "p1", "p2")
        distortion = {name: cameras.distortion(lens)[name] for name in names}
        focal = {"fl_x": fx, "fl_y": fy}
        return {"camera_model": "OPENCV", **focal, **_center(lens), **size, **distortion}
    if isinstance(lens, Fisheye624):
        fx, fy = cameras.focal_pixels(lens)
        focal = {"fl_x": fx, "fl_y": fy}
        parameters = {"distortion_params": list(lens.coefficients)}
        return {"camera_model": "FISHEYE624", **focal, **_center(lens), **size, **parameters}
    fx, fy, *radial = cameras.opencv_fisheye(lens)
    named = {f"k{number}": value for number, value in enumerate(radial, 1)}
    focal = {"fl_x": fx, "fl_y": fy}
    return {"camera_model": "OPENCV_FISHEYE", **focal, **_center(lens), **size, **named}


def _center(lens: Lens) -> dict[str, float]:
    return {"cx": lens.center[0], "cy": lens.center[1]}
