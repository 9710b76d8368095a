"""What the passes of a scene's view hold, against what else is known of it, and what they cost.

For each lens, of the first view: by how much of the colour its parts of light add up to another,
at most; how many pixels have the object that Blender's ray casts find, and how many have it first
in their Cryptomatte; by how much of it depth differs from the ray casts' there, in the median and
the 99th percentile; the angles in degrees, their median and third quartile, between normals and
those of the faces that these find, and those of planes through neighbouring depths; motion in
pixels, of what stands still; values that were not a number, and how many of them not at the rim of
an image circle or of the picture; which part of its paint the albedo is, in the median, the 5th and
the 95th percentile, where Blender's nodes say that a surface is nothing but painted; and from it to
a second view, 5 cm beside it, how many pixels are visible there, and by how much their albedo
differs, in the mean, from its own where flow leads, and where it does not. Then the seconds of a
core, those of the geometry among them, and the bytes of a view with more and more passes.
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
from scipy.ndimage import binary_erosion

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.dataset import keys
from lightfield.dataset.journal import read
from lightfield.dataset.lightfield import NAME, LightField, View
from lightfield.dataset.passes import MANIFEST, PARTS_OF_LIGHT, PASSES
from lightfield.export.source import SourceDataset, Surface
from lightfield.geometry import lenses
from lightfield.geometry.flow import flow
from lightfield.imaging import images
from lightfield.rendering import shard
from lightfield.rendering.colour_pass import render_colour

Array = np.ndarray[Any, Any]

LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80},
    "fisheye": {"lens": "equidistant", "fov": 180},
    "panorama": {"lens": "equirectangular"},
}
# What is no paint shines with.
UNPAINTED = 1e4
# Metres.
BESIDE = 0.05
GEOMETRY = ["normal", "object", "material"]
STEPS = {
    "none": [],
    "geometry": GEOMETRY,
    "and motion": [*GEOMETRY, "motion"],
    "and instance": [*GEOMETRY, "motion", "instance"],
    "and cryptomatte": [*GEOMETRY, "motion", "instance", "cryptomatte"],
    "all": list(PASSES),
}


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
            content.write(folder / NAME)
            _render(content, arguments.blend, folder)
            print(lens, json.dumps(_figures(content, folder)), flush=True)
        for step, passes in STEPS.items():
            content = _content(given, "fisheye", arguments.size, arguments.samples, passes)
            folder = Path(name, step)
            seconds, geometry = _render(content, arguments.blend, folder)
            sizes = {path.parent.name: path.stat().st_size for path in folder.rglob("view_*.exr")}
            costs = f"{seconds:.2f} core seconds a view, {geometry:.2f} of them for geometry,"
            print(step, costs, json.dumps(sizes), flush=True)


def _content(
    given: LightField, lens: str, size: int, samples: int, passes: list[str]
) -> LightField:
    wide = 2 if lens == "panorama" else 1
    made = lenses.from_camera({**LENSES[lens], "resolution": [wide * size, size]})
    render = {**given.render, "samples": samples, "denoise": False, "passes": passes}
    render |= {"transparent": False}
    # The first view's time has some of the start-up in it.
    first, _, last = given.views[:3]
    matrix = first.matrix.copy()
    matrix[:3, 3] += BESIDE * matrix[:3, 0]
    views = [first, View.placed("beside", matrix), last]
    return given.changed(made, views, depth=made.usual_depth or "distance", render=render)


def _render(content: LightField, blend: Path, folder: Path) -> tuple[float, float]:
    """Render the views; return a view's seconds of a core, and those of its geometry."""
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
    columns = ("cpu_seconds", "geometry_seconds")
    seconds, geometry = (np.mean([view[name] for view in made.views[1:]]) for name in columns)
    return float(seconds), float(geometry)


def _read(folder: Path, name: str, view: str) -> tuple[Array, int]:
    """Return a pass (h, w, channels) and how many of its values were not a number."""
    image = images.read_image(PASSES[name].path(folder, view), PASSES[name].channels)
    planes = [image.channels[channel] for channel in PASSES[name].channels]
    return np.stack(planes, axis=-1), int(image.attributes.get(images.NAN_ATTRIBUTE, 0))


