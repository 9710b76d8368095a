"""The settings of a simulated sensor, in a scene YAML and in the settings files of reprojections.

`lightfield.imaging.sensor` has the formulas, and `lightfield.reprojection.sensor` draws each view's
parameters.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, TypeAdapter, model_validator

from lightfield.core.names import VIEWS
from lightfield.imaging.blender_looks import LookName
from lightfield.settings.base import Settings, as_list, checked

# The files beside a view of a bracket, by their kinds.
BRACKET_FILES = {"clipped": "{view}_clipped.png", "weights": "{view}_weights.exr"}
# The views' exposures, in stops.
MOST_STOPS = 30.0
# PPISP's latent numbers of colour. Larger ones turn its matrix over.
MOST_COLOUR = 5.0
CHANNELS = 3
COLOURS = 8

Stops = Annotated[float, Field(ge=-MOST_STOPS, le=MOST_STOPS)]
Colour = Annotated[float, Field(ge=-MOST_COLOUR, le=MOST_COLOUR)]
Alpha = Annotated[float, Field(ge=-100, le=100)]
Place = Annotated[float, Field(ge=-1, le=1)]
_Alphas = Annotated[tuple[Alpha, Alpha, Alpha], as_list(3)]


def _increasing(brackets: list[float]) -> list[float]:
    if sorted(set(brackets)) != brackets:
        raise ValueError("must be a list of stops from the lowest to the highest, each once")
    return brackets


class Varied(Settings):
    """A number that differs from view to view: at random in a range, or by a random walk."""

    range: Annotated[tuple[float, float], as_list(2)] | None = Field(
        None, description="Smallest and largest value. Each view's value is drawn independently."
    )
    start: float | None = Field(
        None,
        description="Value of the first view, for a random walk with step. Without this key, it is "
        "0.",
    )
    step: Annotated[float, Field(gt=0, le=100)] | None = Field(
        None,
        description="Random walk: the standard deviation of the change from each view to the next, "
        "in the order of lightfield.json.",
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.range is None) == (self.step is None):
            raise ValueError("must have one of range and step")
        if self.range and self.range[0] > self.range[1]:
            raise ValueError("range: must have the least value first")
        if self.range and self.start is not None:
            raise ValueError("start: is only for step, not for range")
        return self

    def reaches_beyond(self, limit: float) -> bool:
        """Return whether a value that is given exceeds a ``limit`` on either side."""
        return max(map(abs, self.range or (self.start or 0.0,))) > limit


class Vignetting(Settings):
    """Light is multiplied by 1 + α₁r² + α₂r⁴ + α₃r⁶, limited to the range from 0 to 1."""

    alpha: _Alphas | Annotated[tuple[_Alphas, _Alphas, _Alphas], as_list(CHANNELS)] = Field(
        description="α₁, α₂ and α₃, or three such lists for red, green and blue. r is the distance "
        "from the centre, divided by the image's longer side.",
    )
    center: Annotated[tuple[Place, Place], as_list(2)] = Field(
        (0.0, 0.0),
        description="Centre of the vignetting, to the right and down from the image's middle.",
        json_schema_extra={"unit": "longer sides"},
    )

    @property
    def channels(self) -> tuple[tuple[float, ...], ...]:
        """Centre and alphas of each channel."""
        first = self.alpha[0]
        alphas: Any = self.alpha if isinstance(first, tuple) else [self.alpha] * CHANNELS
        return tuple((*self.center, *alpha) for alpha in alphas)


class Response(Settings):
    """The curve from linear light to the values of the image: a toe, a shoulder, and a gamma."""

    toe: float = Field(1.0, gt=0.3, le=20, description="Exponent for values below center.")
    shoulder: float = Field(1.0, gt=0.3, le=20, description="Exponent for values above center.")
    gamma: float = Field(
        1.0,
        gt=0.1,
        le=20,
        description="Exponent that is applied to the result. 0.4545 brightens it as sRGB does.",
    )
    center: float = Field(0.5, gt=0, lt=1, description="Value at which toe and shoulder meet.")

    @property
    def channels(self) -> tuple[tuple[float, ...], ...]:
        return ((self.toe, self.shoulder, self.gamma, self.center),) * CHANNELS


class Noise(Settings):
    """Noise of variance a · y + b, where the raw value y is 1 at saturation (Foi et al. 2008)."""

    a: float = Field(
        0.0,
        ge=0,
        le=1,
        description="Factor a, the noise of the light itself: 1 / the number of electrons at "
        "saturation.",
    )
    b: float = Field(
        0.0, ge=0, le=1, description="Offset b, the variance of the noise without light."
    )

    @model_validator(mode="after")
    def _has_noise(self) -> Self:
        if not (self.a or self.b):
            raise ValueError("must have a, b, or both above 0")
        if 0 < self.a < 1e-9:
            raise ValueError(f"a: is {self.a:g}; must be 0 or at least 1e-09")
        return self


class SensorOptions(Settings):
    """The options that a scene YAML shares with the programs' settings files."""

    exposure: Stops | Varied = Field(
        0.0,
        description="Exposure of all views, or how it varies from view to view.",
        json_schema_extra={"unit": "stops"},
    )
    vignetting: Vignetting | None = Field(
        None, description="How the image darkens toward its corners. It is the same in all views."
    )
    colour: (
        Annotated[
            tuple[Colour, Colour, Colour, Colour, Colour, Colour, Colour, Colour], as_list(COLOURS)
        ]
        | Varied
        | None
    ) = Field(
        None,
        description="Colour shift: PPISP's eight numbers, two each for blue, red, green and grey, "
        "or how each number varies.",
    )
    noise: Noise | None = Field(
        None, description="Noise of the sensor. Without this key, there is none."
    )
    response: Response | None = Field(
        None,
        description="Response curve, the same in all views. Without this key, it is sRGB's.",
    )
    look: LookName = None
    bits: int = Field(
        8,
        ge=1,
        le=16,
        description="Bits to which the sensor quantises. The PNG holds its values scaled to 8 "
        "bits, or to 16 if bits is above 8.",
        json_schema_extra={"unit": "bits"},
    )
    seed: int = Field(
        0, ge=0, le=2**63 - 1, description="Seed of the noise and of all values that vary."
    )

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        limits = {"exposure": MOST_STOPS, "colour": MOST_COLOUR}
        for key, limit in limits.items():
            value = getattr(self, key)
            if isinstance(value, Varied) and value.reaches_beyond(limit):
                raise ValueError(f"{key}: must be from {-limit:g} to {limit:g}")
        if self.look and self.response:
            raise ValueError("response: does not go with look, which stands in its place")
        return self


