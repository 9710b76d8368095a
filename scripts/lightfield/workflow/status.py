"""Tells the progress of a dataset from the receipts of its shards, also during a build.

A rendered view counts if a receipt has it with the key of the settings in lightfield.json, and if
its file is as the job left it. A reprojected view counts if it is also no older than its source. No
view counts if lightfield.json itself is outdated: only the workflow can tell.
"""

import sys
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lightfield.configuration import keys, scene_yaml
from lightfield.configuration.family import RECORD
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import broken, read_json
from lightfield.core.names import RENDERED
from lightfield.core.units import duration
from lightfield.engine import receipts
from lightfield.engine.receipts import FOLDER, Output
from lightfield.formats.layout import IMAGES, VALIDATION
from lightfield.formats.lightfield import NAME, LightField
from lightfield.stages.checks import Status
from lightfield.workflow import history
from lightfield.workflow.member_record import read_member

# The rate is measured over this many seconds.
WINDOW = 600.0
# A process on another machine counts as dead after this many silent seconds.
_SILENCE = 3600.0


def show(job: Status) -> None:
    """Print the progress of families, of datasets, and of all datasets together."""
    for name, scene in job.family:
        family = scene_yaml.family_of(scene)
        members = {member.name for member in family.members()} if family else set()
        print(of_family(name, job.results / name, members))
    if job.dataset:
        _show_datasets(job)


def _show_datasets(job: Status) -> None:
    now = time.time()
    renderings = []
    for name, views, reprojection_list in job.dataset:
        folder = job.results / name
        shards = job.work / FOLDER / name
        rendering = look(folder, shards, now)
        if name in job.outdated:
            rendering.outdated, rendering.finished = len(rendering.finished), {}
        reprojections = reprojection_list.split(",") if reprojection_list else []
        print("\n".join(lines(name, folder, shards, views, reprojections, rendering)))
        renderings.append(rendering)
    total = sum(views for _, views, _ in job.dataset)
    done = sum(len(rendering.finished) for rendering in renderings)
    recent = sum(rendering.recent for rendering in renderings)
    seconds = max(rendering.seconds for rendering in renderings)
    print(f"all: {done} of {total} views rendered{outlook(total - done, recent, seconds)}")


def of_family(name: str, folder: Path, members: Collection[str]) -> str:
    """Return the progress of a family by the names of its ``members``, which are in ``folder``.

    A former member, which the family no longer has, does not count as built.
    """
    states = []
    for record in folder.glob(f"*/{RECORD}"):
        # A build may remove it meanwhile. A damaged one counts as missing.
        with suppress(UserError):
            if record.parent.name in members:
                states.append(read_member(record.parent).state)
    failed = states.count("failed")
    failures = f", {failed} failed" if failed else ""
    return f"{name}: {states.count('valid')} of {len(members)} members built{failures}"


@dataclass
class RenderProgress:
    """The rendering of one dataset.

    - ``finished``: when each rendered view was made, in nanoseconds since 1970, by its name.
    - ``outdated``: the number of views of an earlier scene, or of earlier settings. They do not
      count as finished, but the next run may keep some of them.
    - ``recent``: the number of views finished in the last ``seconds``, at most `WINDOW`.
    - ``running``, ``silent``, ``killed``: the shards by the state of their processes.
    """

    finished: dict[str, int] = field(default_factory=dict)
    outdated: int = 0
    recent: int = 0
    seconds: float = 0.0
    running: list[str] = field(default_factory=list)
    silent: list[str] = field(default_factory=list)
    killed: list[str] = field(default_factory=list)


