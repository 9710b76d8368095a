"""Reproject views from one lens to another, with the flags of SILVR's reprojection tool.

Lengths are in mm and the angles of lenses in radians; --rotation is in degrees. Without a flag
for the target lens it is that of the source (--no-reproject). Pixels without a source are black,
with alpha 0 in a PNG and depth NaN in an EXR.
"""

import argparse
import hashlib
import itertools
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from lightfield.core import cli
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.core.progress import Progress
from lightfield.dataset.records import ShardRecord
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.rotations import matrix_to_euler
from lightfield.imaging.halves import narrow, widen
from lightfield.imaging.images import (
    DEPTH_ATTRIBUTE,
    KEY_ATTRIBUTE,
    Attribute,
    read_header,
    read_image,
    write_exr,
    write_png,
)
from lightfield.imaging.tonemap import decode_srgb, to_8_bit, tone_map
from lightfield.reprojection import lens_map
from lightfield.reprojection.colour import colour_strips
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.lens_arguments import Target, add_geometry_flags, geometry, joined
from lightfield.reprojection.lens_map import LensMap

VERSION = 2  # of the pixels: part of every key, raised when the same settings give other pixels
# A seventh of the time that zlib's own level and the choice of a filter for each row take, and
# files as small: level 4, and libpng's PNG_FILTER_AVG for every row.
PNG_OPTIONS = {"png:compressionLevel": 4, "png:filter": 64}
SUFFIXES = (".exr", ".png", ".jpg", ".jpeg")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the program's command line."""
    p = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    files = p.add_argument_group("Input and output")
    source = files.add_mutually_exclusive_group(required=True)
    source.add_argument("-i", "--input-dir", type=Path, help="folder of the images")
    source.add_argument("--single", type=Path, metavar="FILE", help="one image")
    files.add_argument("-o", "--output-dir", type=Path, required=True, help="folder to write to")
    files.add_argument("--output-cfg", type=Path, metavar="JSON", help="lightfield.json to write")
    files.add_argument("--exr", action="store_true", help="write EXR: colour and depth")
    files.add_argument("--png", action="store_true", help="write PNG: colour, 8-bit sRGB")
    files.add_argument(
        "--depth-png",
        type=float,
        metavar="SCALE",
        help="write <name>_depth.png: 16-bit, depth in metres × SCALE, 0 for none",
    )
    files.add_argument(
        "--mask",
        action="store_true",
        help="write dynamic_mask_<name>.png: 255 where a pixel has no source",
    )
    files.add_argument(
        "--record", type=Path, metavar="JSON", help="list of the files, written last"
    )
    chosen = p.add_argument_group("Choice of files")
    chosen.add_argument("--filter-prefix", default="", help="only names that start so")
    chosen.add_argument("--filter-suffix", default="", help="only names that end so")
    chosen.add_argument(
        "--views",
        metavar="FIRST:END",
        help="only these frames of --input-cfg, from 0, END excluded",
    )
    add_geometry_flags(p)
    p.add_argument("--lens-map", type=Path, metavar="FILE", help="computed by lens_map.py")
    color = p.add_argument_group("Colour")
    color.add_argument("--exposure", type=float, default=0.0, help="stops, default 0")
    color.add_argument(
        "--reinhard", type=float, default=1.0, help="value that becomes white, default 1: off"
    )
    runtime = p.add_argument_group("Runtime")
    runtime.add_argument("--skip-if-exists", action="store_true", help="keep any existing output")
    runtime.add_argument("-j", "--parallel", type=int, default=1, help="images at a time")
    runtime.add_argument("--dry-run", action="store_true", help="write only --output-cfg")
    return p


@dataclass(frozen=True)
class View:
    """One image to reproject: its output name and the file, or a cube map's six."""

    name: str
    paths: tuple[Path, ...]


