"""The block `scene` of a scene YAML: the builder, .blend, model or views that a scene is from."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, WrapValidator, model_validator

from lightfield.configuration import own_builder
from lightfield.core.names import FILE, LIGHTS, MODELS, SOFTBOXES, UP, builders
from lightfield.geometry.boards import Boards
from lightfield.geometry.rigs.rig import Frame
from lightfield.settings.base import AS_WRITTEN, Address, Settings, pattern
from lightfield.settings.types import QUOTED


class Parameters(Settings):
    """The parameters of a builder."""

    seed: int = Field(
        0,
        ge=0,
        le=2**63 - 1,
        description="Seed of everything random. Another seed gives other positions and shapes of "
        "objects.",
    )
    detail: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] = Field(
        1.0,
        description="Level of detail of plants and meshes. 1 is full detail, and less is faster.",
    )
    place: Annotated[int, Field(ge=0, le=2**63 - 1)] | None = Field(
        None,
        description="Number of a variant of the scene, with another layout, materials and light. "
        "Without this key, the scene has the builder's own layout. The builder `room` has no "
        "other.",
    )


_MODEL_SUFFIXES = "|".join(suffix[1:] for suffix in (*MODELS, *map(str.upper, MODELS)))


class ModelOptions(Settings):
    """How a model file becomes a scene."""

    unit: Literal["box", "metres"] = Field(
        "box",
        description="Size of a model. box: its largest side becomes 1 m, and its middle moves to "
        "the origin. metres: it keeps its size and position.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto",
        description="Axis that points up in an OBJ, PLY or STL model. auto: y for OBJ, z for PLY "
        "and STL. glTF, USD and FBX files define it themselves.",
    )
    ground: bool = Field(
        False,
        description="Put a floor under the model, which receives its shadow. It is a shadow "
        "catcher: views that are not transparent show the light's environment through it.",
    )
    light: str = Field(
        SOFTBOXES,
        pattern=pattern(
            rf"^({'|'.join(LIGHTS)}|{QUOTED}\.(hdr|exr|HDR|EXR))$",
            f"one of {', '.join(LIGHTS)}, or a path that ends in .hdr or .exr, without {{ }} * ? "
            "[ ] and line breaks",
        ),
        examples=list(LIGHTS),
        description="Light of a model. softboxes: three lamps and a grey world. Any other name: "
        "the environment of this name that comes with Blender. A path: your own environment, an "
        "equirectangular .hdr or .exr, relative to the folder in which Snakemake runs.",
    )

    @property
    def light_file(self) -> str | None:
        """The path of the user's own environment. None for a light that has a name."""
        return None if self.light in LIGHTS else self.light


def check_model(model: str, up: str) -> None:
    """Raise a ValueError if ``up`` is given for a model that says itself which axis points up."""
    if up != "auto" and Path(model).suffix.lower() not in UP:
        raise ValueError(
            "up: is only for OBJ, PLY and STL; glTF, USD and FBX files define it themselves"
        )


ModelPath = Annotated[
    str,
    Field(
        pattern=pattern(
            rf"^{QUOTED}\.({_MODEL_SUFFIXES})$",
            f"a path that ends in {', '.join(MODELS)}, without {{ }} * ? [ ] and line breaks",
        )
    ),
]
SharedFolder = Annotated[
    str,
    Field(
        pattern=pattern(rf"^{QUOTED}$", "a path of a folder, without { } * ? [ ] and line breaks")
    ),
]
# Keys of `SceneSource` that only a .blend takes.
_BLEND_KEYS = (
    *("scene_name", "view_layers", "followed_camera", "allow_missing", "sha256", "url", "page"),
)
# Keys of `SceneSource` that only a model takes.
MODEL_KEYS = tuple(ModelOptions.model_fields)


def _existing_builder(builder: str) -> str:
    """Return a builder if it exists. Raises a ValueError or `UserError` that says what is wrong."""
    if own_builder.is_own(builder):
        if not os.path.lexists(builder):
            raise ValueError("must be the path of a file that exists")
        own_builder.check(Path(builder))
    elif builder not in builders():
        raise ValueError(f"must be one of {', '.join(builders())}, or a path that ends in .py")
    return builder


def _of_builder(parameters: Any, _check: Any, others: ValidationInfo) -> Any:
    """Check parameters by the builder to which they belong."""
    builder = others.data.get("builder")
    if builder and own_builder.is_own(builder):
        return own_builder.check_parameters(Path(builder), parameters)
    return Parameters.model_validate(parameters)


