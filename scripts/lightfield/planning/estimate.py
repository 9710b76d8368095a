"""Estimates a dataset's time, memory and disk space before it is rendered."""

import json
import math
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from statistics import fmean

from lightfield.configuration.dataset_paths import DatasetPaths
from lightfield.configuration.reprojections import LIGHT_GROUPS, Reprojection
from lightfield.core.files import DAMAGE
from lightfield.formats import light_groups, passes
from lightfield.planning import memory
from lightfield.planning.unit_costs import (
    BRACKET_SECONDS,
    CAMERA_MOTION_PART,
    CHECK_SECONDS,
    COMPRESSED,
    DENOISING_SAMPLES,
    MOST_SHOWN_VIEWS,
    NOISY_BYTES,
    READ_SECONDS,
    REPORT_SECONDS,
    REPROJECTION_SECONDS,
    SECONDS_PER_SAMPLE,
    SENSOR_SECONDS,
    START_UP_SECONDS,
    WEIGHT_BYTES,
)

# A pixel's samples if a target error is given instead.
_GUESSED_SAMPLES = 256
# The light groups of a scene whose emitters are not known yet.
_GUESSED_LIGHT_GROUPS = 16
# Start-up takes at most this part of a shard's time.
_START_UP_PART = 0.05
# More jobs would lengthen the plan, but not render faster. A cluster may get more.
_USUAL_SHARDS = 64
# On a cluster each job is expected to take at most so long.
_CLUSTER_JOB_MINUTES = 20
# Planning more shards than this takes too long.
_MOST_SHARDS = 10_000
# Bytes for a pixel of an 8-bit PNG.
_PNG_BYTES = 2


