"""The scene YAML and the top-level configuration as typed models, which say what each key may be.

scripts/schema.py makes the JSON schemas in configs/schema/ from these models. With the schemas,
editors complete and check the files. Nothing else in the project reads a scene YAML.
"""

import difflib
import math
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import yaml
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    field_validator,
    model_validator,
)

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.core.settings import (
    AS_WRITTEN,
    Address,
    Name,
    Settings,
    Vector,
    checked,
    pattern,
    suggestion,
)
from lightfield.dataset import light_groups, published
from lightfield.dataset.exports import Export, Exports
from lightfield.dataset.family import Family, stand_in
from lightfield.dataset.names import LIGHTS, MESH, MODELS, SOFTBOXES, UP, VIEWS, builders
from lightfield.dataset.passes import FLOW, GROUP_PREFIX, PASSES, in_order
from lightfield.dataset.publication import PUBLISHED_FOLDER, SPDX, Publication
from lightfield.dataset.reprojections import (
    LIGHT_GROUPS,
    Light,
    ReprojectionOptions,
    ReprojectionSettings,
    Stops,
    face_problem,
)
from lightfield.dataset.sensors import Sensor, SensorSettings
from lightfield.geometry.lenses import LENSES, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import AnyRig, BlendCamera, Poses, Rig
from lightfield.geometry.rigs.rig import Frame
from lightfield.geometry.rigs.split_setting import PARTS, Chosen

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "configs" / "scenes"
# The user's own scene YAMLs, relative to Snakemake's working folder.
OWN_SCENES = Path("configs", "scenes")

FLOW_PLACES = "needs views from two or more places"

# Folders of the project, of a user's inputs, and of programs such as Snakemake.
RESERVED = {
    ".ci",
    ".snakemake",
    ".venv",
    "benchmarks",
    "captions",
    "configs",
    "docs",
    "envs",
    "profiles",
    "rules",
    "scripts",
    "tests",
}
# Names that a scene's folder cannot have, because other folders beside it have them.
SCENE_NEIGHBOURS = {"benchmarks", "logs", "removed", "tables"}
# The same for a rig's folder.
RIG_NEIGHBOURS = {PUBLISHED_FOLDER, "trials"}
# The same for a reprojection's folder.
REPROJECTION_NEIGHBOURS = {
    "exr",
    "exports",
    MESH,
    "panorama",
    "render",
    "report",
    FLOW.name,
    *PASSES,
}
# Names of files, and of a sequence's frames, beside the folders of rigs and reprojections.
OTHER_NEIGHBOURS = re.compile(r"f\d{5,7}|.*\.(blend|html|json|txt)")
# For keys of a camera in lightfield.json: Blender's least and largest value, the unit of messages,
# and the name in messages.
BLENDER_LIMITS = {
    "focal_length": (1.0, 1e6, 1.0, "focal length in mm"),
    "fisheye_fov": (0.1745, 31.4159, math.pi / 180, "fov in degrees"),
    "fisheye_lens": (0.01, 100.0, 1.0, "focal length in mm"),
}
# Planning more frames or views than these would take hours.
MOST_FRAMES = 10_000
MOST_VIEWS = 1_000_000
# Bytes. A scene YAML has some thousand.
LARGEST_YAML = 2**16
# A YAML's nodes, with each alias counted as the nodes that it repeats.
MOST_NODES = 20_000


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _switch(value: Any) -> Any:
    """Return the truth value of `--config key=true`, which Snakemake leaves as text."""
    if value == "true":
        return True
    if value == "false":
        return False
    return value


def _plain_path(folder: str) -> str:
    """Return a path without ``./`` and without a slash at its end: Snakemake compares texts.

    A path such as ``./-x`` keeps them, because programs would take ``-x`` for a flag.
    """
    path = str(Path(folder))
    return path if re.match(r"[\w./]", path) else folder


def _unique(names: list[str]) -> list[str]:
    if not names or len(set(names)) < len(names):
        raise ValueError("must be a list of one or more names, each once")
    return names


def _check_groups(groups: dict[str, list[str]]) -> None:
    """Check that no two light groups have the same emitter or equal names."""
    if not groups:
        raise ValueError("light_groups: must have one group or more")
    emitters: set[str] = set()
    names: set[str] = {light_groups.REST}
    for name, members in groups.items():
        if not re.fullmatch(light_groups.NAME_PATTERN, name):
            raise ValueError(
                f"light_groups: {name!r} is not a name of at most {light_groups.LONGEST_NAME} "
                "letters, digits, _ and -, with a letter or digit first"
            )
        if name.lower() in names:
            raise ValueError(f"light_groups: the name {name} is taken; choose another")
        names.add(name.lower())
        for emitter in members:
            if emitter in emitters:
                raise ValueError(f"light_groups: {emitter} is in two groups; must be in one")
            emitters.add(emitter)


# A single word on the command line is a list of one name.
Names = Annotated[
    list[Name],
    BeforeValidator(_listed),
    AfterValidator(_unique),
]
PassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": list(PASSES)})]], AfterValidator(in_order)
]
# A reprojection may have all passes of light groups, too.
ReprojectedPassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": [*PASSES, LIGHT_GROUPS]})]],
    AfterValidator(lambda names: in_order(names, LIGHT_GROUPS)),
]
Emitters = Annotated[list[str], AfterValidator(_unique)]
Auto = Literal["auto"]
# The rules write this path into commands with {wildcards}.
Folder = Annotated[
    str,
    Field(
        pattern=pattern(
            r"^[\w./][\w./+=@-]*$", "a path of letters, digits and . _ / + = @ - without blanks"
        ),
        max_length=1000,
    ),
    AfterValidator(_plain_path),
]
# The characters of a path that the rules quote in commands.
QUOTED = r"[^{}*?\[\]\x00-\x1f\x7f]{1,1000}"
AtLeastOne = Annotated[int, Field(ge=1, le=2**31 - 1)]


DenoisePrefilter = Literal["accurate", "fast", "none"]


class Preset(Settings):
    """A preset limits the values of scene YAMLs. A key that is left out limits nothing."""

    resolution: AtLeastOne | None = Field(
        None,
        description="Largest length of an image's longer side. Larger images are made smaller.",
        json_schema_extra={"unit": "pixels"},
    )
    samples: AtLeastOne | None = Field(
        None,
        description="Largest number of paths for each pixel.",
        json_schema_extra={"unit": "paths"},
    )
    views: AtLeastOne | None = Field(
        None,
        description="Largest number of views of a rig. Rigs with more are thinned.",
        json_schema_extra={"unit": "views"},
    )
    denoise: bool | None = Field(
        None, description="Whether to denoise the views even if the scene YAML does not."
    )
    denoise_prefilter: DenoisePrefilter | None = Field(
        None, description="Prefilter of the denoiser, unless the scene YAML names one."
    )


