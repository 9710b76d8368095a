"""Makes small pictures of views, because no web page shows EXR files."""

import io
import statistics
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from lightfield.imaging import images, pictures
from lightfield.imaging.look import Look

# Pixels of a thumbnail's longer side.
SIDE = 256
_QUALITY = 85
# The exposure of all thumbnails is the median of so many views', evenly spread over the dataset.
_MEASURED_VIEWS = 9


def exposure_of(views: Sequence[Path], look: Look | None = None) -> float:
    """Return the exposure in stops of the thumbnails of views."""
    step = -(-len(views) // _MEASURED_VIEWS)
    return statistics.median(
        pictures.exposure_for(_light(view)[..., :3], look) for view in views[::step]
    )


def jpeg(view: Path, exposure: float, look: Look | None = None) -> bytes:
    """Return the thumbnail of a view as a JPEG, with a ``look`` if there is one."""
    file = io.BytesIO()
    picture = Image.fromarray(pictures.thumbnail(_light(view), SIDE, exposure, look))
    picture.save(file, "JPEG", quality=_QUALITY)
    return file.getvalue()


def _light(view: Path) -> pictures.Array:
    """Return a view's linear pixels (height, width, 4) with associated alpha."""
    image = images.read_image(view)
    colour = np.where(np.isfinite(image.colour), image.colour, 0)
    alpha = image.channels.get("A", np.ones(colour.shape[:2]))
    return np.dstack([colour, alpha]).astype(np.float32)
