"""Writes the pictures of a source's views, and masks of the pixels that show nothing."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from lightfield.core.progress import Progress
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import View
from lightfield.imaging import images


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
) -> Iterator[tuple[View, bool]]:
    """Write each view's picture and mask into ``folder``. Yield the view, and if it has a mask.

    Only views with pixels that show nothing get a mask, unless ``mask_all``. It is 0 in these
    pixels, which consumers ignore, and 255 elsewhere. ``picture`` and ``mask`` are paths, such as
    "images/{}.png" for a view's name. ``views`` are the source's by default. ``write`` writes a
    picture, by default as an 8-bit PNG. Shows the progress under a ``title``.
    """
    views = source.lightfield.views if views is None else views
    write = write or source.write_image
    progress = Progress(len(views), title, "views")
    for view in views:
        write(view, folder / picture.format(view.name))
        valid = source.valid(view)
        has_mask = mask_all or not valid.all()
        if has_mask:
            images.write_png(folder / mask.format(view.name), valid.astype(np.uint8) * 255)
        yield view, has_mask
        progress.done()
