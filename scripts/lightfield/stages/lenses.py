"""The stages that make views through another lens from finished views."""

from collections.abc import Iterator
from pathlib import Path

from lightfield.configuration.reprojections import Reprojection
from lightfield.engine.stage import Stage, option, reads, writes
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.settings.types import AtLeastOne
from lightfield.stages.lens_flags import LensMapFlags, ReprojectFlags, Source

_FILES = "Input and output"
_CHOICE = "Choice of files"
_RUNTIME = "Runtime"


def lens_map_files(path: Path, settings: Reprojection) -> dict[str, Path]:
    """Return the files of a lens map, by what their names have more: one for each cube face."""
    suffixes = [f"_{face}" for face in CUBE_FACES] if settings.cube_map else [""]
    return {suffix: path.with_name(f"{path.stem}{suffix}{path.suffix}") for suffix in suffixes}


class ComputeLensMap(Source, Stage[Reprojection]):
    """Computes a lens map, which `Reproject` applies to every view of a rig."""

    name = "lens_map"
    function = "lightfield.reprojection.lens_map_files:write"
    by_hand = LensMapFlags

    file: Path = writes("lens map to write, .npy", positional=True, metavar="FILE")


class Reproject(Source, Stage[Reprojection]):
    """Reprojects views from one lens to another."""

    name = "reproject"
    function = "lightfield.reprojection.pipeline:run"
    version = 4
    by_hand = ReprojectFlags

    input_dir: Path | None = reads(
        "folder of the images", None, short=["-i"], group=_FILES, one_of="source"
    )
    single: Path | None = reads(
        "one image, instead of a folder", None, metavar="FILE", group=_FILES, one_of="source"
    )
    output_dir: Path = writes("folder to write to", short=["-o"], group=_FILES)
    output_cfg: Path | None = writes("lightfield.json to write", None, metavar="JSON", group=_FILES)
    source_receipt: Path | None = reads(
        "with --receipt: receipt of the images, whose checksums they must match",
        None,
        metavar="JSONL",
        group=_FILES,
    )
    lens_map: Path | None = reads(
        "lens map that lens_map.py computed", None, metavar="FILE", group=_FILES
    )
    filter_prefix: str = option("only images whose names start with this", "", group=_CHOICE)
    filter_suffix: str = option(
        "only images whose names end with this, with or without .png or .exr", "", group=_CHOICE
    )
    views: str | None = option(
        "only these frames of --input-cfg, as a slice from 0, END excluded",
        None,
        metavar="FIRST:END",
        group=_CHOICE,
    )
    skip_if_exists: bool = option("keep existing output files", False, group=_RUNTIME)
    parallel: AtLeastOne = option(
        "how many images are processed at the same time", 1, short=["-j"], group=_RUNTIME
    )
    dry_run: bool = option("write only --output-cfg, and no images", False, group=_RUNTIME)

    def inputs(self) -> Iterator[str | Path]:
        """Yield the files that the job reads, with the lens maps of a cube map's faces."""
        for path in super().inputs():
            if self.lens_map and path == self.lens_map:
                yield from lens_map_files(self.lens_map, self.settings).values()
            else:
                yield path
