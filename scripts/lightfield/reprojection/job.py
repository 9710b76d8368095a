"""What a run of scripts/reproject.py is to do: its flags, its views, and the files to make."""

import argparse
import hashlib
import itertools
import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.cli import above_zero, positive, stops, view_slice, white
from lightfield.core.errors import UserError
from lightfield.dataset import lightfield, shard_files
from lightfield.dataset.lightfield import LightField
from lightfield.dataset.passes import PASSES, Pass
from lightfield.dataset.records import ShardRecord
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.rotations import matrix_to_euler
from lightfield.reprojection import lens_map
from lightfield.reprojection.lens_arguments import Target, add_geometry_flags, geometry
from lightfield.reprojection.lens_map import LensMap

VERSION = 3  # of the files: part of every key, raised when the same settings give others
SUFFIXES = (".exr", ".png", ".jpg", ".jpeg")


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add all flags of the program."""
    files = parser.add_argument_group("Input and output")
    source = files.add_mutually_exclusive_group(required=True)
    source.add_argument("-i", "--input-dir", type=Path, help="folder of the images")
    source.add_argument("--single", type=Path, metavar="FILE", help="one image")
    files.add_argument("-o", "--output-dir", type=Path, required=True, help="folder to write to")
    files.add_argument("--output-cfg", type=Path, metavar="JSON", help="lightfield.json to write")
    files.add_argument("--exr", action="store_true", help="write EXR: colour and depth")
    files.add_argument("--png", action="store_true", help="write PNG: colour, sRGB")
    files.add_argument("--bits", type=int, choices=[8, 16], default=8, help="of a PNG, default 8")
    files.add_argument(
        "--depth-png",
        type=above_zero,
        metavar="SCALE",
        help="write <name>_depth.png: 16-bit, depth in metres × SCALE, 0 for none",
    )
    files.add_argument(
        "--mask",
        action="store_true",
        help="write dynamic_mask_<name>.png: 255 where a pixel has no source",
    )
    files.add_argument(
        "--passes",
        type=lambda text: text.split(","),
        default=[],
        metavar="NAME,…",
        help="reproject these passes, too, which lie beside --input-cfg, into --output-dir/<pass>/",
    )
    files.add_argument(
        "--record", type=Path, metavar="JSON", help="list of the files, written last"
    )
    files.add_argument(
        "--source-record", type=Path, metavar="JSON", help="record that the images must agree with"
    )
    chosen = parser.add_argument_group("Choice of files")
    chosen.add_argument("--filter-prefix", default="", help="only names that start so")
    chosen.add_argument("--filter-suffix", default="", help="only names that end so")
    chosen.add_argument(
        "--views",
        metavar="FIRST:END",
        help="only these frames of --input-cfg, from 0, END excluded",
    )
    add_geometry_flags(parser)
    parser.add_argument("--lens-map", type=Path, metavar="FILE", help="computed by lens_map.py")
    colour = parser.add_argument_group("Colour")
    colour.add_argument("--exposure", type=stops, default=0.0, help="stops, default 0")
    colour.add_argument(
        "--reinhard", type=white, default=1.0, help="value that becomes white, default 1: off"
    )
    runtime = parser.add_argument_group("Runtime")
    runtime.add_argument("--skip-if-exists", action="store_true", help="keep any existing output")
    runtime.add_argument("-j", "--parallel", type=positive, default=1, help="images at a time")
    runtime.add_argument("--dry-run", action="store_true", help="write only --output-cfg")


@dataclass(frozen=True)
class SourceView:
    """One image to reproject: its output name and the file, or a cube map's six."""

    name: str
    paths: tuple[Path, ...]


