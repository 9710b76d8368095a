"""Writes what a scene's geometry says of cameras: free places for them, and their clearance."""

import sys
from pathlib import Path

import numpy as np

from lightfield.configuration.job_settings import FreePlacesSettings
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import LightField
from lightfield.rendering import blend_file, clearance, drawings, frames
from lightfield.rendering.clearance import REACH, TOUCHING
from lightfield.rendering.limits import warnings


def write_places(
    blend: Path, settings: FreePlacesSettings, inventory: Path | None, output: Path
) -> None:
    """Write the places of a random rig's cameras. Raises `UserError` if there are too few."""
    rig = settings.rig
    contents = read_inventory(inventory, "external_files") if inventory else None
    blend_file.open_scene(blend, settings.model_dump(), contents)
    if isinstance(settings.frame, int):
        frames.go_to(settings.frame)
    clearance.show_what_is_rendered()
    places = clearance.free_places(rig)
    write_json(output, {"box": rig.box, "places": places.tolist()})
    print(f"{len(places)} cameras, each with {rig.clearance:g} m of free space around it")


def write_clearance(blend: Path, path: Path, inventory: Path | None, output: Path) -> None:
    """Write what surrounds each camera of the lightfield.json at ``path``, and print warnings.

    Raises `UserError` if a camera is inside geometry.
    """
    lightfield = LightField.read(path)
    names = [view.name for view in lightfield.views]
    positions = np.array([view.position for view in lightfield.views])
    contents = read_inventory(inventory, "external_files") if inventory else None
    blend_file.open_scene(blend, lightfield.content.get("scene", {}), contents)
    frames.go_to(lightfield.frame)
    clearance.show_what_is_rendered()
    distances, box = clearance.surroundings(positions)
    enclosures = clearance.enclosures(positions, box)
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
            f"{path}: {len(enclosed_views)} of {len(names)} cameras are inside "
            f"{', '.join(objects)}: {', '.join(enclosed_views[:8])}{more}; "
            "move the rig or make it smaller (center and size in the scene YAML)"
        )
    write_json(output, {"views": views})
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
