"""Measure how stable the geometry is: every lens pair over extremes, against mpmath.

Each case has a row: its condition number, its error against a reference of 50 digits, its
round-trip error, the bound that follows from the condition number, and a verdict. Writes
stability.csv (all rows) and stability.md (a summary) into --output. The error over the condition
number goes into stability.svg and stability.png. Fails if a case is outside its bound.

The bound. Rounding moves each datum of a chain of steps by up to one eps. The chain's answer may
then be off by about as much as the exact answer moves. The data of pixel → ray → pixel are:

- the pixel, which moves by eps · (|x| + |principal point|);
- the three components of the ray, each of which moves by eps times itself;
- the answer.

The condition number is the sum of the exact answer's moves, in units of eps and relative to the
image's size. A case passes within ROUNDINGS of these moves. It passes as "ill-conditioned" if they
allow an error of more than half a pixel. Some answers are not unique: at a pole, a seam, the rim of
a 360° lens, or a border between cube faces. These are compared as rays.
"""

import argparse
import collections
import functools
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

try:
    import mpmath
    from mpmath import acos, asin, atan, atan2, cos, hypot, mpf, pi, sin, sqrt, tan
except ModuleNotFoundError:
    sys.exit("error: mpmath is missing: set it up with `make .venv/complete-for-tests`")

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_csv, write_text
from lightfield.core.progress import Progress
from lightfield.geometry.lenses import LENSES, Array, Lens
from lightfield.geometry.lenses.base import CircleFisheye
from lightfield.geometry.lenses.bent import BentLens
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.imaging.plots import BLUE, VERMILION, plot

# Roundings, each of one eps, in the longest chain of operations of one step.
ROUNDINGS = 16
# A point within this many eps of the rim may count as inside or outside.
RIM = 32
# If its bound is larger, in pixels, a case passes as ill-conditioned only.
VAGUE = 0.5
ILL_CONDITIONED = "ok, ill-conditioned"
DIGITS = 50
# The step of differences: far below eps, so that a jump (a seam, a border) has a huge derivative.
STEP = mpf(10) ** -20
# More than the error of mpmath's roots.
TINY = mpf(10) ** -25
INF = mpf("inf")

Vector = Sequence[mpf]


# The reference: every lens by its definition, in mpmath. A missing answer is None.


def half_fov(lens: Any) -> mpf:
    return min(mpf(lens.fov) / 2, pi)


def angles(lens: Any) -> tuple[int, list[mpf]]:
    """Return the sign of a polynomial lens's θ, and the coefficients of |θ| over r."""
    first_nonzero = next(k for k in lens.coefficients[1:] if k)
    sign = -1 if first_nonzero > 0 else 1
    return sign, [-sign * mpf(k) for k in lens.coefficients]


def radii(lens: Any) -> list[mpf]:
    """Return the coefficients of a lens's r / f over θ, from the constant upwards."""
    if lens.name == "f_theta":
        return [mpf(0), mpf(1), *map(mpf, lens.coefficients)]
    coefficients = []
    for k in (1, *lens.coefficients):
        coefficients += [mpf(0), mpf(k)]
    return coefficients


def value(coefficients: Sequence[mpf], t: mpf) -> mpf:
    return mpmath.polyval(coefficients, t, asc=True)


def positive_roots(coefficients: Sequence[mpf]) -> list[mpf]:
    trimmed = list(np.trim_zeros(list(coefficients), "b"))
    roots = mpmath.polyroots(trimmed, maxsteps=500, extraprec=300, asc=True)
    return [r.real for r in roots if abs(r.imag) < TINY < r.real]


@functools.cache
def rise(lens: Any) -> mpf:
    """Return where a lens's polynomial stops increasing, or its θ reaches π."""
    blenders = lens.name == "polynomial"
    coefficients = angles(lens)[1] if blenders else radii(lens)
    ends = positive_roots([i * c for i, c in enumerate(coefficients)][1:])
    if blenders:
        return min(ends + positive_roots([coefficients[0] - pi, *coefficients[1:]]))
    return min([*ends, +pi])


def inverse(coefficients: Sequence[mpf], goal: mpf, end: mpf) -> mpf | None:
    """Return t in [0, end] at which an increasing polynomial is ``goal``."""
    first = coefficients[0]
    last = value(coefficients, end)
    if first == goal or last == goal:
        return mpf(0) if first == goal else end
    if not first < goal < last:
        return None
    solver = {"solver": "anderson", "maxsteps": 300, "verify": False}
    return mpmath.findroot(lambda t: value(coefficients, t) - goal, (mpf(0), end), **solver)


def polynomial_radius(lens: Any, theta: mpf) -> mpf | None:
    sign, coefficients = angles(lens)
    if 0 <= theta < coefficients[0] < max(pixel_size(lens)) * coefficients[1]:
        return mpf(0)  # the hole around the axis, smaller than a pixel
    r = inverse(coefficients, theta, rise(lens))
    return None if r is None else sign * r


def equisolid_angle(lens: Any, r: mpf) -> mpf | None:
    sine = r / (2 * mpf(lens.focal_length))
    return 2 * asin(sine) if sine <= 1 else None


def orthographic_angle(lens: Any, r: mpf) -> mpf | None:
    sine = r * sin(half_fov(lens))
    return asin(sine) if sine <= 1 else None


# The lenses of calibrated cameras, as they are published, with r in focal lengths. Each has θ at r,
# r at θ, and the largest θ, whose r may be infinite.