class Job:
    """All that is the same for every view."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self.geometry = geometry(arguments)
        self.config = self.geometry.config
        self.source = self.geometry.source
        self.targets = self.geometry.targets
        if not (arguments.exr or arguments.png):
            raise UserError("--exr, --png: give one of them, or both")
        if arguments.reinhard <= 0:
            raise UserError(f"--reinhard {arguments.reinhard:g}: must be positive")
        if arguments.depth_png is not None and arguments.depth_png <= 0:
            raise UserError(f"--depth-png {arguments.depth_png:g}: must be positive")
        if arguments.no_configs and arguments.output_cfg:
            raise UserError("--output-cfg: needs --input-cfg, which --no-configs excludes")
        self.record = ShardRecord(arguments.record, arguments.output_dir)

    @cached_property
    def copies(self) -> bool:
        """Whether the target is the source itself, so that nothing is resampled."""
        target = self.targets[0]
        return target.lens == self.source and np.array_equal(target.rotation, np.eye(3))

    @cached_property
    def maps(self) -> list[LensMap]:
        """The lens map of each target, from the file or computed."""
        return [self._map(target) for target in self.targets]

    def _map(self, target: Target) -> LensMap:
        path = self.arguments.lens_map
        if path is None:
            return self.geometry.compute(target)
        path = path.with_name(path.stem + target.suffix + path.suffix)
        made = lens_map.load(path)
        for key, value in self.geometry.settings(target).items():
            if made.settings[key] != value:
                raise UserError(
                    f"{path}: is a lens map for {key} {json.dumps(made.settings[key])}, "
                    f"and this is {json.dumps(value)}; compute it anew with lens_map.py"
                )
        return made

    @cached_property
    def depth_wanted(self) -> bool:
        return bool(self.arguments.exr or self.arguments.depth_png)

    def key(self, target: Target, identity: str) -> str:
        """Return the SHA-256 of all that an output's pixels depend on."""
        content = {
            "version": VERSION,
            "map": self.geometry.settings(target),
            "exposure": self.arguments.exposure,
            "reinhard": self.arguments.reinhard,
            "depth_png": self.arguments.depth_png,
            "depth": self.config.get("depth"),
            "source": identity,
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def outputs(self, view: View, target: Target) -> dict[str, Path]:
        """Return the files to make of a view, by kind."""
        name = view.name + target.suffix
        folder = self.arguments.output_dir
        head, _, stem = name.rpartition("/")
        mask = f"{head}/dynamic_mask_{stem}.png" if head else f"dynamic_mask_{stem}.png"
        every = {
            "exr": (self.arguments.exr, f"{name}.exr"),
            "png": (self.arguments.png, f"{name}.png"),
            "depth": (self.arguments.depth_png, f"{name}_depth.png"),
            "mask": (self.arguments.mask, mask),
        }
        return {kind: folder / path for kind, (wanted, path) in every.items() if wanted}


def _views(job: Job) -> list[View]:
    """Return the views that the command line chooses, in the order of their names or frames."""
    arguments = job.arguments
    if arguments.single:
        return [View(arguments.single.stem, (arguments.single,))]
    folder: Path = arguments.input_dir
    if not folder.is_dir():
        raise UserError(f"--input-dir {folder}: no such folder")
    if arguments.views:
        names = [frame["name"] for frame in _chosen_frames(arguments, job.config)]
        return [View(name, _find(folder, name, job.source)) for name in names]
    paths = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()
    )
    if isinstance(job.source, CubeMap):
        stems = {path.stem[:-2]: path for path in paths if path.stem.endswith("_f")}
        views = [View(stem, _find(folder, stem, job.source)) for stem in stems]
    else:
        views = [View(path.stem, (path,)) for path in paths]
    views = [view for view in views if _passes(arguments, view.name, view.paths[0].suffix)]
    for first, second in itertools.pairwise(views):
        if first.name == second.name:
            raise UserError(
                f"{first.paths[0]} and {second.paths[0]}: would have one output; "
                "choose with --filter-suffix"
            )
    if not views:
        raise UserError(f"--input-dir {folder}: no image passes the filters")
    return views


