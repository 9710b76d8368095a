"""One scene seen by one rig: what is built of it, where its files lie, and what it will take."""

import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from statistics import fmean
from typing import Any, Literal, Self

from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, reading, unreadable
from lightfield.dataset import (
    blend,
    config,
    memory,
    passes,
    published,
    shard_counts,
    shard_files,
)
from lightfield.dataset.config import (
    CHOSEN,
    FILE,
    Configuration,
    Preset,
    Render,
    Source,
    TargetError,
)
from lightfield.dataset.exports import MANIFEST, VIEWS, Exports
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.keys import scene_fingerprint
from lightfield.dataset.lightfield import OMNIDIRECTIONAL
from lightfield.dataset.splits import SPLITS
from lightfield.dataset.view_store import ViewStore
from lightfield.geometry.lenses import CameraSettings
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.overview import sees_all_round
from lightfield.geometry.rigs import BlendCamera, Poses, Random, Rig
from lightfield.geometry.rigs.split import PARTS

# For planning only, measured on one core of a 2-core x86-64 machine: path tracing of one sample of
# one pixel, and start-up (bpy, the scene, and Cycles' acceleration structures).
SECONDS_PER_SAMPLE = 6e-6
START_UP_SECONDS = 3.0
# The same of views that are taken over: reading a pixel, and one that it is reprojected to. Of EXR
# with depth, in batches of 16 views of 2048², by benchmarks/reprojection.py.
READ_SECONDS, REPROJECTION_SECONDS = 4e-8, 1.5e-7
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

# What of a scene YAML's `scene` block is written down: not where a file came from, nor where it is.
SOURCE_KEYS = {"builder", "parameters", "scene_name", "view_layers", "frame"}

# Parts of a split that a rig may be as a whole beside one that trains.
TESTED_WITH = ("validation", "test")

# Pictures of a report, those of them that are plots, which are .svg too, and all its files.
PICTURES = ("overview", "contact_sheet", "rig", "depth", "noise")
PLOTS = ("rig", "depth", "noise")
PICTURE_FILES = (*(f"{name}.png" for name in PICTURES), *(f"{name}.svg" for name in PLOTS))
REPORT_FILES = (*PICTURE_FILES, "costs.json", "index.html")


@dataclass(frozen=True)
class Cluster:
    """A cluster that renders: how many jobs run at once, and the cores of each job."""

    jobs: int
    cores: int


