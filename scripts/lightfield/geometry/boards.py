"""Calibration boards: their keys in a scene YAML, their cells, and their corners.

A pattern is a grid of black and white cells. So a mesh with one face for each cell is exact at any
distance. OpenCV draws the markers.

Corners are in the coordinates of the program that reads such boards:

- OpenCV (chessboards and ChArUco): the origin is the pattern's top left corner, x goes right, y
  goes down. Inner corners are numbered row by row, from the top left.
- Kalibr (AprilGrid): the origin is the bottom left corner of tag 0, x goes right, y goes up.
  Tags, and the corners of all tags, are numbered row by row, from the bottom left. Source:
  GridCalibrationTargetAprilgrid.cpp and kalibr_create_target_pdf in github.com/ethz-asl/kalibr.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, model_validator

from lightfield.geometry.rotations import Floats, euler_to_matrix
from lightfield.settings.base import Name, Settings, Vector, as_list, checked

Bools = NDArray[np.bool_]

# OpenCV's dictionaries, and the number of markers in each.
MARKERS = {
    f"DICT_{bits}X{bits}_{count}": count for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)
} | {"DICT_ARUCO_ORIGINAL": 1024, "DICT_ARUCO_MIP_36h12": 250}
APRIL_TAGS = {
    "DICT_APRILTAG_16h5": 30,
    "DICT_APRILTAG_25h9": 35,
    "DICT_APRILTAG_36h10": 2320,
    "DICT_APRILTAG_36h11": 587,
}
_ALL_MARKERS = MARKERS | APRIL_TAGS


def _one_of(names: Mapping[str, int]) -> AfterValidator:
    """Return a validator that takes the names of dictionaries."""

    def check(name: str) -> str:
        if name not in names:
            raise ValueError(f"must be one of {', '.join(names)}")
        return name

    return AfterValidator(check)


_Squares = Annotated[int, Field(strict=True, ge=2, le=50)]
_Tags = Annotated[int, Field(strict=True, ge=1, le=50)]
_Length = Annotated[float, Field(gt=0, le=100)]


@dataclass(frozen=True)
class Pattern:
    """A board's cells, as seen from its front. x goes right, y goes down, in metres.

    ``columns`` (n + 1,) and ``rows`` (m + 1,) are the edges of the cells. ``is_white`` (m, n).
    """

    columns: Floats
    rows: Floats
    is_white: Bools

    @classmethod
    def of_widths(cls, across: Floats, down: Floats, is_white: Bools, margin: float) -> Self:
        """Return the pattern of cells with these widths, with a white ``margin`` around it."""
        around = 1 if margin else 0
        widths = [np.pad(sides, around, constant_values=margin) for sides in (across, down)]
        columns, rows = (np.concatenate([[0.0], np.cumsum(sides)]) for sides in widths)
        return cls(columns, rows, np.pad(is_white, around, constant_values=True))


class Board(Settings):
    """The keys that all boards share."""

    # Whether y goes down in the coordinates of the corners, as OpenCV has it.
    y_is_down: ClassVar[bool] = True

    type: str = Field(description="Type of the board.")
    position: Vector = Field(
        (0, 0, 0),
        description="Position of the board's middle in the world.",
        json_schema_extra={"unit": "m"},
    )
    rotation: Vector = Field(
        (0, 0, 0),
        description="Rotation of the board around its middle, as XYZ Euler angles. Without it, the "
        "board faces up, and its upper edge is towards +y. With [90, 0, 0], it faces −y.",
        json_schema_extra={"unit": "degrees"},
    )
    border: float | None = Field(
        None,
        ge=0,
        le=100,
        description="Width of the white margin around the pattern. Without this key, it is as wide "
        "as a square, or as half a tag.",
        json_schema_extra={"unit": "m"},
    )

    @property
    def margin(self) -> float:
        """The width of the white margin in metres."""
        return self._usual_margin if self.border is None else self.border

    @property
    def _usual_margin(self) -> float:
        raise NotImplementedError

    def pattern(self) -> Pattern:
        """Return the board's cells, with its margin."""
        raise NotImplementedError

    def corners(self) -> Floats:
        """Return the corners (n, 3) in the board's coordinates, in metres, by their ids."""
        raise NotImplementedError

    @property
    def _origin(self) -> tuple[float, float]:
        """The origin of the corners' coordinates: how far right and down in the pattern."""
        return self.margin, self.margin

    @property
    def world_from_middle(self) -> Floats:
        """The matrix (4, 4) from the board's middle to the world. There, y is up, z is in front."""
        matrix = np.eye(4)
        matrix[:3, :3] = euler_to_matrix(np.radians(np.asarray(self.rotation, float)))
        matrix[:3, 3] = self.position
        return matrix

    @property
    def world_from_board(self) -> Floats:
        """The matrix (4, 4) from the coordinates of the corners to the world."""
        pattern = self.pattern()
        middle_from_board = np.diag([1.0, -1.0, -1.0, 1.0]) if self.y_is_down else np.eye(4)
        right, down = self._origin
        middle_from_board[:2, 3] = (
            right - pattern.columns[-1] / 2,
            pattern.rows[-1] / 2 - down,
        )
        return self.world_from_middle @ middle_from_board

    @property
    def world_corners(self) -> Floats:
        """The corners (n, 3) in the world, in metres, by their ids."""
        matrix = self.world_from_board
        placed: Floats = self.corners() @ matrix[:3, :3].T + matrix[:3, 3]
        return placed

    @property
    def front(self) -> Floats:
        """The unit vector (3,) in the world that points away from the board's front."""
        return self.world_from_middle[:3, 2]


