"""Builds a scene with one of the builders in scripts/scenes/."""

import importlib

from lightfield.core.files import atomic_path
from lightfield.rendering import blend_file
from lightfield.stages.scene import BuildScene


def build(job: BuildScene) -> None:
    """Build the scene of the settings, and save it as a .blend."""
    builder = importlib.import_module(f"scenes.{job.settings.builder}")
    blend_file.new_scene()
    builder.build(job.settings.parameters.model_dump())
    with atomic_path(job.output) as temporary:
        blend_file.save_scene(temporary)
