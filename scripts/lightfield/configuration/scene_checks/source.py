"""Checks what the source of a scene needs, and what only a .blend has."""

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.core.names import FILE


def check(blocks: SceneBlocks) -> None:
    """Check that the blocks are there that the source needs."""
    for key in ("render", "rigs"):
        if not blocks.scene.dataset and not getattr(blocks, key):
            raise ValueError(f"is missing the key {key}")
    if blocks.scene.sha256 and not blocks.scene.url:
        raise ValueError(
            "scene.sha256: is only for a file with scene.url; leave it out, because the lock "
            "file beside the scene YAML records it"
        )


def check_render(blocks: SceneBlocks) -> None:
    """Check that ``render`` asks only a .blend for its own settings."""
    if blocks.render and blocks.scene.blend is None:
        if blocks.render.samples == FILE:
            raise ValueError("render.samples: file is only for scene.blend")
        if blocks.render.depth_of_field:
            raise ValueError("render.depth_of_field: is only for scene.blend, whose camera it uses")


def check_looks(blocks: SceneBlocks) -> None:
    """Check that only a .blend's views have its look."""
    if blocks.scene.blend is None:
        for key in blocks.keys_of_file_look:
            raise ValueError(f"{key}: file is only for scene.blend; give it a name such as AgX")