class Checkerboard(Board):
    """The keys of boards of squares."""

    squares: Annotated[tuple[_Squares, _Squares], as_list(2)] = Field(
        description="Number of squares across and down. The top left square is black.",
        json_schema_extra={"unit": "squares"},
    )
    square: _Length = Field(description="Side of a square.", json_schema_extra={"unit": "m"})

    @property
    def _usual_margin(self) -> float:
        return self.square

    def corners(self) -> Floats:
        across, down = (np.arange(1, count) for count in self.squares)
        y, x = np.meshgrid(down, across, indexing="ij")
        return np.stack(
            [self.square * x.ravel(), self.square * y.ravel(), np.zeros(x.size)], axis=-1
        )


class Chessboard(Checkerboard):
    """A chessboard. Its corners are the ones that cv2.findChessboardCorners finds."""

    type: Literal["chessboard"]

    def pattern(self) -> Pattern:
        across, down = self.squares
        is_white = np.add.outer(np.arange(down), np.arange(across)) % 2 == 1
        widths = (np.full(across, self.square), np.full(down, self.square))
        return Pattern.of_widths(*widths, is_white, self.margin)


class Charuco(Checkerboard):
    """A ChArUco board: a chessboard with a marker in each white square."""

    type: Literal["charuco"]
    marker: _Length = Field(description="Side of a marker.", json_schema_extra={"unit": "m"})
    dictionary: Annotated[str, _one_of(_ALL_MARKERS)] = Field(
        "DICT_5X5_250",
        description="OpenCV's dictionary of the markers.",
        json_schema_extra={"enum": [*_ALL_MARKERS]},
    )

    @model_validator(mode="after")
    def _markers_fit(self) -> Self:
        if self.marker >= self.square:
            raise ValueError(f"marker: {self.marker:g} m must be smaller than a square")
        across, down = self.squares
        _check_count("squares", across * down // 2, self.dictionary)
        return self

    def pattern(self) -> Pattern:
        across, down = self.squares
        gap = (self.square - self.marker) / 2
        markers = iter(range(across * down))
        blocks = [
            [
                np.pad(_marker(self.dictionary, next(markers), 1), 1, constant_values=True)
                if (row + column) % 2
                else np.zeros((_modules(self.dictionary, 1) + 2,) * 2, np.bool_)
                for column in range(across)
            ]
            for row in range(down)
        ]
        modules = _modules(self.dictionary, 1)
        square = np.concatenate([[gap], np.full(modules, self.marker / modules), [gap]])
        return Pattern.of_widths(
            np.tile(square, across), np.tile(square, down), np.block(blocks), self.margin
        )


class AprilGrid(Board):
    """An AprilGrid as Kalibr has it, with black squares between the corners of tags."""

    y_is_down = False

    type: Literal["aprilgrid"]
    tags: Annotated[tuple[_Tags, _Tags], as_list(2)] = Field(
        description="Number of tags across and down: Kalibr's tagCols and tagRows.",
        json_schema_extra={"unit": "tags"},
    )
    tag: _Length = Field(
        description="Side of a tag's black frame: Kalibr's tagSize.",
        json_schema_extra={"unit": "m"},
    )
    spacing: float = Field(
        0.3,
        gt=0,
        le=10,
        description="Space between tags as a part of a tag's side: Kalibr's tagSpacing.",
        json_schema_extra={"unit": "tags"},
    )
    border_bits: Literal[1, 2] = Field(
        2,
        description="Width of a tag's black frame, in cells. Kalibr expects 2, and OpenCV 1 unless "
        "its markerBorderBits is 2.",
        json_schema_extra={"unit": "cells"},
    )
    dictionary: Annotated[str, _one_of(APRIL_TAGS)] = Field(
        "DICT_APRILTAG_36h11",
        description="OpenCV's dictionary of the tags. Kalibr reads 36h11.",
        json_schema_extra={"enum": [*APRIL_TAGS]},
    )

    @model_validator(mode="after")
    def _tags_exist(self) -> Self:
        across, down = self.tags
        _check_count("tags", across * down, self.dictionary)
        return self

    @property
    def _usual_margin(self) -> float:
        return self.tag / 2

    @property
    def _gap(self) -> float:
        return self.spacing * self.tag

    @property
    def _origin(self) -> tuple[float, float]:
        down = self.tags[1]
        return self.margin + self._gap, self.margin + down * (self._gap + self.tag)

    def pattern(self) -> Pattern:
        across, down = self.tags
        modules = _modules(self.dictionary, self.border_bits)
        tag = np.concatenate([[self._gap], np.full(modules, self.tag / modules)])
        is_white = np.ones((down * (modules + 1) + 1, across * (modules + 1) + 1), np.bool_)
        is_white[:: modules + 1, :: modules + 1] = False
        for number in range(across * down):
            row, column = divmod(number, across)
            top, left = ((modules + 1) * place + 1 for place in (down - 1 - row, column))
            # OpenCV's markers of these dictionaries are AprilTag's, turned by 180°.
            marker = _marker(self.dictionary, number, self.border_bits)[::-1, ::-1]
            is_white[top : top + modules, left : left + modules] = marker
        widths = [np.append(np.tile(tag, count), self._gap) for count in (across, down)]
        return Pattern.of_widths(widths[0], widths[1], is_white, self.margin)

    def corners(self) -> Floats:
        across, down = (self._edges(count) for count in self.tags)
        y, x = np.meshgrid(down, across, indexing="ij")
        return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)

    def _edges(self, count: int) -> Floats:
        """Return where the sides of tags begin and end (2 count,), from the first tag's begin."""
        begins = np.arange(count) * (1 + self.spacing)
        return np.asarray(self.tag * np.stack([begins, begins + 1], axis=-1).ravel())


