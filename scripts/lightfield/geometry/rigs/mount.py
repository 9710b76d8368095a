"""Where the cameras of a head sit on the body that carries them.

The body has the axes of a camera: it looks along −Z, +Y is up, and +X is right.
"""

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses import CameraSettings, build_settings
from lightfield.geometry.rotations import Floats, euler_to_matrix
from lightfield.settings.base import Settings, Vector

# The cameras of a head contain all lenses.
build_settings()


class Mounting(Settings):
    """The pose of a camera on a body."""

    position: Vector = Field(
        (0, 0, 0),
        description="Place of the camera in the body's axes: right, up and back.",
        json_schema_extra={"unit": "m"},
    )
    rotation: Vector = Field(
        (0, 0, 0),
        description="Rotation of the camera in the body's axes, as XYZ Euler angles. [0, 180, 0] "
        "looks back.",
        json_schema_extra={"unit": "degrees"},
    )

    @property
    def body_from_camera(self) -> Floats:
        """The matrix (4, 4) from the camera's axes to the body's, in metres."""
        matrix = np.eye(4)
        matrix[:3, :3] = euler_to_matrix(np.radians(np.asarray(self.rotation, dtype=float)))
        matrix[:3, 3] = self.position
        # Without noise such as 1e-16.
        return np.asarray(np.round(matrix, 15) + 0.0)


class HeadCameraSettings(Mounting):
    """One of the cameras of a head."""

    camera: CameraSettings = Field(description="Lens and image of the camera.")


class Mount(Mounting):
    """The mounting of a rig's camera on the ``head`` that it belongs to, by its ``name`` there.

    It is not for scene YAMLs: the key `head` of a rig becomes rigs with mounts.
    """

    head: str
    name: str
