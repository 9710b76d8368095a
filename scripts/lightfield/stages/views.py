"""The stages that make views, and files from views alone: optical flow, and the list of splits."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from lightfield.engine.stage import PlainStage, Stage, option, reads, writes
from lightfield.settings.base import ReaderSettings
from lightfield.settings.types import AtLeastOne

Device = Literal["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"]

LIGHTFIELD = "lightfield.json of the dataset"
VIEWS = "which frames of lightfield.json, as a slice from 0, END excluded (default: all)"
FIRST_END = "FIRST:END"


class RenderShard(PlainStage):
    """Renders some views of a dataset in one process."""

    name = "render_shard"
    function = "lightfield.rendering.views.shard:render"

    blend: Path = reads("the scene's .blend")
    lightfield: Path = reads(LIGHTFIELD)
    inventory: Path | None = reads(
        "JSON that scripts/inventory.py wrote for the scene, which lists what rendering can leave "
        "out",
        None,
    )
    views: str = option(VIEWS, ":", metavar=FIRST_END)
    output: Path = writes("folder to write the views to")
    device: Device = option("device on which Cycles renders", "auto")
    threads: AtLeastOne | None = option("CPU threads (default: all cores)", None)
    stall: int = option(
        "seconds after which a view counts as hung and the process ends (default: 0, never)",
        0,
        metavar="S",
    )

    def made(self) -> Iterator[Path]:
        # The folders of passes lie beside the folder of the views.
        yield self.output.parent


class ImportViews(PlainStage):
    """Imports views that somebody else has rendered: links or copies them, and records them."""

    name = "import_views"
    function = "lightfield.rendering.views.imported_views:import_views"

    dataset: Path = reads("folder of the existing dataset, with views in exr/")
    lightfield: Path = reads("lightfield.json of the dataset to write")
    views: str = option(VIEWS, ":", metavar=FIRST_END)
    output: Path = writes("folder to write the views to")


class ComputeFlow(Stage[ReaderSettings]):
    """Computes the optical flow from views of a dataset to their neighbours."""

    name = "flow"
    function = "lightfield.products.flow:write_flow"

    settings: ReaderSettings = ReaderSettings()
    lightfield: Path = reads(LIGHTFIELD)
    views: str = option(VIEWS, ":", metavar=FIRST_END)
    output: Path = writes("folder to write", metavar="FOLDER")


class ListSplits(PlainStage):
    """Lists which views of a scene's rigs are for training, validation and testing."""

    name = "splits"
    function = "lightfield.products.splits:write_splits"

    lightfields: list[Path] = reads("the rigs' lightfield.json files", positional=True)
    output: Path = writes("splits.json to write")


class ListHeads(PlainStage):
    """Lists the cameras of a scene's heads, and the views that they take at each place."""

    name = "heads"
    function = "lightfield.products.heads:write_heads"

    lightfields: list[Path] = reads("the rigs' lightfield.json files", positional=True)
    output: Path = writes("heads.json to write")
