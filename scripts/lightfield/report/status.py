"""Tells the progress of a dataset from its files alone, also during a build.

A rendered view counts if its shard's record lists it, or if its file has the key of the settings in
lightfield.json. A reprojected view counts if it is no older than its source.
"""

import os
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lightfield.configuration import keys
from lightfield.configuration.family import RECORD
from lightfield.core.errors import UserError
from lightfield.core.files import broken, read_json
from lightfield.core.units import duration
from lightfield.formats.layout import IMAGES
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.imaging import images
from lightfield.stages.checks import Status
from lightfield.workflow import journal, shard_files
from lightfield.workflow.member_record import read_member

# The rate is measured over this many seconds.
WINDOW = 600.0
# A process on another machine counts as dead after this many silent seconds.
_SILENCE = 3600.0


def show(job: Status) -> None:
    """Print the progress of families, of datasets, and of all datasets together."""
    for name, members in job.family:
        print(of_family(name, job.results / name, members))
    if job.dataset:
        _show_datasets(job)


def _show_datasets(job: Status) -> None:
    now = time.time()
    renderings = []
    for name, views, reprojection_list in job.dataset:
        folder = job.results / name
        rendering = look(folder, job.work / name, views, now)
        reprojections = reprojection_list.split(",") if reprojection_list else []
        print("\n".join(lines(name, folder, views, reprojections, rendering)))
        renderings.append(rendering)
    total = sum(views for _, views, _ in job.dataset)
    done = sum(len(rendering.finished) for rendering in renderings)
    recent = sum(rendering.recent for rendering in renderings)
    seconds = max(rendering.seconds for rendering in renderings)
    print(f"all: {done} of {total} views rendered{outlook(total - done, recent, seconds)}")


def of_family(name: str, folder: Path, count: int) -> str:
    """Return the progress of a family of ``count`` members, whose folders are in ``folder``."""
    states = []
    for record in folder.glob(f"*/{RECORD}"):
        # A build may remove it meanwhile. A damaged one counts as missing.
        with suppress(UserError):
            states.append(read_member(record.parent).state)
    failed = states.count("failed")
    failures = f", {failed} failed" if failed else ""
    return f"{name}: {states.count('valid')} of {count} members built{failures}"


@dataclass
class RenderProgress:
    """The rendering of one dataset.

    - ``finished``: the names of the rendered views.
    - ``recent``: the number of views finished in the last ``seconds``, at most `WINDOW`.
    - ``running``, ``silent``, ``killed``: the shards by the state of their processes.
    """

    finished: set[str] = field(default_factory=set)
    recent: int = 0
    seconds: float = 0.0
    running: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    killed: list[str] = field(default_factory=list)


def look(folder: Path, work: Path, count: int, now: float) -> RenderProgress:
    """Return the progress of the rendering of ``count`` views at ``now``, in seconds since 1970."""
    rendering = RenderProgress()
    views: Sequence[View] = ()
    try:
        if (folder / NAME).exists():
            rendering.finished = _recorded(folder, work)
            # A finished dataset does not need the views.
            if len(rendering.finished) < count:
                lightfield = LightField.read(folder / NAME)
                views = lightfield.views
                rendering.finished |= _keyed(folder, lightfield, rendering.finished)
    except UserError as error:
        print(f"{error}; it is made anew", file=sys.stderr)
    journals = filter(Path.is_file, (work / "render").glob(journal.JOURNALS))
    for bounds, path in sorted((_bounds(path), path) for path in journals):
        runs = journal.read(path)
        if runs:
            first, end = bounds
            missing = any(view.name not in rendering.finished for view in views[first:end])
            _add_shard(rendering, f"{first}:{end}", runs, missing, now)
    if not rendering.running:
        rendering.recent = 0
    return rendering


def _recorded(folder: Path, work: Path) -> set[str]:
    """Return the views in the records that are no older than lightfield.json."""
    written = (folder / NAME).stat().st_mtime_ns
    views = set()
    for record in (work / "render").glob("*-*.json"):
        if record.stat().st_mtime_ns < written:
            continue
        # A record also lists passes, and the files with the names of their numbers.
        for name in shard_files.recorded_sizes(record, str(folder)) or ():
            if name.startswith(f"{IMAGES}/"):
                views.add(_stem(name))
    return views


