"""Compares a GPU's renders with the processor's, and estimates the full datasets' GPU hours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core import processors, units
from lightfield.core.errors import UserError
from lightfield.core.files import write_json, write_text
from lightfield.measurement import metrics, trials
from lightfield.measurement.trials import Trial, Trials
from lightfield.planning.cost import pixel_cost
from lightfield.planning.estimate import CheckedGpu, Known, ViewSize
from lightfield.planning.sampling import standard_error
from lightfield.stages.measurement import FullSize, GpuCheck
from lightfield.workflow.known_times import finished_of, read_known

# The longer side of the view that both devices render, in pixels.
SIZE = 128
# The number of renders on each device, and the samples of each.
SEEDS = 4
SAMPLES = 16
# Blocks of this many pixels along a side are compared, because means are less noisy than pixels.
BLOCK = 8
# The largest squared difference of the same picture, in units of the difference by noise alone.
_MOST_OF_NOISE = 2.0
# The largest difference of all light, in standard errors.
_MOST_ERRORS = 6.0
# Depths of the same pixel on two devices differ by less than this part: only rounding differs.
EQUAL_DEPTH = 1e-4
# At silhouettes rounding decides which surface a ray hits, so this part of the pixels may differ.
_SILHOUETTES = 1e-3


@dataclass(frozen=True)
class DeviceComparison:
    """The difference between renders of the same view on two devices.

    - ``colour``: the mean squared difference of block means, relative as in `metrics.relative_mse`.
      The unit is the difference by noise alone: 1 if nothing but noise differs.
    - ``light``: the difference of all light, in standard errors.
    - ``depth``: the part of the pixels whose depths differ by more than `EQUAL_DEPTH`, or where
      only one device hits anything.
    """

    colour: float
    light: float
    depth: float

    @property
    def same(self) -> bool:
        """Whether the devices render the same picture."""
        return (
            self.colour <= _MOST_OF_NOISE
            and abs(self.light) <= _MOST_ERRORS
            and self.depth <= _SILHOUETTES
        )


def compare(
    first: Sequence[Trial], second: Sequence[Trial], mask: metrics.Mask, block: int = BLOCK
) -> DeviceComparison:
    """Compare at least two renders, of different seeds, with as many of another device.

    ``mask`` (h, w) says which pixels the lens has a ray for.
    """
    is_complete = _blocks(mask[..., None].astype(float), block)[..., 0] == 1
    first_mean = _block_means(first, block, is_complete)
    second_mean = _block_means(second, block, is_complete)
    weights = first_mean.weights
    noise = ((first_mean.variance + second_mean.variance)[is_complete] * weights).mean()
    difference = ((first_mean.colour - second_mean.colour)[is_complete] ** 2 * weights).mean()
    first_light = [trial.colour[mask].mean(dtype=np.float64) for trial in first]
    second_light = [trial.colour[mask].mean(dtype=np.float64) for trial in second]
    error = math.hypot(standard_error(first_light), standard_error(second_light))
    light = _over(fmean(second_light) - fmean(first_light), error)
    first_depth = first[0].depth
    second_depth = second[0].depth
    differ = np.zeros(mask.shape, dtype=bool)
    if first_depth is not None and second_depth is not None:
        differ = _depths_differ(first_depth, second_depth)
    return DeviceComparison(_over(difference, noise), light, float(differ[mask].mean()))


def _depths_differ(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where two depths (h, w) differ by more than `EQUAL_DEPTH`, or only one is infinite."""
    with np.errstate(invalid="ignore"):
        near = np.abs(second / first - 1) <= EQUAL_DEPTH
    differ: NDArray[np.bool_] = ~near & ~(np.isinf(first) & np.isinf(second))
    return differ


def _block_means(trials: Sequence[Trial], block: int, mask: metrics.Mask) -> metrics.Reference:
    """Return the mean of renders in blocks. ``mask`` says which blocks count."""
    return metrics.make_reference([_blocks(trial.colour, block) for trial in trials], None, mask)


def _over(difference: float, noise: float) -> float:
    """Return a difference over noise. Return 0 for equal pictures, which may have no noise."""
    if difference == 0:
        return 0.0
    return float(difference / noise) if noise else math.inf


