"""The settings of a reprojection, in a scene YAML and in the programs' settings files.

A scene YAML's entry of `reprojections` becomes `ReprojectionSettings`. The plan writes them to a
settings file, which scripts/reproject.py and scripts/lens_map.py read with --settings.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from lightfield.core.settings import Settings, Vector
from lightfield.geometry.lenses import CameraSettings, Lens
from lightfield.geometry.lenses.cube_map import CubeMap

MOST_SAMPLES = 64
"""Samples along each side of a pixel."""

LENS_MAP_KEYS = {"camera", "cube_map", "rotation", "filter", "samples"}
"""The settings on which a lens map depends."""

Stops = Annotated[float, Field(ge=-100, le=100)]


class ReprojectionOptions(Settings):
    """The options that a scene YAML has in common with the settings of the programs."""

    camera: CameraSettings | None = Field(
        None, description="Without it, the rig's own: the pixels are those of the views."
    )
    cube_map: bool = Field(False, description="Six faces of each view, each a 90 degree view.")
    rotation: Vector = Field((0.0, 0.0, 0.0), description="Pan, pitch and roll in degrees.")
    filter: Literal["nearest", "bilinear", "bicubic", "lanczos", "adaptive", "st_warp"] = Field(
        "adaptive", description="How colour is resampled."
    )
    samples: int = Field(1, ge=1, le=MOST_SAMPLES, description="n x n samples a pixel.")
    bits: Literal[8, 16] = Field(8, description="Of a PNG's values.")
    reinhard: float = Field(
        1.0,
        ge=1e-9,
        le=1e9,
        description="Reinhard tone mapping: the value that becomes white; 1 is none.",
    )

    @model_validator(mode="after")
    def _camera_fits(self) -> Self:
        if self.camera is None:
            return self
        if self.camera.lens == "file":
            raise ValueError("camera.lens: file goes with a rig of type blend_camera")
        if self.cube_map and (problem := face_problem(self.camera)):
            raise ValueError(f"camera{problem}")
        return self

    def lens(self, source: Lens) -> Lens:
        """Return the lens of the images that are made of views through ``source``."""
        if self.camera is None:
            return source
        if self.cube_map:
            size = self.camera.resolution[0]
            return CubeMap(width=6 * size, height=size).face
        return self.camera.make()


class ReprojectionSettings(ReprojectionOptions):
    """The settings of scripts/reproject.py; scripts/lens_map.py needs `LENS_MAP_KEYS` alone."""

    formats: list[Literal["exr", "png"]] = Field([], description="EXR holds depth, too.")
    exposure: Stops = Field(0.0, description="In stops.")
    depth_png: float | None = Field(
        None, gt=0, description="Of 16-bit depth maps: steps to a metre. Without it, no such maps."
    )
    mask: bool = Field(False, description="Masks of the pixels without a source.")
    passes: list[str] = Field([], description="Passes that are reprojected, too.")

    @property
    def lens_map_settings(self) -> dict[str, Any]:
        """The content of a lens map's settings file."""
        return self.as_json(LENS_MAP_KEYS)

    @property
    def development(self) -> dict[str, Any]:
        """How light becomes pixels. It lacks 8 ``bits``, so that older views keep their keys."""
        bits = {} if self.bits == 8 else {"bits": self.bits}
        return {"exposure": self.exposure, "reinhard": self.reinhard, **bits}

    @property
    def published(self) -> dict[str, Any]:
        """What lightfield.json and the images' headers say in addition to the lens.

        ``rotation`` is pan, pitch and roll in degrees; `lightfield.imaging.tonemap` defines
        ``exposure`` and ``reinhard``, by which the pixels of a PNG can be turned back into light.
        """
        return {
            "rotation": list(self.rotation),
            "filter": self.filter,
            "samples": self.samples,
            **self.development,
        }


def face_problem(camera: CameraSettings) -> str | None:
    """Return why a camera cannot be a cube map's face, worded to follow its key; None if it can."""
    if (camera.lens, getattr(camera, "fov", None)) != ("rectilinear", 90):
        return ": must be rectilinear with fov 90 with cube_map"
    if camera.resolution[0] != camera.resolution[1]:
        size = list(camera.resolution)
        return f".resolution: is {size}; must be square with cube_map"
    return None
