"""Writes scenes that Cycles renders incorrectly without an error: users_scenes.py FOLDER.

Each is a .blend in FOLDER, saved at frame 1, with a lamp:
- aspect: a cube of 2 m, 4 m in front of the file's own camera. The camera's pixels are twice as
  wide as high.
- wall: a wall across y at 1.9 m.
- pencil: the wall, with a Grease Pencil drawing of 2 m in front of it, and one of 10 m behind it.
- simulations: unbaked simulations that move something by frame 20, and some that do not move: hair,
  particles without physics, a rigid body at rest.
- baked: a rigid body and simulation nodes that move, baked for the frames up to 20.
- fluid: a fluid that is not baked.
- box: a closed box of 2 m around the origin. split_box: the same with faces that are not joined.
  lit_box: with a lamp in it. glowing_box: with a glowing surface. box_with_glow: with a bulb in it.
  open_box: the box without its side towards x. open_room: the open box with normals inwards.
- leaves: a ball of leaves around the origin as one mesh. Half of the leaves show their backs.
- dome: a hemisphere of 5 m over a floor. backdrop: a floor and a wall behind it, with normals that
  face away. floor: a plane of 20 m at 1 m below the origin, with a normal that faces down.
"""

import math
import sys
from pathlib import Path

import bpy

# isort: split
import bmesh

from lightfield.rendering.scenes import blend_file

FOLDER = Path(sys.argv[1])


def cube(name="cube", **settings):
    bpy.ops.mesh.primitive_cube_add(**settings)
    bpy.context.object.name = name
    return bpy.context.object


