"""The paths of a dataset's files."""

from dataclasses import dataclass
from pathlib import Path

from lightfield.configuration.description import Description
from lightfield.configuration.exports import MANIFEST
from lightfield.configuration.publication import DOCUMENTS, PUBLISHED_FOLDER
from lightfield.configuration.reprojections import LIGHT_GROUPS
from lightfield.core.names import MESH, VIEWS
from lightfield.formats import passes
from lightfield.formats.splits_file import SPLITS
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.geometry.rigs import BlendCamera, Random, Rig
from lightfield.geometry.rigs.split_setting import PARTS

# The pictures of a report.
PICTURES = ("overview", "contact_sheet", "rig", "depth", "noise")
# The pictures that are plots, and therefore also .svg files.
PLOTS = ("rig", "depth", "noise")
_PICTURE_FILES = (*(f"{name}.png" for name in PICTURES), *(f"{name}.svg" for name in PLOTS))
REPORT_FILES = (*_PICTURE_FILES, "costs.json", "index.html")


@dataclass(frozen=True)
class DatasetPaths(Description):
    """The paths of a dataset's files. A file that the dataset lacks is an empty list."""

    @property
    def scene_work(self) -> str:
        if self.member:
            return f"{self.work_root}/{self.scene_folder}"
        return f"{self.work_root}/{self.scene_name}"

    @property
    def blend(self) -> str | list[str]:
        """The .blend of a builder, of a model, or of the user. An import has none."""
        if self.imported:
            return []
        if self.source.model:
            return f"{self.scene_work}/model.blend"
        return self.source.blend or f"{self.scene_work}/scene.blend"

    @property
    def blend_check(self) -> str | list[str]:
        """The proof that the user's .blend has the recorded SHA-256. A built scene needs none."""
        return f"{self.scene_work}/blend.json" if self.source.blend else []

    @property
    def model_record(self) -> str | list[str]:
        """The record of a model's import: its fingerprint, and the files that were read."""
        return f"{self.scene_work}/model.json" if self.source.model else []

    @property
    def inventory(self) -> str | list[str]:
        """The list of what the scene contains. An import has none."""
        return [] if self.imported else f"{self.scene_work}/inventory.json"

    @property
    def cameras(self) -> str | list[str]:
        """The list of what surrounds each camera. An import has none."""
        return [] if self.imported else f"{self.work}/cameras.json"

    @property
    def blend_inventory(self) -> str | list[str]:
        """The inventory of the user's own .blend, on which its datasets depend."""
        return self.inventory if self.source.blend else []

    @property
    def lightfield_inventory(self) -> str | list[str]:
        """The inventory on which lightfield.json depends: also for the names of light groups."""
        return self.inventory if self.render.light_groups else self.blend_inventory

    @property
    def trials(self) -> str:
        """The folder of trial renders."""
        return f"{self.scene_work}/trials"

    @property
    def calibration(self) -> str | list[str]:
        """The settings chosen for the scene's target error under the preset, if it has one."""
        if self.render.target_error is None:
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
        """Return the lens maps of a reprojection: one, or one for each face of a cube map."""
        stem = f"{self.work}/{name}/lens_map"
        if self.reprojections[name].cube_map:
            return [f"{stem}_{face}.npy" for face in CUBE_FACES]
        return [f"{stem}.npy"]

    @property
    def places(self) -> str | list[str]:
        """The free places for a random rig's cameras. Other rigs need no such file."""
        return f"{self.work}/places.json" if isinstance(self.rig, Random) else []

    @property
    def lightfields(self) -> list[str]:
        """The lightfield.json of the dataset and of each of its reprojections."""
        folders = [self.folder, *(f"{self.folder}/{name}" for name in self.reprojections)]
        return [f"{folder}/lightfield.json" for folder in folders]

    @property
    def image_folders(self) -> list[str]:
        """The folders in ``folder`` that hold views, their passes and reprojections."""
        folders = ["exr", *(view_pass.name for view_pass in self.render.selected_passes)]
        if self.render.light_groups:
            # Only lightfield.json names all of them.
            present = Path(self.folder).glob(f"{passes.GROUP_PREFIX}*")
            folders = list(dict.fromkeys([*folders, *sorted(path.name for path in present)]))
        if self.flow:
            folders.append(passes.FLOW.name)
        folders += self.reprojections
        for name, reprojection in self.reprojections.items():
            for pass_name in reprojection.passes:
                if pass_name == LIGHT_GROUPS:
                    groups = [each for each in folders if each.startswith(passes.GROUP_PREFIX)]
                    folders += [f"{name}/{group}" for group in groups]
                else:
                    folders.append(f"{name}/{pass_name}")
        return folders

    @property
    def exported(self) -> list[str]:
        """The file of each export and source that its job writes last."""
        files = []
        for name, export in self.exports.selected.items():
            if export.is_of_sequence:
                continue
            file = "transforms.json" if name == "instant_ngp" else f"exports/{name}/{MANIFEST}"
            for source in export.sources:
                folder = self.folder if source == VIEWS else f"{self.folder}/{source}"
                files.append(f"{folder}/{file}")
        return files

    @property
    def rig_home(self) -> str:
        """The rig's folder. In a sequence it holds the folders of the frames."""
        return f"{self.results_root}/{self.scene_folder}/{self.rig_name}"

    @property
    def sequence_exports(self) -> list[str]:
        """The list of each export that is made of the whole sequence, which all frames share."""
        return [
            f"{self.rig_home}/{'' if source == VIEWS else f'{source}/'}exports/{name}/{MANIFEST}"
            for name, export in self.exports.selected.items()
            if export.is_of_sequence
            for source in export.sources
        ]

    @property
    def sequence_sums(self) -> str | list[str]:
        """The checksums of the exports of the whole sequence, if it has any."""
        return f"{self.rig_home}/sha256sums.txt" if self.sequence_exports else []

    @property
    def mesh_list(self) -> list[str]:
        """The file in which the mesh's job lists its files, if the dataset has meshes."""
        return [f"{self.folder}/{MESH}/{MANIFEST}"] if self.mesh else []

    @property
    def export_lists(self) -> list[str]:
        """All files in which exports list their files. With a split, each part has one, too."""
        lists = [*self.exported, *self.mesh_list]
        if self.rig.split:
            for path in self.exported:
                if not path.endswith(MANIFEST):
                    stem = path.removesuffix(".json")
                    lists += [f"{stem}_{part}.json" for part in PARTS]
        return lists

    @property
    def splits(self) -> str | list[str]:
        """The list of the views that train, validate and test, if this rig has a split."""
        return f"{self.results_root}/{self.scene_folder}/{SPLITS}" if self.rig.split else []

    @property
    def published(self) -> list[str]:
        """The files that have a job each: all but views and reports."""
        return [*self.lightfields, *self.exported, *self.mesh_list]

    @property
    def pictures(self) -> list[str]:
        return [f"{self.folder}/report/{name}" for name in _PICTURE_FILES]

    @property
    def panorama(self) -> str | list[str]:
        """The report's panorama. An import has none, because it has no scene to render."""
        is_rendered = self.has_panorama and not self.imported
        return f"{self.work}/panorama/exr/view_0000f.exr" if is_rendered else []

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
        """The archive of a rig's dataset with all frames of a sequence, named as SILVR's are."""
        return f"{self.results_root}/{self.scene_folder}/{self.scene_folder}_{self.rig_name}.tar"

    @property
    def published_documents(self) -> list[str]:
        """The files that describe the rig's dataset where it is published, beside its shards."""
        name = f"{self.scene_folder}_{self.rig_name}"
        folder = f"{self.results_root}/{self.scene_folder}/{PUBLISHED_FOLDER}/{name}"
        return [f"{folder}/{document}" for document in DOCUMENTS]

    # The rig. A file may hold its places.

    @property
    def placed_rig(self) -> Rig:
        """The rig. A random rig and a .blend's camera have the path of the file of their places."""
        if isinstance(self.rig, BlendCamera):
            frame = self.source.frame
            return self.rig.placed(str(self.inventory), frame if isinstance(frame, int) else None)
        if isinstance(self.rig, Random):
            return self.rig.placed(str(self.places))
        return self.rig

    @property
    def camera_frames(self) -> list[float | None]:
        """The frames of a rig of the .blend's camera. None is the file's own frame."""
        rig = self.placed_rig
        return rig.path if isinstance(rig, BlendCamera) else []
