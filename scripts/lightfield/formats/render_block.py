"""The block `render` of lightfield.json and of settings files: how Cycles renders the views.

The block of a scene YAML, `lightfield.configuration.render_settings.Render`, has the same keys,
except the keys that a preset or a .blend adds.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    TypeAdapter,
    model_validator,
)

from lightfield.formats import light_groups, passes
from lightfield.formats.passes import PASSES, SAMPLE_PARTS, VARIANCE, Pass
from lightfield.settings.base import AS_WRITTEN, Settings, Vector, checked
from lightfield.settings.types import AtLeastOne, Compression, DenoisePrefilter, unique_names

_PassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": list(PASSES)})]],
    AfterValidator(passes.in_order),
]
_Emitters = Annotated[list[str], AfterValidator(unique_names)]


_Error = Annotated[float, Field(gt=0, le=1), AS_WRITTEN]


class TargetError(Settings):
    """The error that the views must reach, and the methods that may reach it."""

    value: _Error | None = Field(None, description="Relative mean squared error to reach.")
    of_samples: AtLeastOne | None = Field(
        None,
        description="In place of value: reach the error that plain path tracing has with so many "
        "samples. The calibration measures this error.",
        json_schema_extra={"unit": "paths"},
    )
    denoise: Literal["auto", "never"] = Field(
        "auto",
        description="Whether the denoiser may be chosen. auto: if it is cheaper. never: only plain "
        "and adaptive sampling are compared.",
    )

    @model_validator(mode="after")
    def _value_or_samples(self) -> Self:
        if (self.value is None) == (self.of_samples is None):
            raise ValueError("must have either value or of_samples")
        return self


class MeasuredTargetError(TargetError):
    """A target error whose value only the calibration will know."""

    of_samples: AtLeastOne


class CameraMotion(Settings):
    """How each camera moves at constant speed while its shutter is open.

    The view's pose is the camera's pose in the middle of the exposure. Depth and passes show the
    same moment.
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


class RenderOptions(Settings):
    """The settings of Cycles that a scene YAML and a dataset share."""

    samples: AtLeastOne | Literal["file"] | None = Field(
        None,
        description="Number of paths that Cycles traces for each pixel. file: the number in the "
        ".blend.",
        json_schema_extra={"unit": "paths"},
    )
    target_error: _Error | TargetError | None = Field(
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
    compression: Compression | None = Field(
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
        "passes of their own. each: all of them. A list: the sources with these names. A mapping: "
        "groups of them. All others form the group rest.",
    )

    @property
    def has_variance(self) -> bool:
        """Whether the views have a pass of their variance, so that they must have no bias."""
        return VARIANCE in (self.passes or ())

    @property
    def fewest_samples(self) -> int:
        """The fewest samples that a pixel may have."""
        return SAMPLE_PARTS if self.has_variance else 1


class RenderBlock(RenderOptions):
    """How a dataset's views are rendered: with the preset, the calibration, and the .blend applied.

    The keys keep the order in which they were given. A key that was not given is not written: a
    calibration has yet to choose it, or the views are imported. Its value here is the default.
    """

    target_error: _Error | MeasuredTargetError | None = None
    # In any order: another program may have written them.
    passes: list[str] | None = None
    most_samples: AtLeastOne | None = Field(
        None,
        description="A preset's limit for samples that a calibration or the .blend chooses.",
    )
    shutter: Literal["centred"] | None = Field(
        None, description="How views are exposed, if it is not as in the .blend."
    )
    _keys: tuple[str, ...] = PrivateAttr(())

    @model_validator(mode="wrap")
    @classmethod
    def _note_keys(cls, content: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        block = handler(content)
        if isinstance(content, Mapping):
            block._keys = tuple(content)
        return block

    @classmethod
    def read(cls, content: Mapping[str, Any], place: str) -> "RenderBlock":
        """Return the block of a lightfield.json, without unknown keys of other programs.

        Raises `UserError`, one line that begins with ``place``, for a wrong value.
        """
        known_settings = {
            key: value
            for key, value in content.items()
            if key in cls.model_fields and value is not None
        }
        return checked(_ADAPTER, known_settings, place)

    def to_json(self) -> dict[str, Any]:
        """Return the keys that were given, in their order."""
        values = self.model_dump(exclude_none=True)
        return {key: values[key] for key in self._keys}

    def changed(self, **values: Any) -> "RenderBlock":
        """Return a copy with other values. None leaves a key out. New keys are the last."""
        content = self.to_json() | values
        return RenderBlock.of(**content)

    @property
    def uncalibrated(self) -> "RenderBlock":
        """The block without the keys that only its calibration reads."""
        return self.changed(**dict.fromkeys(_ONLY_FOR_CALIBRATION))

    @property
    def without_passes(self) -> "RenderBlock":
        """The block without passes and light groups."""
        return self.changed(passes=None, light_groups=None)

    @property
    def given_denoise(self) -> bool | None:
        """Whether views are denoised. None if a calibration decides."""
        return self.denoise if "denoise" in self.model_fields_set else None

    @property
    def emitters_of_groups(self) -> dict[str, list[str]]:
        """The emitters of each light group, which a lightfield.json has."""
        return self.light_groups if isinstance(self.light_groups, dict) else {}

    @property
    def selected_passes(self) -> list[Pass]:
        """The passes that ``passes`` and ``light_groups`` select.

        A lightfield.json has all groups. A scene YAML may lack names: see `light_groups.names_in`.
        """
        groups = self.light_groups
        selected = [passes.by_name(name) for name in self.passes or ()]
        for group in light_groups.names_in(groups) or ():
            # A transparent view's colour leaves out the world, but Cycles' pass does not.
            members = groups[group] if isinstance(groups, Mapping) else ()
            shows_world = not self.transparent or light_groups.WORLD not in members
            without = None if shows_world else "Environment"
            selected.append(replace(passes.of_group(group), without=without))
        return selected


_ONLY_FOR_CALIBRATION = ("target_error", "most_samples", "denoise")
_ADAPTER = TypeAdapter(RenderBlock)
