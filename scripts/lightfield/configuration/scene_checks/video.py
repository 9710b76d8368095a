"""Checks the video of a dataset, which is synthesised from views of one scene and their depth."""

import shutil

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks.exports import renders_depth
from lightfield.configuration.scene_checks.names import check_rigs


def check(blocks: SceneBlocks) -> None:
    """Check that the video's rigs exist, and that their views have depth and show one scene."""
    if blocks.video is None:
        return
    names = blocks.video.rigs or [*blocks.rigs]
    check_rigs(blocks, "video.rigs", names)
    if blocks.scene.followed_camera == "view":
        raise ValueError("video: needs one scene for all views, but scene.followed_camera is view")
    for name in names:
        rig = blocks.rigs[name]
        if rig.is_omnidirectional or not renders_depth(blocks, rig):
            raise ValueError(f"video: needs depth, which the views of {name} lack")
    if blocks.video.format == "mp4" and shutil.which("ffmpeg") is None:
        raise ValueError("video.format: mp4 needs ffmpeg, which is not installed; webp does not")
