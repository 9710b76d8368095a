"""Renders views with Blender. No other package imports bpy."""
