"""The scene YAML and the top-level configuration, as typed models: what each key may be.

From these models scripts/schema.py makes the JSON schemas in configs/schema/, by which editors
complete and check the files. Nothing else in the project reads a scene YAML.
"""

import difflib
import math
import os
import re
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import yaml
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    TypeAdapter,
    model_validator,
)

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.core.settings import (
    AS_WRITTEN,
    Name,
    Settings,
    checked,
    pattern,
    suggestion,
)
from lightfield.dataset import published
from lightfield.dataset.exports import VIEWS, Export, Exports
from lightfield.dataset.passes import FLOW, PASSES, in_order
from lightfield.dataset.reprojections import (
    ReprojectionOptions,
    ReprojectionSettings,
    Stops,
    face_problem,
)
from lightfield.geometry.lenses import LENSES, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import AnyRig, BlendCamera, Poses, Rig
from lightfield.geometry.rigs.rig import Frame
from lightfield.geometry.rigs.split_setting import PARTS, Chosen

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "configs" / "scenes"
# A user's own, in the folder that Snakemake works in.
OWN_SCENES = Path("configs", "scenes")
BUILDERS = ROOT / "scripts" / "scenes"

FLOW_PLACES = "needs views from two or more places"

# Folders of the project, of a user's inputs, and of the programs that both are used with.
RESERVED = {
    *(".ci", ".snakemake", ".venv", "benchmarks", "captions", "configs", "docs", "envs"),
    *("profiles", "rules", "scripts", "tests"),
}
# What already has these names beside a scene's folder, a rig's, and a reprojection's.
SCENE_NEIGHBOURS = {"benchmarks", "logs", "removed", "tables"}
RIG_NEIGHBOURS = {"trials"}
REPROJECTION_NEIGHBOURS = {"exr", "exports", "panorama", "render", "report", FLOW.name, *PASSES}
# Files lie there, too, and folders of a sequence's frames.
OTHER_NEIGHBOURS = re.compile(r"f\d{5,7}|.*\.(blend|html|json|txt)")
# Of a camera in lightfield.json: Blender's least and most, the unit in words, and what it is.
BLENDER_LIMITS = {
    "focal_length": (1.0, 1e6, 1.0, "focal length in mm"),
    "fisheye_fov": (0.1745, 31.4159, math.pi / 180, "fov in degrees"),
    "fisheye_lens": (0.01, 100.0, 1.0, "focal length in mm"),
}
# More of them have no use, and planning them would take hours.
MOST_FRAMES = 10_000
MOST_VIEWS = 1_000_000
# A scene YAML has some thousand bytes; its aliases may repeat what it says, within these nodes.
LARGEST_YAML = 2**16
MOST_NODES = 20_000


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _switch(value: Any) -> Any:
    """Read what Snakemake leaves a text of `--config key=true`."""
    return {"true": True, "false": False}.get(value, value) if isinstance(value, str) else value


def _unique(names: list[str]) -> list[str]:
    if not names or len(set(names)) < len(names):
        raise ValueError("must be a list of one or more names, each once")
    return names


# A bare word on the command line is a list of one.
Names = Annotated[
    list[Name],
    BeforeValidator(_listed),
    AfterValidator(_unique),
]
PassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": list(PASSES)})]], AfterValidator(in_order)
]
Auto = Literal["auto"]
Address = Annotated[
    str, Field(pattern=pattern(r"^https?://", "an address that begins with http:// or https://"))
]
# A path that the rules write into commands, with {wildcards} beside it.
Folder = Annotated[
    str,
    Field(
        pattern=pattern(
            r"^[\w./][\w./+=@-]*$", "a path of letters, digits and . _ / + = @ - without blanks"
        ),
        max_length=1000,
    ),
]
# Of a path that is quoted there.
QUOTED = r"[^{}*?\[\]\x00-\x1f\x7f]{1,1000}"
AtLeastOne = Annotated[int, Field(ge=1, le=2**31 - 1)]


