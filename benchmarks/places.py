"""Measure how places of a builder differ: pictures, depths, and shares of hard materials.

Each place is built and rendered from one camera: a panorama, or a view of a still life. Writes
<builder>/<place>.png for each, <builder>.jpg with all of them, and <builder>.csv with a row for
each place. A row has the median depth in metres, and the parts of the pixels that mirrors, glass
and leaves take.
Prints FLIP and the distance of the depth histograms over all pairs. Finished pictures are kept.
"""

import argparse
import importlib
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO as oiio
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.files import write_csv
from lightfield.measurement.metrics import flip_map
from lightfield.rendering import blend_file

Array = np.ndarray[Any, Any]
# The height of the panorama's camera above the origin, in metres.
HEIGHTS = {"garden": 1.0, "lone_monk": 2.2, "barbershop": 1.05, "rooms": 1.3}
STILL_LIFE_CAMERA = (0.75, -0.95, 0.62)
KINDS = ("mirror", "glass", "leaves")
# Edges of the depth histograms' bins, in metres.
DEPTHS = np.concatenate([[0], np.geomspace(0.2, 200, 40), [np.inf]])
COLUMNS = 4  # of the sheet


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--builder", required=True, choices=[*HEIGHTS, "still_life"])
    parser.add_argument("--first", type=int, default=1, help="first place (default: 1)")
    parser.add_argument("--last", type=int, default=20, help="last place (default: 20)")
    parser.add_argument("--detail", type=float, default=0.05, help="of the scene (default: 0.05)")
    parser.add_argument("--samples", type=int, default=6, help="of the pictures (default: 6)")
    parser.add_argument("--output", required=True, type=Path, help="folder for sheet and table")
    arguments = parser.parse_args()
    folder = arguments.output / arguments.builder
    folder.mkdir(parents=True, exist_ok=True)
    places = range(arguments.first, arguments.last + 1)
    rows = []
    histograms = []
    pictures = []
    for place in places:
        build(arguments.builder, place, arguments.detail)
        picture = folder / f"{place:03d}.png"
        if not picture.is_file():
            render(picture, "PNG", arguments.samples)
        pictures.append(read(picture)[..., :3])
        depth, shares = measured(folder / "passes.exr")
        histograms.append(np.histogram(depth, DEPTHS)[0] / depth.size)
        median = round(float(np.median(depth)), 2)
        rows.append({"place": place, "median_depth": median} | shares)
        print(rows[-1], flush=True)
    write_csv(arguments.output / f"{arguments.builder}.csv", rows)
    write_sheet(arguments.output / f"{arguments.builder}.jpg", pictures)
    summarise(pictures, histograms, rows)


def build(builder: str, place: int, detail: float) -> None:
    """Build a place, with a camera in it."""
    blend_file.new_scene()
    parameters = {"seed": place, "detail": detail, "place": place}
    importlib.import_module(f"scenes.{builder}").build(parameters)
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("Camera")
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    if builder in HEIGHTS:
        camera.type = "PANO"
        camera.panorama_type = "EQUIRECTANGULAR"
        scene.camera.location = (0, 0, HEIGHTS[builder])
        scene.camera.rotation_euler = (np.pi / 2, 0, 0)
        scene.render.resolution_x, scene.render.resolution_y = 256, 128
    else:
        away = Vector(STILL_LIFE_CAMERA)
        camera.angle = np.radians(38)
        scene.camera.location = away
        toward = Vector((0, 0, 0.06)) - away
        scene.camera.rotation_euler = toward.to_track_quat("-Z", "Y").to_euler()
        scene.render.resolution_x = scene.render.resolution_y = 192


