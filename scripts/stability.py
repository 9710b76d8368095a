"""Measure how steady the geometry is: every lens pair over extremes, against mpmath.

One row a case: its condition number, its error against a reference of 50 digits, its round-trip
error, the bound that the condition number implies, and a verdict. Writes stability.csv (all rows),
stability.md (a summary) and stability.svg and .png (error over condition number) into --output,
and fails where a case is outside its bound.

The bound. A chain of correctly rounded steps is off by about as much as its exact answer moves
when each of its data moves by one rounding. The data of pixel → ray → pixel are the pixel (which
moves by eps · (|x| + |principal point|)), the three components of the ray (each by eps times
itself) and the answer. The sum of the exact answer's moves, in units of eps and relative to the
size of the image, is the condition number; a case passes within ROUNDINGS of these moves, and as
"ill-conditioned" where they let an answer be off by more than half a pixel. Where the
answer is not unique (a pole, a seam, the rim of a 360° lens, a border between cube faces) the two
answers are compared as rays.
"""

import argparse
import collections
import csv
import functools
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from mpmath import mpf

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path
from lightfield.core.progress import Progress
from lightfield.geometry import rigs
from lightfield.geometry.depth import distance_from_z, z_from_distance
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.base import CircleFisheye
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.equisolid import Equisolid
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.orthographic import Orthographic
from lightfield.geometry.lenses.polynomial import Polynomial
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.stereographic import Stereographic
from lightfield.report.plots import BLUE, VERMILION, plot
from lightfield.reprojection import lens_map
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.filters import FILTERS

ROUNDINGS = 16  # roundings, each of one eps, in the longest chain of operations of one step
RIM = 32  # a point this many eps from the rim may count as inside or outside
VAGUE = 0.5  # pixels of bound beyond which a case passes as ill-conditioned only
ILL_CONDITIONED = "ok, ill-conditioned"
DIGITS = 50
# Of differences: far below eps, so that a jump (a seam, a border) shows as an infinite derivative.
STEP = mpf(10) ** -20

Vector = Sequence[mpf]
Pixel = tuple[mpf, mpf]


# The reference: every lens by its definition, in mpmath, through θ and the azimuth.


@functools.cache
def polynomial_end(coefficients: tuple[float, ...], stop: mpf | None) -> mpf:
    """Return where Σ c_i t^i stops increasing, or reaches ``stop``; t > 0."""
    slope = [i * mpf(c) for i, c in enumerate(coefficients)][1:]
    crossing = [mpf(c) for c in coefficients]
    crossing[0] -= stop or 0
    ends = positive_roots(slope) + (positive_roots(crossing) if stop is not None else [])
    return min(ends, default=mpf("inf"))


def positive_roots(coefficients: Sequence[mpf]) -> list[mpf]:
    """Return the positive real roots of a polynomial given from its constant term up."""
    trimmed = list(coefficients)
    while trimmed and trimmed[-1] == 0:
        trimmed.pop()
    if len(trimmed) < 2:
        return []
    roots = mpmath.polyroots(trimmed, maxsteps=500, extraprec=300, asc=True)
    return [r.real for r in roots if abs(r.imag) < mpf(10) ** -25 and r.real > mpf(10) ** -25]


def polynomial(coefficients: Sequence[float], t: mpf) -> tuple[mpf, mpf]:
    """Return Σ c_i t^i and its slope."""
    value = slope = mpf(0)
    for c in reversed(coefficients):
        value, slope = value * t + c, slope * t + value
    return value, slope


def solve_increasing(coefficients: Sequence[float], value: mpf, end: mpf) -> mpf | None:
    """Return t in [0, end] with Σ c_i t^i = value: bisection in floats, then Newton's method."""
    if not coefficients[0] <= value <= polynomial(coefficients, end)[0]:
        return None
    low, high, goal = 0.0, float(end), float(value)
    while low < (middle := (low + high) / 2) < high:
        below = functools.reduce(lambda sum, c: sum * middle + c, reversed(coefficients)) < goal
        low, high = (middle, high) if below else (low, middle)
    t = mpf(high)
    for _ in range(100):
        reached, slope = polynomial(coefficients, t)
        change = (reached - value) / slope if slope else mpf(0)
        t -= change
        if abs(change) <= mpf(10) ** (3 - DIGITS) * t:
            break
    return t


def polynomial_of(lens: Polynomial) -> tuple[int, tuple[float, ...]]:
    """Return the sign of θ and the coefficients, of θ's own sign, of |θ| over r."""
    sign = -1 if next(k for k in lens.coefficients[1:] if k) > 0 else 1
    return sign, tuple(-sign * k for k in lens.coefficients)


def odd_polynomial(lens: KannalaBrandt) -> tuple[float, ...]:
    k1, k2, k3, k4 = lens.coefficients
    return (0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4)


@functools.cache
def half_fov(lens: Any) -> mpf:
    return min(mpf(lens.fov) / 2, mpmath.pi)


@functools.cache
def scales(lens: Lens) -> Pixel:
    """Return what one pixel is, across and down, in the unit of the lens's r."""
    if isinstance(lens, CircleFisheye):
        return mpf(2) / lens.width, mpf(2) / lens.height
    return mpf(lens.sensor[0]) / lens.width, mpf(lens.sensor[1]) / lens.height


