"""Writes a focal stack: what a lens as wide as the plane of cameras would show, focused in turn.

- ``focus_000.png``, or ``.exr`` with linear light, and so on: a picture for each distance.
- ``focal_stack.json``: the ``distance`` in metres of each picture, its camera, the ``aperture``,
  and the views with their weights. The camera has a ``world_matrix`` from the camera to the world,
  and ``focal_length`` and ``principal_point`` in pixels.

`lightfield.export.refocus` says how views become such a picture.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.export import camera_grid, cameras
from lightfield.export.camera_grid import CameraGrid
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import (
    NO_DEPTH,
    NOT_EXR,
    TO_RECTILINEAR,
    Developed,
    Metres,
    plane_refusal,
)
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import Rig
from lightfield.imaging import images
from lightfield.imaging.alpha import divisor

_PICTURES = 12
"""How many distances there are if the settings name none."""

_MOST_BYTES = 400_000_000
"""How much memory the sums of pictures take together, if there are several."""


class FocalStack(Developed):
    """Pictures that are focused at several distances."""

    name = "focal_stack"
    summary = "Pictures refocused at several distances, of a plane of cameras."
    rank = 20
    loader = "import json\npictures = json.load(open('{}/focal_stack.json'))['pictures']"

    format: Literal["png", "exr"] = Field(
        "png", description="Format of the pictures. exr keeps linear light."
    )
    distances: list[Metres] | None = Field(
        None,
        min_length=1,
        max_length=1000,
        description="Distances of the sharp planes from the plane of cameras. Without this key, "
        f"{_PICTURES} distances between the nearest and the farthest surface, evenly spaced in "
        "their inverses.",
        json_schema_extra={"unit": "m"},
    )
    aperture: Metres | None = Field(
        None,
        description="Diameter of a round aperture in the middle of the plane. Without this key, "
        "the aperture is the whole plane.",
        json_schema_extra={"unit": "m"},
    )

    @model_validator(mode="after")
    def _look_is_of_png(self) -> Self:
        if self.look and self.format == "exr":
            raise ValueError("look: is only for format png; an EXR keeps the light")
        return self

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not perspective, as refocusing needs; {TO_RECTILINEAR}"
        if self.format == "exr" and not has_depth:
            return NOT_EXR
        return NO_DEPTH if self.distances is None and not has_depth else None

    def rig_refusal(self, rig: Rig) -> str | None:
        return plane_refusal(rig)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write the pictures and ``focal_stack.json`` into ``folder``."""
        grid = camera_grid.plane_of(source.lightfield)
        # Only here, because its kernels take long to load.
        from lightfield.export import refocus

        distances = self.distances or refocus.inverse_steps(
            *refocus.surface_range(source, grid, "distances"), _PICTURES
        )
        self._note_width(grid, folder)
        weights = refocus.disc_weights(grid, self.aperture)
        entries = []
        pictures = _refocused(source, grid, weights, distances)
        for number, (distance, light) in enumerate(zip(distances, pictures, strict=True)):
            name = f"focus_{number:03}.{self.format}"
            _write(source, light, folder / name)
            entries.append({"file": name, "distance": distance})
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        content = {
            "pictures": entries,
            "aperture": self.aperture,
            "camera": {
                "world_matrix": np.round(grid.world_from_centre, 12).tolist(),
                "resolution": [lens.width, lens.height],
                "focal_length": cameras.focal_pixels(lens),
                "principal_point": lens.center,
            },
            "views": {
                source.lightfield.views[number].name: weight
                for number, weight in zip(
                    grid.views.ravel().tolist(), weights.ravel().tolist(), strict=True
                )
                if weight > 0
            },
        }
        write_json(folder / "focal_stack.json", content)

    def _note_width(self, grid: CameraGrid, folder: Path) -> None:
        """Print a note if the plane of cameras, with half a cell around it, cuts the aperture."""
        counts = (len(grid.right), len(grid.up))
        sides = [count * cell for count, cell in zip(counts, grid.cell, strict=True) if count > 1]
        if self.aperture and self.aperture > (1 + 1e-9) * min(sides):
            size = " × ".join(f"{side:.3g}" for side in sides)
            print(
                f"note: {folder}: the aperture, {self.aperture:g} m, is wider than the cameras "
                f"reach, {size} m, so it is cut off there"
            )


def _refocused(
    source: SourceDataset, grid: CameraGrid, weights: Floats, distances: list[float]
) -> Iterator[NDArray[np.float32]]:
    """Yield linear light with alpha (height, width, 4) for each distance.

    Reads the views once for as many distances as fit in `_MOST_BYTES`.
    """
    from lightfield.export.refocus import MovableView, disparities, mean_light

    lens = source.lens
    assert isinstance(lens, Rectilinear)
    shape = (lens.height, lens.width, 5)
    together = max(1, _MOST_BYTES // (4 * math.prod(shape)))
    batches = [distances[first:][:together] for first in range(0, len(distances), together)]
    places = np.argwhere(weights > 0).tolist()
    progress = Progress(len(places) * len(batches), "focal_stack", "views")
    for batch in batches:
        totals = [np.zeros(shape, np.float32) for _ in batch]
        moves = [disparities(grid, cameras.focal_pixels(lens), distance) for distance in batch]
        for row, column in places:
            view = source.lightfield.views[grid.views[0, row, column]]
            movable = MovableView(source.light(view), source.valid(view))
            for total, move in zip(totals, moves, strict=True):
                right, down = move[row, column].tolist()
                movable.add_to(total, right, down, float(weights[row, column]))
            progress.done()
        for distance, total in zip(batch, totals, strict=True):
            if not total[..., 4].any():
                raise UserError(
                    f"{source.lightfield.path}: distances: {distance:g} m is so near that the "
                    "views show nothing of the middle's picture"
                )
            yield mean_light(total)


def _write(source: SourceDataset, light: NDArray[np.float32], path: Path) -> None:
    """Write linear light with alpha (height, width, 4) as the suffix of ``path`` says."""
    is_transparent = source.lightfield.transparent
    colour, alpha = light[..., :3], light[..., 3:]
    if path.suffix == ".exr":
        planes = {name: light[..., channel] for channel, name in enumerate("RGBA")}
        images.write_exr(path, planes if is_transparent else {name: planes[name] for name in "RGB"})
    elif is_transparent:
        covered = divisor(alpha)
        pixels = source.developed(colour / covered, covered)
        opacity = np.rint(alpha * 255).astype(np.uint8)
        images.write_png(path, np.concatenate([pixels, opacity], axis=-1))
    else:
        images.write_png(path, source.developed(colour))
