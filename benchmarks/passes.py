"""Compare the passes of a scene's view with independent answers, and measure what they cost.

Prints for each lens, of the first view:

- sum: by how much the parts of light differ from the colour, relative to it, at most. "inside"
  leaves out the rim.
- groups: the same of the light groups, of which each emitter has one, and the number of groups.
- reprojected groups: the same through a perspective lens of 100 degrees, by filter.
- objects: the part of the pixels whose object is the one that Blender's ray casts hit.
- mattes: the part of the pixels whose first Cryptomatte entry is that object.
- depth: its relative difference from the ray casts' distance, median and 99th percentile.
- normals: the angle to the normals of the faces that the ray casts hit, in degrees, median and
  third quartile.
- depth gradients: the same, to the normals of planes through neighbouring depths.
- motion: its largest value in pixels; the scene stands still.
- nan: how many values of each pass were not a number.
- lost inside: pixels that have no normal although they are not at a rim.
- albedo of paint: albedo over paint, median, 5th and 95th percentile. It covers the surfaces
  that are nothing but painted, by Blender's nodes; painted is their part of the pixels.
- base colour of paint: base_colour over paint, where surface_mask is 1 and the surface painted.
- surfaces: the part of the pixels whose surface_mask is 1, and the part where it is not 0.
- visible: the part of the pixels that a second view, 5 cm beside the first, also sees.
- warped: the mean difference of albedo to that view, where flow leads; not warped: without flow.

Then it prints the core seconds of a view, how many of them the geometry takes, and its bytes. It
does so with more and more passes, and with a moving camera.
"""

import argparse
import json
import subprocess
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
from lightfield.core.files import write_json
from lightfield.dataset import keys
from lightfield.dataset.journal import read
from lightfield.dataset.light_groups import resolved
from lightfield.dataset.lightfield import NAME, LightField, View
from lightfield.dataset.passes import MANIFEST, PARTS_OF_LIGHT, PASSES, of_group
from lightfield.dataset.reprojections import ReprojectionSettings
from lightfield.export.source import SourceDataset, Surface
from lightfield.geometry import lenses
from lightfield.geometry.flow import flow
from lightfield.imaging import images
from lightfield.rendering import blend_file, inventory, light, shard
from lightfield.rendering.colour_pass import render_colour
from lightfield.reprojection.filters import FILTERS
from lightfield.validation.light_sums import error

Array = np.ndarray[Any, Any]

LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80},
    "fisheye": {"lens": "equidistant", "fov": 180},
    "panorama": {"lens": "equirectangular"},
}
# The brightness of a surface that is not mere paint.
UNPAINTED = 1e4
# Metres from the first view to the second.
BESIDE = 0.05
GEOMETRY = ["normal", "object", "material"]
STEPS = {
    "none": [],
    "geometry": GEOMETRY,
    "and motion": [*GEOMETRY, "motion"],
    "and instance": [*GEOMETRY, "motion", "instance"],
    "and cryptomatte": [*GEOMETRY, "motion", "instance", "cryptomatte"],
    "all": list(PASSES),
    "surfaces alone": [name for name, each in PASSES.items() if each.unless],
}
MOTION = {"travel": [0.05, 0, 0], "turn": [0, 2, 0]}
# What makes views cost more beside passes, as keys of a render block.
OTHERS = {
    "moving camera": {"camera_motion": MOTION},
    "rolling shutter": {"camera_motion": {**MOTION, "rolling": 0.1}},
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--lightfield", required=True, type=Path, help="its views' poses")
    parser.add_argument("--size", type=int, default=64, help="height of a view (default: 64)")
    parser.add_argument("--samples", type=int, default=4, help="a pixel (default: 4)")
    arguments = parser.parse_args()
    poses = LightField.read(arguments.lightfield)
    groups = _groups(arguments.blend)
    with tempfile.TemporaryDirectory() as name:
        for lens in LENSES:
            content = _content(poses, lens, arguments.size, arguments.samples, list(PASSES))
            content = content.changed(render={**content.render, "light_groups": groups})
            folder = Path(name, lens)
            content.write(folder / NAME)
            _render(content, arguments.blend, folder)
            print(lens, json.dumps(_figures(content, folder)), flush=True)
        more = {"light groups alone": {"light_groups": groups}, **OTHERS}
        for step in [*STEPS, *more]:
            passes = STEPS.get(step, [])
            content = _content(poses, "fisheye", arguments.size, arguments.samples, passes)
            content = content.changed(render={**content.render, **more.get(step, {})})
            folder = Path(name, step)
            seconds, geometry = _render(content, arguments.blend, folder)
            sizes = {path.parent.name: path.stat().st_size for path in folder.rglob("view_*.exr")}
            costs = f"{seconds:.2f} core seconds a view, {geometry:.2f} of them for geometry,"
            print(step, costs, json.dumps(sizes), flush=True)


def _groups(blend: Path) -> dict[str, list[str]]:
    """Return a light group for each emitter of a scene."""
    blend_file.open_scene(blend)
    inventory.inventory([bpy.context.scene.frame_current])
    return resolved("each", light.emitters())


def _content(
    poses: LightField, lens: str, size: int, samples: int, passes: list[str]
) -> LightField:
    aspect = 2 if lens == "panorama" else 1
    camera_lens = lenses.from_camera({**LENSES[lens], "resolution": [aspect * size, size]})
    render = {**poses.render, "samples": samples, "denoise": False, "passes": passes}
    render |= {"transparent": False}
    # The first view's time includes some of the start-up.
    first, _, last = poses.views[:3]
    matrix = first.matrix.copy()
    matrix[:3, 3] += BESIDE * matrix[:3, 0]
    views = [first, View.placed("beside", matrix), last]
    depth = camera_lens.usual_depth or "distance"
    return poses.changed(camera_lens, views, depth=depth, render=render)


def _render(content: LightField, blend: Path, folder: Path) -> tuple[float, float]:
    """Render the views; return the mean core seconds of a view, and those of its geometry."""
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
    (session,) = read(journal)
    views = session.views[1:]
    seconds = np.mean([view["cpu_seconds"] for view in views])
    geometry = np.mean([view["geometry_seconds"] for view in views])
    return float(seconds), float(geometry)


def _read(folder: Path, name: str, view: str) -> tuple[Array, int]:
    """Return a pass (h, w, channels) and how many of its values were not a number."""
    image = images.read_image(PASSES[name].path(folder, view), PASSES[name].channels)
    planes = [image.channels[channel] for channel in PASSES[name].channels]
    return np.stack(planes, axis=-1), int(image.attributes.get(images.NAN_ATTRIBUTE, 0))


def _sum_error(parts: list[Array], colour: Array) -> Array:
    """Return how far the sum of ``parts`` is from the colour, relative to it."""
    relative: Array = np.abs(np.sum(parts, axis=0) - colour) / np.maximum(colour, 1e-3)
    return relative


def _reprojected_sums(folder: Path) -> dict[str, float]:
    """Return how far the light groups are from the colour in a reprojection, by filter."""
    errors = {}
    for name in FILTERS:
        settings = ReprojectionSettings.of(
            camera={"lens": "rectilinear", "fov": 100, "resolution": [64, 64]},
            filter=name,
            formats=["exr"],
            passes=["light_groups"],
        )
        path = folder / f"{name}.json"
        write_json(path, settings.as_json())
        program = Path(__file__).resolve().parents[1] / "scripts" / "reproject.py"
        arguments = ["--settings", path, "--input-cfg", folder / NAME]
        arguments += ["--input-dir", folder / "exr", "--output-dir", folder / name]
        arguments += ["--output-cfg", folder / name / NAME]
        subprocess.run([sys.executable, program, *arguments], check=True, capture_output=True)
        content = LightField.read(folder / name / NAME)
        views = [view.name for view in content.views]
        colours = [images.read_image(folder / name / f"{view}.exr").channels for view in views]
        errors[name] = max(
            error(folder / name, view, content.light_groups, np.stack([c[k] for k in "RGB"])) or 0.0
            for view, c in zip(views, colours, strict=True)
        )
    return errors


def _ratios(values: Array, paint: Array, pixels: Array) -> list[float]:
    """Return the median, 5 % and 95 % quantile of values over their paint. Empty without pixels."""
    if not pixels.any():
        return []
    quantiles: list[float] = np.quantile(values[pixels] / paint[pixels], (0.5, 0.05, 0.95)).tolist()
    return quantiles


def _figures(content: LightField, folder: Path) -> dict[str, Any]:
    view, beside = content.views[:2]
    read = {name: _read(folder, name, view.name) for name in PASSES}
    passes = {name: pixels for name, (pixels, _) in read.items()}
    source = SourceDataset(folder, "", ".exr")
    distance = source.depth(view, "distance")
    beside_distance = source.depth(beside, "distance")
    colour = images.read_image(source.path(view)).colour.astype(np.float64)
    parts = [passes[name].astype(np.float64) for name in PARTS_OF_LIGHT]
    sum_error = _sum_error(parts, colour)
    group_paths = [of_group(name).path(folder, view.name) for name in content.light_groups]
    groups = [images.read_image(path).colour.astype(np.float64) for path in group_paths]
    group_error = _sum_error(groups, colour)
    rays = content.lens.pixel_rays()
    covered = np.isfinite(rays[..., 0])
    inside = binary_erosion(covered, np.ones((3, 3)), iterations=2, border_value=0)
    mask = passes["surface_mask"][..., 0]
    objects = passes["object"][..., 0]
    numbers = json.loads((folder / "object" / "names.json").read_text())
    names, normals, cast_distance = _cast(content)
    cast = np.vectorize(lambda name: numbers.get(name, 0))(names)
    same = covered & (cast > 0) & (cast == objects)
    manifest = json.loads(
        images.read_header(PASSES["cryptomatte"].path(folder, view.name)).attributes[MANIFEST]
    )
    matte = passes["cryptomatte"][..., 0].astype(np.float32).view(np.uint32)
    hashes = {number: int(manifest.get(name, "0"), 16) for name, number in numbers.items()}
    expected_matte = np.vectorize(lambda number: hashes.get(number, 0))(objects)
    _, planes = Surface(content.lens, view, rays, distance).points(1)
    hit = np.isfinite(distance) & (distance > 0)
    motion, visible = flow(content.lens, view.matrix, beside.matrix, distance, beside_distance)
    albedo = passes["albedo"]
    beside_albedo = _read(folder, "albedo", beside.name)[0]
    paint = _paint(content)
    painted = ((paint > 0.01) & (paint < UNPAINTED / 2 / content.render["samples"])).all(axis=-1)
    row, column = np.nonzero(visible & hit)
    across, down = motion[row, column].T
    x = np.floor(column + 0.5 + across).astype(int) % content.lens.width
    y = np.floor(row + 0.5 + down).astype(int)
    return {
        "sum": float(sum_error.max()),
        "sum inside": float(sum_error[inside].max()),
        "groups": [float(group_error.max()), len(content.light_groups)],
        "reprojected groups": _reprojected_sums(folder),
        "objects": float((objects == cast)[covered].mean()),
        "mattes": float((matte == expected_matte)[hit].mean()),
        "depth": np.quantile(np.abs(distance / cast_distance - 1)[same], (0.5, 0.99)).tolist(),
        "normals": _angles(normals[same], passes["normal"][same]),
        "depth gradients": _angles(planes, passes["normal"][hit]),
        "motion": float(np.abs(passes["motion"]).max()),
        "nan": {name: count for name, (_, count) in read.items() if count},
        "lost inside": int((hit & inside & ~passes["normal"].any(axis=-1)).sum()),
        "albedo of paint": _ratios(albedo, paint, painted),
        "base colour of paint": _ratios(passes["base_colour"], paint, painted & (mask == 1)),
        "surfaces": [float((mask == 1).sum() / covered.sum()), float((mask > 0).mean())],
        "painted": float(painted.sum() / covered.sum()),
        "visible": float((visible & hit).sum() / hit.sum()),
        "warped": float(np.abs(albedo[row, column] - beside_albedo[y, x]).mean()),
        "not warped": float(np.abs(albedo[row, column] - beside_albedo[row, column]).mean()),
    }


def _paint(content: LightField) -> Array:
    """Return the paint (h, w, 3) of the first view's surfaces; UNPAINTED for any other material.

    Each surface shines with its paint from Blender's nodes, through the same samples as the colour.
    """
    for shaded in (*bpy.data.materials, bpy.context.scene.world):
        if shaded and shaded.node_tree:
            _shine_with_paint(shaded.node_tree)
    view = content.views[0]
    return render_colour(view.matrix, keys.view_seed(content.render["seed"], view.name)).pixels


def _shine_with_paint(tree: Any) -> None:
    """Replace a material's or world's surface by an emission of its paint."""
    output = tree.get_output_node("CYCLES")
    light = tree.nodes.new("ShaderNodeEmission")
    light.inputs["Color"].default_value = (UNPAINTED, UNPAINTED, UNPAINTED, 1)
    if not output:
        return
    paint = _paint_socket(output.inputs["Surface"])
    if paint:
        light.inputs["Color"].default_value = paint.default_value
        if paint.is_linked:
            tree.links.new(light.inputs["Color"], paint.links[0].from_socket)
    tree.links.new(output.inputs["Surface"], light.outputs[0])


def _paint_socket(surface: Any) -> Any:
    """Return the colour socket of a surface that is opaque paint alone, or None."""
    shader = surface.links[0].from_node if surface.links else None
    if shader and shader.type == "BSDF_DIFFUSE":
        return shader.inputs["Color"]
    if not shader or shader.type != "BSDF_PRINCIPLED":
        return None
    zero = ("Metallic", "Transmission Weight", "Subsurface Weight", "Sheen Weight", "Coat Weight")
    values = [(shader.inputs[name], 0) for name in zero]
    values.append((shader.inputs["Alpha"], 1))
    pure = all(not socket.is_linked and socket.default_value == value for socket, value in values)
    return shader.inputs["Base Color"] if pure else None


def _angles(expected: Array, normals: Array) -> list[float]:
    """Return the median and the third quartile of the degrees between normals (n, 3)."""
    cosine = np.sum(expected * normals, axis=-1)
    valid = np.isfinite(cosine) & normals.any(axis=-1)
    if not valid.any():
        return []
    degrees = np.degrees(np.arccos(cosine[valid].clip(-1, 1)))
    quantiles: list[float] = np.quantile(degrees, (0.5, 0.75)).round(2).tolist()
    return quantiles


def _cast(content: LightField) -> tuple[Array, Array, Array]:
    """Return name (h, w), normal (h, w, 3) and distance (h, w) of the faces in the first view."""
    view = content.views[0]
    scene = bpy.context.scene
    rays = content.lens.pixel_rays() @ view.matrix[:3, :3].T
    depsgraph = bpy.context.evaluated_depsgraph_get()
    names = np.full(rays.shape[:2], "", dtype=object)
    normals = np.zeros(rays.shape)
    distance = np.full(rays.shape[:2], np.inf)
    for pixel in zip(*np.nonzero(np.isfinite(rays[..., 0])), strict=True):
        hit, place, normal, _, obj, _ = scene.ray_cast(
            depsgraph, Vector(view.position), Vector(rays[pixel])
        )
        if hit:
            names[pixel] = obj.name_full
            normals[pixel] = -np.sign(np.dot(normal, rays[pixel])) * np.array(normal)
            distance[pixel] = np.linalg.norm(np.array(place) - view.position)
    return names, normals, distance


if __name__ == "__main__":
    run(main)
