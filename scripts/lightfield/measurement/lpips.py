"""LPIPS, the distance of two pictures in the features of a trained network, without that network.

Source: Zhang, Isola, Efros, Shechtman and Wang 2018, "The Unreasonable Effectiveness of Deep
Features as a Perceptual Metric", as in their package lpips, version 0.1. No package ships the
weights of the networks, so a file brings them: the state dict of the package's class LPIPS.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.formats import npz

Floats = NDArray[np.float32]

# How to make the file. With vgg instead of alex, it is VGG's.
RECIPE = (
    "python -c \"import lpips, numpy; numpy.savez('lpips_alex.npz', "
    "**{k: v.numpy() for k, v in lpips.LPIPS(net='alex').state_dict().items()})\""
)
# The values of a convolution's input windows that are copied at once: 128 MB.
_MOST_VALUES = 1 << 25
_TINY = 1e-10  # as in the package


@dataclass(frozen=True)
class _Architecture:
    """The part of a network that LPIPS compares. Each convolution is followed by a ReLU.

    - ``layers``: of each slice, the numbers of its convolutions, and their filters and widths. The
      features at the end of each slice are compared.
    - ``stride``, ``padding``: of the first convolution. The others have 1 and half their width.
    - ``pool``: the width of the maxima, 2 pixels apart, in front of the slices ``pooled``.
    - ``smallest``: the shortest side of a picture of which the last slice has features.
    """

    layers: tuple[tuple[tuple[int, int, int], ...], ...]
    stride: int
    padding: int
    pool: int
    pooled: tuple[int, ...]
    smallest: int

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shapes of the arrays of the state dict that LPIPS needs, by their keys."""
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
            ("scaling_layer.shift", "scaling_layer.scale"), (1, 3, 1, 1)
        )
        channels = 3
        for number, layers in enumerate(self.layers):
            for layer, filters, width in layers:
                shapes[f"net.slice{number + 1}.{layer}.weight"] = (filters, channels, width, width)
                shapes[f"net.slice{number + 1}.{layer}.bias"] = (filters,)
                channels = filters
            shapes[f"lin{number}.model.1.weight"] = (1, channels, 1, 1)
        return shapes


_ARCHITECTURES = {
    "alex": _Architecture(
        (((0, 64, 11),), ((3, 192, 5),), ((6, 384, 3),), ((8, 256, 3),), ((10, 256, 3),)),
        stride=4,
        padding=2,
        pool=3,
        pooled=(1, 2),
        smallest=31,
    ),
    "vgg": _Architecture(
        (
            ((0, 64, 3), (2, 64, 3)),
            ((5, 128, 3), (7, 128, 3)),
            ((10, 256, 3), (12, 256, 3), (14, 256, 3)),
            ((17, 512, 3), (19, 512, 3), (21, 512, 3)),
            ((24, 512, 3), (26, 512, 3), (28, 512, 3)),
        ),
        stride=1,
        padding=1,
        pool=2,
        pooled=(1, 2, 3, 4),
        smallest=16,
    ),
}


@dataclass(frozen=True)
class Lpips:
    """LPIPS with the weights of one network, ``net``: alex or vgg."""

    net: str
    weights: Mapping[str, Floats]

    def distance(self, picture: NDArray[Any], other: NDArray[Any]) -> float:
        """Return the LPIPS of sRGB pictures (h, w, 3) in [0, 1]. 0 is equal.

        Raises `UserError` if they are too small for the network. VGG needs about 1.5 kB a pixel.
        """
        smallest = _ARCHITECTURES[self.net].smallest
        height, width = picture.shape[:2]
        if min(height, width) < smallest:
            raise UserError(
                f"LPIPS ({self.net}): the views are {width} × {height} pixels; they must be at "
                f"least {smallest} × {smallest}"
            )
        total = 0.0
        pairs = zip(self._features(picture), self._features(other), strict=True)
        for number, (features, other_features) in enumerate(pairs):
            factors = self.weights[f"lin{number}.model.1.weight"].ravel()
            squares = (_unit(features) - _unit(other_features)) ** 2
            total += float(factors @ squares.mean(axis=(1, 2), dtype=np.float64))
        return total

    def _features(self, picture: NDArray[Any]) -> Iterator[Floats]:
        """Yield the features (channels, h, w) at the end of each slice."""
        net = _ARCHITECTURES[self.net]
        shift, scale = (self.weights[f"scaling_layer.{name}"][0] for name in ("shift", "scale"))
        # The network takes colours from −1 to 1.
        values = (2 * picture.transpose(2, 0, 1).astype(np.float32) - 1 - shift) / scale
        for number, layers in enumerate(net.layers):
            if number in net.pooled:
                values = _windows(values, net.pool, 2).max(axis=(-2, -1))
            for layer, _, width in layers:
                is_first = number == layer == 0
                weight, bias = (
                    self.weights[f"net.slice{number + 1}.{layer}.{name}"]
                    for name in ("weight", "bias")
                )
                padding, stride = (net.padding, net.stride) if is_first else (width // 2, 1)
                values = _convolved(values, weight, bias, padding, stride)
            yield values


def read(path: Path) -> Lpips:
    """Return LPIPS with the weights in an NPZ file. Raises `UserError` if it has others."""
    try:
        weights = npz.read(path)
    except UserError as error:
        raise UserError(f"{error}; make it by {RECIPE}") from None
    shapes = {key: array.shape for key, array in weights.items() if array.dtype.kind == "f"}
    for name, net in _ARCHITECTURES.items():
        if net.shapes.items() <= shapes.items():
            return Lpips(name, {key: weights[key].astype(np.float32) for key in net.shapes})
    raise UserError(
        f"{path}: must have the weights of LPIPS with alex or vgg, but its arrays have other names "
        f"or shapes; make it by {RECIPE}"
    )


def _windows(values: Floats, width: int, stride: int) -> Floats:
    """Return windows of values (channels, h, w): (channels, rows, columns, width, width)."""
    rows = sliding_window_view(values, width, axis=1)[:, ::stride]
    return np.asarray(sliding_window_view(rows, width, axis=2)[:, :, ::stride])


def _convolved(values: Floats, weight: Floats, bias: Floats, padding: int, stride: int) -> Floats:
    """Return the ReLU of a convolution of values (channels, h, w) with zeros around them."""
    margin = (padding, padding)
    windows = _windows(np.pad(values, ((0, 0), margin, margin)), weight.shape[-1], stride)
    height, width = windows.shape[1:3]
    matrix = weight.reshape(len(weight), -1)
    result = np.empty((len(weight), height, width), np.float32)
    # Strips of rows bound the memory.
    step = max(1, _MOST_VALUES // (matrix.shape[1] * width))
    for first in range(0, height, step):
        rows = windows[:, first : first + step].transpose(0, 3, 4, 1, 2)
        product = matrix @ rows.reshape(matrix.shape[1], -1)
        result[:, first : first + step] = product.reshape(len(weight), -1, width)
    result += bias[:, np.newaxis, np.newaxis]
    return np.maximum(result, 0, out=result)


def _unit(features: Floats) -> Floats:
    """Return features (channels, h, w) whose length is 1 at each place."""
    length = np.sqrt((features**2).sum(axis=0)) + np.float32(_TINY)
    return np.asarray(features / length, np.float32)
