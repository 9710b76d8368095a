"""Measures the box around what a render of the open scene shows."""

from collections.abc import Sequence

import numpy as np

from lightfield.rendering.inspection import clearance
from lightfield.rendering.scenes import frames
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.settings.base import FARTHEST

# The box is measured in at most this many frames, because each takes time.
_MOST_FRAMES = 8


def measure(rendered_frames: Sequence[float]) -> list[list[float]] | None:
    """Return the least and the largest coordinates of the open scene, in metres.

    The box holds the scene in all ``rendered_frames``, as `clearance.surface_box` has it. None if
    nothing has a surface, or if one is not finite.
    """
    boxes = []
    count = min(len(rendered_frames), _MOST_FRAMES)
    for place in np.linspace(0, len(rendered_frames) - 1, count):
        frames.go_to(rendered_frames[round(place)])
        box = in_render(clearance.surface_box)
        if box is not None:
            boxes.append(box)
    if not boxes:
        return None
    corners = np.array(boxes)
    box = np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
    # A number that is none is beyond every limit.
    return box.round(6).tolist() if (np.abs(box) <= FARTHEST).all() else None