def _find(folder: Path, name: str, lens: Lens) -> tuple[Path, ...]:
    """Return the file of a frame; one that exists if any does, so that a missing one is named."""
    if isinstance(lens, CubeMap):
        return tuple(
            path for face in CUBE_FACES for path in _find(folder, f"{name}_{face}", lens.face)
        )
    candidates = [folder / f"{name}{suffix}" for suffix in SUFFIXES]
    return (next((path for path in candidates if path.is_file()), candidates[0]),)


def _passes(arguments: argparse.Namespace, name: str, suffix: str) -> bool:
    """Whether a name passes the filters; the suffix may be given with or without ``.exr``."""
    ends = name.endswith(arguments.filter_suffix) or (name + suffix).endswith(
        arguments.filter_suffix
    )
    return bool(name.startswith(arguments.filter_prefix) and ends)


def _chosen_frames(
    arguments: argparse.Namespace, config: Mapping[str, Any]
) -> list[Mapping[str, Any]]:
    frames = config.get("frames", [])
    first, separator, end = arguments.views.partition(":")
    try:
        start, stop = int(first), int(end)
    except ValueError:
        start, stop = -1, -1
    if not separator or not 0 <= start < stop <= len(frames):
        raise UserError(
            f"--views {arguments.views}: must be FIRST:END with 0 ≤ FIRST < END ≤ {len(frames)}"
        )
    return [
        frame
        for frame in frames[start:stop]
        if _passes(arguments, frame["name"], "".join(SUFFIXES[:1]))
    ]


def output_config(job: Job) -> dict[str, Any]:
    """Return the input's lightfield.json with lens, depth and poses of what is written."""
    arguments = job.arguments
    config = dict(job.config) | job.targets[0].lens.to_lightfield()
    if not job.depth_wanted:
        config["depth"] = None
    elif "depth" not in job.config or job.config["depth"] is not None:
        config["depth"] = _depth_name(job.targets[0].lens)
    if "frames" in config:
        config["frames"] = [
            _turned(frame, target)
            for frame in config["frames"]
            if _passes(arguments, frame["name"], ".exr")
            for target in job.targets
        ]
    return config


def _turned(frame: Mapping[str, Any], target: Target) -> dict[str, Any]:
    turned = dict(frame) | {"name": frame["name"] + target.suffix}
    if np.array_equal(target.rotation, np.eye(3)):
        return turned
    matrix = np.array(frame["world_matrix"], np.float64)
    matrix[:3, :3] = matrix[:3, :3] @ target.rotation
    turned["world_matrix"] = matrix.tolist()
    turned["rotation"] = [float(angle) for angle in matrix_to_euler(matrix[:3, :3])]
    return turned


def _depth_name(lens: Lens) -> str:
    return "z" if lens.has_z_depth else "distance"


def reproject_view(job: Job, view: View) -> list[Path]:
    """Make a view's files, but for those that are there and up to date; return them all."""
    arguments = job.arguments
    made: list[Path] = []
    todo: list[tuple[int, Target, dict[str, Path], str]] = []
    identity = ""
    for index, target in enumerate(job.targets):
        outputs = job.outputs(view, target)
        made += outputs.values()
        if arguments.skip_if_exists and all(path.exists() for path in outputs.values()):
            continue
        identity = identity or _identity(view)
        key = job.key(target, identity)
        if not all(job.record.is_finished(path, key) for path in outputs.values()):
            todo.append((index, target, outputs, key))
    if todo:
        source = _Source(job, view, [job.maps[index].window for index, *_ in todo])
        for index, target, outputs, key in todo:
            _write(job, target, job.maps[index], source, outputs, key)
    return made


def _identity(view: View) -> str:
    """Return what tells the source's content: its render key, or else its checksum."""
    parts = []
    for path in view.paths:
        is_exr = path.suffix.lower() == ".exr"
        key = read_header(path).attributes.get(KEY_ATTRIBUTE) if is_exr else None
        parts.append(str(key or sha256(path)))
    return " ".join(parts)


