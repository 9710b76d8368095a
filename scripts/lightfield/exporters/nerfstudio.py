"""Writes a nerfstudio dataset: perspective views, fisheyes past 180° too, and full panoramas.

- ``transforms.json``: camera-to-world matrices as in lightfield.json (OpenGL axes, Z up), and a
  list of files for each part. Each frame has its own intrinsics if there are several lenses.
- ``images/``: the views.
- ``masks/``: 0 means ignored. Either all frames have a mask, or none. With the key objects, all
  pixels are ignored that show none of these objects.
- ``depths/``: 16-bit millimetres, if the settings ask for them. Z for perspective views. Distance
  for all others, whose rays have unit length in nerfstudio. 0 for none, and beyond 65.535 m. The
  unit is an option of nerfstudio's parser, which no file can set.
- ``normals_from_pretrain/``: 8-bit (n + 1) / 2 in the camera's axes, x right, y down and z forward,
  if the settings ask for it. Grey for none. nerfstudio reads no normals. dn-splatter's parser
  normal-nerfstudio finds them here, in the natural order of their names. Its format omnidata, the
  default, has these axes: it turns them to nerfstudio's before it compares.
- ``points.ply``: a point cloud.

Splatfacto treats every camera as a pinhole: give it perspective views. Brush reads the same files,
and refuses panoramas. Sources: nerfstudio's nerfstudio_dataparser.py, pixel_samplers.py and
cameras.py; dn-splatter's normal_nerfstudio.py, dn_dataset.py and dn_model.py; and
formats/nerfstudio.rs of Brush 1.0.
"""

import re
import sys
from collections.abc import Callable
from operator import not_
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.export import cameras, heads
from lightfield.export.pictures import normal_colours, write_pictures
from lightfield.export.points import lift, write_ply
from lightfield.export.source import Bools, DepthMaps, SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.exporters.base import (
    NO_DEPTH,
    TO_RECTILINEAR,
    ForTraining,
    PointCount,
    sideways_refusal,
)
from lightfield.formats.lightfield import View
from lightfield.geometry.depth import conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images
from lightfield.settings.base import suggestion

POINT_CLOUD = "points.ply"
_MODELS: dict[type[Lens], str] = {
    # nerfstudio takes OPENCV without distortion for PINHOLE, which Brush does not read.
    Rectilinear: "OPENCV",
    BrownConrady: "OPENCV",
    Equidistant: "OPENCV_FISHEYE",
    KannalaBrandt: "OPENCV_FISHEYE",
    Fisheye624: "FISHEYE624",
    Equirectangular: "EQUIRECTANGULAR",
}
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
    # Settings and export.json have these two only if they are used, so that earlier exports keep
    # their bytes.
    normals: bool = Field(
        False,
        exclude_if=not_,
        description="Also write normals for dn-splatter. The source must have the pass normal.",
    )
    objects: list[str] | None = Field(
        None,
        min_length=1,
        exclude_if=not_,
        description="Names of the objects to train on. Masks exclude all other pixels. The source "
        "must have the pass object.",
    )
    # This changes no file.
    splatfacto: bool = Field(
        False, exclude=True, description="Whether to refuse lenses that splatfacto cannot train on."
    )

    @property
    def needed_passes(self) -> tuple[str, ...]:
        needed = {"normal": self.normals, "object": bool(self.objects)}
        return tuple(name for name, is_needed in needed.items() if is_needed)

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if self.normals and not isinstance(lens, Rectilinear):
            return f"has normals for dn-splatter, which takes it for a pinhole; {TO_RECTILINEAR}"
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
        elif type(lens) not in _MODELS:
            return f"has a lens that nerfstudio lacks; {TO_RECTILINEAR}, equidistant or a panorama"
        return NO_DEPTH if self.depth and not has_depth else None

    def joins(self, lens: Lens, other: Lens) -> bool:
        if lens == other:
            return True
        # nerfstudio has one camera model for all frames, which have their own parameters. But it
        # computes all rays of FISHEYE624 with the parameters of one of them.
        model = _MODELS.get(type(lens))
        return model == _MODELS.get(type(other)) and model != "FISHEYE624"

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        source = heads.by_camera(source)
        views = source.lightfield.views
        # These rays have length 1 along the axis.
        has_z_rays = isinstance(source.lens, BrownConrady | Fisheye624)
        meaning = "z" if has_z_rays else conventional_depth(source.lens)
        for lens, path in source.lenses.items():
            if isinstance(lens, BrownConrady) and lens.coefficients[4]:
                print(
                    f"warning: {path}: camera: has k3, which Brush leaves out; give Brush the "
                    "export colmap",
                    file=sys.stderr,
                )
        has_lenses = len(source.lenses) > 1
        counts = _counting(source, self.objects) if self.objects else source.valid
        masked = any(not counts(view).all() for view in views)
        if self.normals:
            _check_names(source)
        frames = []
        depth_maps = DepthMaps(_DEPTH_UNIT)
        for view, _ in write_pictures(
            source,
            folder,
            "nerfstudio",
            picture="images/{}.png",
            mask="masks/{}.png",
            mask_all=masked,
            counts=counts,
        ):
            name = f"{view.name}.png"
            frame: dict[str, Any] = {
                "file_path": f"images/{name}",
                "transform_matrix": view.world_from_camera.tolist(),
            }
            if has_lenses:
                frame |= _parameters(source.view(view).lens)
            if masked:
                frame["mask_path"] = f"masks/{name}"
            if self.depth:
                frame["depth_file_path"] = f"depths/{name}"
                depth_maps.write(folder / "depths" / name, source.depth(view, meaning))
            if self.normals:
                path = folder / "normals_from_pretrain" / name
                images.write_png(path, normal_colours(source, view))
            frames.append(frame)
        depth_maps.report(folder)
        parts = splits(source.lightfield)
        write_ply(folder / POINT_CLOUD, lift(source, count=self.points))
        paths = {view.name: frame["file_path"] for view, frame in zip(views, frames, strict=True)}
        lists = {"train": parts.train, "val": parts.validation, "test": parts.test}
        intrinsics = camera(source.lens)
        if has_lenses:
            intrinsics = {"camera_model": intrinsics["camera_model"]}
        content = {
            **intrinsics,
            "applied_transform": np.eye(4)[:3].tolist(),
            "ply_file_path": POINT_CLOUD,
        }
        for part, part_views in lists.items():
            content[f"{part}_filenames"] = [paths[view.name] for view in part_views]
        content["frames"] = frames
        write_json(folder / "transforms.json", content)


