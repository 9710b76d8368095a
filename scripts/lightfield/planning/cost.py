"""What a job costs before it runs: seconds of one core, memory and disk space.

The functions answer for each job of a dataset, in the units that this module's table lists. A
probe, a calibration and an inventory replace guesses as soon as they exist. How long views take to
render is asked of `lightfield.planning.estimate`.

Every job reads this module with the rules, so it must import nothing that takes long.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightfield.configuration.reprojections import LIGHT_GROUPS, Reprojection
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, read_bytes, read_keys, reading
from lightfield.formats import light_groups, passes
from lightfield.formats.render_block import MeasuredTargetError, RenderBlock
from lightfield.planning import sampling
from lightfield.planning.estimate import Estimate, Known, ProbedViews, ViewSize, read_probe
from lightfield.planning.sampling import cost_in_samples
from lightfield.planning.time_limits import longest_job, most_minutes

if TYPE_CHECKING:
    from lightfield.configuration.dataset import Dataset

# Measured values. One core of a 2-core x86-64 machine took these seconds, most of them in the
# garden. Bytes are bpy 5.0's. Reading and reprojection: benchmarks/reprojection.py with batches of
# 16 views of 2048². Sensors: an image of 512², while the machine also did other work. A moving
# camera and compression: the three scenes. A calibration: the courtyard.

# Seconds for a pixel.
SAMPLE_SECONDS = 6e-6  # one sample of path tracing
READ_SECONDS = 4e-8  # reading an EXR with depth
REPROJECTION_SECONDS = 1.5e-7  # computing a pixel of a reprojected view
SENSOR_SECONDS = 4e-7  # a sensor's noise and response
BRACKET_SECONDS = 7e-7  # the same with the weights of a bracket
CHECK_SECONDS = 1e-7  # the validation, and each export
REPORT_SECONDS = 4e-7  # the figures, and the page
# Seconds for a process.
START_UP_SECONDS = 3.0  # bpy, the scene, and Cycles' acceleration structures
JOB_SECONDS = 1.0  # a job without Blender
_MEMBER_SECONDS = 0.5  # a member of a family, beside its views and checks
_WINDOW_SECONDS = 0.07  # a window's render of a calibration, beside its samples
# Relative to other units.
_CAMERA_MOTION_PART = 0.2  # of a view's time: 0.09 to 0.26 with 4 and 16 samples of 64²
_SEARCH_RENDERS = 9  # renders of each window in a calibration's search
_SEARCH_PART = 2.5  # samples of these renders together, relative to the samples for the target
# Bytes on the disk for a pixel, before compression but for PNGs.
COMPRESSED = 0.75  # an EXR's size, relative to its size without compression
_DEPTH_BYTES = {"float": 4, "rounded": 3, "half": 2}
_PNG_BYTES = 2  # 8 bits
_NOISY_BYTES = 3  # 8 bits with noise, which a PNG cannot compress
_WEIGHT_BYTES = 12  # the weights of a bracket
# Bytes of memory for a pixel of a view that is rendered. They were 255 between 64² and 1024².
PIXEL_MEMORY = 300
# The same for each pixel more than a tile has. A view of 8192² took 10.1 GB, and its file 2.7 GB.
TILED_PIXEL_MEMORY = 200
TILE_SIDE = 2048  # Cycles renders views with more pixels than a square of this side in tiles
DENOISED_PIXEL_MEMORY = 1000  # with OpenImageDenoise, which took 910
_GROUP_PIXEL_MEMORY = 70  # more for each light group: 36 of Cycles and its file, 30 of arrays
_PASSES_PIXEL_BYTES = 200  # a temporary file with all passes in 32-bit floats, and a reserve
_GROUP_PASS_PIXEL_BYTES = 12  # more of that file for each light group

# Guesses, used until the true values are known.
UNKNOWN_SCENE = 6_000_000_000  # bytes of memory of a scene without an inventory
_GUESSED_SAMPLES = 256  # a pixel's, with a target error or the .blend's own samples
_GUESSED_LIGHT_GROUPS = 16
# A scene is expected to take this much more memory than its inventory measured.
_SCENE_RESERVE = 1.2

# The page and the figures show at most so many views.
_MOST_SHOWN_VIEWS = 120
# The page of a sequence shows one view of each frame, or more views, but at most so many.
_MOST_VIEWS_OF_SEQUENCE = 240

# Start-up takes at most this part of a shard's time.
_START_UP_PART = 0.05
# More jobs would lengthen the plan, but not render faster. A cluster may get more.
_USUAL_SHARDS = 64
# On a cluster each job is expected to take at least so many minutes. A batch system may take a
# minute to start a job.
_SHORTEST_JOB = 5
# Planning more shards than this takes too long.
_MOST_SHARDS = 10_000


@dataclass(frozen=True)
class Cost:
    """The cost of work: seconds, the memory of its largest process, and disk space.

    ``seconds`` count for one core. ``gpu_seconds`` count for a GPU, and come beside them.
    """

    seconds: float = 0.0
    memory_bytes: int = 0
    disk_bytes: float = 0.0
    gpu_seconds: float = 0.0

    def __add__(self, other: Cost) -> Cost:
        """Return the cost of both, one after the other."""
        return Cost(
            self.seconds + other.seconds,
            max(self.memory_bytes, other.memory_bytes),
            self.disk_bytes + other.disk_bytes,
            self.gpu_seconds + other.gpu_seconds,
        )

    def __rmul__(self, count: int) -> Cost:
        """Return the cost of doing it ``count`` times, one after the other."""
        return Cost(
            count * self.seconds,
            self.memory_bytes,
            count * self.disk_bytes,
            count * self.gpu_seconds,
        )

    @property
    def all_seconds(self) -> float:
        """The seconds of a core and of a GPU, one after the other."""
        return self.seconds + self.gpu_seconds

    def megabytes(self, attempt: int = 1) -> int:
        """Return the memory that a job requests. Each further attempt requests more."""
        return math.ceil(self.memory_bytes / 1e6) * attempt

    def most_minutes(self, cores: float, limit: int | None = None) -> int:
        """Return a job's time limit: several times its estimate, and at least half an hour.

        Its work is shared by ``cores``. The partition may ``limit`` its minutes.
        """
        return most_minutes(self.seconds, cores, limit)

    @property
    def stall_seconds(self) -> int:
        """Seconds after which the work counts as hung: ten times its estimate, and more."""
        return 1800 + math.ceil(10 * self.seconds)


JOB = Cost(JOB_SECONDS)
"""The cost of a small job."""
BLENDER = Cost(START_UP_SECONDS)
"""The cost of a job that starts Blender, and does little more."""


def rendering(dataset: Dataset, views: int | None = None, estimate: Estimate | None = None) -> Cost:
    """Return the cost of a job that renders this many views, by default all of the dataset.

    Without an ``estimate`` of the dataset's views, they take what a probe measured, or a guess.
    """
    return BLENDER + _count(dataset, views) * _rendered_view(dataset, estimate)


def importing(dataset: Dataset, views: int | None = None) -> Cost:
    """Return the cost of a job that imports this many views, by default all of the dataset."""
    return JOB + _count(dataset, views) * _imported_view(dataset)


def computing_flow(dataset: Dataset, views: int | None = None) -> Cost:
    """Return the cost of a job that computes the optical flow of views, by default of all."""
    return JOB + _count(dataset, views) * _flow_of_view(dataset)


def reprojecting(dataset: Dataset, name: str, views: int | None = None) -> Cost:
    """Return the cost of a job of the reprojection ``name`` of views, by default of all."""
    return JOB + _count(dataset, views) * _reprojected_view(dataset, name)


def checking(dataset: Dataset) -> Cost:
    """Return the cost of a job that validates or exports all views and reprojections."""
    return JOB + _checks(dataset)


def drawing(dataset: Dataset) -> Cost:
    """Return the cost of a job that draws the figures, or writes the page."""
    return JOB + _pictures(dataset)


def drawing_frames(frames: Sequence[Dataset]) -> Cost:
    """Return the cost of the job that writes the page of a sequence."""
    views = len(frames) * frames[0].view_count
    shown_views = max(len(frames), min(views, _MOST_VIEWS_OF_SEQUENCE))
    return JOB + Cost(shown_views * frames[0].pixels * REPORT_SECONDS)


def rendering_panorama(dataset: Dataset) -> Cost:
    """Return the cost of the job that renders the panorama."""
    return BLENDER + _panorama(dataset)


def _count(dataset: Dataset, views: int | None) -> int:
    return dataset.view_count if views is None else views


def view_cost(dataset: Dataset) -> Cost:
    """Return the cost of a rendered view, its flow and reprojections, without starts of jobs."""
    reprojected = (_reprojected_view(dataset, name) for name in dataset.reprojections)
    return sum(reprojected, _rendered_view(dataset) + _flow_of_view(dataset))


def members_cost(datasets: Iterable[Dataset], members: int) -> Cost:
    """Return the cost of a job that builds members of a family, each with these ``datasets``."""
    member = Cost(_MEMBER_SECONDS)
    for dataset in datasets:
        member += dataset.view_count * view_cost(dataset) + _checks(dataset)
    return BLENDER + members * member


def pixel_cost(render: RenderBlock, calibration: Path | None) -> float:
    """Return the cost of a pixel in samples, with denoising, of views with ``render`` settings.

    The file of a ``calibration`` says it, because adaptive sampling takes fewer samples than it
    may. Raises `UserError` for a damaged file.
    """
    if calibration is None:
        assert isinstance(render.samples, int)
        return cost_in_samples(render.samples, render.denoise)
    with reading(calibration, "calibration"):
        return float(read_keys(calibration, "calibrate.py", "cost_samples")["cost_samples"])


def kwh(machine_seconds: float, watts: float) -> float:
    """Return the energy of a machine that works for a time, and takes ``watts``."""
    return watts * machine_seconds / 3.6e6


def rendering_memory(scene: int, pixels: int, denoise: bool, groups: int = 0) -> int:
    """Return the bytes of a process that renders views of this many pixels.

    ``scene`` is the inventory's ``memory_bytes``: the memory for a view of very few pixels. The
    views have this many light ``groups``.
    """
    in_tile = pixels if denoise else min(pixels, TILE_SIDE**2)
    pixel_bytes = DENOISED_PIXEL_MEMORY if denoise else PIXEL_MEMORY
    memory = in_tile * pixel_bytes + (pixels - in_tile) * TILED_PIXEL_MEMORY
    return scene + memory + pixels * groups * _GROUP_PIXEL_MEMORY


def temporary_bytes(pixels: int, groups: int) -> int:
    """Return the bytes of a view's temporary file with all passes and light groups."""
    return pixels * (_PASSES_PIXEL_BYTES + groups * _GROUP_PASS_PIXEL_BYTES)


