"""Writes .blends with colours of another OpenColorIO configuration: foreign_colours.py FOLDER.

The configuration is Blender's, with a colour space, a display, a view transform and a look more.
Each .blend is the studio of blend_scenes.py with one of them, and its cube has a grey texture:
texture, unused (the image is in no material), display, view_transform, look, working_space, and
two_scenes, in which another scene has the view transform.
"""

import importlib.util
import os
import shutil
import sys
from pathlib import Path

FOLDER = Path(sys.argv[1])
STUDIO = """
colorspaces:
  - !<ColorSpace>
    name: Studio sRGB
    from_scene_reference: !<ColorSpaceTransform> {src: ACES2065-1, dst: sRGB}

  - !<ColorSpace>
    name: Studio Linear
    from_scene_reference: !<MatrixTransform>
      matrix: [2, -1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
"""
LOOK = """
looks:
  - !<Look>
    name: Studio Look
    process_space: Linear Rec.709
    transform: !<CDLTransform> {power: [1.2, 1.2, 1.2]}
"""
VIEW = "    - !<View> {name: Studio View, view_transform: Standard, display_colorspace: sRGB}\n"
RAW = "    - !<View> {name: Raw, colorspace: Non-Color}\n"


def configure(linear="Linear Rec.709"):
    """Write the configuration, and let Blender use it. Blender must not be loaded yet."""
    package = Path(importlib.util.find_spec("bpy").origin).parent
    (own,) = package.glob("*/datafiles/colormanagement")
    shutil.copytree(own, FOLDER / "colormanagement", dirs_exist_ok=True)
    file = FOLDER / "colormanagement/config.ocio"
    text = file.read_text()
    for old, new in (
        ("\ncolorspaces:\n", STUDIO + "\n"),
        ("\nlooks:\n", LOOK + "\n"),
        ("\nactive_displays:", f"\n  Studio Display:\n{VIEW}active_displays:"),
        (RAW, RAW + VIEW),
        ("active_displays: [sRGB, ", "active_displays: [sRGB, Studio Display, "),
        ("active_views: [Standard, ", "active_views: [Standard, Studio View, "),
        ("scene_linear: Linear Rec.709", f"scene_linear: {linear}"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    file.write_text(text)
    os.environ["OCIO"] = str(file)


configure("Studio Linear" if sys.argv[2:] == ["working_space"] else "Linear Rec.709")

import bpy  # noqa: E402

# isort: split
import blend_scenes  # noqa: E402


def textured():
    """Make the studio, and let its cube shine with a texture of one grey. Return the image."""
    blend_scenes.studio()
    image = bpy.data.images.new("grey", 4, 4)
    image.pixels = [0.5, 0.5, 0.5, 1] * 16
    image.file_format = "PNG"
    image.filepath_raw = str(FOLDER / "grey.png")
    image.save()
    image.pack()
    tree = bpy.data.objects["Cube"].data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return image


def texture():
    textured().colorspace_settings.name = "Studio sRGB"


def unused():
    textured()
    image = bpy.data.images.new("spare", 4, 4)
    image.use_fake_user = True
    image.colorspace_settings.name = "Studio sRGB"


def display():
    textured()
    bpy.context.scene.display_settings.display_device = "Studio Display"


def view_transform():
    textured()
    bpy.context.scene.view_settings.view_transform = "Studio View"


def look():
    textured()
    bpy.context.scene.view_settings.view_transform = "Standard"
    bpy.context.scene.view_settings.look = "Studio Look"


def two_scenes():
    textured()
    bpy.context.scene.view_settings.view_transform = "AgX"
    bpy.data.scenes.new("Other").view_settings.view_transform = "Studio View"


def working_space():
    textured()


names = sys.argv[2:] or ["texture", "unused", "display", "view_transform", "look", "two_scenes"]
for name in names:
    globals()[name]()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{name}.blend"), copy=True)