class Energy(Settings):
    """The power and price from which report/costs.json computes energy and costs."""

    watts: float = Field(
        65,
        ge=0,
        le=1e6,
        description="Power of the machine when all its cores work.",
        json_schema_extra={"unit": "W"},
    )
    cores: Auto | AtLeastOne = Field(
        "auto",
        description="Number of cores of that machine. auto: as many as the machine that computes "
        "the costs has.",
        json_schema_extra={"unit": "cores"},
    )
    price_per_kwh: float = Field(
        0.32,
        ge=0,
        le=1e6,
        description="Price of electricity, in the currency below.",
        json_schema_extra={"unit": "currency/kWh"},
    )
    currency: str = Field("EUR", max_length=20, description="Currency of that price.")


_SHARDS_ARE_AUTOMATIC = (
    "leave it out, or set views_per_shard to the number of views that one render job makes"
)


class Configuration(Settings):
    """Which scenes to build, at which quality, and into which folders."""

    removed_keys: ClassVar[Mapping[str, str]] = {
        "most_shards": _SHARDS_ARE_AUTOMATIC,
        "shard_minutes": _SHARDS_ARE_AUTOMATIC,
    }

    scenes: Names = Field(
        description="Scenes to build: names of files in configs/scenes/, without .yaml. A single "
        "name needs no list."
    )
    rigs: Literal["all"] | Names = Field(
        "all", description="Rigs to build, by their names in the scene YAMLs. all: every rig."
    )
    preset: str = Field(description="Name of the preset to apply: one of those in presets.")
    presets: dict[
        Annotated[
            str,
            Field(
                pattern=pattern(
                    "^[a-z][a-z0-9]*$", "a name of small letters and digits with a letter first"
                ),
                max_length=30,
            ),
        ],
        Preset,
    ] = Field(
        min_length=1,
        description="Presets by their names. Each sets upper limits for values of the scene YAMLs.",
    )
    results: Folder = Field("results", description="Folder in which the datasets are built.")
    work: Folder = Field(
        "work",
        description="Folder for intermediate files: scenes, lens maps, records and timings.",
    )
    device: Literal["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"] = Field(
        "auto",
        description="Device on which Cycles renders. auto: a GPU if there is one, else the CPU.",
    )
    views_per_shard: Auto | AtLeastOne = Field(
        "auto",
        description="How many views one render job makes. auto: chosen from the expected time of a "
        "view, and on a cluster also from the number of simultaneous jobs (--jobs). A dataset that "
        "was begun with auto keeps its jobs.",
        json_schema_extra={"unit": "views"},
    )
    accept_blend: Annotated[bool, BeforeValidator(_switch)] = Field(
        False,
        description="Accept each .blend file as it is now, even if its SHA-256 has changed. This "
        "rewrites the lock file beside the scene YAML.",
    )
    package_gigabytes: Annotated[float, Field(gt=0)] | None = Field(
        None,
        description="Largest size of a package's parts. Without this key, a package is one file.",
        json_schema_extra={"unit": "GB"},
    )
    energy: Energy = Field(
        Energy(),
        description="Power and price of electricity, from which the energy and costs of a dataset "
        "are computed.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.preset not in self.presets:
            names = ", ".join(self.presets)
            raise ValueError(f"preset: is {self.preset!r}; must be one of {names}")
        for name in self.scenes:
            if "." in name or name in SCENE_NEIGHBOURS:
                used_names = ", ".join(sorted(SCENE_NEIGHBOURS))
                raise ValueError(
                    f"scenes: {name} cannot be the name of a scene; must have no dots, and not be "
                    f"one of {used_names}"
                )
        for key in ("results", "work"):
            _check_folder(key, getattr(self, key))
        results = Path(self.results).resolve()
        work = Path(self.work).resolve()
        if results == work or results in work.parents or work in results.parents:
            raise ValueError(
                f"work: is {self.work!r}, and results is {self.results!r}; "
                "must be two folders, neither in the other"
            )
        return self


def _check_folder(key: str, folder: str) -> None:
    """Refuse a folder of the project, of the user's inputs, or of Git."""
    path = Path(os.path.normpath(Path(folder).absolute()))
    parents = [Path.cwd(), *Path.cwd().parents, ROOT, *ROOT.parents]
    reserved = {home / name for home in (Path.cwd(), ROOT) for name in RESERVED}
    is_inside = not reserved.isdisjoint([path, *path.parents]) or ".git" in path.parts
    if path in parents or path.resolve() in parents or is_inside:
        raise ValueError(f"{key}: is {folder!r}; must be a folder that is used for nothing else")
    if path.exists() and not path.is_dir():
        raise ValueError(f"{key}: is {folder!r}, which is a file; must be a folder")


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
        "and STL. glTF and USD files define it themselves.",
    )
    ground: bool = Field(
        False,
        description="Put a floor under the model, which receives its shadow.",
    )
    light: Annotated[str, Field(json_schema_extra={"enum": list(LIGHTS)})] = Field(
        SOFTBOXES,
        description="Light of a model. softboxes: three lamps and a grey world. Any other name: "
        "the environment of this name that comes with Blender.",
    )

    @field_validator("light")
    @classmethod
    def _exists(cls, light: str) -> str:
        if light not in LIGHTS:
            raise ValueError(f"must be one of {', '.join(LIGHTS)}")
        return light


