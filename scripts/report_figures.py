"""Draw a dataset's stills: its rig in 3D, and what its panorama says of depth and of noise.

Writes rig, depth_panorama and noise, each as .svg and .png, into --output.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter

from lightfield.core.cli import run
from lightfield.dataset.lightfield import LightField
from lightfield.geometry import rigs
from lightfield.imaging import images
from lightfield.imaging.pictures import luminance
from lightfield.imaging.plots import BLUE, GREY, plot
from lightfield.measurement import noise

# From where the rig is looked at: degrees round it from −Y, and above the ground.
AZIMUTH, ELEVATION = 30.0, 24.0
MISS = "#b0b0b0"
# The noise map has about this many blocks across.
NOISE_BLOCKS = 128


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument("--rig", required=True, type=json.loads, help="the scene YAML's rig, JSON")
    parser.add_argument("--panorama", required=True, type=Path, help="EXR seen from the centre")
    parser.add_argument("--output", required=True, type=Path, help="folder to write to")
    arguments = parser.parse_args()
    poses = LightField.read(arguments.lightfield).matrices
    draw_rig(arguments.output / "rig", rigs.from_settings(arguments.rig), poses)
    panorama = images.read_image(arguments.panorama)
    colour = panorama.colour
    # Without depth the map is grey: the workflow's plan names the same pictures for every dataset.
    depth = panorama.channels.get("Z", np.full(colour.shape[:2], np.nan))
    draw_depth(arguments.output / "depth_panorama", depth.astype(np.float32))
    draw_noise(arguments.output / "noise", colour)


def draw_rig(stem: Path, rig: rigs.Rig, poses: np.ndarray) -> None:
    """Draw each camera as a dot and an arrow along its view, as Figure 2 of the SILVR paper."""
    turn, rise = np.radians(AZIMUTH), np.radians(ELEVATION)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    ahead = np.array([-np.sin(turn) * np.cos(rise), np.cos(turn) * np.cos(rise), -np.sin(rise)])
    screen = np.stack([right, np.cross(right, ahead)], axis=-1)
    places, forwards = poses[:, :3, 3], -poses[:, :3, 2]
    drawn = np.concatenate([places, *rig.outline()])
    extent = np.linalg.norm(np.ptp(drawn, axis=0)) or 1.0
    arrow = min(0.09, 0.5 / np.sqrt(len(poses))) * extent
    order = np.argsort(-(places @ ahead), kind="stable")
    # What is nearer is drawn later and darker.
    near = np.linspace(0.35, 1.0, len(poses))
    ends = places[order] + arrow * forwards[order]
    lines = [line @ screen for line in rig.outline()]
    with plot(stem, size=(7, 6)) as axes:
        axes.add_collection(LineCollection(lines, colors=GREY, linewidths=0.8))
        start, end = places[order] @ screen, ends @ screen
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
        dots = [(*matplotlib.colors.to_rgb(BLUE), alpha) for alpha in near]
        axes.scatter(*start.T, s=min(14.0, 350 / np.sqrt(len(poses))), c=dots, linewidths=0)
        draw_axes(axes, screen, np.concatenate([start, end, *lines]), extent)
        axes.set_aspect("equal")
        axes.set_axis_off()


def draw_axes(axes: Any, screen: np.ndarray, drawn: np.ndarray, extent: float) -> None:
    """Draw X, Y and Z below left of what is ``drawn``, each of a round length, and tell it."""
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


def draw_depth(stem: Path, distance: np.ndarray) -> None:
    """Draw the panorama's distance in metres; what no ray hit is grey."""
    hit = np.where(np.isfinite(distance) & (distance > 0), distance, np.nan)
    known = hit[np.isfinite(hit)]
    low, high = np.percentile(known, [0.1, 99.9]) if known.size else (1.0, 2.0)
    draw_map(stem, hit, (low, max(high, 1.01 * low)), "viridis_r", "distance from the rig's centre")


def draw_noise(stem: Path, colour: np.ndarray) -> None:
    """Draw the panorama's relative noise in percent."""
    block = max(noise.SMALLEST_BLOCK, colour.shape[1] // NOISE_BLOCKS)
    percent = 100 * noise.relative_noise(luminance(colour), block)
    known = percent[np.isfinite(percent) & (percent > 0)]
    low, high = np.percentile(known, [2, 99]) if known.size else (1.0, 2.0)
    draw_map(
        stem, percent, (max(low, high / 1e3), max(high, 1.01 * low)), "magma", "noise of luminance"
    )


def draw_map(
    stem: Path, values: np.ndarray, limits: tuple[float, float], colours: str, label: str
) -> None:
    """Draw an equirectangular map with a logarithmic scale bar; NaN is grey."""
    unit = "m" if "distance" in label else "%"
    with plot(stem, size=(10, 5)) as axes:
        palette = matplotlib.colormaps[colours].with_extremes(bad=MISS)
        picture = axes.imshow(
            np.ma.masked_invalid(values),
            norm=LogNorm(*limits, clip=True),
            cmap=palette,
            extent=(-180, 180, -90, 90),
            interpolation="nearest",
        )
        axes.set(xlabel="azimuth (°)", ylabel="elevation (°)")
        axes.set_xticks(range(-180, 181, 60))
        axes.set_yticks(range(-90, 91, 30))
        axes.grid(False)
        bar = axes.figure.colorbar(
            picture, ax=axes, orientation="horizontal", shrink=0.73, aspect=40
        )
        bar.set_label(f"{label} ({unit}); grey: nothing there")
        shown = FuncFormatter(lambda value, _: f"{value:g}")
        bar.ax.xaxis.set_major_formatter(shown)
        few = limits[1] / limits[0] < 30
        bar.ax.xaxis.set_minor_formatter(shown if few else FuncFormatter(lambda *_: ""))


if __name__ == "__main__":
    run(main)
