"""Draws the parameters of each view's sensor from the settings of a scene YAML."""

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from lightfield.formats.sensors import (
    CHANNELS,
    COLOURS,
    MOST_COLOUR,
    MOST_STOPS,
    SensorSettings,
    Varied,
)
from lightfield.imaging.sensor import SensorParameters


def parameters_of(
    settings: SensorSettings, index: int, name: str, face: str = "", frame: int = 0
) -> SensorParameters:
    """Return the parameters of the view ``name``, number ``index`` of its lightfield.json.

    They depend on nothing else, so they are the same in any shard and order. ``face`` is the suffix
    of a cube map's face. The faces of a view have equal parameters, but other noise. ``frame`` is
    the scene's frame.
    """
    seed = settings.seed
    exposure = settings.exposure
    if isinstance(exposure, Varied):
        exposure = _value(exposure, [seed, frame, "exposure"], index, name, MOST_STOPS)
    colour: Sequence[float] = (0.0,) * COLOURS
    if isinstance(settings.colour, Varied):
        colour = [
            _value(settings.colour, [seed, frame, "colour", number], index, name, MOST_COLOUR)
            for number in range(COLOURS)
        ]
    elif settings.colour:
        colour = settings.colour
    noise = settings.noise
    vignetting = settings.vignetting.channels if settings.vignetting else ((0.0,) * 5,) * CHANNELS
    return SensorParameters(
        exposure=exposure + (settings.bracket or 0.0),
        vignetting=vignetting,
        colour=tuple(colour),
        response=settings.response.channels if settings.response else None,
        gain=noise.a if noise else 0.0,
        floor=noise.b if noise else 0.0,
        bits=settings.bits,
        seed=_number([seed, frame, "noise", settings.bracket, name + face]),
        has_look=settings.look is not None,
    )


def _value(varied: Varied, seed: Sequence[Any], index: int, name: str, limit: float) -> float:
    """Return the value of the view ``name``, number ``index``, within ± ``limit``.

    ``seed`` differs between quantities.
    """
    if varied.range:
        low, high = varied.range
        return float(_random([*seed, name]).uniform(low, high))
    assert varied.step is not None
    # Each view draws the steps of all views before it, so that none depends on another job.
    steps = _random(seed).standard_normal(index) * varied.step
    return float(np.clip((varied.start or 0.0) + steps.sum(), -limit, limit))


def _random(seed: Sequence[Any]) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=_number(seed)))


def _number(seed: Sequence[Any]) -> int:
    """Return a number from 0 to 2⁶³ − 1 that follows from a seed's parts."""
    digest = hashlib.sha256(json.dumps(list(seed)).encode()).hexdigest()
    return int(digest[:16], 16) >> 1
