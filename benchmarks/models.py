"""Make 200 models to test families with: shapes of the scenes' library, in five formats.

Most are sound: twenty kinds of shapes, each with its own sizes, colours or texture, as glTF, GLB,
USD, OBJ, PLY or STL. The others are what collections contain, too. Some files are cut short, empty,
of another format, without their texture or without faces. Some models are animated, mirrored, huge,
tiny or far away. models.json beside them says what each is, and whether it can be rendered.
Equal counts give equal files, except that USDZ archives say when they were written.
"""

import argparse
import math
import shutil
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.files import write_json
from lightfield.core.progress import Progress
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.scenes.quiet import quiet
from scenes.library.architecture import arch_stones, frame, ring_of_stones
from scenes.library.materials import plain
from scenes.library.plants import Growth, blade, branches, leaf_cloud, leaves_on, oval_leaf, tuft
from scenes.library.points import Array, noise, polar, smooth_path
from scenes.library.scene import Scene
from scenes.library.shapes import Shape, box, icosphere, join, lettering, prism, tube

Random = np.random.Generator
Part = tuple[Shape, str]
# The formats of 20 sound models, in turn. Collections on the web are mostly GLB.
FORMATS = (*("glb",) * 8, "gltf", "gltf", "usdc", "usdc", "usda", "usdz", "obj", "obj")
FORMATS += ("ply", "ply", "stl", "stl")
# Triangles of the huge model: 20 · 4ⁿ.
HUGE_SUBDIVISIONS = 8
# The number of a model with a texture, and of no sound model.
TEXTURED = 999


# ---- kinds of shapes: each returns parts and their materials, "first" and "second" -------------


def vase(scene: Scene, random: Random) -> list[Part]:
    height = np.linspace(0, random.uniform(0.5, 1.2), 9)
    radius = 0.12 + 0.12 * random.random(9)
    return [(scene.lathe(np.column_stack([radius, height]), 40), "first")]


def bowl(scene: Scene, random: Random) -> list[Part]:
    angle = np.linspace(-np.pi / 2, random.uniform(-0.4, 0.1), 12)
    outer = np.column_stack([np.cos(angle), np.sin(angle)])
    return [(scene.lathe(np.concatenate([outer, 0.92 * outer[::-1]]), 48), "first")]


def column(scene: Scene, random: Random) -> list[Part]:
    height = random.uniform(1.5, 3)
    shaft = scene.lathe([(0.2, 0), (0.19, height / 3), (0.15, height)], 24)
    plates = [box((0.5, 0.5, 0.1), 0.01).moved(0, 0, z) for z in (-0.05, height + 0.05)]
    return [(shaft, "first"), (join(plates), "second")]


def table(scene: Scene, random: Random) -> list[Part]:
    width, depth, height = random.uniform((0.8, 0.5, 0.4), (2, 1, 0.9))
    corners = [(x * (width / 2 - 0.1), y * (depth / 2 - 0.1)) for x in (-1, 1) for y in (-1, 1)]
    leg = scene.lathe([(0.02, 0), (0.03, height)], 12)
    legs = [leg.moved(x, y, 0) for x, y in corners]
    return [(box((width, depth, 0.04), 0.01).moved(0, 0, height), "first"), (join(legs), "second")]


def chair(scene: Scene, random: Random) -> list[Part]:
    side, height, back = random.uniform((0.35, 0.4, 0.3), (0.5, 0.5, 0.6))
    legs = [
        box((0.04, 0.04, height)).moved(x * side / 2.3, y * side / 2.3, height / 2)
        for x in (-1, 1)
        for y in (-1, 1)
    ]
    rest = box((side, 0.03, back), 0.01).moved(0, side / 2, height + back / 2)
    seat = box((side, side, 0.05), 0.02).moved(0, 0, height)
    return [(join([*legs, rest]), "first"), (seat, "second")]


