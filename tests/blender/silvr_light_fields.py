"""Writes a .blend with the properties of SILVR's add-on, as the add-on keeps them.

Usage: silvr_light_fields.py BLEND. The names, types and defaults are those of lightfield.py in
github.com/IDLabMedia/blender-lightfield-addon at 254fc6b.
"""

import math
import sys

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


class LightfieldPropertyGroup(bpy.types.PropertyGroup):
    obj_empty: PointerProperty(type=bpy.types.Object)
    data_camera: PointerProperty(type=bpy.types.Camera)
    lf_type: StringProperty(default="PLANE")
    num_cams_x: IntProperty(default=3, min=2, max=2000)
    num_cams_y: IntProperty(default=3, min=2, max=2000)
    num_cams_z: IntProperty(default=3, min=2, max=2000)
    num_cams_radius: IntProperty(default=3, min=3, max=2000)
    num_cams_subdiv: IntProperty(default=3, min=1, max=6)
    face_inside: BoolProperty(default=False)
    res_x: IntProperty(default=1024, min=32)
    res_y: IntProperty(default=1024, min=32)
    sequence_start: IntProperty(default=1)
    sequence_end: IntProperty(default=1)
    sequence_steps: IntProperty(default=1, min=1, max=20)


def add(name, place, turn, scale, camera, **properties):
    """Add a light field."""
    scene = bpy.context.scene
    empty = bpy.data.objects.new(name, None)
    empty.location = place
    empty.rotation_euler = turn
    empty.scale = scale
    scene.collection.objects.link(empty)
    data = bpy.data.cameras.new(f"{name}_Camera")
    group = scene.lightfield.add()
    group.obj_empty = empty
    group.data_camera = data
    for owner, values in ((data, camera), (group, properties)):
        for key, value in values.items():
            setattr(owner, key, value)


def main():
    bpy.ops.wm.read_factory_settings()
    bpy.utils.register_class(LightfieldPropertyGroup)
    bpy.types.Scene.lightfield = CollectionProperty(type=LightfieldPropertyGroup)
    fisheye = {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": math.pi}
    straight = {"type": "PERSP", "lens": 18, "sensor_width": 36}
    add("LFCuboid", (0, 0, 1.05), (0, 0, math.pi / 4), (1, 3, 1), fisheye, lf_type="CUBOID",
        num_cams_x=10, num_cams_y=30, num_cams_z=10, res_x=2048, res_y=2048)  # fmt: skip
    add("LFSphere", (0, 0, 1.05), (0, 0, 0), (1.45,) * 3, fisheye, lf_type="SPHERE",
        num_cams_subdiv=4, sequence_end=9, sequence_steps=2)  # fmt: skip
    add("LFCylinder", (1, 2, 3), (0, 0, 0), (2, 2, 2), straight, lf_type="CYLINDER",
        num_cams_radius=12, face_inside=True, res_x=640, res_y=480)  # fmt: skip
    add("Wall of mine", (0, 0, 0), (0, 0, 0), (1, 1, 1), straight, face_inside=True)
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])


if __name__ == "__main__":
    main()
