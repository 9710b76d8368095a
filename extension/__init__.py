"""Plenoforge Rigs: see and edit the camera rigs of a scene YAML in Blender's viewport."""

from . import panel


def register() -> None:
    panel.register()


def unregister() -> None:
    panel.unregister()
