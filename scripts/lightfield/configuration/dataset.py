"""A dataset: its scene and cameras, what is made of the views, and the paths of all files."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Literal

from lightfield.configuration import own_builder, scene_yaml
from lightfield.configuration.capture import Capture
from lightfield.configuration.config_file import Preset
from lightfield.configuration.dataset_paths import Paths, prefix_of
from lightfield.configuration.reprojections import Reprojection
from lightfield.configuration.scene_blocks import Flow, MeshFiles, Video
from lightfield.configuration.shown_look import ShownLook, shown_look
from lightfield.core.names import FILE, PARTS, RENDERED, scene_folder
from lightfield.exporters import BESIDE_VIEWS, Exports
from lightfield.exporters.base import Export
from lightfield.formats import passes
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.rigs import BlendCamera, Random, Rig

# A GPU of any kind is expected to render at least so many times as fast as a core. An NVIDIA H200
# was measured to be 291 to 499 times as fast.
SPEED_OF_GPU = 64


@dataclass(frozen=True)
class Cluster:
    """A cluster that renders: how many jobs run at once, and the cores of each job.

    ``minutes`` is the longest time of a job that its partition allows. ``has_gpus`` says whether
    each render requests a GPU.
    """

    jobs: int
    cores: int
    minutes: int | None = None
    has_gpus: bool = False

    @property
    def speed(self) -> int:
        """How many times as fast as one core a job renders."""
        return max(self.cores, SPEED_OF_GPU) if self.has_gpus else self.cores


@dataclass(frozen=True, kw_only=True)
class Dataset(Capture):
    """One scene seen by one rig, with every default filled in and the preset applied.

    It is made shard by shard. ``rig_folder`` is the rig's name. In a sequence the frame's folder
    follows, as in LFSphere/f00001. ``paths`` says where all files lie. A property with the same
    name is None for a dataset that lacks the file.
    """

    preset: str
    rig_name: str
    rig_folder: str
    # The scene YAML, in which `source`, `render` and `rig` are without the preset's limits.
    written: scene_yaml.Scene
    reprojections: dict[str, Reprojection]
    flow: Flow | None
    mesh: MeshFiles | None
    video: Video | None
    exports: Exports
    # Whether the report shows a panorama from the rig's centre.
    has_panorama: bool
    limits: Preset
    # Returns the number of shards, which depends on costs and on earlier runs.
    shard_count: Callable[["Dataset"], int]
    # The folders of the rigs whose views test models that were trained on this rig's views.
    tested_by: tuple[str, ...] = ()
    # The folder of the rig whose views train the models that this rig's views test.
    trained_by: str | None = None
    results_root: str = "results"
    work_root: str = "work"
    views_per_shard: int | Literal["auto"] = "auto"
    # None if this machine renders.
    cluster: Cluster | None = None
    # The member of a family of scenes whose dataset this is.
    member: str | None = None

    @property
    def scene_folder(self) -> str:
        """The folder of the scene under its preset: garden, garden_tiny, or garden_tiny/0007."""
        folder = scene_folder(self.scene_name, self.preset)
        return f"{folder}/{self.member}" if self.member else folder

    @property
    def name(self) -> str:
        """Scene and rig, as in garden_tiny/LFSphere."""
        return f"{self.scene_folder}/{self.rig_folder}"

    @property
    def sequence_name(self) -> str:
        """Scene and rig, without the frame of a sequence."""
        return f"{self.scene_folder}/{self.rig_name}"

    @cached_property
    def paths(self) -> Paths:
        """Where the dataset's files lie."""
        return self._paths_of(self.rig_folder)

    @property
    def sequence_paths(self) -> Paths:
        """Where the files of the whole sequence lie, whose frames are datasets."""
        return self._paths_of(self.rig_name)

    def _paths_of(self, rig: str) -> Paths:
        # Each member of a family has a scene of its own. Presets share one.
        name = self.scene_folder if self.member else self.scene_name
        return Paths(self.results_root, self.work_root, self.scene_folder, rig, name)

    @cached_property
    def view_count(self) -> int:
        """Number of views of the rig."""
        return self.rig.view_count

    @property
    def pixels(self) -> int:
        """The number of pixels of a view."""
        return math.prod(self.rig.camera.resolution)

    @property
    def panorama_width(self) -> int:
        """The panorama's width: twice a 180 degree fisheye's angular resolution, at most 4096."""
        return min(4 * self.rig.camera.resolution[0], 4096)

    @property
    def uses_file_look(self) -> bool | None:
        """Whether something is developed with the look of the user's .blend. Otherwise None."""
        made = [*self.reprojections.values(), *self.exports.selected.values()]
        return any(getattr(each, "look", None) == FILE for each in made) or None

    @property
    def shown_look(self) -> ShownLook | None:
        """The look of the dataset's pictures, if they have one."""
        return shown_look(self.reprojections.values(), self.exports.selected.values())

    # Files that a dataset may lack.

    @property
    def blend(self) -> str | None:
        """The .blend of a builder, of a model, or of the user. An import has none."""
        if self.imported:
            return None
        if self.source.model:
            return self.paths.model_blend
        return self.source.blend or self.paths.built_blend

    @property
    def builder_files(self) -> list[str]:
        """The files of the user's own builder. Built-in builders have none here."""
        builder = self.source.builder
        if builder is None or not own_builder.is_own(builder):
            return []
        return [str(file) for file in own_builder.files(Path(builder))]

    @property
    def blend_check(self) -> str | None:
        """The proof that the user's .blend has the recorded SHA-256. A built scene needs none."""
        return self.paths.blend_check if self.source.blend else None

    @property
    def model_record(self) -> str | None:
        return self.paths.model_record if self.source.model else None

    @property
    def inventory(self) -> str | None:
        """The inventory: it lists what the scene contains. An import has none."""
        return None if self.imported else self.paths.inventory

    @property
    def blend_inventory(self) -> str | None:
        """The inventory of the user's own .blend, on which its datasets depend."""
        return self.inventory if self.source.blend else None

    @property
    def lightfield_inventory(self) -> str | None:
        """The inventory on which lightfield.json depends: also for the names of light groups."""
        return self.inventory if self.render.light_groups else self.rig_inventory

    @property
    def rig_inventory(self) -> str | None:
        """The inventory on which the places of the cameras depend, if they fit the scene's box."""
        return self.inventory if self.rig.is_fitted else self.blend_inventory

    @property
    def calibration(self) -> str | None:
        """The settings chosen for the target error under the preset, if the scene has one."""
        return None if self.render.target_error is None else self.paths.calibration

    @property
    def places(self) -> str | None:
        """The free places for a random rig's cameras. Other rigs need no such file."""
        return self.paths.places if isinstance(self.rig, Random) else None

    @property
    def cameras(self) -> str | None:
        """The report on the cameras: the space around each of them. An import has none."""
        return None if self.imported else self.paths.cameras

    @property
    def corners(self) -> str | None:
        """The corners of the calibration boards, if the scene has any.

        An omnidirectional stereo view has no centre, and therefore no corners.
        """
        has_corners = self.source.targets and not self.rig.is_omnidirectional
        return self.paths.corners if has_corners else None

    @property
    def panorama(self) -> str | None:
        """The report's panorama. An import has none, because it has no scene to render."""
        return self.paths.panorama if self.has_panorama and not self.imported else None

    @property
    def splits(self) -> str | None:
        """The list of the views that train, validate and test, if this rig has a split."""
        return self.paths.splits if self.rig.split else None

    @property
    def heads(self) -> str | None:
        """The list of the scene's heads, if this rig is a camera of one."""
        return self.paths.heads if self.rig.mount else None

    @property
    def mesh_list(self) -> str | None:
        return self.paths.mesh_list if self.mesh else None

    @property
    def video_list(self) -> str | None:
        return self.paths.video_list if self.video else None

    @property
    def sequence_sums(self) -> str | None:
        """The checksums of the exports of the whole sequence, if it has any."""
        return self.sequence_paths.sums if self.sequence_exports else None

    @property
    def sequence_page(self) -> str | None:
        """The page of the whole sequence, if this is a frame of one."""
        return self.sequence_paths.sequence_page if self.rig.sequence else None

    def training_list(self, export: Export, source: str) -> str | None:
        """Return the list of the ``export`` of the views that train what this dataset tests.

        None if the export does not read it.
        """
        if self.trained_by is None or not export.reads_training_list:
            return None
        return replace(self.paths, rig=self.trained_by).export_list(export.name, prefix_of(source))

    # Files that a dataset has several of.

    @property
    def scene_benchmarks(self) -> list[str]:
        """The folders with the times of the scene's jobs: of all presets, and of this one."""
        folders = dict.fromkeys((self.scene_name, self.scene_folder))
        return [f"{self.work_root}/benchmarks/{folder}" for folder in folders]

    @cached_property
    def shards(self) -> list[tuple[int, int]]:
        """The views in runs (first, end) of nearly equal length."""
        return shard_bounds(self.view_count, self.shard_count(self))

    @property
    def shard_folders(self) -> list[str]:
        """The folders of receipts of the shards that make the dataset's images."""
        folders = [RENDERED, *self.reprojections]
        if self.flow:
            folders.append(passes.FLOW.name)
        return folders

    def receipts(self, folder: str) -> list[str]:
        """Return the receipts of all shards in one of the `shard_folders`."""
        return [self.paths.receipt(folder, first, end) for first, end in self.shards]

    @property
    def all_receipts(self) -> list[str]:
        """The receipts of all shards."""
        return [file for folder in self.shard_folders for file in self.receipts(folder)]

    def rigs_beside(self, export: Export) -> tuple[str, ...]:
        """Return the folders of the other rigs whose views go into an ``export`` of this one.

        They test, unless the export has several rigs together.
        """
        if export.joined_rigs:
            frame_folder = self.rig_folder.removeprefix(self.rig_name)
            return tuple(f"{rig}{frame_folder}" for rig in export.joined_rigs[1:])
        return self.tested_by if export.is_for_training else ()

    def lens_maps(self, name: str) -> list[str]:
        """Return the lens maps of a reprojection: one, or one for each face of a cube map."""
        faces = CUBE_FACES if self.reprojections[name].cube_map else ("",)
        return [self.paths.lens_map(name, face) for face in faces]

    @property
    def lightfields(self) -> list[str]:
        """The lightfield.json of the dataset and of each of its reprojections."""
        prefixes = ["", *map(prefix_of, self.reprojections)]
        return [self.paths.source_lightfield(prefix) for prefix in prefixes]

    @property
    def exported(self) -> list[str]:
        """The file of each export and source that its job writes last."""
        return [
            self.paths.export_list(name, prefix_of(source))
            for name, export in self.exports.selected.items()
            if not export.is_of_sequence
            for source in export.sources
        ]

    @property
    def sequence_exports(self) -> list[str]:
        """The list of each export that is made of the whole sequence, which all frames share."""
        return [
            self.sequence_paths.export_list(name, prefix_of(source))
            for name, export in self.exports.selected.items()
            if export.is_of_sequence
            for source in export.sources
        ]

    @property
    def export_lists(self) -> list[str]:
        """All files in which exports list their files. With a split, each part has one, too."""
        lists = [*self.exported, *_present(self.mesh_list), *_present(self.video_list)]
        if self.rig.split:
            lists += [
                self.paths.export_list(name, prefix_of(source), part)
                for name, export in self.exports.selected.items()
                if name in BESIDE_VIEWS
                for source in export.sources
                for part in PARTS
            ]
        return lists

    @property
    def published(self) -> list[str]:
        """The light fields, corners, and lists of exports, mesh and video. One job makes each."""
        lists = _present(self.corners, self.mesh_list, self.video_list)
        return [*self.lightfields, *self.exported, *lists]

    @property
    def files(self) -> list[str]:
        """All files of the finished dataset, as a target rule names them.

        The receipts are among them, although other files depend on them: Snakemake makes a missing
        file again only if a target rule names it.
        """
        paths = self.paths
        return [
            paths.validation,
            paths.sums,
            *_present(self.splits, self.heads),
            *self.published,
            *self.sequence_exports,
            *_present(self.sequence_sums),
            *paths.pictures,
            paths.costs,
            paths.page,
            *_present(self.sequence_page),
            *self.all_receipts,
        ]

    @property
    def intermediates(self) -> list[str]:
        """The intermediate files, which a target rule names, too: a missing one is made again."""
        files = _present(
            self.blend_check or self.blend,
            self.model_record,
            self.inventory,
            self.calibration,
            self.places,
            self.cameras,
        )
        if self.panorama:
            files += [self.paths.panorama_lightfield, self.panorama]
        for name in self.reprojections:
            files += self.lens_maps(name)
        return files

    # The rig. A file may hold its places.

    @property
    def placed_rig(self) -> Rig:
        """The rig. A random rig and a .blend's camera have the path of the file of their places."""
        if isinstance(self.rig, BlendCamera):
            frame = self.source.frame
            inventory = self.paths.inventory
            return self.rig.placed(inventory, frame if isinstance(frame, int) else None)
        if isinstance(self.rig, Random):
            return self.rig.placed(self.paths.places)
        return self.rig

    @property
    def camera_frames(self) -> list[float | None]:
        """The frames of a rig of the .blend's camera. None is the file's own frame."""
        rig = self.placed_rig
        return rig.path if isinstance(rig, BlendCamera) else []


def shard_bounds(views: int, count: int) -> list[tuple[int, int]]:
    """Return the views in ``count`` runs (first, end) of nearly equal length."""
    return list(pairwise(views * number // count for number in range(count + 1)))


def _present(*paths: str | None) -> list[str]:
    """Return the paths of the files that a dataset has."""
    return [path for path in paths if path is not None]