class Division:
    """Fitzgibbon: tan θ = r / (1 + k r²)."""

    def __init__(self, lens: Any) -> None:
        self.k = mpf(lens.coefficients[0])

    def angle(self, r: mpf) -> mpf:
        return atan2(r, 1 + self.k * r * r)

    def radius(self, t: mpf) -> mpf:
        # The smallest positive root of k r² sin θ − r cos θ + sin θ.
        root = sqrt(cos(t) ** 2 - 4 * self.k * sin(t) ** 2)
        return (cos(t) - root) / (2 * self.k * sin(t)) if t else mpf(0)

    @functools.cached_property
    def last(self) -> tuple[mpf, mpf]:
        if self.k < 0:
            return +pi, INF
        return atan(1 / (2 * sqrt(self.k))), 1 / sqrt(self.k)


class FovModel:
    """Devernay and Faugeras: r = atan(2 tan θ tan(ω / 2)) / ω."""

    def __init__(self, lens: Any) -> None:
        self.omega = mpf(lens.coefficients[0])

    def angle(self, r: mpf) -> mpf:
        return atan(tan(r * self.omega) / (2 * tan(self.omega / 2)))

    def radius(self, t: mpf) -> mpf:
        return atan(2 * tan(t) * tan(self.omega / 2)) / self.omega

    @functools.cached_property
    def last(self) -> tuple[mpf, mpf]:
        return pi / 2, pi / (2 * self.omega)


class Unified:
    """Mei and Rives: r = sin θ / (cos θ + ξ), and their inverse."""

    def __init__(self, lens: Any) -> None:
        self.xi = mpf(lens.coefficients[0])

    def angle(self, r: mpf) -> mpf:
        factor = (self.xi + sqrt(1 + (1 - self.xi**2) * r * r)) / (1 + r * r)
        return atan2(factor * r, factor - self.xi)

    def radius(self, t: mpf) -> mpf:
        return sin(t) / (cos(t) + self.xi)

    @functools.cached_property
    def last(self) -> tuple[mpf, mpf]:
        if self.xi > 1:
            return acos(-1 / self.xi), 1 / sqrt(self.xi**2 - 1)
        return acos(-self.xi), INF


class ExtendedUnified:
    """Khomutenko et al.: r = sin θ / (α d + (1 − α) cos θ), and their inverse."""

    def __init__(self, lens: Any) -> None:
        self.alpha, self.beta = map(mpf, lens.coefficients)

    def angle(self, r: mpf) -> mpf:
        alpha, beta = self.alpha, self.beta
        root = sqrt(1 - (2 * alpha - 1) * beta * r * r)
        return atan2(r, (1 - beta * alpha**2 * r * r) / (alpha * root + 1 - alpha))

    def radius(self, t: mpf) -> mpf:
        d = sqrt(self.beta * sin(t) ** 2 + cos(t) ** 2)
        return sin(t) / (self.alpha * d + (1 - self.alpha) * cos(t))

    @functools.cached_property
    def last(self) -> tuple[mpf, mpf]:
        # cos θ = −w d = −w √(β sin² θ + cos² θ)
        w = self.alpha / (1 - self.alpha)
        if self.alpha > 0.5:
            w = 1 / w
        theta = atan2(sqrt(1 - w * w), -w * sqrt(self.beta))
        return theta, 1 / sqrt(self.beta * (2 * self.alpha - 1)) if self.alpha > 0.5 else INF


class DoubleSphere:
    """Usenko et al.: r = sin θ / (α d2 + (1 − α)(ξ + cos θ)), and their inverse."""

    def __init__(self, lens: Any) -> None:
        self.xi, self.alpha = map(mpf, lens.coefficients)

    def angle(self, r: mpf) -> mpf:
        xi, alpha = self.xi, self.alpha
        z = (1 - alpha**2 * r * r) / (alpha * sqrt(1 - (2 * alpha - 1) * r * r) + 1 - alpha)
        factor = (z * xi + sqrt(z * z + (1 - xi**2) * r * r)) / (z * z + r * r)
        return atan2(factor * r, factor * z - xi)

    def divisor(self, t: mpf) -> mpf:
        d2 = sqrt(sin(t) ** 2 + (self.xi + cos(t)) ** 2)
        return self.alpha * d2 + (1 - self.alpha) * (self.xi + cos(t))

    def radius(self, t: mpf) -> mpf:
        return sin(t) / self.divisor(t)

    @functools.cached_property
    def last(self) -> tuple[mpf, mpf]:
        # The paper's w2 is a little less than the θ at which r stops growing.
        if self.alpha > 0.5:
            r = 1 / sqrt(2 * self.alpha - 1)
            return self.angle(r), r
        return mpmath.findroot(self.divisor, (mpf(0), +pi), "anderson", maxsteps=300), INF


PUBLISHED: dict[str, type[Any]] = {
    "division": Division,
    "fov_model": FovModel,
    "unified": Unified,
    "extended_unified": ExtendedUnified,
    "double_sphere": DoubleSphere,
}


@functools.cache
def published(lens: Any) -> Any:
    """Return the published model of a lens."""
    return PUBLISHED[lens.name](lens)


def published_angle(lens: Any, r: mpf) -> mpf | None:
    """Return θ at r, in mm, of a lens that is published with its inverse."""
    model = published(lens)
    r = r / lens.focal_length
    return model.angle(r) if r <= model.last[1] else None


def published_radius(lens: Any, theta: mpf) -> mpf | None:
    """Return r, in mm, at θ, of a lens that is published with its inverse."""
    model = published(lens)
    last, r = model.last
    if theta == last:
        return None if r == INF else lens.focal_length * r
    return lens.focal_length * model.radius(theta) if theta < last else None


def polynomial_of_angle(lens: Any, theta: mpf) -> mpf | None:
    """Return r, in mm, at θ, of a lens whose r is a polynomial of θ."""
    return lens.focal_length * value(radii(lens), theta) if theta <= rise(lens) else None


def angle_of_polynomial(lens: Any, r: mpf) -> mpf | None:
    """Return θ at r, in mm, of a lens whose r is a polynomial of θ."""
    return inverse(radii(lens), r / lens.focal_length, rise(lens))


