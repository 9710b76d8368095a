"""Where the files of a dataset lie."""

from dataclasses import dataclass

from lightfield.dataset import passes
from lightfield.dataset.config import FILE
from lightfield.dataset.description import Description
from lightfield.dataset.exports import MANIFEST, VIEWS
from lightfield.dataset.splits_file import SPLITS
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.rigs import BlendCamera, Random, Rig
from lightfield.geometry.rigs.split_setting import PARTS

# Pictures of a report, those of them that are plots, which are .svg too, and all its files.
PICTURES = ("overview", "contact_sheet", "rig", "depth", "noise")
PLOTS = ("rig", "depth", "noise")
PICTURE_FILES = (*(f"{name}.png" for name in PICTURES), *(f"{name}.svg" for name in PLOTS))
REPORT_FILES = (*PICTURE_FILES, "costs.json", "index.html")


@dataclass(frozen=True)
class DatasetPaths(Description):
    """The paths of a dataset's files. One that a dataset does not have is an empty list."""

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

    @property
    def package(self) -> str:
        """A rig's dataset as one archive, all frames of a sequence in it, named as SILVR's are."""
        return f"{self.results_root}/{self.scene_folder}/{self.scene_folder}_{self.rig_name}.tar"

    # The rig, whose places a file may hold.

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
    def camera_frames(self) -> list[int | None]:
        """The frames at which a rig of the .blend's camera needs it; None is the file's own."""
        rig = self.placed_rig
        return rig.path if isinstance(rig, BlendCamera) else []
