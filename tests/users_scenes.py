"""Scenes of which Cycles renders something wrong without an error: users_scenes.py FOLDER.

Each is a .blend in FOLDER, saved at frame 1, with a lamp:
- aspect: a cube of 2 m, 4 m before the file's own camera, whose pixels are twice as wide as high.
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


def main():
    for make in (aspect,):
        blend_file.new_scene()
        bpy.ops.object.light_add(type="SUN")
        make()
        bpy.context.scene.frame_set(1)
        blend_file.save_scene(FOLDER / f"{make.__name__}.blend")


if __name__ == "__main__":
    main()
