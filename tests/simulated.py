"""Makes a consistent build of the smoke scene without rendering: every file is there.

Snakemake has nothing to do in it. If a test damages a file, Snakemake must plan it again.
"""

import contextlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bookkeeping
import numpy as np
from checkouts import jobs_on, snakemake

from lightfield.configuration.dataset import Dataset
from lightfield.core.files import sha256, write_json, write_text
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.planning.loading import scene_datasets

WHEN = 1_700_000_000


def build(folder: Path) -> list[Dataset]:
    """Write all files of all datasets of the scene smoke into a checkout."""
    datasets = scene_datasets("smoke")
    for number, dataset in enumerate(datasets):
        _views(folder, dataset)
        for name in [*dataset.files, *dataset.intermediates]:
            if not (folder / name).exists():
                _write(folder / name, number)
        sums = sorted(
            (path.relative_to(folder / dataset.paths.folder).as_posix(), sha256(path))
            for path in (folder / dataset.paths.folder).rglob("*")
            if path.is_file() and "report" not in path.parts and path.name != "sha256sums.txt"
        )
        text = "".join(f"{digest}  {name}\n" for name, digest in sums)
        write_text(folder / dataset.paths.sums, text)
    # The plan writes the settings of every job.
    plan = snakemake(folder, "--dry-run", "--forceall", "--logger", "jobs", "--", "smoke")
    assert plan.returncode == 0, plan.stderr
    set_times(folder)
    bookkeeping.note_build(folder, jobs_on(plan.stderr))
    set_times(folder)
    return datasets


def set_times(folder: Path) -> None:
    """Give all files of a build the same time."""
    for name in ("results", "work"):
        for path in (folder / name).rglob("*"):
            os.utime(path, (WHEN, WHEN))


def planned(folder: Path, *arguments: str) -> set[str]:
    """Return the files that the next run would update."""
    result = snakemake(folder, "--summary", *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    rows = [line.split("\t") for line in result.stdout.splitlines()]
    return {row[0] for row in rows if row[-1] == "update pending"}


def _views(folder: Path, dataset: Dataset) -> None:
    """Write the views and their receipts. The views differ in colour."""
    lightfield = LightField.from_rig(dataset.rig, dataset.rig.camera.make(), **dataset.origin)
    lightfield.write(folder / dataset.paths.lightfield)
    for name, reprojection in dataset.reprojections.items():
        lens = (reprojection.camera or dataset.rig.camera).make()
        made = lightfield.changed(lens, reprojection=reprojection.published(None))
        made.write(folder / dataset.paths.folder / name / "lightfield.json")
    for name in dataset.exported:
        kind = Path(name).parent.name if name.endswith("export.json") else "instant_ngp"
        options = dataset.exports.selected[kind].recorded
        write_json(folder / name, {"options": options, "files": {}})
    for stage in ("render", *dataset.reprojections):
        reprojection = dataset.reprojections.get(stage)
        suffix = reprojection.suffix if reprojection else ".exr"
        images_folder = folder / dataset.paths.folder / (stage if reprojection else "exr")
        for first, end in dataset.shards:
            files = [images_folder / f"{v.name}{suffix}" for v in lightfield.views[first:end]]
            for number, file in enumerate(files):
                pixels = np.full((4, 4), number + 10 * len(stage), np.uint8)
                if suffix == ".png":
                    images.write_png(file, pixels, {images.KEY_ATTRIBUTE: stage})
                else:
                    key = {images.KEY_ATTRIBUTE: stage}
                    images.write_exr(file, {"R": pixels.astype(np.float16)}, key)
            keys = {file.relative_to(folder): stage for file in files}
            with contextlib.chdir(folder):
                bookkeeping.note_shard(dataset.paths.receipt(stage, first, end), keys)


def _write(path: Path, number: int) -> None:
    """Write a file whose content does not matter: a mapping, an image, or some bytes."""
    match path.suffix:
        case ".json":
            write_json(path, {"path": str(path), "number": number, "valid": True})
        case ".png":
            images.write_png(path, np.full((4, 4), number, np.uint8))
        case ".exr":
            images.write_exr(path, {"R": np.full((4, 4), number, np.float16)})
        case _:
            write_text(path, f"{path.name} {number}\n")


def put(path: Path, content: Any) -> None:
    """Write a text, or other content as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))


def write_one_view(folder: Path) -> None:
    """Write a dataset of one view, and its file of checksums."""
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [4, 4]})
    rig = {"type": "plane", "cameras": [1, 1]}
    LightField.from_rig(rig, lens).write(folder / "lightfield.json")
    put(folder / "validation.json", {"valid": True})
    files = ["exr/view_0000f.exr", "transforms.json", "depth.png"]
    files += ["exports/colmap/export.json", "exports/colmap/sparse/points.txt"]
    for name in files:
        put(folder / name, f'{{"name": "{folder}/{name}"}}')
    write_checksums(folder, [*files, "lightfield.json", "validation.json"])
    put(folder / "report/page.html", "a page")


def write_checksums(folder: Path, names: Iterable[str]) -> None:
    """Write the checksums of these files of a dataset."""
    lines = [f"{sha256(folder / name)}  {name}\n" for name in sorted(names)]
    put(folder / "sha256sums.txt", "".join(lines))
