"""Render what is hard for a renderer in 32-bit floats, and compare it with exact answers.

Each case has a row: the basis of its exact answer, the largest relative errors of colour and depth,
Plenoforge's messages, and a verdict. A case is "right" within its bound, "warned" or "refused" by
Plenoforge, or "as asked" by the scene's own settings. Otherwise it is "WRONG", and the run fails.
Scenes consist of planes and boxes, and the code that renders datasets renders them. Writes
extremes.csv and extremes.md into --output.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_csv, write_text
from lightfield.core.progress import Progress
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.rendering.inspection import limits
from lightfield.rendering.inspection.clearance import TOUCHING, surroundings
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
from lightfield.rendering.views import shard
from lightfield.rendering.views.colour_pass import render_colour
from lightfield.rendering.views.geometry_pass import render_geometry

Array = np.ndarray[Any, Any]
Vector = tuple[float, float, float]

PANORAMA = {"lens": "equirectangular", "resolution": [32, 16]}
AROUND = {"lens": "equidistant", "fov": 360, "resolution": [24, 24]}
AHEAD = {"lens": "rectilinear", "fov": 60, "resolution": [16, 16]}
NARROW = {"lens": "rectilinear", "fov": 1, "resolution": [16, 16]}
RENDER = {"adaptive_threshold": 0, "denoise": False, "seed": 0, "clamp_indirect": 0}
# Half floats have 11 binary digits.
HALF = 2.0**-11
# Relative error of a depth at perpendicular incidence.
SHARP = 2e-6
# Relative error of a depth that is worth a warning.
COARSE = 10.0**-limits.DIGITS


@dataclass(frozen=True)
class Render:
    """A case's view: colour (h, w, 3), depth (h, w), and rays (h, w, 3) in world space."""

    colour: Array
    depth: Array
    rays: Array
    origin: Array


# Compares a render with the exact answer; returns the largest relative error of each part.
Truth = Callable[[Render], Mapping[str, float]]


@dataclass(frozen=True)
class Case:
    """One scene and one camera, which looks along +Y.

    - ``bound``: the largest errors that may go without a warning.
    - ``basis``: what the exact answer follows from.
    - ``trades_truth``: whether the scene's settings give up truth for less noise. Blender's own
      documentation says so of them.
    """

    name: str
    build: Callable[[], None]
    truth: Truth
    bound: Mapping[str, float]
    basis: str = "closed form"
    camera: Mapping[str, Any] = field(default_factory=lambda: PANORAMA)
    place: Vector = (0, 0, 0)
    samples: int = 4
    frame: int = 1
    render: Mapping[str, Any] = field(default_factory=dict)
    trades_truth: bool = False


# Scenes.