@functools.cache
def largest_radius(lens: Lens) -> mpf:
    match lens:
        case Rectilinear():
            return mpf("inf")
        case Equisolid():
            return 2 * mpf(lens.focal_length) * mpmath.sin(half_fov(lens) / 2)
        case Polynomial():
            return polynomial_end(polynomial_of(lens)[1], half_fov(lens))
        case KannalaBrandt():
            odd = odd_polynomial(lens)
            angle = min(polynomial_end(odd, None), half_fov(lens))
            return mpf(lens.focal_length) * polynomial(odd, angle)[0]
    return mpf(1)


def angle_of_radius(lens: Lens, r: mpf) -> mpf | None:
    match lens:
        case Rectilinear():
            return mpmath.atan(r / mpf(lens.focal_length))
        case Equidistant():
            return r * half_fov(lens)
        case Equisolid():
            sine = r / (2 * mpf(lens.focal_length))
            return 2 * mpmath.asin(sine) if sine <= 1 else None
        case Stereographic():
            return 2 * mpmath.atan(r * mpmath.tan(half_fov(lens) / 2))
        case Orthographic():
            sine = r * mpmath.sin(half_fov(lens))
            return mpmath.asin(sine) if sine <= 1 else None
        case Polynomial():
            sign, coefficients = polynomial_of(lens)
            return sign * polynomial(coefficients, r)[0]
        case KannalaBrandt():
            odd = odd_polynomial(lens)
            end = min(polynomial_end(odd, None), mpmath.pi)
            return solve_increasing(odd, r / mpf(lens.focal_length), end)
    raise TypeError(lens)


def radius_of_angle(lens: Lens, theta: mpf) -> mpf | None:
    match lens:
        case Rectilinear():
            return mpf(lens.focal_length) * mpmath.tan(theta) if theta < mpmath.pi / 2 else None
        case Equidistant():
            return theta / half_fov(lens)
        case Equisolid():
            return 2 * mpf(lens.focal_length) * mpmath.sin(theta / 2)
        case Stereographic():
            return mpmath.tan(theta / 2) / mpmath.tan(half_fov(lens) / 2)
        case Orthographic():
            if theta > mpmath.pi / 2:
                return None
            return mpmath.sin(theta) / mpmath.sin(half_fov(lens))
        case Polynomial():
            sign, coefficients = polynomial_of(lens)
            end = polynomial_end(coefficients, mpmath.pi)
            pixel = max(scales(lens))
            if 0 <= theta < coefficients[0] < pixel * coefficients[1]:
                return mpf(0)  # the hole around the axis, smaller than a pixel
            r = solve_increasing(coefficients, theta, end)
            return None if r is None else sign * r
        case KannalaBrandt():
            odd = odd_polynomial(lens)
            if theta > polynomial_end(odd, None):
                return None
            return mpf(lens.focal_length) * polynomial(odd, theta)[0]
    raise TypeError(lens)


CUBE_RAYS: list[Callable[[mpf, mpf], Vector]] = [
    lambda u, v: (u, v, mpf(-1)),
    lambda u, v: (-u, v, mpf(1)),
    lambda u, v: (mpf(-1), v, -u),
    lambda u, v: (mpf(1), v, u),
    lambda u, v: (u, mpf(1), v),
    lambda u, v: (u, mpf(-1), -v),
]  # f b l r u d, for u to the right and v up in −1 … 1


def unit(ray: Vector) -> Vector:
    length = mpmath.sqrt(sum(c * c for c in ray))
    return tuple(c / length for c in ray)


