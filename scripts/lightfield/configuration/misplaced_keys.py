"""Says where a key belongs that stands at a wrong place of a scene YAML."""

import re
from collections.abc import Collection

from lightfield.configuration.publication import Publication
from lightfield.configuration.render_settings import Render
from lightfield.configuration.scene_source import SceneSource
from lightfield.geometry.lenses import LENSES
from lightfield.settings.base import Settings

_BLOCKS: dict[str, type[Settings]] = {
    "render": Render,
    "scene": SceneSource,
    "publish": Publication,
}


def with_place(problem: str, top_keys: Collection[str]) -> str:
    """Return what is wrong with a key. An unknown key of another block gets this block's name.

    ``top_keys`` are the keys at the top of a scene YAML.
    """
    # A user's builder decides which parameters there are.
    unknown = re.match(r"(?!scene\.parameters\.)(?:.*\.)?(\w+)(?=: unknown key)", problem)
    place = unknown and _place_of(unknown[1], top_keys)
    if not (unknown and place):
        return problem
    if problem.endswith("?"):
        # Another key of the same block is similar.
        return f"{problem} {unknown[1]} belongs to {place}"
    return f"{unknown[0]}: belongs to {place}"


def _place_of(key: str, top_keys: Collection[str]) -> str | None:
    """Return where a key belongs. None for a key of no block."""
    if key in top_keys:
        return "the top of the file, beside scene"
    for block, model in _BLOCKS.items():
        if key in model.model_fields:
            return block
    lens_settings = [lens.Settings for lens in LENSES.values() if lens.Settings]
    is_of_camera = any(key in settings.model_fields for settings in lens_settings)
    return "camera" if is_of_camera else None