class Preset(Settings):
    """Upper limits put on what a scene YAML says; one that is not given limits nothing."""

    resolution: AtLeastOne | None = Field(None, description="Pixels along an image's longer side.")
    samples: AtLeastOne | None = Field(None, description="Paths a pixel.")
    views: AtLeastOne | None = Field(None, description="Views of a rig.")
    denoise: bool | None = Field(None, description="Denoise even where the scene does not.")


class Energy(Settings):
    """From which report/costs.json has energy and price."""

    watts: float = Field(65, ge=0, le=1e6, description="Of a machine, while all its cores work.")
    cores: Auto | AtLeastOne = Field(
        "auto",
        description="How many that machine has; auto is those of the machine that adds up.",
    )
    price_per_kwh: float = Field(0.32, ge=0, le=1e6)
    currency: str = Field("EUR", max_length=20)


_SHARDS_ARE_AUTOMATIC = (
    "leave it out, or set views_per_shard to the number of views that one render job makes"
)


class Configuration(Settings):
    """Which scenes to build, how well, and where."""

    removed_keys: ClassVar[Mapping[str, str]] = {
        "most_shards": _SHARDS_ARE_AUTOMATIC,
        "shard_minutes": _SHARDS_ARE_AUTOMATIC,
    }

    scenes: Names = Field(description="Names of files in configs/scenes/, without .yaml.")
    rigs: Literal["all"] | Names = Field(
        "all", description="all, or the names of the rigs to build."
    )
    preset: str = Field(description="One of the presets below.")
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
    ] = Field(min_length=1)
    results: Folder = Field("results", description="Folder of the datasets.")
    work: Folder = Field(
        "work",
        description="Folder of what is made on the way: scenes, lens maps, records, timings.",
    )
    device: Literal["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"] = Field(
        "auto", description="What Cycles renders on."
    )
    views_per_shard: Auto | AtLeastOne = Field(
        "auto",
        description="How many views one render job makes. With auto, the number follows from the "
        "expected time of a view, and on a cluster from the jobs that run at once (--jobs). A "
        "dataset that was begun with auto keeps its jobs.",
    )
    accept_blend: Annotated[bool, BeforeValidator(_switch)] = Field(
        False,
        description="Take each .blend as it is now: its lock file beside the scene YAML is written "
        "anew.",
    )
    package_gigabytes: Annotated[float, Field(gt=0)] | None = Field(
        None, description="Size of a package's parts, at most; without it, a package is one file."
    )
    energy: Energy = Energy()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.preset not in self.presets:
            known = ", ".join(self.presets)
            raise ValueError(f"preset: is {self.preset!r}; must be one of {known}")
        for name in self.scenes:
            if "." in name or name in SCENE_NEIGHBOURS:
                taken = ", ".join(sorted(SCENE_NEIGHBOURS))
                raise ValueError(f"scenes: {name} is no name for a scene; no dots, and not {taken}")
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
    """Refuse what is not a folder of its own: the project's, the user's inputs, and Git's."""
    path = Path(os.path.normpath(Path(folder).absolute()))
    above = [Path.cwd(), *Path.cwd().parents, ROOT, *ROOT.parents]
    reserved = {home / name for home in (Path.cwd(), ROOT) for name in RESERVED}
    inside = not reserved.isdisjoint([path, *path.parents]) or ".git" in path.parts
    if path in above or path.resolve() in above or inside:
        raise ValueError(f"{key}: is {folder!r}; must be a folder of its own")
    if path.exists() and not path.is_dir():
        raise ValueError(f"{key}: is {folder!r}, which is a file; must be a folder")


class Parameters(Settings):
    """What a builder is given."""

    seed: int = Field(0, ge=0, le=2**63 - 1)
    detail: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] = Field(1.0, description="1 is full.")


# What a value of the .blend's own is called, wherever the scene YAML may ask for it.
FILE = "file"
# Keys of `SceneSource` that a builder does not take.
OF_A_BLEND = ("scene_name", "view_layers", "allow_missing", "sha256", "url", "page")


