"""Writes where the corners of calibration boards are in each view, and which are visible.

Pixels follow from the boards' places and the dataset's lens, in float64. They agree with the views
as far as Blender's float32 does. A corner is visible if its pixel is in the frame, if the board's
front faces the camera, and if a ray from the camera to the corner meets no surface before it. The
ray stops at glass and at transparent pictures, too. It does not meet hair, points and volumes.
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import write_text
from lightfield.core.progress import Progress
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import boards
from lightfield.geometry.boards import Board
from lightfield.geometry.lenses import Lens
from lightfield.geometry.rotations import Floats
from lightfield.rendering.scenes import blend_file, frames
from lightfield.rendering.setup import viewport
from lightfield.stages.rig import FindCorners

# What the numbers of a pixel mean.
_PIXEL_ORIGIN = (
    "the upper left corner of the picture, so the first pixel's centre is (0.5, 0.5); for OpenCV, "
    "subtract 0.5 from both"
)
# Digits after the point of a pixel.
_DIGITS = 6
# A surface hides a corner if it is nearer than the corner by more than this, in metres, and as a
# part of the distance. The board itself is as far as the corner, up to float32.
_AT_CORNER = 1e-4
_AT_CORNER_PART = 1e-5


def write(job: FindCorners) -> None:
    """Write the corners of all boards in all views. Raises `UserError` for a scene without any."""
    lightfield = LightField.read(job.lightfield)
    targets = lightfield.content.get("scene", {}).get("targets")
    if not targets:
        raise UserError(f"{job.lightfield}: scene: has no targets")
    known = boards.from_settings(targets, f"{job.lightfield}: scene.targets")
    inventory = read_inventory(job.inventory, "external_files") if job.inventory else None
    blend_file.open_scene(job.blend, lightfield.content["scene"], inventory)
    frames.go_to(lightfield.frame)
    viewport.show_what_is_rendered()
    progress = Progress(len(lightfield.views), f"corners {lightfield.folder}")
    views = {}
    for view in lightfield.views:
        views[view.name] = [*_in_view(view, lightfield.lens, known)]
        progress.done()
    write_text(job.output, _as_json(known, views))
    seen = sum(corner["visible"] for corners in views.values() for corner in corners)
    print(f"{len(known)} boards, {seen} visible corners in {len(views)} views")


def _as_json(known: Mapping[str, Board], views: Mapping[str, list[dict[str, Any]]]) -> str:
    """Return the content of corners.json, with a line for each board and each corner."""
    described = (f"{json.dumps(name)}: {json.dumps(_described(known[name]))}" for name in known)
    listed = (
        f"{json.dumps(name)}: [\n{_lines(json.dumps(each) for each in corners)}]"
        for name, corners in views.items()
    )
    return (
        f'{{"pixel_origin": {json.dumps(_PIXEL_ORIGIN)},\n'
        f'"boards": {{\n{_lines(described)}}},\n"views": {{\n{_lines(listed)}}}}}\n'
    )


def _lines(entries: Iterator[str]) -> str:
    return ",\n".join(entries)


def _described(board: Board) -> dict[str, Any]:
    """Return a board's entry: its keys, and its corners in its own coordinates, by their ids."""
    return {
        **board.as_json(),
        "world_from_board": board.world_from_board.tolist(),
        "corners": board.corners().round(9).tolist(),
    }


def _in_view(view: View, lens: Lens, known: Mapping[str, Board]) -> Iterator[dict[str, Any]]:
    """Yield the corners whose pixels are in a view's frame, board by board, by their ids."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera_from_world = np.linalg.inv(view.world_from_camera)
    for name, board in known.items():
        places = board.world_corners
        rays = places @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        pixels = lens.pixels(rays)
        faces = bool((view.position - board.world_from_middle[:3, 3]) @ board.front > 0)
        for number in np.flatnonzero(lens.in_frame(pixels)).tolist():
            yield {
                "board": name,
                "id": number,
                "pixel": pixels[number].round(_DIGITS).tolist(),
                "visible": faces and not _is_hidden(view.position, places[number], depsgraph),
            }


def _is_hidden(camera: NDArray[np.float64], corner: Floats, depsgraph: Any) -> bool:
    """Return whether a surface that cameras see lies between a camera and a corner."""
    toward = corner - camera
    distance = float(np.linalg.norm(toward))
    direction = Vector(toward / distance)
    start = Vector(camera)
    left = distance * (1 - _AT_CORNER_PART) - _AT_CORNER
    while left > 0:
        hit, place, _, _, obj, _ = bpy.context.scene.ray_cast(
            depsgraph, start, direction, distance=left
        )
        if not hit:
            return False
        if obj.visible_camera:
            return True
        passed = (place - start).length + _AT_CORNER
        start = start + direction * passed
        left -= passed
    return False
