"""The base class of rigs: settings in the scene YAML, and the names and poses of the views.

A rig places its cameras in a unit box around the origin. The box is scaled by ``size``, rotated by
``rotation`` and moved to ``center``. The rotation turns the cameras, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator
from pydantic.json_schema import SkipJsonSchema
from typing_extensions import TypeAliasType

from lightfield.core.errors import UserError
from lightfield.core.names import Part
from lightfield.geometry.frames import ONE_PLACE
from lightfield.geometry.lenses import CameraSettings, build_settings
from lightfield.geometry.lenses.cube_map import CUBE_FACE_ANGLES
from lightfield.geometry.rigs.mount import HeadCameraSettings, Mount
from lightfield.geometry.rigs.split_setting import Chosen, Split, part_of
from lightfield.geometry.rotations import (
    Floats,
    euler_to_matrix,
    looking_at,
    matrix_to_euler,
)
from lightfield.geometry.spread import spread
from lightfield.settings.base import FARTHEST, Name, Settings, Vector, as_list

# Each type of rig contains all lenses.
build_settings()

Side = Annotated[float, Field(strict=True, ge=0, le=FARTHEST)]
Size = TypeAliasType("Size", Side | Annotated[tuple[Side, Side, Side], as_list(3)])
Frame = Annotated[int, Field(ge=0, le=1048574)]
# What a scene YAML says in place of a size or a center that follow from the scene's box.
FIT = "fit"


@dataclass(frozen=True)
class Pose:
    """One camera of a rig.

    ``number`` is the sequence number within the view's name. ``position`` is in metres.
    ``rotation`` holds Blender's XYZ Euler angles in radians. ``split`` says whether the view
    trains, validates or tests.
    """

    name: str
    number: int
    position: tuple[float, float, float]
    rotation: tuple[float, float, float]
    split: Part | None

    def world_from_camera(self) -> Floats:
        """Return the (4, 4) camera-to-world matrix. The camera looks along −Z, and +Y is up."""
        world_from_camera = np.eye(4)
        world_from_camera[:3, :3] = euler_to_matrix(np.array(self.rotation))
        world_from_camera[:3, 3] = self.position
        return world_from_camera


@dataclass(frozen=True)
class UnitPoses:
    """The cameras of a rig in the unit box, one in each entry.

    ``positions`` (n, 3) reach from −½ to ½. ``rotations`` (n, 3) are XYZ Euler angles in radians.
    """

    names: Sequence[str]
    numbers: NDArray[np.int64]
    positions: Floats
    rotations: Floats

    @classmethod
    def of_sides(cls, *sides: tuple[str, Floats, Floats]) -> Self:
        """Number the cameras of each side from 0. A side is a letter, positions and rotations."""
        return cls(
            [f"view_{side}{i:04d}f" for side, places, _ in sides for i in range(len(places))],
            np.concatenate([np.arange(len(places)) for _, places, _ in sides]),
            np.concatenate([places for _, places, _ in sides]),
            np.concatenate([np.broadcast_to(turns, places.shape) for _, places, turns in sides]),
        )


class Frames(Settings):
    """A range of frames of an animation."""

    first: Frame = Field(description="First frame of the range.")
    last: Frame = Field(
        description="Last frame of the range, which is included if the steps reach it."
    )
    step: int = Field(
        1, ge=1, description="Distance from one frame to the next: 2 takes every second frame."
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.first > self.last:
            raise ValueError(f"first is {self.first}; must be at most last")
        return self

    @property
    def numbers(self) -> range:
        """The frames of the animation to render."""
        return range(self.first, self.last + 1, self.step)

    @property
    def folders(self) -> dict[str, int]:
        """The frames' numbers by the names of their folders in the rig's folder."""
        return {f"f{number:05d}": number for number in self.numbers}


# The eyes of a stereo pair, and the side of each along the camera's +X.
EYES = {"left": -1, "right": 1}


class Stereo(Settings):
    """A pair of cameras at each position."""

    distance: float = Field(
        gt=0,
        le=1000,
        description="Distance between the two cameras, which are on both sides of the position.",
        json_schema_extra={"unit": "m"},
    )
    omnidirectional: bool = Field(
        False,
        description="For panoramas: each eye moves on a circle around the position, so that the "
        "stereo is correct in all directions. Such a view has no single centre, so it cannot have "
        "depth, reprojections or exports.",
    )


def _require_camera(schema: dict[str, Any]) -> None:
    schema["oneOf"] = [{"required": ["camera"]}, {"required": ["head"]}]


class Rig(Settings):
    """The keys that all rigs share. Each type of rig adds its own keys.

    ``shape`` is the type of rig that lightfield.json names: the nearest of SILVR's four.
    """

    shape: ClassVar[Literal["PLANE", "CUBOID", "CYLINDER", "SPHERE"]]
    # Whether the cameras of a row go around z.
    is_round: ClassVar[bool] = False
    # Whether the rig is as large as the box around its cameras, whatever its ``size``.
    is_loose: ClassVar[bool] = False
    # Where the cameras look, unless face_inside or look_at turns them: at the middle, away from
    # it, all along one axis, or each somewhere else.
    looks: ClassVar[Literal["inward", "outward", "ahead", "anywhere"]] = "outward"

    model_config = ConfigDict(json_schema_extra=_require_camera)

    type: str = Field(description="Type of the rig, which says how the cameras are placed.")
    size: Size | Literal["fit"] = Field(
        1,
        description="Size of the rig: one number for all axes, or one each for x, y and z. fit: "
        "it follows from the scene's box, from the rig's type and from its lens.",
        json_schema_extra={"unit": "m"},
    )
    center: Vector | Literal["fit"] = Field(
        (0, 0, 0),
        description="Position of the rig's middle in the world. fit: the middle of the scene's "
        "box, or a place before it if all cameras look one way.",
        json_schema_extra={"unit": "m"},
    )
    rotation: Vector = Field(
        (0, 0, 0),
        description="Rotation of the whole rig around its middle, as XYZ Euler angles.",
        json_schema_extra={"unit": "degrees"},
    )
    face_inside: bool = Field(
        False,
        description="Turn each camera by 180° about its own up axis, so that cameras that look "
        "outward look inward.",
    )
    look_at: Vector | None = Field(
        None,
        description="Point in world coordinates that all cameras look at, upright. Without this "
        "key, they look where the rig's type points them.",
        json_schema_extra={"unit": "m"},
    )
    cube_map: bool = Field(
        False, description="Render six views of 90° at each position, as the faces of a cube."
    )
    stereo: Stereo | None = Field(
        None, description="Render a stereo pair of views at each position."
    )
    frames: Frames | None = Field(
        None,
        description="Render a sequence. Each of these frames of the animation becomes a dataset of "
        "its own.",
    )
    split: Split | None = Field(
        None,
        description="Which views are for training, validation and test. odd: views with odd "
        "sequence numbers are test views. train, validation or test: all views are. A mapping "
        "selects one of n positions, or views by name.",
    )
    # Every rig of a scene YAML has a camera or a head. Code that needs only the places may leave it
    # out.
    camera: CameraSettings = Field(  # type: ignore[assignment]
        None, description="Lens and image of each camera. Required without head."
    )
    head: dict[Name, HeadCameraSettings] | None = Field(
        None,
        min_length=1,
        description="In place of camera: cameras with fixed poses on one body, which the rig "
        "places. Each is a rig of its own, <rig>_<name>, with equal names of views.",
    )
    mount: SkipJsonSchema[Mount | None] = None

    @model_validator(mode="after")
    def _looks_one_way(self) -> Self:
        if self.look_at is not None and (self.face_inside or self.cube_map):
            raise ValueError("look_at: does not go with face_inside or cube_map")
        if self.stereo is not None and self.cube_map:
            raise ValueError("stereo: does not go with cube_map")
        return self

    @model_validator(mode="after")
    def _head_is_whole(self) -> Self:
        if self.head is None:
            return self
        if self.camera is not None:
            raise ValueError("camera: does not go with head, whose cameras have their own")
        if self.stereo is not None or self.cube_map:
            key = "cube_map" if self.cube_map else "stereo"
            raise ValueError(f"{key}: does not go with head; give the head more cameras")
        if self.is_fitted:
            key = "size" if self.size == FIT else "center"
            raise ValueError(f"{key}: fit does not go with head, whose lenses differ; give numbers")
        return self

    @model_validator(mode="after")
    def _fits_if_it_is_free(self) -> Self:
        for key in ("size", "center"):
            if self.is_loose and getattr(self, key) == FIT:
                raise ValueError(
                    f"{key}: fit does not go with type {self.type}, whose places are given; give "
                    "numbers"
                )
        return self

    @property
    def is_fitted(self) -> bool:
        """Whether the size or the center follows from the scene's box.

        Until `fit.fitted` has replaced them by numbers, the size counts as 1 m and the center as
        the origin.
        """
        return FIT in (self.size, self.center)

    @property
    def positions(self) -> int:
        """The number of the cameras' positions."""
        raise NotImplementedError

    def unit_poses(self) -> UnitPoses:
        """Return the cameras in the unit box, in SILVR's order."""
        raise NotImplementedError

    def _thinned_to(self, positions: int) -> Self | None:
        """Return the densest such rig of at most ``positions``. None if the smallest has more."""
        raise NotImplementedError

    @property
    def sequence(self) -> Frames | None:
        """The frames of a sequence, each of which is a dataset."""
        return self.frames

    @property
    def is_omnidirectional(self) -> bool:
        """Whether the rays of a view do not start from one centre."""
        return self.stereo is not None and self.stereo.omnidirectional

    def is_at_one_place(self) -> bool:
        """Return whether the settings put all views at one place.

        Raises `UserError` for a pose file that cannot be read.
        """
        if self.stereo and not self.is_omnidirectional:
            return False
        if self.positions == 1:
            return True
        places = self.to_world(self.unit_poses().positions)
        if self.mount:
            # A body that turns at one place moves its cameras.
            places = np.array([pose.position for pose in self.poses()])
        return bool(np.all(np.ptp(places, axis=0) < ONE_PLACE))

    @property
    def lf_type(self) -> str:
        """What lightfield.json calls the rig."""
        return self.shape

    @property
    def view_count(self) -> int:
        """The number of views. Only a rig of poses reads its file for it."""
        return self.positions * self.views_a_position

    @property
    def views_a_position(self) -> int:
        if self.stereo:
            return len(EYES)
        return len(CUBE_FACE_ANGLES) if self.cube_map else 1

    @property
    def tests_one_of(self) -> int | None:
        """The split's key `every`. None without that key."""
        return self.split.every if isinstance(self.split, Chosen) else None

    def thinned(self, max_views: int) -> Self:
        """Return the densest version of the rig that has at most ``max_views`` views.

        Raises `UserError` if the smallest rig of this type has more views.
        """
        if self.view_count <= max_views:
            return self
        thinner = self._thinned_to(max_views // self.views_a_position)
        if thinner is None:
            raise UserError(f"a rig of type {self.type} cannot have as few as {max_views} views")
        # A split's names refer to the full rig: a thinned rig may give them to other views.
        if isinstance(self.split, Chosen) and self.split.names:
            return thinner.model_copy(update={"split": None})
        return thinner

    def to_world(self, points: Floats) -> Floats:
        """Return points (..., 3) of the unit box in world coordinates, in metres."""
        placed: Floats = points * self.sides @ self.turn.T + self.middle
        return placed

    @property
    def extent(self) -> float | tuple[float, float, float]:
        """The size in metres, as the scene YAML gives it, or as it follows from other keys."""
        return 1.0 if isinstance(self.size, str) else self.size

    @property
    def middle(self) -> Floats:
        """The middle (3,) of the rig in the world, in metres."""
        return np.zeros(3) if isinstance(self.center, str) else np.asarray(self.center, dtype=float)

    @property
    def sides(self) -> Floats:
        """The size (3,) along x, y and z, in metres."""
        return np.broadcast_to(np.asarray(self.extent, dtype=float), 3)

    @property
    def turn(self) -> Floats:
        """The rotation matrix (3, 3) of the whole rig."""
        return euler_to_matrix(np.radians(np.asarray(self.rotation, dtype=float)))

    def poses(self) -> list[Pose]:
        """Return every view's pose, in the order in which SILVR numbers and lists them.

        Raises `UserError` for a pose file that cannot be read.
        """
        unit = self.unit_poses()
        names = unit.names
        numbers = unit.numbers
        rotations = unit.rotations
        positions = self.to_world(unit.positions)
        turn = self.turn
        if self.look_at is not None:
            rotations = matrix_to_euler(looking_at(positions, np.array(self.look_at, float)))
        elif self.face_inside or self.cube_map or np.any(turn != np.eye(3)):
            matrices = turn @ euler_to_matrix(rotations)
            if self.face_inside:
                matrices = matrices @ np.diag([-1.0, 1.0, -1.0])  # half a turn about its own up
            if self.cube_map:
                faces = euler_to_matrix(np.array(list(CUBE_FACE_ANGLES.values())))
                matrices = (matrices[:, None] @ faces).reshape(-1, 3, 3)
                names = [f"{name}_{face}" for name in names for face in CUBE_FACE_ANGLES]
                numbers = np.repeat(numbers, len(CUBE_FACE_ANGLES))
                positions = np.repeat(positions, len(CUBE_FACE_ANGLES), axis=0)
            rotations = matrix_to_euler(matrices)
        if self.stereo:
            aside = euler_to_matrix(rotations)[:, None, :, 0] * self.stereo.distance / 2
            sides = np.array(list(EYES.values()))[:, None]
            # The renderer itself places the eyes of an omnidirectional pair.
            sides = sides * (not self.stereo.omnidirectional)
            positions = (positions[:, None] + sides * aside).reshape(-1, 3)
            names = [f"{name}_{eye}" for name in names for eye in EYES]
            numbers = np.repeat(numbers, len(EYES))
            rotations = np.repeat(rotations, len(EYES), axis=0)
        if self.mount:
            world_from_body = euler_to_matrix(rotations)
            body_from_camera = self.mount.body_from_camera
            positions = positions + world_from_body @ body_from_camera[:3, 3]
            rotations = matrix_to_euler(world_from_body @ body_from_camera[:3, :3])
        tests = self._spread_tests(unit)
        poses = []
        views = zip(names, numbers.tolist(), plain(positions), plain(rotations), strict=True)
        for index, (name, number, position, rotation) in enumerate(views):
            part = part_of(self.split, name, number, index // self.views_a_position in tests)
            poses.append(Pose(name, number, tuple(position), tuple(rotation), part))
        return poses

    def _spread_tests(self, unit: UnitPoses) -> set[int]:
        """Return the positions, by number, of the test views that the split's `every` chooses."""
        if self.tests_one_of is None:
            return set()
        axes = euler_to_matrix(unit.rotations)[..., 2]
        return {*spread(self.to_world(unit.positions), axes, self.tests_one_of)}

    def cells(self) -> list[tuple[int, ...]] | None:
        """Return the cells between neighbouring positions, as indices of the positions.

        None if the cameras span no surface.
        """
        return None

    def middle_row(self, places: Floats) -> list[int]:
        """Return the numbers of the positions in the rig's middle row. Empty without a row.

        ``places`` (n, 3) are the positions in metres, in the rig's own axes.
        """
        return []

    def unit_outline(self) -> list[Floats]:
        """Return the shape on which the cameras lie, as polylines (n, 3) in the unit box."""
        return []

    def outline(self) -> list[Floats]:
        """Return the shape on which the cameras lie, as polylines (n, 3) in world coordinates."""
        return [self.to_world(line) for line in self.unit_outline()]


def plain(values: Floats) -> Any:
    """Return nested lists of floats rounded to 1e-12, without noise such as 6e-17 or −0."""
    return (np.round(values, 12) + 0.0).tolist()


def stack(*coordinates: Floats | float) -> Floats:
    """Return points (n, 3) from coordinates. Each coordinate is (n,), or one number for all."""
    stacked: Floats = np.stack(np.broadcast_arrays(*coordinates), axis=-1)
    return stacked


def circle() -> tuple[Floats, Floats]:
    """Return the coordinates of a closed circle of diameter 1, to draw."""
    angle = np.linspace(0, 2 * np.pi, 73)
    return np.cos(angle) / 2, np.sin(angle) / 2


def ball_outline() -> list[Floats]:
    """Return three circles around a ball of diameter 1, across z, y and x."""
    cosine, sine = circle()
    return [stack(cosine, sine, 0.0), stack(cosine, 0.0, sine), stack(0.0, cosine, sine)]


class CountedRig(Rig):
    """A rig of any number of cameras. With fewer cameras it is still a rig of its type."""

    count: int = Field(
        ge=1, le=100000, description="Number of cameras, or of positions with cube_map or stereo."
    )

    @property
    def positions(self) -> int:
        return self.count

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"count": positions}) if positions else None
