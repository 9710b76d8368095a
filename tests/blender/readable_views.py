"""Renders what shaders can read, with and without passes, and as Blender itself renders it.

Runs in a process of its own, because bpy keeps one global state. The argument is a folder. For each
choice of passes in `CHOICES` it writes there a dataset <choice>/ of one view. blender.exr is the
same view, rendered by Blender alone. tiles.json has the tiles of the view by name: the column and
the row of the pixel in its middle.

A tile glows with the value of a node's output, times `SCALE`.
"""

import json
import sys
from pathlib import Path

import bpy
import one_shard

from lightfield.configuration import keys
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PASSES, VARIANCE
from lightfield.geometry import lenses
from lightfield.rendering.scenes import blend_file

# The view shows rows of square tiles.
ROW = 12
TILE = 8
CAMERA = {"lens": "rectilinear", "fov": 40, "resolution": [ROW * TILE, ROW * TILE]}
SCALE = 1 / 64
RENDER = {
    "samples": 4,
    "adaptive_threshold": 0,
    "denoise": False,
    "seed": 0,
    "max_bounces": 2,
    "depth_precision": "float",
}
# Other passes are rendered together.
ALONE = ("normal", "object", "material", "instance", "cryptomatte", "motion")
CHOICES = {
    "none": {},
    **{name: {"passes": [name]} for name in ALONE},
    "light": {"passes": [name for name, each in PASSES.items() if each.kind == "light"]},
    "surfaces": {"passes": [name for name, each in PASSES.items() if each.unless]},
    # The variance changes last digits of the colour.
    "all": {"passes": [name for name in PASSES if name != VARIANCE]},
    "groups": {
        "light_groups": {"lamp": ["lamp"], "tile": ["group 300"], "others": ["World"]},
    },
}
OBJECT_INFO = ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random")
GEOMETRY = (
    *("Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing"),
    *("Pointiness", "Random Per Island"),
)
PARTICLE_INFO = (
    *("Index", "Random", "Age", "Lifetime", "Location", "Size", "Velocity", "Angular Velocity"),
)
# Paths from an object, and from a view layer, scene or world.
OF_OBJECTS = (
    *("pass_index", "material_slots[0].material.pass_index", "location", "own", "of_data", "both"),
)
OF_LAYERS = ("of_layer", "of_scene", "of_world", "frame_current", 'objects["source"].pass_index')


def output(tree, node, name):
    """Return an output of a new node."""
    return tree.nodes.new(f"ShaderNode{node}").outputs[name]


def attribute(tree, kind, name):
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type = kind
    node.attribute_name = name
    return node.outputs["Color"]


def scaled(tree, value, factor=SCALE):
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    tree.links.new(value, node.inputs["Vector"])
    node.inputs["Scale"].default_value = factor
    return node.outputs["Vector"]