# θ at r, and r at θ, each None if missing; r as in the lenses' own definitions.
RADIAL: dict[str, tuple[Callable[[Any, mpf], mpf | None], Callable[[Any, mpf], mpf | None]]] = {
    "rectilinear": (
        lambda lens, r: atan(r / lens.focal_length),
        lambda lens, t: lens.focal_length * tan(t) if t < pi / 2 else None,
    ),
    "equidistant": (
        lambda lens, r: r * half_fov(lens),
        lambda lens, t: t / half_fov(lens),
    ),
    "equisolid": (
        equisolid_angle,
        lambda lens, t: 2 * lens.focal_length * sin(t / 2),
    ),
    "stereographic": (
        lambda lens, r: 2 * atan(r * tan(half_fov(lens) / 2)),
        lambda lens, t: tan(t / 2) / tan(half_fov(lens) / 2),
    ),
    "orthographic": (
        orthographic_angle,
        lambda lens, t: sin(t) / sin(half_fov(lens)) if t <= pi / 2 else None,
    ),
    "polynomial": (
        lambda lens, r: angles(lens)[0] * value(angles(lens)[1], r),
        polynomial_radius,
    ),
    **dict.fromkeys(("kannala_brandt", "f_theta"), (angle_of_polynomial, polynomial_of_angle)),
    **dict.fromkeys(PUBLISHED, (published_angle, published_radius)),
}


@functools.cache
def pixel_size(lens: Lens) -> tuple[mpf, mpf]:
    """Return a pixel's width and height in the unit of the lens's r."""
    sides = (2, 2) if isinstance(lens, CircleFisheye) else lens.sensor
    return mpf(sides[0]) / lens.width, mpf(sides[1]) / lens.height


@functools.cache
def largest_radius(lens: Any) -> mpf:
    if lens.name == "rectilinear":
        return INF
    last = half_fov(lens)
    if lens.name == "polynomial":
        last = min(last, value(angles(lens)[1], rise(lens)))
    elif lens.name in ("kannala_brandt", "f_theta"):
        last = min(last, rise(lens))
    elif lens.name in PUBLISHED:
        end, r = published(lens).last
        if float(last) >= float(end):
            return r * lens.focal_length
    return abs(RADIAL[lens.name][1](lens, last))


# The lenses that are not quite radial, as they are published, with y down.


class BrownConrady:
    """OpenCV's projectPoints. Its plane is that of tan θ."""

    def __init__(self, lens: Any) -> None:
        self.k1, self.k2, self.p1, self.p2, *self.others = map(mpf, lens.coefficients)
        self.last = tan(mpf(lens.fov) / 2) if lens.fov < math.pi else mpf(math.tan(math.pi / 2))

    def place(self, theta: mpf) -> mpf | None:
        return tan(theta) if theta < pi / 2 else None

    def angle(self, t: mpf) -> mpf:
        return atan(t)

    def radius(self, t: mpf) -> mpf:
        q = t * t
        k3, k4, k5, k6 = self.others
        above = 1 + self.k1 * q + self.k2 * q**2 + k3 * q**3
        return t * above / (1 + k4 * q + k5 * q**2 + k6 * q**3)

    def bend(self, x: mpf, y: mpf) -> Vector:
        q = x * x + y * y
        return (
            2 * self.p1 * x * y + self.p2 * (q + 2 * x * x),
            self.p1 * (q + 2 * y * y) + 2 * self.p2 * x * y,
        )

    def steepest(self, t: mpf) -> mpf:
        return 6 * t * hypot(self.p1, self.p2)


class ThinPrismFisheye:
    """COLMAP's THIN_PRISM_FISHEYE. Its plane is that of θ."""

    def __init__(self, lens: Any) -> None:
        self.k1, self.k2, self.p1, self.p2, self.k3, self.k4, *self.s = map(mpf, lens.coefficients)
        self.last = half_fov(lens)

    def place(self, theta: mpf) -> mpf | None:
        return theta

    def angle(self, t: mpf) -> mpf:
        return t

    def radius(self, t: mpf) -> mpf:
        q = t * t
        return t * (1 + self.k1 * q + self.k2 * q**2 + self.k3 * q**3 + self.k4 * q**4)

    def bend(self, x: mpf, y: mpf) -> Vector:
        q = x * x + y * y
        return (
            2 * self.p1 * x * y + self.p2 * (q + 2 * x * x) + self.s[0] * q,
            2 * self.p2 * x * y + self.p1 * (q + 2 * y * y) + self.s[1] * q,
        )

    def steepest(self, t: mpf) -> mpf:
        return 6 * t * hypot(self.p1, self.p2) + 2 * t * hypot(*self.s)


class Fisheye624:
    """Project Aria's FisheyeRadTanThinPrism. Its plane is that of r."""

    def __init__(self, lens: Any) -> None:
        *self.k, self.p0, self.p1, self.s0, self.s1, self.s2, self.s3 = map(mpf, lens.coefficients)
        self.terms = [mpf(0), mpf(1)]
        for k in self.k:
            self.terms += [mpf(0), k]
        ends = positive_roots([i * c for i, c in enumerate(self.terms)][1:])
        self.rim = min([*ends, half_fov(lens)])
        self.last = value(self.terms, self.rim)

    def place(self, theta: mpf) -> mpf | None:
        return value(self.terms, theta) if theta <= self.rim else None

    def angle(self, t: mpf) -> mpf:
        return inverse(self.terms, min(t, self.last), self.rim)

    def radius(self, t: mpf) -> mpf:
        return t

    def bend(self, x: mpf, y: mpf) -> Vector:
        q = x * x + y * y
        return (
            self.p0 * (q + 2 * x * x) + 2 * self.p1 * x * y + self.s0 * q + self.s1 * q * q,
            self.p1 * (q + 2 * y * y) + 2 * self.p0 * x * y + self.s2 * q + self.s3 * q * q,
        )

    def steepest(self, t: mpf) -> mpf:
        prism = hypot(self.s0 + 2 * self.s1 * t * t, self.s2 + 2 * self.s3 * t * t)
        return 6 * t * hypot(self.p0, self.p1) + 2 * t * prism


