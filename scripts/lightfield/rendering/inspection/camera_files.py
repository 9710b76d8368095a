"""Writes free places for cameras in a scene's geometry, and the clearance of each camera."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.inventory import read_inventory, scene_box
from lightfield.formats.lightfield import LightField
from lightfield.geometry import framing
from lightfield.geometry.rigs import fitted
from lightfield.geometry.rotations import Floats
from lightfield.rendering.inspection import clearance, light
from lightfield.rendering.inspection.clearance import REACH
from lightfield.rendering.inspection.limits import lens_warnings, warnings
from lightfield.rendering.scenes import blend_file, frames
from lightfield.rendering.setup import drawings, viewport
from lightfield.stages.rig import CheckCameras, FreePlaces


def write_places(job: FreePlaces) -> None:
    """Write the places of a random rig's cameras. Raises `UserError` if there are too few."""
    settings = job.settings
    rig = settings.rig
    contents = _contents(job.inventory)
    if rig.is_fitted:
        if job.inventory is None:
            raise UserError("--inventory: is missing; scripts/inventory.py measures the scene")
        rig = fitted(rig, scene_box(job.inventory))
    blend_file.open_scene(job.blend, settings.as_json(), contents)
    if isinstance(settings.frame, int):
        frames.go_to(settings.frame)
    viewport.show_what_is_rendered()
    places = clearance.free_places(rig)
    write_json(job.output, {"box": rig.box, "places": places.tolist()})
    print(f"{len(places)} cameras, each with {rig.clearance:g} m of free space around it")


def write_clearance(job: CheckCameras) -> None:
    """Write what surrounds each camera of a light field, and print warnings.

    Raises `UserError` if a camera is inside geometry.
    """
    lightfield = LightField.read(job.lightfield)
    names = [view.name for view in lightfield.views]
    positions = np.array([view.position for view in lightfield.views])
    contents = _contents(job.inventory)
    blend_file.open_scene(job.blend, lightfield.content.get("scene", {}), contents)
    frames.go_to(lightfield.frame)
    viewport.show_what_is_rendered()
    distances, box = clearance.surroundings(positions)
    enclosures = clearance.enclosures(positions, box)
    enclosing = clearance.enclosing_objects(enclosures)
    are_inside = clearance.are_inside(enclosing, distances)
    views = {
        name: {
            "distance": None if np.isinf(distance) else round(float(distance), 6),
            "inside": is_inside,
        }
        for name, distance, is_inside in zip(names, distances, are_inside.tolist(), strict=True)
    }
    if problems := [*_enclosed(names, enclosing), *_touching(names, enclosing, distances)]:
        raise UserError(f"{job.lightfield}: {'; '.join(problems)}")
    shown = clearance.contents()
    cameras = (lightfield.lens, lightfield.world_from_cameras)
    content: dict[str, Any] = {"views": views}
    if shown.box is not None:
        content["box"] = shown.box.round(6).tolist()
    content["without_depth"] = sorted(
        name for name, box in shown.without_depth.items() if framing.may_see(*cameras, box).any()
    )
    write_json(job.output, content)
    camera_type = lightfield.content["camera"]["type"]
    for warning in (
        *_framing_warnings(lightfield, shown.box),
        *clearance.open_mesh_warnings(enclosures),
        *clearance.dark_room_warnings(enclosures, light.emitters),
        *warnings(positions, distances),
        *lens_warnings(lightfield.lens),
        *drawings.warnings(camera_type),
    ):
        print(f"warning: {warning}", file=sys.stderr)
    nearest = min(distances)
    away = f"{nearest:.3f} m" if nearest < REACH else f"more than {REACH} m"
    print(f"{len(names)} cameras, none inside geometry; the nearest surface is {away} away")


def _enclosed(names: Sequence[str], enclosing: Sequence[str | None]) -> Iterator[str]:
    """Yield a line if objects enclose cameras."""
    views = [name for name, around in zip(names, enclosing, strict=True) if around]
    if views:
        objects = ", ".join(sorted({name for name in enclosing if name}))
        yield (
            f"{len(views)} of {len(names)} cameras are inside {objects}: {_listed(views)}; move "
            "the rig or make it smaller (center and size in the scene YAML)"
        )


def _touching(
    names: Sequence[str], enclosing: Sequence[str | None], distances: Floats
) -> Iterator[str]:
    """Yield a line if cameras that no object encloses touch a surface."""
    touch = (distances < clearance.TOUCHING) & np.array([around is None for around in enclosing])
    if touch.any():
        nearest = 1000 * distances[touch].min()
        views = [name for name, touches in zip(names, touch, strict=True) if touches]
        yield (
            f"{len(views)} of {len(names)} cameras touch a surface, which is {nearest:.2g} mm away "
            f"from the nearest: {_listed(views)}; a camera needs {1000 * clearance.TOUCHING:g} mm "
            "of free space: move the rig away from the surface (center in the scene YAML)"
        )


def _listed(views: Sequence[str]) -> str:
    return f"{', '.join(views[:8])}{' …' if len(views) > 8 else ''}"


def _framing_warnings(lightfield: LightField, box: Floats | None) -> Iterator[str]:
    """Yield a line if cameras cannot see, or hardly see, what is in the scene's ``box`` (2, 3)."""
    # Otherwise objects may follow each camera.
    if box is not None and not lightfield.follows_views:
        names = [view.name for view in lightfield.views]
        cameras = (lightfield.lens, names, lightfield.world_from_cameras)
        yield from framing.warnings(*cameras, box)
        # Views of other scenes may cut a floor or a wall.
        if "unit" in lightfield.content.get("scene", {}):
            yield from framing.cut_warnings(*cameras, clearance.outermost_points())


def _contents(inventory: Path | None) -> dict[str, Any] | None:
    """Return the inventory of a scene, if there is one."""
    return read_inventory(inventory, "external_files") if inventory else None
