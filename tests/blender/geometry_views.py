"""Renders the geometry of scenes whose surfaces are known exactly, and of fog.

Runs in a process of its own, because bpy keeps one global state. Arguments: a folder, and a JSON
file that maps names to [scene, content of a lightfield.json]. FOLDER/views.npz holds of each case's
first view:

- "<name>.z" as in the dataset, and "<name>.normal" in world space;
- "<name>.objects" and "<name>.materials", their places in "<name>.object_names" and
  "<name>.material_names", from 1;
- "<name>.colour" rendered after these, and "<name>.alone", the same without geometry before it.
"""

import json
import sys
from pathlib import Path
from types import MappingProxyType

import bpy
import numpy as np

from lightfield.formats.lightfield import LightField
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
from lightfield.rendering.views import shard
from lightfield.rendering.views.colour_pass import render_colour
from lightfield.rendering.views.geometry_pass import render_geometry

PASSES = ["normal", "object", "material"]


def material(name, alpha=1.0):
    created = bpy.data.materials.new(name)
    created.use_nodes = True
    shader = created.node_tree.nodes["Principled BSDF"]
    shader.inputs["Emission Strength"].default_value = 0.5
    shader.inputs["Alpha"].default_value = alpha
    created.pass_index = 20 + len(bpy.data.materials)
    return created


def volume(name, surface=None, shader="ShaderNodeVolumeScatter"):
    created = bpy.data.materials.new(name)
    created.use_nodes = True
    add_volume(created.node_tree, shader)
    links, nodes = created.node_tree.links, created.node_tree.nodes
    nodes.remove(nodes["Principled BSDF"])
    if surface:
        links.new(nodes.new(surface).outputs[0], nodes["Material Output"].inputs["Surface"])
    return created


def add_volume(tree, shader="ShaderNodeVolumeScatter"):
    scatter = tree.nodes.new(shader)
    scatter.inputs["Density"].default_value = 0.5
    output = next(node for node in tree.nodes if "Output" in node.bl_idname)
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])


