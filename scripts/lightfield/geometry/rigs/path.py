"""A path: cameras evenly along a smooth curve through key poses."""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from lightfield.core.errors import UserError
from lightfield.geometry.inertia import Imu, Motion, upright_rates
from lightfield.geometry.rigs.rig import CountedRig, UnitPoses
from lightfield.geometry.rotations import Floats, looking_at, matrix_to_euler
from lightfield.settings.base import Settings, Vector, as_list

# The curve's length is measured over this many pieces between two keys. Its error is below 1e-6.
_PIECES = 2000


class Key(Settings):
    """A pose through which the path passes."""

    position: Vector = Field(
        description="A point that the path passes through.", json_schema_extra={"unit": "m"}
    )
    rotation: Vector | None = Field(
        None,
        description="Rotation of the camera at this point, as XYZ Euler angles.",
        json_schema_extra={"unit": "degrees"},
    )
    quaternion_wxyz: Annotated[tuple[float, float, float, float], as_list(4)] | None = Field(
        None, description="Rotation as a quaternion, w first. Give either this or rotation."
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.rotation is not None and self.quaternion_wxyz is not None:
            raise ValueError("quaternion_wxyz: does not go with rotation")
        if self.quaternion_wxyz and not 1e-9 < math.hypot(*self.quaternion_wxyz) < 1e9:
            raise ValueError("quaternion_wxyz: must have a length from 1e-9 to 1e9")
        return self

    @property
    def is_turned(self) -> bool:
        return self.rotation is not None or self.quaternion_wxyz is not None


class Path(CountedRig):
    """If the keys have no rotations, the cameras look along the path, and are upright."""

    shape = "PLANE"
    is_loose = True

    type: Literal["path"]
    keys: list[Key] = Field(
        min_length=2, max_length=1000, description="Poses that the path passes through, in order."
    )
    closed: bool = Field(
        False, description="Whether the path continues from the last key back to the first."
    )
    imu: Imu | None = Field(
        None,
        description="Write what an inertial sensor on the camera measures, and when the camera is "
        "at each view.",
    )

    @model_validator(mode="after")
    def _is_a_path(self) -> Self:
        if len({key.is_turned for key in self.keys}) > 1:
            raise ValueError("keys: must all have a rotation, or none of them")
        steps = np.diff(self._places(), axis=0) * self.sides
        if (np.linalg.norm(steps, axis=-1) < 1e-9).any():
            raise ValueError("keys: two consecutive keys have the same position")
        if self.imu and self.frames:
            raise ValueError("imu: does not go with frames, which repeat the path in each frame")
        return self

    def is_at_one_place(self) -> bool:
        return self.view_count == 1  # No two keys in a row are at one place.

    def unit_poses(self) -> UnitPoses:
        # SciPy takes long to import, and no plan needs it.
        from scipy.interpolate import PchipInterpolator
        from scipy.spatial.transform import Rotation, Slerp

        spline, fine, length = self._curve()
        along = np.linspace(0, length[-1], self.count, endpoint=not self.closed)
        where = PchipInterpolator(length, fine)(along)
        if self.keys[0].is_turned:
            turns = Slerp(length[::_PIECES], Rotation.from_quat(self._quaternions()))(along)
            matrices = turns.as_matrix()
        else:
            ahead = spline(where, 1) * self.sides
            if _turns_back(ahead):
                raise UserError("keys: the path turns back at a camera; give each key a rotation")
            matrices = looking_at(-ahead, np.zeros(3))
        return UnitPoses.of_sides(("", spline(where), matrix_to_euler(matrices)))

    def view_times(self) -> Floats:
        """Return the times (count,) in s at which the camera with the `imu` is at each position."""
        assert self.imu
        return np.linspace(0, self.imu.seconds, self.count, endpoint=not self.closed)

    def motion(self, times: Floats) -> Motion:
        """Return the motion of the camera with the `imu` at ``times`` (n,) in s.

        At `view_times` it has the poses of the views. With stereo, it is between the eyes, with
        cube_map it looks as the face in front, and with a head it is the body's. Raises `UserError`
        where the path has no direction.
        """
        from scipy.interpolate import PchipInterpolator
        from scipy.spatial.transform import Rotation, Slerp

        assert self.imu
        spline, fine, length = self._curve()
        speed = length[-1] / self.imu.seconds
        along = np.clip(times * speed, 0, length[-1])
        where = PchipInterpolator(length, fine)(along)
        ahead = spline(where, 1) * self.sides
        if _turns_back(ahead):
            raise UserError("keys: the path turns back, so its imu would measure a collision")
        metres = np.linalg.norm(ahead, axis=-1, keepdims=True)
        ahead /= metres
        bend = spline(where, 2) * self.sides / metres**2
        # Along itself, a path at constant speed has no acceleration.
        bend -= ahead * np.sum(ahead * bend, axis=-1, keepdims=True)
        positions = self.to_world(spline(where))
        velocities = speed * ahead @ self.turn.T
        if self.look_at is not None:
            target = np.array(self.look_at, float)
            rotations = looking_at(positions, target)
            rates = upright_rates(rotations, target - positions, -velocities)
        elif self.keys[0].is_turned:
            turns = Rotation.from_quat(self._quaternions())
            at_keys = length[::_PIECES]
            rotations = self.turn @ Slerp(at_keys, turns)(along).as_matrix()
            between = (turns[:-1].inv() * turns[1:]).as_rotvec() / np.diff(at_keys)[:, np.newaxis]
            rates = speed * between[np.searchsorted(at_keys[1:-1], along, side="right")]
        else:
            rotations = looking_at(-ahead, np.zeros(3))
            rates = upright_rates(rotations, ahead, speed * bend)
            rotations = self.turn @ rotations
        if self.face_inside:
            rotations = rotations * np.array([-1.0, 1.0, -1.0])
            rates = rates * np.array([-1.0, 1.0, -1.0])
        return Motion(positions, velocities, speed**2 * bend @ self.turn.T, rotations, rates)

    def unit_outline(self) -> list[Floats]:
        spline, fine, _ = self._curve()
        return [spline(fine[:: _PIECES // 20])]

    def _places(self) -> Floats:
        """Return the keys' positions (n, 3). A closed path repeats the first one at the end."""
        keys = [*self.keys, self.keys[0]] if self.closed else self.keys
        return np.array([key.position for key in keys], float)

    def _quaternions(self) -> Floats:
        """Return the keys' rotations (n, 4), the scalar last as SciPy has it."""
        from scipy.spatial.transform import Rotation

        rotations = []
        for key in self.keys:
            if key.quaternion_wxyz is None:
                angles = key.rotation or (0, 0, 0)
                rotations.append(Rotation.from_euler("xyz", angles, degrees=True))
            else:
                rotations.append(Rotation.from_quat(np.roll(key.quaternion_wxyz, -1)))
        if self.closed:
            rotations.append(rotations[0])
        quaternions: Floats = np.array([rotation.as_quat() for rotation in rotations])
        return quaternions

    def _curve(self) -> tuple[Any, Floats, Floats]:
        """Return the curve, many values (n) of its parameter, and the length in metres up to each.

        The curve is a cubic spline with a continuous second derivative. Between two keys its
        parameter grows by the root of their distance (centripetal), which avoids loops between
        unevenly spaced keys. Source: Lee 1989, "Choosing nodes in parametric curve interpolation".
        """
        from scipy.interpolate import CubicSpline

        keys = self._places()
        steps = np.sqrt(np.linalg.norm(np.diff(keys, axis=0), axis=-1))
        knots = np.concatenate([[0], np.cumsum(steps)])
        spline = CubicSpline(knots, keys, bc_type="periodic" if self.closed else "natural")
        fine = np.interp(
            np.arange(_PIECES * (len(knots) - 1) + 1) / _PIECES, np.arange(len(knots)), knots
        )
        pieces = np.linalg.norm(np.diff(spline(fine), axis=0) * self.sides, axis=-1)
        return spline, fine, np.concatenate([[0], np.cumsum(pieces)])


def _turns_back(ahead: Floats) -> bool:
    """Return whether a path's derivative (n, 3) vanishes, so that it has no direction."""
    speed = np.linalg.norm(ahead, axis=-1)
    return bool(np.min(speed) <= 1e-9 * np.max(speed))
