"""What an exporter writes from: the views of a lightfield.json, and the surfaces they see."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy
from lightfield.dataset.lightfield import NAME, LightField, View
from lightfield.geometry.depth import distance_from_z, z_from_distance
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb, to_8_bit, tone_map

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Two distances of one surface differ by less than this part: the one is of a pixel's centre, the
# other of a point somewhere in the pixel.
SAME_SURFACE = 0.01

DEPTH_UNIT = 0.001
"""Metres of one step of a 16-bit depth map; what lies beyond 65.535 m has no depth there."""


@dataclass(frozen=True)
class SourceDataset:
    """The views of a dataset folder: the rendered ones (``name`` "") or those of a reprojection.

    ``beside`` are the folders of the rigs whose views test what is trained on these, by the rigs'
    names, which precede the names of their views: spiral_view_0000f.
    EXR views are developed with ``exposure`` (stops) and ``reinhard`` (the value that becomes
    white; 1 leaves light as it is); PNG views are taken as they are.
    """

    dataset: Path
    name: str
    suffix: str
    beside: Mapping[str, Path] = field(default_factory=dict)
    exposure: float = 0.0
    reinhard: float = 1.0

    @cached_property
    def lightfield(self) -> LightField:
        return self._read(self.name)

    @cached_property
    def rendered(self) -> LightField:
        """The rendered views, which hold the depth of every surface."""
        return self._read("")

    def _read(self, name: str) -> LightField:
        lightfield = LightField.read(self.dataset / name / NAME)
        lightfield.require_centre()
        views = list(lightfield.views)
        for rig, folder in self.beside.items():
            other = LightField.read(folder / name / NAME)
            if other.lens != lightfield.lens:
                raise UserError(f"{other.path}: camera: is another than that of {lightfield.path}")
            views += [replace(view, name=f"{rig}_{view.name}") for view in other.views]
        return lightfield.changed(views=views)

    @property
    def lens(self) -> Lens:
        return self.lightfield.lens

    @property
    def has_depth(self) -> bool:
        """Whether the views themselves hold depth."""
        return self.suffix == ".exr" and self.lightfield.depth is not None

    def path(self, view: View) -> Path:
        return self._path(view, self.name or "exr", self.suffix)

    def _path(self, view: View, folder: str, suffix: str) -> Path:
        dataset, name = self._homes.get(view.name, (self.dataset, view.name))
        return dataset / folder / f"{name}{suffix}"

    @cached_property
    def _homes(self) -> dict[str, tuple[Path, str]]:
        """The folder, and the name there, of each view of another rig."""
        return {
            f"{rig}_{view.name}": (folder, view.name)
            for rig, folder in self.beside.items()
            for name in {"", self.name}
            for view in LightField.read(folder / name / NAME).views
        }

    def _image(self, view: View, channels: Sequence[str] | None = None) -> images.Image:
        """Read a view; raises `UserError` for one of another size than the lens has."""
        image = images.read_image(self.path(view), channels)
        check_size(self.path(view), self.lightfield, next(iter(image.channels.values())))
        return image

    def colour(self, view: View) -> NDArray[np.uint8]:
        """Return a view's sRGB pixels, (height, width, 3)."""
        image = self._image(view)
        if self.suffix == ".png":
            return image.srgb
        colour = image.colour
        if self.lightfield.transparent:
            alpha = image.channels["A"][..., None].astype(np.float32)
            colour /= np.where(alpha > 0, alpha, 1)
        return to_8_bit(tone_map(colour, self.exposure, self.reinhard))

    def alpha(self, view: View) -> NDArray[np.uint8]:
        """Return how much of each pixel (height, width) is covered; 0 where there is no light."""
        covered = self.valid(view).astype(np.float32)
        if self.lightfield.transparent:
            alpha = self._image(view, ["A"]).channels["A"]
            scale = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
            covered *= alpha.astype(np.float32) / scale
        return np.asarray(np.rint(covered * 255), np.uint8)

    def encoded(self, view: View) -> Floats:
        """Return a view's sRGB-encoded colour, (height, width, 3), 0 to 1, not rounded."""
        if self.suffix == ".png":
            return self.colour(view) / 255
        developed = tone_map(self._image(view).colour, self.exposure, self.reinhard)
        return np.asarray(encode_srgb(developed), np.float64)

    def valid(self, view: View) -> Bools:
        """Return which pixels (height, width) hold light: the lens has a ray there and a source."""
        inside: Bools = np.isfinite(self._rays[..., 0])
        if self.name:
            channels = self._image(view).channels
            if "A" in channels and not self.lightfield.transparent:
                inside = inside & (channels["A"] > 0)
            elif "Z" in channels:
                inside = inside & ~np.isnan(channels["Z"])
        return inside

    def depth(self, view: View, meaning: str) -> Floats:
        """Return depth in metres, (height, width): "z" or "distance"; inf for a miss, NaN for none.

        Raises `UserError` where the views have no depth.
        """
        if not self.has_depth:
            raise UserError(f"{self.path(view)}: has no depth; reproject with format: exr")
        return depth_of(self.path(view), self.lightfield, self._rays, meaning)

    def write_image(self, view: View, target: Path) -> None:
        """Write a view as an 8-bit PNG; one that is such a PNG becomes a second name of that file.

        It is RGBA if the views are transparent.
        """
        if self.suffix == ".png" and not self._has_16_bits:
            link_or_copy(self.path(view), target)
        elif self.lightfield.transparent:
            images.write_png(target, np.dstack([self.colour(view), self.alpha(view)]))
        else:
            images.write_png(target, self.colour(view))

    @property
    def _has_16_bits(self) -> bool:
        return bool(self.lightfield.content.get("reprojection", {}).get("bits") == 16)

    @cached_property
    def _rays(self) -> Floats:
        return self.lens.pixel_rays()

    def surfaces(self, views: Iterable[View]) -> Iterator[tuple[View, "Surface"]]:
        """Yield views with the surface that each sees, as the rendered view beneath it has it."""
        if self.rendered.depth is None:
            raise UserError(
                f"{self.rendered.path}: depth: is null; points need it (render.depth in the YAML)"
            )
        by_name = {view.name: view for view in self.rendered.views}
        rays = self.rendered.lens.pixel_rays()
        for view in views:
            # A face of a cube map is named after its view: view_0000f_l.
            below = by_name.get(view.name) or by_name[view.name.rpartition("_")[0]]
            path = self._path(below, "exr", ".exr")
            distance = depth_of(path, self.rendered, rays, "distance")
            yield view, Surface(self.rendered.lens, below, rays, distance)