class SceneSource(Settings):
    """Where the scene comes from: a builder, a .blend file, or views that are there already."""

    builder: str | None = Field(
        None,
        pattern=pattern(
            "^[a-z][a-z0-9_]*$", "a name of small letters, digits and _ with a letter first"
        ),
        description="The builder's file in scripts/scenes/, without .py.",
    )
    parameters: Parameters = Parameters()
    blend: str | None = Field(
        None,
        pattern=pattern(
            rf"^{QUOTED}\.blend$", "a path that ends in .blend, without { } * ? [ ] and line breaks"
        ),
        description="The user's own .blend file, relative to the scene YAML's repository.",
    )
    dataset: str | None = Field(
        None,
        description="Instead of a scene to render: the folder of a light field in SILVR's layout "
        "(lightfield.json and exr/), or one with several such folders.",
    )
    scene_name: str | None = Field(
        None, description="Of the .blend's scenes; without it, the one that was open when saved."
    )
    view_layers: Literal["all"] | list[str] | None = Field(
        None,
        min_length=1,
        description="Of that scene's view layers, shown together in one picture; all are those in "
        "use; without it, the first of them.",
    )
    frame: Frame | Literal["file"] = Field(
        1,
        description="Of the animation, the frame that is rendered; file is the one at which the "
        ".blend was saved.",
    )
    allow_missing: bool | None = Field(
        None,
        description="Render although textures, fonts, libraries, volumes or caches are missing or "
        "cannot be read; such a texture is magenta.",
    )
    sha256: str | None = Field(
        None,
        pattern=pattern("^[0-9a-f]{64}$", "64 hexadecimal digits in small letters"),
        description="The .blend file's SHA-256, as sha256sum prints it; "
        "without it, the one recorded at first use.",
    )
    url: Address | None = Field(
        None, description="Where the .blend file is downloaded from if it is not there."
    )
    page: Address | None = Field(
        None, description="The page on which a person finds the .blend file."
    )

    @model_validator(mode="after")
    def _one_of_three(self) -> Self:
        if [self.builder, self.blend, self.dataset].count(None) != 2:
            raise ValueError("must have one of builder, blend and dataset")
        if self.builder is not None:
            known = builders()
            if self.builder not in known:
                raise ValueError(f"builder: is {self.builder!r}; must be one of {', '.join(known)}")
            for name in OF_A_BLEND:
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: goes with blend, not with builder")
            if self.frame == FILE:
                raise ValueError("frame: file goes with blend, not with builder")
        elif self.dataset is not None and len(self.model_fields_set) > 1:
            (name, *_) = self.model_fields_set - {"dataset"}
            raise ValueError(f"{name}: goes without dataset")
        elif self.blend is not None and "parameters" in self.model_fields_set:
            raise ValueError("parameters: goes with builder, not with blend")
        return self


# What a calibration chooses for a target error.
CHOSEN = ("samples", "adaptive_threshold", "denoise")


class TargetError(Settings):
    """A target error, and what may be chosen to reach it."""

    value: Annotated[float, Field(gt=0, le=1), AS_WRITTEN]
    denoise: Literal["auto", "never"] = Field(
        "auto", description="never chooses among plain and adaptive sampling alone."
    )