def _counting(source: SourceDataset, objects: list[str]) -> Callable[[View], Bools]:
    """Return a function with the pixels (height, width) of a view that show one of the objects.

    Raises `UserError` if the scene has no object of a name, or if no view shows any.
    """

    def counts(view: View) -> Bools:
        shown = source.view(view)
        numbers = shown.dataset.names("object")
        for name in objects:
            if name not in numbers:
                raise UserError(
                    f"{shown.dataset.lightfield.path}: its pass object has no {name!r}, which "
                    f"exports.nerfstudio.objects names{suggestion(name, numbers)}"
                )
        chosen = np.isin(shown.read("object"), [numbers[name] for name in objects])
        return np.asarray(chosen & source.valid(view))

    if not any(counts(view).any() for view in source.lightfield.views):
        raise UserError(
            f"{source.lightfield.path}: no view shows any of exports.nerfstudio.objects: "
            f"{', '.join(objects)}"
        )
    return counts


def _check_names(source: SourceDataset) -> None:
    """Check that dn-splatter pairs images, ordered as text, with normals, ordered by numbers.

    Raises `UserError` if it does not.
    """
    names = [view.name for view in source.lightfield.views]
    place = f"{source.lightfield.path}: frames"
    if any("/" in name for name in names):
        raise UserError(
            f"{place}: are of a head, for whose cameras dn-splatter finds no normals; leave out "
            "normals: true"
        )
    if sorted(names, key=_with_numbers) != sorted(names):
        raise UserError(
            f"{place}: have names with numbers of different lengths, whose normals dn-splatter "
            "mixes up; give them zeros in front, as in rig_02"
        )


def _with_numbers(name: str) -> list[str | int]:
    """Return the texts in a name, and in turn the numbers between them."""
    parts = re.split(r"(\d+)", name)
    return [int(part) if index % 2 else part for index, part in enumerate(parts)]


def camera(lens: Lens) -> dict[str, Any]:
    """Return the keys that describe a lens to nerfstudio."""
    model = {"camera_model": _MODELS[type(lens)]}
    size = {"w": lens.width, "h": lens.height}
    if isinstance(lens, Equirectangular):
        focal = {"fl_x": lens.width / 2, "fl_y": float(lens.height)}
        return {**model, **focal, **_center(lens), **size}
    assert isinstance(lens, Rectilinear | CalibratedLens | Equidistant)
    fx, fy = cameras.focal_pixels(lens)
    focal = {"fl_x": fx, "fl_y": fy}
    return {**model, **focal, **_center(lens), **size, **_distortion(lens)}


def _distortion(lens: Lens) -> dict[str, Any]:
    """Return the keys of a lens's distortion."""
    if isinstance(lens, Rectilinear):
        return dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    if isinstance(lens, BrownConrady):
        named = cameras.distortion(lens)
        return {name: named[name] for name in ("k1", "k2", "k3", "p1", "p2")}
    if isinstance(lens, Fisheye624):
        return {"distortion_params": list(lens.coefficients)}
    _, _, *radial = cameras.opencv_fisheye(lens)
    return {f"k{number}": value for number, value in enumerate(radial, 1)}


def _parameters(lens: Lens) -> dict[str, Any]:
    """Return the keys that describe a lens of a known model."""
    return {key: value for key, value in camera(lens).items() if key != "camera_model"}


def _center(lens: Lens) -> dict[str, float]:
    return {"cx": lens.center[0], "cy": lens.center[1]}
