"""Writes a .blend of a square that shines with a texture: textured_scene.py OUT.blend TEXTURE."""

import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_plane_add(size=4)
square = bpy.context.object
material = bpy.data.materials.new("screen")
nodes, links = material.node_tree.nodes, material.node_tree.links
nodes.clear()
texture = nodes.new("ShaderNodeTexImage")
texture.image = bpy.data.images.load(sys.argv[2])
shine = nodes.new("ShaderNodeEmission")
links.new(texture.outputs["Color"], shine.inputs["Color"])
links.new(shine.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
square.data.materials.append(material)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1], relative_remap=True)
