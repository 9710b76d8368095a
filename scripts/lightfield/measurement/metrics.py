"""The errors of a rendered image against a reference, and the reference's own error.

The reference is the mean of n renders that differ only in their seeds. Every metric counts only
pixels that the lens has a ray for.

The main metric is the relative mean squared error, (x − r)² / (r² + ε). It is the mean over
channels and over all pixels but the worst thousandth (Rousselle, Knaus and Zwicker 2011, section
5). Images are exposed so that the references' geometric mean luminance is middle grey, 0.18. ε is
0.01. Leaving out the worst thousandth makes the metric robust. Otherwise a few fireflies would
decide it, and it would take thousands of views to tell two methods apart.

The expected error of all pixels is exactly proportional to 1/N for N independent samples. Without
the worst pixels it falls more slowly, if light comes in rare bright paths. Then few samples make
few bright pixels, and the thousandth is most of them.

Reports also give the same error of all pixels. Two more metrics are common in publications. They
count all pixels, and light without exposure: (x − r)² / (r² + ε), and pbrt's MRSE,
(x − r)² / (r + ε)². They say little about a linear image whose middle grey is far from 0.18,
because ε is then too large or too small.

The error is the sum of bias and variance. The bias is the difference of the mean of many renders.
The variance is how single renders differ from that mean. Many short renders measure both (Celarek,
Jakob, Wimmer and Lehtinen 2019). Plain path tracing has only variance, which falls with more
samples. A denoiser's error ends at its bias, which falls more slowly or not at all.

An independent reference adds its own variance, and nothing else, to every expected square. The
differences of its n renders give an estimate of that variance. Subtracting it leaves the image's
error.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.imaging.pictures import WHITE, exposure_for
from lightfield.imaging.tonemap import encode_srgb, tone_map
from lightfield.measurement.picture_difference import depth_error, flip_map, psnr, ssim_map

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_EPSILON = 0.01
# This part of the pixels, with the largest errors, does not count.
OUTLIERS = 0.001


@dataclass(frozen=True)
class Reference:
    """The reference of an image.

    - ``colour`` (h, w, 3): scene-linear, the mean of the renders.
    - ``variance`` (h, w, 3): the estimated variance of that mean.
    - ``depth`` (h, w): the median of the renders' depths, inf for a miss, or None.
    - ``mask`` (h, w): the pixels that the lens has a ray for.
    - ``exposure``: the stops at which the image is shown.
    - ``part`` (h, w): the pixels of the mask that count, or None for all.
    """

    colour: Array
    variance: Array
    depth: Array | None
    mask: Mask
    exposure: float
    part: Mask | None = None

    @property
    def counted(self) -> Mask:
        """The pixels that every metric counts, (h, w)."""
        return self.mask if self.part is None else self.mask & self.part

    @property
    def weights(self) -> Array:
        """The factors (n, 3) of the squared differences of the counted pixels."""
        return _weights(self.colour[self.counted], self.exposure)

    @property
    def unexposed_weights(self) -> tuple[Array, Array]:
        """The factors of the unexposed relative mean squared error, and of pbrt's MRSE."""
        truth = self.colour[self.counted]
        return 1 / (truth**2 + _EPSILON), 1 / (truth + _EPSILON) ** 2

    @property
    def own_error(self) -> float:
        """Expected relative mean squared error of the reference itself."""
        variance = (self.variance[self.counted] * self.weights).mean(axis=-1)
        return float(variance[_inliers(variance)].mean())


def _weights(truth: Array, exposure: float) -> Array:
    gain = 4.0**exposure
    weights: Array = gain / (gain * truth**2 + _EPSILON)
    return weights


def make_reference(
    colours: Sequence[NDArray[np.float32]],
    depths: Sequence[NDArray[np.float32]] | None,
    mask: Mask,
) -> Reference:
    """Make a reference of at least two renders (h, w, 3), with their depths (h, w) if any."""
    stack = np.stack(colours).astype(np.float64)
    with np.errstate(invalid="ignore"):
        depth = np.median(np.stack(depths), axis=0).astype(np.float64) if depths else None
    mean = stack.mean(axis=0)
    variance = stack.var(axis=0, ddof=1) / len(stack)
    return Reference(mean, variance, depth, mask, exposure_for(mean[mask]))


def exposed_alike(
    references: Sequence[Reference], exposure: float | None = None
) -> list[Reference]:
    """Return references under one ``exposure``. By default, all their pixels together set it."""
    if exposure is None:
        exposure = exposure_for(np.concatenate([r.colour[r.mask] for r in references]))
    return [replace(reference, exposure=exposure) for reference in references]


