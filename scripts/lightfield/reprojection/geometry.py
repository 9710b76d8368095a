"""The geometry of a reprojection: the lens of the views, and the lenses of their new images."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.dataset.reprojections import ReprojectionSettings
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.reprojection import lens_map


@dataclass(frozen=True)
class Target:
    """One image to make of each view.

    Its name is the view's name and ``suffix``. ``rotation`` (3, 3) turns rays of its camera into
    the source camera's.
    """

    suffix: str
    lens: Lens
    rotation: Array


@dataclass(frozen=True)
class Geometry:
    """The lens of the views, the images to make of each, and how they are sampled."""

    source: Lens
    targets: list[Target]
    filter: str
    samples: int

    @classmethod
    def of(cls, settings: ReprojectionSettings, source: Lens) -> "Geometry":
        """Return the geometry of views through the lens ``source``."""
        return cls(source, _targets(settings, source), settings.filter, settings.samples)

    def compute(self, target: Target) -> lens_map.LensMap:
        """Compute the lens map of one of the targets."""
        return lens_map.compute(
            self.source, target.lens, target.rotation, self.filter, self.samples
        )

    def map_settings(self, target: Target) -> dict[str, Any]:
        """Return what the lens map of one of the targets depends on."""
        return lens_map.settings(
            self.source, target.lens, target.rotation, self.filter, self.samples
        )


def _targets(settings: ReprojectionSettings, source: Lens) -> list[Target]:
    rotation = lens_map.rotation_matrix(*settings.rotation)
    lens = settings.lens(source)
    if not settings.cube_map:
        return [Target("", lens, rotation)]
    faces = [Target(f"_{name}", lens, rotation @ turn) for name, turn in CUBE_FACES.items()]
    return [target for target in faces if _is_seen(target, source)]


def _is_seen(target: Target, source: Lens) -> bool:
    """Return whether the source sees any part of a target.

    A fisheye of 180°, for example, sees nothing of the face behind it.
    """
    rays = target.lens.resized(64, 64).pixel_rays() @ target.rotation.T
    if np.isfinite(source.pixels(rays)).any():
        return True
    # The whole image of a narrow lens may lie between these rays.
    pixels = target.lens.pixels(source.fitted(64).pixel_rays() @ target.rotation)
    return bool(((pixels >= 0) & (pixels <= target.lens.width)).all(axis=-1).any())