def aspect():
    cube(location=(0, 5, 0))
    bpy.ops.object.camera_add(rotation=(1.5707963, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.context.scene.render.pixel_aspect_x = 2


def drawing(name, **settings):
    bpy.ops.object.grease_pencil_add(type="MONKEY", **settings)
    bpy.context.object.name = name
    bpy.context.object.show_in_front = False


def wall():
    cube("a wall", location=(0, 2, 0), scale=(9, 0.1, 9))


def pencil():
    wall()
    drawing("drawing")
    drawing("behind", location=(0, 4, 0), scale=(5, 5, 5))


def falling(name, kind):
    bpy.ops.mesh.primitive_grid_add(location=(0, 0, 5))
    bpy.context.object.name = name
    bpy.context.object.modifiers.new(name, kind)
    return bpy.context.object


def rigid_body(name, kind="ACTIVE"):
    obj = cube(name, location=(0, 5, 5))
    bpy.ops.rigidbody.object_add(type=kind)
    return obj


def emitter(name, **settings):
    """Add an object with particles in the shape of a cube."""
    obj = falling(name, "PARTICLE_SYSTEM")
    particles = obj.particle_systems[0].settings
    particles.render_type, particles.instance_object = "OBJECT", bpy.data.objects["seed"]
    for key, value in settings.items():
        setattr(particles, key, value)


def simulation_nodes(name):
    """Add a cube that simulation nodes move by 0.1 m in each frame."""
    tree = bpy.data.node_groups.new("moves", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Mesh", in_out=direction, socket_type="NodeSocketGeometry")
    names = ("SimulationInput", "Transform", "SimulationOutput")
    first, move, last = (tree.nodes.new(f"GeometryNode{name}") for name in names)
    first.pair_with_output(last)
    move.inputs["Translation"].default_value = (0.1, 0, 0)
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], first.inputs["Geometry"])
    tree.links.new(first.outputs["Geometry"], move.inputs["Geometry"])
    tree.links.new(move.outputs["Geometry"], last.inputs["Geometry"])
    tree.links.new(last.outputs["Geometry"], tree.nodes.new("NodeGroupOutput").inputs[0])
    obj = cube(name)
    obj.modifiers.new("moves", "NODES").node_group = tree
    return obj


def simulations():
    falling("flag", "CLOTH")
    falling("jelly", "SOFT_BODY")
    rigid_body("stone")
    rigid_body("rock", "PASSIVE")
    rigid_body("hidden stone").hide_render = True
    cube("seed", location=(9, 9, 9))
    emitter("sparks")
    emitter("confetti", physics_type="NO")
    emitter("grass", type="HAIR")
    simulation_nodes("crawler")


def baked():
    rigid_body("stone")
    bpy.context.scene.rigidbody_world.point_cache.frame_end = 20
    simulation_nodes("crawler")
    bpy.context.scene.frame_end = 20
    blend_file.save_scene(FOLDER / "baked.blend")
    blend_file.open_scene(FOLDER / "baked.blend")
    bpy.ops.ptcache.bake_all(bake=True)
    crawler = bpy.data.objects["crawler"]
    modifier = crawler.modifiers[0]
    bpy.ops.object.geometry_node_bake_single(
        session_uid=crawler.session_uid,
        modifier_name=modifier.name,
        bake_id=modifier.bakes[0].bake_id,
    )


def fluid():
    falling("water", "FLUID").modifiers[0].fluid_type = "DOMAIN"


def box():
    cube("box")


def edit(remove):
    """Remove the active mesh's faces for which ``remove`` is true, and split the others."""
    mesh = bmesh.new()
    mesh.from_mesh(bpy.context.object.data)
    faces = [face for face in mesh.faces if remove(face)]
    bmesh.ops.delete(mesh, geom=faces, context="FACES")
    bmesh.ops.split_edges(mesh, edges=mesh.edges)
    mesh.to_mesh(bpy.context.object.data)


def open_box():
    cube("box")
    edit(lambda face: face.normal.x > 0.9)


def lit_box():
    cube("box")
    bpy.ops.object.light_add(type="POINT", location=(0, 0.5, 0.5))


def glow(obj):
    material = bpy.data.materials.new("glow")
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 1
    obj.data.materials.append(material)


def glowing_box():
    glow(cube("box"))


def box_with_glow():
    cube("box")
    glow(cube("bulb", size=0.1, location=(0, 0, 0.8)))


def open_room():
    open_box()
    bpy.context.object.data.flip_normals()


def split_box():
    cube("box")
    edit(lambda face: False)


def leaves():
    """Split a ball into its faces, and flip every other one, as on a chessboard."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=3)
    edit(lambda face: face.calc_center_median().z > 2)
    # The order of faces differs from run to run, so it cannot tell which to flip.
    for face in bpy.context.object.data.polygons:
        x, y, z = face.center.normalized()
        column = math.floor(32 * math.atan2(y, x) / math.tau)
        row = math.floor(16 * math.acos(z) / math.pi)
        if (row + column) % 2:
            face.flip()


def floor():
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1), rotation=(math.pi, 0, 0))


def dome():
    floor()
    bpy.context.object.rotation_euler.x = 0
    bpy.ops.mesh.primitive_uv_sphere_add(radius=5, location=(0, 0, -1))
    bpy.context.object.name = "dome"
    edit(lambda face: face.calc_center_median().z < 0)


def backdrop():
    bpy.ops.mesh.primitive_cube_add(size=8, location=(0, 0, 3))
    bpy.context.object.name = "backdrop"
    edit(lambda face: max(face.normal.z, abs(face.normal.x), -face.normal.y) > 0.9)


def main():
    physics = (simulations, baked, fluid)
    meshes = (
        box,
        lit_box,
        glowing_box,
        box_with_glow,
        split_box,
        open_box,
        open_room,
        leaves,
        dome,
        backdrop,
        floor,
    )
    for make in (aspect, wall, pencil, *physics, *meshes):
        blend_file.new_scene()
        bpy.ops.object.light_add(type="SUN", rotation=(1.2, 0, 0))
        make()
        bpy.context.scene.frame_set(1)
        blend_file.save_scene(FOLDER / f"{make.__name__}.blend")


if __name__ == "__main__":
    main()