class Job:
    """All that is the same for every view; a `UserError` names the flag that is wrong."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self.geometry = geometry(arguments)
        self.lightfield = self.geometry.lightfield
        self.source = self.geometry.source
        self.targets = self.geometry.targets
        if not (arguments.exr or arguments.png):
            raise UserError("--exr, --png: give one of them, or both")
        if arguments.no_configs and arguments.output_cfg:
            raise UserError("--output-cfg: needs --input-cfg, which --no-configs excludes")
        if not self.copies:
            self.lightfield.require_centre()
        self.passes = self._passes_wanted(arguments.passes)
        self.record = ShardRecord(arguments.record, arguments.output_dir)
        given = shard_files.read_record(arguments.source_record) if arguments.source_record else {}
        # The SHA-256 of each image, by its path in the dataset.
        self.source_sums = {path: digest for path, (_, digest) in given.items()}

    def _passes_wanted(self, names: list[str]) -> list[Pass]:
        there = [found.name for found in self.lightfield.passes if found.kind != "motion"]
        for name in names:
            if name not in there:
                known = ", ".join(there) or "no passes to reproject"
                raise UserError(f"--passes: is {name}; --input-cfg has {known}")
        return [PASSES[name] for name in names]

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

    @property
    def settings(self) -> dict[str, Any]:
        """What, beside the lens, was done to the pixels: with it, a PNG's can be undone.

        ``rotation`` is pan, pitch and roll in degrees; `lightfield.imaging.tonemap` defines
        ``exposure`` and ``reinhard``.
        """
        return {
            "rotation": self.geometry.rotation,
            "filter": self.geometry.filter,
            "samples": self.geometry.samples,
            "exposure": self.arguments.exposure,
            "reinhard": self.arguments.reinhard,
            **({"bits": 16} if self.arguments.bits == 16 else {}),
        }

    @property
    def depth_wanted(self) -> bool:
        return bool(self.arguments.exr or self.arguments.depth_png)

    @property
    def depth_precision(self) -> str:
        """That of the source's floats, by its lightfield.json; others' may not say it."""
        render = self.lightfield.content.get("render", {})
        return str(render.get("depth_precision", "float"))

    def key(self, target: Target, identity: str) -> str:
        """Return the SHA-256 of all that an output's pixels depend on.

        ``identity`` stands for the source's content.
        """
        content = {
            "version": VERSION,
            "map": self.geometry.settings(target),
            "exposure": self.arguments.exposure,
            "reinhard": self.arguments.reinhard,
            "depth_png": self.arguments.depth_png,
            "depth": self.lightfield.content.get("depth"),
            "source": identity,
            # Not said where it is as it has always been, for keys to stay as they are.
            **({"bits": 16} if self.arguments.bits == 16 else {}),
            **({"transparent": True} if self.lightfield.transparent else {}),
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def outputs(self, view: SourceView, target: Target) -> dict[str, Path]:
        """Return the files to make of a view, by kind."""
        name = view.name + target.suffix
        every = {
            "exr": (self.arguments.exr, f"{name}.exr"),
            "png": (self.arguments.png, f"{name}.png"),
            "depth": (self.arguments.depth_png, f"{name}_depth.png"),
            "mask": (self.arguments.mask, f"dynamic_mask_{name}.png"),
        }
        folder: Path = self.arguments.output_dir
        return {kind: folder / file for kind, (wanted, file) in every.items() if wanted}

    def pass_outputs(self, view: SourceView, target: Target) -> dict[Pass, Path]:
        """Return the files to make of a view's passes."""
        folder: Path = self.arguments.output_dir
        return {found: found.path(folder, view.name + target.suffix) for found in self.passes}

    def files(self, view: SourceView, target: Target) -> list[Path]:
        """Return all files to make of a view."""
        return [*self.outputs(view, target).values(), *self.pass_outputs(view, target).values()]

    def sources(self, view: SourceView) -> list[Path]:
        """Return the files that a view is made of: its own, and those of its passes."""
        folder = self.lightfield.folder
        return [*view.paths, *(found.path(folder, view.name) for found in self.passes)]

    def output_lightfield(self) -> LightField:
        """Return the input's lightfield.json with lens, depth and poses of what is written."""
        lens = self.targets[0].lens
        depth = lens.usual_depth if self.depth_wanted and self.lightfield.depth else None
        views = [
            _turned(view, target)
            for view in self.lightfield.views
            if self._passes(view.name, ".exr")
            for target in self.targets
        ]
        passes = [found.name for found in self.passes]
        more: dict[str, Any] = {"passes": passes} if self.lightfield.passes else {}
        more["reprojection"] = self.settings
        return self.lightfield.changed(lens, views, depth=depth, **more)

    def views(self) -> list[SourceView]:
        """Return the views that the command line chooses, in the order of their names or frames."""
        arguments = self.arguments
        if arguments.single:
            if isinstance(self.source, CubeMap):
                raise UserError(
                    "--single: is one face of a cube map; give --input-dir, for all six"
                )
            return [SourceView(arguments.single.stem, (arguments.single,))]
        folder: Path = arguments.input_dir
        if not folder.is_dir():
            raise UserError(f"--input-dir {folder}: no such folder")
        if arguments.views:
            names = [view.name for view in self.lightfield.views]
            names = names[view_slice(arguments.views, len(names))]
            views = [SourceView(name, _find(folder, name, self.source)) for name in names]
        else:
            views = self._views_in(folder)
        views = [view for view in views if self._passes(view.name, view.paths[0].suffix)]
        for first, second in itertools.pairwise(sorted(views, key=lambda view: view.name)):
            if first.name == second.name:
                raise UserError(
                    f"{first.paths[0]} and {second.paths[0]}: would have one output; "
                    "choose with --filter-suffix"
                )
        if not views:
            raise UserError(f"--input-dir {folder}: no image passes the filters")
        return views

    def _views_in(self, folder: Path) -> list[SourceView]:
        paths = sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()
        )
        if isinstance(self.source, CubeMap):
            stems = [path.stem[:-2] for path in paths if path.stem.endswith("_f")]
            return [SourceView(stem, _find(folder, stem, self.source)) for stem in stems]
        return [SourceView(path.stem, (path,)) for path in paths]

    def _passes(self, name: str, suffix: str) -> bool:
        """Whether a name passes the filters; theirs may have ``suffix`` or not."""
        end = self.arguments.filter_suffix
        return name.startswith(self.arguments.filter_prefix) and (
            name.endswith(end) or (name + suffix).endswith(end)
        )


def _find(folder: Path, name: str, lens: Lens) -> tuple[Path, ...]:
    """Return the file of a view; one that exists if any does, so that a missing one is named."""
    if isinstance(lens, CubeMap):
        return tuple(
            path for face in CUBE_FACES for path in _find(folder, f"{name}_{face}", lens.face)
        )
    candidates = [folder / f"{name}{suffix}" for suffix in SUFFIXES]
    return (next((path for path in candidates if path.is_file()), candidates[0]),)


def _turned(view: lightfield.View, target: Target) -> lightfield.View:
    name = view.name + target.suffix
    # Its flow counts in pixels of its own lens.
    view = replace(view, others={k: v for k, v in view.others.items() if k != "flow"})
    if np.array_equal(target.rotation, np.eye(3)):
        return replace(view, name=name)
    matrix = view.matrix.copy()
    matrix[:3, :3] = matrix[:3, :3] @ target.rotation
    return replace(view, name=name, matrix=matrix, rotation=matrix_to_euler(matrix[:3, :3]))
