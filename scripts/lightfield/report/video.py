"""Makes a dataset's video: a turntable or a walk that begins where the page's walk begins."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lightfield.core.files import atomic_path
from lightfield.core.names import VIDEO
from lightfield.core.progress import Progress
from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear, RectilinearSettings
from lightfield.geometry.rigs import Rig
from lightfield.imaging import pictures
from lightfield.imaging.video import video
from lightfield.products.exports import is_of_dataset, replace_folder
from lightfield.reading.dataset import OpenDataset
from lightfield.report import video_path, walk_start
from lightfield.report.video_path import Array, Standpoint
from lightfield.report.views import depths_of, read, shown_views
from lightfield.report.walk import bounds
from lightfield.stages.report import MakeVideo
from lightfield.stages.synthesis import BEST
from lightfield.synthesis.view import Sources, reader

# Pictures in a second.
RATE = 25
# The longer side of a picture is at most so many times as long as the shorter one.
_LONGEST = 2
_WEBP_QUALITY = 80
# The views with which the eye's start is found are at most this long, in pixels.
_SMALL_SIDE = 192
# The eye looks at what the middle of its first picture shows: this part of its height.
_MIDDLE = 0.25


def write(job: MakeVideo) -> None:
    """Write the video into the folder, and list it in export.json."""
    settings = job.settings
    name = f"{settings.path}.{settings.format}"
    options = {key: getattr(settings, key) for key in ("path", "format", "seconds", "height")}
    replace_folder(
        VIDEO,
        options,
        job.output,
        lambda folder: _write_pictures(job, folder / name),
        is_own=is_of_dataset(job.output, VIDEO),
    )
    print(f"{job.output / name}: {settings.seconds:g} s")


def _write_pictures(job: MakeVideo, path: Path) -> None:
    settings = job.settings
    source = OpenDataset.in_folder(job.dataset, suffix=".exr")
    lightfield = source.lightfield
    lightfield.require_centre()
    sources = Sources(
        source.lens,
        lightfield.views,
        reader(source),
        fills_holes=not lightfield.transparent,
        most=4 * BEST,
    )
    lens = lens_of(source.lens, settings.height)
    standpoint, light = _start(source, settings.rig, sources, lens)
    look = settings.look.resolved(lightfield) if settings.look else None
    exposure = pictures.exposure_for(light, look)
    places = lightfield.world_from_cameras[:, :3, 3]
    count = round(settings.seconds * RATE)
    planes = bounds(places)
    if settings.path == "turntable":
        poses = video_path.turntable(standpoint, places, planes, count)
    else:
        poses = video_path.walk(standpoint, planes, count)
    progress = Progress(count, "video", "pictures")

    def developed() -> Iterator[NDArray[np.uint8]]:
        for pose in poses:
            colour = np.nan_to_num(sources.synthesise(pose, lens).colour)
            yield pictures.develop(colour, exposure, look)
            progress.done()

    if settings.format == "mp4":
        with video(path, (lens.width, lens.height), RATE, is_reproducible=True) as add:
            for picture in developed():
                add(picture)
    else:
        _write_webp(path, developed())


def lens_of(lens: Lens, height: int) -> Rectilinear:
    """Return the lens of a video: it sees as much as the views' own ``lens``, but at most 80°."""
    across, down = np.tan(np.minimum(lens.field_of_view, walk_start.WIDEST) / 2).tolist()
    across = min(across, _LONGEST * down)
    down = min(down, _LONGEST * across)
    width = 2 * round(height * across / down / 2)
    fov = 2 * math.degrees(math.atan(across))
    made = RectilinearSettings(lens="rectilinear", fov=fov, resolution=(width, height)).make()
    assert isinstance(made, Rectilinear)
    return made


def _start(source: OpenDataset, rig: Rig, sources: Sources, lens: Lens) -> tuple[Standpoint, Array]:
    """Return where the eye begins, and the light (n, h, w, 3) of small views."""
    lightfield = source.lightfield
    shown, first = shown_views(lightfield, rig)
    small = source.lens.fitted(min(_SMALL_SIDE, max(source.lens.width, source.lens.height)))
    views = [read(source.views[number], small, has_depth=True) for number in shown]
    depths = depths_of(views, small)
    assert depths is not None
    distances = converted(depths, small.pixel_rays(), lightfield.depth, "distance")
    poses = lightfield.world_from_cameras
    at, ahead = walk_start.start_of(small, poses[shown], distances, first)
    target = video_path.common_target(poses)
    if target is None:
        target = at + ahead * _distance(sources, walk_start.eye(at, ahead), lens)
    return Standpoint(at, target), np.stack([view.colour for view in views])


def _distance(sources: Sources, pose: Array, lens: Lens) -> float:
    """Return the distance in metres of what the middle of the first picture shows."""
    seen = sources.synthesise(pose, lens).distance
    height, width = seen.shape
    y, x = np.mgrid[:height, :width]
    away = np.hypot(x - width / 2, y - height / 2)
    middle = seen[(away < _MIDDLE * height) & np.isfinite(seen)]
    return float(np.median(middle)) if middle.size else float(sources.distances[1])


def _write_webp(path: Path, developed: Iterator[NDArray[np.uint8]]) -> None:
    """Write an animation that repeats for ever. Pillow needs all pictures in memory."""
    first, *others = [Image.fromarray(picture) for picture in developed]
    options: dict[str, Any] = {"append_images": others, "duration": 1000 // RATE, "loop": 0}
    # Whole pictures: else small changes of smooth areas wait for the next whole one, and jump.
    options |= {"kmin": 0, "kmax": 1}
    with atomic_path(path) as temporary:
        first.save(temporary, "WEBP", save_all=True, quality=_WEBP_QUALITY, **options)
