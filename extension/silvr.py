"""Reads the light fields that SILVR's add-on keeps in a .blend, whether it is installed or not.

Source: github.com/IDLabMedia/blender-lightfield-addon at 254fc6b (2023-04-10), lightfield.py and
lightfield_*.py. The scene has a collection property ``lightfield``. A property that has its default
is not in the file.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from .scripts.lightfield.core.errors import UserError
from .scripts.lightfield.geometry import lenses

PROPERTY = "lightfield"
# The add-on's defaults.
_DEFAULTS = {
    "lf_type": "PLANE",
    **dict.fromkeys(("num_cams_x", "num_cams_y", "num_cams_z"), 3),
    **dict.fromkeys(("num_cams_radius", "num_cams_subdiv"), 3),
    **dict.fromkeys(("res_x", "res_y"), 1024),
    **dict.fromkeys(("sequence_start", "sequence_end", "sequence_steps"), 1),
    "face_inside": False,
}
# The keys of a rig by the add-on's type, and the properties that they come from.
_COUNTS = {
    "PLANE": ("plane", "cameras", ("num_cams_x", "num_cams_y")),
    "CUBOID": ("cuboid", "cameras", ("num_cams_x", "num_cams_y", "num_cams_z")),
    "CYLINDER": ("cylinder", "cameras", ("num_cams_radius", "num_cams_y")),
    "SPHERE": ("sphere", "subdivisions", ("num_cams_subdiv",)),
}
# The types whose cameras face inside. For the others, the add-on ignores its switch.
_CAN_FACE_INSIDE = ("CYLINDER", "SPHERE")
# The lens's numbers in lightfield.json, which Blender's cameras have by the same names.
_PANORAMA_KEYS = {
    "FISHEYE_EQUIDISTANT": ("fisheye_fov",),
    "FISHEYE_EQUISOLID": ("fisheye_lens", "fisheye_fov"),
    "EQUIRECTANGULAR": ("latitude_min", "latitude_max", "longitude_min", "longitude_max"),
}


def is_in(scene: Any) -> bool:
    """Return whether a scene has light fields of the add-on."""
    return bool(_groups(scene))


def rigs(scene: Any) -> Iterator[tuple[str, dict[str, Any], tuple[Any, Any, Any]]]:
    """Yield each light field's name, the keys of its rig, and its Empty's place, turn and scale.

    Raises `UserError` if it has no Empty or camera any more, or a lens that no rig has.
    """
    for group in _groups(scene):
        values = {key: group.get(key, default) for key, default in _DEFAULTS.items()}
        empty, camera = group.get("obj_empty"), group.get("data_camera")
        if empty is None or camera is None:
            raise UserError("a light field of SILVR's add-on has lost its Empty or camera")
        name = re.sub(r"[^A-Za-z0-9_.-]", "_", empty.name).lstrip("_.-") or "lightfield"
        rig_type, key, properties = _COUNTS[values["lf_type"]]
        numbers = [values[each] for each in properties]
        settings: dict[str, Any] = {"type": rig_type}
        settings[key] = numbers if key == "cameras" else numbers[0]
        if values["face_inside"] and values["lf_type"] in _CAN_FACE_INSIDE:
            settings["face_inside"] = True
        if values["sequence_start"] != values["sequence_end"]:
            names = {"first": "sequence_start", "last": "sequence_end", "step": "sequence_steps"}
            settings["frames"] = {key: values[name] for key, name in names.items()}
        settings["camera"] = _lens(name, camera, values["res_x"], values["res_y"])
        matrix = empty.matrix_world
        yield name, settings, (matrix.to_translation(), matrix.to_euler(), matrix.to_scale())


def _groups(scene: Any) -> list[Mapping[str, Any]]:
    """Return the properties of each light field. Blender 5 keeps an add-on's properties apart."""
    return list(scene.bl_system_properties_get().get(PROPERTY) or scene.get(PROPERTY) or ())


def _lens(name: str, camera: Any, width: int, height: int) -> dict[str, Any]:
    """Return the key camera of a rig, from a Blender camera as the add-on exports it."""
    side = {
        "AUTO": camera.sensor_width / max(width, height),
        "HORIZONTAL": camera.sensor_width / width,
        "VERTICAL": camera.sensor_height / height,
    }[camera.sensor_fit]
    content: dict[str, Any] = {"type": camera.type}
    if camera.type == "PERSP":
        content |= {"lens_unit": "MILLIMETERS", "focal_length": camera.lens}
    if camera.type == "PANO":
        kind = camera.panorama_type
        keys = _PANORAMA_KEYS.get(kind, ())
        content = {"type": "PANO", "panorama_type": kind, **{k: getattr(camera, k) for k in keys}}
    try:
        lens = lenses.from_lightfield(
            {
                "camera": content,
                "resolution": [width, height],
                "sensor_size": [side * width, side * height],
            }
        )
    except UserError as error:
        raise UserError(f"{name}: {error}") from None
    return lens.settings()
