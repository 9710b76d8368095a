"""Checks that instant-ngp's unit cube lies where the options of a transforms.json want it.

The loader maps a point p of its world to ``scale`` · p + ``offset``. The options say whether both
were given, or fitted to the rig, or fitted to what the views see. A rig that tests what another one
trains has the cube of that rig.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.validation.files import ImageSet
from lightfield.validation.readers import instant_ngp
from lightfield.validation.readers.contents import FLOAT32, Floats, UnitCube, same

# Of the cube's side the rig takes this part where nothing else is known, unless it looks inward.
RIG_PART = 0.2
MIDDLE = 0.5
# Percent: of what the views see the middle nine tenths along each axis are in the cube.
SEEN = (5, 95)


def is_of_rig(cube: UnitCube, image_set: ImageSet, other_rigs: Mapping[str, Path]) -> bool:
    """Return whether a cube is to fit this rig, and not one that trains what this rig tests.

    ``other_rigs`` are the datasets of the scene's other rigs, by their names. Where none of them
    has a transforms.json, the one that trains is not here, and the cube may be its.
    """
    if not all(view.split in ("validation", "test") for view in image_set.lightfield.views):
        return True
    paths = [folder / image_set.name / "transforms.json" for folder in other_rigs.values()]
    there = [path for path in paths if path.is_file()]
    return bool(there) and not any(_has_cube(path, cube) for path in there)


def _has_cube(path: Path, cube: UnitCube) -> bool:
    try:
        other = instant_ngp.read(path).cube
    except UserError:
        return False  # which the validation of its dataset says
    return bool(other and same(cube.scale, other.scale) and same(cube.offset, other.offset))


def faults(cube: UnitCube, matrices: Floats) -> Iterator[str]:
    """Yield what is wrong with a cube that is not fitted to what views (n, 4, 4) see."""
    cameras = in_cube(cube, matrices[:, :3, 3])
    limit = _limit(cube)
    if cube.asked_scale is None or cube.asked_place is None:
        if not (_rig_in_middle(cameras, limit) or _looks_inward(cube, matrices, limit)):
            yield f"{cube.place}: scale, offset: do not put the rig into the middle of the cube"
        return
    if not same(cube.scale, cube.asked_scale):
        yield f"{cube.place}: scale: is {cube.scale}, but its options have {cube.asked_scale}"
    apart = np.abs(cameras.mean(axis=0) - cube.asked_place).max()
    if not apart <= limit:
        yield f"{cube.place}: offset: puts the mean camera {apart:.2g} beside that of its options"


def seen_faults(cube: UnitCube, cameras: Floats, points: Floats) -> Iterator[str]:
    """Yield what is wrong with a cube for cameras (n, 3) and what they see, points (m, 3)."""
    low, high = np.percentile(in_cube(cube, points), SEEN, axis=0)
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
    """Return world points (n, 3) as the loader has them, less its change of axes."""
    places: Floats = points @ instant_ngp.WORLD.T * cube.scale + cube.offset
    return places


def _limit(cube: UnitCube) -> float:
    """Return what float32 resolves in the cube, whose numbers are differences of the offset."""
    return 4 * FLOAT32 * float(1 + np.abs(cube.offset).max())


def _rig_in_middle(cameras: Floats, limit: float) -> bool:
    """Return whether cameras (n, 3) are a fifth of the cube, in its middle."""
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