class _Source:
    """The part of a view's pixels that its targets need, linear and in float32."""

    def __init__(self, job: Job, view: View, windows: list[tuple[int, int, int, int]]) -> None:
        low, high = np.min(windows, axis=0), np.max(windows, axis=0)
        self.rows, self.columns = (int(low[0]), int(high[1])), (int(low[2]), int(high[3]))
        faces = [self._read(job, path) for path in view.paths]
        self.color = _side_by_side([face[0] for face in faces])
        depths = [face[1] for face in faces if face[1] is not None]
        self.depth = _side_by_side(depths) if len(depths) == len(faces) else None
        self.has_alpha = faces[0][2]
        # The file knows best; the configuration may be another program's.
        meaning = faces[0][3] or job.config.get("depth") or _depth_name(job.source)
        self.is_z = meaning == "z"

    def _read(self, job: Job, path: Path) -> tuple[Array, Array | None, bool, Attribute | None]:
        lens = job.source.face if isinstance(job.source, CubeMap) else job.source
        header = read_header(path)
        if (header.width, header.height) != (lens.width, lens.height):
            raise UserError(
                f"{path}: has {header.width} × {header.height} pixels; "
                f"the lens expects {lens.width} × {lens.height}"
            )
        names = header.channels
        colors = "RGB" if {"R", "G", "B"} <= set(names) else "YYY"
        if colors[0] not in names:
            raise UserError(f"{path}: has no colour: its channels are {', '.join(names)}")
        wanted = {*colors, "A", "Z"} if job.depth_wanted else {*colors, "A"}
        image = read_image(path, [name for name in names if name in wanted], self.rows)
        columns = slice(*self.columns)
        channels = {name: array[:, columns] for name, array in image.channels.items()}
        alpha, depth = channels.get("A"), channels.get("Z")
        color = _linear([channels[name] for name in colors], alpha)
        if depth is not None and depth.dtype != np.float16:
            depth = depth.astype(np.float32, copy=False)
        return color, depth, alpha is not None, image.attributes.get(DEPTH_ATTRIBUTE)


def _side_by_side(faces: list[Array]) -> Array:
    """Return a cube map's faces as one strip; the one image of another lens as it is."""
    return faces[0] if len(faces) == 1 else np.concatenate(faces, axis=1)


def _linear(planes: list[Array], alpha: Array | None) -> Array:
    """Return pixels as (h, w, 4) float32 linear R G B A, colour associated with alpha."""
    if planes[0].dtype.kind == "u":
        largest = np.iinfo(planes[0].dtype).max
        table = decode_srgb(np.arange(largest + 1) / largest).astype(np.float32)
        planes = [table[plane] for plane in planes]
        if alpha is not None:
            alpha = alpha.astype(np.float32) / np.float32(largest)
            planes = [plane * alpha for plane in planes]
    color = widen(*planes, alpha)
    if alpha is not None:
        # What is wholly transparent is no sample.
        color[alpha == 0] = np.nan
    return color


