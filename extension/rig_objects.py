"""Rigs as objects of the open scene: an Empty is a rig's box, and has the rig's other keys.

The Empty keeps the keys as JSON in a custom property. So Blender's undo and .blend files keep them,
too. Nothing else refers to objects, which undo replaces.
"""

import json
from contextlib import chdir
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from . import scene_file
from .scripts.lightfield.core.errors import UserError
from .scripts.lightfield.geometry.rigs import Rig, fitted, from_settings
from .scripts.lightfield.geometry.rigs.grid import Grid
from .scripts.lightfield.geometry.rigs.orbit import Orbit
from .scripts.lightfield.geometry.rigs.plane import Plane
from .scripts.lightfield.geometry.rigs.sphere import Sphere
from .scripts.lightfield.geometry.rotations import euler_to_matrix, matrix_to_euler
from .scripts.lightfield.rendering.inspection import clearance

KEY = "plenoforge_rig"
COLLECTION = "Plenoforge rigs"
# The rigs whose box and counts can be changed. Others are only drawn.
EDITABLE = (Grid, Orbit, Sphere)
# The keys that count cameras.
COUNTS = ("cameras", "subdivisions", "count")
# Custom property of a scene: the box around its surfaces when a scene YAML was opened.
_BOX = "plenoforge_box"
# A rotation is the same if its matrix differs by less. Blender computes in 32 bits.
_SAME = 1e-6


def collection(scene: Any) -> Any:
    """Return the collection of all rigs, which renders do not show."""
    rigs = bpy.data.collections.get(COLLECTION) or bpy.data.collections.new(COLLECTION)
    rigs.hide_render = True
    if rigs.name not in scene.collection.children:
        scene.collection.children.link(rigs)
    return rigs


def empties(scene: Any) -> list[Any]:
    """Return the Empties of the scene's rigs."""
    return [obj for obj in scene.objects if KEY in obj]


def yaml_path(scene: Any) -> Path | None:
    """Return the scene YAML that is open."""
    return Path(bpy.path.abspath(scene.plenoforge_yaml)) if scene.plenoforge_yaml else None


def folder(scene: Any) -> Path:
    """Return the folder from which paths in the rigs start."""
    path = yaml_path(scene)
    return scene_file.home(path) if path else Path.cwd()


def add(scene: Any, name: str, settings: dict[str, Any]) -> Any:
    """Add an Empty for a rig. Raises `UserError` for wrong settings."""
    with chdir(folder(scene)):
        rig = _fitted(scene, from_settings(settings, name))
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type = "CUBE"
    empty.empty_display_size = 0.5
    empty.location = rig.middle
    empty.rotation_euler = np.radians(rig.rotation)
    empty.scale = rig.sides
    keep(empty, name, settings)
    collection(scene).objects.link(empty)
    return empty


def keep(empty: Any, name: str, settings: dict[str, Any]) -> None:
    """Keep a rig's name and keys in its Empty."""
    empty[KEY] = json.dumps({"name": name, "settings": settings})


def kept(empty: Any) -> tuple[str, dict[str, Any]]:
    """Return a rig's name and its keys, without what handles have changed since."""
    content = json.loads(empty[KEY])
    return content["name"], content["settings"]


def rig_of(scene: Any, empty: Any) -> tuple[Rig, dict[str, Any]]:
    """Return the rig of an Empty, and its keys for the scene YAML.

    Raises `UserError` if no rig can be where the Empty is.
    """
    name, settings = kept(empty)
    with chdir(folder(scene)):
        rig = _fitted(scene, from_settings(settings, name))
        if is_editable(rig):
            settings = {**settings, **_moved(name, empty, rig)}
            rig = _fitted(scene, from_settings(settings, name))
    return rig, settings


def measure(scene: Any) -> None:
    """Keep the scene's box, which rigs with size: fit or center: fit follow until the next time."""
    box = clearance.surface_box()
    scene[_BOX] = [] if box is None or not np.isfinite(box).all() else box.ravel().tolist()


def _fitted(scene: Any, rig: Rig) -> Rig:
    """Return the rig with numbers for a size and a center that fit the scene's box, if it has one.

    Raises `UserError` for a flat box that has no room for cameras.
    """
    numbers_of_box = np.array(scene.get(_BOX, []), float)
    return fitted(rig, numbers_of_box.reshape(2, 3)) if len(numbers_of_box) else rig


def is_editable(rig: Rig) -> bool:
    """Return whether handles and the panel change the rig."""
    return isinstance(rig, EDITABLE)


def has_fixed_size(rig: Rig) -> bool:
    """Return whether the size follows from other keys."""
    return isinstance(rig, Plane) and rig.baseline is not None


def _moved(name: str, empty: Any, rig: Rig) -> dict[str, Any]:
    """Return the keys center, rotation and size, where the Empty differs from its rig."""
    rotation = _rotation(empty)
    own = Matrix.LocRotScale(empty.location, rotation.to_quaternion(), empty.scale)
    if not np.allclose(own, empty.matrix_world, atol=1e-4 * max(1, *map(abs, empty.location))):
        raise UserError(
            f"{name}: a parent, a constraint or a delta transform moves its Empty; clear it"
        )
    if min(empty.scale) < 0:
        raise UserError(f"{name}: its Empty has a negative scale; make it positive")
    keys: dict[str, Any] = {}
    if not np.array_equal(np.float32(rig.middle), empty.location):
        keys["center"] = numbers(empty.location)
    if not np.allclose(euler_to_matrix(np.radians(rig.rotation)), rotation, atol=_SAME):
        is_xyz = empty.rotation_mode == "XYZ"
        euler = empty.rotation_euler if is_xyz else matrix_to_euler(np.array(rotation))
        keys["rotation"] = numbers(np.round(np.degrees(euler), 4))
    if not has_fixed_size(rig) and not np.array_equal(np.float32(rig.sides), empty.scale):
        sides = numbers(empty.scale)
        keys["size"] = sides[0] if len(set(sides)) == 1 else sides
    return keys


def _rotation(empty: Any) -> Matrix:
    """Return an Empty's rotation (3, 3), in whichever mode it is given."""
    match empty.rotation_mode:
        case "QUATERNION":
            return empty.rotation_quaternion.normalized().to_matrix()
        case "AXIS_ANGLE":
            angle, *axis = empty.rotation_axis_angle
            return Matrix.Rotation(angle, 3, axis)
    return empty.rotation_euler.to_matrix()


def numbers(values: Any) -> list[float]:
    """Return numbers with the digits that 32 bits have. Whole numbers become int."""
    rounded = [float(f"{value:.6g}") for value in values]
    return [int(value) if value.is_integer() else value for value in rounded]


def count_key(settings: dict[str, Any]) -> str | None:
    """Return the key that counts a rig's cameras."""
    return next((key for key in COUNTS if key in settings), None)


def counts(settings: dict[str, Any]) -> list[int]:
    """Return a rig's numbers of cameras, as its key has them."""
    value = settings.get(count_key(settings), [])
    return list(value) if isinstance(value, list) else [value]


def with_count(settings: dict[str, Any], index: int, count: int) -> dict[str, Any]:
    """Return a rig's keys with another number of cameras along one axis."""
    key = count_key(settings)
    changed = counts(settings)
    changed[index] = count
    return {**settings, key: changed if isinstance(settings[key], list) else count}
