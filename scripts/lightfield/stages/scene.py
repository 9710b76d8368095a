"""The stages that make a .blend, check it, and list what it contains."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from lightfield.configuration.keys import import_version
from lightfield.configuration.scene_source import (
    BUILDER,
    BUILDER_PARAMETERS,
    MODEL_KEYS,
    Builder,
    BuilderParameters,
    ModelOptions,
    ModelPath,
    SceneSource,
    SharedFolder,
    check_model,
)
from lightfield.engine.stage import PlainStage, Stage, cause, option, reads, writes
from lightfield.exporters import Exports
from lightfield.formats.inventory import read_inventory
from lightfield.geometry.boards import Boards
from lightfield.geometry.rigs.rig import Frame
from lightfield.settings.base import Name, Settings


class BuildSettings(Settings):
    """The settings of scripts/build_scene.py."""

    builder: Builder = Field(description=BUILDER)
    parameters: BuilderParameters = Field({}, validate_default=True, description=BUILDER_PARAMETERS)
    fingerprint: str | None = cause(
        "Hash of the builder's code. If it changes, the scene is built again."
    )


class BuildScene(Stage[BuildSettings]):
    """Builds a scene with one of the builders in scripts/scenes/, or with a user's own."""

    name = "build_scene"
    function = "lightfield.rendering.scenes.built_scene:build"
    by_hand = BuildSettings

    output: Path = writes(".blend to write")


class ImportSettings(ModelOptions):
    """The settings of scripts/import_model.py."""

    model: ModelPath = Field(description="Path of the model file.")
    frame: Frame = Field(
        1, description="Frame of the animation at which the size of the model is measured."
    )
    allow_missing: bool = Field(
        False, description="Import the model even if files that it names are missing."
    )
    shared_folder: SharedFolder | None = Field(
        None, description="Folder with files that the model may name, beside its own folder."
    )
    version: int | None = cause(
        "Version of the importer. If it changes, the model is imported again."
    )
    bpy: str | None = cause("Version of Blender. If it changes, the job runs again.")

    @classmethod
    def of_source(cls, source: SceneSource) -> Self:
        """Return the settings that import the model of a scene's ``source``."""
        keys = {"model", "frame", "allow_missing", "shared_folder", *MODEL_KEYS}
        return cls(
            **source.model_dump(include=keys, exclude_none=True),
            version=import_version(source.light),
            bpy=version("bpy"),
        )

    @model_validator(mode="after")
    def _up_is_unknown(self) -> Self:
        check_model(self.model, self.up)
        return self


class ImportModel(Stage[ImportSettings]):
    """Makes a scene from a model file in glTF, USD, FBX, OBJ, PLY or STL."""

    name = "import_model"
    function = "lightfield.rendering.imports.model:import_model"
    by_hand = ImportSettings

    output: Path = writes(".blend to write")
    record: Path = writes("JSON to write: the files that were read")


class FetchBlend(PlainStage):
    """Downloads the .blend of a scene YAML."""

    name = "fetch_blend"
    function = "lightfield.rendering.scenes.blend_source:fetch"

    scene: str = option("name of a file in configs/scenes/")
    output: Path = writes(".blend to write")


class CheckBlendSettings(Settings):
    """What makes a .blend be checked again."""

    sha256: str | None = cause("SHA-256 in the scene YAML. Without it, the job records the file's.")
    bpy: str | None = cause("Version of Blender. If it changes, the job runs again.")


class CheckBlend(Stage[CheckBlendSettings]):
    """Checks that a .blend has the SHA-256 that is recorded for its scene."""

    name = "check_blend"
    function = "lightfield.rendering.scenes.blend_source:check"

    settings: CheckBlendSettings = CheckBlendSettings()
    scene: str = option("name of a file in configs/scenes/")
    blend: Path = reads(".blend to check")
    output: Path = writes("JSON to write if the .blend has the right SHA-256")


class InventorySettings(Settings):
    """The settings of scripts/inventory.py."""

    scene_name: str | None = Field(None, description="As in the scene YAML.")
    view_layers: Literal["all"] | list[str] | None = Field(
        None, description="As in the scene YAML."
    )
    targets: Boards | None = Field(None, description="As in the scene YAML.")
    allow_missing: bool | None = Field(None, description="As in the scene YAML.")
    motion_blur: bool | None = Field(None, description="As in the scene YAML.")
    rendered_frames: list[int | Literal["file"]] = Field(
        [], description="Frames that the rigs render."
    )
    camera_frames: list[float | None] | None = Field(
        None, description="Frames of rigs of the file's own camera."
    )
    camera_version: int | None = cause("Version of the choice of cameras.")
    look_version: int | None = cause("Version of what is read of the file's look, if it is used.")
    followed_camera: Literal["file", "view"] | None = Field(
        None, description="As in the scene YAML."
    )
    light_groups: str | list[str] | dict[str, list[str]] | None = Field(
        None, description="As in the scene YAML."
    )
    measures_box: bool | None = Field(
        None, description="Whether to measure the scene's box, because a rig fits it."
    )


class Inventory(Stage[InventorySettings]):
    """Lists what a scene contains, and what its rendering can leave out."""

    name = "inventory"
    function = "lightfield.rendering.inspection.inventory_file:make"
    version = 8

    settings: InventorySettings = InventorySettings()
    scene: str | None = option("name of the file in configs/scenes/ that uses this .blend", None)
    blend: Path = reads("the scene's .blend")
    output: Path = writes("JSON to write")
    skip_memory: bool = option(
        "do not measure the memory that the scene takes, in a process of its own", False
    )

    def shared(self) -> Iterator[Path]:
        files = read_inventory(self.output, "external_files")["external_files"]
        yield from (self.blend.parent / file["path"] for file in files)


class NewScene(PlainStage):
    """Writes the scene YAML of a user's own .blend, model file or folder of views."""

    name = "new_scene"
    function = "lightfield.rendering.imports.new_scene:write"

    file: Path = reads("a .blend, a model file, or a folder of views", positional=True)
    scene: Name | None = option("name of the scene (default: the name of the file)", None)
    export: str | None = option(
        "format of an export of the views", None, enum=[*Exports.model_fields]
    )