def _write(
    job: Job,
    target: Target,
    made: LensMap,
    source: _Source,
    outputs: Mapping[str, Path],
    key: str,
) -> None:
    arguments = job.arguments
    row, end_row, column, end_column = made.window
    rows = slice(row - source.rows[0], end_row - source.rows[0])
    columns = slice(column - source.columns[0], end_column - source.columns[0])
    color = np.ascontiguousarray(source.color[rows, columns])
    depth = None if source.depth is None else source.depth[rows, columns]
    as_z = target.lens.has_z_depth
    if job.copies and source.is_z == as_z:
        outside = np.isnan(made.target_cos[row:end_row, column:end_column])
        color = np.where(outside[:, :, None], np.float32(np.nan), color)
        strips: Iterable[tuple[slice, Array]] = [(np.s_[:], _in_frame(color, made))]
        depth = None if depth is None else _in_frame(depth, made)
    else:
        strips = colour_strips(color, made)
        if depth is not None:
            found = resample_depth(depth, source.is_z, as_z, made)
            with np.errstate(over="ignore"):
                depth = found.astype(depth.dtype, copy=False)
    size = made.target_cos.shape
    empty = np.empty(size, bool)
    half = np.empty((3, *size), np.float16)
    pixels = np.empty((*size, 3), np.uint8)
    for rows, strip in strips:
        empty[rows] = np.isnan(strip[:, :, 0])
        if source.has_alpha:
            with np.errstate(invalid="ignore", divide="ignore"):
                strip[:, :, :3] /= strip[:, :, 3:]
        strip = tone_map(strip[:, :, :3], arguments.exposure, arguments.reinhard)
        if "exr" in outputs:
            half[:, rows] = narrow(strip, 3)
        if "png" in outputs:
            pixels[rows] = to_8_bit(strip)
    marked = bool(empty.any())
    if marked:
        half[:, empty] = 0
        if depth is not None:
            depth[empty] = np.nan
    attributes = {KEY_ATTRIBUTE: key}
    for kind, path in outputs.items():
        match kind:
            case "exr":
                channels = dict(zip("RGB", half, strict=True))
                if depth is not None:
                    channels["Z"] = depth
                    attributes = attributes | {DEPTH_ATTRIBUTE: "z" if as_z else "distance"}
                elif marked:
                    channels["A"] = (~empty).astype(np.float16)
                write_exr(path, channels, attributes)
            case "png":
                if marked:
                    pixels = np.dstack([pixels, np.where(empty, 0, 255).astype(np.uint8)])
                write_png(path, pixels, {KEY_ATTRIBUTE: key, **PNG_OPTIONS})
            case "depth":
                if depth is None:
                    raise UserError("--depth-png: the image has no channel Z")
                with np.errstate(invalid="ignore"):
                    scaled = np.rint(depth.astype(np.float64) * arguments.depth_png)
                    known = np.isfinite(scaled) & (scaled <= 65535)
                write_png(path, np.where(known, scaled, 0).astype(np.uint16), {KEY_ATTRIBUTE: key})
            case "mask":
                write_png(path, np.where(empty, 255, 0).astype(np.uint8), {KEY_ATTRIBUTE: key})
        job.record.add(path, key)


def _in_frame(window: Array, made: LensMap) -> Array:
    """Return the window's pixels in their place in the whole image, NaN around them."""
    out = np.full((*made.target_cos.shape, *window.shape[2:]), np.nan, window.dtype)
    row, end_row, column, end_column = made.window
    out[row:end_row, column:end_column] = window
    return out


def main() -> None:
    """Run the program on the command line's arguments."""
    job = Job(parser().parse_args(joined(sys.argv[1:])))
    arguments = job.arguments
    views = [] if arguments.dry_run else _views(job)
    if arguments.output_cfg:
        write_json(arguments.output_cfg, output_config(job))
    if arguments.dry_run:
        return
    # One view is one thread's work: the libraries shall not add theirs.
    oiio.attribute("threads", 1)
    for made in job.maps:
        lens_map.report(made)
    label = f"reproject to {arguments.output_dir} {arguments.views or ''}".rstrip()
    progress = Progress(len(views), label)
    paths: list[Path] = []
    failed = 0
    for view, result in _run(job, views):
        if isinstance(result, UserError | OSError):
            failed += 1
            print(f"error: {_named(view, result)}", file=sys.stderr, flush=True)
        else:
            paths += result
        progress.done()
    if failed:
        raise UserError(f"{failed} of {len(views)} views could not be reprojected")
    job.record.write(sorted(paths), counts={"views": len(views), "files": len(paths)})


def _run(job: Job, views: list[View]) -> Iterator[tuple[View, Any]]:
    """Yield each view with its files, or with the error that it ended in."""
    with ThreadPoolExecutor(max(1, job.arguments.parallel)) as pool:
        futures = {pool.submit(reproject_view, job, view): view for view in views}
        for future in as_completed(futures):
            error = future.exception()
            if error is not None and not isinstance(error, UserError | OSError):
                raise error
            yield futures[future], error or future.result()


def _named(view: View, error: Exception) -> str:
    text = str(error)
    return text if str(view.paths[0].parent) in text else f"{view.paths[0]}: {text}"


if __name__ == "__main__":
    cli.run(main)