@dataclass(frozen=True)
class Errors:
    """The errors of one image against its reference.

    - ``relative_mse``: without the reference's own error. Much smaller errors may be below 0 by
      chance.
    - ``relative_mse_whole``: the same of all pixels, with the worst thousandth.
    - ``relative_mse_unexposed``, ``mrse`` (pbrt's): of all pixels, of light without exposure.
    - ``psnr`` (decibel, inf if equal), ``ssim`` (1 if equal), ``flip`` (0 if equal): of the
      tone-mapped image.
    - ``depth``: as in `depth_error`, or None without depth. Depth is one sample: more samples do
      not improve it.
    """

    relative_mse: float
    relative_mse_whole: float
    relative_mse_unexposed: float
    mrse: float
    psnr: float
    ssim: float
    flip: float
    depth: float | None


def compare(
    colour: NDArray[np.float32], depth: NDArray[np.float32] | None, reference: Reference
) -> Errors:
    """Compare an image, (h, w, 3) scene-linear with depth (h, w), with its reference."""
    mask = reference.counted
    shown, truth = (developed(x, reference) for x in (colour, reference.colour))
    mean_square = float(np.mean((truth[mask] - shown[mask]) ** 2, dtype=np.float64))
    excess = _squares(colour, reference) - reference.variance[mask]
    unexposed, mrse = (float((excess * weights).mean()) for weights in reference.unexposed_weights)
    return Errors(
        relative_mse=relative_mse(colour, reference),
        relative_mse_whole=relative_mse(colour, reference, left_out=0),
        relative_mse_unexposed=unexposed,
        mrse=mrse,
        psnr=psnr(mean_square),
        ssim=float(ssim_map(truth, shown)[mask].mean()),
        flip=float(flip_map(truth, shown)[mask].mean()),
        depth=None
        if depth is None or reference.depth is None
        else depth_error(depth[mask], reference.depth[mask]),
    )


def relative_mse(
    colour: NDArray[np.float32], reference: Reference, left_out: float = OUTLIERS
) -> float:
    """Return the relative mean squared error, without the reference's own part of it.

    ``left_out`` is the part of the pixels, with the largest errors, that does not count.
    """
    errors = (_squares(colour, reference) * reference.weights).mean(axis=-1)
    reference_error = (reference.variance[reference.counted] * reference.weights).mean(axis=-1)
    inliers = _inliers(errors, left_out)
    return float((errors - reference_error)[inliers].mean())


def bias_and_variance(
    colours: Sequence[NDArray[np.float32]], reference: Reference
) -> tuple[float, float]:
    """Return the squared bias and the variance of renders that differ only in their seeds.

    Both are relative, and add up to `relative_mse` of all pixels. The squared difference of the
    mean of n ≥ 2 renders is a sum: the squared bias, an n-th of the variance, and the reference's
    own variance. So the bias is exact to about an n-th of the variance. A smaller bias may be below
    0 by chance.
    """
    stack = np.stack([colour[reference.counted] for colour in colours]).astype(np.float64)
    variance = stack.var(axis=0, ddof=1)
    squared_difference = (stack.mean(axis=0) - reference.colour[reference.counted]) ** 2
    bias = squared_difference - variance / len(stack) - reference.variance[reference.counted]
    weights = reference.weights
    return float((bias * weights).mean()), float((variance * weights).mean())