BENT: dict[str, type[Any]] = {
    "brown_conrady": BrownConrady,
    "thin_prism_fisheye": ThinPrismFisheye,
    "fisheye624": Fisheye624,
}


@functools.cache
def bent(lens: Any) -> Any:
    """Return the published model of a lens that is not quite radial."""
    return BENT[lens.name](lens)


@functools.cache
def largest_place(lens: Any) -> mpf:
    """Return the t at which the image of a bent lens may fold, or its last."""
    model = bent(lens)

    def spread(t: mpf) -> mpf:
        slope = mpmath.diff(model.radius, t)
        return min(slope, model.radius(t) / t) - model.steepest(t)

    places = [mpf(t) for t in np.sinh(np.linspace(0, math.asinh(model.last), 513))[1:-1]]
    places.append(model.last)
    folded = next((i for i, t in enumerate(places) if spread(t) <= 0), None)
    if folded is None:
        return model.last
    low = places[folded - 1] if folded else TINY
    return mpmath.findroot(spread, (low, places[folded]), "anderson", maxsteps=300, verify=False)


def bent_image(lens: Any, x: mpf, y: mpf) -> Vector:
    """Return where a bent lens shows a place in its plane: in focal lengths, y down."""
    t = hypot(x, y)
    ratio = bent(lens).radius(t) / t if t else mpf(1)
    return tuple(ratio * c + d for c, d in zip((x, y), bent(lens).bend(x, y), strict=True))


def missing(lens: Any, goal: Vector, place: Vector) -> Vector:
    """Return how far the image of a place in a bent lens's plane is from its goal."""
    return tuple(a - b for a, b in zip(goal, bent_image(lens, *place), strict=True))


def bent_place(lens: Any, goal: Vector) -> Vector | None:
    """Return the place within a bent lens that it shows at ``goal``, in focal lengths.

    Newton's method, from the axis. Steps that leave the lens or bring no gain are shortened.
    """
    x, y = mpf(0), mpf(0)
    offset = missing(lens, goal, (x, y))
    for _ in range(200):
        if mpmath.norm(offset) <= TINY**1.5 * mpmath.norm(goal):
            return x, y
        right = [
            (a - b) / STEP for a, b in zip(offset, missing(lens, goal, (x + STEP, y)), strict=True)
        ]
        down = [
            (a - b) / STEP for a, b in zip(offset, missing(lens, goal, (x, y + STEP)), strict=True)
        ]
        determinant = right[0] * down[1] - right[1] * down[0]
        dx = (offset[0] * down[1] - offset[1] * down[0]) / determinant
        dy = (right[0] * offset[1] - right[1] * offset[0]) / determinant
        for halvings in range(60):
            new = x + dx / 2**halvings, y + dy / 2**halvings
            rest = missing(lens, goal, new)
            is_inside = hypot(*new) <= largest_place(lens) * (1 + TINY)
            if is_inside and mpmath.norm(rest) < mpmath.norm(offset):
                break
        else:
            return None
        (x, y), offset = new, rest
    return None


def bent_rim(lens: Any, goal: Vector) -> mpf:
    """Return the distance of a bent lens's rim from its centre in the direction of ``goal``."""
    azimuth = atan2(goal[1], goal[0])
    for _ in range(60):
        t = largest_place(lens)
        x, y = bent_image(lens, t * cos(azimuth), t * sin(azimuth))
        azimuth += atan2(goal[1] * x - goal[0] * y, goal[0] * x + goal[1] * y)
    return hypot(x, y)


def bent_ray_and_excess(lens: Any, goal: Vector) -> tuple[Vector | None, mpf]:
    """Return the exact ray of a bent lens's image in focal lengths, and how far it lies outside."""
    place = bent_place(lens, goal)
    if place is None:
        return None, hypot(*goal) / bent_rim(lens, goal) - 1
    t = hypot(*place)
    model = bent(lens)
    excess = model.radius(t) / model.radius(largest_place(lens)) - 1
    theta = model.angle(t)
    right, down = (c / t for c in place) if t else (mpf(0), mpf(0))
    return (sin(theta) * right, -sin(theta) * down, -cos(theta)), excess


def bent_place_and_excess(lens: Any, ray: Vector) -> tuple[Vector | None, mpf]:
    """Return the exact place of a ray in a bent lens's plane, and how far it lies outside."""
    side = hypot(ray[0], ray[1])
    model = bent(lens)
    t = model.place(atan2(side, -ray[2]))
    if t is None or t > largest_place(lens) * (1 + TINY):
        return None, mpf(1)
    place = (t * ray[0] / side, -t * ray[1] / side) if side else (mpf(0), mpf(0))
    return place, model.radius(t) / model.radius(largest_place(lens)) - 1


def bent_pixel(lens: Any, x: mpf, y: mpf) -> Vector:
    """Return the pixel of a place in a bent lens's plane."""
    sides = zip(lens.center, bent_image(lens, x, y), pixel_size(lens), strict=True)
    return tuple(m + c * lens.focal_length / size for m, c, size in sides)


# The right, up and forward axes of faces f b l r u d.
CUBE = (
    ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 0, -1), (0, 1, 0), (-1, 0, 0)),
    ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
    ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((1, 0, 0), (0, 0, -1), (0, -1, 0)),
)


