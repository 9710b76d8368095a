"""Divides pixels into strata by what they show, because some content is hard for path tracing.

A fire, a mirror or a pane of glass is small, so windows spread evenly over the views miss it. A
pilot finds where each stratum is, and how noisy. It renders a few small full views with few
samples. It also renders the parts of light that add up to the colour, and the materials.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from lightfield.formats.lightfield import View
from lightfield.formats.passes import PARTS_OF_LIGHT
from lightfield.measurement.metrics import Mask
from lightfield.measurement.trials import FULL_ENOUGH, SURFACES, Trials, ViewWindow

Classes = NDArray[np.int64]

# Strata by the light that dominates a pixel. Glossy is the light of metal and mirrors.
_BY_LIGHT = ("diffuse", "glossy", "emission", "environment")
# All strata, in the order of their numbers. Leaves and paper are translucent, glass is transparent.
STRATA = [*_BY_LIGHT, "translucent", "transparent", "volume"]
# A pixel shows fog, smoke or fire if they give at least this part of its light.
_OF_VOLUME = 0.25
# The class of pixels outside the image circle.
NONE = -1

# The pilot's views, the pixels of their longer side, the samples of a pixel, the renders of each.
VIEWS = 8
SIZE = 96
SAMPLES = 4
SEEDS = 2
# A stratum has at least this part of the pilot's pixels.
_SMALLEST_AREA = 0.0005
# A window counts in a stratum if it has at least this many of its pixels.
FEWEST_PIXELS = 64


def classes(pilot: Trials, window: ViewWindow) -> tuple[Classes, NDArray[Any]]:
    """Return the stratum of each pixel of a window, (h, w), and its noise over its light."""
    trials = [pilot.render(window, 1 + seed, {"samples": SAMPLES}) for seed in range(SEEDS)]
    parts = {name: np.mean([t.parts[name] for t in trials], axis=0) for name in trials[0].parts}
    emitting, translucent, transparent = (parts[name] > 0 for name in SURFACES)
    # Emission that comes from no emitting surface comes from a volume.
    glow = np.where(emitting | (not pilot.has_volumes), 0, parts["emission"])
    of_volumes = parts["volume_light"] + glow
    by_light = [parts["diffuse_light"], parts["glossy_light"], parts["emission"] - glow]
    kinds = np.argmax([*by_light, parts["environment"]], axis=0)
    mirrors = kinds == STRATA.index("glossy")
    kinds[translucent & ~mirrors] = STRATA.index("translucent")
    kinds[transparent & ~mirrors] = STRATA.index("transparent")
    total = sum(parts[name] for name in PARTS_OF_LIGHT)
    kinds[(of_volumes > 0) & (of_volumes >= _OF_VOLUME * total)] = STRATA.index("volume")
    light = [trial.colour.mean(axis=-1, dtype=np.float64) for trial in trials]
    noise = np.abs(light[0] - light[1]) / (light[0] + light[1] + 1e-6)
    return np.where(pilot.mask(window), kinds, NONE), noise


def classes_of(renderer: Trials, windows: Sequence[ViewWindow]) -> list[Classes]:
    """Return the stratum of each pixel (h, w) of the ``windows``, from a pilot."""
    pilot = renderer.pilot()
    return [classes(pilot, window)[0] for window in windows]


def choose(renderer: Trials, size: int, count: int) -> tuple[list[ViewWindow], dict[str, float]]:
    """Choose ``count`` windows of ``size``² pixels for each stratum.

    Returns all windows, and each stratum's part of the whole views. A stratum's windows lie around
    pixels that represent its noise: at even steps of the pixels sorted by noise. If the stratum is
    large enough, the windows avoid its borders.
    """
    small = renderer.lens.fitted(SIZE)
    pilot = renderer.pilot(small)
    views = renderer.lightfield.views
    views = [views[(2 * n + 1) * len(views) // (2 * VIEWS)] for n in range(min(VIEWS, len(views)))]
    pilots = [classes(pilot, ViewWindow(view, 0, 0, small.width, small.height)) for view in views]
    total = sum(int((kinds != NONE).sum()) for kinds, _ in pilots)
    windows: list[ViewWindow] = []
    areas: dict[str, float] = {}
    for number, name in enumerate(STRATA):
        members = [kinds == number for kinds, _ in pilots]
        area = sum(int(member.sum()) for member in members) / total
        if area < _SMALLEST_AREA:
            continue
        areas[name] = area
        inner = [binary_erosion(member) for member in members]
        if np.any(inner):
            members = inner
        around = _around(renderer, views, members, [noise for _, noise in pilots], size)
        for step in range(count):
            window = around[int((step + 0.5) / count * len(around))]
            if window not in windows:
                windows.append(window)
    return windows, areas


def _around(
    renderer: Trials,
    views: Sequence[View],
    members: Sequence[Mask],
    noise: Sequence[NDArray[Any]],
    size: int,
) -> list[ViewWindow]:
    """Return a window around each member pixel of the pilot's views, the least noisy first.

    Leaves out windows that reach too far out of the image circle, unless all of them do.
    """
    lens = renderer.lens
    side = min(size, lens.width, lens.height)
    by_noise = []
    for view, member, noisy in zip(views, members, noise, strict=True):
        height, width = member.shape
        for row, column in np.argwhere(member):
            left_edge = (column + 0.5) / width * lens.width - side / 2
            top_edge = (row + 0.5) / height * lens.height - side / 2
            x = round(min(max(left_edge, 0), lens.width - side))
            y = round(min(max(top_edge, 0), lens.height - side))
            by_noise.append((float(noisy[row, column]), ViewWindow(view, x, y, side, side)))
    by_noise.sort(key=lambda entry: entry[0])
    windows = [window for _, window in by_noise]
    # The views have windows at the same places.
    places = {(w.x, w.y): w for w in windows}
    full = {place for place, w in places.items() if renderer.mask(w).mean() >= FULL_ENOUGH}
    return [w for w in windows if (w.x, w.y) in full] or windows
