"""What a dataset will take: time, memory and bytes, as they are estimated before it is rendered."""

import json
import math
from functools import cached_property, lru_cache
from pathlib import Path
from statistics import fmean

from lightfield.core.files import DAMAGE
from lightfield.dataset import memory, passes
from lightfield.dataset.config import FILE
from lightfield.dataset.dataset_paths import DatasetPaths

# For planning only, measured on one core of a 2-core x86-64 machine: path tracing of one sample of
# one pixel, and start-up (bpy, the scene, and Cycles' acceleration structures).
SECONDS_PER_SAMPLE = 6e-6
START_UP_SECONDS = 3.0
# The same of views that are taken over: reading a pixel, and one that it is reprojected to. Of EXR
# with depth, in batches of 16 views of 2048², by benchmarks/reprojection.py.
READ_SECONDS = 4e-8
REPROJECTION_SECONDS = 1.5e-7
# A pixel's samples where a target error is given instead of them: an estimate for planning.
GUESSED_SAMPLES = 256
# Start-up is kept under this part of a shard's time.
START_UP_PART = 0.05
# More jobs would make the plan long, and no more render at once; a cluster may take more.
USUAL_SHARDS = 64
# On a cluster no job is expected to render longer than this.
CLUSTER_JOB_MINUTES = 20
# A longer plan would take longer than it is worth.
MOST_SHARDS = 10_000
# Of the bytes of half-float colour and of depth, what an EXR takes: measured in the three scenes.
COMPRESSED = 0.75
# A pixel of an 8-bit PNG.
PNG_BYTES = 2