def light_group_count(dataset: Dataset) -> int:
    """Return the number of light groups, by the scene YAML or the inventory, or as a guess."""
    setting = dataset.render.light_groups
    if setting is None:
        return 0
    names = light_groups.names_in(setting)
    if names is not None:
        return len(names) + 1
    try:
        return len(_content(dataset.inventory)["emitters"])
    except (OSError, *DAMAGE):
        return _GUESSED_LIGHT_GROUPS


# Shards.


def shard_count(dataset: Dataset) -> int:
    """Return how many shards a dataset gets before the first is rendered.

    Shards are as short as possible, so that many processes can work at once. But start-up must stay
    a small part of a shard's time, and a cluster's job must last some minutes. The count must
    depend only on the configuration and the probe.
    """
    view_count = dataset.view_count
    probe = _core_probe_of(dataset)
    seconds = probe.estimate.view_seconds if probe else _planned_view_seconds(dataset)
    least_seconds = START_UP_SECONDS / _START_UP_PART
    most = _USUAL_SHARDS
    if dataset.cluster:
        speed = dataset.cluster.speed
        longest = 60 * longest_job(dataset) * speed
        least = min(60 * _SHORTEST_JOB * speed, longest)
        least_seconds = max(least_seconds, least)
        short_jobs = math.ceil(view_count * seconds / longest)
        most = min(max(most, dataset.cluster.jobs, short_jobs), _MOST_SHARDS)
    shortest = math.ceil(least_seconds / max(seconds, 1e-6))
    return min(math.ceil(view_count / shortest), most)