AnyBoard = Annotated[Chessboard | Charuco | AprilGrid, Field(discriminator="type")]
Boards = dict[Name, AnyBoard]
_BOARDS: TypeAdapter[Boards] = TypeAdapter(Boards, config=ConfigDict(defer_build=True))


def from_settings(content: Mapping[str, Any], file: str) -> dict[str, Board]:
    """Return the boards of a block `targets`, by their names. Raises `UserError` with ``file``."""
    known: Boards = checked(_BOARDS, content, file)
    return {**known}


def _check_count(key: str, needed: int, dictionary: str) -> None:
    """Raise ValueError if a dictionary has too few markers."""
    if needed > _ALL_MARKERS[dictionary]:
        raise ValueError(
            f"{key}: need {needed} markers, but {dictionary} has {_ALL_MARKERS[dictionary]}"
        )


@cache
def _dictionary(name: str) -> Any:
    # Only here, because it takes long to load.
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def _modules(dictionary: str, border_bits: int) -> int:
    """Return how many cells a marker has in a row, with its black frame."""
    return int(_dictionary(dictionary).markerSize) + 2 * border_bits


def _marker(dictionary: str, number: int, border_bits: int) -> Bools:
    """Return which cells of a marker are white, with its black frame."""
    import cv2

    side = _modules(dictionary, border_bits)
    picture = cv2.aruco.generateImageMarker(
        _dictionary(dictionary), number, side, borderBits=border_bits
    )
    return np.asarray(picture > 0)
