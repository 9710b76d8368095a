"""The geometry of a reprojection: the lens of the views, and the lenses of their new images."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.configuration.reprojections import Reprojection
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.cube_map import CUBE_FACES
from lightfield.reprojection import lens_map


@dataclass(frozen=True)
class Target:
    """One image to make of each view.

    Its name is the view's name and ``suffix``. ``source_from_target`` (3, 3) turns rays of its
    camera into the source camera's.
    """

    suffix: str
    lens: Lens
    source_from_target: Array


@dataclass(frozen=True)
class ReprojectionGeometry:
    """The lens of the views, the images to make of each, and how they are sampled."""

    source: Lens
    targets: list[Target]
    filter: str
    samples: int

    @classmethod
    def of(cls, settings: Reprojection, source: Lens) -> "ReprojectionGeometry":
        """Return the geometry of views through the lens ``source``."""
        return cls(source, _targets(settings, source), settings.filter, settings.samples)

    def compute(self, target: Target) -> lens_map.LensMap:
        """Compute the lens map of one of the targets."""
        return lens_map.compute(
            self.source, target.lens, target.source_from_target, self.filter, self.samples
        )

    def map_settings(self, target: Target) -> dict[str, Any]:
        """Return what the lens map of one of the targets depends on."""
        return lens_map.settings(
            self.source, target.lens, target.source_from_target, self.filter, self.samples
        )


def _targets(settings: Reprojection, source: Lens) -> list[Target]:
    source_from_target = lens_map.rotation_matrix(*settings.rotation)
    lens = settings.lens(source)
    if not settings.cube_map:
        return [Target("", lens, source_from_target)]
    faces = [
        Target(f"_{name}", lens, source_from_target @ turn) for name, turn in CUBE_FACES.items()
    ]
    return [target for target in faces if _is_seen(target, source)]


def _is_seen(target: Target, source: Lens) -> bool:
    """Return whether the source's image shows any part of a target.

    A fisheye of 180°, for example, shows nothing of the face behind it.
    """
    to_source = _rays_across(target.lens) @ target.source_from_target.T
    # The whole image of a narrow lens may lie between these rays, so test the other way, too.
    to_target = _rays_across(source) @ target.source_from_target
    return _shows_any(source, to_source) or _shows_any(target.lens, to_target)


def _rays_across(lens: Lens) -> Array:
    """Return rays (n, n, 3) of places across an image, almost from edge to edge."""
    # Neighbouring faces share their edges, which show nothing of the other face.
    places = np.linspace(1e-6, 1 - 1e-6, 65)
    return lens.rays(lens.width * places[None, :], lens.height * places[:, None])


def _shows_any(lens: Lens, rays: Array) -> bool:
    """Return whether any of the rays (..., 3) lies in the lens's frame."""
    pixels = lens.pixels(rays)
    # Comparisons with NaN are false.
    inside = (pixels >= 0) & (pixels <= [lens.width, lens.height])
    return bool(inside.all(axis=-1).any())
