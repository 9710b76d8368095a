"""What an export says of a dataset, in the axes and metres of lightfield.json."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oracles.readers.cameras import Camera

Floats = NDArray[np.float64]

FLOAT32 = 4 * float(np.finfo(np.float32).eps)
"""Numbers with a smaller relative difference are equal, because consumers compute with float32."""


@dataclass(frozen=True)
class ExportedView:
    """One view: ``world_from_camera`` (4, 4) in metres, x right, y up, looking along −z.

    ``file`` and ``place`` say where it stands. ``name`` is the view's, or None where the export
    numbers its pictures. ``exposure`` are the matrices at the start and the end of a moving
    camera's exposure.
    """

    file: Path
    place: str
    name: str | None
    world_from_camera: Floats
    exposure: tuple[Floats, Floats] | None = None


@dataclass(frozen=True)
class ExportedCamera:
    """A lens, and the ``place`` in the file that has its numbers."""

    place: str
    camera: Camera


@dataclass(frozen=True)
class Part:
    """The ``names`` of the views that a ``place`` in a file lists for a ``part`` of the split."""

    place: str
    part: str
    names: list[str]


@dataclass(frozen=True)
class DepthRange:
    """The nearest and the farthest depth of a view in metres. ``meaning`` is "z" or "distance".

    ``view`` is None for the range of all views together. In a sequence, it is the range of all
    frames. Misses, and depths beyond ``farthest``,
    count as ``farthest``.
    """

    place: str
    view: str | None
    near: float
    far: float
    meaning: str
    farthest: float


@dataclass(frozen=True)
class DepthMap:
    """A view's depth in integers: ``metres`` per step, 0 for none.

    ``meaning`` is "z" or "distance".
    """

    place: str
    path: Path
    view: str
    metres: float
    meaning: str


@dataclass(frozen=True)
class Picture:
    """A picture of a view, and what its numbers mean.

    - ``place``: where it is, for messages.
    - ``path``: the file. None for a mask that is missing: then all pixels count.
    - ``view``: the name of the view. None for the view nearest to ``position`` (3,).
    - ``kind``: "colour" in sRGB, or the pixels of the view itself in EXR; "opaque", colour in sRGB
      in front of black; "luma" of ``bits`` bits; "alpha"; "mask" (0: ignored); "hidden" (0: not
      ignored). Of depth: "steps" of ``unit`` metres, 0 for none; "metres", 0 for none;
      "disparity", ``unit`` divided by the depth, 0 for none; "relative", 65535 at the farthest
      surface, 0 for none; "levels" of normalised disparity of ``bits`` bits between the two depths
      ``limits``, where depth has ``lowest`` at least.
    - ``meaning``: which depth, "z" or "distance".
    - ``development``: exposure and white with which light becomes sRGB.
    - ``size``: width and height of a file without a header of its own.
    - ``objects``: names of the only objects whose pixels a mask keeps. Without any, it keeps all.
    - ``frame``: the number of its frame in a raw video.
    """

    place: str
    path: Path | None
    view: str | None
    kind: str
    meaning: str = "z"
    unit: float = 1.0
    bits: int = 16
    limits: tuple[float, float] = (0.0, math.inf)
    lowest: int = 0
    development: tuple[float, float] = (0.0, 1.0)
    size: tuple[int, int] = (0, 0)
    position: tuple[float, ...] = ()
    objects: tuple[str, ...] = ()
    frame: int = 0


@dataclass(frozen=True)
class Cloud:
    """World points (n, 3) in metres. The file calls them by their ``numbers`` (n,)."""

    file: Path
    kind: str
    numbers: NDArray[np.int64]
    positions: NDArray[np.floating[Any]]

    def name(self, index: int) -> str:
        return f"{self.file}: {self.kind} {self.numbers[index]}"


@dataclass(frozen=True)
class Box:
    """What an annotation says: its ``number``, left, top, width and height, and area in pixels.

    ``category`` is the number of an object, and ``instance`` that of its instance. ``mask``
    (height, width) says which pixels its segmentation has. None without a segmentation.
    """

    number: int
    sides: tuple[float, ...]
    area: float
    category: int
    instance: int
    mask: NDArray[np.bool_] | None


@dataclass(frozen=True)
class Boxes:
    """The ``boxes`` of a ``view``. ``place`` is the file that has them."""

    place: str
    view: str
    boxes: list[Box]


@dataclass(frozen=True)
class Flow:
    """An image of a view's scene flow: X, Y, Z in metres, and V, which is 1 where it is known."""

    path: Path
    view: str


