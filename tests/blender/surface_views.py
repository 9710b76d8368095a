"""Renders a row of cubes with known materials, with the passes of surfaces.

Runs in a process of its own, because bpy keeps one global state. The argument is a folder. It gets
a dataset <lens>/ for each lens, plain/ without these passes, and names.json: which objects are one
Principled BSDF.
"""

import json
import sys
from pathlib import Path

import bpy
import one_shard

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.rendering.scenes import blend_file

SIZE = 48
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 90, "resolution": [2 * SIZE, SIZE]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [2 * SIZE, 2 * SIZE]},
    "panorama": {"lens": "equirectangular", "resolution": [4 * SIZE, 2 * SIZE]},
}
SURFACES = [
    "base_colour",
    "roughness",
    "metallic",
    "transmission",
    "surface_emission",
    "surface_mask",
]
RENDER = {
    "samples": 16,
    "adaptive_threshold": 0,
    "denoise": False,
    "seed": 0,
    "max_bounces": 2,
    "depth_precision": "float",
    "passes": ["object", *SURFACES],
}
# What every exact cube has: as the passes give it.
KNOWN = {
    "base_colour": (0.25, 0.5, 0.75),
    "roughness": (0.375,),
    "metallic": (0.25,),
    "transmission": (0.125,),
    "surface_emission": (0.5, 0.25, 2.0),
}
# What a matt cube has instead: it reflects nothing but its colour.
MATT = KNOWN | {
    "roughness": (1,),
    "metallic": (0,),
    "transmission": (0,),
    "surface_emission": (0, 0, 0),
}
# The floor's base colour is its place times this, and 0.5.
SLOPE = 0.03


def principled(tree):
    """Return a new Principled BSDF with the known values."""
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*KNOWN["base_colour"], 1)
    node.inputs["Roughness"].default_value = KNOWN["roughness"][0]
    node.inputs["Metallic"].default_value = KNOWN["metallic"][0]
    node.inputs["Transmission Weight"].default_value = KNOWN["transmission"][0]
    node.inputs["Emission Color"].default_value = (0.25, 0.125, 1, 1)
    node.inputs["Emission Strength"].default_value = 2.0
    return node


def material(name):
    """Return a material without nodes but its output, its tree, and the output's input."""
    made = bpy.data.materials.new(name)
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    return made, tree, tree.nodes["Material Output"].inputs["Surface"]


def direct(name="direct"):
    made, tree, surface = material(name)
    tree.links.new(principled(tree).outputs[0], surface)
    return made


def rerouted():
    made, tree, surface = material("rerouted")
    reroute = tree.nodes.new("NodeReroute")
    tree.links.new(principled(tree).outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], surface)
    return made


def group():
    """Return a group with a Principled BSDF, whose roughness comes from outside."""
    inner = bpy.data.node_groups.new("paint", "ShaderNodeTree")
    inner.interface.new_socket("Shine", in_out="OUTPUT", socket_type="NodeSocketShader")
    inner.interface.new_socket("Rough", in_out="INPUT", socket_type="NodeSocketFloat")
    entry = inner.nodes.new("NodeGroupInput")
    node = principled(inner)
    inner.links.new(entry.outputs[0], node.inputs["Roughness"])
    inner.links.new(node.outputs[0], inner.nodes.new("NodeGroupOutput").inputs[0])
    return inner


def grouped(inner):
    made, tree, surface = material("grouped")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = inner
    node.inputs["Rough"].default_value = KNOWN["roughness"][0]
    tree.links.new(node.outputs[0], surface)
    return made


def mixed(inner):
    """Return a material that mixes the group, which another material shows alone."""
    made, tree, surface = material("mixed")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = inner
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(node.outputs[0], mix.inputs[1])
    tree.links.new(tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], surface)
    return made


def clamped():
    """Return a material with a roughness of 3, which Cycles clamps to 1."""
    made, tree, surface = material("clamped")
    node = principled(tree)
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 3.0
    tree.links.new(value.outputs[0], node.inputs["Roughness"])
    tree.links.new(node.outputs[0], surface)
    return made


def matt():
    """Return a material that is one Diffuse BSDF."""
    made, tree, surface = material("matt")
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (*KNOWN["base_colour"], 1)
    tree.links.new(node.outputs[0], surface)
    return made


def glass():
    made, tree, surface = material("glass")
    tree.links.new(tree.nodes.new("ShaderNodeBsdfGlass").outputs[0], surface)
    return made


def muted():
    made, tree, surface = material("muted")
    node = principled(tree)
    node.mute = True
    tree.links.new(node.outputs[0], surface)
    return made


def with_alpha(name, alpha):
    made = direct(name)
    made.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = alpha
    return made


def floor():
    """Return a material whose base colour follows from its place."""
    made, tree, surface = material("floor")
    node = principled(tree)
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value = (SLOPE, SLOPE, SLOPE)
    scale.inputs[2].default_value = (0.5, 0.5, 0.5)
    place = tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    tree.links.new(place, scale.inputs[0])
    tree.links.new(scale.outputs[0], node.inputs["Base Color"])
    tree.links.new(node.outputs[0], surface)
    return made


def add(name, kind, surface, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    obj = bpy.context.object
    obj.name = name
    if surface:
        obj.data.materials.append(surface)
    return obj


def of_library(folder):
    """Return a material of another .blend."""
    blend_file.new_scene()
    path = folder / "library.blend"
    bpy.data.libraries.write(str(path), {direct("linked")}, fake_user=True)
    blend_file.new_scene()
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.materials = ["linked"]
    return wanted.materials[0]


def build(folder):
    linked = of_library(folder)
    inner = group()
    shared = direct()
    exact = {
        "direct": shared,
        "twin": shared,
        "rerouted": rerouted(),
        "grouped": grouped(inner),
        "linked": linked,
        "behind cutout": shared,
        "clamped": clamped(),
        "matt": matt(),
    }
    other = {
        "mixed": mixed(inner),
        "glass": glass(),
        "muted": muted(),
        "bare": None,
        "behind veil": shared,
    }
    for number, (name, surface) in enumerate({**exact, **other}.items()):
        across, up = number % 7, number // 7
        place = (1.1 * (across - 3), 3, 1 + 1.2 * up)
        add(name, "cube", surface, size=0.9, location=place)
        veil = {"behind cutout": with_alpha("cut", 0.0), "behind veil": with_alpha("veil", 0.5)}
        if name in veil:
            front = (0.75 * place[0], 2, 1 + 0.75 * (place[2] - 1))
            add(
                f"card {name}", "plane", veil[name], size=1, location=front, rotation=(1.5708, 0, 0)
            )
    add("floor", "plane", floor(), size=30)
    world = bpy.data.worlds.new("sky")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.8, 0.8, 1)
    bpy.context.scene.world = world
    (folder / "names.json").write_text(json.dumps({"exact": [*exact], "other": [*other]}))
    blend_file.save_scene(folder / "scene.blend")


def main(folder: Path) -> None:
    build(folder)

    def render(name, lens, **settings):
        made = lenses.from_camera(LENSES[lens])
        rig = {"type": "lattice", "cameras": [1, 1, 1], "center": [0, -1, 1.3]}
        depth = "z" if made.has_z_depth else "distance"
        block = {**RENDER, **settings}
        content = LightField.from_rig(rig, made, depth=depth, frame=1, scene={}, render=block)
        receipt = folder / f"receipts/{name}.jsonl"
        one_shard.render(content, folder / name, folder / "scene.blend", receipt=receipt)

    for lens in LENSES:
        render(lens, lens)
    render("plain", "perspective", passes=["object"])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