class Render(Settings):
    """What Cycles is asked for.

    Of what is not given here, max_bounces, clamp_indirect, light_tree, guiding, filter_width and
    motion_blur stay as the .blend has them; everything else has the default that stands here.
    """

    samples: AtLeastOne | Literal["file"] | None = Field(
        None, description="Paths a pixel; file is as many as the .blend has."
    )
    target_error: Annotated[float, Field(gt=0, le=1), AS_WRITTEN] | TargetError | None = Field(
        None,
        description="Instead of samples: relative mean squared error, (x - r)^2 / (r^2 + 0.01) "
        "with middle grey at 0.18, of all but the worst thousandth of pixels, for which samples, "
        "adaptive_threshold and denoise are chosen on probe views.",
    )
    max_bounces: int | None = Field(
        None, ge=0, le=1024, description="Bounces of a path, of any kind."
    )
    clamp_indirect: Annotated[float, Field(ge=0, le=1e9), AS_WRITTEN] | None = Field(
        None, description="Largest value of one indirect sample; 0 does not clamp."
    )
    light_tree: bool | None = Field(
        None, description="Choose lights for a place by a tree of all of them, or any alike."
    )
    guiding: bool | None = Field(
        None, description="Learn where light comes from while rendering; on processors alone."
    )
    filter_width: Annotated[float, Field(ge=0.01, le=10), AS_WRITTEN] | None = Field(
        None, description="Width of the pixel filter, in pixels."
    )
    adaptive_threshold: Annotated[float, Field(ge=0, le=1), AS_WRITTEN] = Field(
        0, description="Noise at which adaptive sampling stops early; 0 takes every sample."
    )
    denoise: bool = Field(False, description="Denoise each view with OpenImageDenoise.")
    denoise_quality: Literal["high", "balanced", "fast"] | None = Field(
        None, description="Of a denoiser's network; high unless given."
    )
    denoise_prefilter: Literal["accurate", "fast", "none"] | None = Field(
        None, description="Of the albedo and normals that guide a denoiser; accurate unless given."
    )
    motion_blur: bool | None = Field(
        None, description="Blur what moves; without it, as the .blend has it."
    )
    depth_of_field: bool | None = Field(
        None,
        description="Blur what is out of the focus of the .blend's own camera, with its aperture; "
        "without it, everything is sharp.",
    )
    seed: int = Field(
        0, ge=0, le=2**63 - 1, description="From this and its name each view has its own seed."
    )
    depth: Literal["auto", "z", "distance", "none"] = Field(
        "auto",
        description="Meaning of channel Z: auto is z up to 180 degrees and distance beyond.",
    )
    depth_precision: Literal["float", "rounded", "half"] = Field(
        "float",
        description="Binary digits that are kept: float has 24, half 11; rounded is a float of "
        "which 17 are kept, within 1e-5, in smaller files.",
    )
    compression: Literal["zip", "zips", "piz", "htj2k", "zstd"] | None = Field(
        None,
        description="Of the views' EXR files, lossless: zip, which every program reads, unless "
        "given. htj2k and zstd are smaller, for archives and scratch.",
    )
    transparent: bool | None = Field(
        None, description="Leave out the world behind the scene, and write how much is covered (A)."
    )
    passes: PassNames | None = Field(
        None, description="What else of a view is written, each into a folder of its own."
    )

    @model_validator(mode="after")
    def _samples_or_target(self) -> Self:
        if self.target_error is None and self.samples is None:
            raise ValueError("is missing the key samples (or target_error)")
        for name in CHOSEN:
            if self.target_error is not None and name in self.model_fields_set:
                raise ValueError(f"{name}: goes without target_error, for which it is chosen")
        return self


class Reprojection(ReprojectionOptions):
    """The same views through another lens, or as other files."""

    rigs: list[str] | None = Field(
        None, min_length=1, description="The rigs it is made for; without it, every one of them."
    )
    format: Literal["png", "exr"] = Field("png", description="EXR has depth.")
    exposure: Stops | Annotated[list[Stops], Field(min_length=1, max_length=32)] = Field(
        0, description="In stops; of a list each makes a folder, as in png_ev-2 and png_ev0."
    )
    passes: PassNames | None = Field(
        None, description="Those of render.passes that are reprojected, too, as EXR."
    )

    @model_validator(mode="after")
    def _has_use(self) -> Self:
        for name in ("cube_map", "rotation", "filter", "samples"):
            if self.camera is None and name in self.model_fields_set:
                raise ValueError(f"{name}: goes with camera; without one nothing is resampled")
        if self.format == "exr" and self.bits != 8:
            raise ValueError("bits: goes with format png; an EXR has halves")
        return self

    @property
    def suffix(self) -> str:
        """Of the images' names."""
        return f".{self.format}"

    @property
    def settings(self) -> ReprojectionSettings:
        """What scripts/reproject.py is to do."""
        # `Scene` has made a reprojection of each exposure.
        assert not isinstance(self.exposure, list)
        options = self.model_dump(include={*ReprojectionOptions.model_fields}, exclude_none=True)
        return ReprojectionSettings(
            **options,
            formats=[self.format],
            exposure=self.exposure,
            passes=self.passes or [],
        )


