"""How much memory a process needs that renders views, and how many threads each may have."""

import math

# Bytes a pixel takes while a view is rendered, plain and with OpenImageDenoise: measured with
# bpy 5.0 between 64² and 1024², 255 and 910, and rounded up.
PIXEL_BYTES = 300
DENOISED_PIXEL_BYTES = 1000
# Of all passes of a view in 32-bit floats in a temporary file, at most, and some room for others.
PASSES_PIXEL_BYTES = 200
# Of a scene that nobody has measured yet.
UNKNOWN_SCENE = 6_000_000_000


def needed(scene: int, pixels: int, denoise: bool) -> int:
    """Return the bytes of a process that renders views of so many pixels.

    ``scene`` is what it takes for a view of hardly any pixels: ``memory_bytes`` of the inventory.
    """
    return scene + pixels * (DENOISED_PIXEL_BYTES if denoise else PIXEL_BYTES)


def threads(cores: int, shards: int, need: int, available: int) -> int:
    """Return how many cores each of so many ``shards`` takes, each of which ``need``s memory.

    One, or more where there are fewer shards than cores, or where what would run at once on all
    cores does not fit into the memory that is ``available``. Of that a tenth is left to others.
    """
    at_once = max(1, int(0.9 * available) // need)
    return max(1, cores // max(1, shards), math.ceil(cores / at_once))