def _keyed(folder: Path, lightfield: LightField, recorded: set[str]) -> set[str]:
    """Return the views without a record whose files have the key of their settings."""
    present = {path.stem for path in _file(folder, "").parent.glob("*.exr")} - recorded
    return {
        view.name
        for view in lightfield.views
        if view.name in present
        and images.has_key(_file(folder, view.name), keys.render_key(lightfield, view))
    }


def _add_shard(
    rendering: RenderProgress, name: str, runs: Sequence[journal.Run], missing: bool, now: float
) -> None:
    """Add the state of a shard's processes. ``missing`` says whether it lacks views."""
    last = runs[-1]
    # None for a process on another machine: it cannot be asked.
    is_running = last.is_running()
    silence = now - last.last_heard
    if is_running:
        rendering.running.append(name)
    elif is_running is None and silence < _SILENCE:
        host = last.start["host"]
        rendering.running.append(f"{name} on {host} (heard of {duration(silence)} ago)")
    elif missing and last.end is None:
        if is_running is None:
            rendering.silent.append(name)
        else:
            rendering.killed.append(name)
    for run in runs:
        rendering.recent += sum(view["finished"] > now - WINDOW for view in run.views)
        # A running process counts until now, although its next view is not yet finished.
        until = now if run is last and is_running is not False else run.last_heard
        if until > now - WINDOW:
            span = min(WINDOW, now - float(run.start["started"]))
            rendering.seconds = max(rendering.seconds, span)


def lines(
    name: str, folder: Path, count: int, reprojections: Sequence[str], rendering: RenderProgress
) -> list[str]:
    """Return lines about the progress of a dataset of ``count`` views."""
    rendered = len(rendering.finished)
    rate = outlook(count - rendered, rendering.recent, rendering.seconds)
    parts = [name, f"  rendered: {rendered} of {count}{rate}"]
    for reprojection in reprojections:
        reprojected = _reprojected(folder, reprojection, rendering.finished)
        parts.append(f"  {reprojection}: {reprojected} of {count}")
    parts.append(f"  validated: {_validated(folder, count, rendering.finished)}")
    for title, shards in (
        ("shards at work", rendering.running),
        ("shards killed, the next run goes on with them", rendering.killed),
        ("shards not heard of for an hour", rendering.silent),
    ):
        if shards:
            parts.append(f"  {title}: {', '.join(shards)}")
    return parts


def outlook(remaining: int, recent: int, seconds: float) -> str:
    """Return the rate of ``recent`` views in ``seconds``, and the time for the remaining ones."""
    if not remaining:
        return ""
    # A node's clock may be ahead.
    if not recent or seconds <= 0:
        return ", no rate yet"
    return (
        f", {recent / seconds * 60:.3g} a minute, {duration(remaining / recent * seconds)} left"
        f" at the rate of the last {duration(seconds)}"
    )


def _reprojected(folder: Path, reprojection: str, finished: set[str]) -> int:
    """Count the finished views that are reprojected too."""
    times = {}
    for path in (folder / reprojection).glob("*"):
        if path.suffix in (".png", ".exr"):
            times[path.stem] = path.stat().st_mtime
    # A cube map is finished with its last face.
    last_faces = times.keys() & {f"{name}_d" for name in finished}
    times |= {face.removesuffix("_d"): times[face] for face in last_faces}
    return sum(times.get(name, -1) >= _file(folder, name).stat().st_mtime for name in finished)


def _validated(folder: Path, count: int, finished: set[str]) -> str:
    """Return whether a dataset's current views were validated, and the result."""
    path = folder / "validation.json"
    if len(finished) < count or not path.exists():
        return "no"
    images_folder = folder / IMAGES
    views = os.scandir(images_folder) if images_folder.exists() else ()
    newest = max(
        (view.stat().st_mtime for view in views if _stem(view.name) in finished), default=0
    )
    if path.stat().st_mtime < newest:
        return "not since its views were made"
    problem = broken(path)
    if problem:
        return f"no: {path} {problem}, and is made anew"
    return "yes" if read_json(path).get("valid") else f"yes, and it is not valid: see {path}"


def _bounds(path: Path) -> tuple[int, int]:
    """Return the first view of a journal's shard, and the view after its last."""
    first, end = path.name.partition(".")[0].split("-")
    return int(first), int(end)


def _stem(path: str) -> str:
    """Return a file's name without its suffix. Faster than `Path` for many files."""
    return path.rpartition("/")[2].rpartition(".")[0]


def _file(folder: Path, name: str) -> Path:
    return folder / IMAGES / f"{name}.exr"
