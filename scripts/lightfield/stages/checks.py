"""The stages that check finished datasets, and show the progress of a build."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from lightfield.core.names import INVENTORY
from lightfield.engine.stage import ByHand, PlainStage, Stage, option, reads, writes
from lightfield.settings.base import ReaderSettings
from lightfield.settings.types import AtLeastOne


class ValidationSettings(ReaderSettings):
    """The settings of scripts/validate.py. Paths are relative to the working folder."""

    reprojections: list[str] = Field(
        [], description="Names of the folders in the dataset that hold reprojections."
    )
    exports: list[str] | None = Field(
        None,
        description="Paths of the export.json or transforms.json of each export that the dataset "
        "must have. Without this key, any exports are allowed.",
    )


class ValidationByHand(ByHand):
    """The parts that a dataset must have, from flags instead of a settings file."""

    receipts: list[str] = option(
        "receipts with the checksums with which images were written", [], may_be_empty=True
    )
    reprojection: list[str] = option(
        "reprojections, by their folders in the dataset (default without --output: all)", []
    )
    exports: list[str] | None = option(
        "export.json or transforms.json of each export that the dataset must have (default: any)",
        None,
        may_be_empty=True,
    )

    def settings(self, given: Mapping[str, Any]) -> ValidationSettings:
        return ValidationSettings.of(
            reprojections=self.reprojection, exports=self.exports, inputs=self.receipts
        )


class Validate(Stage[ValidationSettings]):
    """Checks a whole dataset."""

    name = "validate"
    function = "lightfield.validation.validation_file:check"
    by_hand = ValidationByHand

    dataset: Path = reads("folder of the dataset", positional=True)
    output: Path | None = writes("validation.json to write", None)
    clearance: Path | None = reads("JSON that scripts/check_cameras.py wrote for the dataset", None)
    inventory: Path | None = reads(INVENTORY, None)
    splits: Path | None = reads("splits.json of the scene", None)
    removed: Path | None = option(
        "folder to which files that do not belong to the dataset are moved", None
    )
    processes: AtLeastOne = option("number of worker processes", 1)


class SequenceValidationSettings(ReaderSettings):
    """The settings of scripts/validate_sequence.py. Paths are relative to the working folder."""

    frames: list[str] | None = Field(
        None,
        description="Names of the folders of the sequence's frames, in the rig's folder. Without "
        "this key, all of them.",
    )
    exports: list[str] | None = Field(
        None,
        description="Paths of the export.json of each export that the sequence must have. Without "
        "this key, any exports are allowed.",
    )


class SequenceValidationByHand(ByHand):
    """The parts that a sequence must have, from flags instead of a settings file."""

    exports: list[str] | None = option(
        "export.json of each export that the sequence must have (default: any)",
        None,
        may_be_empty=True,
    )

    def settings(self, given: Mapping[str, Any]) -> SequenceValidationSettings:
        return SequenceValidationSettings.of(exports=self.exports)


class ValidateSequence(Stage[SequenceValidationSettings]):
    """Checks the exports of a whole sequence."""

    name = "validate_sequence"
    function = "lightfield.validation.validation_file:check_sequence"
    by_hand = SequenceValidationByHand

    rig: Path = reads("folder of the rig, which holds the folders of the frames", positional=True)
    output: Path | None = writes("validation.json to write, with --sums", None)
    sums: Path | None = writes("sha256sums.txt to write, with --output", None)
    removed: Path | None = option(
        "folder to which files that do not belong to the sequence are moved", None
    )


class Verify(PlainStage):
    """Checks every byte of datasets against the checksums of their files."""

    name = "verify"
    function = "lightfield.validation.verification:verify"

    dataset: list[Path] = reads("folder of a dataset, or of a family of scenes", positional=True)
    work: Path | None = option("the workflow's folder of intermediate files", None)
    mend: bool = option(
        "move damaged files to WORK/removed, so that the next run makes them again", False
    )


class Diff(PlainStage):
    """Says why two datasets differ."""

    name = "diff"
    function = "lightfield.measurement.dataset_difference:compare"
    error_status = 2

    a: Path = reads("folder of a dataset", positional=True)
    b: Path = reads("folder of the other dataset", positional=True)


class Status(PlainStage):
    """Prints the progress of the chosen datasets."""

    name = "status"
    function = "lightfield.workflow.status:show"

    results: Path = option("folder of the datasets")
    work: Path = option("folder of intermediate files, with the receipts of the shards")
    dataset: list[tuple[str, AtLeastOne, str]] = option(
        "a dataset: scene/rig, its number of views, and the names of its reprojections, separated "
        "by commas",
        [],
        metavar=("NAME", "VIEWS", "REPROJECTIONS"),
    )
    outdated: list[str] = option(
        "a dataset whose scene or settings have changed since its cameras were placed: scene/rig",
        [],
        metavar="NAME",
    )
    family: list[tuple[str, str]] = option(
        "a family: its folder, and its scene YAML's name", [], metavar=("FOLDER", "SCENE")
    )
