"""Tell how far the chosen datasets are, also while they are being built: from their files alone.

A rendered view counts if its file carries the key of the settings that lightfield.json gives; a
reprojected one if it is no older than the view that it was made from. The time left is that at the
rate of the last ten minutes, as the journals of the shards tell it: it assumes that the views that
are left take as long as those, and that as many processes go on working.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import broken, read_json
from lightfield.core.progress import duration
from lightfield.dataset import journal, keys
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.imaging import images

WINDOW = 600.0
# A process on another machine that has been silent for so long is taken for dead.
SILENCE = 3600.0


@dataclass(frozen=True)
class Dataset:
    """One that was chosen: its folders, how many views it will have, and its reprojections."""

    name: str
    folder: Path
    made: Path
    views: int
    reprojections: list[str]


@dataclass(frozen=True)
class Rendering:
    """Of one dataset: the views that are rendered, and what its shards' processes are doing."""

    finished: set[str]
    # When views were finished, and the span over which that was looked at, both within `WINDOW`.
    recent: int
    seconds: float
    running: list[str]
    silent: list[str]
    killed: list[str]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument("--work", required=True, type=Path, help="folder of the journals")
    parser.add_argument(
        "--dataset",
        action="append",
        nargs=3,
        required=True,
        metavar=("NAME", "VIEWS", "REPROJECTIONS"),
        help="scene/rig, how many views it has, and its reprojections, with commas between them",
    )
    arguments = parser.parse_args()
    now = time.time()
    total = done = recent = 0
    seconds = 0.0
    for name, views, reprojections in arguments.dataset:
        dataset = Dataset(
            name=name,
            folder=arguments.results / name,
            made=arguments.work / name,
            views=int(views),
            reprojections=[text for text in reprojections.split(",") if text],
        )
        rendering = look(dataset, now)
        print("\n".join(lines(dataset, rendering)))
        total += dataset.views
        done += len(rendering.finished)
        recent += rendering.recent
        seconds = max(seconds, rendering.seconds)
    print(f"all: {done} of {total} views rendered{outlook(total - done, recent, seconds)}")


def look(dataset: Dataset, now: float) -> Rendering:
    """Find out how far the rendering of a dataset is at ``now``, in seconds since 1970."""
    path = dataset.folder / NAME
    try:
        lightfield = LightField.read(path) if path.exists() else None
    except UserError as error:
        print(f"{error}; it is made anew", file=sys.stderr)
        lightfield = None
    views = lightfield.views if lightfield else []
    finished = {
        view.name
        for view in views
        if lightfield
        and images.has_key(view_file(dataset, view.name), keys.render_key(lightfield, view))
    }
    recent, seconds = 0, 0.0
    running: list[str] = []
    silent: list[str] = []
    killed: list[str] = []
    journals = (dataset.made / "render").glob("*.journal.jsonl")
    for path in sorted(filter(Path.is_file, journals), key=shard_bounds):
        runs = journal.read(path)
        if not runs:
            continue
        first, end = shard_bounds(path)
        last = runs[-1]
        at_work = last.is_running()
        missing = any(view.name not in finished for view in views[first:end])
        text = f"{first}:{end}"
        if at_work:
            running.append(text)
        elif at_work is None and now - last.last_heard < SILENCE:
            ago = duration(now - last.last_heard)
            running.append(f"{text} on {last.start['host']} (heard of {ago} ago)")
        elif missing and last.end is None:
            (silent if at_work is None else killed).append(text)
        for part in runs:
            recent += sum(view["finished"] > now - WINDOW for view in part.views)
            # What works now counts until now, although its next view is not yet finished.
            until = now if part is last and (at_work or at_work is None) else part.last_heard
            if until > now - WINDOW:
                seconds = max(seconds, min(WINDOW, now - float(part.start["started"])))
    if not running:
        recent = 0
    return Rendering(finished, recent, seconds, running, silent, killed)


def shard_bounds(path: Path) -> tuple[int, int]:
    """Return the first view and the end of the shard that a journal is of."""
    first, end = path.name.partition(".")[0].split("-")
    return int(first), int(end)


def view_file(dataset: Dataset, name: str) -> Path:
    """Return the path of a rendered view."""
    return dataset.folder / "exr" / f"{name}.exr"


def reprojected(dataset: Dataset, reprojection: str, finished: set[str]) -> int:
    """Count the finished views that are reprojected too."""
    times = {path.stem: path.stat().st_mtime for path in modified(dataset.folder / reprojection)}
    return sum(
        name in times and times[name] >= view_file(dataset, name).stat().st_mtime
        for name in finished
    )


def modified(folder: Path) -> list[Path]:
    """Return the images of a reprojection's folder."""
    return [*folder.glob("*.png"), *folder.glob("*.exr")]


def validated(dataset: Dataset, finished: set[str]) -> str:
    """Say whether a dataset's validation has been made of its views, and what came out."""
    path = dataset.folder / "validation.json"
    if len(finished) < dataset.views or not path.exists():
        return "no"
    newest = max((view_file(dataset, name).stat().st_mtime for name in finished), default=0)
    if path.stat().st_mtime < newest:
        return "not since its views were made"
    if problem := broken(path):
        return f"no: {path} {problem}, and is made anew"
    return "yes" if read_json(path).get("valid") else f"yes, and it is not valid: see {path}"


def lines(dataset: Dataset, rendering: Rendering) -> list[str]:
    """Say in lines how far a dataset is."""
    done = len(rendering.finished)
    left = outlook(dataset.views - done, rendering.recent, rendering.seconds)
    parts = [dataset.name, f"  rendered: {done} of {dataset.views}{left}"]
    for name in dataset.reprojections:
        count = reprojected(dataset, name, rendering.finished)
        parts.append(f"  {name}: {count} of {dataset.views}")
    parts.append(f"  validated: {validated(dataset, rendering.finished)}")
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
    if not recent:
        return ", no rate yet"
    return (
        f", {recent / seconds * 60:.3g} a minute, {duration(left / recent * seconds)} left"
        f" at the rate of the last {duration(seconds)}"
    )


if __name__ == "__main__":
    run(main)