class Flow(Settings):
    """Where another view sees what a view sees."""

    pairs: Literal["neighbours"] = Field(
        description="From each view to the one whose camera is nearest."
    )


class Report(Settings):
    """What a dataset's page shows."""

    panorama: Auto | bool = Field(
        "auto",
        description="A panorama from the rig's centre; auto makes one where the cameras look "
        "outward, all round. Without it the view in the rig's middle is in its place.",
    )


def _bracketed(reprojections: dict[str, Reprojection]) -> dict[str, Reprojection]:
    """Return each reprojection of several exposures as so many, named by their stops."""
    found: dict[str, Reprojection] = {}
    for name, reprojection in reprojections.items():
        if not isinstance(reprojection.exposure, list):
            found[name] = reprojection
            continue
        for stops in reprojection.exposure:
            key = f"{name}_ev{stops:g}"
            if key in found or key in reprojections:
                raise ValueError(f"{name}.exposure: must not name {key} twice")
            found[key] = reprojection.model_copy(update={"exposure": stops})
    return found


class Credits(Settings):
    """What a package's card says of the scene."""

    description: str | None = Field(None, description="One line about the scene.")
    licence: str | None = Field(None, description="Of the scene, for a package's card.")
    credit: str | None = Field(None, description="How the scene's artist is to be cited.")