def nodes(name: str) -> tuple[Any, Callable[..., Any], Any]:
    """Return a material, a function that adds a linked node to it, and its node tree."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    output = tree.nodes["Material Output"]

    def add(kind: str, to: Any = None, **inputs: Any) -> Any:
        node = tree.nodes.new(kind)
        for key, value in inputs.items():
            node.inputs[key].default_value = value
        if to is not None:
            tree.links.new(node.outputs[0], to if hasattr(to, "links") else output.inputs[to])
        return node

    return material, add, tree


def grey(value: float) -> tuple[float, float, float, float]:
    return (value, value, value, 1)


def emission(strength: float) -> Any:
    material, add, _ = nodes("emission")
    add("ShaderNodeEmission", "Surface", Strength=strength)
    material.cycles.emission_sampling = "NONE"
    return material


def furnace(kind: str, albedo: float, **inputs: Any) -> Any:
    """A surface that emits as much as it absorbs: in a closed room of it, the light is 1.

    With n bounces the light is 1 − albedoⁿ⁺²: Cycles also counts what the last bounce's path meets.
    """
    material, add, _ = nodes("furnace")
    both = add("ShaderNodeAddShader", "Surface")
    add(kind, both.inputs[0], Color=grey(albedo), **inputs)
    add("ShaderNodeEmission", both.inputs[1], Strength=1 - albedo)
    material.cycles.emission_sampling = "NONE"
    return material


def surface(kind: str, **inputs: Any) -> Any:
    material, add, _ = nodes(kind)
    add(kind, "Surface", **inputs)
    return material


def fog(kind: str, density: float, colour: float) -> Any:
    material, add, _ = nodes("fog")
    add(kind, "Volume", Density=density, Color=grey(colour))
    return material


def box(half: float, material: Any, center: Vector = (0, 0, 0)) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=2 * half, location=center)
    return painted(material)


def wall(y: float, material: Any, size: float = 1e3, x: float = 0, z: float = 0) -> Any:
    upright = (math.radians(90), 0, 0)
    bpy.ops.mesh.primitive_plane_add(size=size, location=(x, y, z), rotation=upright)
    return painted(material)


def screen(y: float, light: float = 1, **placed: float) -> Any:
    """A wall that shines."""
    return wall(y, emission(light), **placed)


def room(half: float, center: Vector = (0, 0, 0)) -> None:
    """A box whose walls shine with 1."""
    box(half, emission(1), center)


def painted(material: Any) -> Any:
    obj = bpy.context.object
    obj.data.materials.append(material)
    return obj


def sun(strength: float, degrees: float) -> None:
    """Shine along +Y."""
    light = bpy.data.lights.new("sun", "SUN")
    light.energy = strength
    light.angle = math.radians(degrees)
    obj = bpy.data.objects.new("sun", light)
    obj.rotation_euler = (math.radians(90), 0, 0)
    bpy.context.scene.collection.objects.link(obj)


def bounces(**most: int) -> None:
    """Limit the bounces of paths by kind; Blender's own limits are 12, and 4 diffuse or glossy."""
    for kind, number in most.items():
        setattr(bpy.context.scene.cycles, f"{kind}_bounces", number)


def world(strength: float) -> None:
    white = bpy.data.worlds.new("world")
    white.use_nodes = True
    background = white.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = grey(1)
    background.inputs["Strength"].default_value = strength
    bpy.context.scene.world = white


def sliding(first: int, frame: int) -> None:
    """A square 2 m wide slides by 4 m a frame, and is ahead of the camera at ``frame``."""
    screen(20, 0.25)
    square = screen(10, size=2)
    moving(square, 0, {at: 4 * (at - frame) for at in (first, frame, frame + 1)})
    bpy.context.scene.render.use_motion_blur = True


def moving(obj: Any, axis: int, places: Mapping[int, float]) -> None:
    """Move an object along an axis: through ``places``, by frame, and evenly between them."""
    for frame, place in places.items():
        obj.location[axis] = place
        obj.keyframe_insert("location", index=axis, frame=frame)
    (bag,) = obj.animation_data.action.layers[0].strips[0].channelbags
    for key in bag.fcurves[0].keyframe_points:
        key.interpolation = "LINEAR"


# Truths.


def largest(values: Array, truth: Array | float) -> float:
    """Return the largest relative error. Equal values have an error of 0, and NaN has inf."""
    values, truth = np.broadcast_arrays(np.asarray(values, np.float64), np.asarray(truth))
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(values / truth - 1)
    error = np.where(np.isfinite(error), error, np.inf)
    return float(np.where(values == truth, 0, error).max())


def in_box(shown: Render, half: float, center: Vector = (0, 0, 0)) -> tuple[Array, Array]:
    """Return the distances to the walls of a box, (h, w), and the cosines of incidence."""
    with np.errstate(divide="ignore"):
        each = (np.sign(shown.rays) * half - (shown.origin - center)) / shown.rays
    nearest = each.argmin(axis=-1)[..., None]
    cosine = np.abs(np.take_along_axis(shown.rays, nearest, -1))[..., 0]
    return np.take_along_axis(each, nearest, -1)[..., 0], cosine


def of_box(
    half: float, light: float, center: Vector = (0, 0, 0), density: float = 0, even: bool = True
) -> Truth:
    """A box of even light, around the camera, in a fog that absorbs.

    Where chance ends paths, the light is not ``even``; its mean is right.
    """

    def truth(shown: Render) -> Mapping[str, float]:
        distance, cosine = in_box(shown, half, center)
        expected = light * np.exp(-density * distance)[..., None]
        error = np.abs(shown.depth / distance - 1) * cosine
        colour = shown.colour if even else shown.colour.mean()
        return {"colour": largest(colour, expected), "depth": float(error.max())}

    return truth


