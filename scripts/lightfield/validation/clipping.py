"""Finds developed pictures in which many pixels are brighter than white, so that light is lost.

A contact sheet does not show it, because its tone mapping keeps this light. A sun or a lamp may be
white: it covers few pixels.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.formats.export_lists import IN_FOLDERS
from lightfield.formats.layout import ImageSet
from lightfield.imaging.alpha import divisor
from lightfield.validation.files import lists_of
from lightfield.validation.result import Check

Counts = NDArray[np.int64]

# The name of the check.
NAME = "clipping"
# At most this part of the pixels may be brighter than white without a warning.
MOST_CLIPPED = 0.01
# Light is counted in steps of this many to a stop, between two limits in stops.
_STEPS = 8
_DARKEST, _BRIGHTEST = -16, 17
# Light is counted at every n-th pixel across and down.
_EVERY = 2


class _Development(NamedTuple):
    """Pictures in a ``folder``, and the ``light`` of the ``pixels`` that they are made of."""

    folder: str
    name: str
    light: Counts
    pixels: str
    exposure: float
    white: float


def count(colour: NDArray[Any], alpha: NDArray[Any] | None, region: NDArray[np.bool_]) -> Counts:
    """Count the pixels of a region by the light of their brightest channel.

    ``colour`` (3, h, w) is multiplied with ``alpha`` (h, w), if there is one. The entry n counts
    light up to 2^(`_DARKEST` + n / `_STEPS`).
    """
    part = np.s_[::_EVERY, ::_EVERY]
    light = np.stack([channel[part] for channel in colour]).astype(np.float32).max(axis=0)
    shown = region[part] & np.isfinite(light)
    if alpha is not None:
        covered = alpha[part].astype(np.float32)
        shown = shown & (covered > 0)
        light /= divisor(covered)
    steps = np.ceil(_STEPS * np.log2(np.maximum(light[shown], 2.0**_DARKEST)))
    numbers = np.minimum(steps, _STEPS * _BRIGHTEST).astype(np.int64) - _STEPS * _DARKEST
    return np.bincount(numbers, minlength=_STEPS * (_BRIGHTEST - _DARKEST) + 1)


def checks(
    dataset: Path,
    sets: Sequence[ImageSet],
    lights: Mapping[int, Counts],
    sets_of_png: Collection[int],
    export_lists: Collection[Path] | None,
) -> list[Check]:
    """Return a check with a warning for each place whose pictures clip. Empty if none do.

    ``lights`` are the counts of the sets with EXR views. ``sets_of_png`` have PNG views.
    """
    parts = {}
    names: dict[tuple[str, str], list[str]] = {}
    for each in _developments(dataset, sets, lights, sets_of_png, export_lists):
        beyond = _part_beyond(each.light)
        limit = math.log2(each.white) - each.exposure
        part = float(beyond[_number_of(limit)])
        if part <= MOST_CLIPPED:
            continue
        stops = _DARKEST + int(np.argmax(beyond <= MOST_CLIPPED)) / _STEPS
        exposure = math.floor(10 * (math.log2(each.white) - stops)) / 10
        parts[f"{each.folder}{each.name}"] = float(f"{part:.3g}")
        text = (
            f"{part:.1%} of {each.pixels} are brighter than white; "
            f"exposure: {exposure:g} clips at most {MOST_CLIPPED:.0%}"
        )
        names.setdefault((each.folder, text), []).append(each.name)
    warnings = [f"{folder}{', '.join(each)}: {text}" for (folder, text), each in names.items()]
    detail = f"{len(parts)} places have pictures that clip"
    return [Check(NAME, True, detail, warnings=warnings, figures=parts)] if parts else []


def _part_beyond(light: Counts) -> NDArray[np.float64]:
    """Return for each entry of counts the part of the pixels that are brighter than its limit."""
    return np.asarray(1 - np.cumsum(light) / max(1, int(light.sum())), np.float64)


def _number_of(stops: float) -> int:
    """Return the entry of counts whose limit is a light, in stops, or the next brighter limit."""
    number = math.ceil(_STEPS * (stops - _DARKEST) - 1e-9)
    return min(max(number, 0), _STEPS * (_BRIGHTEST - _DARKEST))


def _developments(
    dataset: Path,
    sets: Sequence[ImageSet],
    lights: Mapping[int, Counts],
    sets_of_png: Collection[int],
    export_lists: Collection[Path] | None,
) -> Iterator[_Development]:
    """Yield the PNG reprojections, and the exports that develop EXR views."""
    for number, image_set in enumerate(sets):
        if number in sets_of_png:
            lightfield = image_set.lightfield
            # A look brings bright light below white.
            is_known = not (image_set.sensor or lightfield.is_relit or lightfield.has_look)
            settings = lightfield.content.get("reprojection", {})
            if is_known and 0 in lights and not sets[0].name:
                yield _Development(
                    "",
                    image_set.name,
                    lights[0],
                    "the rendered views' pixels",
                    settings.get("exposure", 0.0),
                    settings.get("reinhard", 1.0),
                )
        elif number in lights:
            for path in lists_of(dataset, image_set, IN_FOLDERS, export_lists):
                options = _options(path)
                is_developed = "exposure" in options and options.get("format") != "exr"
                if is_developed and "look" not in options:
                    yield _Development(
                        f"{path.parent.parent.relative_to(dataset).as_posix()}/",
                        path.parent.name,
                        lights[number],
                        "the pixels",
                        options["exposure"],
                        options.get("reinhard", 1.0),
                    )


def _options(path: Path) -> Mapping[str, Any]:
    """Return the options of an export. Empty if its list cannot be read: another check says so."""
    try:
        options = read_json(path).get("options", {})
    except (UserError, AttributeError):
        return {}
    return options if isinstance(options, Mapping) else {}
