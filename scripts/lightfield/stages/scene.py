"""The stages that make a .blend, check it, and list what it contains."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from lightfield.configuration.keys import import_version
from lightfield.configuration.scene_source import (
    MODEL_KEYS,
    ModelOptions,
    ModelPath,
    Parameters,
    SceneSource,
    SharedFolder,
    check_model,
)
from lightfield.core.names import builders
from lightfield.core.settings import Settings
from lightfield.core.stage import PlainStage, Stage, cause, option, reads, writes
from lightfield.geometry.rigs.rig import Frame


def _known_builder(name: str) -> str:
    if name not in builders():
        raise ValueError(f"must be one of {', '.join(builders())}")
    return name


class BuildSettings(Settings):
    """The settings of scripts/build_scene.py."""

    builder: Annotated[str, AfterValidator(_known_builder)] = Field(
        description="Name of the builder, which is a folder in scripts/scenes/.",
        json_schema_extra={"enum": list(builders())},
    )
    parameters: Parameters = Field(Parameters(), description="Parameters of the builder.")
    fingerprint: str | None = cause(
        "Hash of the builder's code. If it changes, the scene is built again."
    )


class BuildScene(Stage[BuildSettings]):
    """Builds a scene with one of the builders in scripts/scenes/."""

    name = "build_scene"
    function = "lightfield.rendering.built_scene:build"
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
    """Makes a scene from a model file in glTF, USD, OBJ, PLY or STL."""

    name = "import_model"
    function = "lightfield.rendering.model:import_model"
    by_hand = ImportSettings

    output: Path = writes(".blend to write")
    record: Path = writes("JSON to write: the files that were read")
    sources: Path | None = writes(
        "JSON to write as soon as the files that the model names are known, also if the model is "
        "refused",
        None,
    )


class FetchBlend(PlainStage):
    """Downloads the .blend of a scene YAML."""

    name = "fetch_blend"
    function = "lightfield.rendering.blend_source:fetch"

    scene: str = option("name of a file in configs/scenes/")
    output: Path = writes(".blend to write")


class CheckBlend(PlainStage):
    """Checks that a .blend has the SHA-256 that is recorded for its scene."""

    name = "check_blend"
    function = "lightfield.rendering.blend_source:check"

    scene: str = option("name of a file in configs/scenes/")
    blend: Path = reads(".blend to check")
    output: Path = writes("JSON to write if the .blend has the right SHA-256")


class Inventory(PlainStage):
    """Lists what a scene contains, and what its rendering can leave out."""

    name = "inventory"
    function = "lightfield.rendering.inventory_file:make"
    version = 5

    scene: str | None = option("name of the file in configs/scenes/ that uses this .blend", None)
    blend: Path = reads("the scene's .blend")
    output: Path = writes("JSON to write")