def bias_correlation(
    renders: tuple[Sequence[NDArray[np.float32]], Sequence[NDArray[np.float32]]],
    references: tuple[Reference, Reference],
    common_pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> float | None:
    """Return the correlation of two views' biases at ``common_pixels`` (see `disagreement`)."""
    return correlation_of_biases(bias_products(renders, references, common_pixels))


def bias_products(
    renders: tuple[Sequence[NDArray[np.float32]], Sequence[NDArray[np.float32]]],
    references: tuple[Reference, Reference],
    common_pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> Array:
    """Return the products (n, 3) of two views' biases at n ``common_pixels``.

    They are the square of the first view's bias, the square of the second's, and the product of
    both. The first view's reference gives the weights.
    """
    means = []
    squares = []
    for colours, reference, where in zip(renders, references, common_pixels, strict=True):
        stack = np.stack([c.reshape(-1, 3)[where] for c in colours]).astype(np.float64)
        means.append(stack.mean(axis=0) - reference.colour.reshape(-1, 3)[where])
        noise = stack.var(axis=0, ddof=1) / len(stack)
        squares.append(means[-1] ** 2 - noise - reference.variance.reshape(-1, 3)[where])
    truth = references[0].colour.reshape(-1, 3)[common_pixels[0]]
    weights = _weights(truth, references[0].exposure)
    products = np.stack([*squares, means[0] * means[1]])
    means_of_channels: Array = (products * weights).mean(axis=-1).T
    return means_of_channels


def correlation_of_biases(products: Array) -> float | None:
    """Return the correlation of biases with these `bias_products`, of one pair of views or more.

    1 if both views have the same bias, as a blurred texture has. 0 if their biases have nothing in
    common. None if the square of a bias is not above 0 by two standard errors over the pixels.
    """
    first, second, product = (float(value) for value in products.mean(axis=0))
    standard_errors = products.std(axis=0) / math.sqrt(len(products))
    if first <= 2 * standard_errors[0] or second <= 2 * standard_errors[1]:
        return None
    return product / math.sqrt(first * second)


def _squares(colour: NDArray[np.float32], reference: Reference) -> Array:
    """Return the squared differences (n, 3) of the pixels that count."""
    squares: Array = (colour.astype(np.float64) - reference.colour)[reference.counted] ** 2
    return squares


def _inliers(errors: Array, left_out: float = OUTLIERS) -> NDArray[np.int64]:
    """Return the indices of all but the largest errors, in rising order."""
    return np.argsort(errors, kind="stable")[: errors.size - math.ceil(left_out * errors.size)]


def developed(colour: NDArray[Any], reference: Reference) -> Array:
    """Return the sRGB image in [0, 1] as reports show it: exposed and tone-mapped."""
    mapped = tone_map(np.ascontiguousarray(colour, np.float32), reference.exposure, WHITE)
    return np.where(reference.mask[..., np.newaxis], encode_srgb(mapped), 0.0)


def pareto(cost: Sequence[float], error: Sequence[float], same_cost: float = 0.0) -> list[int]:
    """Return the indices of the Pareto front: points that no other point beats, by rising cost.

    A point beats another if it is better in one figure and as good in the other. Of equal points
    the first counts. Costs within the part ``same_cost``, and errors within a millionth, are as
    good.
    """
    costs = np.array(cost)
    errors = np.array(error)
    order = np.arange(len(cost))
    # Rows are the points, columns the points that may beat them.
    point_cost = costs[:, np.newaxis]
    point_error = errors[:, np.newaxis]
    has_less_error = errors < point_error * (1 - 1e-6)
    has_no_more_error = errors <= point_error * (1 + 1e-6)
    costs_less = costs < point_cost * (1 - same_cost)
    costs_no_more = costs <= point_cost * (1 + same_cost)
    is_same = (errors == point_error) & (costs == point_cost)
    is_repeated = is_same & (order < order[:, np.newaxis])
    beaten = (has_less_error & costs_no_more) | (has_no_more_error & costs_less) | is_repeated
    front = order[~beaten.any(axis=1)]
    return [int(index) for index in front[np.argsort(costs[front], kind="stable")]]


@dataclass(frozen=True)
class Disagreement:
    """How two views differ where both see the same surface.

    - ``total``: the root of the mean relative squared difference of the images.
    - ``floor``: the same of their references. Its causes are reflections, texture and the choice of
      the nearest pixel.
    - ``added``: the same of the images' errors. Its cause is rendering.
    - ``share``: added² as a part of both images' squared errors. It is 1 for independent errors,
      such as noise, less if both views have similar errors, and 0 without errors.
    """

    total: float
    floor: float
    added: float
    share: float


def disagreement(
    images: tuple[NDArray[np.float32], NDArray[np.float32]],
    references: tuple[Reference, Reference],
    common_pixels: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> Disagreement:
    """Compare two views at ``common_pixels`` of common surfaces: flat indices (n,) into each.

    Compares the nearest pixels, because interpolation would remove noise. The first view's
    reference gives the weights. The part of the references' own errors is subtracted.
    """
    truths = [
        r.colour.reshape(-1, 3)[where] for r, where in zip(references, common_pixels, strict=True)
    ]
    errors = [
        image.astype(np.float64).reshape(-1, 3)[where] - truth
        for image, truth, where in zip(images, truths, common_pixels, strict=True)
    ]
    weights = _weights(truths[0], references[0].exposure)
    reference_errors = sum(
        r.variance.reshape(-1, 3)[where] * weights
        for r, where in zip(references, common_pixels, strict=True)
    )
    both = (errors[0] ** 2 + errors[1] ** 2) * weights
    # The same pixels are left out of every mean.
    inliers = _inliers(both.mean(axis=-1))
    error_difference = errors[0] - errors[1]
    truth_difference = truths[0] - truths[1]
    total, floor, added, sum_of_squares = (
        float(value[inliers].mean())
        for value in (
            (error_difference + truth_difference) ** 2 * weights,
            truth_difference**2 * weights - reference_errors,
            error_difference**2 * weights - reference_errors,
            both - reference_errors,
        )
    )
    return Disagreement(
        total=math.sqrt(total),
        floor=math.sqrt(max(floor, 0.0)),
        added=math.sqrt(max(added, 0.0)),
        share=added / sum_of_squares if sum_of_squares else 0.0,
    )
