"""Writes the page of a sequence: one file that shows all its frames, and plays them.

The page has a few cameras of the rig. All pictures are developed with one exposure, so that they do
not flicker.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lightfield.core.progress import Progress
from lightfield.formats.layout import IMAGES, REPORT, VALIDATION
from lightfield.formats.lightfield import NAME, LightField
from lightfield.geometry.overview import middle_view
from lightfield.geometry.rigs import Rig
from lightfield.imaging import pictures
from lightfield.imaging.look import Look
from lightfield.imaging.pictures import Array
from lightfield.report import contact_sheet, page, tables
from lightfield.report.dataset_page import rig_text
from lightfield.report.packing import webp
from lightfield.stages.report import ReportSequence

# The page has at least one picture of each frame. It has more cameras if their pictures are at most
# so many.
_MOST_PICTURES = 240
_MOST_CAMERAS = 12
# All pictures together have at most so many pixels, which take about 5 MB in the page.
_MOST_PIXELS = 24_000_000
_WIDEST = 640
_QUALITY = 80
# A loop takes two seconds or more, so that few frames do not flash.
_SHORTEST_LOOP = 2
_FASTEST = 24
# The exposure follows from every fourth pixel of every fourth row.
_STRIDE = 4
_LARGEST_HALF = 65504


def write(job: ReportSequence) -> None:
    """Write the page of a sequence. An unreadable view is black, because validation reports it."""
    folders = [job.rig / name for name in job.settings.frames]
    lightfields = [LightField.read(folder / NAME) for folder in folders]
    first = lightfields[0]
    rig = first.placed(job.settings.rig)
    first.require_rig(rig)
    chosen = cameras(rig, len(first.views), len(folders))
    names = [first.views[number].name for number in chosen]
    look = job.settings.look.resolved(first) if job.settings.look else None
    shown = _pictures_of(folders, names, first, look)
    middle = chosen.index(middle_view(rig))
    page.write(
        job.output,
        "sequence.html.j2",
        name=job.rig_name,
        home="../" * (job.rig_name.count("/") + 2) + "index.html",
        facts=_facts(lightfields, rig),
        frames=[
            {
                "name": folder.name,
                "link": f"../{folder.name}/{REPORT}/index.html",
                "state": tables.state(folder / VALIDATION),
                "picture": picture,
            }
            for folder, picture in zip(folders, shown[middle], strict=True)
        ],
        cameras=names,
        middle=middle,
        # The frames above already have the pictures of the middle camera.
        pictures=[[] if number == middle else row for number, row in enumerate(shown)],
        rate=max(1, min(_FASTEST, len(folders) // _SHORTEST_LOOP)),
        fastest=_FASTEST,
    )


def cameras(rig: Rig, count: int, frames: int) -> list[int]:
    """Return the numbers of the views that the page shows, of ``count`` views of each frame.

    They are spread over the rig, and have its middle view.
    """
    most = min(_MOST_CAMERAS, max(1, _MOST_PICTURES // frames))
    spread = range(0, count, math.ceil(count / (most - 1))) if most > 1 else []
    return sorted({middle_view(rig), *spread})


def _pictures_of(
    folders: Sequence[Path], names: Sequence[str], first: LightField, look: Look | None
) -> list[list[str]]:
    """Return the pictures of each named view at each frame, as data URIs."""
    width, height = _size(first.lens.width, first.lens.height, len(folders) * len(names))
    progress = Progress(len(folders) * len(names), "report_sequence", "views")
    rows: list[list[Array]] = []
    for name in names:
        row = []
        for folder in folders:
            view = contact_sheet.small_view(folder / IMAGES / f"{name}.exr", width, height)
            row.append(view.clip(max=_LARGEST_HALF).astype(np.float16))
            progress.done()
        rows.append(row)
    sample = np.stack([view[::_STRIDE, ::_STRIDE] for row in rows for view in row])
    exposure = pictures.exposure_for(sample.astype(np.float32), look)

    def developed(view: Array) -> str:
        return webp(pictures.develop(view.astype(np.float32), exposure, look), _QUALITY)

    return [[developed(view) for view in row] for row in rows]


def _size(width: int, height: int, count: int) -> tuple[int, int]:
    """Return the size of each of ``count`` pictures of views of ``width`` × ``height`` pixels."""
    scale = min(1.0, _WIDEST / max(width, height), math.sqrt(_MOST_PIXELS / count / width / height))
    return max(1, round(width * scale)), max(1, round(height * scale))


def _facts(lightfields: Sequence[LightField], rig: Rig) -> list[tuple[str, str]]:
    """Return the most important facts about a sequence, as pairs of title and text."""
    first, last = lightfields[0], lightfields[-1]
    lens = first.lens
    step = rig.sequence.step if rig.sequence else 1
    numbers = f"{first.frame} to {last.frame}" + (f", every {step}" if step > 1 else "")
    places = first.world_from_cameras[:, :3, 3]
    return [
        ("Frames", f"{len(lightfields)} ({numbers})"),
        ("Views of a frame", str(len(first.views))),
        ("Rig", rig_text(rig, places)),
        ("Lens", lens.description),
        ("Resolution", f"{lens.width} × {lens.height}"),
    ]