def of_wall(y: float, light: float, density: float = 0, fog_depth: float = 0) -> Truth:
    """A wall ahead, of even light, behind a fog that absorbs, ``fog_depth`` thick."""

    def truth(shown: Render) -> Mapping[str, float]:
        ahead = shown.rays[..., 1]
        expected = light * np.exp(-density * fog_depth / ahead)[..., None]
        z = y - shown.origin[1]
        return {"colour": largest(shown.colour, expected), "depth": largest(shown.depth, z)}

    return truth


def mean_light(light: float) -> Truth:
    return lambda shown: {"colour": abs(float(shown.colour.mean()) / light - 1)}


def grazing(shown: Render) -> Mapping[str, float]:
    """A floor 1 m below, up to the horizon: Z-depth, and its error times the cosine."""
    down = -shown.rays[..., 2]
    below = down > 0
    distance = 1 / down[below]
    z = distance * shown.rays[..., 1][below]
    error = np.abs(shown.depth[below] / z - 1)
    missed = np.isfinite(shown.depth[~below]).any()
    return {"depth": math.inf if missed else float((error * down[below]).max())}


def one_of_two(shown: Render) -> Mapping[str, float]:
    """Two surfaces in one place, of light 1 and 3: each pixel shows one of them."""
    error = np.minimum(np.abs(shown.colour - 1), np.abs(shown.colour - 3)).max()
    return {"colour": float(error), "depth": largest(shown.depth, 2)}


def one_pixel(shown: Render) -> Mapping[str, float]:
    """A square of one pixel's size, of light 1 before black: all pixels' light adds up to 1."""
    hit = np.isfinite(shown.depth)
    depth = largest(shown.depth[hit], 10) if hit.sum() == 1 else math.inf
    return {"colour": abs(float(shown.colour[..., 0].sum()) - 1), "depth": depth}


def slid(shown: Render) -> Mapping[str, float]:
    """A square slides past: its part of a pixel is its part of the shutter's half frame."""
    x = shown.rays[..., 0] / shown.rays[..., 1] * 10
    tall = np.abs(shown.rays[..., 2] / shown.rays[..., 1] * 10) < 1
    begin = np.clip((x - 1) / 4, -0.25, 0.25)
    end = np.clip((x + 1) / 4, -0.25, 0.25)
    covered = np.where(tall, (end - begin) / 0.5, 0)
    truth = (0.25 + 0.75 * covered)[..., None]
    # Pixels whose centre is on the square's edge are either.
    sure = np.abs(np.abs(x) - 1) > 1e-3
    z = np.where(tall & (np.abs(x) < 1), 10, 20)
    error = np.abs(shown.colour - truth).max()
    return {"colour": float(error), "depth": largest(shown.depth[sure], z[sure])}


# Cases.


def sizes() -> Iterator[Case]:
    for size, name in ((1e-3, "1 mm"), (1.0, "1 m"), (1e5, "100 km")):

        def build(size: float = size) -> None:
            bounces(max=8, diffuse=8)
            box(size / 2, furnace("ShaderNodeBsdfDiffuse", 0.5))

        truth = of_box(size / 2, 1 - 0.5**10, even=False)
        basis = "closed form, furnace of 8 bounces"
        place = (0.1 * size, -0.2 * size, 0.05 * size)
        bound = {"colour": 0.01, "depth": SHARP}
        yield Case(f"a room of {name}", build, truth, bound, basis, place=place, samples=64)


def far() -> Iterator[Case]:
    for power in range(3, 8):
        # A rig's centre is at most 1e7 m away.
        away = 10.0**power - 1
        center = (away, -away, away)
        build = partial(room, 2, center)
        name = f"a room of 4 m, 1e{power} m from the origin"
        bound = {"colour": HALF, "depth": COARSE}
        place = (away + 0.1, -away - 0.2, away + 0.3)
        yield Case(name, build, of_box(2, 1, center), bound, place=place)