def check_model(model: str, up: str) -> None:
    """Raise a ValueError if ``up`` is given for a model that says itself which axis points up."""
    if up != "auto" and Path(model).suffix.lower() not in UP:
        raise ValueError(
            "up: is only for OBJ, PLY and STL; glTF and USD files define it themselves"
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


# The word in a scene YAML that stands for the .blend's own value.
FILE = "file"
# Keys of `SceneSource` that only a .blend takes.
BLEND_KEYS = ("scene_name", "view_layers", "allow_missing", "sha256", "url", "page")
# Keys of `SceneSource` that only a model takes.
MODEL_KEYS = tuple(ModelOptions.model_fields)


class Origin(Settings):
    """Where a scene is from: a builder, a .blend, a model file, or views that exist already."""

    builder: str | None = Field(
        None,
        pattern=pattern(
            "^[a-z][a-z0-9_]*$", "a name of small letters, digits and _ with a letter first"
        ),
        description="Name of the builder, which is a folder in scripts/scenes/.",
    )
    parameters: Parameters = Field(Parameters(), description="Parameters of the builder.")
    blend: str | None = Field(
        None,
        pattern=pattern(
            rf"^{QUOTED}\.blend$", "a path that ends in .blend, without { } * ? [ ] and line breaks"
        ),
        description="Path of your own .blend file, relative to the folder in which Snakemake runs.",
    )
    model: ModelPath | None = Field(
        None,
        description="Path of a model file (glTF, USD, OBJ, PLY or STL), relative to the folder in "
        "which Snakemake runs.",
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
    allow_missing: bool | None = Field(
        None,
        description="Render even if files of the .blend or model are missing or cannot be read: "
        "textures, fonts, libraries, volumes or caches. Missing textures are magenta.",
    )
    sha256: str | None = Field(
        None,
        pattern=pattern("^[0-9a-f]{64}$", "64 hexadecimal digits in small letters"),
        description="SHA-256 that the .blend file must have, as sha256sum prints it. Without this "
        "key, it is the one recorded at first use.",
    )
    url: Address | None = Field(
        None, description="Address from which the .blend file is downloaded if it is missing."
    )
    page: Address | None = Field(
        None, description="Web page from which you can download the .blend file by hand."
    )


class SceneSource(ModelOptions, Origin):
    """Where a scene comes from. A model has more keys, in the next table."""

    @model_validator(mode="after")
    def _one_of_four(self) -> Self:
        if [self.builder, self.blend, self.model, self.dataset].count(None) != 3:
            raise ValueError("must have one of builder, blend, model and dataset")
        if self.builder is not None:
            names = builders()
            if self.builder not in names:
                raise ValueError(f"builder: is {self.builder!r}; must be one of {', '.join(names)}")
            for name in BLEND_KEYS:
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: is only for blend, not for builder")
            if self.frame == FILE:
                raise ValueError("frame: file is only for blend, not for builder")
        elif self.dataset is not None and len(self.model_fields_set) > 1:
            (name, *_) = self.model_fields_set - {"dataset"}
            raise ValueError(f"{name}: does not go with dataset")
        elif self.model is not None:
            for name in (*BLEND_KEYS, "parameters"):
                if name in self.model_fields_set and name != "allow_missing":
                    raise ValueError(f"{name}: does not go with model")
            if self.frame == FILE:
                raise ValueError("frame: file is only for blend, not for model")
            check_model(self.model, self.up)
        elif self.blend is not None and "parameters" in self.model_fields_set:
            raise ValueError("parameters: is only for builder, not for blend")
        for name in MODEL_KEYS:
            if self.model is None and name in self.model_fields_set:
                raise ValueError(f"{name}: is only for model")
        return self


# The keys of `Render` that a calibration chooses for a target error.
CHOSEN = ("samples", "adaptive_threshold", "denoise")


class TargetError(Settings):
    """The error that the views must reach, and how it may be reached."""

    value: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] = Field(
        description="Relative mean squared error to reach."
    )
    denoise: Literal["auto", "never"] = Field(
        "auto",
        description="Whether the denoiser may be chosen. auto: if it is cheaper. never: only plain "
        "and adaptive sampling are compared.",
    )


class CameraMotion(Settings):
    """How each camera moves at constant speed while its shutter is open.

    The view's pose is that in the middle of the exposure. Depth and passes are of that moment.
    """

    travel: Vector = Field(
        (0.0, 0.0, 0.0),
        description="How far the camera moves during the exposure: to its right, up and backward.",
        json_schema_extra={"unit": "m"},
    )
    turn: Vector = Field(
        (0.0, 0.0, 0.0),
        description="How far the camera turns during the exposure: a rotation vector whose axes "
        "are its right, up and backward.",
        json_schema_extra={"unit": "degrees"},
    )
    rolling: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] | None = Field(
        None,
        description="Rolling shutter, from the top row to the bottom: the fraction of the exposure "
        "during which one row is exposed. Without this key, all rows are exposed all the time.",
    )

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if not any((*self.travel, *self.turn)):
            raise ValueError("must have travel, turn, or both")
        if max(map(abs, self.turn)) >= 180:
            raise ValueError(f"turn: is {list(self.turn)}; must be below 180 degrees")
        return self


class Render(Settings):
    """The settings of Cycles.

    Without a value here, the .blend decides on max_bounces, clamp_indirect, light_tree, guiding,
    filter_width and motion_blur. All other keys have the defaults of this model.
    """

    samples: AtLeastOne | Literal["file"] | None = Field(
        None,
        description="Number of paths that Cycles traces for each pixel. file: the number in the "
        ".blend.",
        json_schema_extra={"unit": "paths"},
    )
    target_error: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] | TargetError | None = Field(
        None,
        description="Error to reach, instead of samples: samples, adaptive_threshold and denoise "
        "are then chosen on probe views. It is the relative mean squared error, (x - r)^2 / (r^2 + "
        "0.01) with middle grey at 0.18, without the worst thousandth of pixels.",
    )
    max_bounces: int | None = Field(
        None,
        ge=0,
        le=1024,
        description="Largest number of bounces of a path, of all kinds together. Without this key, "
        "as in the .blend.",
        json_schema_extra={"unit": "bounces"},
    )
    clamp_indirect: Annotated[float, Field(ge=0, le=1e9), AS_WRITTEN] | None = Field(
        None,
        description="Largest value of one indirect sample, which removes fireflies but darkens. 0: "
        "no limit. Without this key, as in the .blend.",
        json_schema_extra={"unit": "light"},
    )
    light_tree: bool | None = Field(
        None,
        description="Sample lights by Cycles' light tree, which reduces noise in scenes with many "
        "lights. Without this key, as in the .blend.",
    )
    guiding: bool | None = Field(
        None,
        description="Use Cycles' path guiding, which learns where light comes from. It works only "
        "on CPUs. Without this key, as in the .blend.",
    )
    filter_width: Annotated[float, Field(ge=0.01, le=10), AS_WRITTEN] | None = Field(
        None,
        description="Width of the pixel filter. Without this key, as in the .blend.",
        json_schema_extra={"unit": "pixels"},
    )
    adaptive_threshold: Annotated[float, Field(ge=0, le=1), AS_WRITTEN] = Field(
        0,
        description="Noise level at which adaptive sampling of a pixel stops. 0: every pixel takes "
        "all samples.",
    )
    denoise: bool = Field(False, description="Denoise each view with OpenImageDenoise.")
    denoise_quality: Literal["high", "balanced", "fast"] | None = Field(
        None, description="Quality of the denoiser. The default is high, and the others are faster."
    )
    denoise_prefilter: DenoisePrefilter | None = Field(
        None,
        description="How the albedo and normals that guide the denoiser are denoised first. The "
        "default is accurate.",
    )
    motion_blur: bool | None = Field(
        None, description="Whether moving objects are blurred. Without this key, as in the .blend."
    )
    camera_motion: CameraMotion | None = Field(
        None, description="How each camera moves while its shutter is open, which blurs the views."
    )
    depth_of_field: bool | None = Field(
        None,
        description="Blur what is out of focus, with the focus and aperture of the .blend's own "
        "camera. Without this key, everything is sharp.",
    )
    seed: int = Field(
        0,
        ge=0,
        le=2**63 - 1,
        description="Seed of the noise. Each view's own seed is computed from this and the view's "
        "name.",
    )
    depth: Literal["auto", "z", "distance", "none"] = Field(
        "auto",
        description="What channel Z holds. z: depth along the optical axis. distance: distance "
        "from the camera. none: no depth. auto: z for lenses up to 180 degrees, distance for wider "
        "ones.",
    )
    depth_precision: Literal["float", "rounded", "half"] = Field(
        "float",
        description="Precision of depth. float: 24 significant bits. rounded: a float with 17 "
        "significant bits (a relative error below 1e-5), in smaller files. half: 11 significant "
        "bits.",
    )
    compression: Literal["zip", "zips", "piz", "htj2k", "zstd"] | None = Field(
        None,
        description="Lossless compression of the views' EXR files. The default is zip, which every "
        "program reads. htj2k and zstd give smaller files, for archives and temporary use.",
    )
    transparent: bool | None = Field(
        None,
        description="Make the background transparent: the world behind the scene is left out, and "
        "alpha holds the coverage.",
    )
    passes: PassNames | None = Field(
        None, description="Passes to write beside colour and depth, each into a folder of its own."
    )
    light_groups: Literal["each"] | Emitters | dict[str, Emitters] | None = Field(
        None,
        description="Light sources (lamps, glowing objects, the world) whose light is written as "
        "passes of their own. each: all of them. A list: those with these names. A mapping: groups "
        "of them. All others form the group rest.",
    )

    @model_validator(mode="after")
    def _sum_of_groups(self) -> Self:
        """Check that light groups add up to the colour, which the denoiser would change."""
        if self.light_groups is None:
            return self
        if isinstance(self.light_groups, dict):
            _check_groups(self.light_groups)
        reason = "does not go with light_groups, which must add up to the colour"
        if self.denoise:
            raise ValueError(f"denoise: {reason}; leave it out, and take more samples")
        target = self.target_error
        if target is not None and not (
            isinstance(target, TargetError) and target.denoise == "never"
        ):
            raise ValueError(
                f"target_error: may choose to denoise, which {reason}; write "
                "{value: …, denoise: never}"
            )
        return self

    @model_validator(mode="after")
    def _samples_or_target(self) -> Self:
        if self.target_error is None and self.samples is None:
            raise ValueError("is missing the key samples (or target_error)")
        for name in CHOSEN:
            if self.target_error is not None and name in self.model_fields_set:
                raise ValueError(f"{name}: does not go with target_error, which chooses it")
        if self.camera_motion and "motion" in (self.passes or ()):
            raise ValueError("passes: motion does not go with camera_motion")
        return self


