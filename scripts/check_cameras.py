"""Find cameras of a dataset that are inside geometry, or that would show it wrongly.

The workflow runs this before it renders.
"""

import argparse
import sys
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument("--inventory", type=Path, help="JSON of the scene's contents")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    import bpy
    import numpy as np

    from lightfield.dataset.inventory import read_inventory
    from lightfield.dataset.lightfield import LightField
    from lightfield.rendering import blend_file, clearance, drawings
    from lightfield.rendering.clearance import REACH, TOUCHING
    from lightfield.rendering.limits import warnings

    lightfield = LightField.read(arguments.lightfield)
    names = [view.name for view in lightfield.views]
    positions = np.array([view.position for view in lightfield.views])
    path = arguments.inventory
    inventory = path and read_inventory(path, "external_files")
    blend_file.open_scene(arguments.blend, lightfield.content.get("scene", {}), inventory)
    bpy.context.scene.frame_set(lightfield.frame)
    clearance.show_what_is_rendered()
    distances = clearance.clearances(positions)
    enclosures = clearance.enclosures(positions)
    inside = clearance.enclosing_objects(enclosures)
    views = {
        name: {
            "distance": None if np.isinf(distance) else round(float(distance), 6),
            "inside": enclosing is not None or bool(distance < TOUCHING),
        }
        for name, distance, enclosing in zip(names, distances, inside, strict=True)
    }
    enclosed_views = [name for name in names if views[name]["inside"]]
    if enclosed_views:
        objects = sorted({enclosing for enclosing in inside if enclosing}) or ["a surface"]
        more = " …" if len(enclosed_views) > 8 else ""
        raise UserError(
            f"{arguments.lightfield}: {len(enclosed_views)} of {len(names)} cameras are inside "
            f"{', '.join(objects)}: {', '.join(enclosed_views[:8])}{more}; "
            "move the rig or make it smaller (center and size in the scene YAML)"
        )
    write_json(arguments.output, {"views": views})
    camera_type = lightfield.content["camera"]["type"]
    for warning in (
        *clearance.open_mesh_warnings(enclosures),
        *warnings(positions, distances),
        *drawings.warnings(camera_type),
    ):
        print(f"warning: {warning}", file=sys.stderr)
    nearest = min(distances)
    away = f"{nearest:.3f} m" if nearest < REACH else f"more than {REACH} m"
    print(f"{len(names)} cameras, none inside geometry; the nearest surface is {away} away")


if __name__ == "__main__":
    run(main)
