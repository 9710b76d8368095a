"""Writes transforms.json for instant-ngp, beside the views, and the files that it names."""

# How instant-ngp's loader reads poses (``src/nerf_loader.cu``, ``common_device.cuh``). It negates
# the Y and Z axes of each camera. It maps a position p to p · ``scale`` + ``offset``. Then it
# cycles the axes (x, y, z) to (y, z, x). This module writes world points in SILVR's orientation:
# (x, y, z) becomes (y, −x, z). Training happens in the cube of side ``aabb_scale`` around
# (½, ½, ½).

import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, model_validator

from lightfield.core.errors import UserError
from lightfield.core.files import (
    absolute_path,
    keep_apart,
    link_or_copy,
    read_json,
    write_json,
)
from lightfield.core.names import PARTS, VIEWS
from lightfield.core.progress import Progress
from lightfield.engine.stage import ByHand, Stage, option, reads, writes
from lightfield.export import cameras
from lightfield.export.disparity import FARTHEST
from lightfield.export.source import DepthMaps, Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, ExportSettings, Joined
from lightfield.formats.depth import check_size, depth_of
from lightfield.formats.layout import Manifest
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.depth import LARGEST_STEP, conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.fisheye624 import Fisheye624
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.thin_prism_fisheye import ThinPrismFisheye
from lightfield.geometry.rigs import Rig
from lightfield.geometry.rotations import euler_to_matrix, nearest_to_axes
from lightfield.imaging import images
from lightfield.settings.base import Vector, as_list, checked

TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""The rotation from world to NeRF coordinates in SILVR's generate_NERF_transforms.py."""

RIG_PART = 0.2
"""The part of the unit cube's side that the rig fills if the scene's size is unknown."""

MASK = "dynamic_mask_{view}.png"
"""The mask beside a PNG view. instant-ngp does not train on pixels where it is above 0."""

BOUNDS_VIEWS = 64
"""The extent of a scene is measured in this many views."""
BOUNDS_PIXELS = 64
"""The views that measure a scene's extent have this many pixels along the longer side."""

_DEPTH_UNIT = 0.001  # metres of a step of depth, unless a surface is too far for such steps
_FIT_LIMIT = 0.25  # pixels by which the loader's polynomial may miss a fisheye's ray


def pictures_of(path: Path) -> list[str]:
    """Return the images that a transforms.json names: views and depth maps."""
    try:
        frames = read_json(path)["frames"]
        depths = [str(frame["depth_path"]) for frame in frames if "depth_path" in frame]
        return [str(frame["file_path"]) for frame in frames] + depths
    except (UserError, LookupError, TypeError):
        raise UserError(f"{path}: is not JSON with frames, each with a file_path") from None


