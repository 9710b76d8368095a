"""Builds a scene with one of the builders in scripts/scenes/, or with a user's own."""

import importlib
from pathlib import Path

from lightfield.configuration.scene_source import Parameters
from lightfield.core.files import atomic_path
from lightfield.rendering import blend_file, own_scene
from lightfield.stages.scene import BuildScene


def build(job: BuildScene) -> None:
    """Build the scene of the settings, and save it as a .blend."""
    settings = job.settings
    blend_file.new_scene()
    if isinstance(settings.parameters, Parameters):
        builder = importlib.import_module(f"scenes.{settings.builder}")
        builder.build(settings.parameters.model_dump())
    else:
        own_scene.fill(Path(settings.builder), settings.parameters)
    with atomic_path(job.output) as temporary:
        blend_file.save_scene(temporary)