def material(name, read, index=5):
    """Return a material that glows with what ``read`` returns for its node tree."""
    made = bpy.data.materials.new(name)
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    glow = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(scaled(tree, read(tree)), glow.inputs["Color"])
    tree.links.new(glow.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    made.pass_index = index
    return made


class Tiles:
    """Places tiles in the view, side by side."""

    def __init__(self):
        self.middles = {}

    def place(self, name):
        """Return the place of a new tile in the plane y = 0."""
        row, column = divmod(len(self.middles), ROW)
        self.middles[name] = [TILE * column + TILE // 2, TILE * row + TILE // 2]
        return (column - ROW / 2 + 0.5, 0, ROW / 2 - 0.5 - row)


def plane(name, paint, place, index=7, cuts=None):
    """Add a tile, as a mesh of its own."""
    bpy.ops.mesh.primitive_grid_add(
        size=0.9, location=place, rotation=(1.5707963, 0, 0), x_subdivisions=cuts or 1
    )
    obj = bpy.context.object
    obj.name = name
    obj.data.materials.append(paint)
    obj.data.attributes.new("of_geometry", "FLOAT", "POINT").data.foreach_set(
        "value", range(len(obj.data.vertices))
    )
    obj.pass_index = index
    obj.color = (3, 5, 8, 0.5)
    obj["own"] = 11
    obj["both"] = 12.5
    obj.data["of_data"] = 13
    return obj


def by_collection(tile, place):
    """Show a tile through an instance of its collection alone."""
    group = bpy.data.collections.new(tile.name)
    group.objects.link(tile)
    bpy.context.scene.collection.objects.unlink(tile)
    tile.location = (0, 0, 0)
    empty = bpy.data.objects.new(f"{tile.name} by collection", None)
    empty.location = place
    empty.instance_type = "COLLECTION"
    empty.instance_collection = group
    empty.pass_index = 23
    empty["both"] = 17
    bpy.context.scene.collection.objects.link(empty)


def by_particle(tile, place):
    """Show a tile through a particle alone."""
    tile.location = (0, 9, 0)
    tile.hide_render = True
    mesh = bpy.data.meshes.new("point")
    mesh.from_pydata([(0, 0, 0)], [], [])
    emitter = bpy.data.objects.new(f"{tile.name} by particle", mesh)
    emitter.location = place
    emitter.pass_index = 29
    emitter["both"] = 19
    bpy.context.scene.collection.objects.link(emitter)
    emitter.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end = 1, 1, 1
    settings.emit_from, settings.physics_type = "VERT", "NO"
    settings.render_type, settings.instance_object = "OBJECT", tile
    settings.particle_size, settings.use_rotation_instance = 1, True
    emitter.show_instancer_for_render = False


def by_nodes(tile, place):
    """Show a tile through geometry nodes alone, which give the instance an attribute."""
    tile.location = (0, 9, 0)
    tile.hide_render = True
    tree = bpy.data.node_groups.new("instance", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    shown = tree.nodes.new("GeometryNodeObjectInfo")
    shown.inputs["Object"].default_value = tile
    shown.inputs["As Instance"].default_value = True
    upright = tree.nodes.new("GeometryNodeTransform")
    upright.inputs["Rotation"].default_value = tile.rotation_euler
    stored = tree.nodes.new("GeometryNodeStoreNamedAttribute")
    stored.domain = "INSTANCE"
    stored.inputs["Name"].default_value = "both"
    stored.inputs["Value"].default_value = 21
    tree.links.new(shown.outputs["Geometry"], upright.inputs[0])
    tree.links.new(upright.outputs[0], stored.inputs[0])
    tree.links.new(stored.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    host = bpy.data.objects.new(f"{tile.name} by nodes", bpy.data.meshes.new("host"))
    host.location = place
    host.pass_index = 27
    host.modifiers.new("instance", "NODES").node_group = tree
    bpy.context.scene.collection.objects.link(host)


HOSTS = {
    "object": None,
    "collection": by_collection,
    "particle": by_particle,
    "nodes": by_nodes,
}


def group_of_index():
    """Return a group that adds both indices. Materials and a lamp share it."""
    inner = bpy.data.node_groups.new("indices", "ShaderNodeTree")
    inner.interface.new_socket("Sum", in_out="OUTPUT", socket_type="NodeSocketFloat")
    add = inner.nodes.new("ShaderNodeMath")
    inner.links.new(output(inner, "ObjectInfo", "Object Index"), add.inputs[0])
    inner.links.new(output(inner, "ObjectInfo", "Material Index"), add.inputs[1])
    inner.links.new(add.outputs[0], inner.nodes.new("NodeGroupOutput").inputs[0])
    return inner


def grouped(tree, inner):
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = inner
    return node.outputs[0]


def readings():
    """Yield the name of each reading, and a function that adds its nodes to a tree."""
    for node, names in (("ObjectInfo", OBJECT_INFO), ("NewGeometry", GEOMETRY)):
        for name in names:
            yield name, lambda tree, node=node, name=name: output(tree, node, name)
    for kind in ("OBJECT", "INSTANCER"):
        for path in OF_OBJECTS:
            yield f"{kind} {path}", lambda tree, kind=kind, path=path: attribute(tree, kind, path)


def add_tiles(tiles):
    for name, read in readings():
        for host, show in HOSTS.items():
            is_of_instances = name.startswith("INSTANCER") or name in OBJECT_INFO
            if show and not is_of_instances:
                continue
            title = f"{name} {host}"
            place = tiles.place(title)
            tile = plane(title, material(title, read), place)
            if show:
                show(tile, place)
    for name in PARTICLE_INFO:
        place = tiles.place(name)
        paint = material(name, lambda tree, name=name: output(tree, "ParticleInfo", name))
        by_particle(plane(name, paint, place), place)
    for path in OF_LAYERS:
        paint = material(path, lambda tree, path=path: attribute(tree, "VIEW_LAYER", path))
        plane(path, paint, tiles.place(path))
    paint = material("mesh", lambda tree: attribute(tree, "GEOMETRY", "of_geometry"))
    plane("mesh", paint, tiles.place("mesh"))


def add_special_tiles(tiles):
    """Add tiles whose shape, visibility or light follows from an index."""
    inner = group_of_index()
    for index in (0, 7, 300):
        name = f"group {index}"
        paint = material(name, lambda tree: grouped(tree, inner), index + (index == 0))
        plane(name, paint, tiles.place(name), index)
    shared = material("shared", lambda tree: grouped(tree, inner))
    for index in (2, 3):
        plane(f"shared {index}", shared, tiles.place(f"shared {index}"), index)
    # Tiles of index 1 are cut out.
    cut = material("cut", lambda tree: output(tree, "ObjectInfo", "Random"))
    tree = cut.node_tree
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    tree.links.new(output(tree, "ObjectInfo", "Object Index"), shader.inputs["Alpha"])
    tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    for index in (0, 1):
        plane(f"cut {index}", cut, tiles.place(f"cut {index}"), index)
    lifted = material("lifted", lambda tree: output(tree, "NewGeometry", "Position"))
    lifted.displacement_method = "DISPLACEMENT"
    tree = lifted.node_tree
    move = tree.nodes.new("ShaderNodeDisplacement")
    move.inputs["Scale"].default_value = 0.05
    tree.links.new(output(tree, "ObjectInfo", "Object Index"), move.inputs["Height"])
    tree.links.new(move.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
    plane("lifted", lifted, tiles.place("lifted"), 4, cuts=4)
    for name, density in (("fog", "Object Index"), ("haze", "Material Index")):
        fog = bpy.data.materials.new(name)
        fog.pass_index = 3
        tree = fog.node_tree
        tree.nodes.remove(tree.nodes["Principled BSDF"])
        scatter = tree.nodes.new("ShaderNodeVolumeScatter")
        tree.links.new(output(tree, "ObjectInfo", density), scatter.inputs["Density"])
        tree.links.new(scatter.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        bpy.ops.mesh.primitive_cube_add(size=0.8, location=tiles.place(name))
        bpy.context.object.name = name
        bpy.context.object.data.materials.append(fog)
        bpy.context.object.pass_index = 2
    return inner


def keyed(block, path, values):
    for frame, value in enumerate(values, 1):
        setattr(block, path, value)
        block.keyframe_insert(path, frame=frame)


def driven(block, path, source, source_path, index=-1):
    driver = block.driver_add(path, index).driver if index >= 0 else block.driver_add(path).driver
    driver.type = "SUM"
    target = driver.variables.new().targets[0]
    target.id_type, target.id, target.data_path = source.id_type, source, source_path


def add_linked_tile(tiles, folder):
    """Add a tile whose material is in another .blend."""
    path = folder / "library.blend"
    made = material("linked", lambda tree: output(tree, "ObjectInfo", "Object Index"), 6)
    bpy.data.libraries.write(str(path), {made}, fake_user=True)
    bpy.data.materials.remove(made)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.materials = ["linked"]
    plane("linked", wanted.materials[0], tiles.place("linked"), 9)


def add_animation(tiles):
    index = lambda tree: output(tree, "ObjectInfo", "Object Index")  # noqa: E731
    for name in ("keyed", "hidden keyed", "moving"):
        tile = plane(name, material(name, index), tiles.place(name))
        keyed(tile, "pass_index", (1, 41, 3))
        tile.hide_viewport = name.startswith("hidden")
    keyed(bpy.data.materials["moving"], "pass_index", (4, 5, 6))
    x, _, _ = tile.location
    for frame, change in enumerate((0, 0.1, 0.2), 1):
        tile.location.x = x + change
        tile.keyframe_insert("location", frame=frame)
    source = plane("source", material("source", index), tiles.place("source"), 31)
    follower = plane("follower", material("follower", index), tiles.place("follower"), 8)
    # A driver adds the source's index to what it is added to.
    driven(follower, "scale", source, "pass_index", 0)
    follower.data.transform(((1 / 31, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    paint = material("driven", lambda tree: output(tree, "Value", 0))
    value = next(node for node in paint.node_tree.nodes if node.type == "VALUE")
    driven(value.outputs[0], "default_value", bpy.data.materials["keyed"], "pass_index")
    plane("driven", paint, tiles.place("driven"))


def content(**passes):
    lens = lenses.from_camera(CAMERA)
    rig = {"type": "lattice", "cameras": [1, 1, 1], "center": [0, -16.4, 0]}
    render = RENDER | passes
    return LightField.from_rig(rig, lens, depth="z", frame=2, scene={}, render=render)


def build(folder):
    scene = bpy.context.scene
    tiles = Tiles()
    add_tiles(tiles)
    inner = add_special_tiles(tiles)
    add_animation(tiles)
    add_linked_tile(tiles, folder)
    bpy.context.view_layer["of_layer"] = 37
    scene["of_scene"] = 39
    world = scene.world = bpy.data.worlds.new("world")
    world["of_world"] = 43
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.2, 0.2, 1)
    floor = bpy.data.materials.new("floor")
    plane("floor", floor, (0, 1, 0), 0).scale = (40, 40, 40)
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy = 900
    lamp.use_nodes = True
    tree = lamp.node_tree
    tree.links.new(grouped(tree, inner), tree.nodes["Emission"].inputs["Strength"])
    lamp_object = bpy.data.objects.new("lamp", lamp)
    lamp_object.location = (3, -5, 6)
    lamp_object.pass_index = 2
    scene.collection.objects.link(lamp_object)
    lightfield = content()
    camera = bpy.data.cameras.new("camera")
    camera.lens = lightfield.content["camera"]["focal_length"]
    camera.sensor_width = lightfield.content["sensor_size"][0]
    camera.clip_start, camera.clip_end = 1e-4, 1e9
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.matrix_world = lightfield.views[0].world_from_camera.T
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = CAMERA["resolution"]
    scene.cycles.samples = RENDER["samples"]
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.max_bounces = RENDER["max_bounces"]
    scene.cycles.seed = keys.view_seed(0, lightfield.views[0].name)
    scene.frame_set(2)
    (folder / "tiles.json").write_text(json.dumps(tiles.middles))


def render_with_blender(path):
    scene = bpy.context.scene
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main(folder: Path) -> None:
    blend = folder / "readable.blend"
    blend_file.new_scene()
    build(folder)
    blend_file.save_scene(blend)
    blend_file.open_scene(blend)
    render_with_blender(folder / "blender.exr")
    for name, choice in CHOICES.items():
        receipt = folder / f"receipts/{name}.jsonl"
        one_shard.render(content(**choice), folder / name, blend, receipt=receipt)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
