"""Runs a reprojection: makes the missing views."""

import itertools
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import cache
from pathlib import Path
from typing import Any

from lightfield.core.errors import OutsideError, UserError, is_outside
from lightfield.core.files import keep_apart, sha256
from lightfield.core.progress import Progress
from lightfield.geometry.depth import LARGEST_STEP
from lightfield.imaging.images import KEY_ATTRIBUTE, read_header
from lightfield.reprojection import lens_map
from lightfield.reprojection.geometry import Target
from lightfield.reprojection.job import Light, ReprojectionJob, SourceView
from lightfield.reprojection.passes import write_passes
from lightfield.reprojection.pixels import SourcePixels, write
from lightfield.stages.lenses import Reproject
from lightfield.workflow import shard_log


def run(stage: Reproject) -> None:
    """Reproject the chosen views. Raises `UserError` with the number of views that failed."""
    job = ReprojectionJob(stage)
    views = [] if stage.dry_run else job.views()
    _check_apart(job, views)
    if stage.output_cfg:
        job.output_lightfield().write(stage.output_cfg)
    if stage.dry_run:
        return
    # One thread makes each view. OpenImageIO, which is imported later, must add no threads.
    os.environ["OPENIMAGEIO_THREADS"] = "1"
    maps = job.maps
    # lens_map.py has already reported the maps in files.
    if stage.lens_map is None:
        lens_map.report(maps)
        for clipped in {target.lens.clipped for target in job.targets} - {None}:
            print(f"warning: {clipped}", file=sys.stderr)
    label = f"reproject to {stage.output_dir} {stage.views or ''}".rstrip()
    progress = Progress(len(views), label)
    paths: list[Path] = []
    failed: list[str] = []
    kind = UserError
    for view, result in _results(job, views):
        if isinstance(result, UserError | OSError):
            failed.append(_named(view, result))
            kind = OutsideError if is_outside(result) else kind
            print(f"error: {failed[-1]}", file=sys.stderr, flush=True)
        else:
            paths += result
        progress.done()
    if failed:
        # The run's report quotes the last line of the log.
        raise kind(
            f"{len(failed)} of {len(views)} views could not be reprojected, such as {min(failed)}"
        )
    if lost := sum(job.lost_depths):
        steps = job.settings.depth_png
        assert steps is not None
        print(
            f"note: {stage.output_dir}: {lost} depths are 0, unknown, in 16-bit depth maps, "
            f"which hold only {1 / steps:g} to {LARGEST_STEP / steps:g} m"
        )


def _check_apart(job: ReprojectionJob, views: list[SourceView]) -> None:
    """Raise `UserError` if an output would replace an input, even through another path."""
    if job.stage.output_cfg and job.stage.input_cfg:
        keep_apart("--output-cfg", job.stage.output_cfg, job.stage.input_cfg)
    resolve_folder = cache(Path.resolve)
    for view in views:
        inputs = {(resolve_folder(path.parent), path.name) for path in job.sources(view)}
        for light, target in itertools.product(job.lights, job.targets):
            for path in job.files(view, target, light):
                if (resolve_folder(path.parent), path.name) in inputs:
                    raise UserError(
                        f"--output-dir {job.stage.output_dir}: would replace the input {path}; "
                        "give another folder"
                    )


def _results(job: ReprojectionJob, views: list[SourceView]) -> Iterator[tuple[SourceView, Any]]:
    """Yield each view with its files, or with the error that stopped it."""
    with ThreadPoolExecutor(max(1, job.stage.parallel)) as pool:
        futures = {pool.submit(_reproject_view, job, view): view for view in views}
        for future in as_completed(futures):
            error = future.exception()
            if error is not None and not isinstance(error, UserError | OSError):
                raise error
            yield futures[future], error or future.result()


def _reproject_view(job: ReprojectionJob, view: SourceView) -> list[Path]:
    """Make a view's missing or outdated files. Return all of its files."""
    stage = job.stage
    paths_of_view: list[Path] = []
    todo: list[tuple[int, Target, Light, str]] = []
    identity = ""
    for light, (index, target) in itertools.product(job.lights, enumerate(job.targets)):
        paths = job.files(view, target, light)
        paths_of_view += paths
        if stage.skip_if_exists and all(path.exists() for path in paths):
            continue
        identity = identity or _identity(view)
        key = job.key(view, target, light, identity)
        if not all(shard_log.is_finished(path, key) for path in paths):
            todo.append((index, target, light, key))
    if todo:
        source = SourcePixels(job, view, [job.maps[index].window for index, *_ in todo])
        for index, target, light, key in todo:
            source.light_up(light)
            write(job, view, target, light, job.maps[index], source, key)
            pass_paths = job.pass_outputs(view, target)
            write_passes(job, view, pass_paths, job.maps[index], source, key)
    return paths_of_view


def _identity(view: SourceView) -> str:
    """Return the identity of the source's content: its render key, or else its checksum.

    A file that stores other pixels than it shows has its window, too.
    """
    parts = []
    for path in view.paths:
        header = read_header(path) if path.suffix.lower() == ".exr" else None
        key = header.attributes.get(KEY_ATTRIBUTE) if header else None
        parts.append(str(key or sha256(path)))
        if header and not header.window.is_stored_whole:
            parts.append(str(header.window))
    return " ".join(parts)


def _named(view: SourceView, error: Exception) -> str:
    text = str(error)
    return text if str(view.paths[0].parent) in text else f"{view.paths[0]}: {text}"
