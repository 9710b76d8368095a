"""Renders a scene with emitters of every kind, with a light group for each.

Runs in a process of its own, because bpy keeps one global state. The argument is a folder. It gets
scene.blend with library.blend beside it, and emitters.json. It also gets a dataset <name>/ with its
receipt receipts/<name>.jsonl for each lens, a transparent view, a clamp, and the lamp alone.
"""

import json
import sys
from pathlib import Path

import bpy
import one_shard

from lightfield.core.errors import UserError
from lightfield.formats.light_groups import resolved
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.rendering.inspection import inventory, light
from lightfield.rendering.scenes import blend_file

SIZE = 24
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [SIZE, SIZE]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [SIZE, SIZE]},
    "panorama": {"lens": "equirectangular", "resolution": [2 * SIZE, SIZE]},
}
RENDER = {"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0, "max_bounces": 3}
RIG = {"type": "lattice", "cameras": [1, 1, 1], "center": [0.2, -1.4, 1.1]}


def material(name, **inputs):
    made = bpy.data.materials.new(name)
    for key, value in inputs.items():
        made.node_tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    return made


def add(name, kind, *surfaces, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    obj = bpy.context.object
    obj.name = name
    for surface in surfaces:
        obj.data.materials.append(surface)
    return obj


def lamp(name, place, energy=100):
    data = bpy.data.lights.new(name, "POINT")
    data.energy = energy
    obj = bpy.data.objects.new(name, data)
    obj.location = place
    bpy.context.collection.objects.link(obj)


def place_collection(name, collection, place):
    empty = bpy.data.objects.new(name, None)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = collection
    empty.location = place
    bpy.context.scene.collection.objects.link(empty)


def bulbs(glow):
    """Return a collection with one glowing cube."""
    collection = bpy.data.collections.new("bulbs")
    bulb = add("bulb", "cube", glow, size=0.2)
    bpy.context.collection.objects.unlink(bulb)
    collection.objects.link(bulb)
    return collection


def build(folder):
    blend_file.new_scene()
    collection = bulbs(material("warm", Emission_Strength=2.0))
    bpy.data.libraries.write(str(folder / "library.blend"), {collection})
    blend_file.new_scene()
    add("floor", "plane", material("grey"), size=20)
    warm = material("warm", Emission_Strength=2.0, Emission_Color=(1, 0.5, 0.2, 1))
    cold = material("cold", Emission_Strength=1.0, Emission_Color=(0.2, 0.5, 1, 1))
    two = add("two colours", "cube", warm, cold, size=0.5, location=(1, 1, 0.5))
    two.data.polygons[0].material_index = 1
    lamp("lamp.1", (-1, 0, 2))
    lamp("lamp 1", (1, 0, 2), 50)
    collection = bulbs(warm)
    for number in range(2):
        place_collection(f"place {number}", collection, (-1, number, 0.3))
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["bulbs"]
    place_collection("from library", wanted.collections[0], (0.6, 0.2, 0.3))
    fire = material("fire")
    nodes = fire.node_tree.nodes
    nodes.remove(nodes["Principled BSDF"])
    volume = nodes.new("ShaderNodeVolumePrincipled")
    volume.inputs["Emission Strength"].default_value = 1.0
    fire.node_tree.links.new(volume.outputs[0], nodes["Material Output"].inputs["Volume"])
    add("fire", "cube", fire, size=0.4, location=(0, 2, 0.6))
    world = bpy.data.worlds.new("sky")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.4, 1)
    bpy.context.scene.world = world
    blend_file.save_scene(folder / "scene.blend")


def main(folder: Path) -> None:
    build(folder)
    inventory.inventory([1])
    emitters = light.emitters()
    (folder / "emitters.json").write_text(json.dumps(emitters))

    def render(name, lens, groups, **settings):
        block = {**RENDER, "depth_precision": "float", "light_groups": groups, **settings}
        content = LightField.from_rig(
            RIG, lenses.from_camera(LENSES[lens]), depth=None, frame=1, scene={}, render=block
        )
        receipt = folder / f"receipts/{name}.jsonl"
        one_shard.render(content, folder / name, folder / "scene.blend", receipt=receipt)

    groups = resolved("each", emitters)
    for lens in LENSES:
        render(lens, lens, groups)
    render("transparent", "perspective", groups, transparent=True)
    render("clamped", "perspective", groups, clamp_indirect=0.05)
    render("named", "perspective", resolved({"lamps": ["lamp.1", "lamp 1"]}, emitters))
    render("many_samples", "perspective", groups, samples=256)
    # The same scene in another light: one lamp is off, and the other is twice as bright.
    blend_file.open_scene(folder / "scene.blend")
    bpy.data.lights["lamp.1"].energy = 0
    bpy.data.lights["lamp 1"].energy *= 2
    blend_file.save_scene(folder / "scene.blend")
    render("relit", "perspective", groups, samples=256)
    bpy.data.objects["floor"].is_shadow_catcher = True
    blend_file.save_scene(folder / "scene.blend")
    try:
        render("catcher", "perspective", groups)
    except UserError as error:
        (folder / "refusal.txt").write_text(str(error))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