class InstantNgp(Joined):
    """The transforms.json of instant-ngp."""

    name = "instant_ngp"
    summary = "transforms.json for instant-ngp."
    rank = 1
    loader = "./instant-ngp {}/transforms.json"
    # Test views get the scale and offset of the training views.
    reads_training_list = True
    lists_beside_views = Manifest("transforms*.json", pictures_of, (MASK,))

    scale: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        None,
        description="Scale from metres to unit cubes. Without this key, it is fitted to the scene.",
        json_schema_extra={"unit": "cubes/m"},
    )
    offset: Vector | None = Field(
        None,
        description="Position of the mean camera in the unit cube. Without this key, it is 0.5 "
        "along each axis.",
        json_schema_extra={"unit": "cubes"},
    )
    bounds: Literal["rig", "depth"] = Field(
        "rig",
        description="What the unit cube is fitted to without a scale. rig: the cameras. depth: the "
        "cameras, and most of the surfaces that the views see.",
    )
    aabb_scale: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = Field(
        None,
        description="Length of a side of the volume in which instant-ngp trains.",
        json_schema_extra={"unit": "cubes"},
    )
    render_aabb: Annotated[tuple[Vector, Vector], as_list(2)] | None = Field(
        None,
        description="Two opposite corners of the part of the unit cube that instant-ngp shows.",
        json_schema_extra={"unit": "cubes"},
    )
    depth: bool = Field(
        False, description="Also write depth maps of 16 bits. The source must have depth."
    )

    @model_validator(mode="after")
    def _one_placement(self) -> Self:
        if self.scale is not None and self.bounds == "depth":
            raise ValueError("bounds: does not go with scale, which it would determine")
        if self.scale is None and self.offset is not None:
            raise ValueError("offset: needs scale; without scale, both are fitted")
        if self.render_aabb:
            lowest, highest = self.render_aabb
            if any(low >= high for low, high in zip(lowest, highest, strict=True)):
                raise ValueError("render_aabb: must have the corner of smaller numbers first")
        return self

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if reason := _asymmetry(lens):
            return f"is a lens that instant-ngp cannot follow: {reason}; {TO_RECTILINEAR}"
        return NO_DEPTH if (self.depth or self.bounds == "depth") and not has_depth else None

    def rig_refusal(self, rig: Rig) -> str | None:
        if self.scale is None and self.bounds == "rig" and rig.positions == 1:
            return "has cameras at one place, which gives no scale; give scale, or bounds: depth"
        return None

    @property
    def recorded(self) -> dict[str, Any]:
        options = super().recorded
        del options["offset"]
        # Without a scale the offset is fitted, too.
        return options if self.scale is None else {**options, "offset": list(self.middle)}

    @property
    def middle(self) -> tuple[float, float, float]:
        """The mean camera's place in the unit cube, if a scale is given."""
        return self.offset or (0.5, 0.5, 0.5)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write transforms.json into ``folder``, and the files that it names."""
        view_images = {view.name: source.path(view) for view in source.lightfield.views}
        places = _Places.of(folder / "transforms.json", view_images)
        _write(self, source.lightfield, source.suffix, places, source.training_list)


@dataclass(frozen=True)
class _Places:
    """Where the files of an export lie: the transforms.json, images, and folders of other files.

    - ``images``: the image of each view by the view's name. A view of another rig has a name that
      its image does not have.
    - ``copies``: the folder for copies of EXR views, and for links to the PNG views of other rigs.
    """

    output: Path
    images: Mapping[str, Path]
    copies: Path
    depth: Path

    @classmethod
    def of(
        cls,
        output: Path,
        images: Mapping[str, Path],
        copies: Path | None = None,
        depth: Path | None = None,
    ) -> "_Places":
        folder = output.parent / "instant_ngp"
        return cls(output, images, copies or folder, depth or folder / "depth")


def _write(
    options: InstantNgp,
    lightfield: LightField,
    suffix: str,
    places: _Places,
    training_list: Path | None,
) -> None:
    """Write a dataset's transforms.json, and the files that it names."""
    output = places.output
    view_names = {output: [view.name for view in lightfield.views]}
    for part in PARTS:
        names = [view.name for view in lightfield.views if view.split == part]
        part_list = output.with_stem(f"{output.stem}_{part}")
        if names:
            view_names[part_list] = names
        else:
            # An earlier split may have had this part.
            part_list.unlink(missing_ok=True)
    writer = _TransformsWriter(options, lightfield, suffix, places, training_list)
    scale, offset = writer.placement()
    common = writer.lens_keys | {"scale": scale, "offset": offset}
    common["options"] = options.recorded
    if options.aabb_scale:
        common["aabb_scale"] = options.aabb_scale
    if options.render_aabb:
        common["render_aabb"] = [list(corner) for corner in options.render_aabb]
    if options.depth:
        common["integer_depth_scale"] = writer.depth_maps.unit
    frames = writer.frames()
    for path, names in view_names.items():
        write_json(path, common | {"frames": [frames[name] for name in names]})
        print(f"{path}: {len(names)} frames, scale {scale:.6g}, offset {offset}")


