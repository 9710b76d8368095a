"""What the passes of a scene's view hold, against what else is known of it, and what they cost.

For each lens: the largest difference between the colour and the sum of its parts of light, as a
part of the colour; how many pixels have the object that Blender's ray casts find; and the angles
in degrees, their median and third quartile, between normals and the faces' that these find. Then
the seconds and the bytes of a view with more and more passes.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.dataset.journal import read
from lightfield.dataset.lightfield import LightField
from lightfield.dataset.passes import PARTS_OF_LIGHT, PASSES
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.rendering import shard

Array = np.ndarray[Any, Any]

LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80},
    "fisheye": {"lens": "equidistant", "fov": 180},
    "panorama": {"lens": "equirectangular"},
}
GEOMETRY, MOTION = ["normal", "object", "material"], ["motion"]
LIGHT = [found.name for found in PASSES.values() if found.of_colour]
STEPS = {"none": [], "geometry": GEOMETRY, "and motion": GEOMETRY + MOTION, "all": list(PASSES)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="its views' poses")
    parser.add_argument("--size", type=int, default=64, help="pixels of a side")
    parser.add_argument("--samples", type=int, default=4)
    arguments = parser.parse_args()
    given = LightField.read(arguments.lightfield)
    with tempfile.TemporaryDirectory() as name:
        for lens in LENSES:
            content = _content(given, lens, arguments.size, arguments.samples, list(PASSES))
            folder = Path(name, lens)
            _render(content, arguments.blend, folder)
            print(lens, json.dumps(_figures(content, folder)), flush=True)
        for step, passes in STEPS.items():
            content = _content(given, "fisheye", arguments.size, arguments.samples, passes)
            folder = Path(name, step)
            seconds = _render(content, arguments.blend, folder)
            sizes = {path.parent.name: path.stat().st_size for path in folder.rglob("view_*.exr")}
            print(step, f"{seconds:.2f} s a view,", json.dumps(sizes), flush=True)


def _content(
    given: LightField, lens: str, size: int, samples: int, passes: list[str]
) -> LightField:
    wide = 2 if lens == "panorama" else 1
    made = lenses.from_camera({**LENSES[lens], "resolution": [wide * size, size]})
    render = {**given.render, "samples": samples, "denoise": False, "passes": passes}
    # The first view's time has some of the start-up in it.
    return given.changed(made, given.views[:3], depth=made.usual_depth, render=render)


def _render(content: LightField, blend: Path, folder: Path) -> float:
    """Render the views and return the seconds that one of them took."""
    journal = folder / "journal.jsonl"
    shard.render(
        content,
        ":",
        folder / "exr",
        blend=blend,
        inventory=None,
        device="cpu",
        threads=1,
        journal=journal,
    )
    (made,) = read(journal)
    return float(np.mean([view["wall_seconds"] for view in made.views[1:]]))


def _figures(content: LightField, folder: Path) -> dict[str, float]:
    view = content.views[0]
    image = images.read_image(folder / "exr" / f"{view.name}.exr")
    found = {
        name: np.stack(
            list(
                images.read_image(
                    PASSES[name].path(folder, view.name), PASSES[name].channels
                ).channels.values()
            ),
            axis=-1,
        ).astype(np.float64)
        for name in PASSES
    }
    colour = image.colour.astype(np.float64)
    total = np.sum([found[name] for name in PARTS_OF_LIGHT], axis=0)
    numbers = json.loads((folder / "object" / "names.json").read_text())
    names, normals = _cast(content)
    cast = np.vectorize(lambda name: numbers.get(name, 0))(names)
    seen = np.isfinite(content.lens.pixel_rays()[..., 0])
    same = seen & (cast > 0) & (cast == found["object"][..., 0])
    cosine = np.sum(normals * found["normal"], axis=-1)[same].clip(-1, 1)
    turned = np.degrees(np.arccos(cosine))
    return {
        "sum": float((np.abs(total - colour) / np.maximum(colour, 1e-3)).max()),
        "objects": float((found["object"][..., 0] == cast)[seen].mean()),
        "normals": np.quantile(turned, (0.5, 0.75)).round(2).tolist(),
    }


def _cast(content: LightField) -> tuple[Array, Array]:
    """Return name (h, w) and face normal (h, w, 3) of what is behind the first view's pixels."""
    view, scene = content.views[0], bpy.context.scene
    rays = content.lens.pixel_rays() @ view.matrix[:3, :3].T
    depsgraph = bpy.context.evaluated_depsgraph_get()
    names, normals = np.full(rays.shape[:2], "", dtype=object), np.zeros(rays.shape)
    for pixel in zip(*np.nonzero(np.isfinite(rays[..., 0])), strict=True):
        hit, _, normal, _, thing, _ = scene.ray_cast(
            depsgraph, Vector(view.position), Vector(rays[pixel])
        )
        if hit:
            names[pixel] = thing.name_full
            normals[pixel] = -np.sign(np.dot(normal, rays[pixel])) * np.array(normal)
    return names, normals


if __name__ == "__main__":
    run(main)
