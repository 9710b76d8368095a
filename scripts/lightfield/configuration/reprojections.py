"""The settings of a reprojection, in a scene YAML and in the programs' settings files.

`ReprojectionEntry` is an entry of `reprojections` in a scene YAML. It becomes a `Reprojection`. The
plan writes this to a settings file, which scripts/reproject.py and scripts/lens_map.py read with
--settings.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic.json_schema import SkipJsonSchema
from typing_extensions import TypeAliasType

from lightfield.engine.stage import cause
from lightfield.formats.passes import PASSES, in_order
from lightfield.formats.sensors import SensorSettings
from lightfield.geometry.lenses import CameraSettings, Lens
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging import blender_looks
from lightfield.imaging.blender_looks import LookName
from lightfield.imaging.look import Look
from lightfield.settings.base import Name, Settings, Vector, as_list
from lightfield.settings.types import REINHARD, Compression, Primaries, Stops, White

MOST_SAMPLES = 64
"""Samples along each side of a pixel."""

LIGHT_GROUPS = "light_groups"
"""In the list of a reprojection's passes, this name stands for all light groups."""

OPTICS = ("camera", "cube_map", "rotation", "filter", "samples")
"""The settings that say how views are resampled, on which a lens map depends."""

# A group's factor, or its factors of red, green and blue.
_Strength = Annotated[float, Field(ge=0, le=1e6)]
_Colour = TypeAliasType("_Colour", Annotated[tuple[_Strength, _Strength, _Strength], as_list(3)])
Light = Literal["each"] | dict[str, _Strength | _Colour]
"""The strengths of light groups by name. each: every group alone."""


Filter = Literal["nearest", "bilinear", "bicubic", "lanczos", "adaptive", "st_warp"]
DEFAULT_FILTER: Filter = "adaptive"


class ReprojectionOptions(Settings):
    """The options that a scene YAML shares with the programs' settings files."""

    camera: CameraSettings | None = Field(
        None,
        description="Lens and image of the result. Without this key, the views keep their lens and "
        "image, and nothing is resampled.",
    )
    cube_map: bool = Field(
        False, description="Make six views of 90° from each view, as the faces of a cube."
    )
    rotation: Vector = Field(
        (0.0, 0.0, 0.0),
        description="Rotation of the camera: pan to the left, pitch downward, and roll clockwise.",
        json_schema_extra={"unit": "degrees"},
    )
    filter: Filter = Field(
        DEFAULT_FILTER,
        description="Filter that resamples colour. adaptive averages over the whole area of each "
        "pixel, so it also suits smaller images.",
    )
    samples: int = Field(
        1,
        ge=1,
        le=MOST_SAMPLES,
        description="Samples along each side of a pixel: n gives n × n samples.",
        json_schema_extra={"unit": "samples"},
    )
    bits: Literal[8, 16] = Field(
        8, description="Bits per channel of a PNG.", json_schema_extra={"unit": "bits"}
    )
    reinhard: White = Field(
        1.0,
        description=f"Tone mapping: the {REINHARD}",
        json_schema_extra={"unit": "light"},
    )
    look: LookName = None

    @model_validator(mode="after")
    def _one_tone_curve(self) -> Self:
        blender_looks.check_beside(self.look, self.reinhard)
        return self

    @model_validator(mode="after")
    def _camera_fits(self) -> Self:
        if self.camera is None:
            return self
        if self.camera.lens == "file":
            raise ValueError("camera.lens: file is only for a rig of type blend_camera")
        if self.cube_map and (problem := face_problem(self.camera)):
            raise ValueError(f"camera{problem}")
        return self

    def lens(self, source: Lens) -> Lens:
        """Return the lens of the new images. ``source`` is the lens of the views."""
        if self.camera is None:
            return source
        if self.cube_map:
            size = self.camera.resolution[0]
            return CubeMap(width=6 * size, height=size).face
        return self.camera.make()