def lights() -> Iterator[Case]:
    def sunny() -> None:
        sun(5e4 * math.pi / 0.5, 0)
        wall(10, surface("ShaderNodeBsdfDiffuse", Color=grey(0.5)))
        shade = screen(5, 5e-3, size=2)
        shade.visible_shadow = False

    def in_sun(shown: Render) -> Mapping[str, float]:
        away = np.abs(shown.rays / shown.rays[..., 1:2])[..., [0, 2]].max(axis=-1) * 5
        inside = away < 0.6
        outside = away > 1.4
        return {
            "colour": max(largest(shown.colour[inside], 5e-3), largest(shown.colour[outside], 5e4)),
            "depth": max(largest(shown.depth[inside], 5), largest(shown.depth[outside], 10)),
        }

    bound = {"colour": 2 * HALF, "depth": SHARP}
    yield Case("a sun 1e7 times the shade", sunny, in_sun, bound, camera=AHEAD)
    for strength in (6.5e4, 1e6, 1e-6):
        bound = {"colour": HALF if strength > 6e-5 else 2.0**-25 / strength, "depth": SHARP}
        build = partial(screen, 10, strength)
        truth = of_wall(10, strength)
        yield Case(f"light of {strength:g}", build, truth, bound, camera=AHEAD)


def surfaces() -> Iterator[Case]:
    for distance in (0.002, 1e-4, 5e-5):
        build = partial(screen, distance, size=1)
        truth = of_wall(distance, 1)
        bound = {"colour": HALF, "depth": 2 * SHARP}
        yield Case(f"a surface {distance:g} m ahead", build, truth, bound, camera=AHEAD)

    def coincident() -> None:
        screen(2)
        screen(2, 3)

    yield Case(
        "two surfaces in one place",
        coincident,
        one_of_two,
        {"colour": 3 * HALF, "depth": SHARP},
        "each pixel shows one of them",
        camera=AHEAD,
        samples=1,
    )
    pixel = 2 * 10 * math.tan(math.radians(0.5)) / 16
    dot = partial(screen, 10, size=pixel, x=pixel / 2, z=pixel / 2)
    bound = {"colour": 0.02, "depth": SHARP}
    yield Case("a surface of one pixel", dot, one_pixel, bound, camera=NARROW, samples=1024)

    def floor() -> None:
        bpy.ops.mesh.primitive_plane_add(size=1e5, location=(0, 0, -1))
        painted(emission(1))

    yield Case(
        "a floor up to 89.98° of incidence",
        floor,
        grazing,
        {"depth": SHARP},
        "closed form; error × cosine",
        camera=NARROW,
    )


def layers() -> Iterator[Case]:
    for count, limit in ((8, 8), (1000, 1024), (1000, 8)):

        def build(count: int = count, limit: int = limit) -> None:
            bpy.context.scene.cycles.transparent_max_bounces = limit
            clear = surface("ShaderNodeBsdfTransparent", Color=grey(0.9999))
            corners = ((-50, -50), (50, -50), (50, 50), (-50, 50))
            mesh = bpy.data.meshes.new("layers")
            mesh.from_pydata(
                [(x, 2 + 0.01 * number, z) for number in range(count) for x, z in corners],
                [],
                [tuple(range(4 * number, 4 * number + 4)) for number in range(count)],
            )
            mesh.materials.append(clear)
            obj = bpy.data.objects.new("layers", mesh)
            bpy.context.scene.collection.objects.link(obj)
            screen(20)

        name = f"{count:,} transparent layers, of {limit:,} that may be"
        truth = mean_light(0.9999**count)
        yield Case(name, build, truth, {"colour": 0.05}, camera=NARROW, samples=16)