@dataclass(frozen=True)
class UnitCube:
    """How instant-ngp maps rotated world points into its unit cube: times ``scale`` + ``offset``.

    ``option_scale`` is the user's scale, and ``option_place`` the user's place for the mean camera.
    Without them the cube is fitted to the rig, or to depth if ``fits_depth``.
    """

    place: str
    scale: float
    offset: Floats
    option_scale: float | None
    option_place: Floats | None
    fits_depth: bool


@dataclass
class Exported:
    """One export.

    ``views_of`` names the part of the split whose views it holds. None for all views. ``boxes`` and
    ``flows`` are None for an export without them. ``faults`` are lines about contradictions in its
    files, and with what its consumer needs. Each line names the file.
    """

    views: list[ExportedView] = field(default_factory=list)
    views_of: str | None = None
    cameras: list[ExportedCamera] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    ranges: list[DepthRange] = field(default_factory=list)
    depth_map: DepthMap | None = None
    pictures: list[Picture] = field(default_factory=list)
    clouds: list[Cloud] = field(default_factory=list)
    boxes: list[Boxes] | None = None
    flows: list[Flow] | None = None
    cube: UnitCube | None = None
    faults: list[str] = field(default_factory=list)

    def add_picture(self, path: Path, view: str | None, kind: str, **meaning: Any) -> None:
        """Add a picture of a view, if it exists. Other checks report missing files."""
        if path.is_file():
            self.pictures.append(Picture(str(path), path, view, kind, **meaning))

    def add_mask(self, path: Path, view: str, objects: Sequence[str] = ()) -> None:
        """Add the mask of a view. If the file is missing, all pixels of the view count."""
        there = path if path.is_file() else None
        self.pictures.append(Picture(str(path), there, view, "mask", objects=tuple(objects)))

    def expect(self, place: str, actual: Any, expected: Any) -> None:
        """Note a fault if a number or a text is not the ``expected`` one."""
        if not same(actual, expected):
            self.faults.append(f"{place}: is {actual!r}; must be {expected!r}")

    def expect_picture(self, place: str, path: Path, view: str, picture: str) -> None:
        """Note a fault if ``path`` is not a file, or does not have the name of the view's picture.

        ``picture`` is that name, with braces in place of the view's name: "{}_depth.png".
        """
        if path.name != picture.format(view):
            self.faults.append(f"{place}: is {path.name}; must be {picture.format(view)}")
        elif not path.is_file():
            self.faults.append(f"{place}: there is no file {path}")


def development(options: Mapping[str, Any]) -> tuple[float, float]:
    """Return the exposure and the white of an export's options."""
    return float(options.get("exposure", 0)), float(options.get("reinhard", 1))


def video_rate(options: Mapping[str, Any], frames: Mapping[str, int]) -> float:
    """Return the frames a second of a video of these frames, by the rate of their animation."""
    numbers = list(frames.values())
    return float(options["rate"]) * (len(numbers) - 1) / (numbers[-1] - numbers[0])


def same(actual: Any, expected: Any) -> bool:
    """Return whether two values are equal. Numbers may differ by `FLOAT32` times the largest."""
    if expected is None or isinstance(expected, str | bytes | bool):
        return type(actual) is type(expected) and bool(actual == expected)
    try:
        expected_numbers = np.array(expected, np.float64)
        difference = numbers(actual, expected_numbers.shape) - expected_numbers
    except (TypeError, ValueError, OverflowError):
        return False
    return bool((np.abs(difference) <= FLOAT32 * np.abs(expected_numbers).max(initial=0)).all())


def numbers(value: ArrayLike, shape: tuple[int, ...] = ()) -> Floats:
    """Return finite numbers as an array of a shape. Raises ValueError for anything else."""
    array = np.array(value)
    if array.shape != shape or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        size = " × ".join(map(str, shape))
        raise ValueError(f"must be {size} finite numbers")
    return array.astype(np.float64)


def number(value: Any) -> float:
    """Return a finite number. Raises ValueError for anything else."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"must be a finite number, not {value!r}")
    return float(value)


def from_texts(texts: Sequence[str]) -> Floats:
    """Return the finite numbers (n,) of a text file. Raises ValueError for anything else."""
    return numbers([float(text) for text in texts], (len(texts),))
