"""The block `render` of a scene YAML: samples, passes, light groups, motion and denoising."""

import re
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from lightfield.configuration.setting_types import AtLeastOne, DenoisePrefilter, unique_names
from lightfield.core.settings import AS_WRITTEN, Settings, Vector
from lightfield.formats import light_groups
from lightfield.formats.passes import PASSES, in_order

_PassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": list(PASSES)})]], AfterValidator(in_order)
]
_Emitters = Annotated[list[str], AfterValidator(unique_names)]
# The keys of `Render` that a calibration chooses for a target error.
CHOSEN = ("samples", "adaptive_threshold", "denoise")


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
    passes: _PassNames | None = Field(
        None, description="Passes to write beside colour and depth, each into a folder of its own."
    )
    light_groups: Literal["each"] | _Emitters | dict[str, _Emitters] | None = Field(
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