class Reprojection(ReprojectionOptions):
    """Versions of the views through another lens, or as other files."""

    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs whose views are reprojected. Without this key, all rigs.",
    )
    format: Literal["png", "exr"] = Field(
        "png", description="Format of the images. Only EXR has depth."
    )
    exposure: Stops | Annotated[list[Stops], Field(min_length=1, max_length=32)] = Field(
        0,
        description="Exposure of the images. A list makes a folder for each of its values, such as "
        "png_ev-2 and png_ev0.",
        json_schema_extra={"unit": "stops"},
    )
    passes: ReprojectedPassNames | None = Field(
        None,
        description="Passes of render.passes that are also reprojected, as EXR. light_groups: the "
        "passes of all light groups.",
    )
    relight: Name | Light | None = Field(
        None,
        description="Light of the images, if it is not the rendered one: the name of an entry of "
        "relight, or strengths as in such an entry.",
    )
    primaries: Literal["rec709", "acescg"] | None = Field(
        None,
        description="Colour space of EXR images, which the files name in their attribute "
        "chromaticities. Without this key, it is Rec. 709, and the files do not name it.",
    )

    @model_validator(mode="after")
    def _has_use(self) -> Self:
        for name in ("cube_map", "rotation", "filter", "samples"):
            if self.camera is None and name in self.model_fields_set:
                raise ValueError(f"{name}: needs camera; without one, nothing is resampled")
        if self.format == "exr" and self.bits != 8:
            raise ValueError("bits: is only for format png; an EXR has 16-bit floats")
        if self.format == "png" and self.primaries:
            raise ValueError("primaries: is only for format exr; a PNG is sRGB")
        lights = [
            name
            for name in self.passes or ()
            if name == LIGHT_GROUPS or PASSES[name].kind == "light"
        ]
        if self.primaries == "acescg" and lights:
            raise ValueError(f"primaries: does not go with the pass {lights[0]}, which is Rec. 709")
        return self

    @property
    def suffix(self) -> str:
        """The suffix of the images' names."""
        return f".{self.format}"

    @property
    def settings(self) -> ReprojectionSettings:
        """The settings of scripts/reproject.py."""
        # `Scene` has made a reprojection for each exposure.
        assert not isinstance(self.exposure, list)
        options = self.model_dump(include={*ReprojectionOptions.model_fields}, exclude_none=True)
        return ReprojectionSettings.of(
            **options,
            formats=[self.format],
            exposure=self.exposure,
            passes=self.passes or [],
            # `loading` has replaced a name by its strengths.
            relight=self.relight,
            primaries=self.primaries,
        )


# The keys of a reprojection that say how its views are resampled.
OPTICS = ("camera", "cube_map", "rotation", "filter", "samples")


class SensorReprojection(Reprojection):
    """The same views as a sensor sees them. `Scene.developments` makes it from ``sensor``."""

    sensor: SensorSettings

    @property
    def settings(self) -> ReprojectionSettings:
        return super().settings.model_copy(update={"sensor": self.sensor})


class Flow(Settings):
    """Optical flow between pairs of views."""

    pairs: Literal["neighbours"] = Field(
        description="Pairs of views. neighbours: from each view to the view whose camera is "
        "nearest."
    )


class MeshFiles(Settings):
    """Meshes of the surface that cameras can see, and the boxes and poses of its objects."""

    formats: Annotated[list[Literal["glb", "ply"]], AfterValidator(_unique)] = Field(
        ["glb", "ply"],
        description="Formats to write. glb: objects keep their names, and instances share a mesh. "
        "ply: all triangles together, in world coordinates.",
    )
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs whose datasets get the meshes. Without this key, all rigs.",
    )


class Report(Settings):
    """What the page of a dataset shows."""

    panorama: Auto | bool = Field(
        "auto",
        description="Whether the page shows a panorama from the rig's centre. auto: only if the "
        "cameras look outward in all directions. Otherwise, the page shows the view in the rig's "
        "middle.",
    )


def _bracketed(reprojections: dict[str, Reprojection]) -> dict[str, Reprojection]:
    """Replace each reprojection of several exposures by one for each, named by its stops."""
    bracketed: dict[str, Reprojection] = {}
    for name, reprojection in reprojections.items():
        if not isinstance(reprojection.exposure, list):
            bracketed[name] = reprojection
            continue
        for stops in reprojection.exposure:
            key = f"{name}_ev{stops:g}"
            if key in bracketed or key in reprojections:
                raise ValueError(f"{name}.exposure: must not name {key} twice")
            bracketed[key] = reprojection.model_copy(update={"exposure": stops})
    return bracketed


