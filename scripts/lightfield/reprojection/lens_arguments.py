"""Command-line flags for a reprojection's geometry, in the words of SILVR's reprojection tool.

Lengths are in mm, the angles of lenses in radians or, as in 120deg, in degrees; a rotation is in
degrees.
"""

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.cli import above_zero
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.dataset.lightfield import LightField
from lightfield.geometry.lenses import LENSES, Array, Lens, from_camera
from lightfield.geometry.lenses.base import named_numbers
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.reprojection import lens_map
from lightfield.reprojection.filters import DEFAULT_FILTER, FILTERS

# Of an image's side: of a cube map's strip of faces, too.
MOST_PIXELS = 2**19
# Each way, of a pixel: as many as a scene YAML may have.
MOST_SAMPLES = 64


def add_geometry_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that `geometry` reads."""
    files = parser.add_argument_group("Configuration")
    files.add_argument("--input-cfg", type=Path, metavar="JSON", help="the images' lightfield.json")
    files.add_argument(
        "--no-configs", metavar="WIDTH,HEIGHT", help="size of the images, whose lens --i-… gives"
    )
    _add_lens_flags(parser, "i-", "Input lens, with --no-configs")
    _add_lens_flags(parser, "", "Output lens")
    optics = parser.add_argument_group("Output optics")
    optics.add_argument("--no-reproject", action="store_true", help="keep the input lens")
    optics.add_argument(
        "--rotation",
        default="0,0,0",
        metavar="PAN,PITCH,ROLL",
        help="turn the camera left, down and clockwise, degrees",
    )
    optics.add_argument(
        "--scale", type=above_zero, default=1.0, help="size over the input's, default 1"
    )
    optics.add_argument(
        "--output-resolution", metavar="WIDTH,HEIGHT", help="size, instead of --scale"
    )
    sampling = parser.add_argument_group("Sampling")
    sampling.add_argument("-s", "--samples", type=int, default=1, help="n × n samples a pixel")
    kind = sampling.add_mutually_exclusive_group()
    kind.add_argument("--nn", action="store_const", dest="filter", const="nearest")
    kind.add_argument("--bl", action="store_const", dest="filter", const="bilinear")
    kind.add_argument("--bc", action="store_const", dest="filter", const="bicubic")
    kind.add_argument(
        "--filter", choices=FILTERS, help=f"default {DEFAULT_FILTER}, or bicubic with --samples"
    )


def _add_lens_flags(parser: argparse.ArgumentParser, prefix: str, title: str) -> None:
    group = parser.add_argument_group(
        title, "Lengths in mm, angles in radians, or in degrees as in 120deg."
    )
    choice = group.add_mutually_exclusive_group()
    for lens in LENSES.values():
        if lens.form:
            choice.add_argument(f"--{prefix}{lens.flag()}", metavar=lens.form, help=lens.title)
    if prefix:
        choice.add_argument(
            "--i-cubemap",
            action="store_true",
            help="six faces <name>_f, _b, _l, _r, _u, _d; the size is 6 × N, N",
        )
    else:
        choice.add_argument(
            "--camera",
            metavar="JSON",
            help="a scene YAML's camera: lens, resolution and the lens's own keys, in degrees",
        )
        choice.add_argument(
            "--cubemap", type=int, metavar="SIZE", help="six perspective faces of 90°, SIZE² pixels"
        )


@dataclass(frozen=True)
class Target:
    """One image to make of each view: its lens, and how its rays turn into the source camera's.

    ``suffix`` is what its name has after the view's; ``rotation`` is (3, 3).
    """

    suffix: str
    lens: Lens
    rotation: Array


@dataclass(frozen=True)
class Geometry:
    """What the command line says of a reprojection's geometry; ``lightfield`` is the input's."""

    lightfield: LightField
    source: Lens
    targets: list[Target]
    filter: str
    samples: int
    # Pan, pitch and roll in degrees.
    rotation: list[float]

    def compute(self, target: Target) -> lens_map.LensMap:
        """Compute the lens map of one of the targets."""
        return lens_map.compute(
            self.source, target.lens, target.rotation, self.filter, self.samples
        )

    def settings(self, target: Target) -> dict[str, Any]:
        """Return what the lens map of one of the targets depends on."""
        return lens_map.settings(
            self.source, target.lens, target.rotation, self.filter, self.samples
        )


def geometry(arguments: argparse.Namespace) -> Geometry:
    """Read the flags of `add_geometry_flags`; a `UserError` names the one that is wrong."""
    if not 1 <= arguments.samples <= MOST_SAMPLES:
        raise UserError(f"--samples {arguments.samples}: must be from 1 to {MOST_SAMPLES}")
    lightfield, source = _source(arguments)
    return Geometry(
        lightfield=lightfield,
        source=source,
        targets=_targets(arguments, source),
        # The adaptive filter covers the pixel by itself; samples are those of SILVR's default.
        filter=arguments.filter or (DEFAULT_FILTER if arguments.samples == 1 else "bicubic"),
        samples=arguments.samples,
        rotation=_numbers(arguments.rotation, "--rotation", "PAN,PITCH,ROLL"),
    )


def _source(arguments: argparse.Namespace) -> tuple[LightField, Lens]:
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


def _targets(arguments: argparse.Namespace, source: Lens) -> list[Target]:
    if arguments.output_resolution:
        width, height = _size(arguments.output_resolution, "--output-resolution")
    else:
        width = int(source.width * arguments.scale)
        height = int(source.height * arguments.scale)
        if min(width, height) < 1:
            raise UserError(f"--scale {arguments.scale:g}: leaves no pixel")
        if max(width, height) > MOST_PIXELS:
            raise UserError(f"--scale {arguments.scale:g}: makes a side of over {MOST_PIXELS}")
    rotation = lens_map.rotation_matrix(
        *_numbers(arguments.rotation, "--rotation", "PAN,PITCH,ROLL")
    )
    if arguments.cubemap is not None:
        if arguments.no_reproject:
            raise UserError("--no-reproject: excludes an output lens")
        if not 1 <= arguments.cubemap <= MOST_PIXELS // 6:
            raise UserError(
                f"--cubemap {arguments.cubemap}: must be from 1 to {MOST_PIXELS // 6} pixels"
            )
        face = CubeMap(width=6 * arguments.cubemap, height=arguments.cubemap).face
        faces = [Target(f"_{name}", face, rotation @ turn) for name, turn in CUBE_FACES.items()]
        return [target for target in faces if _is_seen(target, source)]
    lens = _lens(arguments, "", width, height)
    if arguments.camera:
        try:
            lens = from_camera(json.loads(arguments.camera))
        except (ValueError, KeyError, UserError) as error:
            raise UserError(f"--camera {arguments.camera}: {error}") from None
    if arguments.no_reproject:
        if lens is not None:
            raise UserError("--no-reproject: excludes an output lens")
        lens = source.resized(width, height)
    if lens is None:
        raise UserError("--rectilinear, …: give the output lens, or --no-reproject")
    return [Target("", lens, np.asarray(rotation))]


def _is_seen(target: Target, source: Lens) -> bool:
    """Whether the source sees anything of a target; a fisheye of 180° sees nothing behind it."""
    rays = target.lens.resized(64, 64).pixel_rays() @ target.rotation.T
    if np.isfinite(source.pixels(rays)).any():
        return True
    # All that a narrow lens sees may lie between these rays.
    pixels = target.lens.pixels(source.fitted(64).pixel_rays() @ target.rotation)
    return bool(((pixels >= 0) & (pixels <= target.lens.width)).all(axis=-1).any())


def _lens(arguments: argparse.Namespace, prefix: str, width: int, height: int) -> Lens | None:
    """Return the lens of the flag that was given, at ``width`` × ``height``; None without one."""
    attribute = prefix.replace("-", "_")
    if prefix and arguments.i_cubemap:
        return CubeMap(width=width, height=height)
    for lens in LENSES.values():
        text = getattr(arguments, attribute + lens.name, None)
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
    if not all(side.is_integer() and 1 <= side <= MOST_PIXELS for side in (width, height)):
        raise UserError(f"{flag} {text}: must be two whole numbers from 1 to {MOST_PIXELS}")
    return int(width), int(height)