class SensorSettings(SensorOptions):
    """The sensor of one reprojection: the keys of the first table, and this one."""

    bracket: Stops | None = Field(
        None,
        description="Exposure of one bracket, relative to the sensor's exposure. With this key, "
        "clipping masks and weights are also written.",
        json_schema_extra={"unit": "stops"},
    )


class Sensor(SensorOptions):
    """Versions of the views as a sensor would record them. The clean views stay."""

    sources: list[str] = Field(
        [VIEWS],
        min_length=1,
        description="What the sensor is applied to: names of reprojections, or "
        f"`{VIEWS}` for the views as they were rendered. The folder of these views is sensor. The "
        "folder of perspective is perspective_sensor.",
    )
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs to whose views the sensor is applied. Without this key, all rigs.",
    )
    brackets: (
        Annotated[list[Stops], AfterValidator(_increasing), Field(min_length=2, max_length=32)]
        | None
    ) = Field(
        None,
        description="Exposure brackets: each value makes a folder of images (such as sensor_ev-2) "
        "with clipping masks and weights.",
        json_schema_extra={"unit": "stops"},
    )

    @model_validator(mode="after")
    def _can_be_merged(self) -> Self:
        if self.look and self.brackets:
            raise ValueError(
                "brackets: does not go with look, which cannot be undone to merge them"
            )
        return self

    def folders(self, source: str) -> dict[str, SensorSettings]:
        """Return the settings of a source's folders, by their names."""
        name = "sensor" if source == VIEWS else f"{source}_sensor"
        options = self.model_dump(include={*SensorOptions.model_fields}, exclude_none=True)
        if self.brackets is None:
            return {name: SensorSettings(**options)}
        return {
            f"{name}_ev{stops:g}": SensorSettings(**options, bracket=stops)
            for stops in self.brackets
        }


def settings_in(lightfield: Mapping[str, Any]) -> SensorSettings | None:
    """Return the settings in a reprojection's lightfield.json. None if it is not of a sensor."""
    match lightfield:
        case {"reprojection": {"sensor": content}}:
            return checked(TypeAdapter(SensorSettings), content, "reprojection.sensor")
    return None


def parameter_file(view: str) -> str:
    """Return the name of the file with a view's parameters."""
    return f"{view}.json"


def sensor_files(settings: SensorSettings, view: str) -> dict[str, str]:
    """Return the names of the files beside a view's PNG, by their kinds."""
    files = {"parameters": parameter_file(view)}
    if settings.bracket is not None:
        files |= {kind: name.format(view=view) for kind, name in BRACKET_FILES.items()}
    return files