class Estimate:
    """Estimates for a dataset, from its settings and from what is measured of its scene."""

    def __init__(self, dataset: DatasetPaths) -> None:
        self.dataset = dataset

    @cached_property
    def view_seconds(self) -> float:
        """Seconds that one core takes to render a view, as a probe has measured or as guessed."""
        if self._probe:
            return self._probe[0]
        return self.dataset.pixels * self._samples * SECONDS_PER_SAMPLE

    @cached_property
    def view_bytes(self) -> float:
        """Bytes of a rendered view with its passes, as a probe has measured or as guessed."""
        if self._probe:
            return self._probe[1]
        render = self.dataset.render
        width = 6 + sum(wanted.bytes for wanted in passes.wanted(render))
        if self.dataset.depth:
            width += {"float": 4, "rounded": 3, "half": 2}[render["depth_precision"]]
        return self.dataset.pixels * width * COMPRESSED

    @property
    def all_view_bytes(self) -> float:
        """Bytes of a view, its flow, and everything that it is reprojected to."""
        sizes = {"exr": 10 * COMPRESSED, "png": PNG_BYTES}
        size = self.view_bytes
        if self.dataset.flow:
            size += passes.FLOW.bytes * COMPRESSED * self.dataset.pixels
        return size + sum(
            self._reprojected_pixels(name) * sizes[reprojection.format] * (reprojection.bits / 8)
            for name, reprojection in self.dataset.reprojections.items()
        )

    def memory_bytes(self, pixels: int) -> int:
        """Bytes of memory that a process takes which renders views of so many pixels.

        The scene's part is what the inventory has measured, as soon as it has, and a fifth more.
        """
        scene = memory.UNKNOWN_SCENE
        inventory = Path(str(self.dataset.inventory))
        if inventory.is_file():
            scene = _scene_memory(inventory, inventory.stat().st_mtime_ns)
        # Until the calibration has chosen, it may choose to denoise.
        return memory.needed(scene, pixels, self.dataset.render.get("denoise", True))

    @property
    def view_memory_bytes(self) -> int:
        """Bytes of memory that a process takes which renders the dataset's own views."""
        return self.memory_bytes(self.dataset.pixels)

    @property
    def panorama_seconds(self) -> float:
        """Seconds that one core takes for the panorama, which is twice as wide as high."""
        pixels = self.dataset.panorama_width**2 / 2
        return START_UP_SECONDS + self.view_seconds * pixels / self.dataset.pixels

    @property
    def shard_count(self) -> int:
        """How many shards a dataset gets of which none has been rendered.

        A shard is as short as it can be while start-up stays a small part of its time: the
        shorter, the more processes can work at once.
        """
        dataset = self.dataset
        seconds = self._probe[0] if self._probe else self._planned_view_seconds
        shortest = math.ceil(START_UP_SECONDS / START_UP_PART / max(seconds, 1e-6))
        most = USUAL_SHARDS
        if dataset.cluster:
            job_seconds = 60 * CLUSTER_JOB_MINUTES * dataset.cluster.cores
            short_jobs = math.ceil(dataset.view_count * seconds / job_seconds)
            most = min(max(most, dataset.cluster.jobs, short_jobs), MOST_SHARDS)
        return min(math.ceil(dataset.view_count / shortest), most)

    @property
    def _planned_samples(self) -> int:
        """A pixel's samples; with a target error, or the .blend's own, a guess that stays the same.

        Shards follow from it, whose bounds must follow from the configuration alone.
        """
        samples = self.dataset.render.get("samples", FILE)
        limit = self.dataset.render.get("most_samples", GUESSED_SAMPLES)
        return min(limit, GUESSED_SAMPLES) if samples == FILE else int(samples)

    @property
    def _samples(self) -> float:
        """A pixel's samples: those that the calibration has chosen, as soon as it has."""
        if not isinstance(self.dataset.calibration, str):
            return self._planned_samples
        try:
            calibration = json.loads(Path(self.dataset.calibration).read_bytes())
            return float(calibration["cost_samples"])
        except (OSError, *DAMAGE):
            # Not there yet, or broken, and then it is made anew.
            return self._planned_samples

    @property
    def _planned_view_seconds(self) -> float:
        """Seconds that one core takes to render a view, or to take over and reproject one."""
        dataset = self.dataset
        if dataset.imported:
            targets = sum(self._reprojected_pixels(name) for name in dataset.reprojections)
            read = dataset.pixels * (1 + len(dataset.reprojections))
            return read * READ_SECONDS + targets * REPROJECTION_SECONDS
        return dataset.pixels * self._planned_samples * SECONDS_PER_SAMPLE

    @cached_property
    def _probe(self) -> tuple[float, float] | None:
        """Seconds of one core that a view takes, and its bytes, as a probe measured; None if none.

        A sequence's first frame is probed for all.
        """
        dataset = self.dataset
        try:
            rig = Path(dataset.work_root, dataset.scene_folder, dataset.rig_name)
            # A sequence's lie a folder deeper. The folders of the shards are too full to look into.
            paths = (path for depth in ("", "f*/") for path in rig.glob(f"{depth}probe.json"))
            probe = json.loads(next(paths).read_bytes())
            samples = dataset.render.get("samples", probe["samples"])
            planned = [list(dataset.rig.camera.resolution), samples]
            if probe["device"] == "CPU" and planned == [probe["resolution"], probe["samples"]]:
                seconds = fmean(probe["view_seconds"])
                size = fmean(probe["view_bytes"])
                return (seconds, size) if 0 < seconds < 1e9 and 0 < size < 1e12 else None
        except (OSError, StopIteration, *DAMAGE):
            pass
        return None

    def _reprojected_pixels(self, name: str) -> int:
        """Pixels that one view is reprojected to; a cube map has six images of a view."""
        camera = self.dataset.reprojections[name].camera or self.dataset.rig.camera
        return math.prod(camera.resolution) * len(self.dataset.lens_maps(name))


@lru_cache
def _scene_memory(inventory: Path, _changed: int) -> int:
    """Return what a scene's inventory says that it takes, and a fifth more."""
    try:
        return int(1.2 * json.loads(inventory.read_bytes())["memory_bytes"])
    except (OSError, *DAMAGE):
        return memory.UNKNOWN_SCENE
