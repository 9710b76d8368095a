"""Camera rigs: how many views a rig has, and the name and pose of each. Each type has a file.

Order, names and orientations agree with the SILVR datasets, and with the Blender addon that
rendered them (https://github.com/IDLabMedia/blender-lightfield-addon, ``lightfield_*.py``). Nothing
here needs Blender.
"""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, Field, TypeAdapter

from lightfield.geometry.rigs.blend_camera import BlendCamera
from lightfield.geometry.rigs.cuboid import Cuboid
from lightfield.geometry.rigs.cylinder import Cylinder
from lightfield.geometry.rigs.fit import fitted
from lightfield.geometry.rigs.grid import Grid
from lightfield.geometry.rigs.hemisphere import Hemisphere
from lightfield.geometry.rigs.lattice import Lattice
from lightfield.geometry.rigs.path import Path
from lightfield.geometry.rigs.plane import Plane
from lightfield.geometry.rigs.poses import Poses
from lightfield.geometry.rigs.random import Random
from lightfield.geometry.rigs.rig import Pose, Rig
from lightfield.geometry.rigs.ring import Ring
from lightfield.geometry.rigs.sphere import Sphere
from lightfield.geometry.rigs.spiral import Spiral
from lightfield.settings.base import OTHER_NAMES, checked

__all__ = [
    "AnyRig",
    "BlendCamera",
    "Cylinder",
    "Grid",
    "Path",
    "Plane",
    "Pose",
    "Poses",
    "Random",
    "Rig",
    "Sphere",
    "as_written",
    "fitted",
    "from_settings",
]

OTHER_NAMES.update(
    {"dome": "hemisphere", "wall": "plane", "circle": "ring", "orbit": "ring", "helix": "spiral"}
)

AnyRig = Annotated[
    Plane
    | Cuboid
    | Cylinder
    | Sphere
    | Lattice
    | Hemisphere
    | Ring
    | Spiral
    | Path
    | Random
    | Poses
    | BlendCamera,
    Field(discriminator="type"),
]
_SETTINGS: TypeAdapter[Rig] = TypeAdapter(AnyRig, config=ConfigDict(defer_build=True))


def from_settings(settings: Mapping[str, Any] | Rig, file: str = "rig") -> Rig:
    """Return the rig that a scene YAML's mapping describes. A `Rig` is returned unchanged.

    Raises `UserError` for a wrong key. The error names the ``file``.
    """
    return checked(_SETTINGS, settings, file)


def as_written(rig: Rig) -> dict[str, Any]:
    """Return the keys of a rig that are given, as its scene YAML has them."""
    return rig.model_dump(mode="json", exclude_unset=True, exclude_none=True)
