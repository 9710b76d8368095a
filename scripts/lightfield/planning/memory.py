"""Computes how much memory a rendering process needs, and how many threads each may have."""

import math

# Bytes for each pixel of a view that is rendered. bpy 5.0 took 255 between 64² and 1024².
PIXEL_BYTES = 300
# The same with OpenImageDenoise. bpy 5.0 took 910.
DENOISED_PIXEL_BYTES = 1000
# Bytes for each pixel of a temporary file with all passes in 32-bit floats, and a reserve.
_PASSES_PIXEL_BYTES = 200
# More bytes for each light group: Cycles and its file took 36, and the view's arrays take 30.
_GROUP_PIXEL_BYTES = 70
# More bytes of the temporary file for each light group.
_GROUP_PASS_PIXEL_BYTES = 12
# Bytes for a scene that has not been measured yet.
UNKNOWN_SCENE = 6_000_000_000


def needed(scene: int, pixels: int, denoise: bool, groups: int = 0) -> int:
    """Return the bytes of a process that renders views of this many pixels.

    ``scene`` is the inventory's ``memory_bytes``: the memory for a view of very few pixels. The
    views have this many light ``groups``.
    """
    pixel_bytes = DENOISED_PIXEL_BYTES if denoise else PIXEL_BYTES
    return scene + pixels * (pixel_bytes + groups * _GROUP_PIXEL_BYTES)


def passes_pixel_bytes(groups: int) -> int:
    """Return the bytes for each pixel of a temporary file with all passes and light groups."""
    return _PASSES_PIXEL_BYTES + groups * _GROUP_PASS_PIXEL_BYTES


def threads(cores: int, shards: int, need: int, available: int) -> int:
    """Return how many cores each of this many ``shards`` takes. Each needs ``need`` bytes.

    A shard takes more than one core in two cases. There are fewer shards than cores, or a shard for
    each core would not fit into the ``available`` memory. A tenth is left to other programs.
    """
    shards_that_fit = max(1, int(0.9 * available) // need)
    return max(1, cores // max(1, shards), math.ceil(cores / shards_that_fit))