class Credits(Settings):
    """What a package's card says about the scene, and what publishing needs in addition."""

    description: str | None = Field(None, description="Description of the scene, in one line.")
    licence: str | None = Field(
        None,
        description="Licence of the scene, for a package's card. It is also the licence of the "
        "data, unless publish has another.",
    )
    credit: str | None = Field(None, description="How to cite the artist of the scene.")
    publish: Publication | None = Field(
        None,
        description="What a repository of datasets needs to know. With this key, its metadata and "
        "shards are also written. Without it, a package is only an archive.",
    )

    @property
    def data_licence(self) -> str | None:
        """The short name of the data's licence: its own, or else that of the scene."""
        if self.publish and self.publish.licence:
            return self.publish.licence
        is_short_name = self.licence and re.fullmatch(SPDX, self.licence)
        return self.licence if is_short_name else None

    @model_validator(mode="after")
    def _can_be_published(self) -> Self:
        if self.publish is None:
            return self
        missing = self.publish.missing_keys
        if self.data_licence is None:
            missing.append("licence")
        problems = []
        if missing:
            problems.append(f"publish: is missing {', '.join(missing)}")
        if not self.description:
            problems.append("description: is missing, and publish needs it")
        if problems:
            raise ValueError("; ".join(problems))
        return self


