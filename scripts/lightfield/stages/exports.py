"""The stages that write finished views, and the scene's surface, in other formats."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, InstanceOf, TypeAdapter

from lightfield.core.names import FILE, INVENTORY, VIEWS
from lightfield.engine.stage import ByHand, Stage, option, reads, writes
from lightfield.exporters import EXPORTERS, export_settings_of, list_path
from lightfield.exporters.base import Export, ExportSettings
from lightfield.geometry.boards import Boards
from lightfield.geometry.rigs.rig import Frame
from lightfield.settings.base import Settings, checked


class SourceByHand(ByHand):
    """The views of an export that has default options."""

    source: str = option("name of a reprojection", VIEWS)
    suffix: Literal[".png", ".exr"] = option("suffix of the source's images", ".exr")

    def settings(self, given: Mapping[str, Any]) -> ExportSettings[Export]:
        content = {"options": {"sources": [self.source]}, "suffix": self.suffix}
        return checked(TypeAdapter(export_settings_of(given["format"])), content, "flags")


class ExportViews(Stage[ExportSettings[Any]]):
    """Writes the views of a dataset in the format of another program."""

    name = "export"
    function = "lightfield.products.exports:write"
    by_hand = SourceByHand

    # Of the exporter's own model.
    settings: InstanceOf[ExportSettings[Any]]
    format: str = option("format of the export", positional=True, enum=tuple(EXPORTERS))
    dataset: Path = reads("folder of the dataset; for a sequence, folder of the rig")
    output: Path = writes("folder to write")

    def made(self) -> Iterator[Path]:
        yield from super().made()
        yield self.output / Path(list_path(self.format)).name

    @classmethod
    def settings_model(cls, **own: Any) -> type[Settings]:
        return export_settings_of(own["format"])


class MeshSettings(Settings):
    """The settings of scripts/surface.py."""

    formats: list[Literal["glb", "ply"]] = Field(
        ["glb", "ply"], min_length=1, description="As in the scene YAML."
    )
    frame: Frame | Literal["file"] = Field(
        1, description=f"Frame to load. {FILE}: the .blend's own."
    )
    scene_name: str | None = Field(None, description="As in the scene YAML.")
    view_layers: Literal["all"] | list[str] | None = Field(
        None, description="As in the scene YAML."
    )
    targets: Boards | None = Field(None, description="As in the scene YAML.")
    numbered: bool = Field(
        False,
        description="Whether objects.json lists the numbers that objects have in the passes object "
        "and instance.",
    )


class WriteSurface(Stage[MeshSettings]):
    """Writes the surface that cameras can see as meshes."""

    name = "surface"
    function = "lightfield.products.mesh:write"

    blend: Path = reads("the scene's .blend")
    inventory: Path | None = reads(INVENTORY, None)
    output: Path = writes("folder to write", metavar="FOLDER")