def shard_threads(cores: int, shards: int, need: int, available: int) -> int:
    """Return how many cores each of this many ``shards`` takes. Each needs ``need`` bytes.

    A shard takes more than one core in two cases. There are fewer shards than cores, or a shard for
    each core would not fit into the ``available`` memory. A tenth is left to other programs.
    """
    shards_that_fit = max(1, int(0.9 * available) // need)
    return max(1, cores // max(1, shards), math.ceil(cores / shards_that_fit))


def _planned_view_seconds(dataset: Dataset) -> float:
    """Return the seconds for a view without a probe, a calibration, and denoising."""
    if dataset.imported:
        reprojected = [_reprojected_view(dataset, name) for name in dataset.reprojections]
        return _imported_view(dataset).seconds + sum(each.seconds for each in reprojected)
    return dataset.pixels * _planned_samples(dataset) * _sample_seconds(dataset)


# Measurements.


def view_size(dataset: Dataset) -> ViewSize:
    """Return the size of a dataset's rendered views."""
    samples = _known_samples(dataset)
    effort = None if samples is None else cost_in_samples(samples, dataset.render.denoise)
    if dataset.calibration:
        with suppress(OSError, *DAMAGE):
            effort = float(_content(dataset.calibration)["cost_samples"])
    width, height = dataset.rig.camera.resolution
    return ViewSize((width, height), samples, effort)


def estimate_of(dataset: Dataset, known: Known | None = None, on_gpu: bool = False) -> Estimate:
    """Return how long a view of a dataset takes to render, by all that is known, or as a guess.

    By default, the probe is known. If nothing is known of a GPU, the estimate is a core's.
    """
    known = known or Known(probe_of(dataset))
    size = view_size(dataset)
    devices = (True, False) if on_gpu else (False,)
    estimates = (known.estimate(size, device) for device in devices)
    return next((each for each in estimates if each), None) or _guess(dataset, size)


def _guess(dataset: Dataset, size: ViewSize) -> Estimate:
    """Return the guess for a view on one core, of which nothing was measured."""
    effort = size.effort
    if effort is None:
        effort = cost_in_samples(_planned_samples(dataset), dataset.render.denoise)
    seconds = size.pixels * effort * _sample_seconds(dataset)
    return Estimate(seconds, "a guess: nothing was measured")


def probe_path(dataset: Dataset) -> Path:
    """Return the probe of a dataset. The probe of a sequence's first frame counts for all."""
    frames = [*dataset.rig.sequence.folders][:1] if dataset.rig.sequence else []
    return Path(dataset.work_root, dataset.scene_folder, dataset.rig_name, *frames, "probe.json")


def probe_of(dataset: Dataset) -> ProbedViews | None:
    """Return the probe of a dataset's rig. None without a sound one. It may be out of date."""
    path = probe_path(dataset)
    try:
        return _known_probe(path, path.stat().st_mtime_ns)
    except (OSError, UserError):
        return None


def _core_probe_of(dataset: Dataset) -> ProbedViews | None:
    """Return the probe of a dataset's views on one core. None without a valid one."""
    probe = probe_of(dataset)
    return probe if probe and probe.is_of(view_size(dataset), on_gpu=False) else None


@lru_cache
def _known_probe(path: Path, _changed: int) -> ProbedViews:
    return read_probe(path)


# The views of a dataset, one at a time.


def _rendered_view(dataset: Dataset, estimate: Estimate | None = None) -> Cost:
    """Return the cost of a rendered view with its passes. By default, the probe estimates it."""
    estimate = estimate or estimate_of(dataset)
    seconds, memory = estimate.view_seconds, _memory(dataset, dataset.pixels)
    if estimate.on_gpu:
        return Cost(0, memory, _view_bytes(dataset), seconds)
    return Cost(seconds, memory, _view_bytes(dataset))


def _view_bytes(dataset: Dataset) -> float:
    """Return the size of a rendered view with its passes, by a probe or as a guess."""
    probe = probe_of(dataset)
    if probe and probe.is_of(view_size(dataset), probe.on_gpu):
        return probe.view_bytes
    render = dataset.render
    pixel_bytes = 6 * (1 + light_group_count(dataset))
    pixel_bytes += sum(each.bytes for each in render.selected_passes if not passes.is_group(each))
    if dataset.depth:
        pixel_bytes += _DEPTH_BYTES[render.depth_precision]
    return dataset.pixels * pixel_bytes * COMPRESSED


def _imported_view(dataset: Dataset) -> Cost:
    return Cost(dataset.pixels * READ_SECONDS)


def _flow_of_view(dataset: Dataset) -> Cost:
    size = passes.FLOW.bytes * COMPRESSED * dataset.pixels if dataset.flow else 0.0
    return Cost(disk_bytes=size)


def _reprojected_view(dataset: Dataset, name: str) -> Cost:
    """Return the cost to read a view, to reproject it, and to develop it."""
    reprojection = dataset.reprojections[name]
    all_groups = light_group_count(dataset)
    made_pixels = _reprojected_pixels(dataset, name)
    if reprojection.relight == light_groups.EACH:
        made_pixels *= all_groups
    read_pixels = dataset.pixels
    if reprojection.relight is not None:
        read_pixels *= 1 + all_groups
    pass_names = reprojection.passes
    groups = all_groups if LIGHT_GROUPS in pass_names else 0
    other_passes = [passes.by_name(each) for each in pass_names if each != LIGHT_GROUPS]
    # Light groups are resampled twice: once to add them up.
    resampled_passes = 2 * groups + len(other_passes)
    read_pixels += dataset.pixels * resampled_passes
    pixel_seconds = REPROJECTION_SECONDS * (1 + resampled_passes)
    if sensor := reprojection.sensor:
        pixel_seconds += SENSOR_SECONDS if sensor.bracket is None else BRACKET_SECONDS
    pass_bytes = COMPRESSED * (6 * groups + sum(each.bytes for each in other_passes))
    pixel_bytes = _developed_bytes(reprojection) + pass_bytes
    return Cost(
        read_pixels * READ_SECONDS + made_pixels * pixel_seconds,
        disk_bytes=made_pixels * pixel_bytes,
    )


def _developed_bytes(reprojection: Reprojection) -> float:
    """Return the bytes of a pixel of a reprojection, without its passes."""
    if reprojection.has_depth:
        return 10 * COMPRESSED
    sensor = reprojection.sensor
    if sensor is None:
        return _PNG_BYTES * reprojection.bits / 8
    weights = 0.0 if sensor.bracket is None else _WEIGHT_BYTES * COMPRESSED
    return _NOISY_BYTES * reprojection.bits / 8 + weights


def _memory(dataset: Dataset, pixels: int) -> int:
    """Return the memory of a process that renders views of this many pixels."""
    try:
        scene = int(_SCENE_RESERVE * _content(dataset.inventory)["memory_bytes"])
    except (OSError, *DAMAGE):
        scene = UNKNOWN_SCENE
    # Before the calibration, assume that it will choose to denoise.
    denoise = dataset.render.given_denoise is not False
    return rendering_memory(scene, pixels, denoise, light_group_count(dataset))


def _sample_seconds(dataset: Dataset) -> float:
    """Return the guessed seconds of a sample of a pixel on one core."""
    is_moving = dataset.render.camera_motion is not None
    return SAMPLE_SECONDS * (1 + _CAMERA_MOTION_PART if is_moving else 1)


def _known_samples(dataset: Dataset) -> int | None:
    """Return a pixel's samples. None if a target error decides, or an unknown .blend."""
    samples = dataset.render.samples
    if samples is None or isinstance(samples, int):
        return samples
    try:
        in_file = int(_content(dataset.inventory)["blend"]["samples"])
    except (OSError, *DAMAGE):
        return None
    return min(in_file, dataset.render.most_samples or in_file)


def _planned_samples(dataset: Dataset) -> int:
    """Return a pixel's samples. With a target error, or the .blend's own, it is a fixed guess."""
    render = dataset.render
    if isinstance(render.samples, int):
        return render.samples
    return min(render.most_samples or _GUESSED_SAMPLES, _GUESSED_SAMPLES)


def _reprojected_pixels(dataset: Dataset, name: str) -> int:
    """Return the pixels of a view's reprojection. A cube map has six images."""
    camera = dataset.reprojections[name].camera or dataset.rig.camera
    return math.prod(camera.resolution) * len(dataset.lens_maps(name))


def _all_pixels(dataset: Dataset) -> int:
    """Return the pixels of a view and its reprojections."""
    return dataset.pixels + sum(
        _reprojected_pixels(dataset, name) for name in dataset.reprojections
    )


def _content(path: str | None) -> Any:
    """Return the content of a JSON file. Raises OSError if the dataset has no such file."""
    if path is None:
        raise FileNotFoundError
    return _known_content(path, Path(path).stat().st_mtime_ns)


@lru_cache(maxsize=64)
def _known_content(path: str, _changed: int) -> Any:
    """Return the content of a JSON file. A change of its time makes the cache read it again."""
    return json.loads(read_bytes(path))


# The other jobs of a dataset.


def _checks(dataset: Dataset) -> Cost:
    """Return the cost to validate or export all views and reprojections."""
    return Cost(dataset.view_count * _all_pixels(dataset) * CHECK_SECONDS)


def _pictures(dataset: Dataset) -> Cost:
    """Return the cost to draw the figures, or to write the page."""
    shown_views = min(dataset.view_count, _MOST_SHOWN_VIEWS)
    return Cost(shown_views * _all_pixels(dataset) * REPORT_SECONDS)


def _panorama(dataset: Dataset) -> Cost:
    """Return the cost of the panorama, which is twice as wide as high."""
    pixels = dataset.panorama_width**2 // 2
    seconds = _rendered_view(dataset).seconds * pixels / dataset.pixels
    return Cost(seconds, _memory(dataset, pixels))


def calibrating(dataset: Dataset) -> Cost:
    """Return the cost of the calibration of a scene, whose first rig's dataset this is.

    The estimate takes the error of N samples a pixel as 1 / N. It is 0.4 / N in the courtyard,
    1.4 / N in the barbershop, and 2.6 / N in the garden.
    """
    target = dataset.render.target_error
    if target is None:
        return Cost()
    resolution, most = dataset.rig.camera.resolution, dataset.render.most_samples
    if isinstance(target, MeasuredTargetError):
        return calibration_of_samples(target.of_samples, resolution, most)
    needed = 1 / target
    seeds = sampling.FEWEST_SEEDS
    samples = sampling.REFERENCE_SAMPLES
    while seeds < sampling.MOST_SEEDS and seeds * samples * sampling.REFERENCE_PART < needed:
        seeds *= 2
    return _calibration_of(needed, (seeds, samples), resolution, most)


def calibration_of_samples(
    count: int, resolution: tuple[int, int], most: int | None = None
) -> Cost:
    """Return the cost of a calibration for the error of ``count`` samples, of at most ``most``."""
    return _calibration_of(count, sampling.reference_of_samples(count), resolution, most)


def _calibration_of(
    needed: float, reference: tuple[int, int], resolution: tuple[int, int], most: int | None
) -> Cost:
    """Return the cost of a calibration for an error that needs so many plain samples.

    A ``reference`` has so many seeds, of so many samples each.
    """
    seeds, samples_of_seed = reference
    # Windows and held-out windows have references. Plain path tracing and the search add samples.
    searched = min(needed, most or needed)
    samples = 2 * seeds * samples_of_seed + sum(sampling.PLAIN_SAMPLES) + _SEARCH_PART * searched
    renders = 2 * seeds + _SEARCH_RENDERS
    pixels = min(*resolution, sampling.WINDOW_SIZE) ** 2
    window = renders * _WINDOW_SECONDS + pixels * samples * SAMPLE_SECONDS
    return BLENDER + sampling.PROBES * Cost(window)
