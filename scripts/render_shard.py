"""Render a run of a dataset's views in one process, keeping every view that is already right.

Each view is written, and its checksum logged beside the record, the moment it is done. A view whose
file has the bytes that were logged for the render key that its settings give is left as it is, so
that this program, killed and started again, renders only what is missing. Its journal, one JSON
line a rendered view, tells what was done and how fast.
"""

import argparse
import sys
import time
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import psutil

from lightfield.core import processors
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.progress import Progress, duration
from lightfield.dataset import keys
from lightfield.dataset.journal import Journal
from lightfield.dataset.lightfield import LightField, View
from lightfield.dataset.records import ShardRecord
from lightfield.geometry import depth
from lightfield.imaging import images


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument(
        "--inventory",
        type=Path,
        help="JSON of what the scene contains: leaves out what its pixels do not depend on",
    )
    parser.add_argument(
        "--views",
        metavar="FIRST:END",
        default=":",
        help="a slice of lightfield.json's frames (default: all of them)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder of the views")
    parser.add_argument("--record", type=Path, help="JSON of the views' sizes and checksums")
    parser.add_argument("--journal", type=Path, help="JSON lines of what was rendered and how fast")
    parser.add_argument("--run", type=Path, help="JSON of a run: each dataset's views, by folder")
    parser.add_argument(
        "--device",
        default="auto",
        choices=["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="what Cycles renders on (default: auto)",
    )
    parser.add_argument("--threads", type=int, default=0, help="CPU threads (default: all cores)")
    arguments = parser.parse_args()

    journal = Journal(arguments.journal)
    lightfield = LightField.read(arguments.lightfield)
    views = lightfield.views[parse_slice(arguments.views)]
    record = ShardRecord(arguments.record, arguments.output)
    missing = [
        view
        for view in views
        if not record.is_finished(
            view_path(arguments.output, view), keys.render_key(lightfield, view)
        )
    ]
    warn_of_other_versions(view_path(arguments.output, view) for view in missing)
    # The dataset's folder says which scene and rig it is, and in a sequence which frame.
    label = f"render {arguments.output.parent}"
    if arguments.views != ":":
        label += f" {arguments.views}"
    # A shard that is finished has no line to end, and need not look at any other's files.
    others = Others(len(views), lightfield, arguments.output, arguments.run) if missing else str
    progress = Progress(len(missing), label, already=len(views) - len(missing), note=others)
    if missing:
        render_views(missing, lightfield, arguments, record, journal, progress)
    record.write(view_path(arguments.output, view) for view in views)
    journal.end()


def parse_slice(text: str) -> slice:
    """Read FIRST:END, either of which may be left out, as a slice."""
    first, colon, end = text.partition(":")
    if not colon or not (first + end or "0").isdecimal():
        raise UserError(f"--views: is {text!r}; must be FIRST:END, as in 0:32")
    return slice(int(first) if first else None, int(end) if end else None)


def view_path(folder: Path, view: View) -> Path:
    """Return the path of a view's EXR in the folder of the views."""
    return folder / f"{view.name}.exr"


def warn_of_other_versions(paths: Iterable[Path]) -> None:
    """Warn if there are views that another version of bpy rendered, which are rendered again."""
    versions = [images.attribute(path, images.BPY_ATTRIBUTE) for path in paths]
    for other in sorted({str(found) for found in versions if found} - {version("bpy")}):
        print(
            f"warning: views rendered by bpy {other}, which bpy {version('bpy')} renders again: "
            f"{versions.count(other)}",
            file=sys.stderr,
        )


class Finished:
    """Counts a dataset's finished views, whoever renders them; looks at each finished one once."""

    def __init__(self, lightfield: LightField, folder: Path) -> None:
        self.total = len(lightfield.views)
        self.missing = {
            view_path(folder, view): keys.render_key(lightfield, view) for view in lightfield.views
        }

    def look(self) -> None:
        """Find out which of the views that were missing are finished by now."""
        self.missing = {p: key for p, key in self.missing.items() if not images.has_key(p, key)}

    @property
    def count(self) -> int:
        return self.total - len(self.missing)


class Others:
    """Ends a shard's progress lines with those of the whole dataset and of the whole run.

    ``own`` views are the shard's. ``run`` is a JSON of how many views each dataset of the run has,
    by the dataset's folder. The time left is at the rate of all shards since this one began.
    """

    def __init__(self, own: int, lightfield: LightField, folder: Path, run: Path | None) -> None:
        self.own = own
        self.dataset = Finished(lightfield, folder)
        self.run: dict[str, int] = read_json(run) if run else {}
        # It lists what was chosen, and this may have been asked for by name.
        if str(folder.parent) not in self.run:
            self.run = {}
        self.datasets = {str(folder.parent): self.dataset}
        self.began, self.first = time.monotonic(), self.count()

    def count(self) -> int:
        """Return how many views of the run are finished."""
        for name in self.run.keys() - self.datasets.keys():
            # Another job makes it when its turn has come.
            path = Path(name, "lightfield.json")
            if path.exists():
                self.datasets[name] = Finished(LightField.read(path), Path(name, "exr"))
        for dataset in self.datasets.values():
            dataset.look()
        return sum(dataset.count for dataset in self.datasets.values())

    def __call__(self) -> str:
        done, total, text = self.count(), sum(self.run.values()), ""
        if self.own < self.dataset.total:
            text = f"; of the whole dataset {self.dataset.count} of {self.dataset.total}"
        if self.own < total:
            text += f"; of the run {done} of {total}"
            if self.first < done < total:
                each = (time.monotonic() - self.began) / (done - self.first)
                text += f", {duration(each * (total - done))} left"
        return text


def render_views(
    views: Sequence[View],
    lightfield: LightField,
    arguments: argparse.Namespace,
    record: ShardRecord,
    journal: Journal,
    progress: Progress,
) -> None:
    """Open the scene once and render ``views`` one after the other."""
    threads = arguments.threads or processors.available()
    # Only now, because it takes a second and a shard that is finished does not need it.
    with processors.only(threads):
        from lightfield.rendering import blender

    inventory = read_json(arguments.inventory) if arguments.inventory else {"left_out": []}
    blender.open_scene(arguments.blend)
    if "hidden_objects" in inventory["left_out"]:
        blender.remove_objects(inventory["hidden"])
    device = blender.set_up_render(lightfield.render, lightfield, arguments.device, threads)
    blender.leave_out(inventory["left_out"])
    to_depth = depth_factors(lightfield)
    journal.append(
        {
            "start_up_seconds": round(time.time() - journal.started, 4),
            "start_up_cpu_seconds": round(time.process_time(), 4),
            "device": device,
            "threads": threads,
        }
    )

    process = psutil.Process()
    progress.begin()
    for view in views:
        began, began_cpu = time.perf_counter(), time.process_time()
        seed = keys.view_seed(lightfield.render["seed"], view.name)
        raw = blender.render_view(view.matrix, seed)
        channels, attributes = view_channels(raw, lightfield, to_depth)
        path, key = view_path(arguments.output, view), keys.render_key(lightfield, view)
        attributes |= {images.KEY_ATTRIBUTE: key, images.BPY_ATTRIBUTE: version("bpy")}
        images.write_exr(path, channels, attributes)
        record.add(path, key)
        journal.append(
            {
                "view": view.name,
                "finished": round(time.time(), 3),
                "wall_seconds": round(time.perf_counter() - began, 4),
                "cpu_seconds": round(time.process_time() - began_cpu, 4),
                "render_seconds": raw.render_seconds,
                "synchronization_seconds": raw.synchronization_seconds,
                "memory_bytes": process.memory_info().rss,
            },
        )
        progress.done()


def depth_factors(lightfield: LightField) -> np.ndarray | None:
    """Return the unit rays that turn Cycles' depth into the dataset's, or None if it is that."""
    if lightfield.depth in (None, lightfield.cycles_depth):
        return None
    return lightfield.lens.pixel_rays()


def view_channels(
    raw, lightfield: LightField, rays: np.ndarray | None
) -> tuple[dict[str, np.ndarray], dict[str, images.Attribute]]:
    """Turn what Cycles made into the channels and attributes of a view's EXR.

    Colour beyond the half range is clamped and counted; what is not a number is counted and kept,
    so that validation finds it.
    """
    nan = int(np.isnan(raw.colour).sum())
    clamped = int((np.abs(raw.colour) > images.HALF_MAX).sum())
    colour = np.clip(raw.colour, -images.HALF_MAX, images.HALF_MAX).astype(np.float16)
    channels = {name: colour[:, :, index] for index, name in enumerate("RGB")}
    attributes: dict[str, images.Attribute] = {
        images.CLAMPED_ATTRIBUTE: clamped,
        images.NAN_ATTRIBUTE: nan,
    }
    if lightfield.depth is not None:
        z = raw.depth
        if rays is not None and lightfield.depth == "z":
            z = depth.z_from_distance(z, rays)
        elif rays is not None:
            z = depth.distance_from_z(z, rays)
        # Outside the image circle there is no ray; nothing was hit there.
        z = np.where(np.isnan(z), np.inf, z)
        half = lightfield.render["depth_precision"] == "half"
        with np.errstate(over="ignore"):
            channels["Z"] = z.astype(np.float16 if half else np.float32)
        attributes[images.DEPTH_ATTRIBUTE] = lightfield.depth
    return channels, attributes


if __name__ == "__main__":
    run(main)
