"""Checks a family with the blocks of its members."""

from lightfield.configuration.scene_blocks import SceneBlocks


def check(blocks: SceneBlocks) -> None:
    """Check that a job can build the members of a family one after the other."""
    family = blocks.family
    if family is None:
        return
    if family.seeds and not blocks.scene.builder:
        raise ValueError("family.seeds: needs scene.builder")
    if blocks.render and blocks.render.target_error is not None:
        raise ValueError("render.target_error: does not go with family; give samples")
    for key in ("flow", "mesh"):
        if getattr(blocks, key) is not None:
            raise ValueError(f"{key}: does not go with family")
    if blocks.publish:
        raise ValueError("publish: does not go with family; its corpus has the licence and credit")
    for name, rig in blocks.rigs.items():
        if rig.sequence:
            raise ValueError(f"rigs.{name}.frames: does not go with family")
