"""How far a dataset is, also while it is being built: from its files alone.

A rendered view counts if its shard's record has it, or if its file carries the key of the settings
that lightfield.json gives; a reprojected one if it is no older than the view it was made from.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import broken, read_json
from lightfield.core.progress import duration
from lightfield.dataset import journal, keys, shard_files
from lightfield.dataset.lightfield import NAME, LightField, View
from lightfield.imaging import images
from lightfield.validation.files import IMAGES

# The rate is that of so many seconds.
WINDOW = 600.0
# A process on another machine that has been silent for so long is taken for dead.
SILENCE = 3600.0


@dataclass
class Rendering:
    """Of one dataset: the views that are rendered, and what its shards' processes are doing."""

    finished: set[str] = field(default_factory=set)
    # When views were finished, and the span over which that was looked at, both within `WINDOW`.
    recent: int = 0
    seconds: float = 0.0
    running: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    killed: list[str] = field(default_factory=list)


def look(folder: Path, work: Path, count: int, now: float) -> Rendering:
    """Find out how far the rendering of ``count`` views is at ``now``, in seconds since 1970."""
    found = Rendering()
    views: Sequence[View] = ()
    try:
        if (folder / NAME).exists():
            found.finished = _recorded(folder, work)
            # A finished dataset's poses need not be read.
            if len(found.finished) < count:
                lightfield = LightField.read(folder / NAME)
                views = lightfield.views
                found.finished |= _keyed(folder, lightfield, found.finished)
    except UserError as error:
        print(f"{error}; it is made anew", file=sys.stderr)
    journals = filter(Path.is_file, (work / "render").glob(journal.JOURNALS))
    for bounds, path in sorted((_bounds(path), path) for path in journals):
        if runs := journal.read(path):
            first, end = bounds
            missing = any(view.name not in found.finished for view in views[first:end])
            _add_shard(found, f"{first}:{end}", runs, missing, now)
    if not found.running:
        found.recent = 0
    return found


def _recorded(folder: Path, work: Path) -> set[str]:
    """Return the views that records have which are no older than lightfield.json."""
    written = (folder / NAME).stat().st_mtime_ns
    records = (work / "render").glob("*-*.json")
    current = (path for path in records if path.stat().st_mtime_ns >= written)
    files = (shard_files.recorded_sizes(path, str(folder)) for path in current)
    # Beside the views a record has their passes, and the names of what these number.
    return {_stem(name) for sizes in files for name in sizes or () if name.startswith(f"{IMAGES}/")}


def _keyed(folder: Path, lightfield: LightField, recorded: set[str]) -> set[str]:
    """Return those of the other views whose files carry the key of their settings."""
    present = {path.stem for path in _file(folder, "").parent.glob("*.exr")} - recorded
    return {
        view.name
        for view in lightfield.views
        if view.name in present
        and images.has_key(_file(folder, view.name), keys.render_key(lightfield, view))
    }


def _add_shard(
    found: Rendering, name: str, runs: Sequence[journal.Run], missing: bool, now: float
) -> None:
    """Note what the processes of a shard, of which views are ``missing``, are doing."""
    last = runs[-1]
    at_work = last.is_running()
    silence = now - last.last_heard
    if at_work:
        found.running.append(name)
    elif at_work is None and silence < SILENCE:
        host = last.start["host"]
        found.running.append(f"{name} on {host} (heard of {duration(silence)} ago)")
    elif missing and last.end is None:
        (found.silent if at_work is None else found.killed).append(name)
    for run in runs:
        found.recent += sum(view["finished"] > now - WINDOW for view in run.views)
        # What works now counts until now, although its next view is not yet finished.
        until = now if run is last and at_work is not False else run.last_heard
        if until > now - WINDOW:
            span = min(WINDOW, now - float(run.start["started"]))
            found.seconds = max(found.seconds, span)


def lines(
    name: str, folder: Path, count: int, reprojections: Sequence[str], rendering: Rendering
) -> list[str]:
    """Say in lines how far a dataset of ``count`` views is."""
    done = len(rendering.finished)
    left = outlook(count - done, rendering.recent, rendering.seconds)
    parts = [name, f"  rendered: {done} of {count}{left}"]
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


def outlook(left: int, recent: int, seconds: float) -> str:
    """Say the rate of ``recent`` views in so many ``seconds``, and how long the others take."""
    if not left:
        return ""
    # A node's clock may be ahead.
    if not recent or seconds <= 0:
        return ", no rate yet"
    return (
        f", {recent / seconds * 60:.3g} a minute, {duration(left / recent * seconds)} left"
        f" at the rate of the last {duration(seconds)}"
    )


def _reprojected(folder: Path, reprojection: str, finished: set[str]) -> int:
    """Count the finished views that are reprojected too."""
    made = (p for p in (folder / reprojection).glob("*") if p.suffix in (".png", ".exr"))
    times = {path.stem: path.stat().st_mtime for path in made}
    # Of a cube map the last face counts.
    last = times.keys() & {f"{name}_d" for name in finished}
    times |= {name.removesuffix("_d"): times[name] for name in last}
    return sum(times.get(name, -1) >= _file(folder, name).stat().st_mtime for name in finished)


def _validated(folder: Path, count: int, finished: set[str]) -> str:
    """Say whether a dataset's validation has been made of its views, and what came out."""
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
    if problem := broken(path):
        return f"no: {path} {problem}, and is made anew"
    return "yes" if read_json(path).get("valid") else f"yes, and it is not valid: see {path}"


def _bounds(path: Path) -> tuple[int, int]:
    """Return the first view and the end of the shard that a journal is of."""
    first, end = path.name.partition(".")[0].split("-")
    return int(first), int(end)


def _stem(path: str) -> str:
    """Return a file's name without its ending: quicker than a `Path` where there are many."""
    return path.rpartition("/")[2].rpartition(".")[0]


def _file(folder: Path, name: str) -> Path:
    return folder / IMAGES / f"{name}.exr"
