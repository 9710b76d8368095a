"""The perspective lens."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import (
    SENSOR_WIDTH,
    Array,
    FocalLength,
    LensSettings,
    Pair,
    RadialLens,
    checked_focal_length,
)

_CLIP = (0.1, 1000.0)  # m, a new Blender camera's clipping, which its projection matrix contains


class RectilinearSettings(LensSettings):
    """A perspective lens in a scene YAML: its field of view, or its focal length."""

    lens: Literal["rectilinear"]
    fov: Annotated[float, Field(gt=0, lt=180)] | None = Field(
        None,
        description="Full field of view across the image's width.",
        json_schema_extra={"unit": "degrees"},
    )
    focal_length: FocalLength | None = Field(
        None,
        description="Focal length of the lens. Give either this or fov.",
        json_schema_extra={"unit": "mm"},
    )

    def optics(self) -> dict[str, Any]:
        if self.focal_length is None and self.fov is None:
            raise UserError("focal_length: is missing; the rectilinear lens needs it, or fov")
        if self.fov is None:
            return {"focal_length": self.focal_length}
        if self.focal_length is not None:
            raise UserError("focal_length: does not go with fov; the lens needs only one of them")
        size = self.sensor_size or SENSOR_WIDTH
        width = size if isinstance(size, float) else size[0]
        return {"focal_length": width / 2 / math.tan(math.radians(self.fov) / 2)}


class FileSettings(LensSettings):
    """The perspective lens of a .blend's own camera.

    Until the .blend has been read, its focal length is taken to be 50 mm.
    """

    lens: Literal["file"]

    def make(self) -> "Rectilinear":
        width, height = self.resolution
        return Rectilinear(width=width, height=height, focal_length=50)


@dataclass(frozen=True, kw_only=True)
class Rectilinear(RadialLens):
    """r = f tan θ, ``focal_length`` in mm. Source: the pinhole camera."""

    name = "rectilinear"
    title = "rectilinear"
    camera_types = ("PERSP",)
    in_cycles = True
    focuses_on_plane = True
    Settings = RectilinearSettings
    form = "FOCAL_LENGTH,SENSOR_WIDTH"

    focal_length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_focal_length(self.focal_length)

    @property
    def K(self) -> npt.NDArray[np.float64]:  # noqa: N802
        (across, down), (x, y) = self._unit, self.center
        return np.array([[1 / across, 0, x], [0, 1 / down, y], [0, 0, 1]])

    @property
    def description(self) -> str:
        return f"{self.title}, {self.focal_length:.4g} mm"

    @property
    def has_square_pixels(self) -> bool:
        """Whether a pixel is as wide on the sensor as it is high."""
        across, down = self._pixel_size()
        return math.isclose(across, down, rel_tol=1e-6)

    @property
    def _unit(self) -> Pair:
        # r is counted in focal lengths.
        return self._pixel_size(self.focal_length)

    @property
    def _limit(self) -> float:
        return math.inf

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        length = np.hypot(1, r)
        return r / length, 1 / length

    def _radius(self, sin: Array, cos: Array) -> Array:
        return np.where(cos > 0, sin / cos, np.nan)

    def _to_camera(self) -> dict[str, Any]:
        near, far = _CLIP
        unit = self._unit
        # As in Blender's calc_matrix_camera. The third column holds a shifted principal point.
        return {
            "lens_unit": "MILLIMETERS",
            "focal_length": self.focal_length,
            "projection_matrix": [
                [2 / (self.width * unit[0]), 0.0, 1 - 2 * self.center[0] / self.width, 0.0],
                [0.0, 2 / (self.height * unit[1]), 2 * self.center[1] / self.height - 1, 0.0],
                [0.0, 0.0, (near + far) / (near - far), 2 * near * far / (near - far)],
                [0.0, 0.0, -1.0, 0.0],
            ],
        }

    @classmethod
    def read(cls, camera: Mapping[str, Any], image: Mapping[str, Any]) -> Self:
        # This lens only supplies the image's centre and sensor, which the file may leave out.
        defaults = cls(**image, focal_length=1)
        matrix = camera.get("projection_matrix")
        if matrix and defaults.principal_point is None:
            right, up = float(matrix[0][2]), float(matrix[1][2])
            if right or up:
                center = (defaults.width / 2 * (1 - right), defaults.height / 2 * (1 + up))
                image = {**image, "principal_point": center}
        if camera["lens_unit"] == "MILLIMETERS":
            focal_length = float(camera["focal_length"])
        elif camera["lens_unit"] == "FOV" and matrix:
            focal_length = float(matrix[0][0]) * defaults.sensor[0] / 2
        elif camera["lens_unit"] == "FOV":
            # Blender's angle spans the sensor's longer side.
            focal_length = max(defaults.sensor) / 2 / math.tan(float(camera["angle"]) / 2)
        else:
            raise UserError(f"camera.lens_unit: {camera['lens_unit']!r} is not MILLIMETERS or FOV")
        return cls(**image, focal_length=focal_length)
