"""Builds a scene with one of the builders in scripts/scenes/, or with a user's own."""

import importlib
from pathlib import Path

from lightfield.configuration.keys import builder_fingerprint
from lightfield.configuration.own_builder import is_own
from lightfield.configuration.scene_source import Parameters
from lightfield.core.files import atomic_path
from lightfield.engine.read_files import changed_since_plan
from lightfield.rendering.scenes import blend_file, own_scene
from lightfield.stages.scene import BuildScene, BuildSettings


def build(job: BuildScene) -> None:
    """Build the scene of the settings, and save it as a .blend."""
    settings = job.settings
    _check_builder(settings)
    blend_file.new_scene()
    if isinstance(settings.parameters, Parameters):
        builder = importlib.import_module(f"scenes.{settings.builder}")
        builder.build(settings.parameters.model_dump())
    else:
        own_scene.fill(Path(settings.builder), settings.parameters)
    # Python has read the builder's files meanwhile.
    _check_builder(settings)
    with atomic_path(job.output) as temporary:
        blend_file.save_scene(temporary)


def _check_builder(settings: BuildSettings) -> None:
    """Raise `UserError` if the builder is not as it was when the run was planned."""
    if settings.fingerprint is None:
        return
    if builder_fingerprint(settings.builder, settings.parameters) != settings.fingerprint:
        own = f"scripts/scenes/{settings.builder}, or the library that it uses"
        raise changed_since_plan(settings.builder if is_own(settings.builder) else own)
