"""The base classes of lenses: pixels to rays and back, and how lenses are read and written.

The camera looks along −Z with +Y up and +X right. Pixel coordinates run right (x) and down (y) from
the image's top left corner. Pixel centres are at (i + 0.5). θ is a ray's angle from the optical
axis, and r is the distance from the principal point. Conventions follow Blender's Cycles, measured
on its Position pass with bpy 5.0.1:

- equidistant: on a non-square image the image circle is an ellipse that touches all four edges.
  The sensor plays no part. The same holds for all lenses that only a field of view describes.
- equisolid and polynomial: r is in millimetres on the sensor, so circles stay circles when the
  sensor's pixels are square.
- polynomial: θ = −(k0 + k1 r + k2 r² + k3 r³ + k4 r⁴). A usual lens has k1 < 0; k1 > 0 turns the
  image by 180°.
- equirectangular: longitude grows to the right, latitude upwards, (0, 0) is the optical axis.

float32 input gives float32 output; all other input gives float64. NaN marks a pixel without a ray,
which lies outside the image circle, and a ray that the lens does not see. A lens extends beyond the
image's frame: a caller that reads pixels must check that they lie in [0, width] × [0, height].
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from lightfield.core.errors import UserError
from lightfield.settings.base import Settings, as_list

Array = npt.NDArray[Any]
Pair = tuple[float, float]

SENSOR_WIDTH = 36.0  # mm, Blender's default
# Blender keeps angles in float32, whose π, π/2 and 2π exceed the true ones by less than this.
ANGLE_SLACK = 1e-6

LENSES: dict[str, "type[Lens]"] = {}
"""All lenses by their names."""

# The longest side of an image, or of a cube map's strip of faces.
MOST_PIXELS = 2**19
Pixels = Annotated[int, Field(ge=1, le=65536)]
Place = Annotated[float, Field(ge=-1e6, le=1e6)]
_Millimetres = Annotated[float, Field(ge=1e-3, le=1e6)]
FocalLength = Annotated[
    _Millimetres, Field(description="Focal length of the lens.", json_schema_extra={"unit": "mm"})
]


class LensSettings(Settings):
    """A camera's lens and image in a scene YAML. Each lens adds its own keys.

    The lens itself checks what the schema cannot express. Its errors have the form
    ``key: what is wrong``.
    """

    lens: str
    resolution: Annotated[tuple[Pixels, Pixels], as_list(2)] = Field(
        description="Width and height of the image.", json_schema_extra={"unit": "pixels"}
    )
    sensor_size: _Millimetres | Annotated[tuple[_Millimetres, _Millimetres], as_list(2)] | None = (
        Field(
            None,
            description="Width of the sensor, or its width and height. Without this key, it is 36 "
            "mm wide, and pixels are square.",
            json_schema_extra={"unit": "mm"},
        )
    )
    principal_point: Annotated[tuple[Place, Place], as_list(2)] | None = Field(
        None,
        description="Where the optical axis meets the image, to the right and down from its top "
        "left corner. Without this key, it is the image's centre.",
        json_schema_extra={"unit": "pixels"},
    )

    @model_validator(mode="after")
    def _is_a_lens(self) -> Self:
        try:
            self.make()
        except UserError as error:
            raise ValueError(str(error)) from None
        return self

    def make(self) -> "Lens":
        """Return the lens."""
        width, height = self.resolution
        size = self.sensor_size
        if isinstance(size, float):
            size = (size, size * height / width)
        return LENSES[self.lens](
            width=width,
            height=height,
            sensor_size=size,
            principal_point=self.principal_point,
            **self.optics(),
        )

    def optics(self) -> dict[str, Any]:
        """Return the lens's own parameters, in mm and radians."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Lens(ABC):
    """A projection on an image.

    - ``width``: the image's width in pixels.
    - ``height``: the image's height in pixels.
    - ``sensor_size``: the sensor's width and height in mm. By default, it is 36 mm wide, and pixels
      are square.
    - ``principal_point``: in pixels. By default, it is the image's centre.

    The class of each lens defines:

    - ``name``: its name in a scene YAML, and its flag on the command line;
    - ``title``: its name for people;
    - ``camera_types``: its ``panorama_type`` in lightfield.json, or its ``type`` for a perspective
      camera. The first is written, all are read;
    - ``in_cycles``: whether Cycles has it. A shader renders the others that are `RadialLens`;
    - ``focuses_on_plane``: whether what is in focus is a plane, as for perspective lenses, or else
      a sphere around the camera;
    - ``Settings``: its keys in a scene YAML, or None if a scene YAML cannot have it;
    - ``form``: the numbers of its flag, in mm and radians. Numbers in brackets are optional.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    camera_types: ClassVar[tuple[str, ...]]
    in_cycles: ClassVar[bool] = False
    focuses_on_plane: ClassVar[bool] = False
    Settings: ClassVar[type[LensSettings] | None] = None
    form: ClassVar[str | None] = None

    width: int
    height: int
    sensor_size: Pair | None = None
    principal_point: Pair | None = None

    def __init_subclass__(cls) -> None:
        if "name" in vars(cls):
            LENSES[cls.name] = cls

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise UserError(f"resolution: {self.width} × {self.height} is not an image")
        if not all(0.0 < side < math.inf for side in self.sensor):
            raise UserError(f"sensor_size: {list(self.sensor)} must be positive millimetres")
        # `resized` multiplies it, which must not overflow.
        if not all(abs(coordinate) < 1e99 for coordinate in self.center):
            raise UserError(
                f"principal_point: {list(self.center)} must be finite pixels, below 1e99"
            )

    def __getstate__(self) -> dict[str, Any]:
        # What was computed from the fields may hold functions, which go to no other process.
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def sensor(self) -> Pair:
        """The sensor's width and height in mm."""
        return self.sensor_size or (SENSOR_WIDTH, SENSOR_WIDTH * self.height / self.width)

    @property
    def center(self) -> Pair:
        """The principal point in pixels."""
        return self.principal_point or (self.width / 2, self.height / 2)

    @property
    def K(self) -> npt.NDArray[np.float64]:  # noqa: N802, its name everywhere
        """The intrinsic matrix (3, 3) of a perspective lens, in pixels.

        K (x, y, z) = z (column, row, 1), with x right, y down and z forward, as in OpenCV: y and z
        are the negatives of this camera's. The first pixel's centre is (0.5, 0.5). For programs
        whose first centre is (0, 0), such as OpenCV, subtract 0.5 from K[0, 2] and K[1, 2].
        Raises `UserError` for all other lenses.
        """
        raise UserError(
            f"K: no matrix describes this lens ({self.description}); use its rays and pixels, or a "
            "perspective reprojection"
        )

    @property
    def description(self) -> str:
        """The projection and its field of view, for people."""
        return self.title

    @property
    @abstractmethod
    def has_z_depth(self) -> bool:
        """Whether every ray has cos θ ≥ 0, so that Z-depth can hold its depth."""

    @property
    def usual_depth(self) -> str:
        """The depth that views store by default: "z" if all rays have it, or else "distance"."""
        return "z" if self.has_z_depth else "distance"

    @property
    def field_of_view(self) -> Pair:
        """The angles in radians that the image spans across and down, through `center`."""
        x, y = self.center
        across = self.rays(np.linspace(0, self.width, 513), y)
        down = self.rays(x, np.linspace(0, self.height, 513))
        return _angle_along(across), _angle_along(down)

    @property
    def clipped(self) -> str | None:
        """What part of the image has no ray because the lens's equation ends, for people.

        None if it has none for another reason, such as `fov`, and for lenses without such an end.
        """
        return None

    @property
    def mirrors(self) -> tuple[bool, bool]:
        """Whether the lower half mirrors the upper half, and the right half the left half."""
        return False, False

    def rays(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Array:
        """Return unit rays (..., 3) of the pixel coordinates ``x``, ``y`` (...).

        NaN where the lens has no ray.
        """
        x, y = _as_float(x, y)
        # At least one dimension, because numpy computes with scalars in float64.
        rays = self._rays(np.atleast_1d(x), np.atleast_1d(y))
        return rays.astype(x.dtype, copy=False).reshape(*np.broadcast_shapes(x.shape, y.shape), 3)

    def pixels(self, rays: npt.ArrayLike) -> Array:
        """Return the pixel coordinates (..., 2) of ``rays`` (..., 3) of any length above zero.

        NaN where the lens does not see the ray. Coordinates may lie outside the frame.
        """
        (array,) = _as_float(rays)
        # A coordinate beyond float32 becomes infinite: a miss.
        with np.errstate(over="ignore"):
            pixels = self._pixels(np.atleast_2d(array)).astype(array.dtype, copy=False)
        missed = ~np.isfinite(pixels[..., 0] + pixels[..., 1])
        if missed.any():
            pixels[missed] = np.nan
        return pixels.reshape(*array.shape[:-1], 2)

    def in_frame(self, pixels: Array) -> npt.NDArray[np.bool_]:
        """Return which pixel coordinates (..., 2) lie in the image. NaN does not."""
        return np.asarray(((pixels >= 0) & (pixels < (self.width, self.height))).all(axis=-1))

    def pixel_rays(self, dtype: npt.DTypeLike = np.float64) -> Array:
        """Return the unit rays (height, width, 3) of all pixels' centres."""
        x, y = (np.arange(side, dtype=dtype) + 0.5 for side in (self.width, self.height))
        return self.rays(x[None, :], y[:, None])

    @abstractmethod
    def _rays(self, x: Array, y: Array) -> Array:
        """Return the unit `rays` of arrays that have one dtype and broadcast against each other."""

    @abstractmethod
    def _pixels(self, rays: Array) -> Array:
        """Return the `pixels` of an array. NaN or inf in one coordinate marks a miss."""

    def resized(self, width: int, height: int) -> Self:
        """Return the lens with the same field of view and another number of pixels."""
        center = self.principal_point and (
            self.principal_point[0] * width / self.width,
            self.principal_point[1] * height / self.height,
        )
        return replace(
            self, width=width, height=height, sensor_size=self.sensor, principal_point=center
        )

    def fitted(self, side: int) -> Self:
        """Return the lens at a resolution whose longer side is at most ``side``."""
        scale = min(1.0, side / max(self.width, self.height))
        return self.resized(max(1, round(self.width * scale)), max(1, round(self.height * scale)))

    def to_lightfield(self) -> dict[str, Any]:
        """Return ``camera``, ``resolution`` and ``sensor_size`` as lightfield.json has them."""
        kind = self.camera_types[0]
        names = {"type": "PERSP"} if kind == "PERSP" else {"type": "PANO", "panorama_type": kind}
        camera = {**names, **self._to_camera()}
        if self.principal_point is not None:
            camera["principal_point"] = list(self.principal_point)
        return {
            "camera": camera,
            "resolution": [self.width, self.height],
            "sensor_size": list(self.sensor),
        }

    def _to_camera(self) -> dict[str, Any]:
        """Return the lens's own keys in the ``camera`` mapping of lightfield.json."""
        return {}

    def settings(self) -> dict[str, Any]:
        """Return the mapping ``camera`` that describes this lens in a scene YAML."""
        camera: dict[str, Any] = {"lens": self.name, "resolution": [self.width, self.height]}
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None or field.name in ("width", "height"):
                continue
            is_angle = field.name in ("fov", "longitude", "latitude")
            values = value if isinstance(value, tuple) else (value,)
            numbers = [_degrees(number) if is_angle else number for number in values]
            camera[field.name] = numbers if isinstance(value, tuple) else numbers[0]
        return camera

    @classmethod
    def read(cls, camera: Mapping[str, Any], image: Mapping[str, Any]) -> Self:
        """Return the lens of a ``camera`` mapping of lightfield.json.

        ``image`` holds the fields that all lenses share, if the file has them. Raises KeyError for
        a missing key, and TypeError, ValueError or `UserError` for a wrong value.
        """
        return cls(**image, **cls._from_camera(camera))

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        """Return the lens's own parameters, as `_to_camera` or SILVR's tools wrote them."""
        return {}

    @classmethod
    def flag(cls) -> str:
        """Return the lens's flag on the command line, without its dashes."""
        return cls.name.replace("_", "-")

    @classmethod
    def from_flag(cls, text: str, width: int, height: int) -> Self:
        """Return the lens that a flag's numbers describe. Raises `UserError` for another form."""
        assert cls.form is not None
        numbers = named_numbers(text, cls.form)
        sensor = numbers.pop("SENSOR_WIDTH", None)
        size = None if sensor is None else (sensor, sensor * height / width)
        return cls(width=width, height=height, sensor_size=size, **cls._from_flag(numbers))

    @classmethod
    def _from_flag(cls, numbers: Mapping[str, float]) -> dict[str, Any]:
        """Return the lens's own parameters, from its flag's numbers by their names in `form`."""
        return {name.lower(): number for name, number in numbers.items()}


class RadialLens(Lens):
    """A lens whose r depends on θ alone. r is in the units of `_unit`.

    u runs right and v runs up from the principal point, in the same units. A lens that is not quite
    radial overrides `_bent` and `_unbent`.
    """

    @property
    @abstractmethod
    def _unit(self) -> Pair:
        """A pixel's width and height, in the unit of r."""

    @property
    @abstractmethod
    def _limit(self) -> float:
        """The largest r of the lens."""

    @abstractmethod
    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        """Return sin θ and cos θ at r."""

    @abstractmethod
    def _radius(self, sin: Array, cos: Array) -> Array:
        """Return r at θ, given as sin θ ≥ 0 and cos θ. NaN where the lens has none."""

    def _unbent(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return where the image's points (u, v) would lie if nothing but θ moved them."""
        return u, v

    def _bent(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return the image's points of (u, v), as `_unbent` does in the other direction."""
        return u, v

    def _rays(self, x: Array, y: Array) -> Array:
        u = (x - self.center[0]) * self._unit[0]
        v = (self.center[1] - y) * self._unit[1]
        u, v = self._unbent(u, v)
        r = np.hypot(u, v)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            sin, cos = self._sin_cos(r)
            # One plane after the other: numpy fills these much faster than vectors.
            ray = np.stack([sin * (u / r), sin * (v / r), -cos])
            # The azimuth at r = 0 matters only if θ(0) ≠ 0. There Cycles uses "up".
            axis = r == 0
            ray[0, axis] = 0
            ray[1, axis] = sin[axis]
            outside = ~((r <= self._limit * slack(x.dtype)) & np.isfinite(r))
        np.copyto(ray, np.nan, where=outside)
        return np.moveaxis(ray, 0, -1)

    def _pixels(self, rays: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            # Scale by the largest component: no overflow, and NaN for a ray of length 0 or inf.
            x, y, z = np.moveaxis(rays, -1, 0)
            largest = np.maximum(np.maximum(np.abs(x), np.abs(y)), np.abs(z))
            x, y, z = x / largest, y / largest, z / largest
            side = np.hypot(x, y)
            length = np.hypot(side, z)
            r = self._radius(side / length, -z / length)
            r = np.where(np.abs(r) <= self._limit * slack(rays.dtype), r, np.nan)
            u = r * (x / side)
            v = r * (y / side)
            # The azimuth of the axis matters only behind the camera. It is "up" there, too.
            axis = side == 0
            u[axis] = 0
            v[axis] = r[axis]
            u, v = self._bent(u, v)
            pixels = np.stack(
                [self.center[0] + u / self._unit[0], self.center[1] - v / self._unit[1]]
            )
        return np.moveaxis(pixels, 0, -1)

    @property
    def mirrors(self) -> tuple[bool, bool]:
        return self.center[1] == self.height / 2, self.center[0] == self.width / 2

    @property
    def has_z_depth(self) -> bool:
        with np.errstate(invalid="ignore"):
            return bool(self._sin_cos(np.asarray(self._limit))[1] >= -ANGLE_SLACK)

    def _pixel_size(self, length: float = 1.0) -> Pair:
        """Return a pixel's width and height on the sensor, in lengths of ``length`` mm."""
        return (self.sensor[0] / self.width / length, self.sensor[1] / self.height / length)


class FisheyeSettings(LensSettings):
    """A fisheye in a scene YAML."""

    fov: float

    def optics(self) -> dict[str, Any]:
        return {"fov": math.radians(self.fov)}


def fov_up_to(largest: float, default: Any = ...) -> Any:
    """Return the field `fov` of a fisheye's settings, of at most ``largest`` degrees."""
    return Field(
        default,
        gt=0,
        le=largest,
        description="Full field of view: the angle from one edge of the image circle to the "
        "opposite edge.",
        json_schema_extra={"unit": "degrees"},
    )


@dataclass(frozen=True, kw_only=True)
class Fisheye(RadialLens):
    """A lens that sees up to ``fov`` / 2 radians from its axis."""

    largest_fov: ClassVar[float] = 360.0  # degrees

    fov: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.fov <= math.radians(self.largest_fov) + ANGLE_SLACK:
            raise UserError(
                f"fov: {math.degrees(self.fov):g} degrees is not within 0 to "
                f"{self.largest_fov:g}, the {self.title}'s limit"
            )

    @property
    def description(self) -> str:
        return f"{self.title}, {math.degrees(self.fov):.4g}°"

    def _to_camera(self) -> dict[str, Any]:
        return {"fisheye_fov": self.fov}

    @classmethod
    def _from_camera(cls, camera: Mapping[str, Any]) -> dict[str, Any]:
        return {"fov": float(camera["fisheye_fov"])}


@dataclass(frozen=True, kw_only=True)
class CircleFisheye(Fisheye):
    """A fisheye whose image circle (radius 1) touches the image's edges."""

    form = "FOV"

    @property
    def _unit(self) -> Pair:
        return (2 / self.width, 2 / self.height)

    @property
    def _limit(self) -> float:
        return 1.0


def checked_focal_length(focal_length: float) -> None:
    if not 0.0 < focal_length < math.inf:
        raise UserError(f"focal_length: {focal_length:g} must be positive millimetres")


def checked_coefficients(coefficients: Sequence[float], count: int, names: str) -> None:
    if len(coefficients) != count or not all(k == 0 or 1e-99 < abs(k) < 1e99 for k in coefficients):
        raise UserError(
            f"coefficients: {list(coefficients)} must be {count} numbers, {names}, "
            "each 0 or of a size from 1e-99 to 1e99"
        )


def slack(dtype: np.dtype[Any]) -> float:
    """Return the factor by which rounding may move a point on the rim outwards."""
    return 1.0 + 8.0 * float(np.finfo(dtype).eps)


def pair(values: Sequence[float]) -> Pair:
    """Return two numbers as floats."""
    first, second = values
    return float(first), float(second)


def named_numbers(text: str, form: str) -> dict[str, float]:
    """Return the comma-separated numbers of ``text`` by their names in ``form``.

    Names in brackets, as B in ``A[,B]``, may be missing. A form after a bar is ignored. Angles may
    end in ``deg``. Without it, angles of lenses are in radians. Raises `UserError` if ``text`` has
    another form.
    """
    names = re.findall(r"\w+", form.partition("|")[0])
    least = len(re.findall(r"\w+", form.partition("[")[0].partition("|")[0]))
    parts = text.split(",")
    try:
        values = [_number(part, name) for part, name in zip(parts, names, strict=False)]
    except ValueError:
        values = [math.nan]
    if not least <= len(parts) <= len(names) or not all(map(math.isfinite, values)):
        raise UserError(f"must have the form {form}")
    return dict(zip(names, values, strict=False))


def _number(text: str, name: str) -> float:
    """Return the number that a user wrote for ``name``. Raises ValueError for other text."""
    if not text.endswith("deg"):
        return float(text)
    if name in ("FOV", "LONG_MIN", "LONG_MAX", "LAT_MIN", "LAT_MAX"):
        return math.radians(float(text.removesuffix("deg")))
    if name in ("PAN", "PITCH", "ROLL"):
        return float(text.removesuffix("deg"))
    raise ValueError(f"{name} is not an angle")


def _angle_along(rays: Array) -> float:
    """Return the angle in radians along a line of unit ``rays`` (n, 3), NaN where there is none."""
    visible_rays = rays[np.isfinite(rays[:, 0])]
    chords = np.linalg.norm(np.diff(visible_rays, axis=0), axis=1)
    return float(2 * np.arcsin(chords / 2).sum())


def _degrees(radians: float) -> float:
    """Return an angle in degrees. Rounds off what Blender's float32 adds to a round angle."""
    degrees = math.degrees(radians)
    rounded = round(degrees, 3)
    return rounded if abs(math.radians(rounded) - radians) < ANGLE_SLACK else degrees


def _as_float(*arrays: npt.ArrayLike) -> list[Array]:
    """Return the arrays in float32 if all of them are, or else in float64."""
    all_float32 = all(np.asarray(array).dtype == np.float32 for array in arrays)
    dtype = np.float32 if all_float32 else np.float64
    return [np.asarray(array, dtype) for array in arrays]
