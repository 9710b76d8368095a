"""Program that renders views exactly as the workflow does, and Cycles' Position pass beside them.

Runs in a process of its own, because bpy keeps one global state. Arguments: a .blend, an .npz to
write, and a JSON file that maps names to the content of a lightfield.json; of each, the first
frame is rendered. Output, for each name: the depth channel as the dataset would hold it, and the
points that Cycles hit, in world coordinates (NaN without a hit).
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

from lightfield.dataset.lightfield import LightField
from lightfield.imaging import images
from lightfield.rendering import cycles, shard, view


def main(blend: Path, output: Path, cases: Path) -> None:
    results = {}
    for name, content in json.loads(cases.read_text()).items():
        lightfield = LightField.from_json(content)
        cycles.set_up(blend, None, lightfield, "cpu", 1)
        scene = bpy.context.scene
        raw = view.render_view(lightfield.views[0].matrix, 0)
        channels, _ = shard.view_channels(raw, lightfield, shard.depth_rays(lightfield))
        results[f"{name}.z"] = channels["Z"].astype(np.float64)
        scene.view_layers[0].use_pass_position = True
        scene.render.filepath = str(output.with_suffix(".exr"))
        bpy.ops.render.render(write_still=True)
        passes = images.read_image(scene.render.filepath).channels
        layer = scene.view_layers[0].name
        points = np.stack([passes[f"{layer}.Position.{c}"] for c in "XYZ"], axis=-1)
        missed = passes[f"{layer}.Depth.Z"] >= view.CYCLES_MISS
        results[f"{name}.points"] = np.where(missed[..., None], np.nan, points)
    np.savez(output, **results)


main(*map(Path, sys.argv[1:]))
