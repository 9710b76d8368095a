"""The stages that write finished views, and the scene's surface, in other formats."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, InstanceOf, TypeAdapter

from lightfield.configuration.exports import (
    EXPORTS,
    Export,
    ExportSettings,
    InstantNgp,
    export_settings_of,
)
from lightfield.core.errors import UserError
from lightfield.core.names import FILE, INVENTORY, VIEWS
from lightfield.engine.stage import ByHand, Stage, option, reads, writes
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
    function = "lightfield.export:write"
    by_hand = SourceByHand

    # Of the exporter's own model.
    settings: InstanceOf[ExportSettings[Any]]
    format: str = option("format of the export", positional=True, enum=EXPORTS)
    dataset: Path = reads("folder of the dataset; for a sequence, folder of the rig")
    output: Path = writes("folder to write")

    @classmethod
    def settings_model(cls, **own: Any) -> type[Settings]:
        return export_settings_of(own["format"])


# The key that each flag of export_instant_ngp.py sets, and the value that the flag gives it. Most
# of these flags have the names of SILVR's generate_NERF_transforms.py.
_KEYS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "image_suffix": ("suffix", str),
    "placed_as": ("trained_by", str),
    "scale": ("options.scale", float),
    "offset": ("options.offset", tuple),
    "depth_bounds": ("options.bounds", lambda is_given: "depth" if is_given else "rig"),
    "aabb_scale": ("options.aabb_scale", int),
    "render_aabb": ("options.render_aabb", lambda corners: (corners[:3], corners[3:])),
    "depth_dir": ("options.depth", lambda _: True),
}


class InstantNgpByHand(ByHand):
    """An export for instant-ngp in SILVR's words."""

    image_suffix: Literal[".png", ".exr"] = option("suffix of the views", ".png")
    scale: Annotated[float, Field(gt=0)] | None = option(
        "scale from metres to unit cubes (default: fitted to the scene)", None
    )
    offset: tuple[float, float, float] | None = option(
        "position of the mean camera in the unit cube, with --scale (default: 0.5 0.5 0.5)",
        None,
        metavar=("X", "Y", "Z"),
    )
    depth_bounds: bool = option(
        "fit the unit cube to the cameras and nine tenths of the points in channel Z of the .exr "
        "views (default: the rig fills a fifth of the cube, or all if it looks inward)",
        False,
    )
    aabb_scale: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = option(
        "side of the training volume in unit cubes (instant-ngp's default: 1)", None
    )
    render_aabb: tuple[float, float, float, float, float, float] | None = option(
        "two opposite corners of the part of the unit cube that instant-ngp shows",
        None,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
    )
    placed_as: str | None = option(
        "take scale and offset from this transforms.json, which lists the training views",
        None,
        metavar="TRANSFORMS",
    )

    def settings(self, given: Mapping[str, Any]) -> ExportSettings[InstantNgp]:
        if self.scale is None and self.offset is not None:
            raise UserError("--offset: needs --scale; without --scale, both are fitted")
        flags = {**given, **dict(self)}
        content: dict[str, Any] = {"options": {"sources": [VIEWS]}}
        for flag, (key, value_of) in _KEYS.items():
            if flags.get(flag) is not None:
                block, _, name = key.rpartition(".")
                (content[block] if block else content)[name] = value_of(flags[flag])
        return checked(TypeAdapter(ExportSettings[InstantNgp]), content, "flags")


class ExportInstantNgp(Stage[ExportSettings[InstantNgp]]):
    """Writes transforms.json, with which instant-ngp opens a dataset's views."""

    name = "export_instant_ngp"
    function = "lightfield.export.instant_ngp:write"
    by_hand = InstantNgpByHand

    input_cfg: Path = reads("lightfield.json of the views")
    output: Path = writes("transforms.json to write")
    image_dir: Path | None = reads("folder of the views (default: the folder of --input-cfg)", None)
    exr_dir: Path | None = writes(
        "folder for the copies of EXR views (default: instant_ngp beside --output)", None
    )
    depth_dir: Path | None = writes(
        "folder for depth maps (16-bit PNG in steps of integer_depth_scale), which are made from "
        "channel Z of the .exr views (default, if the settings file asks for them: "
        "instant_ngp/depth beside --output)",
        None,
    )

    def made(self) -> Iterator[Path]:
        # Masks lie beside the views, and the lists of a split beside the output.
        yield from super().made()
        yield self.output.parent


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
    numbered: bool = Field(
        False,
        description="Whether objects.json lists the numbers that objects have in the passes object "
        "and instance.",
    )


class WriteSurface(Stage[MeshSettings]):
    """Writes the surface that cameras can see as meshes."""

    name = "surface"
    function = "lightfield.export.mesh:write"

    blend: Path = reads("the scene's .blend")
    inventory: Path | None = reads(INVENTORY, None)
    output: Path = writes("folder to write", metavar="FOLDER")
