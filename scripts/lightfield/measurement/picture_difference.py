"""How two images of one name differ: in which pixels, by how much, and how visibly."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.units import count
from lightfield.formats.passes import FLOW, by_name
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.measurement import metrics
from lightfield.measurement.dataset_facts import shortened

Array = NDArray[Any]
Channels = Mapping[str, Array]


@dataclass(frozen=True)
class PictureDifference:
    """How two images differ. ``psnr`` is None for images without colour, and inf for equal pixels.

    ``remarks`` say what differs, in words. ``size`` is the largest difference of a value.
    ``unreadable`` has A and B, if they cannot be read.
    """

    remarks: list[str]
    psnr: float | None = None
    size: float = 0.0
    has_equal_pixels: bool = False
    unreadable: str = ""


def compare(a: Path, b: Path) -> PictureDifference:
    """Return how two images differ."""
    found: list[images.Image] = []
    errors: dict[str, str] = {}
    for where, path in (("A", a), ("B", b)):
        try:
            found.append(images.read_image(path))
        except UserError as error:
            errors[where] = str(error)
    if errors:
        return PictureDifference([*errors.values()], size=math.inf, unreadable="".join(errors))
    image_a, image_b = found
    remarks = list(_form(image_a.channels, image_b.channels))
    if remarks:
        return PictureDifference(remarks, size=math.inf)
    if all(_equal(plane, image_b.channels[name]) for name, plane in image_a.channels.items()):
        return PictureDifference([_header(image_a, image_b)], math.inf, has_equal_pixels=True)
    psnr = None
    size = 0.0
    for names, title in _groups(a, image_a.channels):
        planes_a, planes_b = (
            np.stack([image.channels[name] for name in names], axis=-1)
            for image in (image_a, image_b)
        )
        remark, difference = _difference(planes_a, planes_b, names, title)
        remarks += [remark] if remark else []
        size = max(size, difference)
        if title == "colour":
            psnr = metrics.psnr(float(((_shown(image_a) - _shown(image_b)) ** 2).mean()))
    return PictureDifference(remarks, psnr, size)


def flip(a: Path, b: Path) -> float:
    """Return the mean FLIP of two images' colours: 0 is equal, and 1 is the largest difference."""
    return float(metrics.flip_map(*(_shown(images.read_image(path)) for path in (a, b))).mean())


def _shown(image: images.Image) -> Array:
    """Return the sRGB colour (h, w, 3), 0 to 1. Light above 1 is white, and not a number black."""
    if image.channels["R"].dtype.kind == "u":
        return image.encoded
    light = np.nan_to_num(image.colour.astype(np.float64), posinf=1)
    return np.asarray(encode_srgb(light))


def _form(a: Channels, b: Channels) -> Iterator[str]:
    """Yield how the sizes and channels of two images differ."""
    for names, other_names, where in ((a, b, "A"), (b, a, "B")):
        if only := [name for name in names if name not in other_names]:
            yield f"only {where} has {', '.join(only)}"
    for name in a.keys() & b.keys():
        if a[name].shape != b[name].shape:
            sizes = [f"{plane.shape[1]} × {plane.shape[0]}" for plane in (a[name], b[name])]
            yield f"{sizes[0]} → {sizes[1]} pixels"
            return
        if a[name].dtype != b[name].dtype:
            yield f"{name}: {a[name].dtype} → {b[name].dtype}"


def _equal(a: Array, b: Array) -> bool:
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def _header(a: images.Image, b: images.Image) -> str:
    """Return what differs in files of equal pixels."""
    names = sorted(a.attributes.keys() | b.attributes.keys())
    values = [[shortened(i.attributes.get(name, "–")) for i in (a, b)] for name in names]
    changes = [
        f"{name}: {' → '.join(pair)}"
        for name, pair in zip(names, values, strict=True)
        if pair[0] != pair[1]
    ]
    return "equal pixels, " + (f"other header: {', '.join(changes)}" if changes else "other coding")


def _groups(path: Path, channels: Channels) -> Iterator[tuple[list[str], str]]:
    """Yield the channels of an image that are compared together, with what they are.

    Light is colour. Z is depth. Each other channel, such as of normals or numbers, is by itself.
    """
    try:
        kind = FLOW.kind if path.parent.name == FLOW.name else by_name(path.parent.name).kind
    except KeyError:
        kind = "light"
    names = [*channels]
    if kind == "light" and {*"RGB"} <= channels.keys():
        yield [*"RGB"], "colour"
        names = [name for name in names if name not in "RGB"]
    for name in names:
        is_depth = name == "Z" and kind == "light"
        yield [name], "depth" if is_depth else ("numbers" if kind == "id" else name)


def _difference(a: Array, b: Array, names: list[str], title: str) -> tuple[str, float]:
    """Return in words how some channels (h, w, n) differ, and the largest difference.

    The words are "" for equal channels. A value that is finite in one image alone counts as the
    largest difference.
    """
    same = (a == b) | ((a != a) & (b != b))
    if same.all():
        return "", 0.0
    pixels = int((~same).any(axis=-1).sum())
    if title == "numbers":
        row, column, _ = np.argwhere(~same)[0]
        change = f"{a[row, column, 0]} → {b[row, column, 0]}"
        differ = f"numbers differ in {count(pixels, 'pixel')}"
        return f"{differ}, first {change} at ({column}, {row})", float(pixels)
    both = np.isfinite(a) & np.isfinite(b)
    distance = np.abs(np.where(both, a, 0).astype(np.float64) - np.where(both, b, 0))
    largest = float(distance.max())
    row, column, channel = np.argwhere(distance == largest)[0]
    parts = []
    if largest:
        where = f" in {names[channel]}" if len(names) > 1 else ""
        scale = f" of {np.iinfo(a.dtype).max}" if a.dtype.kind == "u" else ""
        unit = " m" if title == "depth" else scale
        parts.append(
            f"{title} differs in {count(pixels, 'pixel')}, at most by {largest:.3g}{unit}{where} "
            f"at ({column}, {row})"
        )
    if lost := int((~same & ~both).any(axis=-1).sum()):
        row, column, channel = np.argwhere(~same & ~both)[0]
        change = f"{a[row, column, channel]:.3g} → {b[row, column, channel]:.3g}"
        parts.append(f"{title} is {change} at ({column}, {row}), {count(lost, 'pixel')} like that")
    return ", ".join(parts), math.inf if lost else largest
