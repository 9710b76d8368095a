"""Reads a dataset for an exporter: the views of a lightfield.json, and the surfaces they see."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, link_or_copy
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.geometry.depth import LARGEST_STEP, in_16_bits
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look
from lightfield.reading.dataset import OpenDataset, OpenView
from lightfield.reading.surface import SeenSurface

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class SourceDataset:
    """The rendered views of a dataset (``name`` ""), or the views of one of its reprojections.

    - ``beside``: the datasets of other rigs, by the rigs' names. Names of their views begin with
      the rig's name: spiral_view_0000f. Each view keeps its part of the split.
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
        lightfield, by_name = self._shown
        if not self.renamed:
            return lightfield
        views = [replace(by_name[old].camera, name=new) for new, old in self.renamed.items()]
        return lightfield.changed(views=views)

    @cached_property
    def look(self) -> Look | None:
        """The look of the developed views, if they get one."""
        if self.suffix == ".png":
            return None
        return Look.of(self.look_name, self.exposure, self.lightfield.content.get(FILE_LOOK))

    @property
    def scene_name(self) -> str:
        """The scene's name, by the lightfield.json, or else by the folder of its datasets."""
        folder = absolute_path(self.dataset).parent
        return str(self.lightfield.content.get("scene", {}).get("name", folder.name))

    @property
    def rendered(self) -> LightField:
        """The rendered views, which hold the depth of every surface."""
        return self._rendered[0]

    @property
    def has_surfaces(self) -> bool:
        """Whether the rendered views are there and hold depth, as `surfaces` needs."""
        if not all((folder / NAME).is_file() for folder in (self.dataset, *self.beside.values())):
            return False
        lightfield, views = self._rendered
        return lightfield.depth is not None and all(view.path.is_file() for view in views.values())

    @cached_property
    def _shown(self) -> tuple[LightField, dict[str, OpenView]]:
        return self._joined(self.name, self.suffix)

    @cached_property
    def _rendered(self) -> tuple[LightField, dict[str, OpenView]]:
        return self._joined("", ".exr")

    def _joined(self, name: str, suffix: str) -> tuple[LightField, dict[str, OpenView]]:
        """Return the views of this rig and of the rigs beside it, by their names here, too."""
        own = OpenDataset.in_folder(self.dataset, name, suffix)
        own.lightfield.require_centre()
        views = {view.name: view for view in own.views}
        for rig, folder in self.beside.items():
            other = OpenDataset.in_folder(folder, name, suffix)
            named = {f"{rig}_{view.name}": view for view in other.views}
            if taken := views.keys() & named.keys():
                raise UserError(
                    f"{other.lightfield.path}: frames: another rig of the export has the name "
                    f"{min(taken)}, too; give the rig or its views another name"
                )
            views |= named
        cameras = [replace(view.camera, name=key) for key, view in views.items()]
        return own.lightfield.changed(views=cameras), views

    def view(self, view: View) -> OpenView:
        """Return a view of the `lightfield` as the library reads it."""
        _, by_name = self._shown
        return by_name[self.renamed.get(view.name, view.name)]

    @property
    def lens(self) -> Lens:
        """The lens of the views. If they have several, the first view's."""
        return self.lightfield.lens

    @property
    def lenses(self) -> dict[Lens, Path]:
        """The different lenses of the views, each with a lightfield.json that has it."""
        lenses: dict[Lens, Path] = {}
        for view in self.lightfield.views:
            dataset = self.view(view).dataset
            lenses.setdefault(dataset.lens, dataset.lightfield.path)
        return lenses

    @property
    def has_depth(self) -> bool:
        """Whether the views themselves hold depth."""
        return self.suffix == ".exr" and self.lightfield.depth is not None

    def path(self, view: View) -> Path:
        return self.view(view).path

    def colour(self, view: View) -> NDArray[np.uint8]:
        """Return a view's sRGB pixels, (height, width, 3)."""
        image = self.view(view).image()
        if self.suffix == ".png":
            return image.srgb
        if self.lightfield.transparent:
            return self.developed(image.straight, image.covered)
        return self.developed(image.colour)

    def developed(
        self, colour: NDArray[np.float32], covered: NDArray[np.float32] | None = None
    ) -> NDArray[np.uint8]:
        """Return linear light (height, width, 3) as sRGB pixels, as the source's views have them.

        Transparent light is divided by its alpha, and ``covered`` (height, width, 1) is what it was
        divided by.
        """
        if self.look:
            return np.asarray(self.look.to_pixels(colour, 8, covered), np.uint8)
        # Only here, because its kernels take long to load, and most exports link developed views.
        from lightfield.imaging.tonemap import to_8_bit, tone_map

        if self.suffix == ".png":
            return to_8_bit(colour)
        return to_8_bit(tone_map(colour, self.exposure, self.reinhard))

    def light(self, view: View) -> Floats:
        """Return a view's linear light with alpha (height, width, 4), multiplied by the alpha.

        PNG views are decoded, so their light is what they show. Alpha is 1 in opaque views.
        """
        from lightfield.imaging.tonemap import decode_srgb

        image = self.view(view).image()
        alpha = np.ones(image.channels["R"].shape)
        if self.lightfield.transparent:
            alpha = image.alpha
        if self.suffix == ".png":
            colour = decode_srgb(image.encoded) * alpha[..., np.newaxis]
        else:
            colour = image.colour
        return np.concatenate([colour, alpha[..., np.newaxis]], axis=-1)

    def alpha(self, view: View) -> NDArray[np.uint8]:
        """Return the coverage of each pixel (height, width), 0 to 255. 0 where it has no light."""
        covered = self.valid(view).astype(np.float32)
        if self.lightfield.transparent:
            covered *= self.view(view).image(["A"]).alpha
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

        image = self.view(view).image()
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
        inside = self.view(view).has_ray
        if self.name:
            channels = self.view(view).image().channels
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
        return self.view(view).depth_as(meaning)

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

    def surfaces(self, views: Iterable[View]) -> Iterator[tuple[View, SeenSurface]]:
        """Yield each view with the surface that it sees, from the depth of its rendered view."""
        if self.rendered.depth is None:
            raise UserError(
                f"{self.rendered.path}: depth: is null; points need it (render.depth in the YAML)"
            )
        _, rendered = self._rendered
        for view in views:
            # The name of a cube map's face begins with its view's: view_0000f_l.
            name = self.renamed.get(view.name, view.name)
            yield view, (rendered.get(name) or rendered[name.rpartition("_")[0]]).surface()


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