def add(kind, index, surface, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
    obj = bpy.context.object
    obj.data.materials.append(surface)
    obj.pass_index = index
    return obj


def known_surfaces():
    """Add a floor z = 0, a wall y = 3, and an exact sphere of radius 1 about (−1, 1.5, 1.25)."""
    add("plane", 1, material("floor"), size=20)
    add("plane", 2, material("wall"), size=20, location=(0, 3, 0), rotation=(np.pi / 2, 0, 0))
    points = add("plane", 3, material("sphere"))
    inputs = {"Position": (-1, 1.5, 1.25), "Radius": 1}
    by_nodes(points, points.data.materials[0], "GeometryNodePoints", inputs)


def by_nodes(obj, surface, kind, inputs=MappingProxyType({})):
    """Let geometry nodes replace an object by the output of a node of a ``kind``."""
    group = bpy.data.node_groups.new("made", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    maker, painted = group.nodes.new(kind), group.nodes.new("GeometryNodeSetMaterial")
    for name, value in inputs.items():
        maker.inputs[name].default_value = value
    painted.inputs["Material"].default_value = surface
    group.links.new(maker.outputs[0], painted.inputs["Geometry"])
    group.links.new(painted.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    obj.modifiers.new("made", "NODES").node_group = group


def curtains():
    """Squares of opacity 0, 0.3, 0.6 and 1, and one of glass, at y = 2 before a wall at y = 3."""
    wall = material("wall")
    add("plane", 1, wall, size=20, location=(0, 3, 0), rotation=(np.pi / 2, 0, 0.3))
    kinds = [material(f"curtain {alpha}", alpha) for alpha in (0.0, 0.3, 0.6, 1.0)]
    glass = material("glass")
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1
    for number, kind in enumerate([*kinds, glass]):
        where = (number - 2, 2, 0)
        add("plane", 10 + number, kind, size=0.9, location=where, rotation=(np.pi / 2, 0, 0))


def render_volumes_quickly():
    """Take long steps through volumes, whose colour need not be exact."""
    bpy.context.scene.cycles.volume_biased = True
    bpy.context.scene.cycles.volume_step_rate = 20


def mesh_fog():
    known_surfaces()
    add("cube", 9, volume("fog"), size=8)


def clear_surface_fog():
    known_surfaces()
    add("cube", 9, volume("fog", "ShaderNodeBsdfTransparent"), size=8)


def volume_object():
    known_surfaces()
    shape = add("cube", 9, material("shape"), size=8)
    shape.hide_render = True
    cloud = bpy.data.objects.new("cloud", bpy.data.volumes.new("cloud"))
    bpy.context.scene.collection.objects.link(cloud)
    modifier = cloud.modifiers.new("from mesh", "MESH_TO_VOLUME")
    modifier.object, modifier.interior_band_width, modifier.voxel_amount = shape, 10, 8
    # A volume object shows where its material reads a grid.
    cloud.data.materials.append(volume("cloud", shader="ShaderNodeVolumePrincipled"))
    render_volumes_quickly()


def nodes_fog():
    """Let geometry nodes make fog of cubes that no viewport shows: from a mesh, and from a grid."""
    known_surfaces()
    for kind in ("GeometryNodeMeshCube", "GeometryNodeVolumeCube"):
        host = add("cube", 9, material("replaced"))
        host.hide_viewport = True
        by_nodes(host, volume("cloud", shader="ShaderNodeVolumePrincipled"), kind)
    render_volumes_quickly()


def world_fog():
    known_surfaces()
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    add_volume(world.node_tree)
    bpy.context.scene.world = world


def moving():
    """The wall comes nearer while the shutter is open. At frame 2 it is at y = 3."""
    known_surfaces()
    wall = bpy.data.objects["Plane.001"]
    for frame in (1, 2, 3):
        wall.location.y = 5 - frame
        wall.keyframe_insert("location", frame=frame)
    bpy.context.scene.render.use_motion_blur = True


def unfocused():
    """The artist's camera has a wide aperture, and focuses on something near."""
    known_surfaces()
    camera = bpy.data.cameras.new("wide open")
    camera.dof.use_dof = True
    camera.dof.aperture_fstop = 0.1
    camera.dof.focus_distance = 0.5
    bpy.context.scene.camera = bpy.data.objects.new("wide open", camera)
    bpy.context.scene.collection.objects.link(bpy.context.scene.camera)


def main(folder: Path, cases: Path) -> None:
    results = {}
    for name, (scene, content) in json.loads(cases.read_text()).items():
        path = folder / f"{scene}.blend"
        if not path.exists():
            blend_file.new_scene()
            globals()[scene]()
            blend_file.save_scene(path)
        lightfield = LightField.from_json(content)
        pose = lightfield.views[0].world_from_camera
        opened = cycles.set_up(path, None, lightfield, "cpu", 1)
        results[f"{name}.alone"] = render_colour(opened, pose, 1).pixels
        # The first geometry follows a new session, the second a colour render. Both must be equal.
        with_passes = LightField.from_json(content | {"passes": PASSES})
        opened = cycles.set_up(path, None, with_passes, "cpu", 1)
        for _ in range(2):
            geometry = render_geometry(opened, pose, PASSES)
            colour = render_colour(opened, pose, 1)
        rays = shard.depth_rays(lightfield)
        results[f"{name}.z"] = shard.depth_channel(geometry.depth, lightfield, rays)
        results[f"{name}.normal"] = geometry.passes["normal"]
        results[f"{name}.objects"] = geometry.passes["object"]
        results[f"{name}.materials"] = geometry.passes["material"]
        for kind in ("object", "material"):
            results[f"{name}.{kind}_names"] = np.array(list(opened.names(kind)))
        results[f"{name}.colour"] = colour.pixels
    np.savez(folder / "views.npz", **results)


main(*map(Path, sys.argv[1:]))
