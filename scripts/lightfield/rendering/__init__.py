"""Views from Blender: the one room that imports bpy."""
