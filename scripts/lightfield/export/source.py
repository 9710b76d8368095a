"""Reads a dataset for an exporter: the views of a lightfield.json, and the surfaces they see."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy
from lightfield.formats.depth import check_size, depth_of
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.geometry.depth import LARGEST_STEP, in_16_bits
from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import ONE_SURFACE, lies_on, pixel_indices
from lightfield.imaging import images
from lightfield.imaging.alpha import divisor
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# A view sees a point that lies on its surface within this part of the distance. The surface is at a
# pixel's centre, and the point is anywhere in the pixel.
_ON_SURFACE = 0.01


@dataclass(frozen=True)
class SourceDataset:
    """The rendered views of a dataset (``name`` ""), or the views of one of its reprojections.

    - ``beside``: the datasets of other rigs, by the rigs' names. Their views become test views,
      whose names begin with the rig's name: spiral_view_0000f.
    - ``renamed``: if there are any, only these views in this order: new names and the views'.
    - ``exposure``, ``reinhard``: how EXR views are developed: stops, and the value that becomes
      white. ``reinhard`` 1 leaves light as it is. PNG views are used as they are.
    - ``look_name``: the look with which EXR views are developed instead, if they are.
    - ``training_list``: the list of the export of the views that train, if these views test.
    """

    dataset: Path
    name: str
    suffix: str
    beside: Mapping[str, Path] = field(default_factory=dict)
    exposure: float = 0.0
    reinhard: float = 1.0
    renamed: Mapping[str, str] = field(default_factory=dict)
    look_name: str | None = None
    training_list: Path | None = None

    @cached_property
    def lightfield(self) -> LightField:
        lightfield = self._read(self.name)
        if not self.renamed:
            return lightfield
        by_name = {view.name: view for view in lightfield.views}
        views = [replace(by_name[old], name=new) for new, old in self.renamed.items()]
        return lightfield.changed(views=views)

    @cached_property
    def look(self) -> Look | None:
        """The look of the developed views, if they get one."""
        if self.suffix == ".png":
            return None
        return Look.of(self.look_name, self.exposure, self.lightfield.content.get(FILE_LOOK))

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
                raise UserError(f"{other.path}: camera: must be the same as in {lightfield.path}")
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
        name = self.renamed.get(view.name, view.name)
        return self._path(name, self.name or "exr", self.suffix)

    def pass_path(self, view: View, name: str) -> Path:
        """Return the file of a view's pass. It may be missing."""
        folder = f"{self.name}/{name}" if self.name else name
        return self._path(self.renamed.get(view.name, view.name), folder, ".exr")

    def _path(self, view_name: str, folder: str, suffix: str) -> Path:
        dataset, name = self._homes.get(view_name, (self.dataset, view_name))
        return dataset / folder / f"{name}{suffix}"

    @cached_property
    def _homes(self) -> dict[str, tuple[Path, str]]:
        """The dataset of each view of another rig, and the view's name there, by its name here."""
        return {
            f"{rig}_{view.name}": (folder, view.name)
            for rig, folder in self.beside.items()
            for name in {"", self.name}
            for view in LightField.read(folder / name / NAME).views
        }

    def _image(self, view: View, channels: Sequence[str] | None = None) -> images.Image:
        """Read a view. Raises `UserError` if its size is not the lens's."""
        image = images.read_image(self.path(view), channels)
        check_size(self.path(view), self.lightfield, next(iter(image.channels.values())))
        return image

    def colour(self, view: View) -> NDArray[np.uint8]:
        """Return a view's sRGB pixels, (height, width, 3)."""
        image = self._image(view)
        if self.suffix == ".png":
            return image.srgb
        colour = image.colour
        alpha = None
        if self.lightfield.transparent:
            alpha = image.channels["A"][..., None].astype(np.float32)
            alpha = divisor(alpha)
            colour /= alpha
        if self.look:
            return np.asarray(self.look.to_pixels(colour, 8, alpha), np.uint8)
        # Only here, because its kernels take long to load, and most exports link developed views.
        from lightfield.imaging.tonemap import to_8_bit, tone_map

        return to_8_bit(tone_map(colour, self.exposure, self.reinhard))

    def alpha(self, view: View) -> NDArray[np.uint8]:
        """Return the coverage of each pixel (height, width), 0 to 255. 0 where it has no light."""
        covered = self.valid(view).astype(np.float32)
        if self.lightfield.transparent:
            covered *= self._image(view, ["A"]).alpha
        return np.asarray(np.rint(covered * 255), np.uint8)

    def opaque(self, view: View) -> NDArray[np.uint8]:
        """Return a view's sRGB pixels (height, width, 3), for pictures that can have no alpha.

        A transparent view is in front of black.
        """
        if not self.lightfield.transparent:
            return self.colour(view)
        return np.asarray(np.rint(255 * self.encoded(view)), np.uint8)

    def encoded(self, view: View) -> Floats:
        """Return a view's sRGB-encoded colour (height, width, 3), 0 to 1, not rounded.

        A transparent view is in front of black.
        """
        from lightfield.imaging.tonemap import decode_srgb, encode_srgb, tone_map

        image = self._image(view)
        if self.suffix == ".png" and not self.lightfield.transparent:
            return image.encoded
        if self.suffix == ".png":
            developed = decode_srgb(image.encoded) * image.alpha[..., np.newaxis]
        elif self.look:
            return np.asarray(self.look.developed(image.colour), np.float64)
        else:
            developed = tone_map(image.colour, self.exposure, self.reinhard)
        return np.asarray(encode_srgb(developed), np.float64)

    def valid(self, view: View) -> Bools:
        """Return which pixels (height, width) hold light. They have a ray and a source."""
        inside: Bools = np.isfinite(self._rays[..., 0])
        if self.name:
            channels = self._image(view).channels
            if "A" in channels and not self.lightfield.transparent:
                inside = inside & (channels["A"] > 0)
            elif "Z" in channels:
                inside = inside & ~np.isnan(channels["Z"])
        return inside

    def depth(self, view: View, meaning: str) -> Floats:
        """Return a view's depth (height, width) in metres. ``meaning`` is "z" or "distance".

        inf for a miss, NaN for pixels without depth. Raises `UserError` if the views have no depth.
        """
        if not self.has_depth:
            raise UserError(f"{self.path(view)}: has no depth; reproject with format: exr")
        return depth_of(self.path(view), self.lightfield, self._rays, meaning)

    def write_image(self, view: View, target: Path) -> None:
        """Write a view as an 8-bit PNG, with RGBA if the views are transparent.

        If the view is such a PNG already, make a hard link to it.
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

    def surfaces(self, views: Iterable[View]) -> Iterator[tuple[View, "SeenSurface"]]:
        """Yield each view with the surface that it sees, from the depth of its rendered view."""
        if self.rendered.depth is None:
            raise UserError(
                f"{self.rendered.path}: depth: is null; points need it (render.depth in the YAML)"
            )
        by_name = {view.name: view for view in self.rendered.views}
        rays = self.rendered.lens.pixel_rays()
        for view in views:
            # The name of a cube map's face begins with its view's: view_0000f_l.
            name = self.renamed.get(view.name, view.name)
            rendered = by_name.get(name) or by_name[name.rpartition("_")[0]]
            path = self._path(rendered.name, "exr", ".exr")
            distance = depth_of(path, self.rendered, rays, "distance")
            yield view, SeenSurface(self.rendered.lens, rendered, rays, distance)


@dataclass(frozen=True)
class SeenSurface:
    """The first surface around a camera: ``distance`` (h, w) in metres along ``rays`` (h, w, 3)."""

    lens: Lens
    view: View
    rays: Floats
    distance: Floats

    def points(self, step: int) -> tuple[Floats, Floats]:
        """Return the world points (n, 3) at every ``step``-th pixel, and their normals (n, 3).

        A normal is perpendicular to the plane through the point and its neighbours to the right and
        below. It points to the camera. NaN at the rim, and where a neighbour is on another surface.
        """
        first = step // 2
        part = np.s_[first::step, first::step]
        with np.errstate(invalid="ignore"):
            world = self.rays * self.distance[..., None] @ self.view.world_from_camera[:3, :3].T
            right = np.full_like(world, np.nan)
            below = np.full_like(world, np.nan)
            right[:, :-1] = world[:, 1:] - world[:, :-1]
            below[:-1] = world[1:] - world[:-1]
            normal = np.cross(below, right)
            near = np.maximum(np.linalg.norm(right, axis=-1), np.linalg.norm(below, axis=-1))
            normal[~(near < ONE_SURFACE * self.distance)] = np.nan
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            normal *= -np.sign((normal * world).sum(axis=-1, keepdims=True))
        hits = np.isfinite(self.distance[part]) & (self.distance[part] > 0)
        return world[part][hits] + self.view.world_from_camera[:3, 3], normal[part][hits]

    def sees(self, points: Floats) -> Bools:
        """Return which world points (n, 3) lie on this surface, so that nothing hides them."""
        local = self.view.to_camera(points)
        expected = np.linalg.norm(local, axis=1)
        column, row, inside = pixel_indices(self.lens, local)
        distance = np.where(inside, self.distance[row, column], np.nan)
        return lies_on(distance, expected, part=_ON_SURFACE)


class DepthMaps:
    """Writes 16-bit depth maps with steps of ``unit`` metres, and counts the depths they lose."""

    def __init__(self, unit: float) -> None:
        self.unit = unit
        self._pixels = 0
        self._lost = 0

    def write(self, path: Path, depth: Floats) -> None:
        """Write the depth (h, w) of a view, in metres. 0 means none, too near, or too far."""
        steps, lost = in_16_bits(depth / self.unit)
        images.write_png(path, steps)
        self._pixels += depth.size
        self._lost += lost

    def report(self, place: Path) -> None:
        """Print how many depths were lost, if any, in the maps of the export at ``place``."""
        if self._lost:
            print(
                f"note: {place}: {self._lost} of {self._pixels} depths are 0, unknown, because "
                f"16 bits hold only {self.unit:g} to {LARGEST_STEP * self.unit:g} m"
            )
