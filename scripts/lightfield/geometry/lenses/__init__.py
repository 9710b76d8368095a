"""All lenses. Each projection is a class in a file of its own, which holds everything about it."""

import importlib
import pkgutil
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter
from typing_extensions import TypeAliasType

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import LENSES, MOST_PIXELS, Array, Lens, LensSettings, pair
from lightfield.geometry.lenses.calibration_settings import LensFileSettings, of_file
from lightfield.geometry.lenses.rectilinear import FileSettings
from lightfield.settings.base import OTHER_NAMES, checked

__all__ = [
    "LENSES",
    "Array",
    "CameraSettings",
    "Lens",
    "build_settings",
    "from_camera",
    "from_lightfield",
]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

OTHER_NAMES.update(
    dict.fromkeys(("perspective", "persp", "pinhole"), "rectilinear")
    | {"fisheye": "equidistant", "opencv_fisheye": "kannala_brandt"}
    | dict.fromkeys(("ucm", "mei", "omni", "omnidir"), "unified")
    | dict.fromkeys(("simple_division",), "division")
    | {"eucm": "extended_unified", "ds": "double_sphere", "ftheta": "f_theta"}
    | dict.fromkeys(("atan", "fov"), "fov_model")
    | dict.fromkeys(("radtan", "opencv", "full_opencv"), "brown_conrady")
    | dict.fromkeys(("panorama", "panoramic", "spherical", "latlong"), "equirectangular")
)

_MODELS: tuple[type[BaseModel], ...] = (
    *(lens.Settings for lens in LENSES.values() if lens.Settings),
    FileSettings,
    LensFileSettings,
)
if TYPE_CHECKING:
    CameraSettings = LensSettings
else:
    # Named, so that the JSON schema has it once.
    CameraSettings = TypeAliasType(
        "CameraSettings",
        Annotated[
            Union[_MODELS],  # noqa: UP007
            Field(discriminator="lens"),
            AfterValidator(of_file),
        ],
    )
"""A scene YAML's ``camera``: the settings of any lens, which its key ``lens`` chooses."""
_SETTINGS: TypeAdapter[LensSettings] = TypeAdapter(
    CameraSettings, config=ConfigDict(defer_build=True)
)


def build_settings() -> None:
    """Build the validators of all lenses' settings now, not when the first is used.

    Models that contain lenses many times take these as parts of their own. Otherwise each of them
    would build the lenses again.
    """
    for model in _MODELS:
        model.model_rebuild()


def from_camera(camera: Mapping[str, Any] | LensSettings) -> Lens:
    """Return the lens of a scene YAML's ``camera`` mapping.

    ``fov`` is in degrees: across the image's width for a rectilinear lens, across the image circle
    for a fisheye. ``sensor_size`` is its width, or both sides, in mm. Raises `UserError` for a
    wrong key, and for ``lens: file``, which only the .blend's inventory can describe.
    """
    settings = checked(_SETTINGS, camera, "camera")
    if isinstance(settings, FileSettings):
        raise UserError("camera: lens: is file, which is only for a rig of type blend_camera")
    return settings.make()


def from_lightfield(content: Mapping[str, Any]) -> Lens:
    """Return the lens of a lightfield.json, which Plenoforge or SILVR's tools wrote.

    Raises `UserError` that names the key if a key is missing or has an unknown value.
    """
    try:
        camera = content["camera"]
        width, height = map(_pixel_count, content["resolution"])
        image: dict[str, Any] = {"width": width, "height": height}
        if "sensor_size" in content:
            image["sensor_size"] = pair(content["sensor_size"])
        if "principal_point" in camera:
            image["principal_point"] = pair(camera["principal_point"])
        return _lens_of(camera).read(camera, image)
    except KeyError as error:
        raise UserError(f"{error.args[0]}: is missing; the lens needs it") from None
    except (TypeError, ValueError, IndexError, ArithmeticError) as error:
        raise UserError(f"camera, resolution or sensor_size: {error}") from None


def _pixel_count(side: Any) -> int:
    """Return an image's side. 96.0 is a whole number, too."""
    is_number = isinstance(side, int | float) and not isinstance(side, bool)
    if not is_number or side % 1 or not 1 <= side <= MOST_PIXELS:
        raise UserError(
            f"resolution: is {side!r}; must be two whole numbers of pixels from 1 to {MOST_PIXELS}"
        )
    return int(side)


def _lens_of(camera: Mapping[str, Any]) -> type[Lens]:
    if camera["type"] not in ("PERSP", "PANO"):
        raise UserError(f"camera.type: {camera['type']!r} is neither PERSP nor PANO")
    kind = "PERSP" if camera["type"] == "PERSP" else camera["panorama_type"]
    for lens in LENSES.values():
        if kind in lens.camera_types:
            return lens
    raise UserError(f"camera.panorama_type: {kind!r} is not a lens of this program")
