"""Scenes of which Cycles renders something wrong without an error: users_scenes.py FOLDER.

Each is a .blend in FOLDER, saved at frame 1, with a lamp:
- aspect: a cube of 2 m, 4 m before the file's own camera, whose pixels are twice as wide as high.
- wall: a wall square to y at 1.9 m.
- pencil: the same, with a drawing with Grease Pencil of 2 m before it, and one of 10 m behind it.
"""

import sys
from pathlib import Path

import bpy

from lightfield.rendering import blend_file

FOLDER = Path(sys.argv[1])


def cube(name="cube", **settings):
    bpy.ops.mesh.primitive_cube_add(**settings)
    bpy.context.object.name = name
    return bpy.context.object


def aspect():
    cube(location=(0, 5, 0))
    bpy.ops.object.camera_add(rotation=(1.5707963, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.context.scene.render.pixel_aspect_x = 2


def drawing(name, **settings):
    bpy.ops.object.grease_pencil_add(type="MONKEY", **settings)
    bpy.context.object.name = name
    bpy.context.object.show_in_front = False


def wall():
    cube("a wall", location=(0, 2, 0), scale=(9, 0.1, 9))


def pencil():
    wall()
    drawing("drawing")
    drawing("behind", location=(0, 4, 0), scale=(5, 5, 5))


def main():
    for make in (aspect, wall, pencil):
        blend_file.new_scene()
        bpy.ops.object.light_add(type="SUN", rotation=(1.2, 0, 0))
        make()
        bpy.context.scene.frame_set(1)
        blend_file.save_scene(FOLDER / f"{make.__name__}.blend")


if __name__ == "__main__":
    main()
