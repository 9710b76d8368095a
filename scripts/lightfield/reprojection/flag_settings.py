"""Reads the flags of `flags`, which can replace the settings file of a reprojection."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import InstanceOf, TypeAdapter

from lightfield.configuration.reprojections import MOST_SAMPLES, Reprojection
from lightfield.core.cli import check_settings
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.settings import checked, read_settings
from lightfield.formats.lightfield import LightField
from lightfield.geometry.lenses import LENSES, Lens
from lightfield.geometry.lenses.base import named_numbers
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.reprojection.filters import DEFAULT_FILTER
from lightfield.reprojection.flags import add_lens_map_flags, add_reproject_flags

# The longest side of an image, or of a cube map's strip of faces.
_MOST_PIXELS = 2**19


class FlagSettings(Reprojection):
    """Settings with a lens that a scene YAML's camera may not be able to describe.

    Flags give angles in radians. --no-reproject with --scale gives the source's lens in another
    size.
    """

    output_lens: InstanceOf[Lens]

    def lens(self, source: Lens) -> Lens:
        return self.output_lens


# The only adapter of these settings, because an adapter takes long to build its validator.
_FLAG_SETTINGS = TypeAdapter(FlagSettings)


def read_source(arguments: argparse.Namespace) -> tuple[LightField, Lens]:
    """Return the light field and lens that `flags.add_configuration_flags` asks for."""
    if arguments.no_configs:
        if arguments.input_cfg:
            raise UserError("--no-configs: excludes --input-cfg")
        width, height = _size(arguments.no_configs, "--no-configs")
        lens = _lens(arguments, "i-", width, height)
        if lens is None:
            raise UserError("--no-configs: needs the input lens, one of the flags --i-…")
        return LightField(lens.to_lightfield(), ()), lens
    if _lens(arguments, "i-", 6, 1) is not None:
        raise UserError("--i-…: the input lens comes from --input-cfg; or give --no-configs")
    if not arguments.input_cfg:
        raise UserError("--input-cfg: is missing; without one, give --no-configs and --i-…")
    path: Path = arguments.input_cfg
    content = read_json(path)
    if isinstance(content, dict) and "frames" not in content:
        lightfield = LightField(content, (), path)
    else:
        lightfield = LightField.read(path)
    return lightfield, lightfield.lens


def lens_map_settings(arguments: argparse.Namespace, source: Lens) -> Reprojection:
    """Return the settings of a lens map, from --settings or from the flags."""
    check_settings(arguments, add_lens_map_flags)
    if arguments.settings:
        return read_settings(Reprojection, arguments.settings)
    return _of_flags(_lens_map_content(arguments, source))


def reproject_settings(arguments: argparse.Namespace, source: Lens) -> Reprojection:
    """Return the settings of a reprojection, from --settings or from the flags."""
    check_settings(arguments, add_reproject_flags)
    if arguments.settings:
        settings = read_settings(Reprojection, arguments.settings)
        if not settings.formats:
            raise UserError(f"{arguments.settings}: formats: must be a list of exr, png, or both")
        return settings
    content = _lens_map_content(arguments, source)
    content["formats"] = [name for name in ("exr", "png") if getattr(arguments, name)]
    if not content["formats"]:
        raise UserError("--exr, --png: give one of them, or both")
    for name in ("bits", "exposure", "reinhard", "mask", "passes"):
        content[name] = getattr(arguments, name)
    if arguments.depth_png is not None:
        content["depth_png"] = arguments.depth_png
    return _of_flags(content)


def _of_flags(content: Mapping[str, Any]) -> Reprojection:
    return checked(_FLAG_SETTINGS, dict(content), "flags")


def _lens_map_content(arguments: argparse.Namespace, source: Lens) -> dict[str, Any]:
    """Return the part of the settings that a lens map depends on."""
    if not 1 <= arguments.samples <= MOST_SAMPLES:
        raise UserError(f"--samples {arguments.samples}: must be from 1 to {MOST_SAMPLES}")
    return {
        "output_lens": _output_lens(arguments, source),
        "cube_map": arguments.cubemap is not None,
        "rotation": _numbers(arguments.rotation, "--rotation", "PAN,PITCH,ROLL"),
        # The adaptive filter covers the pixel by itself. With --samples, use SILVR's default.
        "filter": arguments.filter or (DEFAULT_FILTER if arguments.samples == 1 else "bicubic"),
        "samples": arguments.samples,
    }


def _output_lens(arguments: argparse.Namespace, source: Lens) -> Lens:
    width, height = _output_size(arguments, source)
    if arguments.cubemap is not None:
        if arguments.no_reproject:
            raise UserError("--no-reproject: excludes an output lens")
        if not 1 <= arguments.cubemap <= _MOST_PIXELS // 6:
            raise UserError(
                f"--cubemap {arguments.cubemap}: must be from 1 to {_MOST_PIXELS // 6} pixels"
            )
        return CubeMap(width=6 * arguments.cubemap, height=arguments.cubemap).face
    lens = _lens(arguments, "", width, height)
    if arguments.no_reproject:
        if lens is not None:
            raise UserError("--no-reproject: excludes an output lens")
        return source.resized(width, height)
    if lens is None:
        raise UserError("--rectilinear, …: give the output lens, or --no-reproject")
    return lens


def _output_size(arguments: argparse.Namespace, source: Lens) -> tuple[int, int]:
    """Return the width and height that --output-resolution or --scale gives."""
    if arguments.output_resolution:
        return _size(arguments.output_resolution, "--output-resolution")
    width = int(source.width * arguments.scale)
    height = int(source.height * arguments.scale)
    if min(width, height) < 1:
        raise UserError(f"--scale {arguments.scale:g}: leaves no pixel")
    if max(width, height) > _MOST_PIXELS:
        raise UserError(f"--scale {arguments.scale:g}: makes a side of over {_MOST_PIXELS}")
    return width, height


def _lens(arguments: argparse.Namespace, prefix: str, width: int, height: int) -> Lens | None:
    """Return the lens that a flag gives, at ``width`` × ``height``. None without such a flag."""
    if prefix and arguments.i_cubemap:
        return CubeMap(width=width, height=height)
    attribute_prefix = prefix.replace("-", "_")
    for lens in LENSES.values():
        text = getattr(arguments, attribute_prefix + lens.name, None)
        if text is not None:
            try:
                return lens.from_flag(text, width, height)
            except UserError as error:
                raise UserError(f"--{prefix}{lens.flag()} {text}: {error}") from None
    return None


def _numbers(text: str, flag: str, form: str) -> list[float]:
    try:
        return list(named_numbers(text, form).values())
    except UserError as error:
        raise UserError(f"{flag} {text}: {error}") from None


def _size(text: str, flag: str) -> tuple[int, int]:
    width, height = _numbers(text, flag, "WIDTH,HEIGHT")
    if not all(side.is_integer() and 1 <= side <= _MOST_PIXELS for side in (width, height)):
        raise UserError(f"{flag} {text}: must be two whole numbers from 1 to {_MOST_PIXELS}")
    return int(width), int(height)
