"""Draws a dataset's stills: overview, contact sheet, the rig, and maps of depth and noise.

The overview is a panorama from the rig's centre. Without a panorama it is the middle view.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.ticker import FuncFormatter

from lightfield.core.errors import UserError
from lightfield.export.trainer_splits import splits
from lightfield.geometry.depth import converted
from lightfield.geometry.overview import middle_view
from lightfield.geometry.rigs import Rig
from lightfield.geometry.rigs.grid import box_outline
from lightfield.imaging import images, noise, pictures
from lightfield.imaging.pictures import Array
from lightfield.imaging.plots import BLUE, GREY, ORANGE, PURPLE, plot
from lightfield.reading.dataset import OpenDataset, OpenView
from lightfield.report import contact_sheet
from lightfield.stages.report import ReportFigures

# The viewpoint of the rig's drawing, in degrees: round the rig from −Y, and above the ground.
_AZIMUTH = 30.0
_ELEVATION = 24.0
MISS = "#b0b0b0"
# The noise map has about this many blocks across.
_NOISE_BLOCKS = 128
# The box of a scene follows from so many views, with so many points across each. This part in
# percent of the points may lie outside on each side.
_BOX_VIEWS = 8
_BOX_POINTS = 96
_OUTSIDE = 0.1
# A scene is drawn if it is at most so many times as long as the rig.
_LARGEST_SCENE = 4.0
_PART_COLOURS = {None: BLUE, "train": BLUE, "validation": ORANGE, "test": PURPLE}
DEPTHS = {"z": "Z-depth", "distance": "distance from the camera", None: "no depth"}


@dataclass(frozen=True)
class Overview:
    """Linear ``colour`` (height, width, 3), and ``depth`` (height, width) in metres or NaN."""

    colour: Array
    depth: Array
    is_panorama: bool
    depth_label: str


def draw(job: ReportFigures) -> None:
    """Write all pictures of a dataset."""
    dataset = job.dataset
    output = job.output
    opened = OpenDataset.in_folder(dataset)
    lightfield = opened.lightfield
    rig = lightfield.placed(job.settings.rig)
    lightfield.require_rig(rig)
    views = [view.path for view in opened.views]
    lens = lightfield.lens
    layout = contact_sheet.layout(rig, len(views))
    shown = [views[number] for number in layout.views]
    look = job.settings.look.resolved(lightfield) if job.settings.look else None
    sheet = contact_sheet.sheet(shown, lens.width, lens.height, look, layout.columns)
    images.write_png(output / "contact_sheet.png", sheet)
    parts = [view.split for view in lightfield.views]
    if job.settings.chooses_tests:
        tests = {view.name for view in splits(lightfield).test}
        parts = ["test" if view.name in tests else "train" for view in lightfield.views]
    box = scene_box(opened)
    draw_rig(output / "rig", rig, lightfield.world_from_cameras, parts, box)
    if job.panorama:
        overview = _read_panorama(job.panorama)
    else:
        overview = read_view(opened.views[middle_view(rig)])
    exposure = pictures.exposure_for(overview.colour, look)
    images.write_png(output / "overview.png", pictures.develop(overview.colour, exposure, look))
    _draw_depth(output / "depth", overview)
    draw_noise(output / "noise", overview)


def _read_panorama(path: Path) -> Overview:
    image = images.read_image(path)
    unknown = np.full(image.colour.shape[:2], np.nan, np.float32)
    depth = image.channels.get("Z", unknown).astype(np.float32)
    return Overview(image.colour, depth, True, "distance from the rig's centre")


def read_view(view: OpenView) -> Overview:
    """Read a view. Return a black overview if it cannot be read: validation reports that."""
    lens = view.lens
    label = DEPTHS[view.dataset.depth]
    unknown = np.full((lens.height, lens.width), np.nan, np.float32)
    try:
        image = view.image()
        colour = np.nan_to_num(image.colour, posinf=0, neginf=0)
        depth = image.channels.get("Z", unknown)
    except UserError as error:
        print(f"warning: {error}", file=sys.stderr)
        return Overview(np.stack([np.zeros_like(unknown)] * 3, axis=-1), unknown, False, label)
    return Overview(colour, np.where(view.has_ray, depth, np.nan).astype(np.float32), False, label)


def scene_box(dataset: OpenDataset) -> Array | None:
    """Return the lowest and the highest corner (2, 3) of what some views show, in metres.

    None if they have no depth, or hit nothing.
    """
    if dataset.depth is None:
        return None
    step = math.ceil(len(dataset.views) / _BOX_VIEWS)
    seen = np.concatenate([_points_of(view) for view in dataset.views[::step]])
    return np.percentile(seen, [_OUTSIDE, 100 - _OUTSIDE], axis=0) if len(seen) else None


def _points_of(view: OpenView) -> Array:
    """Return points (n, 3) of the world that a view shows. None of them if it cannot be read."""
    assert view.dataset.depth
    overview = read_view(view)
    every = math.ceil(overview.depth.shape[1] / _BOX_POINTS)
    rays = view.lens.pixel_rays()[::every, ::every]
    depth = overview.depth[::every, ::every]
    distance = converted(depth, rays, view.dataset.depth, "distance")
    is_hit = np.isfinite(distance) & (distance > 0)
    points = (rays * distance[..., None])[is_hit] @ view.world_from_camera[:3, :3].T
    in_world: Array = points + view.world_from_camera[:3, 3]
    return in_world


def draw_rig(
    stem: Path,
    rig: Rig,
    poses: Array,
    parts: Sequence[str | None],
    scene: Array | None = None,
) -> None:
    """Draw each camera as a dot with an arrow along its view, as Figure 2 of the SILVR paper does.

    ``poses`` are (n, 4, 4). ``parts`` (n,) of the split, such as train and test, have colours.
    ``scene`` (2, 3) is the scene's box. It is drawn only if the rig does not look lost in it.
    """
    turn = np.radians(_AZIMUTH)
    rise = np.radians(_ELEVATION)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    ahead = np.array([-np.sin(turn) * np.cos(rise), np.cos(turn) * np.cos(rise), -np.sin(rise)])
    screen = np.stack([right, np.cross(right, ahead)], axis=-1)
    places = poses[:, :3, 3]
    forwards = -poses[:, :3, 2]
    drawn = np.concatenate([places, *rig.outline()])
    extent = float(np.linalg.norm(np.ptp(drawn, axis=0))) or 1.0
    arrow = min(0.09, 0.5 / np.sqrt(len(poses))) * extent
    order = np.argsort(-(places @ ahead), kind="stable")
    # Draw nearer cameras later and darker.
    near = np.linspace(0.35, 1.0, len(poses))
    ends = places[order] + arrow * forwards[order]
    lines = [line @ screen for line in rig.outline()]
    box = []
    if scene is not None and np.linalg.norm(scene[1] - scene[0]) <= _LARGEST_SCENE * extent:
        sides = [line + 0.5 for line in box_outline()]
        box = [(scene[0] + side * (scene[1] - scene[0])) @ screen for side in sides]
    with plot(stem, size=(7, 6)) as axes:
        axes.add_collection(LineCollection(lines, colors=GREY, linewidths=0.8))
        if box:
            edges = LineCollection(box, colors=ORANGE, linewidths=0.8, linestyles="dashed")
            edges.set_gid("scene")
            axes.add_collection(edges)
            axes.plot([], [], color=ORANGE, linewidth=0.8, linestyle="dashed", label="scene")
        start = places[order] @ screen
        end = ends @ screen
        axes.quiver(
            *start.T,
            *(end - start).T,
            color=[(0.0, 0.0, 0.0, alpha) for alpha in near],
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.0022,
            headwidth=4,
            headlength=5,
        )
        colours = [_PART_COLOURS[parts[view]] for view in order]
        dots = [(*to_rgb(colour), alpha) for colour, alpha in zip(colours, near, strict=True)]
        area = min(20.0, 350 / np.sqrt(len(poses)))
        axes.scatter(*start.T, s=area, c=dots, linewidths=0)
        # The few views that validate or test are larger, and never pale.
        held_out = [row for row, view in enumerate(order) if parts[view] in ("validation", "test")]
        if held_out:
            held_out_colours = [colours[row] for row in held_out]
            axes.scatter(*start[held_out].T, s=2 * area, c=held_out_colours, linewidths=0)
        for part in sorted({part for part in parts if part}, reverse=True):
            axes.scatter(
                [], [], s=20, color=_PART_COLOURS[part], label=f"{part} {parts.count(part)}"
            )
        if any(parts) or box:
            axes.legend(loc="upper right")
        _draw_axes(axes, screen, np.concatenate([start, end, *lines, *box]), extent)
        axes.set_aspect("equal")
        axes.set_axis_off()


def _draw_axes(axes: Any, screen: Array, drawn: Array, extent: float) -> None:
    """Draw the axes X, Y and Z below left of the points ``drawn``. Their length is round."""
    length = 10.0 ** np.floor(np.log10(0.3 * extent))
    length *= max(step for step in (1, 2, 5) if step * length <= 0.3 * extent)
    corner = drawn.min(axis=0) - 0.12 * extent
    for name, axis in zip("XYZ", screen, strict=True):
        tip = corner + length * axis
        axes.annotate("", tip, corner, arrowprops={"arrowstyle": "->", "color": GREY, "shrinkA": 0})
        axes.annotate(
            name, corner + 1.22 * (tip - corner), ha="center", va="center", color="#333333"
        )
    axes.annotate(
        f"axes: {length:g} m", corner, (0, -30), textcoords="offset points", color="#333333"
    )
    axes.update_datalim([corner - 0.1 * extent, drawn.max(axis=0) + 0.03 * extent])
    axes.autoscale_view()


def _draw_depth(stem: Path, overview: Overview) -> None:
    """Draw depth in metres. Misses are grey."""
    depth = overview.depth
    hit = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)
    depths = hit[np.isfinite(hit)]
    low, high = np.percentile(depths, [0.1, 99.9]) if depths.size else (1.0, 2.0)
    label = f"{overview.depth_label} (m)"
    _draw_map(stem, hit, (low, max(high, 1.01 * low)), "viridis_r", label, overview.is_panorama)


def draw_noise(stem: Path, overview: Overview) -> None:
    """Draw the relative noise in percent."""
    block = max(noise.SMALLEST_BLOCK, overview.colour.shape[1] // _NOISE_BLOCKS)
    percent = 100 * noise.relative_noise(pictures.luminance(overview.colour), block)
    if not percent.size:
        # The picture is smaller than a block.
        percent = np.full((1, 1), np.nan)
    measured = percent[np.isfinite(percent) & (percent > 0)]
    low, high = np.percentile(measured, [2, 99]) if measured.size else (1.0, 2.0)
    limits = (max(low, high / 1e3), max(high, 1.01 * low))
    _draw_map(stem, percent, limits, "magma", "noise of luminance (%)", overview.is_panorama)


def _draw_map(
    stem: Path,
    values: Array,
    limits: tuple[float, float],
    colours: str,
    label: str,
    is_panorama: bool,
) -> None:
    """Draw an image's values with a logarithmic scale bar. NaN is grey."""
    height, width = values.shape
    size = (10, 5) if is_panorama else (6, 1 + min(6, 6 * height / width))
    with plot(stem, size=size) as axes:
        palette = matplotlib.colormaps[colours].with_extremes(bad=MISS)
        picture = axes.imshow(
            values,
            norm=LogNorm(*limits, clip=True),
            cmap=palette,
            extent=(-180, 180, -90, 90) if is_panorama else None,
            interpolation="nearest",
        )
        axes.grid(False)
        if is_panorama:
            axes.set(xlabel="azimuth (°)", ylabel="elevation (°)")
            axes.set_xticks(range(-180, 181, 60))
            axes.set_yticks(range(-90, 91, 30))
        else:
            axes.set_axis_off()
        bar = axes.figure.colorbar(
            picture, ax=axes, orientation="horizontal", shrink=0.73, aspect=40
        )
        bar.set_label(f"{label}; grey: nothing there")
        labels = FuncFormatter(lambda value, _: f"{value:g}")
        bar.ax.xaxis.set_major_formatter(labels)
        has_few_labels = limits[1] / limits[0] < 30
        no_labels = FuncFormatter(lambda *_: "")
        bar.ax.xaxis.set_minor_formatter(labels if has_few_labels else no_labels)
