"""Writes the scene YAML of a user's own .blend, model file or folder of views."""

import re
import shlex
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
import yaml
from mathutils import Vector

from lightfield.configuration.scene_yaml import OWN_SCENES, SCENES, check_scene
from lightfield.core import processors
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path
from lightfield.core.names import MODELS, ROOT, UP
from lightfield.formats import blend, published
from lightfield.formats.lightfield import NAME
from lightfield.geometry.lenses.base import LensSettings
from lightfield.geometry.rigs import from_settings
from lightfield.geometry.rotations import Floats, euler_to_matrix, matrix_to_euler
from lightfield.imaging import blender_looks
from lightfield.rendering.imports import model
from lightfield.rendering.inspection import (
    blend_facts,
    clearance,
    external_files,
    inventory,
    inventory_file,
)
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.setup import viewport
from lightfield.stages.scene import ImportSettings, NewScene

# Files with poses of images that are no light field.
_POSES = ("transforms.json", "images.txt", "images.bin", "sparse")
# The longer side of the images of a new rig, in pixels.
_SIDE = 800
# The cameras of a wall are this part of the distance to what they see from each other.
_STEP = 1 / 50
# A wall whose cameras are inside objects becomes half as large, at most so many times.
_TRIES = 6
# So many rays to a side of the image find how far away a camera sees something.
_RAYS = 5
# Without it, no run renders a file that lacks others.
_ALLOW_MISSING = "  allow_missing: true  # render in spite of the note of new_scene.py\n"
# How Blender shows pictures that have no look.
_PLAIN = {"view": "Standard", "look": blender_looks.NO_LOOK, "exposure": 0, "gamma": 1}


class _Description(NamedTuple):
    """What a file is, in words, the blocks of its scene YAML, and what the file lacks."""

    words: str
    blocks: str
    missing: str | None = None


