"""Table of the camera setups of scenes, as Table 2 of the SILVR paper has them, beside its figures.

For every rig: views, cameras along each axis, size, mean distance to the nearest camera at another
place, mean distance between the neighbours of the camera grid, and the immersive interpolation
volume by its definition in the paper (lightfield/geometry/interpolation_volume.py says how).
"""

import argparse
import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core import cli
from lightfield.core.files import atomic_path
from lightfield.dataset import config
from lightfield.geometry import rigs
from lightfield.geometry.interpolation_volume import (
    interpolation_volume,
    neighbour_spacing,
    spacing,
)

# Views and mean distance in centimetres as printed in the paper's Table 2, by the published names.
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


@dataclass(frozen=True)
class Row:
    """One rig; lengths in metres, volumes in m³, NaN or None where a figure has no meaning."""

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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+", type=Path, help="scene YAML files")
    parser.add_argument("--markdown", type=Path, required=True, help="table to write")
    parser.add_argument("--csv", type=Path, required=True, help="the same figures, unrounded")
    arguments = parser.parse_args()
    rows = [
        row(path.stem, name, rig)
        for path in arguments.scenes
        for name, rig in config.read_scene(path).rigs.items()
    ]
    text = markdown(rows)
    print(text, end="")
    with atomic_path(arguments.markdown) as temporary:
        temporary.write_text(text, encoding="utf-8")
    with (
        atomic_path(arguments.csv) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        write_csv(rows, file)


def row(scene: str, name: str, rig: rigs.Rig) -> Row:
    """Compute one rig's line of the table."""
    positions = np.array([view.position for view in rig.poses()[:: rig.views_a_position]])
    volume = interpolation_volume(rig, rig.camera.make())
    if isinstance(rig, rigs.Sphere) and np.ptp(rig.sides) == 0:
        extent = f"⌀ {rig.sides[0]:g} m"
    else:
        extent = " × ".join(f"{side:g}" for side in rig.sides) + " m"
    return Row(
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


def markdown(rows: list[Row]) -> str:
    lines = [
        "# Camera setups",
        "",
        "| scene | rig | views (printed) | along X, Y, Z | size | nearest camera | neighbours "
        "| printed | immersive interpolation volume | within the cameras' surface | box or ball |",
        "| --- | --- | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for row in rows:
        views, distance = row.printed or ("–", None)
        printed = f"{distance} cm" if distance else "–"
        lines.append(
            f"| {row.scene} | {row.rig} | {row.views} ({views}) | {row.along} | {row.size} "
            f"| {centimetres(row.nearest)} | {centimetres(row.neighbours)} | {printed} "
            f"| {cubic_metres(row.immersive)} | {cubic_metres(row.enclosed)} "
            f"| {cubic_metres(row.formula)} |"
        )
    lines += [
        "",
        "*Nearest camera*: mean over all cameras of the distance to the nearest camera at another "
        "place, which is what the paper says it prints. *Neighbours*: mean length of the camera "
        "grid's edges. *Immersive interpolation volume*: points for which every ray in every "
        "direction crosses the cameras' surface between neighbouring cameras that all see it; "
        "exact for 180° fisheyes and full panoramas. A plane and a cylinder are open, so theirs "
        "is 0. Panoramas at a cube's corners have one only formally: the paper counts cameras "
        "metres apart as too sparse to interpolate.",
        "",
        "## Differences from the printed table",
        "",
        *(differences(rows) or ["None."]),
        "",
    ]
    return "\n".join(lines)


def differences(rows: list[Row]) -> list[str]:
    """Say in words where a computed figure is not the printed one."""
    found = []
    published = [row for row in rows if row.printed]
    for row in published:
        assert row.printed
        views, distance = row.printed
        where = f"- {row.scene}/{row.rig}:"
        if row.views != views:
            found.append(f"{where} {row.views} views, printed {views}.")
        if round(100 * row.nearest) != distance:
            same = round(100 * row.neighbours) == distance
            found.append(
                f"{where} the nearest camera is {centimetres(row.nearest)} away on average, "
                f"printed {distance} cm; the mean over all neighbours, "
                f"{centimetres(row.neighbours)}, "
                + ("agrees with the print." if same else "does not agree either.")
            )
    volumes = [row.immersive for row in published if row.immersive is not None]
    if {row.rig for row in published} == set(PRINTED):
        low, high = PRINTED_VOLUMES
        if round(min(volumes), 1) != low or round(max(volumes)) != high:
            found.append(
                f"- The paper's abstract gives volumes of {low} to {high:g} m³; computed, they are "
                f"{min(volumes):.3g} to {max(volumes):.3g} m³."
            )
    return found


def write_csv(rows: list[Row], file: Any) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(
        [
            *("scene", "rig", "views", "printed_views", "along_xyz", "size"),
            *("nearest_m", "neighbours_m", "printed_m"),
            *("immersive_interpolation_volume_m3", "enclosed_m3", "box_or_ball_m3"),
        ]
    )
    for row in rows:
        views, distance = row.printed or (None, None)
        writer.writerow(
            [
                *(row.scene, row.rig, row.views, views, row.along, row.size),
                *(row.nearest, row.neighbours, distance and distance / 100),
                *(row.immersive, row.enclosed, row.formula),
            ]
        )


def centimetres(metres: float) -> str:
    return "–" if math.isnan(metres) else f"{100 * metres:.1f} cm"


def cubic_metres(volume: float | None) -> str:
    return "–" if volume is None else f"{volume:.3g} m³"


if __name__ == "__main__":
    cli.run(main)
