"""Writes a table of camera setups, like Table 2 of the SILVR paper, beside its printed figures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.dataset import scene_yaml
from lightfield.geometry import rigs
from lightfield.geometry.interpolation_volume import (
    interpolation_volume,
    neighbour_spacing,
    spacing,
)

# Views and mean distance in centimetres from the paper's Table 2, by the published names.
PRINTED = {
    "LFCuboid_1mx3mx1m": (1400, 11),
    "LFSphere_e105cm_d145cm": (642, 9),
    "LFCuboid_4mx4mx3m": (2226, 20),
    "LFSphere_e220cm_d400cm": (642, 31),
    "LFCuboid_2x2x1": (1806, 10),
    "LFSphere_e100cm_d170cm": (642, 13),
}
# The range of the volumes of all of these, in m³, from the paper's abstract.
PRINTED_VOLUMES = (2.2, 48.0)

HEAD = """\
# Camera setups

| scene | rig | views (printed) | along X, Y, Z | size | nearest camera | neighbours | printed \
| immersive interpolation volume | within the cameras' surface | box or ball |
| --- | --- | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |
"""
NOTES = """
*Nearest camera*: mean over all cameras of the distance to the nearest camera at another place, \
which is what the paper says it prints. *Neighbours*: mean length of the camera grid's edges. \
*Immersive interpolation volume*: points for which every ray in every direction crosses the \
cameras' surface between neighbouring cameras that all see it; exact for 180° fisheyes and full \
panoramas. A plane and a cylinder are open, so theirs is 0. Panoramas at a cube's corners have one \
only formally: the paper counts cameras metres apart as too sparse to interpolate.

## Differences from the printed table

"""


@dataclass(frozen=True)
class Setup:
    """One rig. Lengths in metres, volumes in m³. NaN or None where a figure has no meaning."""

    scene: str
    rig: str
    views: int
    along: str
    size: str
    nearest: float
    neighbours: float
    immersive: float | None
    enclosed: float | None
    formula: float | None

    @property
    def printed(self) -> tuple[int, int] | None:
        return PRINTED.get(self.rig)

    def figures(self) -> dict[str, Any]:
        """Return the line of the CSV, unrounded."""
        views, distance = self.printed or (None, None)
        return {
            "scene": self.scene,
            "rig": self.rig,
            "views": self.views,
            "printed_views": views,
            "along_xyz": self.along,
            "size": self.size,
            "nearest_m": self.nearest,
            "neighbours_m": self.neighbours,
            "printed_m": distance and distance / 100,
            "immersive_interpolation_volume_m3": self.immersive,
            "enclosed_m3": self.enclosed,
            "box_or_ball_m3": self.formula,
        }


def read_setups(scenes: Sequence[Path]) -> list[Setup]:
    """Compute the line of every rig of the scene YAMLs."""
    return [
        _setup(path.stem, name, rig)
        for path in scenes
        for name, rig in scene_yaml.read_scene(path).rigs.items()
    ]


def _setup(scene: str, name: str, rig: rigs.Rig) -> Setup:
    if isinstance(rig, rigs.BlendCamera):
        # Only the .blend has its position.
        return Setup(scene, name, rig.view_count, "–", "–", math.nan, math.nan, None, None, None)
    positions = np.array([view.position for view in rig.poses()[:: rig.views_a_position]])
    volume = interpolation_volume(rig, rig.camera.make())
    if isinstance(rig, rigs.Sphere) and np.ptp(rig.sides) == 0:
        extent = f"⌀ {rig.sides[0]:g} m"
    else:
        sides = np.ptp(positions, axis=0) if rig.is_loose else rig.sides
        extent = " × ".join(f"{side:g}" for side in sides) + " m"
    return Setup(
        scene=scene,
        rig=name,
        views=rig.view_count,
        along=", ".join(map(str, rig.cameras)) if isinstance(rig, rigs.Grid) else "–",
        size=extent,
        nearest=spacing(positions),
        neighbours=neighbour_spacing(rig.cells() or [], positions),
        immersive=volume.immersive if volume else None,
        enclosed=volume.enclosed if volume else None,
        formula=rig.unit_volume and rig.unit_volume * float(np.prod(rig.sides)),
    )


def markdown(setups: Sequence[Setup]) -> str:
    """Return the table, and a line for each figure that differs from the printed one."""
    lines = []
    for setup in setups:
        views, distance = setup.printed or ("–", None)
        cells = (
            setup.scene,
            setup.rig,
            f"{setup.views} ({views})",
            setup.along,
            setup.size,
            _centimetres(setup.nearest),
            _centimetres(setup.neighbours),
            f"{distance} cm" if distance else "–",
            _cubic_metres(setup.immersive),
            _cubic_metres(setup.enclosed),
            _cubic_metres(setup.formula),
        )
        lines.append(f"| {' | '.join(cells)} |\n")
    return HEAD + "".join(lines) + NOTES + "\n".join(_differences(setups) or ["None."]) + "\n"


def _differences(setups: Sequence[Setup]) -> list[str]:
    differences = []
    published = [setup for setup in setups if setup.printed]
    for setup in published:
        assert setup.printed
        views, distance = setup.printed
        where = f"- {setup.scene}/{setup.rig}:"
        if setup.views != views:
            computed = "1 view" if setup.views == 1 else f"{setup.views} views"
            differences.append(f"{where} {computed}, printed {views}.")
        if math.isnan(setup.nearest):
            differences.append(f"{where} its camera has no neighbour, printed {distance} cm.")
        elif round(100 * setup.nearest) != distance:
            same = not math.isnan(setup.neighbours) and round(100 * setup.neighbours) == distance
            differences.append(
                f"{where} the nearest camera is {_centimetres(setup.nearest)} away on average, "
                f"printed {distance} cm; the mean over all neighbours, "
                f"{_centimetres(setup.neighbours)}, "
                + ("agrees with the print." if same else "does not agree either.")
            )
    volumes = [setup.immersive for setup in published if setup.immersive is not None]
    if {setup.rig for setup in published} == set(PRINTED):
        low, high = PRINTED_VOLUMES
        if round(min(volumes), 1) != low or round(max(volumes)) != high:
            differences.append(
                f"- The paper's abstract gives volumes of {low} to {high:g} m³; computed, they are "
                f"{min(volumes):.3g} to {max(volumes):.3g} m³."
            )
    return differences


def _centimetres(metres: float) -> str:
    return "–" if math.isnan(metres) else f"{100 * metres:.1f} cm"


def _cubic_metres(volume: float | None) -> str:
    return "–" if volume is None else f"{volume:.3g} m³"
