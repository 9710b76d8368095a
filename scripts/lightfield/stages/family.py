"""The stages that build the members of a family, collect them, and count them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field

from lightfield.configuration.config_file import Preset
from lightfield.configuration.corpus import CorpusOptions
from lightfield.configuration.family import Draw, Member
from lightfield.configuration.shown_look import ShownLook
from lightfield.core.names import scene_folder
from lightfield.core.paths import files_below
from lightfield.engine.receipts import FOLDER
from lightfield.engine.stage import PlainStage, Stage, cause, option, reads, writes
from lightfield.settings.base import ReaderSettings, Settings
from lightfield.settings.types import AtLeastOne
from lightfield.stages.views import Device


class BatchSettings(Settings):
    """The settings of scripts/build_members.py."""

    family: str = Field(description="Name of the family's scene YAML.")
    scene: dict[str, Any] = Field(
        description="Content of the family's scene YAML, without the block `family`."
    )
    values: dict[str, Draw] = Field({}, description="As in the block `family`.")
    members: list[Member] = Field(min_length=1, description="Members to build.")
    preset: str = Field(
        "full", description="Name of the preset, which becomes part of the folder's name."
    )
    limits: Preset = Field(Preset(), description="Limits of the preset.")
    results: str = Field("results", description="Folder in which the datasets are built.")
    work: str = Field("work", description="Folder for intermediate files.")
    fingerprint: str | None = Field(
        None,
        description="Hash of the builder's code, or version of the importer of models. If it "
        "changes, the members are built again.",
    )
    bpy: str | None = cause("Version of Blender. If it changes, the job runs again.")

    def folder_of(self, member: Member) -> str:
        """Return the folder of a member in the folders of results, of work and of receipts."""
        return f"{scene_folder(self.family, self.preset)}/{member.name}"


class BuildMembers(Stage[BatchSettings]):
    """Builds a batch of a family's members: all their datasets, one member after the other."""

    name = "build_members"
    function = "lightfield.family.batch:run"
    version = 1
    # Each start retries the members that failed.
    reads_history = True

    device: Device = option("device on which Cycles renders", "auto")
    threads: AtLeastOne = option("CPU threads", 1)

    def shared(self) -> Iterator[Path]:
        settings = self.settings
        for member in settings.members:
            place = settings.folder_of(member)
            yield from files_below(Path(settings.results, place))
            yield from files_below(Path(settings.work, FOLDER, place))
            yield Path(settings.work, place, "member.log")


class CorpusSettings(CorpusOptions, ReaderSettings):
    """The settings of scripts/corpus.py."""

    family: str = Field(description="Name of the corpus: the name of the family's scene YAML.")
    members: list[str] | None = Field(
        None,
        description="Names of the members. Without this key, the corpus has all members that have "
        "a record.",
    )
    look: ShownLook | None = Field(None, description="Look of the thumbnails.")
    description: str | None = Field(None, description="Description of the members, in one line.")
    licence: str | None = Field(None, description="Licence of the scene and of the data.")
    credit: str | None = Field(None, description="How to cite the artist of the scene.")


class Corpus(Stage[CorpusSettings]):
    """Writes a family's members as one corpus."""

    name = "corpus"
    function = "lightfield.family.corpus:write"

    folder: Path = writes(
        "folder of the family, which holds a folder for each member", positional=True
    )
    cache: Path = writes(
        "JSON that keeps what was computed from the views, so that it is not computed again",
        metavar="JSON",
    )


class ListScenes(PlainStage):
    """Lists a corpus's exports for feed-forward trainers."""

    name = "list_scenes"
    function = "lightfield.family.scene_lists:write"

    corpus: Path = reads("folder of the corpus", positional=True)
    output: Path = writes("folder to write")


class CountSettings(Settings):
    """The settings of scripts/count_members.py."""

    family: str = Field(description="Name of the family's scene YAML.")


class CountMembers(Stage[CountSettings]):
    """Counts the members of a family that are built, and fails if any has failed."""

    name = "count_members"
    function = "lightfield.family.count:count"

    corpus: Path = reads("corpus.json of the family")
    failed: Path = writes("text file to write: the failed members, with their errors")
    output: Path = writes("JSON to write if no member failed")


class Prune(PlainStage):
    """Removes the members and datasets that families no longer have."""

    name = "prune"
    function = "lightfield.family.prune:prune"

    results: Path = option("folder of the datasets")
    work: Path = option("folder of intermediate files, with the receipts of the members")
    family: list[tuple[str, str]] = option(
        "a family: its folder in the folder of the datasets, and its scene YAML's name",
        [],
        metavar=("FOLDER", "SCENE"),
    )
