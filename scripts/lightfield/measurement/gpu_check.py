"""Whether a GPU renders what the processor renders, and how long the full datasets take on it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.measurement import metrics
from lightfield.measurement.sampling import standard_error
from lightfield.measurement.trials import Trial, Trials

# The view that both render: pixels of its longer side, renders on each, and samples of each.
SIZE, SEEDS, SAMPLES = 128, 4, 16
# Means of so many pixels along a side are compared: they are less noisy than the pixels.
BLOCK = 8
# Squared differences, in units of what noise alone makes, may be so many.
MOST_OF_NOISE = 2.0
# The mean of all light may differ by so many standard errors.
MOST_ERRORS = 6.0
# Depths are the same within this part, but at silhouettes, where rounding decides what is hit.
SAME_DEPTH, SILHOUETTES = 1e-4, 1e-3


@dataclass(frozen=True)
class Comparison:
    """How renders of the same view on two devices differ.

    ``colour`` is the mean squared difference of their means over blocks of pixels, relative as
    `metrics.relative_mse` is, in units of what the noise of both makes: 1 where nothing else
    differs. ``light`` is the difference of all light, in standard errors. ``depth`` is the part of
    the pixels whose depths differ by more than `SAME_DEPTH` of themselves, or of which only one is
    a hit.
    """

    colour: float
    light: float
    depth: float

    @property
    def same(self) -> bool:
        """Whether the devices agree."""
        return (
            self.colour <= MOST_OF_NOISE
            and abs(self.light) <= MOST_ERRORS
            and self.depth <= SILHOUETTES
        )


def compare(
    one: Sequence[Trial], other: Sequence[Trial], mask: metrics.Mask, block: int = BLOCK
) -> Comparison:
    """Compare at least two renders, of different seeds, with as many of another device.

    ``mask`` (h, w) says which pixels the lens has a ray for.
    """
    full = _blocks(mask[..., None].astype(float), block)[..., 0] == 1
    reference, found = (
        metrics.make_reference([_blocks(trial.colour, block) for trial in trials], None, full)
        for trials in (one, other)
    )
    weights = reference.weights
    noise = ((reference.variance + found.variance)[full] * weights).mean()
    apart = ((reference.colour - found.colour)[full] ** 2 * weights).mean()
    totals = [
        [trial.colour[mask].mean(dtype=np.float64) for trial in made] for made in (one, other)
    ]
    error = math.hypot(*(standard_error(total) for total in totals))
    light = _over(fmean(totals[1]) - fmean(totals[0]), error)
    depths = one[0].depth, other[0].depth
    differ = np.zeros(mask.shape, dtype=bool)
    if depths[0] is not None and depths[1] is not None:
        with np.errstate(invalid="ignore"):
            near = np.abs(depths[1] / depths[0] - 1) <= SAME_DEPTH
        differ = ~near & ~(np.isinf(depths[0]) & np.isinf(depths[1]))
    return Comparison(_over(apart, noise), light, float(differ[mask].mean()))


def _over(difference: float, noise: float) -> float:
    """Return a difference over noise, of which a picture of nothing but sky has none."""
    return 0.0 if difference == 0 else float(difference / noise) if noise else math.inf


def _blocks(pixels: NDArray[Any], block: int) -> Any:
    """Return the means of all whole blocks of pixels (h, w, channels)."""
    rows, columns = (side // block for side in pixels.shape[:2])
    whole = pixels[: rows * block, : columns * block].astype(np.float64)
    return whole.reshape(rows, block, columns, block, -1).mean(axis=(1, 3))


def check(
    maker: Trials, device: str, render: Mapping[str, Any], full: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Render the first view small on both, and at its own size on the GPU alone, for its time.

    ``render`` holds the scene's settings, and ``full`` the ``views`` and ``resolution`` of each of
    its datasets at full size. Returns the comparison, the seconds that a megapixel's samples take
    on a core and on the GPU, and the hours of each dataset there.
    """
    lens = maker.lens
    scale = min(1.0, SIZE / max(lens.width, lens.height))
    small = lens.resized(*(max(BLOCK, round(side * scale)) for side in (lens.width, lens.height)))
    made = []
    for first, on in ((1, "cpu"), (1 + SEEDS, device)):
        there = maker.on(on, small)
        seeds = range(first, first + SEEDS)
        made.append([there.render(there.whole, seed, {"samples": SAMPLES}) for seed in seeds])
    comparison = compare(made[0], made[1], there.mask(there.whole))
    core = median(trial.seconds for trial in made[0]) / (small.width * small.height * SAMPLES)
    # At its own size a GPU has enough to do.
    there = maker.on(device, lens)
    timed = there.render(there.whole, 1, {"samples": SAMPLES})
    gpu = timed.seconds / (lens.width * lens.height * SAMPLES)
    return {
        "same": comparison.same,
        **asdict(comparison),
        "devices": [trials[0].device for trials in made],
        "size": [small.width, small.height],
        "core_seconds": core * 1e6,
        "gpu_seconds": gpu * 1e6,
        "samples": render["samples"],
        "hours": {
            name: dataset["views"]
            * math.prod(dataset["resolution"])
            * render["samples"]
            * gpu
            / 3600
            for name, dataset in full.items()
        },
    }


def table(name: str, found: Mapping[str, Any]) -> str:
    """Return what `check` has found, in Markdown."""
    faster = found["core_seconds"] / found["gpu_seconds"]
    rows = [f"| {dataset} | {hours:.3g} |" for dataset, hours in found["hours"].items()]
    return "\n".join(
        [
            f"# {name}: the GPU beside the processor",
            "",
            f"{'The same' if found['same'] else 'Not the same'}: colours differ by "
            f"{found['colour']:.2f} of what noise makes (at most {MOST_OF_NOISE:g}), all light by "
            f"{abs(found['light']):.1f} standard errors (at most {MOST_ERRORS:g}), and of the "
            f"depths {found['depth']:.2%} by more than {SAME_DEPTH:g} of themselves (at most "
            f"{SILHOUETTES:.1%}).",
            f"A sample of a megapixel takes {found['gpu_seconds']:.3g} s on the GPU, {faster:.3g} "
            "times as fast as on one core.",
            "",
            f"| dataset at full size, {found['samples']} samples | GPU hours |",
            "| --- | ---: |",
            *rows,
            f"| together | {sum(found['hours'].values()):.3g} |",
            "",
        ]
    )