def _blocks(pixels: NDArray[Any], block: int) -> Any:
    """Return the means of all complete blocks of pixels (h, w, channels)."""
    rows, columns = (side // block for side in pixels.shape[:2])
    complete = pixels[: rows * block, : columns * block].astype(np.float64)
    return complete.reshape(rows, block, columns, block, -1).mean(axis=(1, 3))


def make(job: GpuCheck) -> None:
    """Write and print the comparison, and the hours of full datasets.

    Raises `UserError` if there is no GPU, or if it renders another picture.
    """
    device = _gpu_of(job)
    lightfield, renderer = trials.of_calibrated(job)
    cost_samples = pixel_cost(lightfield.render, job.calibration)
    known = {
        dataset: read_known(dict(job.probe).get(dataset), None, finished_of(job.finished, dataset))
        for dataset in job.settings.full
    }
    content = check(renderer, device, cost_samples)
    # With a target error, each dataset's calibration chooses its samples.
    samples = None if lightfield.render.target_error else lightfield.render.samples
    assert samples is None or isinstance(samples, int)
    content |= full_hours(content, samples, job.settings.full, known)
    name = job.output.name
    text = table(name, content)
    print(text)
    if not content["same"]:
        raise UserError(
            f"{name}: the GPU renders another picture than the processor: colours differ "
            f"{content['colour']:.2f} times as much as noise explains, all light by "
            f"{content['light']:.1f} standard errors, and {content['depth']:.2%} of the depths "
            "differ; try another driver, or render with device=cpu"
        )
    write_text(job.output.with_suffix(".md"), text)
    write_json(job.output.with_suffix(".json"), content)
    print(
        f"note: {name}: the GPU renders the same picture; it takes "
        f"{units.duration(3600 * sum(content['hours'].values()))} for all datasets at full size"
    )


def _gpu_of(job: GpuCheck) -> str:
    """Return the device to check. Raises `UserError` if this machine does not have it."""
    # Without a GPU, nothing is rendered.
    with processors.only(job.threads):
        from lightfield.rendering.setup import cycles

    device = "gpu" if job.device == "auto" else job.device
    if cycles.device_name(device) == "cpu":
        raise UserError("device: is cpu; gpu_check wants auto, or the name of a GPU's kind")
    return device


def check(renderer: Trials, device: str, cost_samples: float) -> dict[str, Any]:
    """Compare small renders of the first view on both devices, and time a large one on the GPU.

    ``cost_samples`` is the cost of a pixel of the scene in samples, with denoising. Returns the
    comparison, and the seconds of a sample of a megapixel on a core and on the GPU.
    """
    lens = renderer.lens
    scale = min(1.0, SIZE / max(lens.width, lens.height))
    small = lens.resized(*(max(BLOCK, round(side * scale)) for side in (lens.width, lens.height)))
    settings = {"samples": SAMPLES}
    renders = []
    for first_seed, name in ((1, "cpu"), (1 + SEEDS, device)):
        on_device = renderer.on(name, small)
        seeds = range(first_seed, first_seed + SEEDS)
        renders.append([on_device.render(on_device.first_view, s, settings) for s in seeds])
    comparison = compare(renders[0], renders[1], on_device.mask(on_device.first_view))
    core = median(trial.seconds for trial in renders[0]) / (small.width * small.height * SAMPLES)
    # Time a large view: a small one would not keep a GPU busy.
    on_gpu = renderer.on(device, lens)
    timed = on_gpu.render(on_gpu.first_view, 1, settings)
    gpu = timed.seconds / (lens.width * lens.height * SAMPLES)
    return {
        "same": comparison.same,
        **asdict(comparison),
        "devices": [trials[0].device for trials in renders],
        "size": [small.width, small.height],
        "core_seconds": core * 1e6,
        "gpu_seconds": gpu * 1e6,
        "samples": cost_samples,
    }


def full_hours(
    content: Mapping[str, Any],
    samples: int | None,
    full: Mapping[str, FullSize],
    known: Mapping[str, Known],
) -> dict[str, Any]:
    """Return the GPU hours of each ``full`` dataset, and lines that say what estimates them.

    ``content`` is the result of `check`. Of some datasets more is ``known``. ``samples`` is None if
    a target error decides.
    """
    checked = CheckedGpu(content["gpu_seconds"] / 1e6, content["samples"])
    hours, lines = {}, []
    for name, size in full.items():
        width, height = size.resolution
        view_size = ViewSize((width, height), samples, content["samples"])
        estimate = replace(known[name], gpu_check=checked).estimate(view_size, on_gpu=True)
        assert estimate
        hours[name] = size.views * estimate.view_seconds / 3600
        lines.append(estimate.line(name, size.views))
    return {"hours": hours, "rendering": lines}


def table(name: str, content: Mapping[str, Any]) -> str:
    """Return the result of `check` in Markdown."""
    faster = content["core_seconds"] / content["gpu_seconds"]
    rows = [f"| {dataset} | {hours:.3g} |" for dataset, hours in content["hours"].items()]
    return "\n".join(
        [
            f"# {name}: the GPU compared with the processor",
            "",
            f"{'Both' if content['same'] else 'They do not'} render the same picture. Colours "
            f"differ {content['colour']:.2f} times as much as noise explains (at most "
            f"{_MOST_OF_NOISE:g}). All light differs by {abs(content['light']):.1f} standard "
            f"errors (at most {_MOST_ERRORS:g}). {content['depth']:.2%} of the depths differ by "
            f"more than a part of {EQUAL_DEPTH:g} (at most {_SILHOUETTES:.1%}).",
            f"A sample of a megapixel takes {units.duration(content['gpu_seconds'])} on the GPU, "
            f"{faster:.3g} times as fast as on one core.",
            "",
            f"| dataset at full size, {content['samples']:g} samples with denoising | GPU hours |",
            "| --- | ---: |",
            *rows,
            f"| together | {sum(content['hours'].values()):.3g} |",
            "",
            *(f"- {line}" for line in content["rendering"]),
            "",
        ]
    )
