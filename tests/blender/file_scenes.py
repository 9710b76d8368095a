"""Writes a .blend for each kind of file that Blender reads, and the files: file_scenes.py FOLDER.

Each .blend in FOLDER has a camera, a lamp, and one object that shows the file with the .blend's
name and the suffix of its kind. The .blends needed and unneeded name missing files, by switches
that are on or off.
"""

import struct
import sys
from pathlib import Path

import bpy

bpy.utils.expose_bundled_modules()
import openvdb  # noqa: E402

FOLDER = Path(sys.argv[1]).resolve()
SIDE = 32
FRAMES = 6


def new_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.cycles.samples = 1
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    return scene


def save(name):
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{name}.blend"), relative_remap=True)


def cube(name="shape"):
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = name
    return bpy.context.object


def material(obj, name):
    """Give an object a new material, and return its nodes and its shader."""
    made = bpy.data.materials.new(name)
    obj.data.materials.append(made)
    nodes = made.node_tree.nodes
    return made.node_tree, next(n for n in nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")


def textured(obj, name, source="FILE"):
    """Give an object a texture in the file `name`. Return its tree, node and link."""
    tree, shader = material(obj, name)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new(name, 4, 4)
    node.image.source = source
    node.image.filepath = str(FOLDER / name)
    return tree, node, tree.links.new(node.outputs[0], shader.inputs["Base Color"])


def movies():
    scene = new_scene()
    scene.cycles.use_animated_seed = True
    cube()
    settings = scene.render.image_settings
    settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    scene.render.ffmpeg.constant_rate_factor = "HIGH"
    for kind, codec in (("MPEG4", "H264"), ("MKV", "H264"), ("AVI", "MPEG4")):
        suffix = {"MPEG4": "mp4"}.get(kind, kind.lower())
        scene.render.ffmpeg.format, scene.render.ffmpeg.codec = kind, codec
        scene.render.filepath = str(FOLDER / f"{suffix}.{suffix}")
        bpy.ops.render.render(animation=True)
    for suffix in ("mp4", "mkv", "avi"):
        new_scene()
        textured(cube(), f"{suffix}.{suffix}", "MOVIE")
        save(suffix)


def pictures():
    new_scene()
    _, node, _ = textured(cube(), "flip_001.png", "SEQUENCE")
    node.image_user.frame_duration = FRAMES
    node.image_user.frame_start = -1
    for number in range(1, FRAMES + 1):
        picture = bpy.data.images.new("picture", 4, 4)
        picture.filepath_raw, picture.file_format = str(FOLDER / f"flip_{number:03}.png"), "PNG"
        picture.save()
        bpy.data.images.remove(picture)
    save("pictures")


def alembic():
    new_scene()
    obj = cube()
    for frame in (1, FRAMES):
        obj.location.x = frame / FRAMES
        obj.keyframe_insert("location", frame=frame)
    bpy.ops.wm.alembic_export(filepath=str(FOLDER / "abc.abc"), start=1, end=FRAMES)
    bpy.ops.wm.usd_export(filepath=str(FOLDER / "usdc.usdc"), export_animation=True)
    new_scene()
    bpy.ops.wm.alembic_import(filepath=str(FOLDER / "abc.abc"))
    save("abc")
    new_scene()
    bpy.ops.wm.usd_import(filepath=str(FOLDER / "usdc.usdc"))
    save("usdc")


def mesh_caches():
    for kind in ("MDD", "PC2"):
        new_scene()
        obj = cube()
        points = [tuple(vertex.co * 0.5) for vertex in obj.data.vertices]
        values = [value for point in points for value in point] * FRAMES
        if kind == "MDD":
            head = struct.pack(f">2I{FRAMES}f", FRAMES, len(points), *range(FRAMES))
            content = head + struct.pack(f">{len(values)}f", *values)
        else:
            head = struct.pack("<12s2I2fI", b"POINTCACHE2", 1, len(points), 1, 1, FRAMES)
            content = head + struct.pack(f"<{len(values)}f", *values)
        file = FOLDER / f"{kind.lower()}.{kind.lower()}"
        file.write_bytes(content)
        modifier = obj.modifiers.new("cache", "MESH_CACHE")
        modifier.cache_format, modifier.filepath = kind, str(file)
        save(kind.lower())


def imports():
    new_scene()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    for suffix in ("stl", "ply", "obj"):
        export = getattr(bpy.ops.wm, f"{suffix}_export")
        export(filepath=str(FOLDER / f"{suffix}.{suffix}"))
    rows = "\n".join(f"{x},{x * x}" for x in range(99))
    (FOLDER / "csv.csv").write_text(f"x,y\n{rows}\n")
    fog("import_vdb.vdb")
    names = {"stl": "STL", "ply": "PLY", "obj": "OBJ", "csv": "CSV", "import_vdb": "VDB"}
    for name, kind in names.items():
        new_scene()
        suffix = kind.lower()
        import_by_nodes(cube(), kind, FOLDER / f"{name}.{suffix}")
        save(name)


def import_by_nodes(obj, kind, path):
    """Replace an object by a file that geometry nodes import. Return the modifier and node."""
    tree = bpy.data.node_groups.new(kind, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    node = tree.nodes.new(f"GeometryNodeImport{kind}")
    node.inputs["Path"].default_value = str(path)
    tree.links.new(node.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    modifier = obj.modifiers.new(kind, "NODES")
    modifier.node_group = tree
    return modifier, node


def fog(name):
    grid = openvdb.FloatGrid()
    grid.name = "density"
    accessor = grid.getAccessor()
    for index in range(4000):
        accessor.setValueOn((index % 64, index * 7 % 61, index * 13 % 59), (index * 31 % 97) / 97)
    openvdb.write(str(FOLDER / name), grids=[grid])


def volumes():
    new_scene()
    fog("vdb.vdb")
    bpy.ops.object.volume_import(filepath=str(FOLDER / "vdb.vdb"))
    save("vdb")
    new_scene()
    for number in range(1, FRAMES + 1):
        fog(f"smoke_{number:03}.vdb")
    bpy.ops.object.volume_import(filepath=str(FOLDER / "smoke_001.vdb"))
    volume = bpy.context.object.data
    volume.is_sequence = True
    volume.frame_start, volume.frame_duration = 1, FRAMES
    volume.frame_offset = 2
    save("sequence")


def light_profile():
    new_scene()
    angles = "0 30 60 90"
    head = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 4 1 1 2 0.1 0.1 0\n1 1 100\n"
    (FOLDER / "ies.ies").write_text(f"{head}{angles}\n0\n1000 800 400 100\n")
    bpy.ops.object.light_add(type="SPOT", location=(0, 0, 3))
    light = bpy.context.object.data
    light.use_nodes = True
    tree = light.node_tree
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", str(FOLDER / "ies.ies")
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    cube()
    save("ies")


def shader():
    scene = new_scene()
    scene.cycles.shading_system = True
    file = FOLDER / "osl.osl"
    file.write_text("shader green(output color Colour = 0) { Colour = color(0, 1, 0); }\n")
    tree, shader = material(cube(), "osl")
    node = tree.nodes.new("ShaderNodeScript")
    node.mode, node.filepath = "EXTERNAL", str(file)
    output = node.outputs.get("Colour") or node.outputs.new("NodeSocketColor", "Colour")
    tree.links.new(output, shader.inputs["Base Color"])
    save("osl")


def cloth():
    scene = new_scene()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8)
    obj = bpy.context.object
    obj.name = "sail"
    cache = obj.modifiers.new("cloth", "CLOTH").point_cache
    save("cloth")
    cache.use_disk_cache = True
    cache.frame_end = FRAMES
    with bpy.context.temp_override(scene=scene, active_object=obj, point_cache=cache):
        bpy.ops.ptcache.bake(bake=True)
    save("cloth")
    name = obj.name.encode().hex().upper()
    cache.use_external = True
    cache.filepath, cache.name, cache.index = "//blendcache_cloth/", name, 0
    save("external")


def switches(name, is_on):
    """Name missing files by what a switch turns on or off."""
    new_scene()
    # It is not baked, so that it reads nothing.
    cube("ocean").modifiers.new("ocean", "OCEAN")
    obj = cube("squash")
    modifier = obj.modifiers.new("squash", "MESH_CACHE")
    modifier.filepath, modifier.show_render = str(FOLDER / "squash.mdd"), is_on
    texture = bpy.data.textures.new("bumps", "IMAGE")
    texture.image = bpy.data.images.new("bumps.png", 4, 4)
    texture.image.source, texture.image.filepath = "FILE", str(FOLDER / "bumps.png")
    modifier = cube("bumps").modifiers.new("bumps", "DISPLACE")
    modifier.texture, modifier.show_render = texture, is_on
    _, node, _ = textured(cube("muted_node"), "muted_node.png")
    node.mute = not is_on
    _, _, link = textured(cube("muted_link"), "muted_link.png")
    link.is_muted = not is_on
    modifier, _ = import_by_nodes(cube("hidden"), "STL", FOLDER / "hidden.stl")
    modifier.show_render = is_on
    _, node = import_by_nodes(cube("muted"), "PLY", FOLDER / "muted.ply")
    node.mute = not is_on
    _, shader = material(cube("script"), "script")
    node = shader.id_data.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", str(FOLDER / "loose.ies")
    if is_on:
        shader.id_data.links.new(node.outputs[0], shader.inputs["Roughness"])
    if not is_on:
        brush = bpy.data.brushes.new("brush", mode="TEXTURE_PAINT")
        brush.texture = bpy.data.textures.new("brush", "IMAGE")
        brush.texture.image = bpy.data.images.new("brush.png", 4, 4)
        brush.texture.image.source = "FILE"
        brush.texture.image.filepath = str(FOLDER / "brush.png")
    save(name)


movies()
pictures()
alembic()
mesh_caches()
imports()
volumes()
light_profile()
shader()
cloth()
switches("needed", is_on=True)
switches("unneeded", is_on=False)
