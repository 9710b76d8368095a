"""Writes the layout of the HCI 4D light field benchmark, for a plane of parallel pinhole cameras.

- ``input_Cam000.png`` and so on: the views row by row, from the top left as the cameras see it.
- ``parameters.cfg``: the cameras.
- ``gt_depth_lowres_Cam….pfm``: Z in metres, for each view.
- ``gt_disp_lowres_Cam….pfm``: disparity, for each view. Also ``.exr``, if the settings ask for it.

The middle view's ``.pfm`` maps also exist without a number. A disparity is the number of pixels
that a point moves between neighbours, d = b f (1 / Z − 1 / F). Parallel cameras have F = ∞, written
as `_FOCUS`.
Source: Honauer et al. 2016, and the benchmark's parameters.
"""

import math
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lightfield.core.errors import UserError
from lightfield.core.files import write_bytes, write_text
from lightfield.core.progress import Progress
from lightfield.export import camera_grid, cameras
from lightfield.export.source import Floats, SourceDataset
from lightfield.exporters.base import NO_DEPTH, Developed, centred_pinhole, plane_refusal
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import Rig
from lightfield.geometry.rigs.plane import Plane
from lightfield.imaging import images

_FOCUS = 1e9  # metres


class Hci(Developed):
    """The layout of the HCI 4D light field benchmark, with disparities."""

    name = "hci"
    summary = "Layout of the HCI 4D light field benchmark, for programs that read it."
    rank = 7
    loader = (
        "import configparser\nparameters = configparser.ConfigParser()\n"
        "parameters.read('{}/parameters.cfg')"
    )

    disparity: Literal["exr"] | None = Field(
        None,
        description="exr: also write the disparity maps as EXR, with a channel Y of 32-bit floats, "
        "in pixels between neighbouring views.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return centred_pinhole(lens) or (None if has_depth else NO_DEPTH)

    def rig_refusal(self, rig: Rig) -> str | None:
        if refusal := plane_refusal(rig):
            return refusal
        assert isinstance(rig, Plane)
        steps = rig.steps
        if math.isclose(steps[0], steps[-1], rel_tol=1e-6):
            return None
        return (
            f"has cameras {steps[0]:g} m apart across and {steps[1]:g} m apart down, which are "
            "equal in HCI's layout; give it a baseline in place of size"
        )

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        views, columns, baseline = grid(source.lightfield)
        lens = source.lens
        assert isinstance(lens, Rectilinear)
        middle = len(views) // columns // 2 * columns + columns // 2
        disparities: list[float] = []
        progress = Progress(len(views), "hci", "views")
        for number, view in enumerate(views):
            source.write_image(view, folder / f"input_Cam{number:03}.png")
            depth = source.depth(view, "z")
            with np.errstate(divide="ignore"):
                disparity = np.nan_to_num(baseline * cameras.focal_pixels(lens)[0] / depth)
            maps = {"depth": np.where(np.isfinite(depth), depth, 0), "disp": disparity}
            for name, values in maps.items():
                _write_pfm(folder / f"gt_{name}_lowres_Cam{number:03}.pfm", values)
                if number == middle:
                    _write_pfm(folder / f"gt_{name}_lowres.pfm", values)
            if self.disparity == "exr":
                plane = disparity.astype(np.float32)
                images.write_exr(folder / f"gt_disp_lowres_Cam{number:03}.exr", {"Y": plane})
            disparities += [float(np.min(disparity)), float(np.max(disparity))]
            progress.done()
        write_text(
            folder / "parameters.cfg",
            parameters(
                source, views[middle], (columns, len(views) // columns), baseline, disparities
            ),
        )


def grid(lightfield: LightField) -> tuple[list[View], int, float]:
    """Return the views row by row, the number in a row, and their distance in metres.

    Raises `UserError` if the views are not a regular grid in the plane of their images.
    """
    grid = camera_grid.find(lightfield.world_from_cameras)
    steps = grid.steps if grid else np.empty(0)
    if not grid or not grid.is_flat or not steps.size or np.ptp(steps) >= 1e-6 * np.max(steps):
        raise UserError(
            f"{lightfield.path}: frames: are not a grid of cameras that look in parallel, with "
            "equal distances across and down; this layout needs one: give the plane a baseline"
        )
    views = [lightfield.views[number] for number in grid.views.ravel().tolist()]
    return views, len(grid.right), float(steps.mean())


def parameters(
    source: SourceDataset,
    middle: View,
    size: tuple[int, int],
    baseline: float,
    disparities: list[float],
) -> str:
    """Return the text of parameters.cfg. ``baseline`` is in metres."""
    lens = source.lens
    assert isinstance(lens, Rectilinear)
    center = zip(
        ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"),
        [*middle.position.tolist(), *middle.rotation.tolist()],
        strict=True,
    )
    sections = {
        "intrinsics": {
            "focal_length_mm": lens.focal_length,
            "image_resolution_x_px": lens.width,
            "image_resolution_y_px": lens.height,
            "sensor_size_mm": max(lens.sensor),
            "fstop": 100.0,  # no depth of field
        },
        "extrinsics": {
            "num_cams_x": size[0],
            "num_cams_y": size[1],
            "baseline_mm": 1000 * baseline,
            "focus_distance_m": _FOCUS,
            **{f"center_cam_{key}": value for key, value in center},
            "offset": 0.0,
        },
        "meta": {
            "scene": source.scene_name,
            "category": "additional",
            "disp_min": min(disparities),
            "disp_max": max(disparities),
            "depth_map_scale": 1.0,
        },
    }
    texts = []
    for name, section in sections.items():
        lines = [f"{key} = {value}\n" for key, value in section.items()]
        texts.append("".join([f"[{name}]\n", *lines]))
    return "\n".join(texts)


def _write_pfm(path: Path, values: Floats | NDArray[np.float32]) -> None:
    """Write a (height, width) map as a portable float map: float32, the lowest row first."""
    height, width = values.shape
    head = f"Pf\n{width} {height}\n-1.0\n".encode()
    write_bytes(path, head + np.flipud(values).astype("<f4").tobytes())