class Reprojection(ReprojectionOptions):
    """Versions of the views through another lens, or as other files, with every name resolved.

    These are the settings of scripts/reproject.py. scripts/lens_map.py needs only `OPTICS`.
    ``rigs`` are the rigs whose views are reprojected. None means all. They are in no settings file.
    """

    rigs: SkipJsonSchema[list[str] | None] = Field(None, exclude=True)

    formats: list[Literal["exr", "png"]] = Field(
        [], description="Formats of the images to write. EXR also holds depth."
    )
    exposure: Stops = Field(
        0.0, description="Exposure of the images.", json_schema_extra={"unit": "stops"}
    )
    depth_png: float | None = Field(
        None,
        gt=0,
        description="Steps per metre of 16-bit depth maps. They end at 65535 steps. Without this "
        "key, no such maps are written.",
        json_schema_extra={"unit": "steps/m"},
    )
    mask: bool = Field(
        False, description="Also write masks of the pixels that the source views do not see."
    )
    passes: list[str] = Field([], description="Names of passes that are also reprojected.")
    relight: Light | None = Field(
        None,
        description="Light of the images: strengths of light groups, as in relight of the scene "
        "YAML.",
    )
    primaries: Primaries | None = Field(
        None,
        description="Colour space of EXR images, which the files name in their attribute "
        "chromaticities.",
    )
    compression: Compression | None = Field(
        None, description="Lossless compression of the EXR files. The default is a fast zip."
    )
    sensor: SensorSettings | None = Field(
        None, description="Sensor that makes the PNG images, instead of exposure and reinhard."
    )
    look_source: str | None = cause(
        "Version of bpy and SHA-256 of its config.ocio, if there is a look."
    )

    @model_validator(mode="after")
    def _sensor_writes_png(self) -> Self:
        if self.sensor and self.formats != ["png"]:
            raise ValueError("formats: must be [png] with sensor, which writes no other")
        return self

    @model_validator(mode="after")
    def _look_is_of_png(self) -> Self:
        if self.look and "exr" in self.formats:
            raise ValueError("look: is only for PNG images; an EXR keeps the light")
        return self

    @property
    def suffix(self) -> str:
        """The suffix of the images' names."""
        return f".{self.formats[0]}"

    @property
    def has_depth(self) -> bool:
        """Whether images have depth, if the views do."""
        return "exr" in self.formats

    @property
    def lens_map_settings(self) -> dict[str, Any]:
        """The content of a lens map's settings file."""
        return self.as_json({*OPTICS})

    def development(self, look: Look | None) -> dict[str, Any]:
        """Return the settings that turn light into pixels. ``look`` is the look of `look`."""
        settings: dict[str, Any] = {"exposure": self.exposure, "reinhard": self.reinhard}
        if self.sensor:
            settings = {"sensor": self.sensor.as_json()}
        elif look:
            settings = {}
        if look:
            settings["look"] = look.to_json()
        if self.primaries:
            settings["primaries"] = self.primaries
        # 8 is left out, so that the keys of earlier versions stay valid.
        if self.bits != 8:
            settings["bits"] = self.bits
        if self.relight is not None:
            settings["relight"] = self.as_json({"relight"})["relight"]
        return settings

    def published(self, look: Look | None) -> dict[str, Any]:
        """Return the settings in lightfield.json and the images' headers, beside the lens.

        ``rotation`` is pan, pitch and roll in degrees. `lightfield.imaging.tonemap` defines
        ``exposure`` and ``reinhard``, with which a reader can turn a PNG back into light. For a
        sensor, the file of each view's parameters does that. After a look, nothing does.
        """
        return {
            "rotation": list(self.rotation),
            "filter": self.filter,
            "samples": self.samples,
            **self.development(look),
        }


# A reprojection may have all passes of light groups, too.
_PassNames = Annotated[
    list[Annotated[str, Field(json_schema_extra={"enum": [*PASSES, LIGHT_GROUPS]})]],
    AfterValidator(lambda names: in_order(names, LIGHT_GROUPS)),
]


class ReprojectionEntry(ReprojectionOptions):
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
    passes: _PassNames | None = Field(
        None,
        description="Passes of render.passes that are also reprojected, as EXR. light_groups: the "
        "passes of all light groups.",
    )
    relight: Name | Light | None = Field(
        None,
        description="Light of the images, if it is not the rendered one: the name of an entry of "
        "relight, or strengths as in such an entry.",
    )
    primaries: Primaries | None = Field(
        None,
        description="Colour space of EXR images, which the files name in their attribute "
        "chromaticities. Without this key, it is Rec. 709, and the files do not name it.",
    )
    compression: Compression | None = Field(
        None,
        description="Lossless compression of the EXR files. The default is a fast zip, which every "
        "program reads. htj2k is faster and smaller, but few programs read it.",
    )

    @model_validator(mode="after")
    def _has_use(self) -> Self:
        for name in OPTICS:
            if self.camera is None and name in self.model_fields_set:
                raise ValueError(f"{name}: needs camera; without one, nothing is resampled")
        if self.format == "exr" and self.bits != 8:
            raise ValueError("bits: is only for format png; an EXR has 16-bit floats")
        if self.format == "png" and self.primaries:
            raise ValueError("primaries: is only for format exr; a PNG is sRGB")
        if self.format == "png" and self.compression and not self.passes:
            raise ValueError("compression: is only for EXR files: format exr, or passes")
        if self.format == "exr" and self.look:
            raise ValueError("look: is only for format png; an EXR keeps the light")
        lights = [
            name
            for name in self.passes or ()
            if name == LIGHT_GROUPS or PASSES[name].kind in ("light", "variance")
        ]
        if self.primaries == "acescg" and lights:
            raise ValueError(f"primaries: does not go with the pass {lights[0]}, which is Rec. 709")
        return self

    def resolved(self, light: Light | None) -> Reprojection:
        """Return the reprojection of this entry. ``light`` has the strengths that it names."""
        # `bracketed` has made an entry for each exposure.
        assert not isinstance(self.exposure, list)
        options = {name: getattr(self, name) for name in ReprojectionOptions.model_fields}
        return Reprojection.of(
            **options,
            rigs=self.rigs,
            formats=[self.format],
            exposure=self.exposure,
            passes=self.passes,
            relight=light,
            primaries=self.primaries,
            compression=self.compression,
            look_source=blender_looks.source_of(self.look),
        )


def bracketed(reprojections: dict[str, ReprojectionEntry]) -> dict[str, ReprojectionEntry]:
    """Replace each reprojection of several exposures by one for each, named by its stops."""
    bracketed: dict[str, ReprojectionEntry] = {}
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


def face_problem(camera: CameraSettings) -> str | None:
    """Return why a camera cannot be a cube map's face, as text after its key. None if it can."""
    if (camera.lens, getattr(camera, "fov", None)) != ("rectilinear", 90):
        return ": must be rectilinear with fov 90 with cube_map"
    if camera.resolution[0] != camera.resolution[1]:
        size = list(camera.resolution)
        return f".resolution: is {size}; must be square with cube_map"
    return None
