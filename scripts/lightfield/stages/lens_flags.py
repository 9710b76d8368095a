"""The flags of scripts/reproject.py and scripts/lens_map.py, in the words of SILVR's tool.

Lengths are in mm. Angles of lenses are in radians, or in degrees as in 120deg. A rotation is in
degrees. The flags for the output stand for a settings file.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, Field, InstanceOf, create_model

from lightfield.configuration.reprojections import (
    DEFAULT_FILTER,
    MOST_SAMPLES,
    Filter,
    Reprojection,
)
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.engine.flags import checked_flags
from lightfield.engine.stage import ByHand, option, reads
from lightfield.geometry.lenses import LENSES, Lens
from lightfield.geometry.lenses.base import MOST_PIXELS, named_numbers
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging.blender_looks import LOOK_FLAG, LookName
from lightfield.settings.types import REINHARD, Stops, White

if TYPE_CHECKING:
    from lightfield.formats.lightfield import LightField

_LENGTHS = "Lengths in mm, angles in radians, or in degrees as in 120deg"
_INPUT = f"Input lens, with --no-configs. {_LENGTHS}"
_OUTPUT = f"Output lens. {_LENGTHS}"
# SILVR's flags for three of the filters.
_FILTERS = {"nn": "nearest", "bl": "bilinear", "bc": "bicubic"}


def _lens_flags(prefix: str, group: str) -> dict[str, Any]:
    """Return a field for the flag of each lens. Each flag excludes the others."""
    return {
        prefix + lens.name: (
            str | None,
            option(lens.title, None, metavar=lens.form, group=group, one_of=group),
        )
        for lens in LENSES.values()
        if lens.form
    }


_InputLens: type[BaseModel] = create_model("_InputLens", **_lens_flags("i_", _INPUT))


class Source(_InputLens):
    """The lens and the poses of the images that are reprojected."""

    input_cfg: Path | None = reads(
        "lightfield.json of the images", None, metavar="JSON", group="Configuration"
    )
    no_configs: str | None = option(
        "size of images that have no lightfield.json; a flag --i-… then gives their lens",
        None,
        metavar="WIDTH,HEIGHT",
        group="Configuration",
    )
    i_cubemap: bool = option(
        "six faces of a cube, <name>_f, _b, _l, _r, _u and _d; the size of the images is 6 × N, N",
        False,
        group=_INPUT,
        one_of=_INPUT,
    )

    def read(self) -> "tuple[LightField, Lens]":
        """Return the light field and the lens of the images."""
        from lightfield.formats.lightfield import LightField

        if self.no_configs:
            if self.input_cfg:
                raise UserError("--no-configs: excludes --input-cfg")
            width, height = _size(self.no_configs, "--no-configs")
            lens = self._lens(width, height)
            if lens is None:
                raise UserError("--no-configs: needs the input lens, one of the flags --i-…")
            return LightField(lens.to_lightfield(), ()), lens
        if self._lens(6, 1) is not None:
            raise UserError("--i-…: the input lens comes from --input-cfg; or give --no-configs")
        if not self.input_cfg:
            raise UserError("--input-cfg: is missing; without one, give --no-configs and --i-…")
        content = read_json(self.input_cfg)
        if isinstance(content, dict) and "frames" not in content:
            lightfield = LightField(content, (), self.input_cfg)
        else:
            lightfield = LightField.read(self.input_cfg)
        return lightfield, lightfield.lens

    def _lens(self, width: int, height: int) -> Lens | None:
        if self.i_cubemap:
            return CubeMap(width=width, height=height)
        return _given_lens(self, "i_", width, height)


class FlagSettings(Reprojection):
    """Settings with a lens that a scene YAML's camera may not be able to describe.

    Flags give angles in radians. --no-reproject with --scale gives the source's lens in another
    size.
    """

    output_lens: InstanceOf[Lens]

    def lens(self, source: Lens) -> Lens:
        return self.output_lens


_OutputLens: type[ByHand] = create_model("_OutputLens", __base__=ByHand, **_lens_flags("", _OUTPUT))


class LensMapFlags(_OutputLens):
    """The output lens and how it is sampled."""

    cubemap: Annotated[int, Field(ge=1, le=MOST_PIXELS // 6)] | None = option(
        "six perspective faces of 90°, each SIZE × SIZE pixels",
        None,
        metavar="SIZE",
        group=_OUTPUT,
        one_of=_OUTPUT,
    )
    no_reproject: bool = option("keep the input lens", False, group="Output optics")
    rotation: str = option(
        "turn the camera to the left, down and clockwise, in degrees",
        "0,0,0",
        metavar="PAN,PITCH,ROLL",
        group="Output optics",
    )
    scale: Annotated[float, Field(gt=0, allow_inf_nan=False)] = option(
        "size of the output, relative to the size of the input", 1.0, group="Output optics"
    )
    output_resolution: str | None = option(
        "size of the output in pixels, instead of --scale",
        None,
        metavar="WIDTH,HEIGHT",
        group="Output optics",
    )
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] = option(
        "n × n samples per pixel", 1, short=["-s"], group="Sampling"
    )
    nn: bool = option("--filter nearest", False, group="Sampling", one_of="filter")
    bl: bool = option("--filter bilinear", False, group="Sampling", one_of="filter")
    bc: bool = option("--filter bicubic", False, group="Sampling", one_of="filter")
    filter: Filter | None = option(
        f"filter (default: {DEFAULT_FILTER}, or bicubic with --samples)",
        None,
        group="Sampling",
        one_of="filter",
    )

    def settings(self, given: Mapping[str, Any]) -> Reprojection:
        return checked_flags(FlagSettings, self._content(given))

    def _content(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the part of the settings that a lens map depends on."""
        fields = {name: given[name] for name in Source.model_fields if name in given}
        _, source = Source(**fields).read()
        return {
            "output_lens": self._output_lens(source),
            "cube_map": self.cubemap is not None,
            "rotation": _numbers(self.rotation, "--rotation", "PAN,PITCH,ROLL"),
            "filter": self._filter(),
            "samples": self.samples,
        }

    def _filter(self) -> str:
        for flag, name in _FILTERS.items():
            if getattr(self, flag):
                return name
        # The adaptive filter covers the pixel by itself. With --samples, use SILVR's default.
        return self.filter or (DEFAULT_FILTER if self.samples == 1 else "bicubic")

    def _output_lens(self, source: Lens) -> Lens:
        width, height = self._output_size(source)
        lens = _given_lens(self, "", width, height)
        if self.no_reproject:
            if lens is not None or self.cubemap is not None:
                raise UserError("--no-reproject: excludes an output lens")
            return source.resized(width, height)
        if self.cubemap is not None:
            return CubeMap(width=6 * self.cubemap, height=self.cubemap).face
        if lens is None:
            raise UserError("--rectilinear, …: give the output lens, or --no-reproject")
        return lens

    def _output_size(self, source: Lens) -> tuple[int, int]:
        """Return the width and height that --output-resolution or --scale gives."""
        if self.output_resolution:
            return _size(self.output_resolution, "--output-resolution")
        width = int(source.width * self.scale)
        height = int(source.height * self.scale)
        if min(width, height) < 1:
            raise UserError(f"--scale {self.scale:g}: leaves no pixel")
        if max(width, height) > MOST_PIXELS:
            raise UserError(f"--scale {self.scale:g}: makes a side of over {MOST_PIXELS}")
        return width, height


