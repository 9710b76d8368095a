"""Where the files of a dataset lie. The rules use the same paths, with wildcards for names."""

from dataclasses import dataclass

from lightfield.configuration.publication import DOCUMENTS, PUBLISHED_FOLDER
from lightfield.core.names import HEADS, MESH, SEQUENCE_PAGE, SPLITS, VIDEO, VIEWS
from lightfield.engine.receipts import FOLDER, SUFFIX
from lightfield.exporters import list_path
from lightfield.formats.export_lists import MANIFEST
from lightfield.formats.layout import CORNERS

# The pictures of a report.
PICTURES = ("overview", "contact_sheet", "rig", "depth", "noise")
# The pictures that are plots, and therefore also .svg files.
PLOTS = ("rig", "depth", "noise")
_PICTURE_FILES = (*(f"{name}.png" for name in PICTURES), *(f"{name}.svg" for name in PLOTS))
REPORT_FILES = (*_PICTURE_FILES, "costs.json", "index.html")


def prefix_of(source: str) -> str:
    """Return how the paths of a source begin in a dataset's folder: nothing for the views."""
    return "" if source == VIEWS else f"{source}/"


@dataclass(frozen=True)
class Paths:
    """The paths of a dataset's files, as Snakemake compares them.

    ``scene`` is the folder of a scene under its preset. ``rig`` is the folder of a rig. In a
    sequence the frame's folder follows, as in LFSphere/f00001. ``name`` is the folder in
    ``work_root`` with the files that all presets share. The rules leave these names out, and get
    wildcards in their place. A dataset may lack some of these files: see `Dataset`.
    """

    results_root: str
    work_root: str
    scene: str = "{scene}"
    rig: str = "{rig}"
    name: str = "{name}"

    # Files of a scene that all presets share.

    @property
    def scene_work(self) -> str:
        return f"{self.work_root}/{self.name}"

    @property
    def built_blend(self) -> str:
        return f"{self.scene_work}/scene.blend"

    @property
    def model_blend(self) -> str:
        return f"{self.scene_work}/model.blend"

    @property
    def model_record(self) -> str:
        """The record of a model's import: its fingerprint, and the files that were read."""
        return f"{self.scene_work}/model.json"

    @property
    def blend_check(self) -> str:
        """The proof that the user's .blend has the recorded SHA-256."""
        return f"{self.scene_work}/blend.json"

    @property
    def inventory(self) -> str:
        """The inventory: it lists what the scene contains."""
        return f"{self.scene_work}/inventory.json"

    @property
    def trials(self) -> str:
        """The folder of trial renders."""
        return f"{self.scene_work}/trials"

    # Files of a scene under one preset.

    @property
    def scene_results(self) -> str:
        return f"{self.results_root}/{self.scene}"

    @property
    def probes(self) -> str:
        """The lightfield.json of the scene's probe cameras."""
        return f"{self.work_root}/{self.scene}/probes.json"

    @property
    def calibration(self) -> str:
        """The settings chosen for the scene's target error."""
        return f"{self.work_root}/{self.scene}/calibration.json"

    @property
    def calibration_seconds(self) -> str:
        return f"{self.work_root}/{self.scene}/calibration_seconds.json"

    @property
    def splits(self) -> str:
        """The list of the views that train, validate and test."""
        return f"{self.scene_results}/{SPLITS}"

    @property
    def heads(self) -> str:
        """The list of the scene's heads: cameras on one body, and what they take at each place."""
        return f"{self.scene_results}/{HEADS}"

    # Files of a rig.

    @property
    def folder(self) -> str:
        return f"{self.scene_results}/{self.rig}"

    @property
    def work(self) -> str:
        return f"{self.work_root}/{self.scene}/{self.rig}"

    def settings(self, name: str) -> str:
        """Return the settings file of a job."""
        return f"{self.work}/settings/{name}.json"

    @property
    def lightfield(self) -> str:
        return f"{self.folder}/lightfield.json"

    @property
    def views(self) -> str:
        """The folder of the rendered views."""
        return f"{self.folder}/exr"

    @property
    def places(self) -> str:
        """The free places for a random rig's cameras."""
        return f"{self.work}/places.json"

    @property
    def cameras(self) -> str:
        """The report on the cameras: the space around each of them."""
        return f"{self.work}/cameras.json"

    @property
    def corners(self) -> str:
        """The corners of the calibration boards in each view."""
        return f"{self.folder}/{CORNERS}"

    @property
    def probe(self) -> str:
        """The times and sizes of a few views."""
        return f"{self.work}/probe.json"

    def receipt(
        self, folder: str = "{reprojection}", first: int | str = "{first}", end: int | str = "{end}"
    ) -> str:
        """Return the receipt of a shard, in the folder of the rendered views or a reprojection."""
        return f"{self.work_root}/{FOLDER}/{self.scene}/{self.rig}/{folder}/{first}-{end}{SUFFIX}"

    @property
    def mesh_list(self) -> str:
        """The file in which the mesh's job lists its files."""
        return f"{self.folder}/{MESH}/{MANIFEST}"

    @property
    def video_list(self) -> str:
        """The file in which the video's job lists its file."""
        return f"{self.folder}/{VIDEO}/{MANIFEST}"

    # Files of a reprojection. A source is a reprojection, or the views: see `prefix_of`.

    def reprojected(self, name: str = "{reprojection}") -> str:
        """Return the folder of a reprojection."""
        return f"{self.folder}/{name}"

    def lens_map(self, name: str = "{reprojection}", face: str = "") -> str:
        """Return the lens map of a reprojection, or of one face of a cube map."""
        ending = f"_{face}" if face else ""
        return f"{self.work}/{name}/lens_map{ending}.npy"

    def source_lightfield(self, prefix: str = "{source}") -> str:
        """Return the lightfield.json of a source."""
        return f"{self.folder}/{prefix}lightfield.json"

    def export_list(self, name: str = "{format}", prefix: str = "{source}", part: str = "") -> str:
        """Return the file in which the job of an export of a source lists its files.

        ``part`` is a part of a split, which has a list of its own beside the views.
        """
        return f"{self.folder}/{prefix}{list_path(name, part)}"

    # Files of the checks and the report.

    @property
    def validation(self) -> str:
        return f"{self.folder}/validation.json"

    @property
    def sums(self) -> str:
        """The published checksums."""
        return f"{self.folder}/sha256sums.txt"

    @property
    def panorama_lightfield(self) -> str:
        return f"{self.work}/panorama/lightfield.json"

    @property
    def panorama_views(self) -> str:
        """The folder of the report's panorama."""
        return f"{self.work}/panorama/exr"

    @property
    def panorama(self) -> str:
        """The report's panorama."""
        return f"{self.panorama_views}/view_0000f.exr"

    @property
    def pictures(self) -> list[str]:
        return [f"{self.folder}/report/{name}" for name in _PICTURE_FILES]

    @property
    def costs(self) -> str:
        return f"{self.folder}/report/costs.json"

    @property
    def page(self) -> str:
        """The page that shows the dataset."""
        return f"{self.folder}/report/index.html"

    # Files of a rig with all frames of a sequence.

    @property
    def sequence_page(self) -> str:
        """The page that shows all frames of a sequence."""
        return f"{self.folder}/report/{SEQUENCE_PAGE}"

    @property
    def package(self) -> str:
        """The archive, named as SILVR's are."""
        return f"{self.scene_results}/{self.scene}_{self.rig}.tar"

    @property
    def card(self) -> str:
        """The description of the archive."""
        return f"{self.scene_results}/{self.scene}_{self.rig}.json"

    @property
    def documents(self) -> list[str]:
        """The files that describe the rig's dataset where it is published, beside its shards."""
        folder = f"{self.scene_results}/{PUBLISHED_FOLDER}/{self.scene}_{self.rig}"
        return [f"{folder}/{document}" for document in DOCUMENTS]
