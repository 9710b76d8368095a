"""Readers of model files apart from Blender's importers, and the comparison with its scene."""
