"""Scene flow: for each view an EXR with X, Y, Z in metres, and V, which is 1 where it is known."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import reading
from lightfield.imaging import images
from oracles.readers.contents import Exported, Flow


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the flow of all frames but the last, which has none."""
    exported = [Exported() for _ in frames]
    for index, (frame, following) in enumerate(pairwise(frames)):
        if frames[following] != frames[frame] + 1:
            exported[index].faults.append(f"{listing}: {frame}: is not followed by its next frame")
        paths = sorted((listing.parent / frame).glob("*"))
        exported[index].flows = [Flow(path, path.stem) for path in paths]
        for path in paths:
            exported[index].faults += _faults(path, size)
    return exported


def _faults(path: Path, size: tuple[int, int]) -> list[str]:
    """Return what is wrong with a file by itself."""
    with reading(path, "scene flow"):
        channels = images.read_image(path, list("XYZV")).channels
    flow = np.stack([channels[axis] for axis in "XYZ"], axis=-1)
    validity = channels["V"]
    faults = []
    if validity.shape[::-1] != size:
        faults.append(
            f"{path}: is {' × '.join(map(str, validity.shape[::-1]))} pixels, not as its view"
        )
    if not np.isin(validity, (0, 1)).all():
        faults.append(f"{path}: V: is not 0 or 1 everywhere")
    if not np.isfinite(flow).all() or flow[validity == 0].any():
        faults.append(f"{path}: X, Y, Z: are not finite, or not 0 where V is 0")
    return faults