Builder = Annotated[
    str,
    Field(
        pattern=pattern(
            rf"^([a-z][a-z0-9_]*|{QUOTED}\.py)$",
            "a name of small letters, digits and _ with a letter first, or a path that ends in "
            ".py, without { } * ? [ ] and line breaks",
        ),
        examples=list(builders()),
    ),
    AfterValidator(_existing_builder),
]
BUILDER = (
    "Name of the builder, which is a folder in scripts/scenes/. Or path of your own builder, a "
    "Python file, relative to the folder in which Snakemake runs."
)
BuilderParameters = Annotated[Parameters | dict[str, Any], WrapValidator(_of_builder)]
BUILDER_PARAMETERS = "Parameters of the builder. Your own builder has its own."


class Origin(Settings):
    """Where a scene is from: a builder, a .blend, a model file, or views that exist already."""

    builder: Builder | None = Field(None, description=BUILDER)
    parameters: BuilderParameters = Field({}, validate_default=True, description=BUILDER_PARAMETERS)
    blend: str | None = Field(
        None,
        pattern=pattern(
            rf"^{QUOTED}\.blend$", "a path that ends in .blend, without { } * ? [ ] and line breaks"
        ),
        description="Path of your own .blend file, relative to the folder in which Snakemake runs.",
    )
    model: ModelPath | None = Field(
        None,
        description="Path of a model file (glTF, USD, FBX, OBJ, PLY or STL), relative to the "
        "folder in which Snakemake runs.",
    )
    dataset: str | None = Field(
        None,
        description="Folder of existing views, which replace rendering: a light field in SILVR's "
        "layout (lightfield.json and exr/), or a folder of several.",
    )
    scene_name: str | None = Field(
        None,
        description="Name of the scene in the .blend to render. Without this key, it is the scene "
        "that was active when the .blend was saved.",
    )
    view_layers: Literal["all"] | list[str] | None = Field(
        None,
        min_length=1,
        description="View layers of that scene, which are rendered together into one picture. all: "
        "every layer that is enabled for rendering. Without this key, only the first of these.",
    )
    frame: Frame | Literal["file"] = Field(
        1,
        description="Frame of the animation to render. file: the frame at which the .blend was "
        "saved. The size of a model is measured at this frame.",
    )
    followed_camera: Literal["file", "view"] | None = Field(
        None,
        description="Camera that objects of the .blend follow, as billboards do. file, which is "
        "the default: the .blend's camera, so all views show the same scene. view: each view's "
        "own, as if Blender rendered the .blend with that camera.",
    )
    allow_missing: bool | None = Field(
        None,
        description="Render even if files of the .blend or model are missing or cannot be read: "
        "textures, fonts, libraries, volumes or caches. Missing textures are magenta. Also render "
        "textures whose colour space Blender lacks, as they are. A damaged Alembic file stays an "
        "error.",
    )
    shared_folder: SharedFolder | None = Field(
        None,
        description="Folder with files that several models share, such as textures, relative to "
        "the folder in which Snakemake runs. A model may name files there, and in its own folder. "
        "Subfolders count.",
    )
    sha256: str | None = Field(
        None,
        pattern=pattern("^[0-9a-f]{64}$", "64 hexadecimal digits in small letters"),
        description="SHA-256 of the file at the address url, as sha256sum prints it. Without this "
        "key, the first use records the SHA-256 of the .blend in a lock file beside the "
        "scene YAML.",
    )
    url: Address | None = Field(
        None, description="Address from which the .blend file is downloaded if it is missing."
    )
    page: Address | None = Field(
        None, description="Web page from which you can download the .blend file by hand."
    )
    targets: Boards | None = Field(
        None,
        description="Calibration boards that are added to the scene, by their names. A .blend file "
        "itself stays as it is. Each dataset gets corners.json.",
    )


class SceneSource(ModelOptions, Origin):
    """Where a scene comes from. A model has more keys, in the next table."""

    @model_validator(mode="after")
    def _one_of_four(self) -> Self:
        if [self.builder, self.blend, self.model, self.dataset].count(None) != 3:
            raise ValueError("must have one of builder, blend, model and dataset")
        if self.builder is not None:
            for name in _BLEND_KEYS:
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: is only for blend, not for builder")
            if self.frame == FILE:
                raise ValueError("frame: file is only for blend, not for builder")
        elif self.dataset is not None and len(self.model_fields_set) > 1:
            (name, *_) = self.model_fields_set - {"dataset"}
            raise ValueError(f"{name}: does not go with dataset")
        elif self.model is not None:
            for name in (*_BLEND_KEYS, "parameters"):
                if name in self.model_fields_set and name != "allow_missing":
                    raise ValueError(f"{name}: does not go with model")
            if self.frame == FILE:
                raise ValueError("frame: file is only for blend, not for model")
            check_model(self.model, self.up)
        elif self.blend is not None and "parameters" in self.model_fields_set:
            raise ValueError("parameters: is only for builder, not for blend")
        for name in (*MODEL_KEYS, "shared_folder"):
            if self.model is None and name in self.model_fields_set:
                raise ValueError(f"{name}: is only for model")
        return self