class Estimate:
    """Estimates for a dataset, from its settings and from measurements of its scene."""

    def __init__(self, dataset: DatasetPaths) -> None:
        self.dataset = dataset

    @cached_property
    def view_seconds(self) -> float:
        """Seconds that one core takes to render a view, by a probe or as a guess."""
        if self._probe:
            return self._probe[0]
        return self.dataset.pixels * self._cost_samples * self._sample_seconds

    @property
    def _sample_seconds(self) -> float:
        """Seconds that one core takes for a sample of a pixel."""
        is_moving = self.dataset.render.camera_motion is not None
        return SECONDS_PER_SAMPLE * (1 + CAMERA_MOTION_PART if is_moving else 1)

    @cached_property
    def view_bytes(self) -> float:
        """Bytes of a rendered view with its passes, by a probe or as a guess."""
        if self._probe:
            return self._probe[1]
        render = self.dataset.render
        pixel_bytes = 6 * (1 + self.light_group_count)
        pixel_bytes += sum(
            each.bytes for each in render.selected_passes if not passes.is_group(each)
        )
        if self.dataset.depth:
            pixel_bytes += {"float": 4, "rounded": 3, "half": 2}[render.depth_precision]
        return self.dataset.pixels * pixel_bytes * COMPRESSED

    @property
    def all_view_bytes(self) -> float:
        """Bytes of a view, its flow, and its reprojections."""
        size = self.view_bytes
        if self.dataset.flow:
            size += passes.FLOW.bytes * COMPRESSED * self.dataset.pixels
        reprojected_size = 0.0
        for name, reprojection in self.dataset.reprojections.items():
            reprojected_size += self._made_pixels(name) * self._reprojected_pixel_bytes(
                reprojection
            )
        return size + reprojected_size

    def _made_pixels(self, name: str) -> float:
        """Return the pixels that a reprojection makes of a view, in all lights."""
        pixels = self._reprojected_pixels(name)
        if self.dataset.reprojections[name].relight == light_groups.EACH:
            pixels *= self.light_group_count
        return pixels

    @cached_property
    def light_group_count(self) -> int:
        """The number of light groups, by the scene YAML or the inventory, or as a guess."""
        setting = self.dataset.render.light_groups
        if setting is None:
            return 0
        names = light_groups.names_in(setting)
        if names is not None:
            return len(names) + 1
        try:
            return len(json.loads(Path(str(self.dataset.inventory)).read_bytes())["emitters"])
        except (OSError, *DAMAGE):
            return _GUESSED_LIGHT_GROUPS

    def _reprojected_pixel_bytes(self, reprojection: Reprojection) -> float:
        """Return the bytes of a pixel of a reprojection, with the files beside its views."""
        groups, others = self._reprojected_passes(reprojection)
        pass_bytes = COMPRESSED * (6 * groups + sum(each.bytes for each in others))
        if reprojection.has_depth:
            return 10 * COMPRESSED + pass_bytes
        if reprojection.sensor is None:
            return _PNG_BYTES * reprojection.bits / 8 + pass_bytes
        size = NOISY_BYTES * reprojection.bits / 8
        if reprojection.sensor.bracket is not None:
            size += WEIGHT_BYTES * COMPRESSED
        return size

    def _reprojected_passes(self, reprojection: Reprojection) -> tuple[int, list[passes.Pass]]:
        """Return the number of a reprojection's light groups, and its other passes."""
        names = reprojection.passes
        groups = self.light_group_count if LIGHT_GROUPS in names else 0
        return groups, [passes.by_name(name) for name in names if name != LIGHT_GROUPS]

    def memory_bytes(self, pixels: int) -> int:
        """Return the memory in bytes of a process that renders views of this many pixels.

        The inventory measures the scene's part, to which this adds a fifth.
        """
        scene = memory.UNKNOWN_SCENE
        inventory = Path(str(self.dataset.inventory))
        if inventory.is_file():
            scene = _scene_memory(inventory, inventory.stat().st_mtime_ns)
        # Before the calibration, assume that it will choose to denoise.
        denoise = self.dataset.render.given_denoise
        return memory.needed(scene, pixels, denoise is not False, self.light_group_count)

    @property
    def view_memory_bytes(self) -> int:
        """The memory in bytes of a process that renders the dataset's own views."""
        return self.memory_bytes(self.dataset.pixels)

    @property
    def panorama_seconds(self) -> float:
        """Seconds that one core takes for the panorama, which is twice as wide as high."""
        pixels = self.dataset.panorama_width**2 / 2
        return START_UP_SECONDS + self.view_seconds * pixels / self.dataset.pixels

    def reprojection_seconds(self, name: str) -> float:
        """Return the seconds that one core takes to read a view, reproject and develop it."""
        reprojection = self.dataset.reprojections[name]
        read_pixels = self.dataset.pixels
        if reprojection.relight is not None:
            read_pixels *= 1 + self.light_group_count
        # Light groups are resampled twice: once to add them up.
        groups, others = self._reprojected_passes(reprojection)
        resampled_passes = 2 * groups + len(others)
        read_pixels += self.dataset.pixels * resampled_passes
        pixel_seconds = REPROJECTION_SECONDS * (1 + resampled_passes)
        if reprojection.sensor:
            is_bracket = reprojection.sensor.bracket is not None
            pixel_seconds += BRACKET_SECONDS if is_bracket else SENSOR_SECONDS
        return read_pixels * READ_SECONDS + self._made_pixels(name) * pixel_seconds

    @property
    def import_seconds(self) -> float:
        """Seconds that one core takes to import a view."""
        return self.dataset.pixels * READ_SECONDS

    @property
    def check_seconds(self) -> float:
        """Seconds that one core takes to validate or export all views and reprojections."""
        return self.dataset.view_count * self._all_pixels * CHECK_SECONDS

    @property
    def report_seconds(self) -> float:
        """Seconds that one core takes to draw the figures, or to write the page."""
        shown_views = min(self.dataset.view_count, MOST_SHOWN_VIEWS)
        return shown_views * self._all_pixels * REPORT_SECONDS

    @property
    def shard_count(self) -> int:
        """How many shards a dataset gets before the first is rendered.

        Shards are as short as possible, so that many processes can work at once. But start-up must
        stay a small part of a shard's time.
        """
        dataset = self.dataset
        seconds = self._probe[0] if self._probe else self._planned_view_seconds
        shortest = math.ceil(START_UP_SECONDS / _START_UP_PART / max(seconds, 1e-6))
        most = _USUAL_SHARDS
        if dataset.cluster:
            job_seconds = 60 * _CLUSTER_JOB_MINUTES * dataset.cluster.cores
            short_jobs = math.ceil(dataset.view_count * seconds / job_seconds)
            most = min(max(most, dataset.cluster.jobs, short_jobs), _MOST_SHARDS)
        return min(math.ceil(dataset.view_count / shortest), most)

    @property
    def _planned_samples(self) -> int:
        """A pixel's samples. With a target error, or the .blend's own samples, it is a fixed guess.

        The bounds of shards depend on it, and must depend only on the configuration.
        """
        render = self.dataset.render
        if isinstance(render.samples, int):
            return render.samples
        return min(render.most_samples or _GUESSED_SAMPLES, _GUESSED_SAMPLES)

    @property
    def _cost_samples(self) -> float:
        """A pixel's cost in samples, with denoising, by the calibration if it has run."""
        denoising = DENOISING_SAMPLES if self.dataset.render.denoise else 0
        if not isinstance(self.dataset.calibration, str):
            return self._planned_samples + denoising
        try:
            calibration = json.loads(Path(self.dataset.calibration).read_bytes())
            return float(calibration["cost_samples"])
        except (OSError, *DAMAGE):
            # The file is missing, or broken, so that it will be made again.
            return self._planned_samples + denoising

    @property
    def _planned_view_seconds(self) -> float:
        """Seconds that one core takes to render a view, or to import and reproject one."""
        dataset = self.dataset
        if dataset.imported:
            return self.import_seconds + sum(map(self.reprojection_seconds, dataset.reprojections))
        return dataset.pixels * self._planned_samples * self._sample_seconds

    @cached_property
    def _probe(self) -> tuple[float, float] | None:
        """The seconds of one core and the bytes of a view, by a probe. None without a valid probe.

        The probe of a sequence's first frame counts for all frames.
        """
        dataset = self.dataset
        rig_folder = Path(dataset.work_root, dataset.scene_folder, dataset.rig_name)
        # Those of a sequence lie a folder deeper. A search of all folders would take too long.
        paths = chain(rig_folder.glob("probe.json"), rig_folder.glob("f*/probe.json"))
        path = next(paths, None)
        if path is None:
            return None
        try:
            probe = json.loads(path.read_bytes())
            samples = dataset.render.samples or probe["samples"]
            planned = [list(dataset.rig.camera.resolution), samples]
            if probe["device"] == "CPU" and planned == [probe["resolution"], probe["samples"]]:
                seconds = fmean(probe["view_seconds"])
                size = fmean(probe["view_bytes"])
                return (seconds, size) if 0 < seconds < 1e9 and 0 < size < 1e12 else None
        except (OSError, *DAMAGE):
            pass
        return None

    @property
    def _all_pixels(self) -> int:
        """The pixels of a view and its reprojections."""
        reprojected_pixels = sum(map(self._reprojected_pixels, self.dataset.reprojections))
        return self.dataset.pixels + reprojected_pixels

    def _reprojected_pixels(self, name: str) -> int:
        """Return the pixels of a view's reprojection. A cube map has six images."""
        camera = self.dataset.reprojections[name].camera or self.dataset.rig.camera
        return math.prod(camera.resolution) * len(self.dataset.lens_maps(name))


@lru_cache
def _scene_memory(inventory: Path, _changed: int) -> int:
    """Return the memory of a scene in bytes: a fifth more than its inventory measured.

    ``_changed`` is the inventory's time, with which the cache notices a new inventory.
    """
    try:
        return int(1.2 * json.loads(inventory.read_bytes())["memory_bytes"])
    except (OSError, *DAMAGE):
        return memory.UNKNOWN_SCENE
