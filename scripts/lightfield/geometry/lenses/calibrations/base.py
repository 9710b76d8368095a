"""What a calibration file says of a camera, and how its keys are read."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from reprlib import repr as shortened
from typing import Any, Literal, NamedTuple

from lightfield.core.errors import UserError
from lightfield.geometry.lenses.base import Pair

Model = Literal["brown_conrady", "kannala_brandt"]
Size = tuple[int, int]

# From the centre of the first pixel to the image's corner. Tools that place this centre at (0, 0)
# need it.
HALF = 0.5
# The number of brown_conrady's coefficients. OpenCV's order is k1, k2, p1, p2, k3 to k6, then s1 to
# s4, τx and τy, which this lens lacks.
BROWN_CONRADY = 8
FORMATS = (
    "a calibration is OpenCV's or ROS's (camera_matrix), Kalibr's or EuRoC's (intrinsics), a "
    "transforms.json (fl_x), or COLMAP's cameras.txt or cameras.bin"
)
_LARGEST_NUMBER = 1e99


class Calibration(NamedTuple):
    """A camera as a file describes it, in pixels. ``center`` counts from the image's corner."""

    lens: str
    size: Size
    focal_lengths: Pair = (0.0, 0.0)
    center: Pair = (0.0, 0.0)
    coefficients: tuple[float, ...] = ()


class Hints(NamedTuple):
    """What the user adds to a file that does not say it."""

    model: Model | None
    resolution: Size | None


# Returns a camera of a file. Each camera is read only if it is chosen.
Reader = Callable[[Hints], Calibration]


class Keys:
    """A mapping in a file. Errors name its keys after ``prefix``, but not the file."""

    def __init__(self, prefix: str, content: Any) -> None:
        self.prefix = prefix
        self.content: Mapping[str, Any] = content

    def error(self, key: str, problem: str) -> UserError:
        return UserError(f"{self.prefix}{key}: {problem}")

    def first(self, names: Iterable[str]) -> str | None:
        """Return the first of the ``names`` that the mapping has."""
        return next((name for name in names if name in self.content), None)

    def value(self, key: str) -> Any:
        if key not in self.content:
            raise self.error(key, "is missing")
        return self.content[key]

    def text(self, key: str, default: str) -> str:
        value = self.content.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; must be a text")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        value = default if default is not None and key not in self.content else self.value(key)
        (number,) = self._finite(key, [value])
        return number

    def numbers(self, key: str, *counts: int) -> tuple[float, ...]:
        """Return the numbers of a list, or of a matrix in row-major order.

        ``counts`` are the allowed numbers of numbers.
        """
        value = self.value(key)
        if isinstance(value, Mapping):
            return Keys(f"{self.prefix}{key}.", value).numbers("data", *counts)
        numbers = self._finite(key, _flattened(value))
        if counts and len(numbers) not in counts:
            allowed = " or ".join(map(str, counts))
            raise self.error(key, f"has {len(numbers)} numbers; must have {allowed}")
        return numbers

    def _finite(self, key: str, values: Iterable[Any]) -> tuple[float, ...]:
        numbers = []
        for value in values:
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            # Compared without conversion: a whole number may be too large for a float.
            if not is_number or not -_LARGEST_NUMBER < value < _LARGEST_NUMBER:
                raise self.error(key, f"has {shortened(value)}; must be finite numbers")
            numbers.append(float(value))
        return tuple(numbers)

    def size(self, hints: Hints, pairs: Sequence[str], sides: Sequence[tuple[str, str]]) -> Size:
        """Return the image's size, which a list or two keys give, or the user."""
        if key := self.first(pairs):
            width, height = self.numbers(key, 2)
        else:
            keys = next((keys for keys in sides if keys[0] in self.content), None)
            if keys is None:
                if hints.resolution:
                    return hints.resolution
                names = [*pairs, *(" and ".join(names) for names in sides)]
                raise UserError(
                    f"{self.prefix}{names[0]}: is missing; add the key resolution to the camera"
                )
            key, (width, height) = keys[0], (self.number(keys[0]), self.number(keys[1]))
        if any(side % 1 or not 1 <= side <= 2**16 for side in (width, height)):
            raise self.error(key, f"is {width:g} × {height:g}; must be whole numbers of pixels")
        size = int(width), int(height)
        if hints.resolution and hints.resolution != size:
            raise self.error(
                key,
                f"is {size[0]} × {size[1]}, but the given resolution is {hints.resolution[0]} × "
                f"{hints.resolution[1]}",
            )
        return size

    def focal_lengths(self, key: str, *numbers: float) -> Pair:
        if min(numbers) <= 0:
            raise self.error(key, f"has the focal length {min(numbers):g}; must be above 0")
        return numbers[0], numbers[-1]


def _flattened(value: Any) -> Iterable[Any]:
    """Return the values of a list, or of the rows of a matrix."""
    if not isinstance(value, list):
        return [value]
    rows = [part if isinstance(part, list) else [part] for part in value]
    return [number for row in rows for number in row]