class Scene(Credits):
    """One scene: where it comes from, how its rigs render it, and what is made of the views."""

    scene: SceneSource = Field(
        description="Where the scene comes from: a builder, a .blend, a model, or a dataset."
    )
    render: Render | None = Field(
        None,
        description="How Cycles renders the views. Required, but not allowed with scene.dataset.",
    )
    rigs: dict[Name, AnyRig] = Field(
        {},
        min_length=1,
        description="Camera setups, by the names of their folders. Leave it out with "
        "scene.dataset, which has its own cameras.",
    )
    reprojections: Annotated[dict[Name, Reprojection], AfterValidator(_bracketed)] = Field(
        {},
        description="Versions of the views through other lenses or as other files, by the names of "
        "their folders.",
    )
    relight: dict[Name, Light] = Field(
        {},
        description="Versions of the views under other lights, as EXR, by the names of their "
        "folders. A light gives light groups a strength, or one each for red, green and blue. "
        "Other groups keep theirs. each: every group alone, one after the other.",
    )
    sensor: Sensor | None = Field(
        None,
        description="Versions of the views as a real sensor would record them, with noise, "
        "vignetting or exposure brackets.",
    )
    flow: Flow | None = Field(
        None,
        description="Optical flow between views, from depth and poses, for scenes that do not "
        "move.",
    )
    mesh: MeshFiles | None = Field(
        None,
        description="Meshes of the surface that cameras can see, and the bounding boxes of its "
        "objects.",
    )
    exports: Exports = Field(
        Exports(), description="Exports to the formats of trainers and other programs."
    )
    report: Report = Field(Report(), description="What the page of a dataset shows.")
    family: Family | None = Field(
        None, description="Many scenes that differ in seed, model or drawn values."
    )

    @model_validator(mode="before")
    @classmethod
    def _rigs_of_dataset(cls, content: Any) -> Any:
        match content:
            case {"scene": {"dataset": str(dataset)}}:
                for key in ("render", "rigs"):
                    if key in content:
                        raise ValueError(f"{key}: does not go with scene.dataset, which brings it")
                try:
                    return {**content, "rigs": published.rigs(dataset)}
                except UserError as error:
                    raise ValueError(f"scene.dataset: {error}") from None
        return content

    @model_validator(mode="before")
    @classmethod
    def _developed_lights(cls, content: Any) -> Any:
        """Add a reprojection for each entry of relight, which develops the views in that light."""
        match content:
            case {"relight": dict(lights)}:
                reprojections = content.get("reprojections", {})
                if not isinstance(reprojections, dict):
                    return content
                for name in lights:
                    if name in reprojections:
                        raise ValueError(f"relight.{name}: is the name of a reprojection, too")
                relit = {name: {"relight": name, "format": "exr"} for name in lights}
                return {**content, "reprojections": {**reprojections, **relit}}
        return content

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key in ("render", "rigs"):
            if not self.scene.dataset and not getattr(self, key):
                raise ValueError(f"is missing the key {key}")
        for name, rig in self.rigs.items():
            _check_name(f"rigs.{name}", name, RIG_NEIGHBOURS)
            self._check_rig(f"rigs.{name}", name, rig)
        if self.render and self.scene.blend is None:
            if self.render.samples == FILE:
                raise ValueError("render.samples: file is only for scene.blend")
            if self.render.depth_of_field:
                raise ValueError(
                    "render.depth_of_field: is only for scene.blend, whose camera it uses"
                )
        if self.mesh:
            self._check_mesh(self.mesh)
        for name, reprojection in self.reprojections.items():
            block = "relight" if name in self.relight else "reprojections"
            neighbours = REPROJECTION_NEIGHBOURS
            if name.startswith(GROUP_PREFIX) or (block == "relight" and name == light_groups.EACH):
                neighbours = {name}
            _check_name(f"{block}.{name}", name, neighbours)
            self._check_reprojection(f"reprojections.{name}", reprojection)
        if self.sensor:
            self._check_sensor(self.sensor)
        for name, export in self.exports.selected.items():
            self._check_export(f"exports.{name}.sources", export)
        if self.flow and self.render and self.render.depth == "none":
            raise ValueError("flow: follows from depth, but render.depth is none")
        self._check_split_rigs()
        if self.family:
            self._check_family(self.family)
        return self

    def _check_family(self, family: Family) -> None:
        """Check that a job can build the members of a family one after the other."""
        if family.seeds and not self.scene.builder:
            raise ValueError("family.seeds: needs scene.builder")
        if self.render and self.render.target_error is not None:
            raise ValueError("render.target_error: does not go with family; give samples")
        for key in ("flow", "mesh"):
            if getattr(self, key) is not None:
                raise ValueError(f"{key}: does not go with family")
        for name, rig in self.rigs.items():
            if rig.sequence:
                raise ValueError(f"rigs.{name}.frames: does not go with family")

    @property
    def developments(self) -> dict[str, Reprojection]:
        """The reprojections, and those that ``sensor`` adds, by the names of their folders."""
        developments = dict(self.reprojections)
        for source in self.sensor.sources if self.sensor else ():
            developments |= self._sensor_reprojections(source)
        return developments

    def _sensor_reprojections(self, source: str) -> dict[str, Reprojection]:
        """Return the reprojections that ``sensor`` adds for a source, by their folders' names."""
        assert self.sensor
        original = self.reprojections.get(source) or Reprojection()
        optics = original.model_dump(include={*OPTICS}, exclude_unset=True)
        return {
            name: SensorReprojection.of(
                **optics,
                rigs=self.sensor.rigs or original.rigs,
                bits=8 if sensor.bits <= 8 else 16,
                sensor=sensor,
            )
            for name, sensor in self.sensor.folders(source).items()
        }

    def _check_sensor(self, sensor: Sensor) -> None:
        """Check that the sensor's sources and rigs exist, and that it can develop them."""
        allowed_sources = [VIEWS, *self.reprojections]
        for source in sensor.sources:
            if source not in allowed_sources:
                raise ValueError(
                    f"sensor.sources: is {source!r}; must be of {', '.join(allowed_sources)}"
                )
            if sensor.sources.count(source) > 1:
                raise ValueError(f"sensor.sources: must name {source} once")
            original = self.reprojections.get(source)
            if original and original.relight is not None:
                raise ValueError(f"sensor.sources: {source} has relight; name one without")
            if original and original.cube_map and sensor.vignetting:
                raise ValueError(f"sensor.vignetting: does not go with the faces of {source}")
            for rig_name in sensor.rigs or ():
                if original and rig_name not in (original.rigs or self.rigs):
                    raise ValueError(
                        f"sensor.rigs: {rig_name} is not a rig of the reprojection {source}"
                    )
            for name in sensor.folders(source):
                if name in self.reprojections:
                    raise ValueError(f"reprojections.{name}: the name is taken by sensor")
        for rig_name in sensor.rigs or ():
            if rig_name not in self.rigs:
                raise ValueError(
                    f"sensor.rigs: there is no rig {rig_name!r}{suggestion(rig_name, self.rigs)}"
                )
        if self.render and self.render.transparent:
            raise ValueError("sensor: does not go with render.transparent")

    def _check_reprojection(self, key: str, reprojection: Reprojection) -> None:
        """Check that a reprojection's rigs and passes exist."""
        self._check_rig_names(f"{key}.rigs", reprojection.rigs or ())
        if reprojection.relight is not None:
            self._check_light(key, reprojection)
        for pass_name in reprojection.passes or ():
            if pass_name == LIGHT_GROUPS:
                if self.render is None or self.render.light_groups is None:
                    raise ValueError(f"{key}.passes: light_groups needs render.light_groups")
                continue
            if self.render is None or pass_name not in (self.render.passes or ()):
                raise ValueError(f"{key}.passes: {pass_name} is not in render.passes")
            if PASSES[pass_name].kind == "motion":
                raise ValueError(f"{key}.passes: motion is in pixels of the rendered lens")

    def _check_mesh(self, mesh: MeshFiles) -> None:
        if self.scene.dataset:
            raise ValueError("mesh: does not go with scene.dataset, which has no scene to read")
        self._check_rig_names("mesh.rigs", mesh.rigs or ())

    def _check_rig_names(self, key: str, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.rigs:
                hint = suggestion(name, self.rigs)
                raise ValueError(f"{key}: there is no rig {name!r}{hint}")

    def light_of(self, reprojection: Reprojection) -> Any:
        """Return the strengths of a reprojection's light, or `each`. None for the light as is."""
        light = reprojection.relight
        return self.relight[light] if isinstance(light, str) and light in self.relight else light

    def _check_light(self, key: str, reprojection: Reprojection) -> None:
        """Check that the groups of a light exist, as far as the scene YAML names them."""
        light = self.light_of(reprojection)
        at = f"{key}.relight"
        if isinstance(reprojection.relight, str) and reprojection.relight in self.relight:
            at = f"relight.{reprojection.relight}"
        if self.render is None or self.render.light_groups is None:
            raise ValueError(f"{at}: needs render.light_groups, whose strengths it changes")
        if light == light_groups.EACH:
            if reprojection.passes:
                raise ValueError(f"{key}.passes: does not go with the light each")
            return
        if isinstance(light, str):
            hint = suggestion(light, self.relight)
            raise ValueError(f"{at}: there is no relight.{light}{hint}")
        names = light_groups.names_in(self.render.light_groups)
        if names is not None:
            try:
                light_groups.weights(light, [*names, light_groups.REST])
            except ValueError as error:
                raise ValueError(f"{at}: {error}") from None

    def _check_split_rigs(self) -> None:
        """Check rigs of which one trains and others test: trainers see them as one dataset."""
        split_rigs = {name: rig for name, rig in self.rigs.items() if rig.split in PARTS}
        if not split_rigs:
            return
        training = next((name for name, rig in split_rigs.items() if rig.split == "train"), None)
        if training is None:
            name = next(iter(split_rigs))
            raise ValueError(f"rigs.{name}.split: is {split_rigs[name].split}, but no rig trains")
        if not any(rig.split == "test" for rig in split_rigs.values()):
            raise ValueError(f"rigs.{training}.split: is train, but no rig tests")
        for name, rig in split_rigs.items():
            for key in ("camera", "frames"):
                if getattr(rig, key) != getattr(split_rigs[training], key):
                    raise ValueError(f"rigs.{name}.{key}: must be that of {training}, which trains")
        for name, reprojection in self.developments.items():
            missing_rigs = split_rigs.keys() - set(reprojection.rigs or self.rigs)
            if missing_rigs and missing_rigs != split_rigs.keys():
                rigs = ", ".join(sorted(missing_rigs))
                key = f"reprojections.{name}" if name in self.reprojections else "sensor"
                raise ValueError(
                    f"{key}.rigs: lacks {rigs}; must have all rigs "
                    "of which one trains and others test, or none"
                )

    def _check_export(self, key: str, export: Export) -> None:
        """Check that an export's sources exist, and that its consumer can take them."""
        developments = self.developments
        allowed_sources = [VIEWS, *developments]
        for source in export.sources:
            if source not in allowed_sources:
                raise ValueError(f"{key}: is {source!r}; must be of {', '.join(allowed_sources)}")
            has_depth = self.render is None or self.render.depth != "none"
            reprojection = None if source == VIEWS else developments[source]
            if reprojection and self.light_of(reprojection) == light_groups.EACH:
                raise ValueError(
                    f"{key}: {source} has each view once for each light, and an export once"
                )
            if reprojection:
                has_depth &= reprojection.format == "exr"
            self._check_passes_of(key, source, export)
            motion = self.render and self.render.camera_motion
            is_resampled = reprojection is not None and reprojection.camera is not None
            if export.has_row_times and is_resampled and motion and motion.rolling not in (None, 1):
                raise ValueError(
                    f"{key}: {source} mixes the rows of a rolling shutter, whose times the export "
                    f"has; export {VIEWS}"
                )
            for name in (reprojection and reprojection.rigs) or self.rigs:
                rig = self.rigs[name]
                camera = (reprojection and reprojection.camera) or rig.camera
                if refusal := export.refusal(camera.make(), has_depth):
                    raise ValueError(f"{key}: {source} {refusal}")
                if rig.is_omnidirectional:
                    raise ValueError(
                        f"{key}: {source} is of the rig {name}, whose views have no centre"
                    )
                if refusal := export.rig_refusal(rig):
                    raise ValueError(f"{key}: {source} is of the rig {name}, which {refusal}")

    def _check_passes_of(self, key: str, source: str, export: Export) -> None:
        """Check that the views of a source have the passes that an export needs."""
        passes = self.render and self.render.passes
        place = "render.passes"
        if source != VIEWS:
            passes = self.reprojections[source].passes
            place = f"reprojections.{source}.passes"
        for pass_name in export.needed_passes if self.render else ():
            if pass_name not in (passes or ()):
                raise ValueError(f"{key}: {source} lacks the pass {pass_name}; add it to {place}")

    def _check_rig(self, key: str, name: str, rig: Rig) -> None:
        """Check a rig with its camera, its file and the depth."""
        camera = rig.camera
        if camera is None:
            raise ValueError(f"{key}: is missing the key camera")
        if isinstance(rig, Poses) and not Path(rig.file).is_file():
            raise ValueError(f"{key}.file: is {rig.file!r}; there is no such file")
        if self.scene.blend is None and isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.type: blend_camera needs scene.blend")
        if camera.lens == FILE and not isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.camera.lens: file is only for a rig of type blend_camera")
        frames = len(rig.sequence.numbers) if rig.sequence else 1
        if frames > MOST_FRAMES or frames * rig.view_count > MOST_VIEWS:
            raise ValueError(
                f"{key}: has {frames} frames of {rig.view_count} views; must be at most "
                f"{MOST_FRAMES} frames and {MOST_VIEWS} views in all"
            )
        for view in _unknown_names(rig):
            raise ValueError(f"{key}.split: there is no view {view!r}")
        lens = camera.make()
        if self.render and not lens.in_cycles:
            lenses = ", ".join(name for name, lens in LENSES.items() if lens.in_cycles)
            raise ValueError(
                f"{key}.camera.lens: is {camera.lens!r}, which Cycles does not have; "
                f"must be one of {lenses} (reproject for the others)"
            )
        if self.render:
            _check_blender_limits(f"{key}.camera", lens)
        if self.render and isinstance(lens, Rectilinear) and not lens.has_square_pixels:
            raise ValueError(
                f"{key}.camera.sensor_size: is {list(lens.sensor)}, but the pixels of Cycles' "
                f"perspective views are square; must be its width alone, {lens.sensor[0]:g}"
            )
        if self.render and self.render.depth == "z" and not lens.has_z_depth:
            raise ValueError(
                f"render.depth: is 'z', but {key}.camera sees beyond 180 degrees; "
                "must be auto, distance or none"
            )
        _check_cube_map(key, rig)
        if rig.cube_map and self.render and self.render.camera_motion:
            raise ValueError(
                f"render.camera_motion: does not go with {key}.cube_map, whose faces would each "
                "move along axes of their own; render panoramas, and reproject with cube_map"
            )
        if rig.is_omnidirectional:
            self._check_without_centre(key, name)
        if self.flow and rig.is_at_one_place():
            raise ValueError(f"flow: {FLOW_PLACES}, but all views of {key} are from one")

    def _check_without_centre(self, key: str, name: str) -> None:
        """Check that nothing needs a centre of a rig's views, which have none."""
        if self.rigs[name].camera.lens != "equirectangular":
            raise ValueError(f"{key}.stereo.omnidirectional: needs the lens equirectangular")
        refusal = f"does not go with {key}.stereo.omnidirectional, whose views have no centre"
        if self.render and self.render.camera_motion:
            raise ValueError(f"render.camera_motion: {refusal}")
        if self.flow:
            raise ValueError(f"flow: {refusal}")
        if self.render and "motion" in (self.render.passes or ()):
            raise ValueError(f"render.passes: motion {refusal}")
        for reprojection_name, reprojection in self.reprojections.items():
            if reprojection.camera and name in (reprojection.rigs or self.rigs):
                raise ValueError(f"reprojections.{reprojection_name}: {refusal}")


def _check_blender_limits(key: str, lens: Lens) -> None:
    """Refuse a value outside Blender's limits, which Blender would clamp."""
    camera = lens.to_lightfield()["camera"]
    for name, (least, most, unit, title) in BLENDER_LIMITS.items():
        value = camera.get(name, least)
        if not least <= value <= most:
            bound = f"at least {least / unit:.4g}" if value < least else f"at most {most / unit:g}"
            raise ValueError(f"{key}: its {title} is {value / unit:.4g}; Blender has {bound}")
    if max(lens.sensor) < 1:
        raise ValueError(f"{key}.sensor_size: is {lens.sensor[0]:g}; Blender has at least 1 mm")


def _check_cube_map(key: str, rig: Rig) -> None:
    """Check that the camera of a rig with cube maps can be a face's camera."""
    if rig.cube_map and (problem := face_problem(rig.camera)):
        raise ValueError(f"{key}.camera{problem}")


def _check_name(key: str, name: str, neighbours: set[str]) -> None:
    if name in neighbours or OTHER_NEIGHBOURS.fullmatch(name):
        raise ValueError(f"{key}: the name {name} is taken; choose another")


def _unknown_names(rig: Rig) -> list[str]:
    """Return the names in a rig's split that no view has."""
    if not isinstance(rig.split, Chosen) or not rig.split.names:
        return []
    # The .blend names the views of its camera. It has not been read yet.
    if isinstance(rig, BlendCamera):
        return []
    return sorted({*rig.split.names} - {pose.name for pose in rig.poses()})


_CONFIGURATION = TypeAdapter(Configuration)
_SCENE = TypeAdapter(Scene)


def load_config(content: Any) -> Configuration:
    """Return the top-level configuration. Raises `UserError`."""
    return checked(_CONFIGURATION, content, "config.yaml")


def read_config(path: Path) -> dict[str, Any]:
    """Read a config.yaml. Raises `UserError` if it is not a mapping. Does not check its keys."""
    content = read_yaml(path, path.name)
    if not isinstance(content, dict):
        raise UserError(f"{path}: must be a mapping of keys to values")
    return content


def load_scene(scene: str) -> Scene:
    """Read and check one scene YAML. Raises `UserError` with file, key, value and what is right."""
    path = scene_path(scene)
    if not path.is_file():
        files = {*SCENES.glob("*.yaml"), *OWN_SCENES.glob("*.yaml")}
        scenes = sorted({file.stem for file in files})
        similar = " or ".join(difflib.get_close_matches(scene, scenes))
        hint = f"is {similar} meant?" if similar else f"there are {', '.join(scenes)}"
        raise UserError(f"config.yaml: scenes: there is no scene {scene!r}; {hint}")
    return read_scene(path)


def scene_path(scene: str) -> Path:
    """Return the path of a scene's YAML: the user's own, or else the repository's."""
    own_file = OWN_SCENES / f"{scene}.yaml"
    is_in_repository = OWN_SCENES.resolve() == ROOT / OWN_SCENES
    if own_file.is_file() and not is_in_repository:
        return own_file
    return SCENES / f"{scene}.yaml"


def family_of(scene: str) -> Family | None:
    """Return the block `family` of a scene YAML, if it has one. Raises `UserError`."""
    return load_scene(scene).family


def scene_content(scene: str) -> Any:
    """Return the content of a scene YAML as it is written. Raises `UserError`."""
    return read_yaml(scene_path(scene), f"{OWN_SCENES}/{scene}.yaml")


def check_member(content: Any, name: str) -> Scene:
    """Return the content of a member's scene YAML as settings. Errors begin with ``name``."""
    return checked(_SCENE, content, name)


def read_scene(path: Path) -> Scene:
    """Read and check the scene YAML at ``path``, as `load_scene` does by name."""
    file = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
    return _checked_scene(_read_settings_text(path, file), file, Path.cwd())


# The rules ask for the same scenes many times.
@lru_cache(maxsize=100)
def _checked_scene(text: str, file: str, _folder: Path) -> Scene:
    """Return a scene YAML's text as settings. Its relative paths start from ``_folder``."""
    content = _parse_yaml(text, file)
    if isinstance(content, dict) and "family" in content:
        # The check below reports a block `family` that is wrong itself.
        with suppress(ValidationError, TypeError):
            content = stand_in(content)
    return checked(_SCENE, content, file)


def blend_sha256(scene: str, source: SceneSource) -> tuple[str | None, Path]:
    """Return the SHA-256 that a scene's .blend must have, or None if none is recorded yet.

    The second value is the file that records it: the scene YAML or its lock file.
    """
    if source.sha256:
        return source.sha256, scene_path(scene)
    lock = scene_path(scene).with_suffix(".lock.json")
    try:
        return (str(read_json(lock)["sha256"]) if lock.exists() else None), lock
    except (LookupError, TypeError):
        raise UserError(f"{lock}: sha256: is missing; remove the file to record it again") from None


def expected_blend(scene: str, blend: Path, digest: str) -> Path | None:
    """Check that a .blend has the recorded SHA-256. Raises `UserError` if not.

    Returns None. If none is recorded yet, returns the lock file that should record it.
    """
    expected, origin = blend_sha256(scene, load_scene(scene).scene)
    if expected in (None, digest):
        return origin if expected is None else None
    remedy = (
        "write the new one there"
        if origin.suffix == ".yaml"
        else "snakemake with --config accept_blend=true takes it as it is now"
    )
    raise UserError(
        f"{blend}: its sha256 is {digest}, but {origin} says {expected}; if it was edited on "
        f"purpose, {remedy}"
    )


def accept_blend(scene: str) -> None:
    """Record the present SHA-256 of a scene's .blend.

    Raises `UserError` if the scene YAML itself has another SHA-256.
    """
    source = load_scene(scene).scene
    if source.blend is None or not Path(source.blend).is_file():
        return
    digest = sha256(Path(source.blend))
    expected, origin = blend_sha256(scene, source)
    if source.sha256 and digest != expected:
        raise UserError(
            f"{origin}: scene.sha256: is {expected}, but {source.blend} has {digest}; accept_blend "
            "writes no scene YAML: write it there"
        )
    if digest != expected:
        record_blend(Path(source.blend), digest, origin)


def record_blend(blend: Path, digest: str, lock: Path) -> None:
    """Record the SHA-256 that a .blend must have."""
    write_json(lock, {"blend": blend.name, "sha256": digest})
    print(f"note: {blend}: its sha256 {digest} is now recorded in {lock}")


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe YAML in which a key given twice is an error, not a silent overwrite."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._merged_nodes: set[yaml.MappingNode] = set()

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Replace `<<: *other` by the keys of the other mapping. Keys beside it take precedence.

        Afterwards the node has the replaced keys twice. So this checks each node only before that.
        """
        if node not in self._merged_nodes:
            self._merged_nodes.add(node)
            self._check_keys(node)
            super().flatten_mapping(node)

    def _check_keys(self, node: yaml.MappingNode) -> None:
        keys: set[Any] = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                problem = f"the key {key!r} is not a text; put it in quotes"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            if key in keys:
                problem = f"the key {key!r} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            keys.add(key)


# YAML 1.1 reads 12:30 as 750, 0123 as 83 and 0b11 as 3. Here they stay texts, so that messages show
# them as written. YAML 1.1 reads 1e-3 as a text. Here it is a number.
_UniqueKeyLoader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in resolvers if not tag.endswith((":int", ":float"))]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:int",
    re.compile(r"[-+]?(?:0|[1-9][0-9_]*|0x[0-9a-fA-F_]+)$"),
    list("-+0123456789"),
)
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+][0-9]+)?$"
        r"|[-+]?[0-9]+[eE][-+]?[0-9]+$"
        r"|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"
    ),
    list("-+0123456789."),
)


def as_written(content: dict[str, Any], written: Mapping[str, Any]) -> None:
    """Replace Snakemake's reading of a file, ``content``, by this module's reading, ``written``."""
    for key, value in written.items():
        if isinstance(value, Mapping) and isinstance(content.get(key), dict):
            as_written(content[key], value)
        else:
            content[key] = value


def read_yaml(path: Path, file: str) -> Any:
    """Read a YAML file. Errors call it ``file``.

    Raises `UserError` if it is not YAML, or too large. Repeated aliases count, too.
    """
    return _parse_yaml(_read_settings_text(path, file), file)


def _read_settings_text(path: Path, file: str) -> str:
    """Return a YAML file's text. Raises `UserError` if it is not text, or too large."""
    try:
        with path.open("rb") as stream:
            content = stream.read(LARGEST_YAML + 1)
        if len(content) <= LARGEST_YAML:
            return content.decode()
    except (OSError, ValueError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None
    raise UserError(
        f"{file}: is larger than {LARGEST_YAML // 1000} kB, so it is not a settings file"
    )


def _parse_yaml(text: str, file: str) -> Any:
    """Return what a YAML file's text says. Raises `UserError` as `read_yaml` does."""
    try:
        loader = _UniqueKeyLoader(text)
        node = loader.get_single_node()
        if _size(node, {}) > MOST_NODES:
            raise UserError(
                f"{file}: its aliases (*name) repeat too much, so it is not a settings file"
            )
        return loader.construct_document(node) if node else None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = error.problem
        if mark and _is_indented_by_tabs(text, mark.line):
            problem = "is indented with a tab; use spaces"
        raise UserError(f"{file}: {where}{problem}") from None
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None


def _is_indented_by_tabs(text: str, line: int) -> bool:
    """Return whether a line's indentation has a tab. Lines count from 0."""
    line_text = dict(enumerate(text.splitlines())).get(line, "")
    return "\t" in line_text[: len(line_text) - len(line_text.lstrip())]


def _size(node: yaml.Node | None, sizes: dict[int, float]) -> float:
    """Return the number of nodes below a node. Each alias counts as the nodes that it repeats.

    The size of a node that contains itself is infinite.
    """
    if node is None or isinstance(node.value, str):
        return 1
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        is_mapping = isinstance(node, yaml.MappingNode)
        children = chain.from_iterable(node.value) if is_mapping else node.value
        sizes[id(node)] = 1 + sum(_size(child, sizes) for child in children)
    return sizes[id(node)]
