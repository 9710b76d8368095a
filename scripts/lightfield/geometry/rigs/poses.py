"""Loose poses: cameras as a file has them, a lightfield.json or a CSV."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.geometry.rigs.rig import Rig, UnitPoses
from lightfield.geometry.rotations import Floats

CSV_HEADER = ["name", "x", "y", "z", "rx", "ry", "rz"]
LF_TYPES = ("PLANE", "CUBOID", "CYLINDER", "SPHERE")


class Poses(Rig):
    """``max_views`` is for no scene YAML: a preset has thinned the rig to an even subset."""

    shape = "PLANE"

    type: Literal["poses"]
    file: str = Field(
        pattern=r"\.(json|csv)$",
        description="A lightfield.json, or a CSV of name,x,y,z,rx,ry,rz.",
    )
    max_views: SkipJsonSchema[int | None] = None

    @property
    def positions(self) -> int:
        return len(self._rows(len(_read_poses(Path(self.file))[1])))

    @property
    def lf_type(self) -> str:
        """That of its file."""
        return _read_poses(Path(self.file))[0]

    def unit_poses(self) -> UnitPoses:
        _, names, positions, rotations = _read_poses(Path(self.file))
        rows = self._rows(len(names))
        return UnitPoses([names[row] for row in rows], rows, positions[rows], rotations[rows])

    def _thinned_to(self, positions: int) -> Self | None:
        return self.model_copy(update={"max_views": positions}) if positions else None

    def _rows(self, count: int) -> NDArray[np.int64]:
        """Return which rows of the file are used: all, or ``max_views`` spread evenly."""
        views = min(self.max_views or count, count)
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
    keys = CSV_HEADER
    yield Poses.shape
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
    lf_type = content.get("lf_type", Poses.shape)
    if lf_type not in LF_TYPES:
        allowed = ", ".join(LF_TYPES)
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