def render(path: Path, file_format: str, samples: int) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = file_format == "PNG"
    scene.cycles.sample_clamp_indirect = 10
    scene.render.image_settings.media_type = (
        "IMAGE" if file_format == "PNG" else "MULTI_LAYER_IMAGE"
    )
    scene.render.image_settings.file_format = file_format
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def kind_of(material: bpy.types.Material) -> str | None:
    """Whether a material is a mirror, glass (or water), or leaves, by its shaders and its name."""
    nodes = {node.bl_idname: node for node in material.node_tree.nodes}
    if "ShaderNodeBsdfTranslucent" in nodes or "leaf" in material.name.lower():
        return None if "paper" in material.name.lower() else "leaves"
    surface = nodes.get("ShaderNodeBsdfPrincipled")
    if surface is None:
        return "glass" if "ShaderNodeBsdfTransparent" in nodes else None
    if surface.inputs["Transmission Weight"].default_value >= 0.5:
        return "glass"
    metallic = surface.inputs["Metallic"].default_value
    roughness = surface.inputs["Roughness"]
    is_smooth = not roughness.is_linked and roughness.default_value <= 0.2
    return "mirror" if metallic == 1 and is_smooth else None


def measured(path: Path) -> tuple[Array, dict[str, float]]:
    """The finite depths of the view's pixels, and the part of the pixels of each kind."""
    for material in bpy.data.materials:
        kind = kind_of(material)
        material.pass_index = KINDS.index(kind) + 1 if kind else 0
    layer = bpy.context.view_layer
    layer.use_pass_z = True
    layer.use_pass_material_index = True
    render(path, "OPEN_EXR_MULTILAYER", 1)
    passes = read_passes(path)
    depth = next(values for name, values in passes.items() if "Depth" in name)
    index = next(values for name, values in passes.items() if "Index" in name)
    path.unlink()
    shares = {
        kind: round(float((np.rint(index) == i + 1).mean()), 4) for i, kind in enumerate(KINDS)
    }
    return depth[depth < 1e4], shares


def read(path: Path) -> Array:
    """An image as floats (h, w, channels). A PNG's values are 0 to 1."""
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


def read_passes(path: Path) -> dict[str, Array]:
    """The channels of an EXR of several parts: name to values (h, w)."""
    passes = {}
    for part in range(oiio.ImageBuf(str(path)).nsubimages):
        image = oiio.ImageBuf(str(path), part, 0)
        pixels = np.asarray(image.get_pixels(oiio.FLOAT))
        for number, name in enumerate(image.spec().channelnames):
            passes[f"{image.spec().getattribute('oiio:subimagename')} {name}"] = pixels[..., number]
    return passes


def write_sheet(path: Path, pictures: list[Array]) -> None:
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // COLUMNS)
    sheet = np.zeros((rows * height, COLUMNS * width, 3), np.float32)
    for number, picture in enumerate(pictures):
        top = number // COLUMNS * height
        left = number % COLUMNS * width
        sheet[top : top + height, left : left + width] = picture
    image = oiio.ImageBuf(oiio.ImageSpec(sheet.shape[1], sheet.shape[0], 3, oiio.UINT8))
    image.set_pixels(oiio.ROI(), sheet)
    image.specmod().attribute("CompressionQuality", 85)
    image.write(str(path))


def summarise(pictures: list[Array], histograms: list[Array], rows: list[dict[str, Any]]) -> None:
    """Print the least, median and greatest values."""
    pairs = list(combinations(range(len(pictures)), 2))
    flips = [float(flip_map(pictures[a], pictures[b]).mean()) for a, b in pairs]
    # The part of the pixels by which two histograms differ.
    depths = [0.5 * float(np.abs(histograms[a] - histograms[b]).sum()) for a, b in pairs]
    columns = {"FLIP": flips, "depth histogram": depths}
    columns |= {kind: [row[kind] for row in rows] for kind in KINDS}
    for name, values in columns.items():
        least, median, most = np.quantile(values, (0, 0.5, 1))
        print(f"{name}: {least:.3f} / {median:.3f} / {most:.3f}")


if __name__ == "__main__":
    run(main)
