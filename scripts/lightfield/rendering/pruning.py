"""What of a scene is left out of its rendering, because no pixel depends on it.

Only what keeps every byte of every view is left out, so none of it enters the render key, and only
what saves measurably: benchmarks/pruning.py measures each of these, and what was tried and is not
here (bounces of volumes, of transmission and of transparency where there are none: nothing saved).
"""

from collections.abc import Mapping
from typing import Any

REASONS = {
    "viewport": "nobody looks at the viewport: its copy of the scene is not kept",
    "hidden_objects": "objects that no render shows and nothing else refers to are unloaded",
    "motion_blur": "nothing moves: the scene is not evaluated at the shutter's opening and closing",
    "animation": "a dataset shows one frame: the scene is not evaluated anew for each view",
}


def left_out(inventory: Mapping[str, Any]) -> list[str]:
    """Decide from a scene's inventory which of `REASONS` apply to it."""
    blurred = bool(inventory["motion_blur"] and inventory["moving"])
    applies = {
        "viewport": True,
        "hidden_objects": bool(inventory["hidden"]),
        "motion_blur": inventory["motion_blur"] and not blurred,
        # What is blurred has to move while its view is rendered.
        "animation": bool(inventory["animated"]) and not blurred,
    }
    return [name for name in REASONS if applies[name]]