class Scene(Credits):
    """One scene: where it is from, how it is rendered, by which rigs, and what the views become."""

    scene: SceneSource
    render: Render | None = Field(None, description="How; scene.dataset alone has none.")
    rigs: dict[Name, AnyRig] = Field(
        {},
        min_length=1,
        description="The camera setups, by the names of their folders; scene.dataset has its own.",
    )
    reprojections: Annotated[dict[Name, Reprojection], AfterValidator(_bracketed)] = Field(
        {}, description="The same views through other lenses, by the names of their folders."
    )
    flow: Flow | None = Field(None, description="From depth and poses, of what stands still.")
    exports: Exports = Field(Exports(), description="Files for trainers.")
    report: Report = Field(Report(), description="What a dataset's page shows.")

    @model_validator(mode="before")
    @classmethod
    def _rigs_of_dataset(cls, content: Any) -> Any:
        match content:
            case {"scene": {"dataset": str(dataset)}}:
                for key in ("render", "rigs"):
                    if key in content:
                        raise ValueError(f"{key}: goes without scene.dataset, which has its own")
                try:
                    return {**content, "rigs": published.rigs(dataset)}
                except UserError as error:
                    raise ValueError(f"scene.dataset: {error}") from None
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
                raise ValueError("render.samples: file goes with scene.blend")
            if self.render.depth_of_field:
                raise ValueError("render.depth_of_field: goes with scene.blend, for its camera")
        for name, reprojection in self.reprojections.items():
            key = f"reprojections.{name}"
            _check_name(key, name, REPROJECTION_NEIGHBOURS)
            for rig_name in reprojection.rigs or ():
                if rig_name not in self.rigs:
                    hint = suggestion(rig_name, self.rigs)
                    raise ValueError(f"{key}.rigs: there is no rig {rig_name!r}{hint}")
            for pass_name in reprojection.passes or ():
                if self.render is None or pass_name not in (self.render.passes or ()):
                    raise ValueError(f"{key}.passes: {pass_name} is not in render.passes")
                if PASSES[pass_name].kind == "motion":
                    raise ValueError(f"{key}.passes: motion is in pixels of the rendered lens")
        for name, export in self.exports.wanted.items():
            self._check_export(f"exports.{name}.sources", export)
        if self.flow and self.render and self.render.depth == "none":
            raise ValueError("flow: follows from depth, but render.depth is none")
        self._check_whole_rigs()
        return self

    def _check_whole_rigs(self) -> None:
        """Check that rigs of which one trains and others test can be one dataset to a trainer."""
        whole = {name: rig for name, rig in self.rigs.items() if rig.split in PARTS}
        first = next((name for name, rig in whole.items() if rig.split == "train"), None)
        if whole and (first is None or not any(rig.split == "test" for rig in whole.values())):
            name, missing = (first, "tests") if first else (next(iter(whole)), "trains")
            raise ValueError(f"rigs.{name}.split: is {whole[name].split}, but no rig {missing}")
        for name, rig in whole.items():
            for key in ("camera", "frames"):
                if getattr(rig, key) != getattr(whole[str(first)], key):
                    raise ValueError(f"rigs.{name}.{key}: must be that of {first}, which trains")
        for name, reprojection in self.reprojections.items():
            missing_rigs = whole.keys() - set(reprojection.rigs or self.rigs)
            if missing_rigs and missing_rigs != whole.keys():
                rigs = ", ".join(sorted(missing_rigs))
                raise ValueError(
                    f"reprojections.{name}.rigs: lacks {rigs}; must have all rigs "
                    "of which one trains and others test, or none"
                )

    def _check_export(self, key: str, export: Export) -> None:
        """Check that the sources are there, and that the consumer can take them."""
        known = [VIEWS, *self.reprojections]
        for source in export.sources:
            if source not in known:
                raise ValueError(f"{key}: is {source!r}; must be of {', '.join(known)}")
            has_depth = self.render is None or self.render.depth != "none"
            reprojection = None if source == VIEWS else self.reprojections[source]
            if reprojection:
                has_depth &= reprojection.format == "exr"
            names = (reprojection and reprojection.rigs) or self.rigs
            for name, rig in ((name, self.rigs[name]) for name in names):
                camera = (reprojection and reprojection.camera) or rig.camera
                if refusal := export.refusal(camera.make(), has_depth):
                    raise ValueError(f"{key}: {source} {refusal}")
                if rig.is_omnidirectional:
                    raise ValueError(f"{key}: {source} is of the rig {name}, without a centre")
                if refusal := export.rig_refusal(rig):
                    raise ValueError(f"{key}: {source} is of the rig {name}, which {refusal}")

    def _check_rig(self, key: str, name: str, rig: Rig) -> None:
        """Check what of a rig depends on its camera, its file and the depth."""
        camera = rig.camera
        if camera is None:
            raise ValueError(f"{key}: is missing the key camera")
        if isinstance(rig, Poses) and not Path(rig.file).is_file():
            raise ValueError(f"{key}.file: is {rig.file!r}; there is no such file")
        if self.scene.blend is None and isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.type: blend_camera goes with scene.blend")
        if camera.lens == FILE and not isinstance(rig, BlendCamera):
            raise ValueError(f"{key}.camera.lens: file goes with a rig of type blend_camera")
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
            known = ", ".join(name for name, lens in LENSES.items() if lens.in_cycles)
            raise ValueError(
                f"{key}.camera.lens: is {camera.lens!r}, which Cycles does not have; "
                f"must be one of {known} (reproject for the others)"
            )
        if self.render:
            _check_blender_takes(f"{key}.camera", lens)
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
        if rig.is_omnidirectional:
            self._check_without_centre(key, name)
        if self.flow and rig.is_at_one_place():
            raise ValueError(f"flow: {FLOW_PLACES}, but all views of {key} are from one")

    def _check_without_centre(self, key: str, name: str) -> None:
        """Check that nothing is asked of a rig's views for which they would need a centre."""
        if self.rigs[name].camera.lens != "equirectangular":
            raise ValueError(f"{key}.stereo.omnidirectional: goes with the lens equirectangular")
        without = f"without {key}.stereo.omnidirectional, whose views have no centre"
        if self.flow:
            raise ValueError(f"flow: goes {without}")
        if self.render and "motion" in (self.render.passes or ()):
            raise ValueError(f"render.passes: motion goes {without}")
        for other, reprojection in self.reprojections.items():
            if reprojection.camera and name in (reprojection.rigs or self.rigs):
                raise ValueError(f"reprojections.{other}: goes {without}")


