"""The stability measurement: its reference, its bounds, and its verdicts."""

import csv
import math
import subprocess
import sys
from pathlib import Path

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import stability
from lightfield.core.errors import UserError
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.rectilinear import Rectilinear

ALL = stability.extreme_lenses()


@pytest.fixture(autouse=True)
def digits() -> None:
    mpmath.mp.dps = stability.DIGITS


def test_the_reference_inverts_itself_to_all_its_digits() -> None:
    for name, lens in ALL.items():
        x, y = (mpf(float(c)) for c in stability.places(lens)[6])
        ray, excess = stability.ray_and_excess(lens, x, y)
        if ray is None or excess > 0:  # beyond the image circle of this lens
            continue
        pixel = stability.exact_pixel(lens, ray)
        assert pixel is not None, name
        assert abs(pixel[0] - x) + abs(pixel[1] - y) < mpf(10) ** -30, name


@pytest.mark.parametrize(
    "chosen",
    [
        ["rectilinear 0.01°", "stereographic 359.9999°", "cube map"],
        ["rectilinear 1e-6 mm", "equidistant 360°", "polynomial turning"],
        ["equisolid 360°", "kannala_brandt turning", "equirectangular 0.01°"],
        ["orthographic 180°", "polynomial turned 220°", "equirectangular odd"],
        ["division barrel", "division turning", "fov_model", "fov_model 3.1", "equidistant 360°"],
        ["unified 0.9", "unified turning", "double_sphere 0.999", "f_theta turning"],
        ["extended_unified turning", "extended_unified 0.3", "double_sphere turning", "cube map"],
        ["brown_conrady turning", "thin_prism_fisheye 360°", "thin_prism_fisheye turning"],
        ["brown_conrady rational", "fisheye624 turning", "fisheye624 folding", "equidistant 360°"],
    ],
)
def test_lens_pairs_are_within_their_bounds(chosen: list[str]) -> None:
    lenses = {name: ALL[name] for name in chosen}
    rows = list(stability.measure(lenses))
    assert len(rows) == 2 * len(chosen) ** 2
    assert [row["case"] for row in rows if row["verdict"] == "FAIL"] == []
    same_lens = [row for row in rows if len(set(row["case"].split(" → "))) == 1]
    for row in same_lens:
        allowed = 0.01 if row["dtype"] == "float32" else 1e-9
        # At a lens's turning point rounding moves a pixel more, and processors round differently.
        one_rounding = row["round_trip_bound"] / stability.ROUNDINGS
        assert row["round_trip_error"] < max(allowed, one_rounding), row["case"]


class Careless(Equidistant):
    """An equidistant lens that computes θ by acos, which loses half the digits near the axis."""

    def pixels(self, rays: np.ndarray) -> np.ndarray:
        theta = np.arccos(np.clip(-rays[..., 2], -1, 1))
        r = theta / (self.fov / 2)
        side = np.hypot(rays[..., 0], rays[..., 1])
        with np.errstate(invalid="ignore"):
            u, v = r * rays[..., 0] / side, r * rays[..., 1] / side
        return np.stack([(1 + u) * self.width / 2, (1 - v) * self.height / 2], axis=-1)


class Silent(Rectilinear):
    """A rectilinear lens that sees points behind the camera as if they were in front."""

    def pixels(self, rays: np.ndarray) -> np.ndarray:
        return super().pixels(rays * [1, 1, -1] if np.ndim(rays) else rays)


@pytest.mark.parametrize(
    "lens",
    [
        Careless(width=2048, height=2048, fov=math.radians(180)),
        Silent(width=64, height=64, focal_length=18),
    ],
)
def test_a_lens_that_loses_digits_or_invents_pixels_fails(lens: Lens) -> None:
    lenses = {"good": Equidistant(width=65, height=33, fov=math.radians(220)), "bad": lens}
    failed = {row["case"] for row in stability.measure(lenses) if row["verdict"] == "FAIL"}
    assert "good → bad" in failed or "bad → bad" in failed
    assert "good → good" not in failed


def test_the_program_writes_a_row_for_each_case_a_summary_and_a_plot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: ALL[name] for name in ("rectilinear 90° odd", "equidistant 360°")}
    monkeypatch.setattr(stability, "extreme_lenses", lambda: few)
    monkeypatch.setattr(sys, "argv", ["stability.py", "--output", str(tmp_path)])
    stability.main()
    with (tmp_path / "stability.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * len(few) ** 2
    for row in rows:
        assert row["verdict"].startswith("ok")
        assert float(row["error"]) <= float(row["error_bound"])
        assert float(row["round_trip_error"]) <= float(row["round_trip_bound"])
    assert "8 cases, 0 outside their bounds" in (tmp_path / "stability.md").read_text()
    assert (tmp_path / "stability.svg").read_text().lstrip().startswith("<?xml")
    assert (tmp_path / "stability.png").read_bytes().startswith(b"\x89PNG")


def test_the_program_fails_if_a_case_exceeds_its_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = list(stability.measure({"a": ALL["rectilinear 90° odd"]}))
    bad = good[0] | {"case": "made → up", "error": 1.0, "error_bound": 1e-16, "verdict": "FAIL"}
    monkeypatch.setattr(stability, "measure", lambda lenses: [*good, bad])
    monkeypatch.setattr(sys, "argv", ["stability.py", "--output", str(tmp_path)])
    with pytest.raises(UserError, match=r"1 of 3 cases.*made → up"):
        stability.main()
    assert "Outside its bound: made → up" in (tmp_path / "stability.md").read_text()


def test_without_mpmath_it_says_which_command_to_run() -> None:
    folder = Path(stability.__file__).parent
    program = f"import sys; sys.path.insert(0, {str(folder)!r}); sys.modules['mpmath'] = None"
    command = [sys.executable, "-c", f"{program}; import stability"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr.startswith("error: mpmath is missing")
    assert "make .venv/complete-for-tests" in result.stderr
    assert "Traceback" not in result.stderr
