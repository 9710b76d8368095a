"""A camera of a scene YAML whose lens is in the file of a calibration tool."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import LensSettings, Pixels
from lightfield.geometry.lenses.calibrations import Model, read
from lightfield.settings.base import Settings, as_list, pattern, problems


class LensFileSettings(Settings):
    """A lens in the file of a calibration tool.

    The file's numbers take the place of these keys before anything else reads the camera. So a
    file that changes is a camera that changes.
    """

    lens: Literal["calibrated"]
    file: str = Field(
        pattern=pattern(
            r"(?i)\.(ya?ml|xml|json|txt|bin)$",
            "a path that ends in .yaml, .yml, .xml, .json, .txt or .bin",
        ),
        description="Path of the calibration: OpenCV's, ROS's, Kalibr's or EuRoC's .yaml, OpenCV's "
        ".xml or .json, a transforms.json, or COLMAP's cameras.txt or cameras.bin.",
    )
    camera: str | int | None = Field(
        None, description="Name or number of the camera, for a file with several."
    )
    model: Model | None = Field(
        None,
        description="Lens of four coefficients in OpenCV's file, which do not say it: the usual "
        "lens (brown_conrady), or the fisheye (kannala_brandt).",
    )
    resolution: Annotated[tuple[Pixels, Pixels], as_list(2)] | None = Field(
        None,
        description="Width and height of the image, for a file without them.",
        json_schema_extra={"unit": "pixels"},
    )
    fov: float | None = Field(
        None,
        gt=0,
        le=360,
        description="Full field of view at which the lens ends. Without this key, it ends where "
        "its equation does.",
        json_schema_extra={"unit": "degrees"},
    )

    def of_file(self) -> LensSettings:
        """Return the settings of the file's lens. Raises ValueError that begins with the key."""
        try:
            lens = read(
                Path(self.file),
                self.camera,
                model=self.model,
                resolution=self.resolution,
                fov=None if self.fov is None else math.radians(self.fov),
            )
        except UserError as error:
            raise ValueError(f"file: {error}") from None
        assert lens.Settings is not None
        content = lens.settings()
        try:
            return lens.Settings.model_validate(content)
        except ValidationError as error:
            first, *_ = problems(error, content)
            raise ValueError(f"file: {self.file}: {first}") from None


def of_file(settings: Any) -> Any:
    """Return a camera's settings, in which a calibration file's lens replaces the file."""
    return settings.of_file() if isinstance(settings, LensFileSettings) else settings
