"""The motion of a camera in time, and what an inertial sensor (IMU) on it measures.

The sensor's body is the camera's place, with the axes of computer vision: x right, y down, z
forward. It measures the angular rate about these axes, and the specific force along them: the
acceleration without gravity's pull, so a level camera at rest measures +9.81 m/s² upward.
Sources of the noise model: Kalibr's wiki, "IMU noise model"; the EuRoC data set's sensor.yaml.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from lightfield.core.errors import UserError
from lightfield.geometry.rotations import Floats
from lightfield.settings.base import Settings

GRAVITY = 9.81
"""The gravity along −Z of the world, in m/s²."""

BODY_AXES = np.array([1.0, -1.0, -1.0])
"""The signs of the body's axes along the camera's, which are right, up and back."""

# So many samples take 300 MB on disk, and a gigabyte of memory.
_MOST_SAMPLES = 1_000_000
# Below this sine of the angle to the vertical, `looking_at` takes other axes.
_STEEPEST = 1e-4

_Noise = Annotated[float, Field(ge=0, le=1000)]


class Imu(Settings):
    """The camera passes the path once, at constant speed, and carries an inertial sensor."""

    seconds: float = Field(
        gt=0,
        le=1e6,
        description="Time in which the camera passes the whole path. A preset with fewer views "
        "does not change it.",
        json_schema_extra={"unit": "s"},
    )
    rate: float = Field(
        200,
        gt=0,
        le=100_000,
        description="Samples of the sensor in a second.",
        json_schema_extra={"unit": "Hz"},
    )
    gyroscope_noise_density: _Noise = Field(
        0, description="White noise of the angular rate.", json_schema_extra={"unit": "rad/s/√Hz"}
    )
    gyroscope_random_walk: _Noise = Field(
        0,
        description="Random walk of the angular rate's bias, which starts at 0.",
        json_schema_extra={"unit": "rad/s²/√Hz"},
    )
    accelerometer_noise_density: _Noise = Field(
        0, description="White noise of the acceleration.", json_schema_extra={"unit": "m/s²/√Hz"}
    )
    accelerometer_random_walk: _Noise = Field(
        0,
        description="Random walk of the acceleration's bias, which starts at 0.",
        json_schema_extra={"unit": "m/s³/√Hz"},
    )
    seed: int = Field(0, ge=0, le=2**31 - 1, description="Number that chooses the noise.")
    exposure: float | None = Field(
        None,
        gt=0,
        le=1000,
        description="Time of a view's whole exposure. render.camera_motion.rolling needs it, for "
        "the times of the rows.",
        json_schema_extra={"unit": "s"},
    )

    @model_validator(mode="after")
    def _fits_a_file(self) -> Self:
        if self.samples > _MOST_SAMPLES:
            raise ValueError(
                f"rate: gives {self.samples:,} samples in {self.seconds:g} s; must be at most "
                f"{_MOST_SAMPLES:,}"
            )
        return self

    @property
    def samples(self) -> int:
        """The number of samples, of which the first is at time 0."""
        return math.floor(self.seconds * self.rate * (1 + 1e-12)) + 1


@dataclass(frozen=True)
class Motion:
    """The motion of a camera at several times.

    - ``positions`` (n, 3) in m, ``velocities`` (n, 3) in m/s and ``accelerations`` (n, 3) in m/s²
      are in the world.
    - ``world_from_camera`` (n, 3, 3) are rotations.
    - ``rates`` (n, 3) are angular rates in rad/s about the camera's right, up and back.
    """

    positions: Floats
    velocities: Floats
    accelerations: Floats
    world_from_camera: Floats
    rates: Floats


@dataclass(frozen=True)
class Measured:
    """What a sensor measures, and the biases in it. All are (n, 3) in the axes of the body.

    ``rates`` are in rad/s, and ``forces`` in m/s².
    """

    rates: Floats
    forces: Floats
    rate_biases: Floats
    force_biases: Floats


def world_from_body(motion: Motion) -> Floats:
    """Return the rotations (n, 3, 3) of the body."""
    rotations: Floats = motion.world_from_camera * BODY_AXES
    return rotations


def measured(motion: Motion, imu: Imu) -> Measured:
    """Return what a sensor measures at the times k / rate of a motion, for k from 0."""
    felt = motion.accelerations + np.array([0, 0, GRAVITY])
    forces = np.einsum("nij,ni->nj", world_from_body(motion), felt)
    # Later times take no part in the noise of earlier ones.
    draws = np.random.Generator(np.random.Philox(key=imu.seed)).standard_normal((len(forces), 4, 3))
    white = draws[:, :2] * math.sqrt(imu.rate)
    steps = draws[:, 2:] / math.sqrt(imu.rate)
    steps[0] = 0
    biases = np.cumsum(steps, axis=0)
    rate_biases = biases[:, 0] * imu.gyroscope_random_walk
    force_biases = biases[:, 1] * imu.accelerometer_random_walk
    return Measured(
        motion.rates * BODY_AXES + rate_biases + white[:, 0] * imu.gyroscope_noise_density,
        forces + force_biases + white[:, 1] * imu.accelerometer_noise_density,
        rate_biases,
        force_biases,
    )


def upright_rates(rotations: Floats, direction: Floats, change: Floats) -> Floats:
    """Return the angular rates (n, 3) in rad/s of cameras that look along a direction, upright.

    ``rotations`` (n, 3, 3) are the cameras', of `looking_at`. ``direction`` (n, 3) has any length,
    and changes by ``change`` (n, 3) in a second. Raises `UserError` for a camera that looks
    straight up or down, which has no upright position.
    """
    right, up, back = np.moveaxis(rotations, -1, 0)
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    back_change = -(change - back * _dot(back, change)) / length
    # The camera's right is across the vertical and its back.
    slope = np.hypot(back[:, 0], back[:, 1])
    if slope.min() <= _STEEPEST:
        raise UserError(
            "imu: the camera looks straight up or down, where upright is not defined; give each "
            "key a rotation"
        )
    right_change = np.cross([0.0, 0.0, 1.0], back_change) / slope[:, np.newaxis]
    rates = [-_dot(up, back_change), _dot(right, back_change), _dot(up, right_change)]
    return np.concatenate(rates, axis=-1)


def _dot(first: Floats, second: Floats) -> Floats:
    """Return the scalar products (n, 1) of vectors (n, 3)."""
    return np.asarray(np.sum(first * second, axis=-1, keepdims=True))
