"""The lens of Brown and Conrady, as OpenCV calibrates it."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from lightfield.geometry.lenses.base import Array, fov_up_to, slack
from lightfield.geometry.lenses.bent import Bend, BentLens
from lightfield.geometry.lenses.calibrated import CalibratedSettings
from lightfield.geometry.lenses.increasing_polynomial import Increasing, first_fall
from lightfield.settings.base import as_list


class BrownConradySettings(CalibratedSettings):
    """OpenCV's lens model in a scene YAML."""

    lens: Literal["brown_conrady"]
    coefficients: Annotated[tuple[float, ...], as_list(1, 8)] = Field(
        description="One to eight of the coefficients k1, k2, p1, p2, k3, k4, k5 and k6, in this "
        "order. Missing ones are 0. k are radial, p are tangential."
    )
    fov: float = fov_up_to(180, default=180)

    def optics(self) -> dict[str, Any]:
        missing = len(BrownConrady.coefficient_names) - len(self.coefficients)
        return {**super().optics(), "coefficients": self.coefficients + (0.0,) * missing}


@dataclass(frozen=True, kw_only=True)
class BrownConrady(BentLens):
    """r = f t (1 + k1 t² + k2 t⁴ + k3 t⁶) / (1 + k4 t² + k5 t⁴ + k6 t⁶), with t = tan θ.

    p1 and p2 bend the plane of t. ``coefficients`` are k1, k2, p1, p2, k3, k4, k5 and k6. Source:
    OpenCV's projectPoints, without its thin prism (s1 to s4) and its tilted sensor (τx, τy).
    """

    name = "brown_conrady"
    title = "Brown–Conrady lens"
    camera_types = ("BROWN_CONRADY",)
    focuses_on_plane = True
    coefficient_names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    Settings = BrownConradySettings
    focuses_on_plane = True
    largest_fov = 180.0

    fov: float = math.pi

    @cached_property
    def _bend(self) -> Bend:
        _, _, p1, p2, *_ = self.coefficients
        # OpenCV's y runs down.
        return Bend(tangential=(p2, -p1))

    @cached_property
    def _plane(self) -> Increasing:
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        # Polynomials in t².
        above = np.polynomial.Polynomial((1, k1, k2, k3)).trim()
        below = np.polynomial.Polynomial((1, k4, k5, k6)).trim()
        square = np.polynomial.Polynomial((0, 1))
        # The derivative of t · above / below is rising / below².
        rising = (above + 2 * square * above.deriv()) * below - 2 * square * above * below.deriv()

        # A coefficient may be as large as 1e99.
        @np.errstate(divide="ignore", invalid="ignore", over="ignore")
        def value(t: Any) -> Any:
            return t * (above(t * t) / below(t * t))

        @np.errstate(divide="ignore", invalid="ignore", over="ignore")
        def slope(t: Any) -> Any:
            return rising(t * t) / below(t * t) ** 2

        # Towards a pole, r grows without bound.
        last_square = min(first_fall(rising), first_fall(below) * (1 - 1e-9))
        end = min(math.sqrt(last_square), math.tan(min(self.fov, math.pi) / 2))
        # Nodes that grow with t, because t has no bound at 90 degrees.
        return Increasing(value, slope, np.sinh(np.linspace(0, math.asinh(end), 257)))

    def _sin_cos(self, r: Array) -> tuple[Array, Array]:
        t = self._plane.inverse(r)
        length = np.hypot(1, t)
        return t / length, 1 / length

    def _radius(self, sin: Array, cos: Array) -> Array:
        t = np.where(cos > 0, sin / cos, np.nan)
        inside = t <= self._plane.end * slack(t.dtype)
        return np.where(inside, self._plane.value(t.astype(np.float64)), np.nan)
