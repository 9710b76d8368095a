"""The stages that publish finished datasets, and the stages that fetch them from a storage."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from lightfield.configuration.publication import Credits
from lightfield.configuration.scene_yaml import load_scene
from lightfield.configuration.shown_look import ShownLook, shown_look
from lightfield.engine.stage import ByHand, PlainStage, Stage, option, reads, writes
from lightfield.settings.base import ReaderSettings

FOLDER = "folder of a rig, with one or more datasets"


class PublishChecksums(Stage[ReaderSettings]):
    """Publishes the checksums of a valid dataset."""

    name = "publish_checksums"
    function = "lightfield.validation.result:publish"

    settings: ReaderSettings = ReaderSettings()
    validation: Path = reads("validation.json of the dataset")
    page: Path = option("page of the dataset, to name in the error message")
    output: Path = writes("sha256sums.txt to write")


class PackSettings(ReaderSettings):
    """The settings of scripts/package.py and scripts/publish.py."""

    datasets: list[str] = Field(
        [],
        description="Names of the datasets in the folder. If they change, the folder is packed "
        "again.",
    )
    gigabytes: float | None = Field(
        None,
        gt=0,
        description="Largest size of a package's part, or of a shard. Without this key, a package "
        "is one file, and shards have at most 1 GB.",
        json_schema_extra={"unit": "GB"},
    )
    rig: str | None = Field(
        None,
        description="Type of the rig, such as ring. Without this key, it is the type in "
        "lightfield.json.",
    )
    look: ShownLook | None = Field(None, description="Look of a published dataset's thumbnails.")
    scene: Credits = Field(
        Credits(), description="What the card says about the scene, and what publishing needs."
    )

    @property
    def most_bytes(self) -> float | None:
        """The largest size of a part, or of a shard, in bytes. None without ``gigabytes``."""
        return self.gigabytes and self.gigabytes * 1e9


class PackageByHand(ByHand):
    """The scene of a package, and the size of its parts."""

    scene: str = option("name of the file in configs/scenes/ that gives the licence and credit")
    gigabytes: Annotated[float, Field(gt=0)] | None = option(
        "largest size of a part (default: no limit, one part)", None
    )

    def settings(self, given: Mapping[str, Any]) -> PackSettings:
        scene = load_scene(self.scene)
        look = shown_look(scene.developments.values(), scene.exports.selected.values())
        return PackSettings.of(scene=scene, gigabytes=self.gigabytes, look=look)


class PublishByHand(PackageByHand):
    """The scene of a published dataset, and the size of its shards."""

    scene: str = option("name of the file in configs/scenes/ that has the key publish")
    gigabytes: Annotated[float, Field(gt=0)] | None = option(
        "largest size of a shard (default: 1)", None
    )


class Package(Stage[PackSettings]):
    """Packs a finished dataset as tar archives with a card."""

    name = "package"
    version = 4
    function = "lightfield.publishing.package:write"
    by_hand = PackageByHand

    folder: Path = reads(FOLDER)
    output: Path = writes("archive to write, <scene>_<rig>.tar; a .json is written beside it")


class Publish(Stage[PackSettings]):
    """Writes a finished dataset as WebDataset shards, with descriptions of them."""

    name = "publish"
    version = 3
    function = "lightfield.publishing.publish:write"
    by_hand = PublishByHand

    folder: Path = reads(FOLDER)
    output: Path = writes("folder to write")


class TakeDataset(PlainStage):
    """Copies finished datasets from a storage."""

    name = "take_dataset"
    function = "lightfield.workflow.taking:take_datasets"

    datasets: list[Path] = writes("folders to copy, such as results/scene/rig", positional=True)
    store: str = option("URL or folder of the storage")
    work: str = option("folder of intermediate files in the storage", "work")
