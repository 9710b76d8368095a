"""Renders views exactly as the workflow does, and also Cycles' Position pass.

Runs in a process of its own, because bpy keeps one global state. Arguments: a .blend, an .npz to
write, and a JSON file that maps names to the content of a lightfield.json. The first frame of each
is rendered. Output, for each name: the depth channel as in the dataset, and the points that
Cycles hit, in world coordinates (NaN without a hit).
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.formats.lightfield import LightField
from lightfield.rendering.setup import cycles
from lightfield.rendering.views import geometry_pass, shard
from lightfield.rendering.views.view import render_view


def main(blend: Path, output: Path, cases: Path) -> None:
    results = {}
    for name, content in json.loads(cases.read_text()).items():
        lightfield = LightField.from_json(content)
        opened = cycles.set_up(blend, None, lightfield, "cpu", 1)
        pose = lightfield.views[0].world_from_camera
        depth = geometry_pass.render_geometry(opened, pose).depth
        z = shard.depth_channel(depth, lightfield, shard.depth_rays(lightfield))
        results[f"{name}.z"] = z.astype(np.float64)
        layer = bpy.context.scene.view_layers[0]
        layer.use_pass_position = layer.use_pass_z = True
        passes = render_view(opened, pose, 0, {"Position": "XYZ", "Depth": "Z"}).passes
        missed = passes["Depth"] >= geometry_pass.MISS
        results[f"{name}.points"] = np.where(missed, np.nan, passes["Position"])
    np.savez(output, **results)


main(*map(Path, sys.argv[1:]))