def shelf(scene: Scene, random: Random) -> list[Part]:
    width, height = random.uniform((0.6, 1), (1.2, 2))
    boards = int(random.integers(3, 7))
    rows = np.linspace(0, height, boards)
    parts = [box((width, 0.3, 0.03)).moved(0, 0, z) for z in rows]
    parts += [box((0.03, 0.3, height)).moved(x * width / 2, 0, height / 2) for x in (-1, 1)]
    books = []
    for z in rows[:-1]:
        for x in np.arange(-width / 2 + 0.05, width / 2 - 0.05, 0.05):
            size = float(random.uniform(0.12, 0.2))
            books.append(box((0.04, 0.2, size)).moved(x, 0, z + size / 2 + 0.02))
    return [(join(parts), "first"), (join(books), "second")]


def tower(scene: Scene, random: Random) -> list[Part]:
    parts = []
    z = 0.0
    for level in range(int(random.integers(4, 9))):
        width, depth, height = random.uniform(0.2, 1, 3) * 0.9**level
        parts.append(box((width, depth, height), 0.02).moved(0, 0, z + height / 2))
        z += height
    return [(join(parts[::2]), "first"), (join(parts[1::2]), "second")]


def tree(scene: Scene, random: Random) -> list[Part]:
    growth = Growth([1.2, 0.7, 0.35], [6, 5], [0.9, 0.7], [0.02, 0.03, 0.0], 0.08)
    wood, twigs = branches(scene, random, growth)
    leaves = leaves_on(random, twigs, oval_leaf(), 10, (0.05, 0.1), 0.2, 0.01)
    return [(wood, "first"), (leaves, "second")]


def bush(scene: Scene, random: Random) -> list[Part]:
    radii = random.uniform(0.4, 1, 3)
    return [(leaf_cloud(random, 1500, radii, random.uniform(0.1, 0.2, 1500), 0.5), "first")]


def grass(scene: Scene, random: Random) -> list[Part]:
    bow = float(random.uniform(0.1, 0.6))
    return [(tuft(random, blade(0.02, 6, bow), 300, 0.3, (0.3, 0.7)), "first")]


def letters(scene: Scene, random: Random) -> list[Part]:
    text = "".join(random.choice([*"ABCDEFGHJKLMNOPRSTUVWXYZ"], 3))
    return [(lettering(text, float(random.uniform(0.1, 0.4))), "first")]


def arch(scene: Scene, random: Random) -> list[Part]:
    radius, depth = random.uniform((0.5, 0.2), (1, 0.5))
    return [(arch_stones(radius, depth, int(random.integers(7, 16))), "first")]


def well(scene: Scene, random: Random) -> list[Part]:
    rings = [ring_of_stones(14 + level % 2, 0.8, 0.25, 0.2 * level, 0.19) for level in range(4)]
    return [(join(rings), "first"), (scene.lathe([(0.7, 0.5), (0.69, 0.52)], 32), "second")]


def knot(scene: Scene, random: Random) -> list[Part]:
    turns = int(random.integers(2, 5))
    angle = np.linspace(0, 2 * np.pi, 240)
    radius = 1 + 0.4 * np.cos((turns + 1) * angle)
    path = polar(radius, turns * angle, 0.4 * np.sin((turns + 1) * angle))
    return [(tube(path, float(random.uniform(0.06, 0.15)), 16), "first")]


def spring(scene: Scene, random: Random) -> list[Part]:
    angle = np.linspace(0, 2 * np.pi * random.integers(3, 9), 300)
    path = polar(0.5, angle, angle * random.uniform(0.02, 0.06))
    return [(tube(path, 0.04, 12), "first")]


def gear(scene: Scene, random: Random) -> list[Part]:
    teeth = int(random.integers(8, 25))
    angle = np.arange(4 * teeth) * (2 * np.pi / (4 * teeth))
    radius = np.where(np.arange(4 * teeth) % 4 < 2, 1.0, 0.82)
    outline = polar(radius, angle)[:, :2]
    return [(prism(outline, float(random.uniform(0.1, 0.4))), "first")]


