"""Camera rigs: how many views a rig has, and the name and pose of each.

A rig is the mapping that the scene YAML holds, already checked against its schema. Positions
are made in a unit box centred on the origin, then scaled by ``size``, rotated by ``rotation``
and moved to ``center``; the rotation turns the cameras too, the size does not. Order, names and
orientations are those of the SILVR datasets and of the Blender addon that rendered them
(https://github.com/IDLabMedia/blender-lightfield-addon, ``lightfield_*.py``); the vertices of a
sphere are those of Blender's icosphere, in Blender's order. No Blender is needed here.
"""

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json

LF_TYPE = {
    "plane": "PLANE",
    "cuboid": "CUBOID",
    "cylinder": "CYLINDER",
    "sphere": "SPHERE",
    "lattice": "CUBOID",
    "poses": "PLANE",
}
"""``lf_type`` of lightfield.json for each rig type; a rig of poses keeps the one of its file.

SILVR knows these four types only: a lattice fills a cuboid, and loose poses go as PLANE.
"""

CUBE_FACES = {
    "f": (0.0, 0.0, 0.0),
    "b": (0.0, math.pi, 0.0),
    "l": (0.0, math.pi / 2, 0.0),
    "r": (0.0, -math.pi / 2, 0.0),
    "u": (math.pi / 2, 0.0, 0.0),
    "d": (-math.pi / 2, 0.0, 0.0),
}
"""Faces of a cube map, in order: the XYZ Euler angles that turn the camera about its OWN axes.

The rig's camera itself looks at f; l and r turn it by 90° about its up axis, b by 180°, and
u and d pitch it up and down by 90°.
"""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """One camera of a rig.

    ``number`` is the sequence number within the view's name, ``position`` is in metres and
    ``rotation`` holds Blender's XYZ Euler angles in radians.
    """

    name: str
    number: int
    position: tuple[float, float, float]
    rotation: tuple[float, float, float]

    def matrix(self) -> Floats:
        """Return the (4, 4) camera-to-world matrix; the camera looks along −Z, +Y is up."""
        matrix = np.eye(4)
        matrix[:3, :3] = euler_to_matrix(np.array(self.rotation))
        matrix[:3, 3] = self.position
        return matrix


def view_count(rig: Mapping[str, Any]) -> int:
    """Return the number of views of a rig; only a rig of poses has to read its file."""
    if rig["type"] == "poses":
        positions = len(_chosen_rows(rig, len(_read_poses(Path(rig["file"]))[1])))
    else:
        positions = _positions(rig["type"], _counts(rig))
    return positions * (len(CUBE_FACES) if rig.get("cube_map") else 1)


def poses(rig: Mapping[str, Any]) -> list[Pose]:
    """Return every view's pose, in the order in which SILVR numbers and lists them.

    Raises `UserError` for a pose file that cannot be read.
    """
    names, numbers, positions, rotations = _unit_poses(rig)
    size = np.broadcast_to(np.asarray(rig.get("size", 1.0), dtype=float), 3)
    turn = euler_to_matrix(np.radians(np.asarray(rig.get("rotation", (0, 0, 0)), dtype=float)))
    center = np.asarray(rig.get("center", (0, 0, 0)), dtype=float)
    positions = positions * size @ turn.T + center

    if rig.get("face_inside") or rig.get("cube_map") or np.any(turn != np.eye(3)):
        matrices = turn @ euler_to_matrix(rotations)
        if rig.get("face_inside"):
            matrices = matrices @ np.diag([-1.0, 1.0, -1.0])  # half a turn about its own up axis
        if rig.get("cube_map"):
            faces = euler_to_matrix(np.array(list(CUBE_FACES.values())))
            matrices = (matrices[:, None] @ faces).reshape(-1, 3, 3)
            names = [f"{name}_{face}" for name in names for face in CUBE_FACES]
            numbers = np.repeat(numbers, len(CUBE_FACES))
            positions = np.repeat(positions, len(CUBE_FACES), axis=0)
        rotations = matrix_to_euler(matrices)

    return [
        Pose(name, number, tuple(position), tuple(rotation))
        for name, number, position, rotation in zip(
            names, numbers.tolist(), _plain(positions), _plain(rotations), strict=True
        )
    ]