def fogs() -> Iterator[Case]:
    # The filter takes light from beside a pixel's centre.
    sharp = {"samples": 1, "render": {"filter_width": 0.01}}
    ahead = {**AHEAD, "fov": 15}
    for density in (1e-4, 1.0, 12.0):

        def build(density: float = density) -> None:
            screen(10)
            bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 5, 0), scale=(100, 1, 100))
            painted(fog("ShaderNodeVolumeAbsorption", density, 0))

        name = f"fog of optical depth {density:g}"
        truth = of_wall(10, 1, density, 1)
        # As a half float, light of 6e-6 has steps of 1 %.
        bound = {"colour": 2 * HALF if density < 10 else 0.01, "depth": SHARP}
        yield Case(name, build, truth, bound, "Beer–Lambert", camera=ahead, **sharp)

    def scattering(density: float, most: int) -> None:
        bounces(max=most, volume=most)
        world(1)
        box(1, fog("ShaderNodeVolumeScatter", density, 1), (0, 5, 0))

    for density, most in ((0.01, 32), (5.0, 256)):
        name = f"fog that scatters all light, optical depth {2 * density:g}"
        build = partial(scattering, density, most)
        bound = {"colour": 0.02}
        yield Case(name, build, mean_light(1), bound, "furnace", camera=ahead, samples=64)

    def around() -> None:
        room(2)
        fogged = bpy.data.worlds.new("world")
        fogged.use_nodes = True
        tree = fogged.node_tree
        tree.nodes["Background"].inputs["Strength"].default_value = 0
        absorbing = tree.nodes.new("ShaderNodeVolumeAbsorption")
        absorbing.inputs["Color"].default_value = grey(0)
        absorbing.inputs["Density"].default_value = 0.5
        tree.links.new(absorbing.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        bpy.context.scene.world = fogged

    truth = of_box(2, 1, density=0.5)
    bound = {"colour": 4 * HALF, "depth": SHARP}
    both = {"basis": "Beer–Lambert", "place": (0.1, -0.2, 0.3), **sharp}
    yield Case("poles of a panorama, in fog", around, truth, bound, camera=PANORAMA, **both)
    yield Case("rim of a 360° lens, in fog", around, truth, bound, camera=AROUND, **both)


def paths() -> Iterator[Case]:
    for most in (12, 1000):

        def mirrors(most: int = most) -> None:
            bounces(max=most, glossy=most)
            box(1, furnace("ShaderNodeBsdfGlossy", 0.9, Roughness=0.0))

        yield Case(
            f"mirrors facing mirrors, {most:,} bounces",
            mirrors,
            of_box(1, 1 - 0.9 ** (most + 2), even=False),
            {"colour": 0.01, "depth": SHARP},
            f"furnace of {most:,} bounces",
            place=(0.1, -0.2, 0.3),
            samples=256,
        )

    def dielectrics() -> None:
        bounces(max=256, transmission=256, glossy=256)
        world(1)
        for half, index in ((1, 1.5), (0.7, 1.33), (0.4, 2.4)):
            box(half, surface("ShaderNodeBsdfGlass", IOR=index, Roughness=0.0), (0, 5, 0))

    ahead = {**AHEAD, "fov": 15}
    name = "glass in water in glass"
    bound = {"colour": 0.01}
    yield Case(name, dielectrics, mean_light(1), bound, "furnace", camera=ahead, samples=64)
    # Blender's Filter Glossy treats smooth glass as rough after a diffuse bounce. It is 1 in a new
    # file.
    for degrees, blur, clamp in ((0, 0, 0), (10, 0, 0), (10, 1, 0), (10, 0, 1)):

        def caustic(degrees: int = degrees, blur: int = blur) -> None:
            bounces(max=64, transmission=64, glossy=64)
            bpy.context.scene.cycles.blur_glossy = blur
            sun(1, degrees)
            wall(10, surface("ShaderNodeBsdfDiffuse", Color=grey(0.1)))
            bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 8, 0), scale=(60, 0.1, 60))
            painted(surface("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0)).visible_camera = False

        # The pane sends back a tenth of the wall's light, so the wall is dark.
        through = 2 * 1.5 / (1.5**2 + 1)
        yield Case(
            f"a sun of {degrees:g}° through glass, filter glossy {blur:g}, clamped at {clamp:g}",
            caustic,
            mean_light(0.1 / math.pi * through),
            {"colour": 0.05},
            "Fresnel's equations",
            camera=ahead,
            samples=1024,
            render={"clamp_indirect": clamp},
            trades_truth=bool(blur or clamp),
        )


def frames() -> Iterator[Case]:
    for first, frame in ((1, 2), (1048570, 1048573)):
        yield Case(
            f"motion blur at frame {frame}",
            partial(sliding, first, frame),
            slid,
            {"colour": 0.03, "depth": SHARP},
            "closed form, pixels' centres",
            camera={**AHEAD, "resolution": [32, 16]},
            frame=frame,
            samples=1024,
            render={"filter_width": 0.01},
        )

    def moved() -> None:
        moving(screen(2), 1, {1048572: 2, 1048574: 4})

    bound = {"colour": HALF, "depth": SHARP}
    last = 1048574
    yield Case(f"frame {last}, the last one", moved, of_wall(4, 1), bound, camera=AHEAD, frame=last)


def cases() -> Iterator[Case]:
    """Yield every case."""
    for kind in (sizes, far, lights, surfaces, layers, fogs, paths, frames):
        yield from kind()


def render(case: Case, folder: Path) -> tuple[Render, list[str], list[str]]:
    """Render a case as a dataset's view; return the render, the warnings and the refusals."""
    blend_file.new_scene()
    case.build()
    path = folder / "scene.blend"
    blend_file.save_scene(path)
    lens = lenses.from_camera(dict(case.camera))
    lightfield = LightField.from_rig(
        {"type": "lattice", "cameras": [1, 1, 1], "center": list(case.place)},
        lens,
        depth=lens.usual_depth,
        frame=case.frame,
        render=RENDER | {"samples": case.samples, "depth_precision": "float"} | dict(case.render),
    )
    view = lightfield.views[0]
    opened = cycles.set_up(path, None, lightfield, "cpu", 1)
    positions = view.position[None]
    distances = surroundings(positions).distances
    warned = list(limits.warnings(positions, distances))
    refused = ["inside geometry"] if distances[0] < TOUCHING else []
    geometry = render_geometry(opened, view.world_from_camera)
    colour_pass = render_colour(opened, view.world_from_camera, 1)
    channels, attributes = shard.colour_channels(colour_pass.pixels)
    clamped = int(attributes[images.CLAMPED_ATTRIBUTE])
    if clamped:
        warned.append(f"{clamped} values were clamped to the half range")
    depth = shard.depth_channel(geometry.depth, lightfield, shard.depth_rays(lightfield))
    rays = lens.pixel_rays()
    sees = np.isfinite(rays[..., 0])
    colour = np.stack([channels[name] for name in "RGB"], axis=-1)
    # The pixels that the lens covers, as one row.
    shown = Render(
        colour[sees][None].astype(np.float64),
        depth[sees][None].astype(np.float64),
        (rays @ view.world_from_camera[:3, :3].T)[sees][None],
        view.position,
    )
    return shown, warned, refused


def measure(chosen: list[Case]) -> Iterator[dict[str, Any]]:
    """Yield a row for each case."""
    progress = Progress(len(chosen), "extremes", "cases")
    with tempfile.TemporaryDirectory() as name:
        for case in chosen:
            shown, warned, refused = render(case, Path(name))
            errors = case.truth(shown)
            right = all(error <= case.bound[part] for part, error in errors.items())
            if refused:
                verdict = "refused"
            elif right:
                verdict = "right"
            elif warned:
                verdict = "warned"
            elif case.trades_truth:
                verdict = "as asked"
            else:
                verdict = "WRONG"
            yield {
                "case": case.name,
                "truth": case.basis,
                "colour": errors.get("colour"),
                "depth": errors.get("depth"),
                "verdict": verdict,
                "said": "; ".join([*refused, *warned]),
            }
            progress.done()


def table(rows: list[dict[str, Any]]) -> str:
    """Return the rows in Markdown."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.1e}"

    lines = ["| case | truth | colour | depth | verdict |", "| --- | --- | ---: | ---: | --- |"]
    lines += [
        f"| {row['case']} | {row['truth']} | {number(row['colour'])} | {number(row['depth'])} "
        f"| {row['verdict']} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", required=True, type=Path, help="folder for the results")
    folder = parser.parse_args().output
    rows = list(measure(list(cases())))
    write_csv(folder / "extremes.csv", rows)
    write_text(folder / "extremes.md", table(rows))
    print(table(rows))
    wrong = [row["case"] for row in rows if row["verdict"] == "WRONG"]
    if wrong:
        raise UserError(
            f"{len(wrong)} of {len(rows)} cases are wrong without a warning: {', '.join(wrong)}"
        )


if __name__ == "__main__":
    run(main)