@dataclass(frozen=True)
class Dataset:
    """One scene seen by one rig, with every default filled in and the preset applied.

    ``scene_name`` is the scene YAML's name. ``rig_folder`` is the rig's name, in a sequence
    followed by the frame's folder, as in LFSphere/f00001. ``render`` is what lightfield.json holds.
    """

    scene_name: str
    preset: str
    rig_name: str
    rig_folder: str
    source: Source
    render: dict[str, Any]
    rig: Rig
    reprojections: dict[str, config.Reprojection]
    flow: config.Flow | None
    exports: Exports
    # For the report, from the rig's centre.
    has_panorama: bool
    limits: Preset
    # Folders of the rigs in which others test what is trained on this one, and that of the rig on
    # which is trained what this one tests.
    tested_by: tuple[str, ...] = ()
    trained_by: str | None = None
    results_root: str = "results"
    work_root: str = "work"
    views_per_shard: int | Literal["auto"] = "auto"
    # None where this machine renders.
    cluster: Cluster | None = None
    # Path and SHA-256 of each file that a .blend reads, once its inventory is known.
    external_files: Sequence[tuple[str, str | None]] = ()

    def resolved(self, inventory: Path) -> Self:
        """Return the dataset with what a user's .blend says, by its ``inventory``, filled in.

        Raises `UserError` where the .blend has not what the scene YAML asks of it.
        """
        if not self.source.blend:
            return self
        found = read_inventory(inventory, "blend", "external_files")
        with reading(inventory, "inventory"):
            said = found["blend"]
            frame = int(said["frame"] if self.source.frame == FILE else self.source.frame)
            render = dict(self.render)
            rig = self.rig
            if render.get("samples") == FILE:
                most = render.pop("most_samples", said["samples"])
                render["samples"] = min(said["samples"], most)
            if render.get("depth_of_field"):
                blend.camera_of(said)
            if isinstance(rig, BlendCamera):
                blend.camera_of(said)
                rig = rig.placed(inventory, frame)
            if rig.camera.lens == FILE:
                camera = blend.lens_of(said, rig.camera.resolution)
                rig = rig.model_copy(update={"camera": camera})
            return replace(
                self,
                source=self.source.model_copy(update={"frame": frame}),
                render=render,
                rig=rig,
                external_files=[(file["path"], file["sha256"]) for file in found["external_files"]],
            )

    @property
    def scene_folder(self) -> str:
        """The scene's name and the preset's unless it is ``full``: presets keep to themselves."""
        full = self.preset == "full"
        return self.scene_name if full else f"{self.scene_name}_{self.preset}"

    @cached_property
    def view_count(self) -> int:
        """Number of views of the rig."""
        return self.rig.view_count

    @property
    def camera_frames(self) -> list[int | None]:
        """The frames at which a rig of the .blend's camera needs it; None is the file's own."""
        rig = self.placed_rig
        return rig.path if isinstance(rig, BlendCamera) else []

    @property
    def depth(self) -> str | None:
        """What channel Z of the rendered views means: ``z``, ``distance``, or None for no depth.

        Z-depth is unusable for lenses that see beyond 180 degrees, and depth without a centre.
        """
        if self.rig.is_omnidirectional:
            return None
        match self.render["depth"]:
            case "none":
                return None
            case "auto":
                return self.rig.camera.make().usual_depth
            case meaning:
                return str(meaning)

    @property
    def name(self) -> str:
        """Scene and rig, as in garden_tiny/LFSphere."""
        return f"{self.scene_folder}/{self.rig_folder}"

    @property
    def fingerprint(self) -> str:
        """What the scene is identified by: see `scene_fingerprint`."""
        return scene_fingerprint(self.source, self.external_files)

    def origin(self, render: dict[str, Any]) -> dict[str, Any]:
        """Return what lightfield.json says of what is rendered, and how: by this ``render``."""
        return {
            "depth": self.depth,
            **(
                {OMNIDIRECTIONAL: self.rig.stereo.distance}
                if self.rig.stereo and self.rig.is_omnidirectional
                else {}
            ),
            "frame": self.source.frame,
            "scene": {
                "name": self.scene_name,
                **self.source.model_dump(include=SOURCE_KEYS, exclude_none=True),
                "fingerprint": self.fingerprint,
            },
            "render": render,
        }

    @property
    def builder_fingerprint(self) -> str | None:
        """What changes when a builder does; a user's .blend is a file, which is checked."""
        return None if self.source.blend else self.fingerprint

    @property
    def imported(self) -> str | None:
        """The folder of a light field that somebody else has rendered."""
        if isinstance(self.rig, Poses) and self.source.dataset:
            return str(Path(self.rig.file).parent)
        return None

    @property
    def limits_json(self) -> str:
        """The preset's limits, as scripts/make_lightfield.py takes them."""
        return self.limits.model_dump_json(exclude_none=True)

    @property
    def placed_rig(self) -> Rig:
        """The rig; a random one and a .blend's camera know where their places are found."""
        if isinstance(self.rig, BlendCamera):
            frame = self.source.frame
            return self.rig.placed(str(self.inventory), None if frame == FILE else int(frame))
        if isinstance(self.rig, Random):
            return self.rig.placed(str(self.places))
        return self.rig

    @property
    def rig_json(self) -> str:
        """The rig, as the programs take it that make a report."""
        return self.placed_rig.model_dump_json(exclude_unset=True, exclude_none=True)

    @property
    def panorama_width(self) -> int:
        """Twice a 180 degree fisheye view's angular resolution, within 4096 pixels."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    # The scene's files, which all rigs and presets have in common.

    @property
    def scene_work(self) -> str:
        return f"{self.work_root}/{self.scene_name}"

    @property
    def blend(self) -> str | list[str]:
        """The .blend: what a builder makes, or what the user brought; none of an import."""
        if self.imported:
            return []
        return self.source.blend or f"{self.scene_work}/scene.blend"

    @property
    def blend_check(self) -> str | list[str]:
        """The proof that the user's own .blend is the one meant; a built one needs none."""
        return f"{self.scene_work}/blend.json" if self.source.blend else []

    @property
    def inventory(self) -> str | list[str]:
        """The list of what the scene contains; none of an import."""
        return [] if self.imported else f"{self.scene_work}/inventory.json"

    @property
    def cameras(self) -> str | list[str]:
        """What surrounds each camera; not known of an import."""
        return [] if self.imported else f"{self.work}/cameras.json"

    @property
    def blend_inventory(self) -> str | list[str]:
        """The list of what the user's own .blend says, from which its datasets follow, too."""
        return self.inventory if self.source.blend else []

    @property
    def trials(self) -> str:
        """Where trial renders are kept."""
        return f"{self.scene_work}/trials"

    @property
    def calibration(self) -> str | list[str]:
        """What was chosen for the scene's target error under the preset; none without one."""
        if "target_error" not in self.render:
            return []
        return f"{self.work_root}/{self.scene_folder}/calibration.json"

    # The dataset's own files.

    @property
    def folder(self) -> str:
        return f"{self.results_root}/{self.name}"

    @property
    def work(self) -> str:
        return f"{self.work_root}/{self.name}"

    def lens_maps(self, name: str) -> list[str]:
        """Return the lens maps of a reprojection: one, or of a cube map one a face."""
        faces = CUBE_FACES if self.reprojections[name].cube_map else ("",)
        return [f"{self.work}/{name}/lens_map{face and f'_{face}'}.npy" for face in faces]

    @property
    def places(self) -> str | list[str]:
        """Where the cameras of a random rig have free space; other rigs need no such file."""
        return f"{self.work}/places.json" if isinstance(self.rig, Random) else []

    @property
    def lightfields(self) -> list[str]:
        """The lightfield.json of the dataset and of each of its reprojections."""
        folders = [self.folder, *(f"{self.folder}/{name}" for name in self.reprojections)]
        return [f"{folder}/lightfield.json" for folder in folders]

    @property
    def image_folders(self) -> list[str]:
        """The folders in ``folder`` that hold views, their passes and reprojections."""
        own = passes.wanted(self.render)
        reprojected = [
            f"{name}/{pass_name}"
            for name, reprojection in self.reprojections.items()
            for pass_name in reprojection.passes or ()
        ]
        own += [passes.FLOW] if self.flow else []
        return ["exr", *(found.name for found in own), *self.reprojections, *reprojected]

    @property
    def exported(self) -> list[str]:
        """The files by which each export for each of its sources is known to be there."""
        return [
            f"{self.folder}/{'' if source == VIEWS else f'{source}/'}"
            + ("transforms.json" if name == "instant_ngp" else f"exports/{name}/{MANIFEST}")
            for name, export in self.exports.wanted.items()
            for source in export.sources
        ]

    @property
    def export_lists(self) -> list[str]:
        """All files by which exports list what is theirs: of a split each part has one, too."""
        own = [path for path in self.exported if not path.endswith(MANIFEST)]
        parts = PARTS if self.rig.split else ()
        more = [f"{path.removesuffix('.json')}_{part}.json" for path in own for part in parts]
        return [*self.exported, *more]

    @property
    def splits(self) -> str | list[str]:
        """The list of what the views of all rigs are for, where this rig says it of its own."""
        return f"{self.results_root}/{self.scene_folder}/{SPLITS}" if self.rig.split else []

    @property
    def published(self) -> list[str]:
        """The files that a job makes one by one, the views aside."""
        return [*self.lightfields, *self.exported]

    @property
    def pictures(self) -> list[str]:
        return [f"{self.folder}/report/{name}" for name in PICTURE_FILES]

    @property
    def panorama(self) -> str | list[str]:
        """The report's panorama; none of an import, of which there is no scene to render it."""
        made = self.has_panorama and not self.imported
        return f"{self.work}/panorama/exr/view_0000f.exr" if made else []

    @property
    def costs(self) -> str:
        return f"{self.folder}/report/costs.json"

    @property
    def page(self) -> str:
        """The page that shows the dataset."""
        return f"{self.folder}/report/index.html"

    def record(self, stage: str, first: int, end: int) -> str:
        """The record of a shard at one of the ``stages``."""
        return f"{self.work}/{stage}/{first}-{end}.json"

    def records(self, stage: str) -> list[str]:
        return [self.record(stage, first, end) for first, end in self.shards]

    @property
    def stages(self) -> list[str]:
        """The stages that make the dataset's images, shard by shard."""
        return ["render", *self.reprojections, *([passes.FLOW.name] if self.flow else [])]

    @property
    def all_records(self) -> list[str]:
        """The records of all of these."""
        return [file for stage in self.stages for file in self.records(stage)]

    @property
    def files(self) -> list[str]:
        """All that the finished dataset consists of, as a target rule asks for it.

        The records are named although later files follow from them, because Snakemake makes a
        missing file anew only if a target rule names it.
        """
        return [
            f"{self.folder}/validation.json",
            f"{self.folder}/sha256sums.txt",
            *_paths(self.splits),
            *self.published,
            *self.pictures,
            self.costs,
            self.page,
            *self.all_records,
        ]

    @property
    def intermediates(self) -> list[str]:
        """What is made on the way to the dataset, named so that a missing one is made anew, too."""
        scene = self.blend if self.source.builder else self.blend_check
        return [
            *_paths(scene, self.inventory, self.calibration, self.places, self.cameras),
            f"{self.work}/checksums.txt",
            *(
                [f"{self.work}/panorama/lightfield.json", self.panorama]
                if isinstance(self.panorama, str)
                else []
            ),
            *(path for name in self.reprojections for path in self.lens_maps(name)),
        ]

    @property
    def package(self) -> str:
        """A rig's dataset as one archive, all frames of a sequence in it, named as SILVR's are."""
        return f"{self.results_root}/{self.scene_folder}/{self.scene_folder}_{self.rig_name}.tar"

    def outgrown_records(self) -> list[str]:
        """Return the records of imported views that were written anew since they were taken over.

        So is one whose source has another size. A view that left its source is needed no more.
        """
        if not self.imported:
            return []
        return [path for path in self.records("render") if self._is_outgrown(Path(path))]

    def _is_outgrown(self, record: Path) -> bool:
        try:
            sizes = shard_files.recorded(record, self.folder) or {}
            taken = record.stat().st_mtime_ns
        except FileNotFoundError:
            return False
        for name, size in sizes.items():
            source_size, changed = _size_and_time(Path(str(self.imported), name))
            if changed and (source_size != size or changed > taken):
                return True
        return False

    def broken(self) -> Iterator[tuple[str, str]]:
        """Yield each view and journal that cannot be read as a file, and why."""
        views = (view for name in self.image_folders for view in _entries(self.folder, name))
        journals = (journal for stage in self.stages for journal in _entries(self.work, stage))
        for entry in (*views, *journals):
            is_own = entry.name.endswith((".exr", ".png", ".jsonl"))
            if is_own and (problem := unreadable(entry.path)):
                yield entry.path, problem

    def external_changed(self, store: ViewStore | None) -> bool:
        """Whether a file that the user's .blend reads is no longer the one in its inventory.

        So is one that the view store has lost, if there is one.
        """
        if not self.source.blend:
            return False
        home = Path(self.source.blend).parent
        try:
            return any(
                _size_and_time(home / file["path"]) != (file["bytes"], file["mtime_ns"])
                or (store and file["bytes"] and not store.has(file["sha256"], file["bytes"]))
                for file in json.loads(Path(str(self.inventory)).read_bytes())["external_files"]
            )
        except FileNotFoundError:
            return False
        except (OSError, *DAMAGE):
            return True

    # What it will take.

    @property
    def planned_samples(self) -> int:
        """A pixel's samples; with a target error, or the .blend's own, a guess that stays the same.

        Shards follow from it, whose bounds must follow from the configuration alone.
        """
        samples = self.render.get("samples", FILE)
        limit = self.render.get("most_samples", GUESSED_SAMPLES)
        return min(limit, GUESSED_SAMPLES) if samples == FILE else int(samples)

    @property
    def planned_view_seconds(self) -> float:
        """Estimate of how long one core path-traces one view, or takes over and reprojects one."""
        if self.imported:
            targets = sum(self._reprojected_pixels(name) for name in self.reprojections)
            read = self._pixels * (1 + len(self.reprojections))
            return read * READ_SECONDS + targets * REPROJECTION_SECONDS
        return self._pixels * self.planned_samples * SECONDS_PER_SAMPLE

    @property
    def expected_samples(self) -> float:
        """The same samples, or those that the calibration has found, if it has."""
        if not isinstance(self.calibration, str):
            return self.planned_samples
        try:
            return float(json.loads(Path(self.calibration).read_bytes())["cost_samples"])
        except (OSError, *DAMAGE):
            # Not there yet, or broken, and then it is made anew.
            return self.planned_samples

    @cached_property
    def _probed_view(self) -> tuple[float, float] | None:
        """Seconds of one core that a view takes, and its bytes, as a probe measured; None if none.

        A sequence's first frame is probed for all.
        """
        try:
            rig = Path(self.work_root, self.scene_folder, self.rig_name)
            # A sequence's lie a folder deeper. The folders of the shards are too full to look into.
            found = (path for depth in ("", "f*/") for path in rig.glob(f"{depth}probe.json"))
            probe = json.loads(next(found).read_bytes())
            now = [list(self.rig.camera.resolution), self.render.get("samples", probe["samples"])]
            if probe["device"] == "CPU" and now == [probe["resolution"], probe["samples"]]:
                seconds, size = fmean(probe["view_seconds"]), fmean(probe["view_bytes"])
                return (seconds, size) if 0 < seconds < 1e9 and 0 < size < 1e12 else None
        except (OSError, StopIteration, *DAMAGE):
            pass
        return None

    @cached_property
    def expected_view(self) -> tuple[float, float]:
        """Seconds of one core that a view takes, and its bytes: as a probe measured, or guessed."""
        if self._probed_view:
            return self._probed_view
        width = {"float": 4, "rounded": 3, "half": 2}[self.render["depth_precision"]]
        width = 6 + width * bool(self.depth) + sum(p.bytes for p in passes.wanted(self.render))
        size = self._pixels * width * COMPRESSED
        return self._pixels * self.expected_samples * SECONDS_PER_SAMPLE, size

    @property
    def expected_view_bytes(self) -> float:
        """Bytes of a view, its flow, and what it is reprojected to."""
        sizes = {"exr": 10 * COMPRESSED, "png": PNG_BYTES}
        own = self.expected_view[1]
        own += passes.FLOW.bytes * COMPRESSED * self._pixels if self.flow else 0
        return own + sum(
            self._reprojected_pixels(name) * sizes[reprojection.format] * (reprojection.bits / 8)
            for name, reprojection in self.reprojections.items()
        )

    def _reprojected_pixels(self, name: str) -> int:
        """Pixels that one view is reprojected to; a cube map has six images of a view."""
        camera = self.reprojections[name].camera or self.rig.camera
        return math.prod(camera.resolution) * len(self.lens_maps(name))

    @property
    def missing_bytes(self) -> float:
        """Estimate of what the views take that are not there yet, and what is made of them."""
        return self.missing_views * self.expected_view_bytes

    @property
    def missing_views(self) -> int:
        """How many views are not there yet."""
        there = sum(entry.name.endswith(".exr") for entry in _entries(self.folder, "exr"))
        return max(0, self.view_count - there)

    def memory_bytes(self, pixels: int) -> int:
        """Estimate of what a process takes that renders views of so many pixels.

        For the scene that is what the inventory has measured, as soon as it has, and a fifth more.
        """
        scene = memory.UNKNOWN_SCENE
        inventory = Path(str(self.inventory))
        if inventory.is_file():
            scene = _scene_memory(inventory, inventory.stat().st_mtime_ns)
        # Until the calibration has chosen, it may choose to denoise.
        return memory.needed(scene, pixels, self.render.get("denoise", True))

    @property
    def view_memory_bytes(self) -> int:
        """The same of the dataset's own views."""
        return self.memory_bytes(self._pixels)

    @property
    def panorama_seconds(self) -> float:
        """Estimate of how long one core renders the panorama, which is twice as wide as high."""
        pixels = self.panorama_width**2 / 2
        return START_UP_SECONDS + self.expected_view[0] * pixels / self._pixels

    @property
    def _pixels(self) -> int:
        return math.prod(self.rig.camera.resolution)

    @cached_property
    def shards(self) -> list[tuple[int, int]]:
        """The views in runs (first, end) of nearly equal length, as many as there were before.

        With ``views_per_shard`` auto, a run is as short as it can be while start-up takes only its
        small part of the time: the shorter the runs, the more processes can work at once.
        """
        if self.views_per_shard == "auto":
            count = shard_counts.noted(self.work_root, self.name, self.view_count)
            count = count or self._shard_count
        else:
            count = math.ceil(self.view_count / self.views_per_shard)
        bounds = [self.view_count * number // count for number in range(count + 1)]
        return list(pairwise(bounds))

    @property
    def _shard_count(self) -> int:
        """How many shards a dataset gets of which none has been rendered."""
        seconds = self._probed_view[0] if self._probed_view else self.planned_view_seconds
        shortest = math.ceil(START_UP_SECONDS / START_UP_PART / max(seconds, 1e-6))
        most = USUAL_SHARDS
        if self.cluster:
            job_seconds = 60 * CLUSTER_JOB_MINUTES * self.cluster.cores
            short_jobs = math.ceil(self.view_count * seconds / job_seconds)
            most = min(max(most, self.cluster.jobs, short_jobs), MOST_SHARDS)
        return min(math.ceil(self.view_count / shortest), most)


@lru_cache
def _scene_memory(inventory: Path, _changed: int) -> int:
    """Return what a scene's inventory says that it takes, and a fifth more."""
    try:
        return int(1.2 * json.loads(inventory.read_bytes())["memory_bytes"])
    except (OSError, *DAMAGE):
        return memory.UNKNOWN_SCENE


def _paths(*perhaps: str | list[str]) -> list[str]:
    """Return those of several files that there are; one that a dataset has not is an empty list."""
    return [path for path in perhaps if isinstance(path, str)]


def _size_and_time(path: Path) -> tuple[int, int] | tuple[None, None]:
    """Return a file's bytes and when it was changed, in nanoseconds; None where there is none."""
    if not path.is_file():
        return None, None
    status = path.stat()
    return status.st_size, status.st_mtime_ns


def _entries(folder: str, name: str) -> list[os.DirEntry[str]]:
    """Return what lies in a folder in ``folder``; nothing where there is none."""
    try:
        with os.scandir(Path(folder, name)) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return []


def load_datasets(settings: Configuration, cluster: Cluster | None = None) -> list[Dataset]:
    """Read the scene YAMLs that a configuration chooses and resolve their datasets.

    ``cluster`` is the one that renders them, if any.
    Raises `UserError` for a scene that is not there, not right, or without the rigs asked for, and
    for one whose folder another scene has under another preset.
    """
    found: list[Dataset] = []
    for scene in settings.scenes:
        full = settings.preset == "full"
        folder = scene if full else f"{scene}_{settings.preset}"
        base, _, preset = folder.rpartition("_")
        other = base if full else folder
        if preset in settings.presets.keys() - {"full"} and config.scene_path(other).is_file():
            raise UserError(
                f"config.yaml: scenes: {folder} would be the folder of both {base} with "
                f"preset={preset} and {folder}; give one of these scene YAMLs another name"
            )
        limits = settings.presets[settings.preset]
        found += scene_datasets(scene, settings.preset, limits, settings, cluster)
    if settings.rigs == "all":
        return found
    known = {dataset.rig_name for dataset in found}
    for rig in settings.rigs:
        if rig not in known:
            raise UserError(
                f"config.yaml: rigs: {rig!r} is in none of the scenes {', '.join(settings.scenes)}"
                f"; must be all or some of {', '.join(sorted(known))}"
            )
    for scene in settings.scenes:
        # A sequence has a dataset for each frame.
        own = dict.fromkeys(dataset.rig_name for dataset in found if dataset.scene_name == scene)
        if not own.keys() & set(settings.rigs):
            raise UserError(
                f"config.yaml: rigs: none of {', '.join(settings.rigs)} is in {scene}; "
                f"it has {', '.join(own)}; all takes them all"
            )
    return [dataset for dataset in found if dataset.rig_name in settings.rigs]


def scene_datasets(
    scene: str,
    preset: str = "full",
    limits: Preset | None = None,
    settings: Configuration | None = None,
    cluster: Cluster | None = None,
) -> list[Dataset]:
    """Resolve every dataset of one scene YAML under the ``limits`` of a preset.

    Of the ``settings``, folders and length of shards count. ``cluster`` is the one that renders.
    """
    limits = limits or Preset()
    written = config.load_scene(scene)
    file = f"{config.OWN_SCENES}/{scene}.yaml"
    source = written.scene
    if source.blend:
        checksum = config.blend_sha256(scene, source)[0]
        source = source.model_copy(update={"sha256": checksum})
    folders: dict[str, Any] = {}
    if settings:
        folders = {
            "results_root": settings.results,
            "work_root": settings.work,
            "views_per_shard": settings.views_per_shard,
        }
    testing = [name for name, rig in written.rigs.items() if rig.split in TESTED_WITH]
    training = next((name for name, rig in written.rigs.items() if rig.split == "train"), None)
    found = []
    for name, rig in written.rigs.items():
        reprojections = {
            key: reprojection.model_copy(
                update={"camera": reprojection.camera and _limited(reprojection.camera, limits)}
            )
            for key, reprojection in written.reprojections.items()
            if name in (reprojection.rigs or written.rigs)
        }
        exports = {
            key: export.model_copy(
                update={"sources": [s for s in export.sources if s in (VIEWS, *reprojections)]}
            )
            # What a rig tests is exported with what is trained on.
            if rig.split not in TESTED_WITH or not export.is_for_training
            else None
            for key, export in written.exports.wanted.items()
        }
        panorama = written.report.panorama
        has_panorama = sees_all_round(rig) if panorama == "auto" else panorama
        try:
            limited = _limited_rig(rig, limits, written.render is not None)
        except UserError as error:
            raise UserError(f"{file}: rigs.{name}: {error}; let the preset have more") from None
        if written.flow and limited.is_at_one_place():
            raise UserError(
                f"{file}: flow: {config.FLOW_PLACES}, but the preset "
                f"{preset} leaves one of rigs.{name}; let the preset have more views"
            )
        render = _limited_render(written.render, rig, limits)
        for folder, frame in _frames(name, rig, source.frame):
            below = folder.removeprefix(name)
            found.append(
                Dataset(
                    scene_name=scene,
                    preset=preset,
                    rig_name=name,
                    rig_folder=folder,
                    source=source.model_copy(update={"frame": frame}),
                    render=render,
                    rig=limited,
                    reprojections=reprojections,
                    flow=written.flow,
                    exports=written.exports.model_copy(update=exports),
                    has_panorama=has_panorama,
                    limits=limits,
                    tested_by=tuple(f"{other}{below}" for other in testing)
                    if rig.split == "train"
                    else (),
                    trained_by=f"{training}{below}" if rig.split in TESTED_WITH else None,
                    **folders,
                    cluster=cluster,
                )
            )
    return found


def rendered_frames(datasets: Iterable[Dataset]) -> list[int | Literal["file"]]:
    """Return the frames of a scene that its ``datasets`` render; FILE is the .blend's own."""
    frames = {dataset.source.frame for dataset in datasets}
    return sorted(frames, key=lambda frame: (frame == FILE, frame))


def check_presence(dataset: Dataset) -> None:
    """Check that the user's .blend is where the scene YAML says, or can be downloaded.

    Raises `UserError`. Where machines see no common folder, only that of the user has the file.
    """
    source = dataset.source
    if source.blend and not source.url and not Path(source.blend).is_file():
        page = f"get it from {source.page} and " if source.page else ""
        raise UserError(
            f"{config.OWN_SCENES}/{dataset.scene_name}.yaml: scene.blend: "
            f"there is no file {source.blend}; {page}put it there"
        )


def check_external_files(dataset: Dataset) -> None:
    """Check that the files are there which the user's .blend read when it was last listed.

    Raises `UserError`. Of a .blend that was never listed nothing is known.
    """
    source = dataset.source
    if not source.blend or source.allow_missing:
        return
    try:
        listed = json.loads(Path(str(dataset.inventory)).read_bytes())["external_files"]
        home = Path(source.blend).parent
        paths = [
            Path(os.path.normpath(home / file["path"]))
            for file in listed
            if file["bytes"] is not None
        ]
    except (OSError, *DAMAGE):
        return
    # Path.exists() raises for a path that is too long; os.path.exists() does not.
    missing = [str(path) for path in paths if not os.path.exists(path)]  # noqa: PTH110
    if missing:
        more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
        raise UserError(
            f"{source.blend}: files that it shows are missing: {', '.join(missing[:8])}{more}; put "
            "them back, or render without them: scene: {allow_missing: true}"
        )


def check_imported(dataset: Dataset) -> None:
    """Check that the views of a dataset to import are where its lightfield.json is.

    Raises `UserError`.
    """
    folder = Path(str(dataset.imported), "exr")
    missing = [
        f"{pose.name}.exr"
        for pose in dataset.rig.poses()
        if not (folder / f"{pose.name}.exr").is_file()
    ]
    if missing:
        more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
        raise UserError(
            f"{folder}: {', '.join(missing[:8])}{more}: no such file, but the dataset's "
            "lightfield.json has the view"
        )


def _frames(name: str, rig: Rig, frame: int | str) -> Iterator[tuple[str, int | str]]:
    """Yield the folder and the frame number of each dataset of a rig."""
    if rig.sequence is None:
        yield name, frame
        return
    for folder, number in rig.sequence.folders.items():
        yield f"{name}/{folder}", number


def _limited_rig(rig: Rig, limits: Preset, is_rendered: bool) -> Rig:
    """Return a rig of as many views at most, with a file of poses found from any folder.

    Views that are there already keep their resolution.
    """
    if isinstance(rig, Poses):
        rig = rig.model_copy(update={"file": str(Path(rig.file).resolve())})
    if limits.views:
        rig = rig.thinned(limits.views)
    if is_rendered:
        rig = rig.model_copy(update={"camera": _limited(rig.camera, limits)})
    return rig


def _limited_render(render: Render | None, rig: Rig, limits: Preset) -> dict[str, Any]:
    """Return the ``render`` block under a preset's ``limits``.

    Of views that are there already no more is known than what their depth means.

    With a ``target_error``, samples, threshold and denoising are not known before the calibration;
    what the preset says of them limits its choice: at most ``most_samples``, and ``denoise``.
    """
    if render is None:
        assert isinstance(rig, Poses)
        return {"depth": published.depth(rig)}
    content = render.model_dump(exclude_none=True)
    denoise = {} if limits.denoise is None else {"denoise": limits.denoise}
    if isinstance(render.samples, int):
        samples = min(render.samples, limits.samples or render.samples)
        return {**content, "samples": samples, **denoise}
    most = {"most_samples": limits.samples} if limits.samples else {}
    if render.samples == FILE:
        return {**content, **most, **denoise}
    if isinstance(render.target_error, TargetError):
        content["target_error"] = render.target_error.value
        if render.target_error.denoise == "never":
            denoise = {"denoise": False}
    kept = {key: value for key, value in content.items() if key not in CHOSEN}
    return {**kept, **most, **denoise}


def _limited(camera: CameraSettings, limits: Preset) -> CameraSettings:
    """Return the camera with its image's longer side at most ``limits.resolution`` pixels.

    An even side stays even, which video and some trainers need.
    """
    longer = max(camera.resolution)
    most = limits.resolution or longer
    if most >= longer:
        return camera
    scale = (most if longer % 2 else max(1, most // 2 * 2)) / longer
    steps = [2 - side % 2 for side in camera.resolution]
    sizes = [
        max(1, step * round(side * scale / step))
        for side, step in zip(camera.resolution, steps, strict=True)
    ]
    update: dict[str, Any] = {"resolution": tuple(sizes)}
    if camera.principal_point:
        update["principal_point"] = tuple(
            (at - side / 2) * scale + size / 2
            for at, side, size in zip(camera.principal_point, camera.resolution, sizes, strict=True)
        )
    lens = camera.make()
    size = camera.sensor_size
    square = isinstance(lens, Rectilinear) and lens.has_square_pixels
    if square and isinstance(size, tuple):
        # Pixels stay square where a side is rounded.
        update["sensor_size"] = size[0]
    return camera.model_copy(update=update)