def star(scene: Scene, random: Random) -> list[Part]:
    points = int(random.integers(5, 12))
    angle = np.arange(2 * points) * (np.pi / points)
    radius = np.where(np.arange(2 * points) % 2, random.uniform(0.3, 0.7), 1.0)
    return [(prism(polar(radius, angle)[:, :2], 0.3), "first")]


def rock(scene: Scene, random: Random) -> list[Part]:
    ball = icosphere(4)
    lumps = 1 + 0.3 * noise(ball.vertices * 1.5, int(random.integers(10**6)), 3)
    return [(ball.reshaped(ball.vertices * lumps[:, None]), "first")]


def picture(scene: Scene, random: Random) -> list[Part]:
    width, height = random.uniform(0.4, 1.2, 2)
    border = frame(width, height, [(0, 0), (0, 0.03), (0.05, 0.05), (0.1, 0.03), (0.1, 0)])
    return [(border, "first"), (box((width, height, 0.01)), "second")]


def pipes(scene: Scene, random: Random) -> list[Part]:
    parts = [
        tube(smooth_path(random.uniform(-0.6, 0.6, (5, 3)), 60), random.uniform(0.03, 0.08), 12)
        for _ in range(4)
    ]
    return [(join(parts[:2]), "first"), (join(parts[2:]), "second")]


KINDS: tuple[Callable[[Scene, Random], list[Part]], ...] = (
    vase,
    bowl,
    column,
    table,
    chair,
    shelf,
    tower,
    tree,
    bush,
    grass,
    letters,
    arch,
    well,
    knot,
    spring,
    gear,
    star,
    rock,
    picture,
    pipes,
)


# ---- sound models --------------------------------------------------------------------------


def build(number: int, textures: Path) -> str:
    """Fill the empty scene with the sound model of a number. Returns the name of its kind.

    Every third model has a texture, which is written to ``textures``.
    """
    blend_file.new_scene()
    random = np.random.default_rng([1, number])
    # Of the 20 formats in turn, each number of 20 has another kind in the next 20.
    kind = KINDS[(number + number // len(KINDS)) % len(KINDS)]
    for name in ("first", "second"):
        metal = float(random.random() < 0.2)
        colour = tuple(random.uniform(0.05, 0.8, 3))
        plain(name, colour, Roughness=random.uniform(0.2, 0.9), Metallic=metal)
    if number % 3 == 0:
        give_texture(textures / f"{number:03d}.png", random)
    scene = Scene(number, 1.0)
    parts = kind(scene, random)
    materials = [material for _, material in parts]
    # The exporter of USD writes several objects in either order.
    shape = join(shape.painted(slot) for slot, (shape, _) in enumerate(parts))
    data = scene.add(kind.__name__, shape, *materials, smooth=math.radians(35)).data
    add_uv(data)
    add_colours(data, random)
    return kind.__name__


def give_texture(path: Path, random: Random) -> None:
    """Give the first material a texture of coloured tiles."""
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.kron(random.uniform(0.1, 0.9, (8, 8, 3)), np.ones((8, 8, 1)))
    image = bpy.data.images.new(path.stem, 64, 64)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw = str(path)
    image.file_format = "PNG"
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save()
    tree = bpy.data.materials["first"].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(path))
    (shader,) = (node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])


def add_uv(mesh: bpy.types.Mesh) -> None:
    """Give a mesh texture coordinates: its places, seen from the front."""
    vertices = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", vertices)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    layer = mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", vertices.reshape(-1, 3)[corners][:, [0, 2]].ravel())


def add_colours(mesh: bpy.types.Mesh, random: Random) -> None:
    """Give a mesh colours of its vertices, which a PLY keeps."""
    colours = np.ones((len(mesh.vertices), 4), np.float32)
    colours[:, :3] = random.uniform(0.1, 0.9, 3) * random.uniform(0.7, 1, (len(colours), 1))
    attribute = mesh.color_attributes.new("Col", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colours.ravel())


