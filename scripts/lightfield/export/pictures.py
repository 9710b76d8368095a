"""Writes a source's views as pictures, their masks of pixels to ignore, and normals as colours."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.progress import Progress
from lightfield.export.source import Bools, Floats, SourceDataset
from lightfield.formats.lightfield import View
from lightfield.imaging import images

# From the axes of Blender's camera (y up, looks along −z) to the axes of normals (y down, looks
# along z).
_FLIP = np.array([1.0, -1.0, -1.0])


def write_pictures(
    source: SourceDataset,
    folder: Path,
    title: str,
    *,
    picture: str,
    mask: str,
    views: Sequence[View] | None = None,
    mask_all: bool = False,
    write: Callable[[View, Path], None] | None = None,
    counts: Callable[[View], Bools] | None = None,
) -> Iterator[tuple[View, bool]]:
    """Write each view's picture and mask into ``folder``. Yield the view, and if it has a mask.

    Only views with pixels that do not count get a mask, unless ``mask_all``. It is 0 in these
    pixels, which consumers ignore, and 255 elsewhere. ``counts`` returns which pixels (height,
    width) of a view count, by default all that show something. ``picture`` and ``mask`` are paths,
    such as "images/{}.png" for a view's name. ``views`` are the source's by default. ``write``
    writes a picture, by default as an 8-bit PNG. Shows the progress under a ``title``.
    """
    views = source.lightfield.views if views is None else views
    write = write or source.write_image
    counts = counts or source.valid
    progress = Progress(len(views), title, "views")
    for view in views:
        write(view, folder / picture.format(view.name))
        counting = counts(view)
        has_mask = mask_all or not counting.all()
        if has_mask:
            images.write_png(folder / mask.format(view.name), counting.astype(np.uint8) * 255)
        yield view, has_mask
        progress.done()


def normal_colours(source: SourceDataset, view: View) -> NDArray[np.uint8]:
    """Return a view's normals (height, width, 3) as colours, (n + 1) / 2 of 255.

    They have the camera's axes: x right, y down and z forward. Grey for none. Raises `UserError` if
    the view has no normals.
    """
    path = source.view(view).pass_path("normal")
    if not path.is_file():
        raise UserError(
            f"{path}: is missing; normals need passes: [normal] in render and in the reprojection"
        )
    world: Floats = source.view(view).normal.astype(np.float64)
    local = world @ view.world_from_camera[:3, :3] * _FLIP
    return np.asarray(np.round((local + 1) / 2 * 255), np.uint8)


def write_z(source: SourceDataset, view: View, path: Path) -> None:
    """Write a view's Z in metres as an EXR, 0 for none. OpenCV reads its channel Y as a plane."""
    depth = source.depth(view, "z")
    known = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    images.write_exr(path, {"Y": known})
