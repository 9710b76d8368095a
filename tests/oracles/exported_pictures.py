"""Compares the pictures of exports with their views: colours, masks and depth.

A view may be there as EXR and as PNG. Then a picture must show one of them.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.formats.layout import ImageSet
from lightfield.formats.passes import NAMES, PASSES
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.validation.cameras import camera_of
from lightfield.validation.reprojected import toned
from oracles.exported_cameras import SetExport
from oracles.exported_depth import converted
from oracles.readers.contents import FLOAT32, Picture

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Rounding to a step may be off by a little more than a half.
STEP = 0.6
# A level of normalised disparity, and of luma, may be off by one.
LEVEL = 1.0
# Colours are not compared where a transparent view covers less than this part of a pixel.
LEAST_ALPHA = 1 / 255
LARGEST_STEP = np.iinfo(np.uint16).max


def faults(dataset: Path, sets: Sequence[ImageSet], exports: Sequence[SetExport]) -> list[str]:
    """Return the pictures that do not show their view. Views of other rigs are not compared."""
    pictures: dict[tuple[int, int], list[Picture]] = {}
    for export in exports:
        image_set = sets[export.number]
        for picture in export.exported.pictures:
            view = _view_of(picture, image_set)
            if view is not None:
                pictures.setdefault((export.number, view), []).append(picture)
    problems: list[str] = []
    for (number, view), of_view in sorted(pictures.items()):
        problems += _faults_of_view(dataset, sets[number], view, of_view)
    return problems


def _view_of(picture: Picture, image_set: ImageSet) -> int | None:
    """Return the number of the view that a picture shows. None if the set does not have it."""
    if picture.view is not None:
        return image_set.numbers.get(picture.view)
    places = image_set.lightfield.world_from_cameras[:, :3, 3]
    away = np.linalg.norm(places - np.array(picture.position), axis=1)
    return int(np.argmin(away))


def _faults_of_view(
    dataset: Path, image_set: ImageSet, view: int, pictures: Sequence[Picture]
) -> Iterator[str]:
    """Yield the pictures of a view that show none of its files."""
    shown_views = []
    for suffix in (".exr", ".png"):
        path = dataset / image_set.folder / f"{image_set.views[view]}{suffix}"
        if path.is_file():
            shown_views.append(_ShownView(dataset, image_set, view, images.read_image(path)))
    for picture in pictures:
        faults = [shown.fault(picture) for shown in shown_views if shown.can_be_shown(picture)]
        if faults and all(faults):
            yield f"{picture.place}: {faults[0]}"


def _has_size(pixels: NDArray[Any], image_set: ImageSet) -> bool:
    lens = image_set.lightfield.lens
    return bool(pixels.shape == (lens.height, lens.width))


class _ShownView:
    """What the pictures of a view must show, by one file of the view."""

    def __init__(self, dataset: Path, image_set: ImageSet, view: int, image: images.Image) -> None:
        self.dataset = dataset
        self.image_set = image_set
        self.lightfield = image_set.lightfield
        self.view = view
        self.image = image
        self.is_encoded = image.channels["R"].dtype.kind == "u"
        self.rays = self.lightfield.lens.pixel_rays()

    def can_be_shown(self, picture: Picture) -> bool:
        """Return whether this file of the view holds what a picture shows."""
        if picture.kind in ("steps", "metres", "disparity", "relative", "levels"):
            return "Z" in self.image.channels and self.lightfield.depth is not None
        is_copy = picture.path is not None and picture.path.suffix == ".exr"
        return not (is_copy and self.is_encoded)

    def fault(self, picture: Picture) -> str | None:
        """Return how a picture differs from the view. None if it does not."""
        if picture.path is None:
            kept = self.valid & self._chosen(picture.objects)
            return None if kept.all() else f"has no mask, but {self._count(~kept)} do not count"
        comparisons: dict[str, tuple[str, Callable[[Picture], Bools]]] = {
            "colour": ("colour", self._wrong_colours),
            "opaque": ("colour", self._wrong_colours),
            "luma": ("luma", self._wrong_luma),
            "alpha": ("alpha", self._wrong_alpha),
            "mask": ("mask", self._wrong_mask),
            "hidden": ("mask", self._wrong_hidden),
        }
        what, compare = comparisons.get(picture.kind, ("depth", self._wrong_depth))
        try:
            wrong = compare(picture)
        except UserError as error:
            return " ".join(str(error).replace(f"{picture.place}: ", "").split())
        if not wrong.any():
            return None
        return f"has another {what} than its view in {self._count(wrong)}"

    @staticmethod
    def _count(pixels: Bools) -> str:
        return f"{int(pixels.sum())} of {pixels.size} pixels"

    @property
    def valid(self) -> Bools:
        """Where (height, width) the view shows something: it has a ray and a source there."""
        valid: Bools = np.isfinite(self.rays[..., 0])
        if not self.image_set.name:
            return valid
        if "A" in self.image.channels and not self.lightfield.transparent:
            valid &= self.image.channels["A"] > 0
        elif "Z" in self.image.channels:
            valid &= ~np.isnan(self.image.channels["Z"])
        return valid

    @property
    def alpha(self) -> Floats:
        """How much of each pixel (height, width) the scene covers, 0 to 1."""
        if not self.lightfield.transparent:
            return np.ones(self.rays.shape[:2])
        alpha = self.image.channels["A"]
        largest = np.iinfo(alpha.dtype).max if self.is_encoded else 1
        return np.asarray(alpha / largest, np.float64)

    def encoded(self, picture: Picture) -> Floats:
        """Return the sRGB colour (height, width, 3), 0 to 1, as an export develops it.

        Some pictures have no alpha. There a transparent view is in front of black.
        """
        if self.is_encoded:
            return self.image.encoded
        light = self.image.colour.astype(np.float64)
        if picture.kind not in ("luma", "opaque"):
            light /= np.where(self.alpha > 0, self.alpha, 1)[..., None]
        return np.asarray(encode_srgb(toned(light, *picture.development)))

    def _wrong_colours(self, picture: Picture) -> Bools:
        shown = np.stack([self._channel(picture, name) for name in "RGB"], axis=-1)
        compared = self.alpha >= LEAST_ALPHA
        if shown.dtype.kind == "f":
            # The view itself.
            original = np.stack([self.image.channels[name] for name in "RGB"], axis=-1)
            return np.asarray((shown != original).any(axis=-1))
        largest = np.iinfo(shown.dtype).max
        off = np.abs(shown * (255.0 / largest) - 255 * self.encoded(picture)).max(axis=-1)
        return np.asarray(compared & ~(off <= STEP))

    def _wrong_luma(self, picture: Picture) -> Bools:
        """Source of the levels: ITU-R BT.709, 3 and 4."""
        shown = self._channel(picture, "Y")
        red, green, blue = np.moveaxis(self.encoded(picture), -1, 0)
        luma = 16 + 219 * (0.2126 * red + 0.7152 * green + 0.0722 * blue)
        return np.asarray(~(np.abs(shown - luma * np.exp2(picture.bits - 8.0)) <= LEVEL))

    def _wrong_alpha(self, picture: Picture) -> Bools:
        shown = self._channel(picture, "A")
        return np.asarray(~(np.abs(shown - 255 * self.alpha * self.valid) <= STEP))

    def _wrong_mask(self, picture: Picture) -> Bools:
        shown = self._channel(picture, "Y")
        return np.asarray((shown > 0) != (self.valid & self._chosen(picture.objects)))

    def _chosen(self, names: Sequence[str]) -> Bools:
        """Where (height, width) the pass of objects has one of the names. All without names."""
        if not names:
            return np.ones_like(self.valid)
        listed = read_json(self.dataset / "object" / NAMES)
        path = PASSES["object"].path(
            self.dataset / self.image_set.name, self.image_set.views[self.view]
        )
        numbers = images.read_image(path, ["Y"]).channels["Y"]
        return np.logical_or.reduce([numbers == listed[name] for name in names])

    def _wrong_hidden(self, picture: Picture) -> Bools:
        """Compare instant-ngp's mask, which is above 0 where pixels are ignored.

        It also hides rays that its loader does not have: at 90° from the axis and beyond, and at
        the very centre.
        """
        shown = self._channel(picture, "Y")
        in_front = self.rays[..., 2] < -0.01
        shown_off_axis = (shown > 0) & in_front & (self.rays[..., 2] > -1 + 1e-9)
        return np.asarray(np.where(self.valid, shown_off_axis, shown == 0))

    def _wrong_depth(self, picture: Picture) -> Bools:
        camera = camera_of(self.image_set, self.view)
        depth = converted(self.image.channels["Z"], camera, picture.meaning).astype(np.float64)
        depth = np.where(np.isnan(self.rays[..., 2]), np.nan, depth)
        shown = self._channel(picture, "Y").astype(np.float64)
        expected, tolerance = _expected_levels(picture, depth)
        return np.asarray(~(np.abs(shown - expected) <= tolerance))

    def _channel(self, picture: Picture, name: str) -> NDArray[Any]:
        """Return a channel of a picture. Raises `UserError` if its size is not the view's."""
        pixels = _read(picture, name)
        if not _has_size(pixels, self.image_set):
            raise UserError(f"{picture.path}: does not have the size of its view")
        return pixels


