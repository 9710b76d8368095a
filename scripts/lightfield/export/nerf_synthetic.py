"""The layout of NeRF's synthetic scenes: RGBA pictures, and a list for train, val and test each.

``transforms_train.json``, ``_val`` and ``_test`` name pictures without their suffix, beside
``camera_angle_x``; poses are camera-to-world with OpenGL axes and Z up, as ours. The test views
validate, too. Source: load_blender.py of the original NeRF.
"""

import math
from pathlib import Path

import numpy as np

from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.dataset.exports import NerfSynthetic
from lightfield.export import cameras
from lightfield.export.source import Source
from lightfield.export.splits import splits
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images


def export(source: Source, settings: NerfSynthetic, folder: Path) -> None:
    """Write a source's views into ``folder``."""
    lens = source.lens
    assert isinstance(lens, Rectilinear)
    angle = 2 * math.atan(lens.width / 2 / cameras.focal_pixels(lens)[0])
    train, test = splits(source.lightfield)
    progress = Progress(len(source.lightfield.views), "nerf_synthetic", "views")
    for part, own in (("train", train), ("test", test)):
        frames = []
        for view in own:
            alpha = source.valid(view).astype(np.uint8) * 255
            images.write_png(
                folder / part / f"{view.name}.png", np.dstack([source.colour(view), alpha])
            )
            frames.append(
                {"file_path": f"./{part}/{view.name}", "transform_matrix": view.matrix.tolist()}
            )
            progress.done()
        for name in ("train",) if part == "train" else ("val", "test"):
            content = {"camera_angle_x": angle, "frames": frames}
            write_json(folder / f"transforms_{name}.json", content)
