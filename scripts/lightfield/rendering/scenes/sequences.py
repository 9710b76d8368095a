"""Finds the files of a numbered sequence that a render reads."""

import math
import re
from collections.abc import Sequence, Set
from pathlib import Path
from typing import Any

import bpy


def number_of(file: Path) -> int | None:
    """Return the number at the end of a file's name. None without a number."""
    digits = re.search(r"\d+$", file.stem.removesuffix(".bobj"))
    return int(digits[0]) if digits else None


def files_of_volume(volume: Any, first: Path, frames: Sequence[float]) -> list[Path]:
    """Return the files of a sequence of VDBs that are shown at the ``frames``.

    ``first`` is any file of the sequence.
    """
    render = bpy.context.scene.render
    # Blender may stretch the time.
    times = [frame * render.frame_map_new / render.frame_map_old for frame in frames]
    numbers = {_number_in_volume(volume, math.floor(time)) for time in times}
    return _numbered(first, {number for number in numbers if number is not None})


def files_of_image(users: Sequence[Any], first: Path, frames: Sequence[float]) -> list[Path]:
    """Return the files of a sequence of pictures that are shown at the ``frames``.

    ``users`` are the settings with which nodes and textures read it.
    """
    wholes = [math.floor(frame) for frame in frames]
    return _numbered(first, {_number_of_picture(user, whole) for user in users for whole in wholes})


def _numbered(first: Path, numbers: Set[int]) -> list[Path]:
    """Return the files of a sequence with some numbers. The last digits of a name are a number."""
    digits = re.search(r"(\d+)\D*$", first.stem)
    if not digits:
        return [first]
    head, tail = first.stem[: digits.start(1)], first.stem[digits.end(1) :]
    width = len(digits[1])
    return [
        first.with_name(f"{head}{number:0{width}}{tail}{first.suffix}")
        for number in sorted(numbers)
    ]


def _number_of_picture(user: Any, frame: int) -> int:
    """Return the number of the file that a sequence of pictures shows at a frame."""
    length = user.frame_duration
    if not length:
        return 0
    place = frame - user.frame_start + 1
    if user.use_cyclic:
        place = (place - 1) % length + 1
    return int(min(max(place, 0), length) + user.frame_offset)


def _number_in_volume(volume: Any, frame: int) -> int | None:
    """Return the number of the file that a sequence of VDBs shows at a frame. None for nothing."""
    length = volume.frame_duration
    place = frame - volume.frame_start
    if not length:
        return None
    match volume.sequence_mode:
        case "CLIP" if not 0 <= place < length:
            return None
        case "EXTEND":
            place = min(max(place, 0), length - 1)
        case "REPEAT":
            place %= length
        case "PING_PONG" if length > 1:
            place %= 2 * (length - 1)
            place = min(place, 2 * (length - 1) - place)
        case "PING_PONG":
            place = 0
    return int(place + 1 + volume.frame_offset)