def look(folder: Path, shards: Path, now: float) -> RenderProgress:
    """Return the progress of the rendering of a dataset at ``now``, in seconds since 1970.

    ``shards`` is the folder of its receipts.
    """
    rendering = RenderProgress()
    names: list[str] = []
    noted = {path: receipts.noted(path) for path in history.shards(shards / RENDERED)}
    outputs_of_shards = [outputs for outputs, _ in noted.values()]
    try:
        if (folder / NAME).exists():
            lightfield = LightField.read(folder / NAME)
            outputs = _images(outputs_of_shards, folder / IMAGES)
            for view in lightfield.views:
                names.append(view.name)
                output = outputs.get(view.name)
                if output and output.key == keys.render_key(lightfield, view):
                    rendering.finished[view.name] = output.stamp.modified_ns
    except UserError as error:
        print(f"{error}; it is made anew", file=sys.stderr)
    for path, (_, lines_of_history) in noted.items():
        if runs := history.runs_in(lines_of_history):
            first, end = map(int, path.stem.split("-"))
            missing = any(name not in rendering.finished for name in names[first:end])
            _add_shard(rendering, f"{first}:{end}", runs, missing, now)
    if not rendering.running:
        rendering.recent = 0
    return rendering


def _images(outputs_of_shards: Iterable[Mapping[str, Output]], folder: Path) -> dict[str, Output]:
    """Return the images in a folder that are as the shards made them, by the names of the views."""
    beginning = f"{receipts.name_of(folder)}/"
    images = {}
    for outputs in outputs_of_shards:
        for name, output in outputs.items():
            view, _, suffix = name.removeprefix(beginning).rpartition(".")
            is_image = name == f"{beginning}{view}.{suffix}" and suffix in ("exr", "png")
            if is_image and output.stamp.matches(name):
                images[view] = output
    return images


def _add_shard(
    rendering: RenderProgress,
    name: str,
    runs: Sequence[history.ProcessHistory],
    missing: bool,
    now: float,
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
    name: str,
    folder: Path,
    shards: Path,
    count: int,
    reprojections: Sequence[str],
    rendering: RenderProgress,
) -> list[str]:
    """Return lines about the progress of a dataset of ``count`` views."""
    rendered = len(rendering.finished)
    rate = outlook(count - rendered, rendering.recent, rendering.seconds)
    parts = [name, f"  rendered: {rendered} of {count}{rate}"]
    for reprojection in reprojections:
        reprojected = _reprojected(shards / reprojection, folder / reprojection, rendering)
        parts.append(f"  {reprojection}: {reprojected} of {count}")
    made = [path for each in reprojections for path in (shards / each).glob(f"*{receipts.SUFFIX}")]
    reprojected_ns = max((path.stat().st_mtime_ns for path in made), default=0)
    parts.append(f"  validated: {_validated(folder, count, rendering, reprojected_ns)}")
    if rendering.outdated:
        views = units.count(rendering.outdated, "view")
        parts.append(f"  outdated: {views} of an earlier scene, or of earlier settings")
    for title, names in (
        ("shards at work", rendering.running),
        ("shards killed, the next run goes on with them", rendering.killed),
        ("shards not heard of for an hour", rendering.silent),
    ):
        if names:
            parts.append(f"  {title}: {', '.join(names)}")
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


def _reprojected(shards: Path, folder: Path, rendering: RenderProgress) -> int:
    """Count the finished views that are reprojected too."""
    outputs = _images((receipts.noted(path)[0] for path in history.shards(shards)), folder)
    count = 0
    for name, rendered_ns in rendering.finished.items():
        # A cube map is finished with its last face.
        output = outputs.get(name) or outputs.get(f"{name}_d")
        count += output is not None and output.stamp.modified_ns >= rendered_ns
    return count


def _validated(folder: Path, count: int, rendering: RenderProgress, reprojected_ns: int) -> str:
    """Return whether a dataset's current views were validated, and the result.

    ``reprojected_ns`` is when the last shard of a reprojection was made.
    """
    path = folder / VALIDATION
    if len(rendering.finished) < count or not path.exists():
        return "no"
    if path.stat().st_mtime_ns < max(rendering.finished.values()):
        return "not since its views were made"
    if path.stat().st_mtime_ns < reprojected_ns:
        return "not since its reprojections were made"
    problem = broken(path)
    if problem:
        return f"no: {path} {problem}, and is made anew"
    return "yes" if read_json(path).get("valid") else f"yes, and it is not valid: see {path}"
