"""Builds a scene with one of the builders in scripts/scenes/."""

import importlib
from pathlib import Path

from lightfield.configuration.job_settings import BuildSettings
from lightfield.core.files import atomic_path
from lightfield.rendering import blend_file


def write(settings: BuildSettings, output: Path) -> None:
    """Build the scene of the settings, and save it as the .blend ``output``."""
    builder = importlib.import_module(f"scenes.{settings.builder}")
    blend_file.new_scene()
    builder.build(settings.parameters.model_dump())
    with atomic_path(output) as temporary:
        blend_file.save_scene(temporary)
