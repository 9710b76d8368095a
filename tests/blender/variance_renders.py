"""Renders views with the pass `variance` and without it.

Run by test_variance.py in a process of its own, because bpy has one scene at a time:
variance_renders.py FOLDER writes the dataset FOLDER/dataset, FOLDER/parts.npz, and an .npz of each
case and of each room.
"""

import sys
from pathlib import Path

import bpy
import numpy as np
import one_shard

from lightfield.configuration.keys import view_seed
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PASSES, SAMPLE_PARTS, VARIANCE
from lightfield.geometry import lenses
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
from lightfield.rendering.views.colour_pass import render_colour
from lightfield.rendering.views.geometry_pass import render_geometry

SIZE = 32
# The rooms are rendered often.
ROOM_SIZE = 16
SAMPLES = 64
SEEDS = 100
OTHERS = [name for name in PASSES if name != VARIANCE]
CASES = {
    "plain": {"passes": OTHERS},
    "uneven": {"passes": OTHERS, "samples": 13},
    "groups": {"light_groups": {"lamp": ["Area"]}},
    "transparent": {"passes": OTHERS, "transparent": True},
    "rolling": {"camera_motion": {"travel": [0.3, 0, 0], "turn": [0, 8, 0], "rolling": 0.3}},
    "focused": {"depth_of_field": True},
}


def material(name, **inputs):
    made = bpy.data.materials.new(name)
    for key, value in inputs.items():
        made.node_tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    return made


def add_balls():
    """Add a metal, a glass and a matt ball, and a lamp above them."""
    balls = {
        "metal": {"Metallic": 1.0, "Roughness": 0.2},
        "glass": {"Transmission_Weight": 1.0},
        "matt": {"Base_Color": (0.6, 0.4, 0.1, 1)},
    }
    for number, (name, inputs) in enumerate(balls.items()):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(1.2 * (number - 1), 3, 0.5))
        bpy.context.object.name = name
        bpy.context.object.data.materials.append(material(name, **inputs))
    bpy.ops.object.light_add(type="AREA", location=(2, 1, 2.5))
    bpy.context.object.data.energy = 100


def build_open(folder):
    """Save balls on a floor under the sky, and the artist's camera in front of them."""
    blend_file.new_scene()
    bpy.ops.mesh.primitive_plane_add(size=20)
    add_balls()
    bpy.context.scene.world = bpy.data.worlds.new("sky")
    tree = bpy.context.scene.world.node_tree
    tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.4, 0.6, 1)
    camera = bpy.data.cameras.new("artist")
    camera.dof.use_dof = True
    camera.dof.focus_distance = 2
    camera.dof.aperture_fstop = 0.2
    bpy.context.scene.camera = bpy.data.objects.new("artist", camera)
    bpy.context.collection.objects.link(bpy.context.scene.camera)
    blend_file.save_scene(folder / "open.blend")


def build_room(folder, name, bounces):
    """Save the balls in a closed room.

    If light ``bounces``, its lamp is behind a board, and noise is rare bright paths. Otherwise the
    room has no balls, and light that comes directly from a large lamp.
    """
    blend_file.new_scene()
    white = material("white", Base_Color=(0.8, 0.8, 0.8, 1))
    bpy.ops.mesh.primitive_cube_add(size=6, location=(0, 1, 3))
    bpy.context.object.data.materials.append(white)
    if bounces:
        add_balls()
        bpy.ops.mesh.primitive_cube_add(size=1, location=(2, 1, 2))
        bpy.context.object.scale = (1, 1, 0.05)
        bpy.context.object.data.materials.append(white)
    else:
        bpy.ops.object.light_add(type="AREA", location=(0, 1, 5.5))
        bpy.context.object.data.energy = 200
        bpy.context.object.data.size = 4
    blend_file.save_scene(folder / f"{name}.blend")


def lightfield(size=SIZE, **render):
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [size, size]})
    rig = {"type": "lattice", "cameras": [1, 1, 1], "center": [0, 0, 0.8], "size": 0}
    block = {"samples": SAMPLES, "adaptive_threshold": 0, "denoise": False, "seed": 0, **render}
    return LightField.from_rig(rig, lens, depth="z", frame=1, scene={}, render=block)


def set_up(folder, content, scene="open"):
    """Open a scene for a light field. Return it, and the pose of the only view."""
    opened = cycles.set_up(folder / f"{scene}.blend", None, content, "cpu", 1)
    return opened, content.views[0].world_from_camera


def view(folder, **render):
    """Return all that the view shows, by name. "centre" is the prefix of what has no samples."""
    content = lightfield(**render)
    opened, pose = set_up(folder, content)
    names = [each.name for each in content.passes if not each.of_colour]
    geometry = render_geometry(opened, pose, names)
    colour = render_colour(opened, pose, 5, content.passes, content.transparent)
    manifest = " ".join(f"{name} {number}" for name, number in colour.manifest.items())
    return {
        "colour": colour.pixels,
        **colour.passes,
        "centre depth": geometry.depth,
        **{f"centre {name}": pixels for name, pixels in geometry.passes.items()},
        "centre manifest": np.array(manifest),
    }


def write_cases(folder):
    for name, render in CASES.items():
        passes = [*render.get("passes", ()), VARIANCE]
        whole, mean = view(folder, **render), view(folder, **render | {"passes": passes})
        both = {f"whole {key}": value for key, value in whole.items()}
        both |= {f"mean {key}": value for key, value in mean.items()}
        np.savez(folder / f"{name}.npz", **both)


def write_parts(folder):
    """Write the pass, and the parts that Cycles itself makes of a whole view's samples."""
    content = lightfield(passes=[VARIANCE])
    opened, pose = set_up(folder, content)
    # The seed of the dataset's view.
    seed = view_seed(content.render.seed, content.views[0].name)
    measured = render_colour(opened, pose, seed, content.passes).passes[VARIANCE]
    settings = bpy.context.scene.cycles
    settings.use_sample_subset = True
    settings.sample_subset_length = SAMPLES // SAMPLE_PARTS
    parts = []
    for settings.sample_offset in range(0, SAMPLES, SAMPLES // SAMPLE_PARTS):
        parts.append(render_colour(opened, pose, seed).pixels)
    np.savez(folder / "parts.npz", measured=measured, parts=parts)


def write_seeds(folder, scene):
    """Write the colour and the pass of a view for each of many seeds."""
    content = lightfield(ROOM_SIZE, passes=[VARIANCE])
    opened, pose = set_up(folder, content, scene)
    views = [render_colour(opened, pose, 1000 + seed, content.passes) for seed in range(SEEDS)]
    np.savez(
        folder / f"{scene}.npz",
        colour=[each.pixels for each in views],
        variance=[each.passes[VARIANCE] for each in views],
    )


def main(folder):
    build_open(folder)
    build_room(folder, "lamp behind a board", bounces=True)
    build_room(folder, "large lamp", bounces=False)
    write_cases(folder)
    write_parts(folder)
    write_seeds(folder, "lamp behind a board")
    write_seeds(folder, "large lamp")
    content = lightfield(passes=["normal", VARIANCE])
    receipt = folder / "receipts/dataset.jsonl"
    one_shard.render(content, folder / "dataset", folder / "open.blend", receipt=receipt)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
