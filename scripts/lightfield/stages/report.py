"""The stages that draw a dataset's pictures and write the pages."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PlainSerializer

from lightfield.configuration.shown_look import ShownLook
from lightfield.core.names import ROOT
from lightfield.engine.stage import PlainStage, Stage, cause, option, reads, writes
from lightfield.geometry.rigs import AnyRig, as_written
from lightfield.settings.base import ReaderSettings, Settings


class FiguresSettings(ReaderSettings):
    """The settings of scripts/report_figures.py."""

    rig: Annotated[AnyRig, PlainSerializer(as_written)] = Field(description="As in the scene YAML.")
    chooses_tests: bool | None = Field(
        None,
        description="Whether an export chooses test views, because the rig has no split. The "
        "drawing of the rig shows them.",
    )
    look: ShownLook | None = Field(None, description="Look of the pictures.")


class ReportFigures(Stage[FiguresSettings]):
    """Draws a dataset's pictures: an overview, the contact sheet, its rig, depth and noise."""

    name = "report_figures"
    function = "lightfield.report.figures:draw"
    version = 1

    dataset: Path = reads("folder of the dataset")
    panorama: Path | None = reads(
        "EXR of a panorama from the rig's centre, for the overview (default: the view in the rig's "
        "middle)",
        None,
        may_be_empty=True,
    )
    output: Path = writes("folder to write")


class MeasurementFile(Settings):
    """A file that a measurement wrote, and that the page shows."""

    file: str = Field(description="Path of the file.")
    sha256: str | None = cause("SHA-256 of the file. If it changes, the page is made again.")


class PageSettings(ReaderSettings):
    """The settings of scripts/report_html.py."""

    rig: Annotated[AnyRig, PlainSerializer(as_written)] = Field(description="As in the scene YAML.")
    yaml: str = Field(description="Text of the scene YAML.")
    command: str = Field(description="Command that builds the dataset again.")
    panorama: bool = Field(
        False,
        description="Whether the overview is a panorama. false: it is the view in the rig's "
        "middle.",
    )
    measurements: list[MeasurementFile] = Field(
        [], description="Files of measurements that the page shows."
    )
    look: ShownLook | None = Field(None, description="Look of the page's pictures.")


class ReportHtml(Stage[PageSettings]):
    """Makes a dataset's page: one file that shows its views, their quality, and their cost."""

    name = "report_html"
    function = "lightfield.report.dataset_page:write"
    version = 3

    dataset: Path = reads("folder of the dataset")
    dataset_name: str = option("name of the dataset, scene/rig", flag="--name", metavar="NAME")
    inventory: Path | None = reads(
        "JSON that scripts/inventory.py wrote for the scene, if it is a user's .blend", None
    )
    output: Path = writes("HTML file to write")


class SequenceSettings(ReaderSettings):
    """The settings of scripts/report_sequence.py."""

    frames: list[str] = Field(
        min_length=1, description="Names of the folders of the sequence's frames, in order of time."
    )
    rig: Annotated[AnyRig, PlainSerializer(as_written)] = Field(description="As in the scene YAML.")
    look: ShownLook | None = Field(None, description="Look of the page's pictures.")


class ReportSequence(Stage[SequenceSettings]):
    """Makes a sequence's page: one file that shows and plays its frames."""

    name = "report_sequence"
    function = "lightfield.report.sequence_page:write"

    rig: Path = reads("folder of the rig, which holds the folders of the frames")
    rig_name: str = option("name of the rig, scene/rig", flag="--name", metavar="NAME")
    output: Path = writes("HTML file to write")


class VideoSettings(ReaderSettings):
    """The settings of scripts/video.py."""

    path: Literal["turntable", "walk"] = Field(description="As in the scene YAML.")
    format: Literal["mp4", "webp"] = Field(description="As in the scene YAML.")
    seconds: float = Field(gt=0, description="As in the scene YAML.")
    height: int = Field(gt=0, multiple_of=2, description="As in the scene YAML.")
    rig: Annotated[AnyRig, PlainSerializer(as_written)] = Field(description="As in the scene YAML.")
    look: ShownLook | None = Field(None, description="Look of the video.")


class MakeVideo(Stage[VideoSettings]):
    """Makes a turntable or a walk of a dataset as a video."""

    name = "video"
    function = "lightfield.report.video:write"

    dataset: Path = reads("folder of the dataset")
    output: Path = writes("folder to write", metavar="FOLDER")


class ReportWalk(PlainStage):
    """Writes the walk of a dataset's page as one file, for a site."""

    name = "report_walk"
    function = "lightfield.report.walk_page:write"

    page: Path = reads("page of a dataset: its report/index.html", positional=True)
    output: Path = writes("HTML file to write")


class ReportIndex(PlainStage):
    """Makes the page with links to the pages of all datasets in a results folder."""

    name = "report_index"
    function = "lightfield.report.index_page:write"
    # It lists all datasets in the folder, also datasets of other runs.
    reads_history = True

    results: Path = reads("folder of the datasets")
    output: Path = writes("HTML file to write, in that folder")


class WriteSchemas(PlainStage):
    """Writes the JSON schemas, with which editors complete and check YAML files."""

    name = "schema"
    function = "lightfield.workflow.schemas:write"

    folder: Path = writes("folder to write (default: configs/schema)", ROOT / "configs" / "schema")
