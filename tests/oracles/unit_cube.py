"""Checks that instant-ngp's unit cube lies where the options of a transforms.json want it.

The loader maps a point p of its world to ``scale`` · p + ``offset``. The options say where both
come from: the user, a fit to the rig, or a fit to what the views see. A rig of test views has the
cube of the rig that trains.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.formats.layout import ImageSet
from oracles.readers import instant_ngp
from oracles.readers.contents import FLOAT32, Floats, UnitCube, same

# A rig that does not look inward takes this part of the cube's side, if nothing else is given.
RIG_PART = 0.2
MIDDLE = 0.5
# The cube holds what lies between these percentiles of the seen points along each axis.
SEEN_PERCENTILES = (5, 95)


def is_of_rig(cube: UnitCube, image_set: ImageSet, other_rigs: Mapping[str, Path]) -> bool:
    """Return whether a cube must fit this rig. A rig of test views has the cube of another rig.

    ``other_rigs`` are the datasets of the scene's other rigs, by their names. If none of them has a
    transforms.json, the training rig is not here. Then the cube may belong to it.
    """
    if not all(view.split in ("validation", "test") for view in image_set.lightfield.views):
        return True
    paths = [folder / image_set.name / "transforms.json" for folder in other_rigs.values()]
    existing_paths = [path for path in paths if path.is_file()]
    return bool(existing_paths) and not any(_has_cube(path, cube) for path in existing_paths)


def _has_cube(path: Path, cube: UnitCube) -> bool:
    try:
        other = instant_ngp.read(path).cube
    except UserError:
        return False  # The validation of that dataset reports it.
    return bool(other and same(cube.scale, other.scale) and same(cube.offset, other.offset))


def faults(cube: UnitCube, matrices: Floats) -> Iterator[str]:
    """Yield what is wrong with a cube that is not fitted to what views (n, 4, 4) see."""
    cameras = in_cube(cube, matrices[:, :3, 3])
    limit = _limit(cube)
    if cube.option_scale is None or cube.option_place is None:
        if not (_rig_in_middle(cameras, limit) or _looks_inward(cube, matrices, limit)):
            yield f"{cube.place}: scale, offset: do not put the rig into the middle of the cube"
        return
    if not same(cube.scale, cube.option_scale):
        yield f"{cube.place}: scale: is {cube.scale}, but its options have {cube.option_scale}"
    shift = np.abs(cameras.mean(axis=0) - cube.option_place).max()
    if not shift <= limit:
        yield f"{cube.place}: offset: puts the mean camera {shift:.2g} beside that of its options"


def seen_faults(cube: UnitCube, cameras: Floats, points: Floats) -> Iterator[str]:
    """Yield what is wrong with a cube for cameras (n, 3) and what they see, points (m, 3)."""
    low, high = np.percentile(in_cube(cube, points), SEEN_PERCENTILES, axis=0)
    places = in_cube(cube, cameras)
    low = np.minimum(low, places.min(axis=0))
    high = np.maximum(high, places.max(axis=0))
    beside = np.abs((low + high) / 2 - MIDDLE).max()
    larger = np.abs((high - low).max() - 1)
    if not (beside <= _limit(cube) and larger <= _limit(cube)):
        yield (
            f"{cube.place}: scale, offset: do not fit the cube to the cameras and nine tenths of "
            "what they see"
        )


def in_cube(cube: UnitCube, points: Floats) -> Floats:
    """Return where the loader puts world points (n, 3), before it cycles the axes."""
    places: Floats = points @ instant_ngp.WORLD.T * cube.scale + cube.offset
    return places


def _limit(cube: UnitCube) -> float:
    """Return what float32 resolves in the cube. Its coordinates are differences of the offset."""
    return 4 * FLOAT32 * float(1 + np.abs(cube.offset).max())


def _rig_in_middle(cameras: Floats, limit: float) -> bool:
    """Return whether cameras (n, 3) fill a fifth of the cube's side, in its middle."""
    low = cameras.min(axis=0)
    high = cameras.max(axis=0)
    beside = np.abs((low + high) / 2 - MIDDLE).max()
    larger = np.abs(np.max(high - low) - RIG_PART)
    return bool(beside <= limit and larger <= limit)


def _looks_inward(cube: UnitCube, matrices: Floats, limit: float) -> bool:
    """Return whether the cube is filled by cameras (n, 4, 4) that look at its middle.

    The middle is then the point nearest to all optical axes, by least squares.
    """
    cameras = in_cube(cube, matrices[:, :3, 3])
    axes = -matrices[:, :3, 2] @ instant_ngp.WORLD.T
    to_middle = MIDDLE - cameras
    along = (to_middle * axes).sum(axis=1, keepdims=True)
    pull = np.abs((to_middle - along * axes).mean(axis=0)).max()
    gap = float(np.max(np.abs(to_middle))) - MIDDLE
    return bool(pull <= limit and abs(gap) <= limit)
