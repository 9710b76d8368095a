"""Renders a bright wall's edge with a camera that moves while its shutter is open.

Run by test_camera_motion.py in a process of its own, because bpy has one scene at a time:
motion_renders.py FOLDER writes FOLDER/results.npz.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import lenses
from lightfield.geometry.exposure import pose_at, row_times
from lightfield.measurement.trials import Trials, ViewWindow
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
from lightfield.rendering.views.colour_pass import render_colour
from lightfield.rendering.views.geometry_pass import render_geometry

FOLDER = Path(sys.argv[1])
SIZE = 64
CAMERA = {"lens": "rectilinear", "fov": 60, "resolution": [SIZE, SIZE]}
WIDE = {
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [SIZE, SIZE]},
    "panorama": {"lens": "equirectangular", "resolution": [SIZE, SIZE // 2]},
}
RIG = {"type": "lattice", "cameras": [1, 1, 1], "size": 0}
RENDER = {"samples": 64, "adaptive_threshold": 0, "denoise": False, "seed": 0}
TRAVEL = {"travel": [0.3, 0, 0], "turn": [0, 0, 0]}
TURN = {"travel": [0, 0, 0], "turn": [0, 8, 0]}
SUB_FRAMES = 16


def build():
    """Save a glowing wall 2 m ahead, whose left edge is at x = 0. All else is black."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=20, location=(10, 0, -2))
    material = bpy.data.materials.new("glow")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    glow = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(glow.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    bpy.context.object.data.materials.append(material)
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "wall.blend"))


def lightfield(camera, motion):
    render = RENDER | ({"camera_motion": motion} if motion else {})
    lens = lenses.from_camera(camera)
    return LightField.from_rig(
        RIG, lens, depth=lens.usual_depth or "distance", frame=1, render=render, scene={}
    )


def set_up(camera=CAMERA, **motion):
    content = lightfield(camera, motion)
    opened = cycles.set_up(FOLDER / "wall.blend", None, content, "cpu", 1)
    # The mean of a pixel's square.
    bpy.context.scene.cycles.pixel_filter_type = "BOX"
    bpy.context.scene.cycles.filter_width = 1.0
    return opened


def red(opened, matrix, seed=0):
    return render_colour(opened, matrix, seed).pixels[..., 0]


def sub_frames(opened, motion):
    """Return the mean of still pictures at equal steps of the exposure.

    Together they have four times the samples of a blurred picture.
    """
    bpy.context.scene.cycles.samples = RENDER["samples"] * 4 // SUB_FRAMES
    times = (np.arange(SUB_FRAMES) + 0.5) / SUB_FRAMES - 0.5
    poses = [pose_at(np.eye(4), motion["travel"], motion["turn"], time) for time in times]
    mean = np.mean([red(opened, pose, seed) for seed, pose in enumerate(poses)], axis=0)
    bpy.context.scene.cycles.samples = RENDER["samples"]
    return mean


build()
pictures = {}
opened = set_up()
pictures["still"] = red(opened, np.eye(4))
for name, motion in (("travel", TRAVEL), ("turn", TURN)):
    pictures[f"{name}_sub_frames"] = sub_frames(opened, motion)
pictures["depth_still"] = render_geometry(opened, np.eye(4)).depth
for name, motion in (("travel", TRAVEL), ("turn", TURN)):
    opened = set_up(**motion)
    pictures[name] = red(opened, np.eye(4))
pictures["depth"] = render_geometry(opened, np.eye(4)).depth
# Another pose, and back: the keys of one view must not stay in the next.
red(opened, pose_at(np.eye(4), (1, 0, 0), (0, 30, 0), 1))
pictures["turn_again"] = red(opened, np.eye(4))
for rolling in (0.01, 0.5):
    opened = set_up(**TRAVEL, rolling=rolling)
    pictures[f"rolling_{rolling}"] = red(opened, np.eye(4))
# Wide lenses: a turn about the camera's right moves the horizon.
TILT = {"travel": [0.1, 0, 0], "turn": [8, 4, 0]}
for name, camera in WIDE.items():
    opened = set_up(camera)
    pictures[f"{name}_still"] = red(opened, np.eye(4))
    pictures[f"{name}_sub_frames"] = sub_frames(opened, TILT)
    times = row_times(len(pictures[f"{name}_still"]), 0.01)
    rows = []
    for row, moment in enumerate(times):
        cycles.set_window(0, row, SIZE, 1)
        rows.append(red(opened, pose_at(np.eye(4), TILT["travel"], TILT["turn"], moment)))
    pictures[f"{name}_rows"] = np.concatenate(rows)
    opened = set_up(camera, **TILT)
    pictures[name] = red(opened, np.eye(4))
    opened = set_up(camera, **TILT, rolling=0.01)
    pictures[f"{name}_rolling"] = red(opened, np.eye(4))
# A window of a view, as measurements of error and time render it.
blend_file.open_scene(FOLDER / "wall.blend")
contents = {"left_out": ["animation"], "sampling": cycles.sampling(), "volumes": []}
write_json(FOLDER / "inventory.json", contents)
content = lightfield(CAMERA, {**TRAVEL, "rolling": 0.5})
content = content.changed(views=[View.placed("wall", np.eye(4))])
trials = Trials(
    FOLDER / "wall.blend", FOLDER / "inventory.json", content, "cpu", 1, FOLDER / "cache"
)
window = ViewWindow(content.views[0], 8, 40, 48, 20)
for name, part in (("trial", trials.first_view), ("trial_window", window)):
    pictures[name] = trials.render(part, 1, {"samples": 64}).colour[..., 0]
np.savez(FOLDER / "results.npz", **pictures)