@functools.cache
def reference_ray(lens: Lens, x: mpf, y: mpf) -> tuple[Vector | None, mpf]:
    """Return the exact ray of a pixel, and how far outside the lens it is (negative: inside)."""
    if isinstance(lens, CubeMap):
        face = min(int(x // lens.height), 5)
        u = 2 * (x - face * lens.height) / lens.height - 1
        return unit(CUBE_RAYS[face](u, 1 - 2 * y / lens.height)), mpf(-1)
    if isinstance(lens, Equirectangular):
        (west, east), (south, north) = lens.longitude, lens.latitude
        longitude = west + (mpf(east) - west) * x / lens.width
        latitude = north - (mpf(north) - south) * y / lens.height
        radius = mpmath.cos(latitude)
        sine = mpmath.sin(latitude)
        ray = (radius * mpmath.sin(longitude), sine, -radius * mpmath.cos(longitude))
        return ray, abs(latitude) / (mpmath.pi / 2) - 1
    u, v = (x - lens.center[0]) * scales(lens)[0], (lens.center[1] - y) * scales(lens)[1]
    r = mpmath.hypot(u, v)
    theta = angle_of_radius(lens, r)
    excess = r / largest_radius(lens) - 1
    if theta is None:
        return None, excess
    cos, sin = (u / r, v / r) if r else (mpf(0), mpf(1))
    return (mpmath.sin(theta) * cos, mpmath.sin(theta) * sin, -mpmath.cos(theta)), excess


def reference_pixel(lens: Lens, ray: Vector) -> tuple[Pixel | None, mpf]:
    """Return the exact pixel of a ray, and how far outside the lens it is (negative: inside)."""
    if isinstance(lens, CubeMap):
        x, y, z = ray
        sides = (-z, z, -x, x, y, -y)
        face = max(range(6), key=lambda i: sides[i])
        u, v = ((x, y), (-x, y), (-z, y), (z, y), (x, z), (x, -z))[face]
        half = mpf(lens.height) / 2
        side = sides[face]
        return (half * (1 + u / side) + face * lens.height, half * (1 - v / side)), mpf(-1)
    if isinstance(lens, Equirectangular):
        (west, east), (south, north) = lens.longitude, lens.latitude
        longitude = mpmath.atan2(ray[0], -ray[2]) if ray[0] or ray[2] else mpf(0)
        latitude = mpmath.atan2(ray[1], mpmath.hypot(ray[0], ray[2]))
        middle = (mpf(west) + east) / 2
        longitude -= 2 * mpmath.pi * mpmath.floor((longitude - middle) / (2 * mpmath.pi) + 0.5)
        x = (longitude - west) / (mpf(east) - west) * lens.width
        return (x, (north - latitude) / (mpf(north) - south) * lens.height), mpf(-1)
    side = mpmath.hypot(ray[0], ray[1])
    theta = mpmath.atan2(side, -ray[2])
    r = radius_of_angle(lens, theta)
    if r is None:
        return None, mpf(1)
    excess = abs(r) / largest_radius(lens) - 1
    cos, sin = (ray[0] / side, ray[1] / side) if side else (mpf(0), mpf(0))
    return (
        lens.center[0] + r * cos / scales(lens)[0],
        lens.center[1] - r * sin / scales(lens)[1],
    ), excess


def ray_within(lens: Lens, pixel: Sequence[mpf], eps: mpf) -> Vector | None:
    """Return the exact ray of a pixel, which rounding may have carried beyond the lens's rim."""
    ray = reference_ray(lens, *pixel)[0]
    if ray is not None:
        return ray
    allowed = ROUNDINGS * eps * extent(lens, *pixel)
    offset = [c - m for c, m in zip(pixel, lens.center, strict=True)]
    shrink = max(1 - allowed / mpmath.norm(offset), mpf(0))
    return reference_ray(lens, *(m + shrink * o for m, o in zip(lens.center, offset, strict=True)))[
        0
    ]


def angle_between(a: Vector, b: Vector) -> mpf:
    a, b = unit(a), unit(b)
    difference = mpmath.sqrt(sum((p - q) ** 2 for p, q in zip(a, b, strict=True)))
    total = mpmath.sqrt(sum((p + q) ** 2 for p, q in zip(a, b, strict=True)))
    return 2 * mpmath.atan2(difference, total)


# How far the exact answers move with their data.


def movement(after: Sequence[mpf] | None, before: Sequence[mpf] | None, step: mpf) -> mpf:
    """Return the largest change per unit of the datum; infinite where there is no answer."""
    if after is None or before is None:
        return mpf("inf")
    return max(abs(a - b) for a, b in zip(after, before, strict=True)) / (2 * step)


@functools.cache
def ray_per_pixel(lens: Lens, x: mpf, y: mpf) -> mpf:
    """Return the largest move of a pixel's ray with its coordinates, per pixel."""
    step = STEP * (1 + abs(x) + abs(y))
    return sum(
        movement(
            reference_ray(lens, x + dx, y + dy)[0], reference_ray(lens, x - dx, y - dy)[0], step
        )
        for dx, dy in ((step, 0), (0, step))
    )


def pixel_per_ray(lens: Lens, ray: Vector) -> mpf:
    """Return the move of a ray's pixel with relative changes of the ray's three components."""
    total = mpf(0)
    for i in range(3):
        if ray[i]:
            moved = [
                [c * (1 + sign * STEP) if j == i else c for j, c in enumerate(ray)]
                for sign in (1, -1)
            ]
            pixels = [reference_pixel(lens, m)[0] for m in moved]
            total += movement(pixels[0], pixels[1], STEP)
    return total


def pixel_per_pixel(source: Lens, target: Lens, x: mpf, y: mpf) -> mpf:
    """Return the largest move of the target's pixel with the source's coordinates, per pixel."""
    step = STEP * (1 + abs(x) + abs(y))
    total = mpf(0)
    for dx, dy in ((step, 0), (0, step)):
        rays = [reference_ray(source, x + s * dx, y + s * dy)[0] for s in (1, -1)]
        pixels = [None if ray is None else reference_pixel(target, ray)[0] for ray in rays]
        total += movement(pixels[0], pixels[1], step)
    return total


def extent(lens: Lens, x: mpf, y: mpf) -> mpf:
    """Return the size of the numbers that a pixel coordinate is computed from and with."""
    return max(abs(x) + abs(lens.center[0]), abs(y) + abs(lens.center[1]))


# Cases.


@dataclass
class Row:
    """One case. Errors and bounds are in ``unit``; `condition` is relative to the data's size."""

    group: str
    case: str
    source: str
    target: str
    dtype: str
    points: int
    misses: int
    as_rays: int
    condition: float
    error: float
    error_bound: float
    round_trip_error: float
    round_trip_bound: float
    unit: str
    verdict: str


@dataclass
class Worst:
    """The largest error relative to its bound among the points of a case, and how they are held."""

    error: mpf
    bound: mpf
    vague: bool = False
    as_rays: int = 0

    def add(self, error: mpf, bound: mpf) -> None:
        self.vague |= bool(bound > VAGUE)
        if self.bound == 0 or error * self.bound > self.error * bound:
            self.error, self.bound = error, bound

    @property
    def passes(self) -> bool:
        return bool(self.error <= self.bound)


@dataclass
class Reference:
    """Exact answers for one point of a lens pair; both dtypes are held against them."""

    pixel: Pixel
    ray: Vector | None
    ray_excess: mpf
    target: Pixel | None
    target_excess: mpf
    forward: mpf  # moves of the target's pixel, in pixels per eps
    ray_moves: mpf  # moves of the ray, in radians per eps


def reference(source: Lens, target: Lens, pixel: Pixel) -> Reference:
    ray, ray_excess = reference_ray(source, *pixel)
    if ray is None:
        return Reference(pixel, None, ray_excess, None, mpf(1), mpf("inf"), mpf("inf"))
    found, excess = reference_pixel(target, ray)
    forward = mpf("inf")
    data = extent(source, *pixel)
    if found is not None:
        forward = (
            pixel_per_pixel(source, target, *pixel) * data
            + pixel_per_ray(target, ray)
            + extent(target, *found)
        )
    ray_moves = ray_per_pixel(source, *pixel) * data + 1
    return Reference(pixel, ray, ray_excess, found, excess, forward, ray_moves)


def lens_cases(lenses: dict[str, Lens], progress: Progress) -> Iterator[Row]:
    """Every lens as source and as target: pixel → ray → pixel, and back again."""
    for source_name, source in lenses.items():
        points = probes(source)
        for target_name, target in lenses.items():
            exact = [reference(source, target, (mpf(float(x)), mpf(float(y)))) for x, y in points]
            for dtype in (np.float32, np.float64):
                yield lens_row(source_name, target_name, source, target, points, exact, dtype)
            progress.done()


def lens_row(
    source_name: str,
    target_name: str,
    source: Lens,
    target: Lens,
    points: Array,
    exact: Sequence[Reference],
    dtype: type,
) -> Row:
    eps = mpf(float(np.finfo(dtype).eps))
    pixels = target.pixels(source.rays(*points.T.astype(dtype)))
    back = source.pixels(target.rays(*pixels.T))
    forward, round_trip = Worst(mpf(0), mpf(0)), Worst(mpf(0), mpf(0))
    condition = mpf(0)
    misses = wrong = 0
    for point, got, returned in zip(exact, pixels, back, strict=True):
        undecided = abs(point.ray_excess) <= RIM * eps or abs(point.target_excess) <= RIM * eps
        sees = point.target is not None and point.ray_excess <= 0 and point.target_excess <= 0
        if np.isnan(got).all() or not sees:
            # A miss has to be marked in both coordinates, and to be one.
            misses += 1
            wrong += not undecided and not (np.isnan(got).all() and not sees)
            continue
        assert point.target is not None and point.ray is not None
        found = [mpf(float(c)) for c in got]
        error = max(abs(a - b) for a, b in zip(found, point.target, strict=True))
        bound = ROUNDINGS * eps * point.forward
        # The bound of an answer that eps moves by more than the image says nothing: such an
        # answer, and a twin of the right one, is compared as a ray.
        if error <= bound and bound < max(target.width, target.height):
            forward.add(error, bound)
            condition = max(condition, point.forward / extent(target, *point.target))
        else:
            forward.as_rays += 1
            seen = ray_within(target, found, eps)
            ray_bound = (
                ROUNDINGS
                * eps
                * (point.ray_moves + ray_per_pixel(target, *found) * extent(target, *found))
            )
            if seen is None or angle_between(seen, point.ray) > ray_bound:
                wrong += 1
                forward.add(error, bound)
        check_return(
            source, target, point, found, [float(c) for c in returned], bound, eps, round_trip
        )
    vague = forward.vague or round_trip.vague
    passes = forward.passes and round_trip.passes and wrong == 0
    return Row(
        group="lens pair",
        case=f"{source_name} → {target_name}",
        source=type(source).__name__,
        target=type(target).__name__,
        dtype=np.dtype(dtype).name,
        points=len(points),
        misses=misses,
        as_rays=forward.as_rays + round_trip.as_rays,
        condition=float(condition),
        error=float(forward.error),
        error_bound=float(forward.bound),
        round_trip_error=float(round_trip.error),
        round_trip_bound=float(round_trip.bound),
        unit="px",
        verdict="FAIL" if not passes else ILL_CONDITIONED if vague else "ok",
    )


def check_return(
    source: Lens,
    target: Lens,
    point: Reference,
    found: Sequence[mpf],
    returned: Sequence[float],
    forward_bound: mpf,
    eps: mpf,
    round_trip: Worst,
) -> None:
    """Hold the way back, from the pixel that was found, against its bound."""
    ray = reference_ray(target, *found)[0]
    if ray is None:
        return
    data = extent(target, *found)
    per_pixel = pixel_per_pixel(target, source, *found)
    size = extent(source, *point.pixel)
    bound = per_pixel * forward_bound + ROUNDINGS * eps * (
        per_pixel * data + pixel_per_ray(source, ray) + size
    )
    if math.isnan(returned[0]):
        # The way back may end outside only where the rim is within the bound.
        within = abs(point.ray_excess) * size <= bound or abs(point.target_excess) <= RIM * eps
        if within:
            round_trip.as_rays += 1
        else:
            round_trip.add(mpf("inf"), bound)
        return
    error = max(abs(mpf(a) - b) for a, b in zip(returned, point.pixel, strict=True))
    if error <= bound and bound < max(source.width, source.height):
        round_trip.add(error, bound)
        return
    assert point.ray is not None
    round_trip.as_rays += 1
    seen = ray_within(source, [mpf(c) for c in returned], eps)
    moves = 2 * point.ray_moves + ray_per_pixel(target, *found) * data
    if seen is None or angle_between(seen, point.ray) > ROUNDINGS * eps * moves:
        round_trip.add(error, bound)


def extreme_lenses() -> dict[str, Lens]:
    """Return the lenses of the cases, by name."""
    odd = {"width": 65, "height": 33}
    wide = {"width": 2048, "height": 1536}
    one = {"width": 1, "height": 1}
    shifted = {**wide, "principal_point": (-300.25, 2000.5)}

    def focal(fov: float) -> float:
        return 18 / math.tan(math.radians(fov) / 2)

    def degrees(fov: float) -> float:
        return math.radians(fov)

    blender = (-1.1735144e-05, -0.01998874, -3.3525323e-06, 3.0992753e-06, -2.6064646e-08)
    return {
        "rectilinear 0.01°": Rectilinear(**wide, focal_length=focal(0.01)),
        "rectilinear 90° odd": Rectilinear(**odd, focal_length=focal(90)),
        "rectilinear 179.9°": Rectilinear(**wide, focal_length=focal(179.9)),
        "rectilinear 1e-6 mm": Rectilinear(**wide, focal_length=1e-6),
        "rectilinear 1e6 mm": Rectilinear(**wide, focal_length=1e6),
        "rectilinear 1×1 px": Rectilinear(**one, focal_length=18),
        "rectilinear shifted": Rectilinear(**shifted, focal_length=18, sensor_size=(36, 20)),
        "equidistant 0.01°": Equidistant(**wide, fov=degrees(0.01)),
        "equidistant 180° odd": Equidistant(**odd, fov=degrees(180)),
        "equidistant 180° 1×1 px": Equidistant(**one, fov=degrees(180)),
        "equidistant 220° shifted": Equidistant(**shifted, fov=degrees(220)),
        "equidistant 360°": Equidistant(**wide, fov=degrees(360)),
        "equisolid 180° 1e-6 mm": Equisolid(**wide, focal_length=1e-6, fov=degrees(180)),
        "equisolid 180° 1e6 mm": Equisolid(**wide, focal_length=1e6, fov=degrees(180)),
        "equisolid 220° odd": Equisolid(**odd, focal_length=10.5, fov=degrees(220)),
        "equisolid 360°": Equisolid(**wide, focal_length=9, fov=degrees(360)),
        "stereographic 0.01°": Stereographic(**wide, fov=degrees(0.01)),
        "stereographic 180° odd": Stereographic(**odd, fov=degrees(180)),
        "stereographic 359.9999°": Stereographic(**wide, fov=degrees(359.9999)),
        "orthographic 0.01°": Orthographic(**wide, fov=degrees(0.01)),
        "orthographic 180°": Orthographic(**wide, fov=degrees(180)),
        "polynomial Blender's": Polynomial(**odd, coefficients=blender, fov=degrees(180)),
        "polynomial turning": Polynomial(
            **wide, coefficients=(0, -0.1, 0, 4e-4, 0), fov=degrees(360)
        ),
        "polynomial turned 220°": Polynomial(
            **wide, coefficients=(0, 0.08, 1e-4, 1e-5, 0), fov=degrees(220)
        ),
        "kannala_brandt 360°": KannalaBrandt(
            **wide, focal_length=6, coefficients=(0.01, -0.002, 0.0003, 0), fov=degrees(360)
        ),
        "kannala_brandt turning": KannalaBrandt(
            **odd, focal_length=12, coefficients=(-0.3, 0, 0, 0)
        ),
        "equirectangular": Equirectangular(**wide),
        "equirectangular odd": Equirectangular(**odd),
        "equirectangular 0.01°": Equirectangular(
            **wide, longitude=(0, degrees(0.01)), latitude=(0, degrees(0.01))
        ),
        "cube map": CubeMap(width=6 * 1024, height=1024),
        "cube map 1 px": CubeMap(width=6, height=1),
    }


def probes(lens: Lens) -> Array:
    """Return pixel coordinates (n, 2) in float32 that a lens is tried at.

    The exact centre and beside it, the frame's corner, the middles of its edges (the rim of an
    image circle, the seam and the poles of a panorama), just inside the rim, and in between; for
    a lens that turns, at and beside its turning point.
    """
    width, height = lens.width, lens.height
    x, y = lens.center
    points = [
        (x, y),
        (x * (1 + 1e-6), y * (1 - 1e-6)),
        (0.5, 0.5),
        (width, height / 2),
        (width / 2, 0),
        (x + width / 2 * 0.99999, y),
        (0.3 * width, 0.6 * height),
        (0.77 * width, 0.21 * height),
        (0, 0.4 * height),
    ]
    if isinstance(lens, Polynomial | KannalaBrandt):
        end = float(largest_radius(lens) / scales(lens)[0])
        points += [
            (x + end, y),
            (x + end * (1 - 1e-4), y),
            (x, y - end * height / width * (1 - 1e-6)),
        ]
    return np.array(points, np.float32)


def depth_cases() -> Iterator[Row]:
    """Depths of 1e-6 m to 1e9 m, to Z-depth and back, up to a hair from 90°."""
    angles = np.radians([0, 1e-3, 45, 89, 89.99, 89.9999999])
    depths = 10.0 ** np.arange(-6, 10)
    for dtype in (np.float32, np.float64):
        eps = mpf(float(np.finfo(dtype).eps))
        for theta in angles:
            ray = np.array([math.sin(theta), 0, -math.cos(theta)], dtype)
            rays = np.broadcast_to(ray, (len(depths), 3))
            distance = depths.astype(dtype)
            z = z_from_distance(distance, rays)
            again = distance_from_z(z, rays)
            exact = [mpf(float(d)) * -mpf(float(ray[2])) for d in distance]
            error = max(abs(mpf(float(g)) - e) / e for g, e in zip(z, exact, strict=True))
            back = np.abs(again.astype(np.float64) / distance.astype(np.float64) - 1).max()
            # The ray is a datum: a product and a quotient of data have condition number 2.
            yield simple_row(
                "depth",
                f"1e-6 m to 1e9 m at {math.degrees(theta):.10g}°",
                dtype,
                2 * len(depths),
                condition=2,
                error=error,
                round_trip=mpf(float(back)),
                unit="relative",
                eps=eps,
            )


def special_depth_cases() -> Iterator[Row]:
    """Infinity, NaN, the largest half and denormals through the depth conversions."""
    for dtype in (np.float16, np.float32, np.float64):
        # A half depth is converted in the precision of the rays.
        ray_dtype = np.float64 if dtype == np.float64 else np.float32
        ray = np.array([0.6, 0, -0.8], ray_dtype)
        info = np.finfo(dtype)
        for name, value in (
            ("infinity", math.inf),
            ("NaN", math.nan),
            ("largest", float(info.max)),
            ("denormal", float(info.smallest_subnormal) * 1000),
        ):
            depth = np.array([value], dtype)
            z = z_from_distance(depth, ray[None])
            again = distance_from_z(z, ray[None])
            if math.isfinite(value):
                spacing = mpf(float(np.spacing(np.asarray(value / 2, ray_dtype))))
                error = abs(mpf(float(z[0])) - mpf(value) * -mpf(float(ray[2]))) / spacing
                back = abs(mpf(float(again[0])) - mpf(value)) / spacing
            else:
                same = (np.isnan(z) & np.isnan(again)) if math.isnan(value) else (z == again)
                same &= np.isnan(depth) if math.isnan(value) else (z == depth)
                error = back = mpf(0 if same[0] else "inf")
            yield simple_row(
                "depth",
                f"{name} ({np.dtype(dtype).name})",
                ray_dtype,
                1,
                condition=2,
                error=error,
                round_trip=back,
                unit="spacings",
                eps=mpf(1),
            )


def rotation(axis: int, angle: mpf) -> mpmath.matrix:
    """Return the exact rotation by ``angle`` radians about x (0), y (1) or z (2)."""
    matrix = mpmath.eye(3)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix[i, i] = matrix[j, j] = mpmath.cos(angle)
    matrix[j, i], matrix[i, j] = mpmath.sin(angle), -mpmath.sin(angle)
    return matrix


def exact_euler(euler: Iterable[float | mpf]) -> mpmath.matrix:
    x, y, z = (rotation(axis, mpf(angle)) for axis, angle in enumerate(euler))
    return z * y * x


def gimbal_cases() -> Iterator[Row]:
    """Rotations at and beside gimbal lock, through a rig's Euler angles and back to a matrix."""
    eps = mpf(float(np.finfo(np.float64).eps))
    for pitch in (90, -90, 90 - 1e-9, 90 - 1e-8, 90 - 1e-7, -90 + 1e-5, 89.9, 0):
        for turn in (0, 30, -123.4, 180):
            rig = {"type": "plane", "cameras": [1, 1], "rotation": [turn, pitch, 2 * turn]}
            matrix = rigs.from_settings(rig).poses()[0].matrix()[:3, :3]
            radians = [float(np.radians(angle)) for angle in rig["rotation"]]
            exact = exact_euler(radians) * rotation(0, mpf(math.pi / 2))
            error = max(abs(mpf(matrix[i, j]) - exact[i, j]) for i in range(3) for j in range(3))
            orthogonal = matrix @ matrix.T - np.eye(3)
            # A rig publishes its angles rounded to 12 decimals: half a unit of the last of each
            # of three angles. The rotation itself is perfectly conditioned.
            yield simple_row(
                "rotation",
                f"pitch {pitch:.9f}°, yaw {2 * turn}°",
                np.float64,
                1,
                condition=1 + 1.5e-12 / float(eps),
                error=error,
                round_trip=mpf(float(np.abs(orthogonal).max())),
                unit="rad",
                eps=eps,
            )


def far_cases(lenses: dict[str, Lens]) -> Iterator[Row]:
    """Cameras a million metres from the origin: a pixel's point, seen by the next camera."""
    eps = mpf(float(np.finfo(np.float64).eps))
    place = (1e6, -1e6, 1e6)
    first = rigs.Pose("a", 0, place, (0.3, 1.2, -0.7))
    second = rigs.Pose("b", 1, (place[0] + 0.1, place[1], place[2] - 0.05), (0.35, 1.1, -0.6))
    turns = [exact_euler(pose.rotation) for pose in (first, second)]
    for name in (
        "rectilinear 90° odd",
        "equidistant 180° odd",
        "equisolid 360°",
        "equirectangular",
        "cube map",
    ):
        lens = lenses[name]
        x, y = 0.45 * lens.width, 0.55 * lens.height
        distance = 2.0
        ray = lens.rays(x, y)
        world = first.matrix() @ np.append(ray * distance, 1)
        seen = np.linalg.inv(second.matrix()) @ world
        got = lens.pixels(seen[:3])
        inverse = np.linalg.inv(first.matrix()) @ np.linalg.inv(np.linalg.inv(second.matrix()))
        back = lens.pixels((inverse @ seen)[:3])
        exact_ray, _ = reference_ray(lens, mpf(x), mpf(y))
        assert exact_ray is not None
        point = turns[0] * mpmath.matrix(exact_ray) * distance
        offset = [mpf(a) - mpf(b) for a, b in zip(first.position, second.position, strict=True)]
        target = list(turns[1].T * (point + mpmath.matrix(offset)))
        exact, _ = reference_pixel(lens, target)
        assert exact is not None
        length = mpmath.norm(target)
        # Three numbers of a million metres move by one eps each; the pixel moves with the angle.
        per_radian = 1 / ray_moves(lens, exact)
        condition = (3 * mpf(place[0]) / length * per_radian) / extent(lens, *exact) + 2
        error = max(abs(mpf(float(g)) - e) for g, e in zip(got, exact, strict=True))
        returned = max(abs(mpf(float(b)) - mpf(p)) for b, p in zip(back, (x, y), strict=True))
        scale = extent(lens, *exact)
        yield simple_row(
            "far camera",
            f"{name}, 1e6 m from the origin",
            np.float64,
            1,
            condition=float(condition),
            error=error / scale,
            round_trip=returned / scale,
            unit="relative",
            eps=eps,
        )


def ray_moves(lens: Lens, pixel: Pixel) -> mpf:
    """Return the smallest move of the ray with the pixel's coordinates, in radians per pixel."""
    step = STEP * (1 + abs(pixel[0]) + abs(pixel[1]))
    rays = [
        [reference_ray(lens, pixel[0] + s * dx, pixel[1] + s * dy)[0] for s in (1, -1)]
        for dx, dy in ((step, 0), (0, step))
    ]
    return min(movement(after, before, step) for after, before in rays)


def resampling_cases() -> Iterator[Row]:
    """HDR to the half limit, denormals, infinities and NaNs through the resampling filters."""
    source = Equirectangular(width=64, height=32)
    target = Equidistant(width=33, height=33, fov=math.radians(220))
    rays = target.pixel_rays()
    seen = np.isfinite(rays[..., 0])
    for name in FILTERS:
        mapping = lens_map.compute(source, target, np.eye(3), name)
        row, end_row, column, end_column = mapping.window
        shape = (end_row - row, end_column - column, 4)
        for label, value in (
            ("half limit 65504", 65504.0),
            ("denormal 1e-41", 1e-41),
            ("zero", 0.0),
        ):
            out = resample_colour(np.full(shape, value, np.float32), mapping)
            spacing = float(np.spacing(np.float32(value)))
            error = np.abs(out[seen].astype(np.float64) - float(np.float32(value))).max() / spacing
            yield resampling_row(
                f"{name}: all {label}",
                error if np.isnan(out[~seen]).all() else math.inf,
                seen,
            )
        bad = (shape[0] // 2, shape[1] // 2)
        bad_ray = source.rays(column + bad[1] + 0.5, row + bad[0] + 0.5)
        # Eight source pixels are 45 degrees: further than any filter reads here.
        far = seen & (rays @ bad_ray < math.cos(math.pi / 4))
        clean = np.random.default_rng(5).uniform(1, 2, shape).astype(np.float32)
        before = resample_colour(clean, mapping)
        for label, value in (("infinity", math.inf), ("NaN", math.nan)):
            dirty = clean.copy()
            dirty[bad] = value
            after = resample_colour(dirty, mapping)
            kept = np.array_equal(after[far], before[far]) and not np.isinf(after).any()
            yield resampling_row(f"{name}: one pixel of {label}", 0 if kept else math.inf, far)
    mapping = lens_map.compute(source, target, np.eye(3))
    row, end_row, column, end_column = mapping.window
    for depth in (1e-6, 1.0, 1e9, math.inf):
        sphere = np.full((end_row - row, end_column - column), depth, np.float32)
        out = resample_depth(sphere, False, False, mapping)
        if math.isinf(depth):
            error = 0.0 if np.isposinf(out[seen]).all() else math.inf
        else:
            error = np.abs(out[seen] - sphere[0, 0]).max() / np.spacing(sphere[0, 0])
        yield resampling_row(f"all at {depth:g} m", float(error), seen)


def resampling_row(case: str, error: float, where: Array) -> Row:
    """Return the row of an error in spacings of float32: one rounding is half of one."""
    return simple_row(
        "resampling",
        case,
        np.float32,
        int(where.sum()),
        condition=1,
        error=mpf(error),
        round_trip=mpf(0),
        unit="spacings",
        eps=mpf(1),
    )


def simple_row(
    group: str,
    case: str,
    dtype: type,
    points: int,
    *,
    condition: float,
    error: mpf,
    round_trip: mpf,
    unit: str,
    eps: mpf,
) -> Row:
    bound = ROUNDINGS * eps * mpf(condition)
    return Row(
        group=group,
        case=case,
        source="",
        target="",
        dtype=np.dtype(dtype).name,
        points=points,
        misses=0,
        as_rays=0,
        condition=float(condition),
        error=float(error),
        error_bound=float(bound),
        round_trip_error=float(round_trip),
        round_trip_bound=float(bound),
        unit=unit,
        verdict="ok" if error <= bound and round_trip <= bound else "FAIL",
    )


def measure(lenses: dict[str, Lens]) -> list[Row]:
    """Return the rows of all cases, those of lens pairs for the given lenses."""
    mpmath.mp.dps = DIGITS
    progress = Progress(len(lenses) ** 2, "stability", "lens pairs")
    return [
        *lens_cases(lenses, progress),
        *depth_cases(),
        *special_depth_cases(),
        *gimbal_cases(),
        *far_cases(extreme_lenses()),
        *resampling_cases(),
    ]


# What is written.


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.3e}" if isinstance(v, float) else v for k, v in asdict(row).items()}
            for row in rows
        )


def used(row: Row) -> float:
    """Return the part of its bound that a case uses."""
    pairs = ((row.error, row.error_bound), (row.round_trip_error, row.round_trip_bound))
    return max(error / bound if bound else (math.inf if error else 0) for error, bound in pairs)


def write_summary(path: Path, rows: Sequence[Row]) -> None:
    """Write one line a source lens and dtype, and one a group of other cases."""
    own = [row for row in rows if row.source and len(set(row.case.split(" → "))) == 1]
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        name = f"{row.source} → any lens" if row.source else row.group
        groups.setdefault((name, row.dtype), []).append(row)
    failed = sum(row.verdict == "FAIL" for row in rows)
    lines = [
        f"{len(rows)} cases, {failed} outside their bounds. Errors of lenses are in pixels; "
        "the last number is the largest part of its bound that any case uses.",
        "",
        "| cases | dtype | number | largest condition | largest round-trip error | of the bound "
        "| verdict |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for (name, dtype), members in groups.items():
        counts = collections.Counter(row.verdict for row in members)
        verdicts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in sorted(counts))
        lines.append(
            f"| {name} | {dtype} | {len(members)} "
            f"| {max(row.condition for row in members):.1e} "
            f"| {max(row.round_trip_error for row in members):.1e} "
            f"| {max(map(used, members)):.2f} "
            f"| {verdicts} |"
        )
    for dtype in ("float32", "float64"):
        largest = max((row.round_trip_error for row in own if row.dtype == dtype), default=0)
        lines.append(f"\nFrom a lens to itself and back, {dtype}: off by at most {largest:.1e} px.")
    for row in rows:
        if row.verdict == "FAIL":
            lines.append(f"\nOutside its bound: {row.case} ({row.dtype}).")
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_plot(stem: Path, rows: Sequence[Row]) -> None:
    """Plot every lens pair's round-trip error over the condition of its round trip."""
    with plot(stem, size=(8, 5.5)) as axes:
        for dtype, colour, marker in (("float32", VERMILION, "o"), ("float64", BLUE, "s")):
            eps = float(np.finfo(dtype).eps)
            chosen = [
                r
                for r in rows
                if r.dtype == dtype and r.source and 0 < r.round_trip_bound < math.inf
            ]
            moves = np.array([r.round_trip_bound / (ROUNDINGS * eps) for r in chosen])
            errors = np.array([r.round_trip_error for r in chosen])
            # A round trip without any error is shown at the bottom.
            floor = eps / 100
            axes.scatter(
                moves, np.maximum(errors, floor), s=10, c=colour, marker=marker, alpha=0.5,
                linewidths=0, label=f"{dtype} ({len(chosen)} lens pairs)",
            )  # fmt: skip
            if len(moves):
                line = np.array([moves.min(), moves.max()])
                axes.plot(line, ROUNDINGS * eps * line, c=colour, label=f"bound of {dtype}")
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="absolute condition number of the round trip "
            "/ px per unit relative perturbation",
            ylabel="round-trip error / px (exact ones at the bottom)",
            title="Round trips of every lens pair over the extremes",
        )
        axes.legend()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", required=True, type=Path, help="folder for the results")
    arguments = parser.parse_args()
    rows = measure(extreme_lenses())
    write_csv(arguments.output / "stability.csv", rows)
    write_summary(arguments.output / "stability.md", rows)
    write_plot(arguments.output / "stability", rows)
    failed = [row for row in rows if row.verdict == "FAIL"]
    print(f"{len(rows)} cases, {len(failed)} outside their bounds", file=sys.stderr)
    if failed:
        raise UserError(
            f"{len(failed)} of {len(rows)} cases are outside the bound that their condition "
            f"number implies, the first: {failed[0].case} ({failed[0].dtype}); "
            f"all are in {arguments.output / 'stability.csv'}"
        )


if __name__ == "__main__":
    run(main)