def export(path: Path, **options: bool) -> None:
    """Export the scene in the format of a path's suffix."""
    name = str(path)
    match path.suffix:
        case ".glb":
            bpy.ops.export_scene.gltf(filepath=name, **options)
        case ".gltf":
            bpy.ops.export_scene.gltf(filepath=name, export_format="GLTF_SEPARATE", **options)
        case ".obj":
            bpy.ops.wm.obj_export(filepath=name, path_mode="RELATIVE")
        case ".ply":
            bpy.ops.wm.ply_export(filepath=name)
        case ".stl":
            bpy.ops.wm.stl_export(filepath=name)
        case _:
            bpy.ops.wm.usd_export(filepath=name, relative_paths=True, **options)


# ---- broken and odd models -----------------------------------------------------------------


def half(path: Path) -> None:
    """Cut a file to its first half."""
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def replaced(path: Path, source: Path) -> None:
    shutil.copyfile(source, path)


def not_a_number(path: Path) -> None:
    """Replace the first coordinate of a USD text by one that is not a number."""
    text = path.read_text("utf-8")
    head, points, tail = text.partition("point3f[] points = [(")
    path.write_text(f"{head}{points}nan{tail[tail.index(',') :]}", "utf-8")


def not_numbers_stl(path: Path) -> None:
    """Give all corners of a binary STL's first triangle coordinates that are not numbers."""
    content = bytearray(path.read_bytes())
    content[96:132] = struct.pack("<9f", *[math.nan] * 9)
    path.write_bytes(content)


def broken(folder: Path) -> dict[str, str]:
    """Write models that cannot be rendered. Returns what is wrong with each."""
    causes = {}

    def sound(name: str, number: int = 0) -> Path:
        path = folder / name
        build(number, folder / "textures")
        export(path)
        return path

    for suffix in ("glb", "ply", "stl", "usdc", "usdz"):
        half(sound(f"cut_short.{suffix}", 1))
        causes[f"cut_short.{suffix}"] = "cut short"
    sound("buffer_cut_short.gltf", 1)
    half(folder / "buffer_cut_short.bin")
    causes["buffer_cut_short.gltf"] = "its buffer is cut short"
    for suffix in ("glb", "obj", "usda"):
        (folder / f"empty.{suffix}").write_bytes(b"")
        causes[f"empty.{suffix}"] = "empty"
    (folder / "not_found.glb").write_text("<html><h1>404 Not Found</h1></html>\n", encoding="utf-8")
    causes["not_found.glb"] = "a page of the web"
    for suffix in ("gltf", "obj", "usda"):
        path = sound(f"texture_missing_{suffix}.{suffix}", TEXTURED)
        causes[path.name] = "its texture is missing"
    for texture in folder.glob(f"**/{TEXTURED}.png"):
        texture.unlink()
    not_a_number(sound("not_a_number.usda", 1))
    causes["not_a_number.usda"] = "a coordinate is not a number"
    replaced(folder / "a_glb.obj", sound("wrong.glb", 1))
    causes["a_glb.obj"] = "a GLB named as an OBJ"
    replaced(folder / "a_stl.glb", sound("wrong.stl", 1))
    causes["a_stl.glb"] = "an STL named as a GLB"
    (folder / "wrong.glb").unlink()
    (folder / "wrong.stl").unlink()
    (folder / "no_faces.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n", encoding="utf-8")
    causes["no_faces.obj"] = "has no faces"
    (folder / "no_size.obj").write_text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", encoding="utf-8")
    causes["no_size.obj"] = "all its vertices are at one place"
    return causes