def thin(rig: Mapping[str, Any], max_views: int) -> dict[str, Any]:
    """Return the densest version of the same rig that has at most ``max_views`` views.

    A sphere gets fewer subdivisions. A grid loses cameras on the axis that has kept the largest
    part of its own, so all axes thin alike; an axis of two or more cameras keeps two (the way
    round a cylinder three) as long as the number of views allows. A rig of poses gets the key
    ``max_views``, and with it an evenly spaced subset of its file. Raises `UserError` where
    even the smallest rig of this type has more views.
    """
    limit = max_views // len(CUBE_FACES) if rig.get("cube_map") else max_views
    if view_count(rig) <= max_views:
        return dict(rig)
    kind = rig["type"]
    if kind == "poses" and limit >= 1:
        return {**rig, "max_views": limit}
    if kind == "sphere":
        for subdivisions in range(rig["subdivisions"] - 1, 0, -1):
            if _positions(kind, (subdivisions,)) <= limit:
                return {**rig, "subdivisions": subdivisions}
    elif kind != "poses":
        full = _counts(rig)
        keep = [3 if kind == "cylinder" and axis == 0 else 2 for axis in range(len(full))]
        for floor in (keep, [1] * len(full)):
            counts = _thinner(kind, full, floor, limit)
            if counts is not None:
                return {**rig, "cameras": counts}
    raise UserError(f"a rig of type {kind} cannot have as few as {max_views} views")


def lf_type(rig: Mapping[str, Any]) -> str:
    """Return lightfield.json's ``lf_type`` of a rig; a rig of poses has that of its file."""
    if rig["type"] == "poses":
        return _read_poses(Path(rig["file"]))[0]
    return LF_TYPE[rig["type"]]


