"""The cube map: six perspective faces."""

import math
from dataclasses import dataclass

import numpy as np

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import SENSOR_WIDTH, Array, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import euler_to_matrix

CUBE_FACE_ANGLES = {
    "f": (0.0, 0.0, 0.0),
    "b": (0.0, math.pi, 0.0),
    "l": (0.0, math.pi / 2, 0.0),
    "r": (0.0, -math.pi / 2, 0.0),
    "u": (math.pi / 2, 0.0, 0.0),
    "d": (-math.pi / 2, 0.0, 0.0),
}
"""Faces in order: the XYZ Euler angles that turn the cube map's camera to each.

A cuboid rig's sides have the same names and directions:

- f looks along −Z, b along +Z, l along −X and r along +X; these have +Y up;
- u looks along +Y and has +Z up;
- d looks along −Y and has −Z up.
"""
CUBE_FACES: dict[str, Array] = {
    # Without noise such as 6e-17 or −0.
    name: np.round(euler_to_matrix(np.array(angles))) + 0.0
    for name, angles in CUBE_FACE_ANGLES.items()
}
"""Faces in order: the rotation (3, 3) from each face's camera to the cube map's."""


@dataclass(frozen=True, kw_only=True)
class CubeMap(Lens):
    """Six square rectilinear faces of 90°, side by side in the order f b l r u d.

    On disk each face is an image of its own. In memory they form one strip, six times as wide as
    high. Face i begins at column i · height. A kernel must not reach across a face's border, where
    the strip's neighbours are not neighbours in space. Source: Greene 1986.
    """

    name = "cube_map"
    title = "cube map"
    camera_types = ("CUBE_MAP",)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.principal_point is not None:
            raise UserError("principal_point: a cube map has none")
        if self.width != 6 * self.height:
            raise UserError(
                f"resolution: {self.width} × {self.height} is not a cube map's; "
                f"its width is 6 times its height, so {6 * self.height} × {self.height}"
            )

    @property
    def face(self) -> Rectilinear:
        """The lens of one face."""
        return Rectilinear(width=self.height, height=self.height, focal_length=SENSOR_WIDTH / 2)

    def _rays(self, x: Array, y: Array) -> Array:
        size = self.height
        x, y = np.broadcast_arrays(x, y)
        with np.errstate(invalid="ignore"):
            inside = (x >= 0) & (x <= self.width) & (y >= 0) & (y <= size)
        index = np.minimum(np.where(inside, x, 0) // size, 5).astype(np.intp)
        local = self.face.rays(x - (index * size).astype(x.dtype), y)
        rotations = np.stack(list(CUBE_FACES.values())).astype(x.dtype)
        ray = (rotations[index] @ local[..., None])[..., 0]
        ray[~inside] = np.nan
        return np.asarray(ray)

    def _pixels(self, rays: Array) -> Array:
        rotations = [rotation.astype(rays.dtype) for rotation in CUBE_FACES.values()]
        out = np.full((*rays.shape[:-1], 2), np.nan, rays.dtype)
        with np.errstate(invalid="ignore"):
            # A ray meets the face whose axis is nearest to it.
            index = np.argmax(np.stack([-(rays @ r[:, 2]) for r in rotations]), axis=0)
            for i, rotation in enumerate(rotations):
                chosen = index == i
                x, y = np.moveaxis(self.face.pixels(rays[chosen] @ rotation), -1, 0)
                # Rounding must not carry a pixel to the next face of the strip, which is no
                # neighbour in space.
                first, end = np.asarray([i, i + 1], rays.dtype) * self.height
                out[chosen, 0] = np.clip(x + first, first, np.nextafter(end, first))
                out[chosen, 1] = np.clip(y, 0, self.height)
        return out

    @property
    def has_z_depth(self) -> bool:
        return False