@dataclass(frozen=True)
class Surface:
    """The first surface around a camera: ``distance`` (h, w) in metres along ``rays`` (h, w, 3)."""

    lens: Lens
    view: View
    rays: Floats
    distance: Floats

    def points(self, step: int) -> tuple[Floats, Floats]:
        """Return the world points (n, 3) at every ``step``-th pixel, and their normals (n, 3).

        A normal is that of the plane through a point's neighbours to the right and below, turned
        to the camera; NaN at the rim and where these are on another surface.
        """
        first = step // 2
        part = np.s_[first::step, first::step]
        with np.errstate(invalid="ignore"):
            world = self.rays * self.distance[..., None] @ self.view.matrix[:3, :3].T
            right, below = np.full_like(world, np.nan), np.full_like(world, np.nan)
            right[:, :-1] = world[:, 1:] - world[:, :-1]
            below[:-1] = world[1:] - world[:-1]
            normal = np.cross(below, right)
            near = np.maximum(np.linalg.norm(right, axis=-1), np.linalg.norm(below, axis=-1))
            normal[~(near < 0.1 * self.distance)] = np.nan
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            normal *= -np.sign((normal * world).sum(axis=-1, keepdims=True))
        seen = np.isfinite(self.distance[part]) & (self.distance[part] > 0)
        return world[part][seen] + self.view.matrix[:3, 3], normal[part][seen]

    def sees(self, points: Floats) -> Bools:
        """Return which world points (n, 3) are on this surface, and not hidden behind it."""
        local = (points - self.view.matrix[:3, 3]) @ self.view.matrix[:3, :3]
        expected = np.linalg.norm(local, axis=1)
        column, row, inside = pixel_indices(self.lens, local)
        distance = np.where(inside, self.distance[row, column], np.nan)
        with np.errstate(invalid="ignore"):
            same: Bools = np.abs(distance - expected) < SAME_SURFACE * expected
        return same


def pixel_indices(lens: Lens, rays: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp], Bools]:
    """Return column and row of the pixel that each ray (n, 3) meets, and whether it is in frame.

    Outside the frame the indices are 0.
    """
    x, y = np.floor(lens.pixels(rays)).T
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < lens.width) & (y >= 0) & (y < lens.height)
    column, row = (np.where(inside, value, 0).astype(np.intp) for value in (x, y))
    return column, row, inside


def millimetres(depth: Floats) -> NDArray[np.uint16]:
    """Return depth (h, w) in metres as 16-bit steps of `DEPTH_UNIT`; 0 is none, or too far."""
    steps = np.round(depth / DEPTH_UNIT)
    valid = np.isfinite(steps) & (steps >= 1) & (steps <= np.iinfo(np.uint16).max)
    return np.where(valid, steps, 0).astype(np.uint16)


def depth_of(path: Path, lightfield: LightField, rays: Floats, meaning: str) -> Floats:
    """Return a view's depth in metres, (h, w), as "z" or "distance"; NaN where there is no ray.

    ``rays`` (h, w, 3) are those of the pixels. Raises `UserError` for a view of another size, and
    where nothing says what its channel Z means.
    """
    image = images.read_image(path, ["Z"])
    check_size(path, lightfield, image.channels["Z"])
    depth = image.channels["Z"].astype(np.float64)
    held = image.attributes.get(images.DEPTH_ATTRIBUTE, lightfield.depth)
    if held not in ("z", "distance"):
        raise UserError(
            f"{lightfield.path}: depth: is {held!r}; must be z or distance "
            "to say what channel Z of the views holds"
        )
    if held == meaning:
        # A pixel without a ray saw nothing.
        return np.where(np.isnan(rays[..., 2]), np.nan, depth)
    convert = z_from_distance if meaning == "z" else distance_from_z
    return convert(depth, rays)


def check_size(path: Path, lightfield: LightField, pixels: NDArray[Any]) -> None:
    """Raise `UserError` for pixels (h, w, …) of a view that are not as many as the lens has."""
    (height, width), lens = pixels.shape[:2], lightfield.lens
    if (width, height) != (lens.width, lens.height):
        raise UserError(
            f"{path}: is {width} × {height}, but {lightfield.path} says "
            f"{lens.width} × {lens.height}"
        )