def _check_blender_takes(key: str, lens: Lens) -> None:
    """Refuse what Blender would change to the nearest value that it has."""
    camera = lens.to_lightfield()["camera"]
    for name, (least, most, unit, words) in BLENDER_LIMITS.items():
        value = camera.get(name, least)
        if not least <= value <= most:
            bound = f"at least {least / unit:.4g}" if value < least else f"at most {most / unit:g}"
            raise ValueError(f"{key}: its {words} is {value / unit:.4g}; Blender has {bound}")
    if max(lens.sensor) < 1:
        raise ValueError(f"{key}.sensor_size: is {lens.sensor[0]:g}; Blender has at least 1 mm")


def _check_cube_map(key: str, rig: Rig) -> None:
    """Check that a rig's camera can be that of a cube map's face, where it has to."""
    if rig.cube_map and (problem := face_problem(rig.camera)):
        raise ValueError(f"{key}.camera{problem}")


def _check_name(key: str, name: str, neighbours: set[str]) -> None:
    if name in neighbours or OTHER_NEIGHBOURS.fullmatch(name):
        raise ValueError(f"{key}: the name {name} is taken; choose another")


def _unknown_names(rig: Rig) -> list[str]:
    """Return the names in a rig's split that no view has."""
    known_later = isinstance(rig, BlendCamera)
    if known_later or not isinstance(rig.split, Chosen) or not rig.split.names:
        return []
    return sorted({*rig.split.names} - {pose.name for pose in rig.poses()})


_CONFIGURATION = TypeAdapter(Configuration)
_SCENE = TypeAdapter(Scene)


def load_config(content: Any) -> Configuration:
    """Return the top-level configuration; raises `UserError`."""
    return checked(_CONFIGURATION, content, "config.yaml")


def read_config(path: Path) -> dict[str, Any]:
    """Read a config.yaml, unchecked but for being a mapping; raises `UserError`."""
    content = read_yaml(path, path.name)
    if not isinstance(content, dict):
        raise UserError(f"{path}: must be a mapping of keys to values")
    return content


def load_scene(scene: str) -> Scene:
    """Read and check one scene YAML; raises `UserError` with file, key, value and what is right."""
    path = scene_path(scene)
    if not path.is_file():
        files = {*SCENES.glob("*.yaml"), *OWN_SCENES.glob("*.yaml")}
        known = sorted({file.stem for file in files})
        near = " or ".join(difflib.get_close_matches(scene, known))
        hint = f"is {near} meant?" if near else f"there are {', '.join(known)}"
        raise UserError(f"config.yaml: scenes: there is no scene {scene!r}; {hint}")
    return read_scene(path)


def scene_path(scene: str) -> Path:
    """Return the scene YAML of a name: the user's own, or else the repository's."""
    own = OWN_SCENES / f"{scene}.yaml"
    repository = OWN_SCENES.resolve() == ROOT / OWN_SCENES
    return own if own.is_file() and not repository else SCENES / own.name


def read_scene(path: Path) -> Scene:
    """Read and check the scene YAML at ``path``, as `load_scene` does by name."""
    file = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
    return checked(_SCENE, read_yaml(path, file), file)


def builders() -> list[str]:
    """Names of the scene builders, the folders of scripts/scenes/ that are not their library."""
    folders = (file.parent.name for file in BUILDERS.glob("*/__init__.py"))
    return sorted(name for name in folders if name != "library")