@functools.cache
def ray_and_excess(lens: Any, x: mpf, y: mpf) -> tuple[Vector | None, mpf]:
    """Return the exact ray of a pixel, and how far outside the lens it lies (negative: inside)."""
    if lens.name == "cube_map":
        face = min(int(x // lens.height), 5)
        u = 2 * (x - face * lens.height) / lens.height - 1
        v = 1 - 2 * y / lens.height
        ray = [u * right + v * up + ahead for right, up, ahead in zip(*CUBE[face], strict=True)]
        return tuple(c / mpmath.norm(ray) for c in ray), mpf(-1)
    if lens.name == "equirectangular":
        (west, east), (south, north) = lens.longitude, lens.latitude
        longitude = west + (mpf(east) - west) * x / lens.width
        latitude = north - (mpf(north) - south) * y / lens.height
        across = cos(latitude)
        ray = (across * sin(longitude), sin(latitude), -across * cos(longitude))
        return ray, abs(latitude) / (pi / 2) - 1
    u = (x - lens.center[0]) * pixel_size(lens)[0]
    v = (lens.center[1] - y) * pixel_size(lens)[1]
    if lens.name in BENT:
        return bent_ray_and_excess(lens, (u / lens.focal_length, -v / lens.focal_length))
    r = hypot(u, v)
    theta = RADIAL[lens.name][0](lens, r)
    excess = r / largest_radius(lens) - 1
    if theta is None:
        return None, excess
    right, up = (u / r, v / r) if r else (mpf(0), mpf(1))
    return (sin(theta) * right, sin(theta) * up, -cos(theta)), excess


def pixel_and_excess(lens: Any, ray: Vector) -> tuple[Vector | None, mpf]:
    """Return the exact pixel of a ray, and how far outside the lens it lies (negative: inside)."""
    if lens.name == "cube_map":
        faces = [[mpmath.fdot(axis, ray) for axis in axes] for axes in CUBE]
        face = max(range(6), key=lambda i: faces[i][2])
        u, v, side = faces[face]
        half = mpf(lens.height) / 2
        return (half * (1 + u / side) + face * lens.height, half * (1 - v / side)), mpf(-1)
    if lens.name == "equirectangular":
        (west, east), (south, north) = lens.longitude, lens.latitude
        longitude = atan2(ray[0], -ray[2]) if ray[0] or ray[2] else mpf(0)
        latitude = atan2(ray[1], hypot(ray[0], ray[2]))
        middle = (mpf(west) + east) / 2
        longitude -= 2 * pi * mpmath.floor((longitude - middle) / (2 * pi) + 0.5)
        x = (longitude - west) / (mpf(east) - west) * lens.width
        return (x, (north - latitude) / (mpf(north) - south) * lens.height), mpf(-1)
    if lens.name in BENT:
        place, excess = bent_place_and_excess(lens, ray)
        return place and bent_pixel(lens, *place), excess
    side = hypot(ray[0], ray[1])
    r = RADIAL[lens.name][1](lens, atan2(side, -ray[2]))
    if r is None:
        return None, mpf(1)
    right, up = (ray[0] / side, ray[1] / side) if side else (mpf(0), mpf(0))
    x = lens.center[0] + r * right / pixel_size(lens)[0]
    y = lens.center[1] - r * up / pixel_size(lens)[1]
    return (x, y), abs(r) / largest_radius(lens) - 1


def exact_ray(lens: Lens, pixel: Vector) -> Vector | None:
    return ray_and_excess(lens, *pixel)[0]


def exact_pixel(lens: Lens, ray: Vector) -> Vector | None:
    return pixel_and_excess(lens, ray)[0]


def exact_pair(source: Lens, target: Lens, pixel: Vector) -> Vector | None:
    """Return the target's exact pixel for a pixel of the source."""
    ray = exact_ray(source, pixel)
    return None if ray is None else exact_pixel(target, ray)


def ray_within(lens: Lens, pixel: Vector, eps: mpf) -> Vector | None:
    """Return the exact ray of a pixel; one that rounding carried beyond the rim is moved back."""
    ray = exact_ray(lens, pixel)
    if ray is not None:
        return ray
    offset = [c - m for c, m in zip(pixel, lens.center, strict=True)]
    shrink = max(1 - ROUNDINGS * eps * extent(lens, pixel) / mpmath.norm(offset), mpf(0))
    return exact_ray(lens, [m + shrink * o for m, o in zip(lens.center, offset, strict=True)])


def distance(a: Vector, b: Vector) -> mpf:
    """Return the angle between two unit rays."""
    return 2 * asin(min(mpmath.norm([p - q for p, q in zip(a, b, strict=True)]) / 2, 1))


# How far the exact answers move as their data move.


def moves(answer: Callable[[Vector], Vector | None], data: Vector, sizes: Vector) -> mpf:
    """Return the sum of the answer's largest moves with each datum, per eps of the datum's size.

    It is infinite where an answer is missing.
    """
    total = mpf(0)
    for i, size in enumerate(sizes):
        step = [STEP * size * (i == j) for j in range(len(data))]
        if not size:
            continue
        above = answer(tuple(d + s for d, s in zip(data, step, strict=True)))
        below = answer(tuple(d - s for d, s in zip(data, step, strict=True)))
        if above is None or below is None:
            return INF
        total += max(abs(a - b) for a, b in zip(above, below, strict=True)) / (2 * STEP)
    return total


def extent(lens: Lens, pixel: Vector) -> mpf:
    """Return the size of the numbers that a pixel coordinate is computed from."""
    return max(abs(c) + abs(m) for c, m in zip(pixel, lens.center, strict=True))


def ray_moves(lens: Lens, pixel: Vector) -> mpf:
    """Return the moves of a pixel's ray with its coordinates, in radians per eps."""
    return moves(functools.partial(exact_ray, lens), pixel, [extent(lens, pixel)] * 2)


def pixel_moves(lens: Lens, ray: Vector) -> mpf:
    """Return the moves of a ray's pixel with its components, in pixels per eps."""
    return moves(functools.partial(exact_pixel, lens), ray, ray)


def pair_moves(source: Lens, target: Lens, pixel: Vector) -> mpf:
    """Return the moves of the target's pixel with the source's, in pixels per eps."""
    return moves(functools.partial(exact_pair, source, target), pixel, [extent(source, pixel)] * 2)


# A case is a row of the table, by column; errors and bounds are in pixels.

Case = dict[str, Any]


class Worst:
    """The largest error relative to its bound among the points of a case, and its counts.

    - ``vague``: whether any bound was larger than VAGUE.
    - ``as_rays``: how many answers were compared as rays.
    - ``wrong``: how many of these were wrong.
    """

    def __init__(self) -> None:
        self.error = mpf(0)
        self.bound = mpf(0)
        self.vague = False
        self.as_rays = 0
        self.wrong = 0

    def add(self, error: mpf, bound: mpf) -> None:
        self.vague |= bool(bound > VAGUE)
        if self.bound == 0 or error * self.bound > self.error * bound:
            self.error = error
            self.bound = bound

    def compare(
        self,
        lens: Lens,
        computed: Vector,
        answer: Vector,
        bound: mpf,
        ray: Vector,
        moves: mpf,
        eps: mpf,
    ) -> bool:
        """Compare a ``computed`` pixel with the exact ``answer``; return whether it is in bounds.

        A bound larger than the image says nothing. Then, and if the answer is not unique, the rays
        are compared: the pixel's must equal ``ray`` to within ``moves``, in eps.
        """
        error = max(abs(a - b) for a, b in zip(computed, answer, strict=True))
        if error <= bound < max(lens.width, lens.height):
            self.add(error, bound)
            return True
        self.as_rays += 1
        computed_ray = ray_within(lens, computed, eps)
        if computed_ray is None or distance(computed_ray, ray) > ROUNDINGS * eps * moves:
            self.wrong += 1
            self.add(error, bound)
        return False


class Point:
    """Exact answers for one point of a lens pair, for comparison with both dtypes' answers."""

    def __init__(self, source: Lens, target: Lens, pixel: Vector) -> None:
        self.source = source
        self.target = target
        self.pixel = pixel
        self.ray, self.excess = ray_and_excess(source, *pixel)
        self.answer = None
        self.answer_excess = mpf(1)
        if self.ray is None:
            return
        self.answer, self.answer_excess = pixel_and_excess(target, self.ray)
        self.ray_moves = ray_moves(source, pixel) + 1
        if self.answer is not None:
            self.moves = (
                pair_moves(source, target, pixel)
                + pixel_moves(target, self.ray)
                + extent(target, self.answer)
            )

    @property
    def is_seen(self) -> bool:
        return self.answer is not None and self.excess <= 0 and self.answer_excess <= 0

    def is_at_the_rim(self, eps: mpf) -> bool:
        return bool(min(abs(self.excess), abs(self.answer_excess)) <= RIM * eps)

    def check(
        self, computed: Vector, returned: Sequence[float], eps: mpf, forward: Worst, back: Worst
    ) -> mpf:
        """Compare the target's ``computed`` pixel, and the source's pixel ``returned`` from it.

        Returns the condition number, relative to the image; 0 if only rays were compared.
        """
        source = self.source
        target = self.target
        bound = ROUNDINGS * eps * self.moves
        moved = ray_moves(target, computed)
        within = forward.compare(
            target, computed, self.answer, bound, self.ray, self.ray_moves + moved, eps
        )
        ray = exact_ray(target, computed)
        if ray is not None:
            per_eps = pair_moves(target, source, computed)
            size = extent(source, self.pixel)
            forward_bound = bound
            bound = ROUNDINGS * eps * (per_eps + pixel_moves(source, ray) + size)
            bound += per_eps / extent(target, computed) * forward_bound
            if not math.isnan(returned[0]):
                returned_pixel = [mpf(float(c)) for c in returned]
                moved += 2 * self.ray_moves
                back.compare(source, returned_pixel, self.pixel, bound, self.ray, moved, eps)
            # The way back may end outside only where the rim is within the bound.
            elif abs(self.excess) * size <= bound or abs(self.answer_excess) <= RIM * eps:
                back.as_rays += 1
            else:
                back.add(INF, bound)
        return self.moves / extent(target, self.answer) if within else mpf(0)


def measure(lenses: dict[str, Lens]) -> Iterator[Case]:
    """Yield the cases of every lens as source and target: pixel → ray → pixel, and back again."""
    mpmath.mp.dps = DIGITS
    progress = Progress(len(lenses) ** 2, "stability", "lens pairs")
    for source_name, source in lenses.items():
        pixels = places(source)
        for target_name, target in lenses.items():
            exact = [Point(source, target, (mpf(float(x)), mpf(float(y)))) for x, y in pixels]
            for dtype in (np.float32, np.float64):
                yield case(f"{source_name} → {target_name}", pixels, exact, dtype)
            progress.done()


def case(name: str, pixels: Array, exact: Sequence[Point], dtype: type) -> Case:
    eps = mpf(float(np.finfo(dtype).eps))
    source = exact[0].source
    target = exact[0].target
    answers = target.pixels(source.rays(*pixels.T.astype(dtype)))
    back = source.pixels(target.rays(*answers.T))
    forward = Worst()
    round_trip = Worst()
    conditions = [mpf(0)]
    misses = 0
    wrong = 0
    for point, answer, returned in zip(exact, answers, back, strict=True):
        missed = np.isnan(answer).all()
        if point.is_seen and not missed:
            computed = [mpf(float(c)) for c in answer]
            conditions.append(point.check(computed, returned, eps, forward, round_trip))
        else:
            # Both must agree that it is a miss, but for points at the rim.
            misses += 1
            agree = missed and not point.is_seen
            wrong += not agree and not point.is_at_the_rim(eps)
    passes = all(worst.error <= worst.bound for worst in (forward, round_trip))
    passes = passes and not wrong and not forward.wrong
    if not passes:
        verdict = "FAIL"
    elif forward.vague or round_trip.vague:
        verdict = ILL_CONDITIONED
    else:
        verdict = "ok"
    return {
        "group": "lens pair",
        "case": name,
        "source": type(source).__name__,
        "target": type(target).__name__,
        "dtype": np.dtype(dtype).name,
        "points": len(pixels),
        "misses": misses,
        "as_rays": forward.as_rays + round_trip.as_rays,
        "condition": float(max(conditions)),
        "error": float(forward.error),
        "error_bound": float(forward.bound),
        "round_trip_error": float(round_trip.error),
        "round_trip_bound": float(round_trip.bound),
        "unit": "px",
        "verdict": verdict,
    }


def extreme_lenses() -> dict[str, Lens]:
    """Return the lenses of the cases, by name."""
    odd = {"width": 65, "height": 33}
    wide = {"width": 2048, "height": 1536}
    pixel = {"width": 1, "height": 1}
    shifted = {**wide, "principal_point": (-300.25, 2000.5)}
    # Each name begins with the lens; a field of view is in degrees.
    arguments: dict[str, dict[str, Any]] = {
        "rectilinear 0.01°": wide | focal(0.01),
        "rectilinear 90° odd": odd | focal(90),
        "rectilinear 179.9°": wide | focal(179.9),
        "rectilinear 1e-6 mm": wide | {"focal_length": 1e-6},
        "rectilinear 1e6 mm": wide | {"focal_length": 1e6},
        "rectilinear 1×1 px": pixel | {"focal_length": 18},
        "rectilinear shifted": shifted | {"focal_length": 18, "sensor_size": (36, 20)},
        "equidistant 0.01°": wide | {"fov": 0.01},
        "equidistant 180° odd": odd | {"fov": 180},
        "equidistant 180° 1×1 px": pixel | {"fov": 180},
        "equidistant 220° shifted": shifted | {"fov": 220},
        "equidistant 360°": wide | {"fov": 360},
        "equisolid 180° 1e-6 mm": wide | {"focal_length": 1e-6, "fov": 180},
        "equisolid 180° 1e6 mm": wide | {"focal_length": 1e6, "fov": 180},
        "equisolid 220° odd": odd | {"focal_length": 10.5, "fov": 220},
        "equisolid 360°": wide | {"focal_length": 9, "fov": 360},
        "stereographic 0.01°": wide | {"fov": 0.01},
        "stereographic 180° odd": odd | {"fov": 180},
        "stereographic 359.9999°": wide | {"fov": 359.9999},
        "orthographic 0.01°": wide | {"fov": 0.01},
        "orthographic 180°": wide | {"fov": 180},
        "polynomial Blender's": odd | {"coefficients": BLENDERS, "fov": 180},
        "polynomial turning": wide | {"coefficients": (0, -0.1, 0, 4e-4, 0), "fov": 360},
        "polynomial turned 220°": wide | {"coefficients": (0, 0.08, 1e-4, 1e-5, 0), "fov": 220},
        "kannala_brandt 360°": wide | {"coefficients": (0.01, -0.002, 3e-4, 0), "focal_length": 6},
        "kannala_brandt turning": odd | {"coefficients": (-0.3, 0, 0, 0), "focal_length": 12},
        "division barrel": odd | {"coefficients": (-0.35,), "focal_length": 6},
        "division turning": wide | {"coefficients": (0.3,), "focal_length": 12},
        "fov_model": shifted | {"coefficients": (0.93,), "focal_length": 9},
        "fov_model 3.1": wide | {"coefficients": (3.1,), "focal_length": 20},
        "unified 0.9": odd | {"coefficients": (0.9,), "focal_length": 12},
        "unified turning": wide | {"coefficients": (1e3,), "focal_length": 12e3},
        "extended_unified turning": wide | {"coefficients": (0.63, 1.02), "focal_length": 6},
        "extended_unified 0.3": odd | {"coefficients": (0.3, 100.0), "focal_length": 12},
        "double_sphere turning": wide | {"coefficients": (-0.17, 0.59), "focal_length": 6},
        "double_sphere 0.999": odd | {"coefficients": (0.999, 0.3), "focal_length": 6},
        "f_theta turning": wide | {"coefficients": (-0.1, 0, 0, -1e-3), "focal_length": 9},
        "brown_conrady turning": wide | {"coefficients": TURNING, "focal_length": 17},
        "brown_conrady rational": odd | {"coefficients": RATIONAL, "focal_length": 9},
        "thin_prism_fisheye 360°": wide | {"coefficients": THIN_PRISM, "focal_length": 6},
        "thin_prism_fisheye turning": odd | {"coefficients": STRONG_PRISM, "focal_length": 9},
        "fisheye624 turning": wide | {"coefficients": ARIAS, "focal_length": 12},
        "fisheye624 folding": shifted | {"coefficients": FOLDING, "focal_length": 12},
        "equirectangular": wide,
        "equirectangular odd": odd,
        "equirectangular 0.01°": wide | dict.fromkeys(("longitude", "latitude"), CORNER),
        "cube map": {"width": 6 * 1024, "height": 1024},
        "cube map 1 px": {"width": 6, "height": 1},
    }
    lenses = {}
    for name, settings in arguments.items():
        if "fov" in settings:
            settings = {**settings, "fov": math.radians(settings["fov"])}
        kind = name.replace("cube map", "cube_map").split()[0]
        lenses[name] = LENSES[kind](**settings)
    return lenses


BLENDERS = (-1.1735144e-05, -0.01998874, -3.3525323e-06, 3.0992753e-06, -2.6064646e-08)
CORNER = (0, math.radians(0.01))
TURNING = (-0.25, 0.09, 1e-3, -8e-4, -0.014, 0, 0, 0)
RATIONAL = (8.1, 4.2, 1e-3, -8e-4, 0.2, 8.4, 6.1, 1.0)
THIN_PRISM = (-0.01, 0.03, 2e-3, -1e-3, -0.02, 0.003, 3e-3, -2e-3)
STRONG_PRISM = (-0.2, 0.0, 0.02, -0.03, 0.0, 0.0, 0.04, 0.02)
# A SLAM camera of Project Aria's glasses, and a lens whose prism alone folds its image.
ARIAS = (
    -0.027,
    0.102,
    -0.072,
    0.0125,
    1.24e-3,
    -4.15e-4,
    5.5e-4,
    5.8e-4,
    -1.2e-3,
    -4e-4,
    -6e-4,
    1e-5,
)
FOLDING = (0, 0, 0, 0, 0, 0, 0.01, -0.02, 0.05, 0.02, -0.1, 0.01)


def focal(fov: float) -> dict[str, float]:
    return {"focal_length": 18 / math.tan(math.radians(fov) / 2)}


def places(lens: Lens) -> Array:
    """Return the pixel coordinates (n, 2) in float32 at which a lens is tested.

    - The exact centre and a point beside it, the frame's corner, and points in between.
    - The middles of the frame's edges: the rim of an image circle, the seam and the poles of a
      panorama. And a point just inside the rim.
    - For a lens that turns: its turning point, and points beside it.
    """
    width = lens.width
    height = lens.height
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
    if isinstance(lens, BentLens):
        t = largest_place(lens)
        rim = [(t, 0), (t * (1 - 1e-4), 0), (0, -t * (1 - 1e-6))]
        points += [tuple(map(float, bent_pixel(lens, mpf(u), mpf(v)))) for u, v in rim]
    turns = lens.name == "polynomial" or isinstance(lens, CalibratedLens)
    if turns and not isinstance(lens, BentLens) and largest_radius(lens) < INF:
        end = float(largest_radius(lens) / pixel_size(lens)[0])
        points += [
            (x + end, y),
            (x + end * (1 - 1e-4), y),
            (x, y - end * height / width * (1 - 1e-6)),
        ]
    return np.array(points, np.float32)


def used(case: Case) -> float:
    """Return the part of its bound that a case uses."""
    forward = part(case["error"], case["error_bound"])
    round_trip = part(case["round_trip_error"], case["round_trip_bound"])
    return max(forward, round_trip)


def part(error: float, bound: float) -> float:
    if bound:
        return error / bound
    return math.inf if error else 0


# The files.


def summary(cases: Sequence[Case]) -> str:
    """Return a line for each source lens and dtype, and the cases outside their bounds."""
    groups = collections.defaultdict(list)
    for each in cases:
        groups[each["source"], each["dtype"]].append(each)
    failed = [each for each in cases if each["verdict"] == "FAIL"]
    lines = [
        f"{len(cases)} cases, {len(failed)} outside their bounds. Errors of lenses are in pixels. "
        "The last number is the largest part of its bound that any case uses.",
        "",
        "| cases | dtype | number | largest condition | largest round-trip error | of the bound "
        "| verdict |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for (source, dtype), members in groups.items():
        counts = collections.Counter(each["verdict"] for each in members)
        verdicts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in sorted(counts))
        lines.append(
            f"| {source} → any lens | {dtype} | {len(members)} "
            f"| {max(each['condition'] for each in members):.1e} "
            f"| {max(each['round_trip_error'] for each in members):.1e} "
            f"| {max(used(each) for each in members):.2f} | {verdicts} |"
        )
    for dtype in ("float32", "float64"):
        largest = 0.0
        for each in cases:
            source, target = each["case"].split(" → ")
            if each["dtype"] == dtype and source == target:
                largest = max(largest, each["round_trip_error"])
        lines.append(f"\nFrom a lens to itself and back, {dtype}: off by at most {largest:.1e} px.")
    lines += [f"\nOutside its bound: {each['case']} ({each['dtype']})." for each in failed]
    return "\n".join(lines) + "\n"


def draw(stem: Path, cases: Sequence[Case]) -> None:
    """Plot every lens pair's round-trip error over its round trip's condition number."""
    with plot(stem, size=(8, 5.5)) as axes:
        for dtype, colour, marker in (("float32", VERMILION, "o"), ("float64", BLUE, "s")):
            eps = float(np.finfo(dtype).eps)
            chosen = [
                e for e in cases if e["dtype"] == dtype and 0 < e["round_trip_bound"] < math.inf
            ]
            condition = np.array([each["round_trip_bound"] / (ROUNDINGS * eps) for each in chosen])
            errors = np.array([each["round_trip_error"] for each in chosen])
            # A round trip without an error is shown at the bottom.
            axes.scatter(
                condition, np.maximum(errors, eps / 100), s=10, c=colour, marker=marker, alpha=0.5,
                linewidths=0, label=f"{dtype} ({len(chosen)} lens pairs)",
            )  # fmt: skip
            if chosen:
                line = np.array([condition.min(), condition.max()])
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


def printable(case: Case) -> Case:
    """Return a row with its numbers as text of 4 digits."""
    return {
        column: f"{value:.3e}" if isinstance(value, float) else value
        for column, value in case.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", required=True, type=Path, help="folder for the results")
    folder = parser.parse_args().output
    cases = list(measure(extreme_lenses()))
    write_csv(folder / "stability.csv", [printable(case) for case in cases])
    write_text(folder / "stability.md", summary(cases))
    draw(folder / "stability", cases)
    failed = [each for each in cases if each["verdict"] == "FAIL"]
    print(f"{len(cases)} cases, {len(failed)} outside their bounds", file=sys.stderr)
    if failed:
        raise UserError(
            f"{len(failed)} of {len(cases)} cases are outside their bound; the first is "
            f"{failed[0]['case']} ({failed[0]['dtype']}); all are in {folder / 'stability.csv'}"
        )


if __name__ == "__main__":
    run(main)