def write(job: NewScene) -> None:
    """Write the scene YAML of a file, and print the commands that build the scene.

    Raises `UserError` if the YAML exists, and for a file that no scene can be made of.
    """
    name = job.scene or _scene_name(job.file)
    path = OWN_SCENES / f"{name}.yaml"
    for existing in (path, SCENES / path.name):
        if existing.exists():
            raise UserError(f"{path}: exists already; edit it, or give another name with --scene")
    description = _described(job.file, job.export)
    text = f"{_schema_line()}# {description.words}.\n\n{description.blocks}"
    check_scene(text, str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    if description.missing:
        print(f"note: {description.missing}. The YAML allows it; mend it, and remove this key")
    command = f"snakemake {_place()}--cores {processors.available()} --config scenes={name}"
    print(
        f"{path} written: {description.words}\n"
        f"Try it with small views, and then ask what its full size takes:\n"
        f"  {command} preset=tiny\n"
        f"  {command} preset=full -n"
    )


def _scene_name(file: Path) -> str:
    """Return a scene's name that follows from the file's."""
    stem = file.resolve().name if file.is_dir() else file.stem
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", stem).lstrip("_.-")
    if not name:
        raise UserError(f"{file}: its name has no letter or digit; name the scene with --scene")
    return name


def _schema_line() -> str:
    """Return the line that tells editors the schema."""
    in_repository = OWN_SCENES.resolve() == SCENES
    folder = ".." if in_repository else str(SCENES.parent)
    return f"# yaml-language-server: $schema={folder}/schema/scene.schema.json\n"


def _place() -> str:
    """Return the flags with which Snakemake works in this folder."""
    if Path.cwd() == ROOT:
        return ""
    return f"-s {shlex.quote(str(ROOT / 'Snakefile'))} --directory . "


def _described(file: Path, export: str | None) -> _Description:
    """Return what a file is. Raises `UserError` for a file that no scene can be made of."""
    if not file.exists():
        raise UserError(f"{file}: does not exist")
    if file.is_dir():
        return _of_views(file, export)
    suffix = file.suffix.lower()
    if suffix == ".blend":
        return _of_blend(file, export)
    if suffix in MODELS:
        return _of_model(file, export)
    raise UserError(
        f"{file}: must be a .blend, a model file ({', '.join(MODELS)}), or a folder of views"
    )


def _of_model(file: Path, export: str | None) -> _Description:
    record, missing = _imported(file)
    side = 1 / record["placement"]["scale"]
    sides = _sides(np.array(record["box"]) * side)
    # OBJ, PLY and STL do not name their unit.
    if model.is_plausible(side) and file.suffix.lower() not in UP:
        unit = f"metres       # as in the file, where its box is {sides} m; box: 1 m long"
    else:
        unit = f"box          # 1 m long; metres: as in the file, where its box is {sides}"
    scene = f"""scene:
  model: {_flow(_relative(file))}
  unit: {unit}
  light: softboxes   # or studio, courtyard and others, or a path of an .hdr
{_ALLOW_MISSING if missing else ""}
"""
    render = _render("  transparent: true  # without a background\n")
    around = _around([_SIDE, _SIDE])
    blocks = scene + render + around + _exports(export, "views")
    words = f"{file.name}, a model of {sides}, with cameras around it"
    return _Description(words, blocks, missing)


def _imported(file: Path) -> tuple[dict[str, Any], str | None]:
    """Return the record of a model's import, and what it lacks. Raises `UserError`."""
    try:
        return model.make_scene(ImportSettings(model=str(file)), file.parent), None
    except UserError as error:
        refusal = str(error)
    # A model that is refused for something else is refused again.
    settings = ImportSettings(model=str(file), allow_missing=True)
    return model.make_scene(settings, file.parent), refusal


def _of_blend(file: Path, export: str | None) -> _Description:
    external_files.refuse_damaged_alembic(file)
    blend_file.open_scene(file)
    external_files.refuse_special(file)
    facts = blend_facts.facts([])
    box = in_render(clearance.surface_box)
    if box is None or not np.isfinite(box).all():
        raise UserError(f"{file}: shows no surface, or one whose places are not finite")
    size = [bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y]
    resolution = [2 * max(1, round(_SIDE / 2 * side / max(size))) for side in size]
    viewport.show_what_is_rendered()
    front = _front(facts, resolution, box)
    # Last, because it removes what is not rendered.
    missing_files = inventory.missing_files([facts["frame"]])
    scene = f"""scene:
  blend: {_flow(_relative(file))}
  frame: file        # the frame at which the file was saved
{_ALLOW_MISSING if missing_files else ""}
"""
    rig = front or _around(resolution)
    blocks = scene + _render("") + rig + _pictures(facts) + _exports(export, "views")
    where = "around its own camera" if front else "around what it shows"
    words = f"{file.name}, a .blend of {_sides(box)} m, with cameras {where}"
    missing = f"{file}: {inventory_file.missing_text(file, missing_files)}"
    return _Description(words, blocks, missing if missing_files else None)


def _of_views(folder: Path, export: str | None) -> _Description:
    poses = next((name for name in _POSES if (folder / name).exists()), None)
    try:
        rigs = published.rigs(str(folder))
    except UserError:
        if (folder / NAME).exists() or any(folder.glob(f"*/{NAME}")):
            raise
        if poses:
            raise UserError(
                f"{folder}: has poses in {poses}, but no {NAME}: only light fields in SILVR's "
                "layout are imported; for other views of a .blend or a model, give its YAML a rig "
                "of type poses with this file"
            ) from None
        raise UserError(
            f"{folder}: has no {NAME}, and no folder in it has one; must be a light field in "
            "SILVR's layout, or hold several"
        ) from None
    cameras = [rig.camera for rig in rigs.values()]
    blocks = f"scene:\n  dataset: {_flow(_relative(folder))}   # its views replace rendering\n"
    source = "views"
    if any(camera.lens != "rectilinear" for camera in cameras):
        source = "perspective"
        side = min(min(camera.resolution) for camera in cameras)
        blocks += f"""
reprojections:
  perspective:       # the same views through a lens that all programs read
    camera: {{lens: rectilinear, fov: 90, resolution: [{side}, {side}]}}
    format: png      # or exr, with depth
"""
    names = ", ".join(rigs)
    blocks += _exports(export, source)
    return _Description(f"Rendered views in {folder.name}: {names}. They keep their splits", blocks)


def _render(more: str) -> str:
    return f"""render:
  samples: 64        # paths for each pixel: more is less noise
  denoise: true
{more}
"""


def _around(resolution: list[int]) -> str:
    return f"""rigs:
  around:
    type: hemisphere   # cameras that look at the middle; or ring, spiral, sphere and others
    count: 100
    elevation: [5, 80]  # degrees
    size: fit          # metres across; fit: each camera sees the whole box of the scene
    center: fit
    camera: {{lens: rectilinear, fov: 40, resolution: {resolution}}}
    split: {{every: 8}}  # one of 8 views tests, and the others train
"""


def _front(facts: dict[str, Any], resolution: list[int], box: Floats) -> str | None:
    """Return a rig around the .blend's camera. None without a perspective camera in free space."""
    camera = facts["camera"]
    if camera is None or camera["lens"]["type"] != "PERSP":
        return None
    lens = blend.lens_of(facts, (resolution[0], resolution[1]))
    world_from_camera = np.array(camera["matrices"][str(facts["frame"])])
    # The cameras of a plane look along +Y, with +Z up.
    turn = world_from_camera[:3, :3] @ euler_to_matrix(np.array([-np.pi / 2, 0, 0]))
    baseline = _STEP * _distance(world_from_camera, lens, box)
    for number in range(_TRIES):
        settings = {
            "type": "plane",
            "cameras": [5, 5],
            "baseline": float(f"{baseline / 2**number:.3g}"),
            "center": _numbers(world_from_camera[:3, 3]),
            "rotation": _numbers(np.degrees(matrix_to_euler(turn))),
        }
        if _is_free(settings):
            return _wall(settings, lens)
    return None


def _wall(settings: dict[str, Any], lens: LensSettings) -> str:
    camera = lens.model_dump(mode="json", exclude_none=True, exclude_unset=True)
    return f"""rigs:
  front:
    type: plane      # a wall of cameras that all look as the file's own camera does
    cameras: {settings["cameras"]}
    baseline: {settings["baseline"]:g}   # metres between neighbours
    center: {settings["center"]}   # the place of the file's camera
    rotation: {settings["rotation"]}   # degrees
    camera: {_flow(camera)}
    split: {{every: 8}}  # one of 8 views tests, and the others train
"""


def _distance(world_from_camera: Floats, lens: LensSettings, box: Floats) -> float:
    """Return how far away a camera sees something, as the median of some rays, in metres."""
    x, y = (np.linspace(0, side, _RAYS + 2)[1:-1] for side in lens.resolution)
    rays = lens.make().rays(x[None, :], y[:, None]).reshape(-1, 3)
    place = Vector(world_from_camera[:3, 3])
    depsgraph = bpy.context.evaluated_depsgraph_get()
    distances = []
    for ray in rays @ world_from_camera[:3, :3].T:
        hit, where, *_ = bpy.context.scene.ray_cast(depsgraph, place, Vector(ray))
        if hit:
            distances.append((where - place).length)
    if not distances:
        return float(np.linalg.norm(box.mean(axis=0) - world_from_camera[:3, 3]))
    return float(np.median(distances))


def _is_free(settings: dict[str, Any]) -> bool:
    """Return whether no camera of a rig is inside an object."""
    poses = from_settings(settings).poses()
    positions = np.array([pose.position for pose in poses])
    distances, box = clearance.surroundings(positions)
    enclosing = clearance.enclosing_objects(clearance.enclosures(positions, box))
    return not clearance.are_inside(enclosing, distances).any()


def _pictures(facts: dict[str, Any]) -> str:
    """Return how pictures get the look of a .blend. Nothing if it has none that they can have."""
    try:
        look = blend.look_of(facts)
    except UserError:
        return ""
    if look == _PLAIN:
        return ""
    title = blender_looks.title(look)
    return f"""
# reprojections:
#   pictures: {{look: file}}   # the views as PNG, as Blender shows the file: {title}
"""


def _exports(export: str | None, source: str) -> str:
    if export is None:
        return f"""
# exports:           # files for trainers, such as
#   colmap: {{sources: [{source}]}}
"""
    return f"\nexports:\n  {export}: {{sources: [{source}]}}   # or a reprojection\n"


def _relative(file: Path) -> str:
    """Return a path from the folder in which Snakemake runs, if it is below it."""
    absolute = file.absolute()
    return str(absolute.relative_to(Path.cwd()) if absolute.is_relative_to(Path.cwd()) else file)


def _sides(box: Floats) -> str:
    return " × ".join(f"{side:.3g}" for side in (box[1] - box[0]))


def _numbers(values: Floats) -> list[float]:
    rounded = [float(f"{value:.6g}") for value in values.tolist()]
    return [int(value) if value.is_integer() else value for value in rounded]


def _flow(value: Any) -> str:
    """Return a value as YAML in one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")
