"""Adds lamps to a .blend: lamp_scene.py IN.blend OUT.blend.

Cameras may see the lamp "seen" at y = 60 m, and "behind" near the origin. "sun" and "point" have no
surface. "unseen" is hidden from cameras, as new lamps are.
"""

import sys

import bpy

bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
for name, kind, place in (
    ("seen", "POINT", (0, 60, 0)),
    ("behind", "POINT", (0, 0, 5)),
    ("sun", "SUN", (0, 60, 0)),
    ("point", "SPOT", (0, 60, 0)),
    ("unseen", "AREA", (0, 60, 0)),
):
    lamp = bpy.data.lights.new(name, kind)
    if kind in ("POINT", "SPOT"):
        lamp.shadow_soft_size = 0 if name == "point" else 1
    obj = bpy.data.objects.new(name, lamp)
    obj.location = place
    obj.visible_camera = name != "unseen"
    bpy.context.scene.collection.objects.link(obj)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2], copy=True)