class _TransformsWriter:
    """Writes the files that a transforms.json names, view by view."""

    def __init__(
        self,
        options: InstantNgp,
        lightfield: LightField,
        suffix: str,
        places: _Places,
        training_list: Path | None,
    ) -> None:
        self.options = options
        self.lightfield = lightfield
        self.suffix = suffix
        self.places = places
        self.training_list = training_list
        self.lens = lightfield.lens
        try:
            self.lens_keys = lens_keys(self.lens)
        except UserError as error:
            raise UserError(f"{lightfield.path}: {error}") from None
        self.rays = self.lens.pixel_rays()
        self.blind = _blind_pixels(self.lens)
        # The loader multiplies depth by the length of the ray. A perspective ray has length 1 along
        # the axis. All other rays have length 1. The loader ignores a depth of 0.
        # Rays of a pinhole, distorted or not, have length 1 along the axis in the loader.
        self.meaning = "z" if _is_projected_to_plane(self.lens) else conventional_depth(self.lens)

    def placement(self) -> tuple[float, list[float]]:
        """Return scale and offset from the settings, or fit them to depth, or to the rig."""
        if self.training_list:
            training = read_json(self.training_list)
            try:
                return training["scale"], training["offset"]
            except (LookupError, TypeError):
                raise UserError(f"{self.training_list}: has no scale and offset") from None
        cameras = np.array([view.position for view in self.lightfield.views])
        if self.options.scale is not None:
            return self.options.scale, placed(cameras, self.options.scale, self.options.middle)
        if self.options.bounds == "rig":
            return _fitted_to_rig(cameras, -self.lightfield.world_from_cameras[:, :3, 2])
        points = np.concatenate(list(self.seen_points()))
        if not len(points):
            raise UserError(f"{self.lightfield.path}: no view sees anything at a finite depth")
        return fitted(*scene_bounds(cameras, points))

    def seen_points(self) -> Iterator[Floats]:
        """Yield the world points (n, 3) in metres that some views see. They spread over the rig."""
        views = self.lightfield.views
        step = max(1, max(self.lens.width, self.lens.height) // BOUNDS_PIXELS)
        part = np.s_[step // 2 :: step, step // 2 :: step]
        for index in np.unique(np.linspace(0, len(views) - 1, BOUNDS_VIEWS).round().astype(int)):
            view = views[index]
            distance = self.depth(view, "distance")[part]
            points = (self.rays[part] * distance[..., None])[np.isfinite(distance)]
            yield points @ view.world_from_camera[:3, :3].T + view.world_from_camera[:3, 3]

    def frames(self) -> dict[str, dict[str, Any]]:
        """Write the files of all views. Return their frames by the views' names."""
        progress = Progress(len(self.lightfield.views), "export")
        frames = {}
        missing = []
        for view in self.lightfield.views:
            image = self.places.images[view.name]
            if self.suffix == ".exr":
                image = self.copied_exr(view, image)
            else:
                if not image.is_file():
                    missing.append(image)
                elif image.stem != view.name:
                    image = self.linked(view, image)
                self.write_mask(view, image)
            frame: dict[str, Any] = {
                "file_path": self.relative(image),
                "transform_matrix": transform_matrix(view).tolist(),
            }
            if self.options.depth:
                path = self.places.depth / f"{view.name}.png"
                self.depth_maps.write(path, self.depth(view, self.meaning))
                frame["depth_path"] = self.relative(path)
            frames[view.name] = frame
            progress.done()
        if self.options.depth:
            self.depth_maps.report(self.places.output)
        if missing:
            print(
                f"warning: {len(missing)} images are missing, the first is {missing[0]}",
                file=sys.stderr,
            )
        return frames

    @cached_property
    def depth_maps(self) -> DepthMaps:
        """The writer of depth maps, whose steps reach to the farthest surface within `FARTHEST`."""
        farthest = 0.0
        for view in self.lightfield.views:
            depth = self.depth(view, self.meaning)
            farthest = max(farthest, float(np.max(depth, where=np.isfinite(depth), initial=0)))
        return DepthMaps(max(_DEPTH_UNIT, min(farthest, FARTHEST) / LARGEST_STEP))

    def relative(self, path: Path) -> str:
        """Return a path relative to the transforms.json.

        A folder beside it may be a link, and is a folder in a package.
        """
        folder = absolute_path(self.places.output).parent
        if absolute_path(path).is_relative_to(folder):
            return absolute_path(path).relative_to(folder).as_posix()
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()

    def depth(self, view: View, meaning: str) -> Floats:
        """Return a view's depth (height, width) in metres. ``meaning`` is "z" or "distance"."""
        path = self.places.images[view.name].with_suffix(".exr")
        return depth_of(path, self.lightfield, self.rays, meaning)

    def linked(self, view: View, source: Path) -> Path:
        """Link a PNG view of another rig, whose folder no package of this rig has."""
        target = self.places.copies / f"{view.name}{source.suffix}"
        link_or_copy(source, target)
        return target

    def copied_exr(self, view: View, source: Path) -> Path:
        """Copy R, G, B as half floats. Pixels that instant-ngp must not train on become −1.

        Transparent views keep their channel A. Their colour stays premultiplied by it.
        """
        image = images.read_image(source)
        channels = image.channels
        missing = [name for name in "RGB" if name not in channels]
        if missing:
            raise UserError(f"{source}: has no channel {missing[0]}")
        check_size(source, self.lightfield, channels["R"])
        hidden = self.blind | np.isnan(channels.get("Z", np.zeros(1)))
        target = self.places.copies / f"{view.name}.exr"
        planes = np.moveaxis(image.colour, -1, 0)
        copied = {
            name: np.where(hidden, -1, plane).astype(np.float16)
            for name, plane in zip("RGB", planes, strict=True)
        }
        if self.lightfield.transparent:
            copied["A"] = channels["A"]
        images.write_exr(target, copied)
        return target

    def write_mask(self, view: View, image: Path) -> None:
        """Write the mask of a PNG view if some pixels have no ray, or no source."""
        hidden = self.blind
        if image.is_file():
            channels = images.read_image(image).channels
            check_size(image, self.lightfield, next(iter(channels.values())))
            if "A" in channels and not self.lightfield.transparent:
                hidden = hidden | (channels["A"] == 0)
        path = image.with_name(MASK.format(view=view.name))
        if hidden.any():
            images.write_png(path, np.where(hidden, 255, 0).astype(np.uint8))
        else:
            # A mask here belongs to an earlier lens of the views.
            path.unlink(missing_ok=True)


def transform_matrix(view: View) -> Floats:
    """Return the (4, 4) camera-to-world matrix of a view in NeRF coordinates.

    It is computed from the angles, as in all files published so far. The rounded ``world_matrix``
    differs from it by 1e-12.
    """
    turn = np.eye(4)
    turn[:3, :3] = TURN
    matrix = np.eye(4)
    matrix[:3, :3] = euler_to_matrix(view.rotation)
    matrix[:3, 3] = view.position
    return turn @ matrix


def lens_keys(lens: Lens) -> dict[str, Any]:
    """Return the keys that describe a lens to the loader.

    A lens of Brown and Conrady is written as OpenCV's, unless it has k3 to k6. A fisheye is written
    as θ = Σ p_i r^i with r in pixels (``ftheta``), which is exact for equidistant and polynomial
    lenses. A panorama is written as ``latlong``, because the loader's
    ``equirectangular`` is linear in the sine of the latitude. Raises `UserError` if the loader
    would miss the lens by more than a quarter of a pixel.
    """
    keys: dict[str, Any] = {
        "w": lens.width,
        "h": lens.height,
        "cx": lens.center[0],
        "cy": lens.center[1],
    }
    if isinstance(lens, Rectilinear):
        return {**_focal_keys(lens, *_axis_pixels(lens, 1.0)), **keys}
    if isinstance(lens, BrownConrady) and _is_projected_to_plane(lens):
        named = cameras.distortion(lens)
        coefficients = {name: named[name] for name in ("k1", "k2", "p1", "p2")}
        return {**_focal_keys(lens, *cameras.focal_pixels(lens)), **keys, **coefficients}
    if _is_full_panorama(lens):
        focal = lens.width / (2 * math.pi)
        return {"fl_x": focal, "fl_y": focal, **keys, "latlong": True}
    if reason := _asymmetry(lens):
        raise UserError(_not_followed(reason))
    polynomial = _ftheta(lens)
    focal = 1 / abs(polynomial[1])
    coefficients = {f"ftheta_p{power}": value for power, value in enumerate(polynomial)}
    return {"fl_x": focal, "fl_y": focal, **keys, **coefficients}


def _focal_keys(lens: Lens, focal_x: float, focal_y: float) -> dict[str, float]:
    """Return the keys of a pinhole's focal lengths in pixels."""
    return {
        "camera_angle_x": 2 * math.atan(lens.width / (2 * focal_x)),
        "camera_angle_y": 2 * math.atan(lens.height / (2 * focal_y)),
        "fl_x": focal_x,
        "fl_y": focal_y,
    }


def _has_more_than_opencv(lens: BrownConrady) -> bool:
    """Return whether a lens has k3 to k6, which the loader's ``OpenCV`` lacks."""
    return any(lens.coefficients[4:])


def _asymmetry(lens: Lens) -> str | None:
    """Return why the loader has no lens that is as asymmetric as this one. None if it has one."""
    if isinstance(lens, ThinPrismFisheye | Fisheye624):
        return "it has a thin prism"
    if isinstance(lens, BrownConrady) and _has_more_than_opencv(lens):
        named = cameras.distortion(lens)
        if named["p1"] or named["p2"]:
            return "it has p1 or p2 beside k3 to k6"
    return None


def _is_projected_to_plane(lens: Lens) -> bool:
    """Return whether the loader takes the lens for a pinhole, distorted or not."""
    if isinstance(lens, BrownConrady):
        return not _has_more_than_opencv(lens)
    return isinstance(lens, Rectilinear)


def _blind_pixels(lens: Lens) -> NDArray[np.bool_]:
    """Return which pixels (height, width) have no ray, in the lens or in the loader.

    They must be hidden, because the loader trains them with the ray of the optical axis. In a
    fisheye the loader has no ray at the exact centre, nor at 90° from the axis and beyond.
    """
    rays = lens.pixel_rays()
    blind: NDArray[np.bool_] = np.isnan(rays).any(axis=-1)
    if not _is_projected_to_plane(lens) and not _is_full_panorama(lens):
        blind |= ~(rays[..., 2] < -1e-6)
        y, x = np.ogrid[: lens.height, : lens.width]
        blind |= (x + 0.5 == lens.center[0]) & (y + 0.5 == lens.center[1])
    return blind


def scene_bounds(cameras: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the corners (3,), (3,) in metres of the box that becomes the unit cube.

    It holds all ``cameras`` (n, 3) and, along each axis, the middle nine tenths of the ``points``
    (n, 3). Sky, hills and other far points lie outside, within ``aabb_scale``.
    """
    low, high = np.percentile(points, [5, 95], axis=0)
    return np.minimum(low, cameras.min(axis=0)), np.maximum(high, cameras.max(axis=0))


def fitted(low: Floats, high: Floats) -> tuple[float, list[float]]:
    """Return the scale and offset that put a box of the world into the middle of the unit cube."""
    side = float(np.max(high - low))
    if not side > 0:
        raise UserError("the scene's extent is zero, so no scale fits it; give a scale")
    scale = 1 / side
    return scale, (0.5 - scale * TURN @ ((low + high) / 2)).tolist()


def _fitted_to_rig(cameras: Floats, axes: Floats) -> tuple[float, list[float]]:
    """Return the scale and offset that put the rig in the cube's middle, `RIG_PART` wide.

    ``axes`` (n, 3) are the directions in which the ``cameras`` (n, 3) look. A rig that looks
    inward, as at an object, fills the whole cube around the point that it looks at.
    """
    center = (cameras.min(axis=0) + cameras.max(axis=0)) / 2
    half = (cameras.max(axis=0) - cameras.min(axis=0)) / 2 / RIG_PART
    point = looked_at(cameras, axes)
    if point is not None:
        center = point
        half = np.abs(cameras - point).max(axis=0)
    return fitted(center - half, center + half)


def looked_at(cameras: Floats, axes: Floats) -> Floats | None:
    """Return the point (3,) within a rig that all its cameras look at, or None.

    It is the point nearest to all optical axes by least squares. It must lie in front of every
    camera, and no farther from the rig's middle than the farthest camera.
    """
    point = nearest_to_axes(cameras, axes)
    if point is None:
        return None
    in_front = ((point - cameras) * axes).sum(axis=1) > 0
    middle = (cameras.min(axis=0) + cameras.max(axis=0)) / 2
    reach = np.max(np.linalg.norm(cameras - middle, axis=1))
    return point if in_front.all() and np.linalg.norm(point - middle) <= reach else None


def placed(cameras: Floats, scale: float, offset: Sequence[float]) -> list[float]:
    """Return the offset with which the mean camera lies at ``offset``, as SILVR's script does."""
    mean = TURN @ cameras.mean(axis=0)
    return [float(value) for value in np.asarray(offset) - scale * mean]


def _axis_pixels(lens: Lens, tangent: float) -> tuple[float, float]:
    """Return the pixels from the centre to a ray right and to a ray down at this tangent."""
    right, down = lens.pixels(np.array([[tangent, 0.0, -1.0], [0.0, -tangent, -1.0]]))
    return float(right[0] - lens.center[0]), float(down[1] - lens.center[1])


def _is_full_panorama(lens: Lens) -> bool:
    """Return whether the lens is the loader's ``latlong``."""
    return isinstance(lens, Equirectangular) and lens.is_full


def _ftheta(lens: Lens) -> list[float]:
    """Return p0 to p4 of θ = Σ p_i r^i, r in pixels, fitted to the lens up to 90° or its rim."""
    corners = np.array([[0, 0], [lens.width, 0], [0, lens.height], [lens.width, lens.height]])
    reach = float(np.hypot(*(corners - lens.center).T).max())
    radius = np.linspace(0, reach, 4001)
    in_front = radius[np.abs(_angles(lens, radius)[0]) <= math.pi / 2]
    if len(in_front) < 5:
        raise UserError(_not_followed("its view is not a fisheye's"))
    # Chebyshev's nodes keep the largest error of a polynomial fit near its minimum.
    nodes = in_front[-1] * (0.5 - 0.5 * np.cos(np.linspace(0, math.pi, 1001)))
    across, down = _angles(lens, nodes)
    # If the angle at the centre is not 0, the centre looks up, and no pixel beside it does.
    usable = np.isfinite(across) & ((nodes > 0) | (down == 0))
    nodes = nodes[usable]
    across = across[usable]
    down = down[usable]
    for degree in (1, 4):
        fit = Polynomial.fit(  # type: ignore[no-untyped-call, unused-ignore]
            nodes, across, degree, domain=[0, in_front[-1]], window=[0, 1]
        )
        if np.abs(fit(nodes) - across).max() < 1e-9:
            break
    pixel = np.abs(np.gradient(across, nodes))
    beside = _beside_diagonal(lens, nodes, fit(nodes))
    miss = np.stack([*np.abs(fit(nodes) - [across, down]), beside]) / pixel
    error = float(np.nanmax(miss))
    if not error <= _FIT_LIMIT:
        raise UserError(_not_followed(f"its polynomial misses it by {error:.2g} pixels"))
    powers = np.zeros(5)
    powers[: degree + 1] = fit.convert().coef
    if degree == 1:
        powers[0] = 0.0  # without rounding noise: a linear fit passes through the centre
    return [float(power) for power in powers]


def _angles(lens: Lens, radius: Floats) -> tuple[Floats, Floats]:
    """Return the signed angles from the axis to the right of the centre and below it."""
    x, y = lens.center
    right = lens.rays(x + radius, np.full_like(radius, y))
    below = lens.rays(np.full_like(radius, x), y + radius)
    return np.arctan2(right[:, 0], -right[:, 2]), np.arctan2(-below[:, 1], -below[:, 2])


def _beside_diagonal(lens: Lens, radius: Floats, angle: Floats) -> Floats:
    """Return the angles (n,) between the rays of the lens and of a fisheye, towards a corner.

    The fisheye has ``angle`` (n,) at ``radius`` (n,). NaN where the lens has no ray.
    """
    x, y = lens.center
    rays = lens.rays(x + radius * math.sqrt(0.5), y + radius * math.sqrt(0.5))
    side = np.sin(angle) * math.sqrt(0.5)
    expected = np.stack([side, -side, -np.cos(angle)], axis=-1)
    angles: Floats = 2 * np.arcsin((np.linalg.norm(rays - expected, axis=-1) / 2).clip(max=1))
    return angles


def _not_followed(reason: str) -> str:
    return f"camera: instant-ngp cannot follow this lens ({reason}); reproject it to rectilinear"


# The key that each flag sets, and the value that the flag gives it. Most of these flags have the
# names of SILVR's generate_NERF_transforms.py.
_KEYS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "image_suffix": ("suffix", str),
    "placed_as": ("trained_by", str),
    "scale": ("options.scale", float),
    "offset": ("options.offset", tuple),
    "depth_bounds": ("options.bounds", lambda is_given: "depth" if is_given else "rig"),
    "aabb_scale": ("options.aabb_scale", int),
    "render_aabb": ("options.render_aabb", lambda corners: (corners[:3], corners[3:])),
    "depth_dir": ("options.depth", lambda _: True),
}


class _SilvrFlags(ByHand):
    """An export for instant-ngp in SILVR's words."""

    image_suffix: Literal[".png", ".exr"] = option("suffix of the views", ".png")
    scale: Annotated[float, Field(gt=0)] | None = option(
        "scale from metres to unit cubes (default: fitted to the scene)", None
    )
    offset: tuple[float, float, float] | None = option(
        "position of the mean camera in the unit cube, with --scale (default: 0.5 0.5 0.5)",
        None,
        metavar=("X", "Y", "Z"),
    )
    depth_bounds: bool = option(
        "fit the unit cube to the cameras and nine tenths of the points in channel Z of the .exr "
        "views (default: the rig fills a fifth of the cube, or all if it looks inward)",
        False,
    )
    aabb_scale: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = option(
        "side of the training volume in unit cubes (instant-ngp's default: 1)", None
    )
    render_aabb: tuple[float, float, float, float, float, float] | None = option(
        "two opposite corners of the part of the unit cube that instant-ngp shows",
        None,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
    )
    placed_as: str | None = option(
        "take scale and offset from this transforms.json, which lists the training views",
        None,
        metavar="TRANSFORMS",
    )

    def settings(self, given: Mapping[str, Any]) -> ExportSettings[InstantNgp]:
        if self.scale is None and self.offset is not None:
            raise UserError("--offset: needs --scale; without --scale, both are fitted")
        flags = {**given, **dict(self)}
        content: dict[str, Any] = {"options": {"sources": [VIEWS]}}
        for flag, (key, value_of) in _KEYS.items():
            if flags.get(flag) is not None:
                block, _, name = key.rpartition(".")
                (content[block] if block else content)[name] = value_of(flags[flag])
        return checked(TypeAdapter(ExportSettings[InstantNgp]), content, "flags")


class TransformsByHand(Stage[ExportSettings[InstantNgp]]):
    """Writes a transforms.json by hand, for views in any folder."""

    name = "export_instant_ngp"
    function = "lightfield.exporters.instant_ngp:write_by_hand"
    by_hand = _SilvrFlags

    input_cfg: Path = reads("lightfield.json of the views")
    output: Path = writes("transforms.json to write")
    image_dir: Path | None = reads("folder of the views (default: the folder of --input-cfg)", None)
    exr_dir: Path | None = writes(
        "folder for the copies of EXR views (default: instant_ngp beside --output)", None
    )
    depth_dir: Path | None = writes(
        "folder for depth maps (16-bit PNG in steps of integer_depth_scale), which are made from "
        "channel Z of the .exr views (default, if the settings file asks for them: "
        "instant_ngp/depth beside --output)",
        None,
    )

    def made(self) -> Iterator[Path]:
        # Masks lie beside the views, and the lists of a split beside the output.
        yield from super().made()
        yield self.output.parent


def write_by_hand(job: TransformsByHand) -> None:
    """Write the transforms.json that the flags describe."""
    options, suffix = job.settings.options, job.settings.suffix
    training_list = Path(job.settings.trained_by) if job.settings.trained_by else None
    lightfield = LightField.read(job.input_cfg)
    lightfield.require_centre()
    folder = job.image_dir or lightfield.folder
    view_images = {view.name: folder / f"{view.name}{suffix}" for view in lightfield.views}
    places = _Places.of(job.output, view_images, job.exr_dir, job.depth_dir)
    keep_apart("--output", job.output, job.input_cfg, training_list)
    if job.depth_dir and not options.depth:
        raise UserError("--depth-dir: needs options.depth: true in the settings file")
    if suffix == ".exr":
        keep_apart("--exr-dir", places.copies, folder)
    elif options.depth:
        keep_apart("--depth-dir", places.depth, folder)
    _write(options, lightfield, suffix, places, training_list)