def _figures(content: LightField, folder: Path) -> dict[str, Any]:
    view, beside = content.views[:2]
    read = {name: _read(folder, name, view.name) for name in PASSES}
    found = {name: pixels for name, (pixels, _) in read.items()}
    source = SourceDataset(folder, "", ".exr")
    distance = source.depth(view, "distance")
    there = source.depth(beside, "distance")
    colour = images.read_image(source.path(view)).colour.astype(np.float64)
    total = np.sum([found[name].astype(np.float64) for name in PARTS_OF_LIGHT], axis=0)
    rays = content.lens.pixel_rays()
    seen = np.isfinite(rays[..., 0])
    inside = binary_erosion(seen, np.ones((3, 3)), iterations=2, border_value=0)
    different = np.abs(total - colour) / np.maximum(colour, 1e-3)
    objects = found["object"][..., 0]
    numbers = json.loads((folder / "object" / "names.json").read_text())
    names, normals, away = _cast(content)
    cast = np.vectorize(lambda name: numbers.get(name, 0))(names)
    same = seen & (cast > 0) & (cast == objects)
    manifest = json.loads(
        images.read_header(PASSES["cryptomatte"].path(folder, view.name)).attributes[MANIFEST]
    )
    first = found["cryptomatte"][..., 0].astype(np.float32).view(np.uint32)
    hashed = {number: int(manifest.get(name, "0"), 16) for name, number in numbers.items()}
    expected = np.vectorize(lambda number: hashed.get(number, 0))(objects)
    _, planes = Surface(content.lens, view, rays, distance).points(1)
    hit = np.isfinite(distance) & (distance > 0)
    led, visible = flow(content.lens, view.matrix, beside.matrix, distance, there)
    albedo = found["albedo"]
    other = _read(folder, "albedo", beside.name)[0]
    paint = _paint(content)
    painted = ((paint > 0.01) & (paint < UNPAINTED / 2 / content.render["samples"])).all(axis=-1)
    row, column = np.nonzero(visible & hit)
    across, down = led[row, column].T
    x = np.floor(column + 0.5 + across).astype(int) % content.lens.width
    y = np.floor(row + 0.5 + down).astype(int)
    return {
        "sum": float(different.max()),
        "sum inside": float(different[inside].max()),
        "objects": float((objects == cast)[seen].mean()),
        "mattes": float((first == expected)[hit].mean()),
        "depth": np.quantile(np.abs(distance / away - 1)[same], (0.5, 0.99)).tolist(),
        "normals": _angles(normals[same], found["normal"][same]),
        "depth gradients": _angles(planes, found["normal"][hit]),
        "motion": float(np.abs(found["motion"]).max()),
        "nan": {name: lost for name, (_, lost) in read.items() if lost},
        "lost inside": int((hit & inside & ~found["normal"].any(axis=-1)).sum()),
        "albedo of paint": np.quantile(albedo[painted] / paint[painted], (0.5, 0.05, 0.95)).tolist()
        if painted.any()
        else [],
        "painted": float(painted.sum() / seen.sum()),
        "visible": float((visible & hit).sum() / hit.sum()),
        "warped": float(np.abs(albedo[row, column] - other[y, x]).mean()),
        "not warped": float(np.abs(albedo[row, column] - other[row, column]).mean()),
    }


def _paint(content: LightField) -> Array:
    """Return the paint (h, w, 3) of the first view's surfaces, much more where one has another.

    Each shines with its paint as Blender's nodes give it, through the same samples as the colour.
    """
    for shaded in (*bpy.data.materials, bpy.context.scene.world):
        if tree := shaded and shaded.node_tree:
            output = tree.get_output_node("CYCLES")
            light = tree.nodes.new("ShaderNodeEmission")
            light.inputs["Color"].default_value = (UNPAINTED, UNPAINTED, UNPAINTED, 1)
            if output and (paint := _paint_socket(output.inputs["Surface"])):
                light.inputs["Color"].default_value = paint.default_value
                if paint.is_linked:
                    tree.links.new(light.inputs["Color"], paint.links[0].from_socket)
            if output:
                tree.links.new(output.inputs["Surface"], light.outputs[0])
    view = content.views[0]
    return render_colour(view.matrix, keys.view_seed(content.render["seed"], view.name)).pixels


def _paint_socket(surface: Any) -> Any:
    """Return the colour of a surface that is paint alone, opaque, or None."""
    shader = surface.links[0].from_node if surface.links else None
    if shader and shader.type == "BSDF_DIFFUSE":
        return shader.inputs["Color"]
    if not shader or shader.type != "BSDF_PRINCIPLED":
        return None
    none = ("Metallic", "Transmission Weight", "Subsurface Weight", "Sheen Weight", "Coat Weight")
    values = [(shader.inputs[name], 0) for name in none] + [(shader.inputs["Alpha"], 1)]
    pure = all(not socket.is_linked and socket.default_value == value for socket, value in values)
    return shader.inputs["Base Color"] if pure else None


def _angles(one: Array, other: Array) -> list[float]:
    """Return the median and the third quartile of the degrees between normals (n, 3)."""
    cosine = np.sum(one * other, axis=-1)
    known = np.isfinite(cosine) & other.any(axis=-1)
    turned = np.degrees(np.arccos(cosine[known].clip(-1, 1)))
    found: list[float] = np.quantile(turned, (0.5, 0.75)).round(2).tolist() if known.any() else []
    return found


def _cast(content: LightField) -> tuple[Array, Array, Array]:
    """Return name (h, w), normal (h, w, 3) and distance (h, w) of the faces in the first view."""
    view = content.views[0]
    scene = bpy.context.scene
    rays = content.lens.pixel_rays() @ view.matrix[:3, :3].T
    depsgraph = bpy.context.evaluated_depsgraph_get()
    names = np.full(rays.shape[:2], "", dtype=object)
    normals = np.zeros(rays.shape)
    away = np.full(rays.shape[:2], np.inf)
    for pixel in zip(*np.nonzero(np.isfinite(rays[..., 0])), strict=True):
        hit, place, normal, _, thing, _ = scene.ray_cast(
            depsgraph, Vector(view.position), Vector(rays[pixel])
        )
        if hit:
            names[pixel] = thing.name_full
            normals[pixel] = -np.sign(np.dot(normal, rays[pixel])) * np.array(normal)
            away[pixel] = np.linalg.norm(np.array(place) - view.position)
    return names, normals, away


if __name__ == "__main__":
    run(main)