def blend_sha256(scene: str, source: SceneSource) -> tuple[str | None, Path]:
    """Return the SHA-256 that a scene's .blend must have, or None if no one knows it yet.

    The second value is the file that says so, or that shall: the scene YAML or its lock file.
    """
    if source.sha256:
        return source.sha256, scene_path(scene)
    lock = scene_path(scene).with_suffix(".lock.json")
    try:
        return (str(read_json(lock)["sha256"]) if lock.exists() else None), lock
    except (LookupError, TypeError):
        raise UserError(
            f"{lock}: sha256: is missing; without the file it is recorded anew"
        ) from None


def expected_blend(scene: str, blend: Path, digest: str) -> Path | None:
    """Check that a .blend has the SHA-256 that is meant.

    Returns None, or the lock file that shall say so where no one knows it yet. Raises `UserError`.
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
    """Record a scene's .blend as it is now as the one that is meant.

    Raises `UserError` where the scene YAML itself says which one that is.
    """
    source = load_scene(scene).scene
    if source.blend is None or not Path(source.blend).is_file():
        return
    found = sha256(Path(source.blend))
    expected, origin = blend_sha256(scene, source)
    if source.sha256 and found != expected:
        raise UserError(
            f"{origin}: scene.sha256: is {expected}, but {source.blend} has {found}; accept_blend "
            "writes no scene YAML: write it there"
        )
    if found != expected:
        record_blend(Path(source.blend), found, origin)


def record_blend(blend: Path, digest: str, lock: Path) -> None:
    """Record the SHA-256 of the .blend that is meant."""
    write_json(lock, {"blend": blend.name, "sha256": digest})
    print(f"note: {blend}: its sha256 {digest} is now recorded in {lock}")


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe YAML in which a key given twice is an error, not a silent overwrite."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            # `<<: *other`: what is given beside it counts, wherever both have a key.
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                problem = f"the key {key!r} is not a text; put it in quotes"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            if key in seen:
                problem = f"the key {key!r} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


# YAML 1.1 takes 12:30 for 750, 0123 for 83 and 0b11 for 3. Here they stay the texts that they look
# like, which messages show as they were written. It takes 1e-3 for a text; here it is a number.
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
    """Replace in ``content`` what Snakemake has read of a file by our own reading, ``written``."""
    for key, value in written.items():
        if isinstance(value, Mapping) and isinstance(content.get(key), dict):
            as_written(content[key], value)
        else:
            content[key] = value


def read_yaml(path: Path, file: str) -> Any:
    """Read a YAML file, which errors name ``file``; raises `UserError` for what is none.

    Refused, too, is one so large, or of aliases to so much, that it is no settings.
    """
    try:
        with path.open("rb") as stream:
            content = stream.read(LARGEST_YAML + 1)
        if len(content) > LARGEST_YAML:
            raise UserError(
                f"{file}: is larger than {LARGEST_YAML // 1000} kB, so it is no settings"
            )
        loader = _UniqueKeyLoader(content.decode())
        node = loader.get_single_node()
        if _size(node, {}) > MOST_NODES:
            raise UserError(f"{file}: its aliases (*name) repeat too much, so it is no settings")
        return loader.construct_document(node) if node else None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = error.problem
        if mark and _is_indented_by_tabs(content, mark.line):
            problem = "is indented with a tab; use spaces"
        raise UserError(f"{file}: {where}{problem}") from None
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None


def _is_indented_by_tabs(content: bytes, line: int) -> bool:
    """Return whether blanks with a tab among them begin a line, counted from 0."""
    text = dict(enumerate(content.splitlines())).get(line, b"")
    return b"\t" in text[: len(text) - len(text.lstrip())]


def _size(node: yaml.Node | None, sizes: dict[int, float]) -> float:
    """Return how many nodes there are below one, each alias counted as what it stands for.

    A node that holds itself is infinite.
    """
    if node is None or isinstance(node.value, str):
        return 1
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        pairs = isinstance(node, yaml.MappingNode)
        below = chain.from_iterable(node.value) if pairs else node.value
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in below)
    return sizes[id(node)]