_FILES = "Files of each view"


class ReprojectFlags(LensMapFlags):
    """The output lens, the files, and their colour."""

    exr: bool = option("write EXR images with colour and depth", False, group=_FILES)
    png: bool = option("write PNG images with colour in sRGB", False, group=_FILES)
    bits: Literal[8, 16] = option("bits per channel of a PNG", 8, group=_FILES)
    depth_png: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = option(
        "write 16-bit depth maps, <name>_depth.png: depth in metres × SCALE, and 0 where there is "
        "no depth, or more than 65535 steps",
        None,
        metavar="SCALE",
        group=_FILES,
    )
    mask: bool = option(
        "write masks, dynamic_mask_<name>.png: 255 where the input does not see the pixel",
        False,
        group=_FILES,
    )
    passes: list[str] = option(
        "also reproject these passes, from the folders beside --input-cfg to --output-dir/<pass>/",
        [],
        metavar="NAME,…",
        commas=True,
        group=_FILES,
    )
    exposure: Stops = option("exposure in stops", 0.0, group="Colour")
    reinhard: White = option(
        f"tone mapping: the {REINHARD}",
        1.0,
        group="Colour",
    )

    look: LookName = option(LOOK_FLAG, None, group="Colour")

    def settings(self, given: Mapping[str, Any]) -> Reprojection:
        formats = [name for name in ("exr", "png") if getattr(self, name)]
        if not formats:
            raise UserError("--exr, --png: give one of them, or both")
        content = self._content(given) | {"formats": formats}
        for name in ("bits", "exposure", "reinhard", "mask", "passes"):
            content[name] = getattr(self, name)
        for name in ("depth_png", "look"):
            if getattr(self, name) is not None:
                content[name] = getattr(self, name)
        return checked_flags(FlagSettings, content)


def _given_lens(flags: BaseModel, prefix: str, width: int, height: int) -> Lens | None:
    """Return the lens that a flag gives, at ``width`` × ``height``. None without such a flag."""
    for lens in LENSES.values():
        text = getattr(flags, prefix + lens.name, None)
        if text is not None:
            try:
                return lens.from_flag(text, width, height)
            except UserError as error:
                flag = prefix.replace("_", "-") + lens.flag()
                raise UserError(f"--{flag} {text}: {error}") from None
    return None


def _numbers(text: str, flag: str, form: str) -> list[float]:
    try:
        return list(named_numbers(text, form).values())
    except UserError as error:
        raise UserError(f"{flag} {text}: {error}") from None


def _size(text: str, flag: str) -> tuple[int, int]:
    width, height = _numbers(text, flag, "WIDTH,HEIGHT")
    if not all(side.is_integer() and 1 <= side <= MOST_PIXELS for side in (width, height)):
        raise UserError(f"{flag} {text}: must be two whole numbers from 1 to {MOST_PIXELS}")
    return int(width), int(height)