def odd(folder: Path) -> dict[str, str]:
    """Write models that are hard, but sound. Returns what is odd about each."""
    kinds = {}

    def changed(name: str, what: str, change: Callable[[], None], **options: bool) -> Path:
        build(4, folder / "textures")
        change()
        export(folder / name, **options)
        kinds[name] = what
        return folder / name

    for suffix in ("glb", "usdc", "obj"):
        changed(f"mirrored.{suffix}", "a negative scale", mirror)
    changed("moving.glb", "animated", move)
    changed("moving.usdc", "animated", move, export_animation=True)
    changed("far.glb", "10 km from the origin", lambda: scale_and_move(1, 10_000))
    changed("tiny.glb", "micrometres in size", lambda: scale_and_move(1e-6, 0))
    changed("kilometres.stl", "kilometres in size", lambda: scale_and_move(1000, 0))
    changed("lit.glb", "with lamps and cameras", add_lamp_and_camera, export_lights=True)
    changed("Stühle — 椅.glb", "a name with blanks and other letters", lambda: None)
    changed("many_parts.glb", "of 400 objects", multiply)
    changed("huge.ply", f"{20 * 4**HUGE_SUBDIVISIONS:,} triangles", enlarge)
    not_numbers_stl(changed("not_numbers.stl", "a triangle of no numbers", lambda: None))
    return kinds


def mirror() -> None:
    for obj in bpy.data.objects:
        obj.scale = (-1, 1, 1)


def move() -> None:
    obj = bpy.data.objects[0]
    obj.keyframe_insert("location", frame=1)
    obj.location = (1, 0, 0)
    obj.keyframe_insert("location", frame=10)
    bpy.context.scene.frame_end = 10


def scale_and_move(factor: float, metres: float) -> None:
    for obj in bpy.data.objects:
        obj.scale = (factor,) * 3
        obj.location = (metres, metres, 0)


def add_lamp_and_camera() -> None:
    for data in (bpy.data.lights.new("lamp", "POINT"), bpy.data.cameras.new("camera")):
        obj = bpy.data.objects.new(data.name, data)
        obj.location = (0, -1, 1)
        bpy.context.scene.collection.objects.link(obj)


def multiply() -> None:
    """Put 400 copies of the first object into the scene, each a mesh of its own."""
    original = bpy.data.objects[0]
    for index in range(400):
        obj = original.copy()
        obj.data = original.data.copy()
        obj.location = (index % 20, index // 20, 0)
        bpy.context.scene.collection.objects.link(obj)


def enlarge() -> None:
    """Replace the scene by a rough ball of very many triangles."""
    bpy.data.batch_remove([*bpy.data.objects])
    ball = icosphere(HUGE_SUBDIVISIONS - 1)
    places: Array = ball.vertices
    rough = 1 + 0.05 * np.sin(20 * places).prod(axis=1, keepdims=True)
    obj = Scene(0, 1.0).add("ball", ball.reshaped(places * rough), "first")
    obj.modifiers.new("finer", "SUBSURF").subdivision_type = "SIMPLE"


# ---- all -----------------------------------------------------------------------------------


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, required=True, help="folder to write")
    parser.add_argument("--count", type=int, default=200, help="models in all (default: 200)")
    arguments = parser.parse_args()
    folder = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    with quiet():
        causes = broken(folder)
        kinds = odd(folder)
    entries = {name: {"kind": what, "renders": False} for name, what in causes.items()}
    entries |= {name: {"kind": what, "renders": True} for name, what in kinds.items()}
    progress = Progress(arguments.count - len(entries), "models", "models")
    for number in range(arguments.count - len(entries)):
        with quiet():
            kind = build(number, folder / "textures")
            name = f"{number:03d}_{kind}.{FORMATS[number % len(FORMATS)]}"
            export(folder / name)
        entries[name] = {"kind": kind, "renders": True}
        progress.done()
    write_json(folder / "models.json", dict(sorted(entries.items())))
    failing = sum(not entry["renders"] for entry in entries.values())
    print(f"{folder}: {len(entries)} models, of which {failing} cannot be rendered")


if __name__ == "__main__":
    run(main)