def euler_to_matrix(euler: Floats) -> Floats:
    """Return the rotations (…, 3, 3) of XYZ Euler angles (…, 3): Rz · Ry · Rx, as in Blender."""
    cx, cy, cz = np.moveaxis(np.cos(euler), -1, 0)
    sx, sy, sz = np.moveaxis(np.sin(euler), -1, 0)
    rows = [
        [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
        [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
        [-sy, sx * cy, cx * cy],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_euler(matrix: Floats) -> Floats:
    """Return the XYZ Euler angles (…, 3), in radians, of rotations (…, 3, 3).

    Of the two sets of angles that give a rotation it takes the one with the smaller sum of
    magnitudes, as Blender's Matrix.to_euler does. At gimbal lock the rotation about Z is 0.
    """
    # A fresh zero is positive: rounding noise and -0 must not decide between +π and −π.
    m = np.where(np.abs(matrix) < 1e-15, 0.0, matrix)
    cosine = np.hypot(m[..., 0, 0], m[..., 1, 0])
    locked = cosine < 1e-12

    def angles(sign: float) -> Floats:
        x = np.where(
            locked,
            np.arctan2(-m[..., 1, 2], m[..., 1, 1]),
            np.arctan2(sign * m[..., 2, 1], sign * m[..., 2, 2]),
        )
        # Z from what is left when the turn about X is undone, so that the two agree however
        # near gimbal lock is (Day, "Extracting Euler angles from a rotation matrix").
        sine, cos = np.sin(x), np.cos(x)
        z = np.arctan2(
            sine * m[..., 0, 2] - cos * m[..., 0, 1], cos * m[..., 1, 1] - sine * m[..., 1, 2]
        )
        y = np.arctan2(-m[..., 2, 0], sign * cosine)
        return np.stack([x, y, np.where(locked, 0.0, z)], axis=-1)

    first, second = angles(1.0), angles(-1.0)
    smaller = np.abs(second).sum(-1) < np.abs(first).sum(-1) - 1e-12
    return np.where((smaller & ~locked)[..., None], second, first)


def icosphere(subdivisions: int) -> Floats:
    """Return the vertices (n, 3) of Blender's icosphere of radius 1, in Blender's order.

    Blender cuts each edge of an icosahedron into 2^(subdivisions−1) pieces, in the order of the
    edges, then fills each face with rows between two of its edges, in the order of the faces;
    every new point is projected to the sphere as soon as it is made. Agrees with Blender 5.0 to
    1e-6 for 1 to 7 subdivisions. The first level keeps the icosahedron's rounded coordinates.
    """
    base = np.array(_ICOSAHEDRON) / 200.0
    if subdivisions == 1:
        return base
    pieces = 2 ** (subdivisions - 1)
    steps = np.arange(1, pieces)[:, None] / pieces
    vertices = [_unit(base)]
    for start, end in _EDGES:
        vertices.append(_unit(base[start] + (base[end] - base[start]) * steps))
    for apex, left, right in _FACES:
        row_starts = _unit(base[apex] + (base[left] - base[apex]) * steps)
        row_ends = _unit(base[apex] + (base[right] - base[apex]) * steps)
        for row in range(1, pieces - 1):
            along = np.arange(1, row + 1)[:, None] / (row + 1)
            vertices.append(_unit(row_starts[row] + (row_ends[row] - row_starts[row]) * along))
    return np.concatenate(vertices)


# The icosahedron that Blender starts from: coordinates as rounded in its source
# (bmesh/operators/bmo_primitive.cc), and the orders in which its subdivision visits edges and
# faces, each face from its apex. The tests compare the result with Blender's own.
_ICOSAHEDRON = [
    (0.0, 0.0, -200.0),
    (144.72, -105.144, -89.443),
    (-55.277, -170.128, -89.443),
    (-178.885, 0.0, -89.443),
    (-55.277, 170.128, -89.443),
    (144.72, 105.144, -89.443),
    (55.277, -170.128, 89.443),
    (-144.72, -105.144, 89.443),
    (-144.72, 105.144, 89.443),
    (55.277, 170.128, 89.443),
    (178.885, 0.0, 89.443),
    (0.0, 0.0, 200.0),
]
# fmt: off
_EDGES = [
    (2, 0), (0, 1), (1, 2), (5, 1), (0, 5), (3, 0), (2, 3), (4, 0), (3, 4), (4, 5),
    (10, 1), (5, 10), (6, 2), (1, 6), (7, 3), (2, 7), (8, 4), (3, 8), (9, 5), (4, 9),
    (10, 6), (6, 7), (7, 8), (8, 9), (9, 10), (11, 6), (10, 11), (11, 7), (11, 8), (11, 9),
]
_FACES = [
    (11, 10, 9), (11, 9, 8), (11, 8, 7), (11, 7, 6), (11, 6, 10),
    (10, 5, 9), (9, 4, 8), (8, 3, 7), (7, 2, 6), (6, 1, 10),
    (9, 5, 4), (8, 4, 3), (7, 3, 2), (6, 2, 1), (10, 1, 5),
    (5, 0, 4), (4, 0, 3), (3, 0, 2), (5, 1, 0), (2, 0, 1),
]
# fmt: on


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit


def _plain(values: Floats) -> Any:
    """Return nested lists of floats rounded to 1e-12, without noise such as 6e-17 or −0."""
    return (np.round(values, 12) + 0.0).tolist()


def _counts(rig: Mapping[str, Any]) -> tuple[int, ...]:
    return (rig["subdivisions"],) if rig["type"] == "sphere" else tuple(rig["cameras"])


def _positions(kind: str, counts: tuple[int, ...] | list[int]) -> int:
    """Return how many camera positions a rig of this type has for its counts an axis."""
    if kind == "sphere":
        return int(10 * 4 ** (counts[0] - 1) + 2)
    if kind == "cuboid":
        nx, ny, nz = counts
        return 2 * (nx * nz + ny * nz + nx * ny)
    return math.prod(counts)


def _thinner(kind: str, full: tuple[int, ...], floor: list[int], limit: int) -> list[int] | None:
    """Return counts of at most ``limit`` positions and at least ``floor`` an axis, or None."""
    counts = list(full)
    axes = range(len(full))
    while _positions(kind, counts) > limit:
        shrinkable = [axis for axis in axes if counts[axis] > floor[axis]]
        if not shrinkable:
            return None
        # Among equals the last axis, the vertical one, goes first.
        counts[max(shrinkable, key=lambda axis: (counts[axis] / full[axis], axis))] -= 1
    for axis in axes:
        while counts[axis] < full[axis]:
            counts[axis] += 1
            if _positions(kind, counts) > limit:
                counts[axis] -= 1
                break
    return counts


def _unit_poses(rig: Mapping[str, Any]) -> tuple[list[str], NDArray[np.int64], Floats, Floats]:
    """Return names, sequence numbers, positions in the unit box and Euler angles of a rig."""
    kind = rig["type"]
    if kind == "poses":
        _, names, positions, rotations = _read_poses(Path(rig["file"]))
        rows = _chosen_rows(rig, len(names))
        return [names[row] for row in rows], rows, positions[rows], rotations[rows]
    sides = {
        "plane": _plane,
        "cuboid": _cuboid,
        "cylinder": _cylinder,
        "sphere": _sphere,
        "lattice": _lattice,
    }[kind](_counts(rig))
    names, numbers, places, turns = [], [], [], []
    for side, positions, rotations in sides:
        names += [f"view_{side}{number:04d}f" for number in range(len(positions))]
        numbers.append(np.arange(len(positions)))
        places.append(positions)
        turns.append(np.broadcast_to(rotations, positions.shape))
    return names, np.concatenate(numbers), np.concatenate(places), np.concatenate(turns)


Sides = Iterator[tuple[str, Floats, Floats]]


def _axis(count: int) -> Floats:
    """Return evenly spaced places from −½ to ½; one camera sits in the middle."""
    return np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)


def _grid(columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return the column's and the row's value of each camera, row by row."""
    return np.tile(columns, len(rows)), np.repeat(rows, len(columns))


def _stack(*coordinates: Floats | float) -> Floats:
    stacked: Floats = np.stack(np.broadcast_arrays(*coordinates), axis=-1)
    return stacked


def _plane(counts: tuple[int, ...]) -> Sides:
    across, down = _grid(_axis(counts[0]), -_axis(counts[1]))
    yield "", _stack(across, 0.0, down), np.array([math.pi / 2, 0.0, 0.0])


def _cuboid(counts: tuple[int, ...]) -> Sides:
    x, y, z = (_axis(count) for count in counts)
    level = math.pi / 2
    across, down = _grid(x, -z)
    yield "f", _stack(across, 0.5, down), np.array([level, 0.0, 0.0])
    across, down = _grid(-x, -z)
    yield "b", _stack(across, -0.5, down), np.array([level, 0.0, math.pi])
    across, down = _grid(y, -z)
    yield "l", _stack(-0.5, across, down), np.array([level, 0.0, math.pi / 2])
    across, down = _grid(-y, -z)
    yield "r", _stack(0.5, across, down), np.array([level, 0.0, -math.pi / 2])
    across, down = _grid(-x, y)
    yield "u", _stack(across, down, 0.5), np.array([math.pi, 0.0, 0.0])
    across, down = _grid(x, -y)
    yield "d", _stack(across, down, -0.5), np.array([0.0, 0.0, 0.0])


def _cylinder(counts: tuple[int, ...]) -> Sides:
    angle, down = _grid(2 * np.pi * np.arange(counts[0]) / counts[0], -_axis(counts[1]))
    positions = _stack(0.5 * np.sin(angle), 0.5 * np.cos(angle), down)
    yield "", positions, _stack(math.pi / 2, 0.0, -angle)


def _sphere(counts: tuple[int, ...]) -> Sides:
    vertices = icosphere(counts[0])
    normal = _unit(vertices)
    side = np.cross([0.0, 0.0, 1.0], normal)
    poles = np.linalg.norm(side, axis=-1) <= 1e-4
    side[poles] = np.cross([0.0, 1.0, 0.0], normal[poles])
    side = _unit(side)
    up = np.cross(side, normal)
    yield "", 0.5 * vertices, matrix_to_euler(np.stack([-side, -up, -normal], axis=-1))


def _lattice(counts: tuple[int, ...]) -> Sides:
    x, y, z = (_axis(count) for count in counts)
    across, layer = _grid(x, np.repeat(-z, len(y)))
    back = np.tile(np.repeat(y, len(x)), len(z))
    yield "", _stack(across, back, layer), np.array([math.pi / 2, 0.0, 0.0])


def _chosen_rows(rig: Mapping[str, Any], count: int) -> NDArray[np.int64]:
    """Return which rows of a pose file are used: all, or ``max_views`` spread evenly."""
    views = min(rig.get("max_views", count), count)
    rows: NDArray[np.int64] = np.round(np.linspace(0, count - 1, views)).astype(np.int64)
    return rows


def _read_poses(path: Path) -> tuple[str, list[str], Floats, Floats]:
    """Return lf_type, names, positions and Euler angles from a lightfield.json or a CSV."""
    rows = _csv_rows(path) if path.suffix.lower() == ".csv" else _json_rows(path)
    lf_type = next(rows)
    names: list[str] = []
    numbers = []
    seen = set()
    for where, name, values in rows:
        if not isinstance(name, str) or not name or "/" in name or "\\" in name:
            raise UserError(f"{path}: {where}: name: must be a file name, not {name!r}")
        if name in seen:
            raise UserError(f"{path}: {where}: name: {name!r} is there twice")
        seen.add(name)
        names.append(name)
        numbers.append([_number(path, f"{where}: {key}", value) for key, value in values])
    if not names:
        raise UserError(f"{path}: holds no pose")
    table = np.array(numbers)
    return lf_type, names, table[:, :3], table[:, 3:]


def _number(path: Path, where: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or isinstance(value, bool):
        raise UserError(f"{path}: {where}: must be a finite number, not {value!r}")
    return number


def _csv_rows(path: Path) -> Iterator[Any]:
    """Yield lf_type, then (where, name, [(key, value)]) of each row; angles in radians."""
    keys = ["name", "x", "y", "z", "rx", "ry", "rz"]
    yield LF_TYPE["poses"]
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            if header != keys:
                raise UserError(
                    f"{path}: row 1: must be {','.join(keys)} (metres, radians), "
                    f"not {','.join(header)}"
                )
            for row in reader:
                if not row:
                    continue
                where = f"row {reader.line_num}"
                if len(row) != len(keys):
                    raise UserError(f"{path}: {where}: has {len(row)} values, not {len(keys)}")
                yield where, row[0], list(zip(keys[1:], row[1:], strict=True))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: is not CSV: {error}") from None


def _json_rows(path: Path) -> Iterator[Any]:
    """Yield lf_type, then (where, name, [(key, value)]) of each frame of a lightfield.json."""
    content = read_json(path)
    frames = content.get("frames") if isinstance(content, dict) else None
    if not isinstance(frames, list):
        raise UserError(f"{path}: frames: must be a list of views")
    lf_type = content.get("lf_type", LF_TYPE["poses"])
    if lf_type not in LF_TYPE.values():
        allowed = ", ".join(dict.fromkeys(LF_TYPE.values()))
        raise UserError(f"{path}: lf_type: must be one of {allowed}, not {lf_type!r}")
    yield lf_type
    for index, frame in enumerate(frames):
        where = f"frames[{index}]"
        if not isinstance(frame, dict):
            raise UserError(f"{path}: {where}: must be a mapping, not {frame!r}")
        values = []
        for key in ("position", "rotation"):
            vector = frame.get(key)
            if not isinstance(vector, list) or len(vector) != 3:
                raise UserError(f"{path}: {where}: {key}: must be three numbers, not {vector!r}")
            values += [(f"{key}[{axis}]", value) for axis, value in enumerate(vector)]
        yield where, frame.get("name"), values
