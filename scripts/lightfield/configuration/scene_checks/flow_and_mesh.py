"""Checks flow and meshes, which follow from one scene and its depth."""

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks.names import check_rigs


def check_mesh(blocks: SceneBlocks) -> None:
    """Check that there is a scene to read, and that the mesh's rigs exist."""
    if blocks.mesh is None:
        return
    if blocks.scene.dataset:
        raise ValueError("mesh: does not go with scene.dataset, which has no scene to read")
    check_rigs(blocks, "mesh.rigs", blocks.mesh.rigs or ())


def check(blocks: SceneBlocks) -> None:
    """Check that all views show one scene, and that flow has depth."""
    for key in ("flow", "mesh"):
        if getattr(blocks, key) is not None and blocks.scene.followed_camera == "view":
            raise ValueError(
                f"{key}: needs one scene for all views, but scene.followed_camera is view"
            )
    if blocks.flow and blocks.render and blocks.render.depth == "none":
        raise ValueError("flow: follows from depth, but render.depth is none")
