"""How two pictures differ: the metrics of publications, and which pixels of two files differ.

The metrics take sRGB pictures in [0, 1]. `lightfield.measurement.metrics` has the errors of light.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import flip_evaluator
import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from lightfield.core.errors import UserError
from lightfield.core.units import count
from lightfield.formats.passes import FLOW, by_name
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.imaging.tonemap import encode_srgb
from lightfield.measurement.dataset_facts import shortened

Array = NDArray[Any]
Channels = Mapping[str, Array]

# The pixels along a side of SSIM's window: 3.5 standard deviations of 1.5 pixels around its middle.
_SSIM_WINDOW = 11
# From sRGB to luma and two differences of colour. Source: ITU-R BT.709.
TO_YCBCR = np.array(
    [[0.2126, 0.7152, 0.0722], [-0.1146, -0.3854, 0.5], [0.5, -0.4542, -0.0458]], np.float64
)
# IV-PSNR weights luma and both colour differences by these. Whole numbers, so that a mean of equal
# values is exact on every processor.
_IV_WEIGHTS = np.array([4.0, 1.0, 1.0])
# IV-PSNR forgives shifts of this many pixels, and this difference of the mean colour.
_SHIFT = 2
_MOST_OFFSET = 0.01


def ssim_map(truth: Array, shown: Array) -> Array:
    """Return the structural similarity (h, w, 3) of sRGB pictures in [0, 1]. 1 is equal.

    Source: Wang et al. 2004, with its Gaussian window of 1.5 pixels. Pictures continue mirrored
    beyond their borders.
    """
    # scikit-image refuses pictures smaller than its window.
    border = _SSIM_WINDOW // 2
    margins = ((border, border), (border, border), (0, 0))
    similarity: Array = structural_similarity(
        np.pad(truth, margins, mode="symmetric"),
        np.pad(shown, margins, mode="symmetric"),
        data_range=1.0,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )[1]
    return similarity[border:-border, border:-border]


def flip_map(truth: Array, shown: Array) -> Array:
    """Return the FLIP (h, w) of sRGB pictures in [0, 1]. 0 is equal. Source: Andersson 2020."""
    flip: Array = flip_evaluator.evaluate(
        truth.astype(np.float32), shown.astype(np.float32), "LDR", applyMagma=False
    )[0]
    return flip.reshape(truth.shape[:2])


def solid_angles(lens: Lens) -> Array:
    """Return the solid angle (h, w) of each pixel of a lens in steradians.

    It is half the cross product of the diagonals between the rays of the pixel's corners. It is 0
    if a corner has no ray.
    """
    rays = lens.rays(np.arange(lens.width + 1.0)[None, :], np.arange(lens.height + 1.0)[:, None])
    falling = rays[1:, 1:] - rays[:-1, :-1]
    rising = rays[:-1, 1:] - rays[1:, :-1]
    angles: Array = np.linalg.norm(np.cross(falling, rising), axis=-1) / 2
    return np.nan_to_num(angles)


def psnr(mean_square: float) -> float:
    """Return the PSNR in decibel of pictures in [0, 1] with this mean squared error.

    Equal pictures have inf. scikit-image's function would import all of SciPy's statistics, which
    takes half a second.
    """
    return -10 * math.log10(mean_square) if mean_square else math.inf


def ws_psnr(truth: Array, shown: Array, weights: Array) -> float:
    """Return the PSNR in decibel of pictures (h, w, 3) in [0, 1], with pixel ``weights`` (h, w).

    With `solid_angles` as weights it is WS-PSNR. Source: Sun, Lu and Yu 2017,
    "Weighted-to-Spherically-Uniform Quality Evaluation for Omnidirectional Video". The mean square
    counts as at least 1e-10, so equal pictures have 100 dB.
    """
    errors = ((truth - shown) ** 2).mean(axis=-1)
    return -10 * math.log10(max(float((weights * errors).sum() / weights.sum()), 1e-10))


def iv_psnr(
    truth: Array, shown: Array, counted: NDArray[np.bool_], weights: Array | None = None
) -> float:
    """Return the IV-PSNR in decibel of sRGB pictures (h, w, 3) in [0, 1].

    Only the ``counted`` pixels (h, w) count. The metric forgives shifts of up to two pixels, and
    differences of the mean colour of up to a hundredth. Source: Dziembowski, Mieloch, Stankowski
    and Grzelka 2022, "IV-PSNR – The Objective Quality Metric for Immersive Video Applications".
    Panoramas have pixel ``weights`` (h, w). Their program, QMIV, has them, too, but does not divide
    by their sum. This adds 10 log10(π / 2), 1.96 dB, to its figures of whole panoramas.
    """
    part = np.where(counted, 1.0 if weights is None else weights, 0.0)
    true_picture = truth @ TO_YCBCR.T
    shown_picture = shown @ TO_YCBCR.T
    offset = (true_picture - shown_picture)[counted].mean(axis=0)
    shown_picture = shown_picture + offset.clip(-_MOST_OFFSET, _MOST_OFFSET)
    return min(
        _iv_psnr(true_picture, shown_picture, part),
        _iv_psnr(shown_picture, true_picture, part),
    )


def _iv_psnr(picture: Array, other: Array, weights: Array) -> float:
    """Return the PSNR of a ``picture`` whose pixels are compared with their best matches."""
    height, width = weights.shape
    padded = np.pad(other, ((_SHIFT, _SHIFT), (_SHIFT, _SHIFT), (0, 0)), mode="edge")
    least = np.full(weights.shape, np.inf)
    best = np.zeros_like(picture)
    for row in range(2 * _SHIFT + 1):
        for column in range(2 * _SHIFT + 1):
            squares = (picture - padded[row : row + height, column : column + width]) ** 2
            error = squares @ _IV_WEIGHTS
            is_less = error < least
            least[is_less] = error[is_less]
            best[is_less] = squares[is_less]
    means = np.average(best.reshape(-1, 3), axis=0, weights=weights.ravel())
    return float(np.average(-10 * np.log10(np.maximum(means, 1e-10)), weights=_IV_WEIGHTS))


def depth_error(depth: NDArray[Any], truth: NDArray[Any]) -> float:
    """Return the mean of |depth / truth − 1|, at most 1 per pixel. inf is a miss, NaN unknown.

    A pixel counts as 1 if only one of the two hit anything.
    """
    missed = np.isinf(depth)
    truth_missed = np.isinf(truth)
    with np.errstate(invalid="ignore"):
        error = np.fmin(np.abs(depth / truth - 1), 1.0)
    return float(np.where(missed | truth_missed, missed != truth_missed, error).mean())


def normal_error(normals: Array, truth: Array) -> float | None:
    """Return the mean angle in degrees between normals (n, 3), where the truth has a normal.

    A missing normal, one of length 0 or not finite, counts as perpendicular to the truth.
    """
    has_normal = np.linalg.norm(truth, axis=-1) > 0.5
    if not has_normal.any():
        return None
    normals = normals[has_normal]
    truth = truth[has_normal]
    is_missing = ~np.isfinite(normals).all(axis=-1) | ~normals.any(axis=-1)
    with np.errstate(invalid="ignore"):
        cosine = (normals * truth).sum(axis=-1)
        sine = np.linalg.norm(np.cross(normals, truth), axis=-1)
        angles = np.arctan2(sine, cosine)
    return float(np.degrees(np.where(is_missing, np.pi / 2, angles)).mean())


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
    decibel = None
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
            decibel = psnr(float(((_shown(image_a) - _shown(image_b)) ** 2).mean()))
    return PictureDifference(remarks, decibel, size)


def flip(a: Path, b: Path) -> float:
    """Return the mean FLIP of two images' colours: 0 is equal, and 1 is the largest difference."""
    return float(flip_map(*(_shown(images.read_image(path)) for path in (a, b))).mean())


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
