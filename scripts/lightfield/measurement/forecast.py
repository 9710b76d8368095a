"""What a run will take, by what is known before it: it is said at the end of each dry run.

Every job reads this file with the rules, so it imports nothing that takes long.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from lightfield.dataset.estimate import SECONDS_PER_SAMPLE, START_UP_SECONDS
from lightfield.measurement.sampling import (
    FEWEST_SEEDS,
    MOST_SEEDS,
    PLAIN_SAMPLES,
    PROBES,
    REFERENCE_PART,
    REFERENCE_SAMPLES,
    WINDOW_SIZE,
)

# Measured in the courtyard: how many renders a calibration's search makes of each window, how many
# of the samples that the target needs, and what a render of a window takes beside its samples.
SEARCH_RENDERS = 9
SEARCH_PART = 2.5
WINDOW_SECONDS = 0.07


@dataclass(frozen=True)
class Work:
    """What a run will do of one rig, or to calibrate: views, seconds of one core, and bytes."""

    name: str
    views: int
    seconds: float
    size: float = 0.0


def forecast(works: Sequence[Work]) -> str:
    """Return the table that a dry run ends with, sums below."""
    total = Work(
        "all",
        sum(work.views for work in works),
        sum(work.seconds for work in works),
        sum(work.size for work in works),
    )
    rows = [
        f"{work.name:<40} {work.views or '':>8} {figure(work.seconds / 3600):>10} "
        f"{figure(work.size / 1e9) if work.size else '':>8}"
        for work in [*works, *([total] if len(works) > 1 else [])]
    ]
    head = f"{'to render':<40} {'views':>8} {'CPU hours':>10} {'GB':>8}"
    return "\n".join([head, *rows, "Expected from pixels and samples, or from probes: see `plan`."])


def calibration_seconds(target: float, size: int, most: int | None = None) -> float:
    """Estimate how long one core calibrates for a ``target`` error with views of ``size``².

    Path tracing of N samples a pixel has an error of about 1 / N (0.4 / N in the courtyard, 1.4 / N
    in the barbershop, 2.6 / N in the garden), and a preset may allow no more than ``most`` samples.
    """
    needed = 1 / target
    seeds = FEWEST_SEEDS
    while seeds < MOST_SEEDS and seeds * REFERENCE_SAMPLES * REFERENCE_PART < needed:
        seeds *= 2
    # References for the windows and for those held out, plain path tracing, and what else is tried.
    tried = sum(PLAIN_SAMPLES) + SEARCH_PART * min(needed, most or needed)
    samples = 2 * seeds * REFERENCE_SAMPLES + tried
    renders = 2 * seeds + SEARCH_RENDERS
    pixels = min(size, WINDOW_SIZE) ** 2
    window = renders * WINDOW_SECONDS + pixels * samples * SECONDS_PER_SAMPLE
    return START_UP_SECONDS + PROBES * window


def figure(value: float) -> str:
    """Return a number in two digits, or whole with commas."""
    return f"{value:.2g}" if value < 10 else f"{value:,.0f}"