def _expected_levels(picture: Picture, depth: Floats) -> tuple[Floats, Floats]:
    """Return the numbers (h, w) that a picture must have, and how far off they may be (h, w).

    ``depth`` (h, w) is in metres, inf for a miss, and NaN where nothing is known.
    """
    # A damaged number may be anything.
    with np.errstate(all="ignore"):
        if picture.kind == "levels":
            near, far = np.array(picture.limits)
            highest = np.exp2(float(picture.bits)) - 1
            part = (1 / depth - 1 / far) / (1 / near - 1 / far)
            levels = np.clip(part * highest, picture.lowest, highest)
            return np.where(depth > 0, levels, 0), np.full(depth.shape, LEVEL)
        has_depth = np.isfinite(depth) & (depth > 0)
        if picture.kind == "disparity":
            shown = np.where(has_depth, picture.unit / depth, 0)
            return shown, FLOAT32 * (1 + np.abs(shown))
        if picture.kind == "metres":
            shown = np.where(np.isfinite(depth), depth, 0)
            return shown, FLOAT32 * (1 + np.abs(shown))
        unit = picture.unit
        if picture.kind == "relative":
            # The farthest surface of the view has the largest number.
            unit = float(np.max(depth, where=has_depth, initial=0)) / LARGEST_STEP or 1.0
            return np.where(has_depth, np.maximum(depth / unit, 1), 0), np.full(depth.shape, STEP)
        steps = depth / unit
        has_steps = has_depth & (np.round(steps) >= 1) & (np.round(steps) <= LARGEST_STEP)
        return np.where(has_steps, steps, 0), STEP + FLOAT32 * np.where(has_steps, steps, 0)


def _read(picture: Picture, channel: str) -> NDArray[Any]:
    """Return a channel of a picture. If it has only one, that is Y."""
    path = picture.path
    assert path is not None
    if path.suffix in (".png", ".exr"):
        return images.read_image(path, [channel]).channels[channel]
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    width, height = picture.size
    count = width * height
    if path.suffix == ".yuv":
        # The luma of a frame of 4:2:0 is two thirds of it.
        start = picture.frame * 3 * count
        return _array(path, content[start : start + 2 * count], "<u2", (height, width))
    # COLMAP's depth maps, and portable float maps, whose lowest row is first.
    pixels = _array(path, content[len(content) - 4 * count :], "<f4", (height, width))
    return np.flipud(pixels) if path.suffix == ".pfm" else pixels


def _array(path: Path, content: bytes, kind: str, shape: tuple[int, int]) -> NDArray[Any]:
    try:
        return np.frombuffer(content, kind).reshape(shape)
    except ValueError:
        raise UserError(f"{path}: does not have the size of its view") from None
