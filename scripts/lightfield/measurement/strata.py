"""Strata: the pixels of a light field by what they show that path tracing may find hard.

That is not spread evenly: a fire, a mirror or a pane of glass is small, and windows spread over the
views miss it. A pilot, a few small whole views of few samples with the parts of light that add up
to the colour and with the materials seen, finds where each is, and how noisy.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from lightfield.dataset.lightfield import View
from lightfield.dataset.passes import PARTS_OF_LIGHT
from lightfield.measurement.metrics import Mask
from lightfield.measurement.trials import FULL_ENOUGH, SURFACES, Trials, Window

Classes = NDArray[np.int64]

# In the order of the classes' numbers. By the light that a pixel shows most of: glossy is that of
# metal and mirrors. Of these, leaves and paper are translucent, glass and water transparent.
BY_LIGHT = ("diffuse", "glossy", "emission", "environment")
STRATA = [*BY_LIGHT, "translucent", "transparent", "volume"]
# Fog, smoke or fire that gives so much of a pixel's light is what the pixel shows.
OF_VOLUME = 0.25
# A pixel of no stratum: outside the image circle.
NONE = -1

# The pilot: views, pixels of their longer side, samples of a pixel, renders of each.
VIEWS = 8
SIZE = 96
SAMPLES = 4
SEEDS = 2
# A stratum has at least this part of the pilot's pixels, and of all pixels measured so many.
SMALLEST_AREA, FEWEST_PIXELS = 0.0005, 64


def classes(pilot: Trials, window: Window) -> tuple[Classes, NDArray[Any]]:
    """Return the stratum of each pixel of a window, (h, w), and its noise over its light."""
    trials = [pilot.render(window, 1 + seed, {"samples": SAMPLES}) for seed in range(SEEDS)]
    parts = {name: np.mean([t.parts[name] for t in trials], axis=0) for name in trials[0].parts}
    emitting, translucent, transparent = (parts[name] > 0 for name in SURFACES)
    # What glows and is no surface that emits is a volume.
    glow = np.where(emitting | (not pilot.has_volumes), 0, parts["emission"])
    of_volumes = parts["volume_light"] + glow
    by_light = [parts["diffuse_light"], parts["glossy_light"], parts["emission"] - glow]
    kinds = np.argmax([*by_light, parts["environment"]], axis=0)
    mirrors = kinds == STRATA.index("glossy")
    kinds[translucent & ~mirrors] = STRATA.index("translucent")
    kinds[transparent & ~mirrors] = STRATA.index("transparent")
    total = sum(parts[name] for name in PARTS_OF_LIGHT)
    kinds[(of_volumes > 0) & (of_volumes >= OF_VOLUME * total)] = STRATA.index("volume")
    light = [trial.colour.mean(axis=-1, dtype=np.float64) for trial in trials]
    noise = np.abs(light[0] - light[1]) / (light[0] + light[1] + 1e-6)
    return np.where(pilot.mask(window), kinds, NONE), noise


def classes_of(maker: Trials, windows: Sequence[Window]) -> list[Classes]:
    """Return the stratum of each pixel of some windows, (h, w) each, by a pilot of ``maker``."""
    pilot = maker.pilot()
    return [classes(pilot, window)[0] for window in windows]


def choose(maker: Trials, size: int, count: int) -> tuple[list[Window], dict[str, float]]:
    """Choose ``count`` windows of ``size``² pixels for each stratum, and return its part of all.

    Of a stratum's pixels in the pilot, its windows are around ones that are as noisy as the rest
    of it: at even steps of their rank, and away from its borders if it is large enough.
    """
    small = maker.lens.fitted(SIZE)
    pilot = maker.pilot(small)
    views = maker.lightfield.views
    views = [views[(2 * n + 1) * len(views) // (2 * VIEWS)] for n in range(min(VIEWS, len(views)))]
    found = [classes(pilot, Window(view, 0, 0, small.width, small.height)) for view in views]
    total = sum(int((kinds != NONE).sum()) for kinds, _ in found)
    windows: list[Window] = []
    areas: dict[str, float] = {}
    for number, name in enumerate(STRATA):
        members = [kinds == number for kinds, _ in found]
        area = sum(int(member.sum()) for member in members) / total
        if area < SMALLEST_AREA:
            continue
        areas[name] = area
        inner = [binary_erosion(member) for member in members]
        around = _around(
            maker, views, inner if np.any(inner) else members, [noise for _, noise in found], size
        )
        for step in range(count):
            window = around[int((step + 0.5) / count * len(around))]
            if window not in windows:
                windows.append(window)
    return windows, areas


def _around(
    maker: Trials,
    views: Sequence[View],
    members: Sequence[Mask],
    noise: Sequence[NDArray[Any]],
    size: int,
) -> list[Window]:
    """Return a window around each member pixel of the pilot's views, those of little noise first.

    Those that reach too far out of the image circle are left out, unless all do.
    """
    lens = maker.lens
    side = min(size, lens.width, lens.height)
    found = []
    for view, member, noisy in zip(views, members, noise, strict=True):
        height, width = member.shape
        for row, column in np.argwhere(member):
            x = round(
                min(max((column + 0.5) / width * lens.width - side / 2, 0), lens.width - side)
            )
            y = round(
                min(max((row + 0.5) / height * lens.height - side / 2, 0), lens.height - side)
            )
            found.append((float(noisy[row, column]), Window(view, x, y, side, side)))
    found.sort(key=lambda entry: entry[0])
    windows = [window for _, window in found]
    return [w for w in windows if maker.mask(w).mean() >= FULL_ENOUGH] or windows
