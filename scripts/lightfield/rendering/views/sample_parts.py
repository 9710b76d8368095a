"""Renders a view in parts of its samples. Their spread gives the variance of their mean.

The parts have the samples that Cycles would take at once. So their mean is the same view, within
the rounding of floats.
"""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from itertools import pairwise

import bpy
import numpy as np

from lightfield.formats.passes import SAMPLE_PARTS
from lightfield.rendering.scenes.open_scene import OpenScene
from lightfield.rendering.scenes.render_graph import changed
from lightfield.rendering.views.view import Array, Rendered, render_view

_COLOUR = "Combined"


def render_in_parts(
    opened: OpenScene,
    world_from_camera: Array,
    seed: int,
    passes: Mapping[str, str],
    divisors: Mapping[str, str],
    to_rec_709: Array | None,
) -> tuple[Rendered, Array]:
    """Render a view as `render_view` does. Also return the estimated variance of its colour.

    ``divisors`` says which passes Cycles has divided, and by which others. ``to_rec_709`` (3, 3)
    converts the colour, if it needs that. The variance (height, width, 3) is float32, in squared
    linear Rec. 709.
    """
    mean = _Mean(np.eye(3) if to_rec_709 is None else to_rec_709)
    seconds = synchronization_seconds = 0.0
    for count in _parts():
        part = render_view(opened, world_from_camera, seed, passes)
        for name, divisor in divisors.items():
            part.passes[name] *= part.passes[divisor]
        mean.add(part.passes, count)
        seconds += part.render_seconds
        synchronization_seconds += part.synchronization_seconds
    for name, divisor in divisors.items():
        divided, by = mean.passes[name], mean.passes[divisor]
        mean.passes[name] = np.divide(divided, by, out=np.zeros_like(divided), where=by != 0)
    mean_passes = {name: pixels.astype(np.float32) for name, pixels in mean.passes.items()}
    view = Rendered(mean_passes, part.attributes, seconds, synchronization_seconds)
    return view, mean.colour_variance.astype(np.float32)


def _parts() -> Iterator[int]:
    """Limit the next render to each part of the samples. Yield the number of its samples."""
    cycles = bpy.context.scene.cycles
    bounds = [cycles.samples * part // SAMPLE_PARTS for part in range(SAMPLE_PARTS + 1)]
    for first, end in pairwise(bounds):
        with ExitStack() as stack:
            stack.enter_context(changed(cycles, "use_sample_subset", True))
            stack.enter_context(changed(cycles, "sample_offset", first))
            stack.enter_context(changed(cycles, "sample_subset_length", end - first))
            yield end - first


class _Mean:
    """The mean of the passes of parts that come one after the other, and the colour's variance.

    It is computed by Welford's method (1962), which keeps all digits. Equal parts have no variance.
    """

    def __init__(self, to_rec_709: Array) -> None:
        self.passes: dict[str, Array] = {}
        self._to_rec_709 = to_rec_709
        self._samples = 0
        self._spread: Array = np.zeros(3)

    def add(self, passes: Mapping[str, Array], samples: int) -> None:
        """Add the passes of a part. It counts as much as it has ``samples``."""
        if not self.passes:
            self.passes = {name: np.zeros_like(pixels) for name, pixels in passes.items()}
            self.passes[_COLOUR] = np.zeros(passes[_COLOUR].shape)
        self._samples += samples
        before = self._distance(passes[_COLOUR])
        for name, mean in self.passes.items():
            mean += samples / self._samples * (passes[name] - mean)
        self._spread = self._spread + samples * before * self._distance(passes[_COLOUR])

    def _distance(self, colour: Array) -> Array:
        """Return how far a part's colour is from the mean, in Rec. 709."""
        return np.asarray((colour - self.passes[_COLOUR])[..., :3] @ self._to_rec_709.T)

    @property
    def colour_variance(self) -> Array:
        """The estimated variance of the mean colour (height, width, 3)."""
        return self._spread / (self._samples * (SAMPLE_PARTS - 1))
