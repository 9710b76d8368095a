"""Compares a camera's calibration with the true lens of a dataset, over the whole frame.

The ray of each pixel's centre goes through the calibrated lens. The error is the distance from the
pixel to the place where it arrives. A calibration is right up to a rotation of the camera, because
the poses of its boards turn with it. So the error is also given after the best rotation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.ticker import StrMethodFormatter
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField
from lightfield.geometry.lenses import Lens, calibrations
from lightfield.geometry.rotations import Floats
from lightfield.imaging import plots
from lightfield.stages.measurement import EvaluateCalibration

# The best rotation follows from about this many pixels.
_FITTED_PIXELS = 2000
# The least error on the map, in pixels.
_LEAST = 1e-4


@dataclass(frozen=True)
class CalibrationError:
    """How far a calibrated lens is from the true one.

    - ``error`` (height, width): in pixels. NaN where either lens has no value.
    - ``has_ray`` (height, width): whether the true lens has a ray.
    - ``rotation`` (3,): the rotation of rays before the calibrated lens, a vector in degrees.
    """

    error: Floats
    has_ray: np.ndarray[Any, np.dtype[np.bool_]]
    rotation: Floats

    @property
    def figures(self) -> dict[str, float]:
        """Median, rms and largest error in pixels, and the part of the frame without a value."""
        known = self.error[np.isfinite(self.error)]
        return {
            "median": float(np.median(known)),
            "rms": float(np.sqrt(np.mean(known**2))),
            "max": float(np.max(known)),
            "without_value": 1 - known.size / int(self.has_ray.sum()),
        }


def evaluate(job: EvaluateCalibration) -> None:
    """Print the figures of a calibration, and write them with a map of its error."""
    true = LightField.read(job.lightfield).lens
    settings = job.settings
    calibrated = calibrations.read(
        job.calibration,
        settings.camera,
        model=settings.model,
        resolution=(true.width, true.height),
    )
    as_calibrated, rotated = compare(true, calibrated)
    if not np.isfinite(as_calibrated.error).any():
        raise UserError(f"{job.calibration}: its lens sees no ray of {job.lightfield}")
    results = {"as_calibrated": as_calibrated, "after_rotation": rotated}
    if job.output:
        content = {
            "lens": true.to_lightfield(),
            "calibrated": calibrated.to_lightfield(),
            "rotation_degrees": rotated.rotation.tolist(),
            **{name: result.figures for name, result in results.items()},
        }
        write_json(job.output / "calibration.json", content)
        _draw(job.output / "calibration_error", results)
    print(_table(results))


def compare(true: Lens, calibrated: Lens) -> tuple[CalibrationError, CalibrationError]:
    """Return the error of a calibrated lens as it is, and after the best rotation of its rays."""
    rays = true.pixel_rays()
    rotation = _best_rotation(true, calibrated, rays)
    return _error(calibrated, rays, Rotation.identity()), _error(calibrated, rays, rotation)


def _error(calibrated: Lens, rays: Floats, rotation: Rotation) -> CalibrationError:
    turned = rays @ rotation.as_matrix().T
    error = np.linalg.norm(calibrated.pixels(turned) - _pixels(*rays.shape[:2]), axis=-1)
    return CalibrationError(error, np.isfinite(rays[..., 0]), rotation.as_rotvec(degrees=True))


def _pixels(height: int, width: int) -> Floats:
    """Return the coordinates (height, width, 2) of the pixels' centres."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y], axis=-1)


def _best_rotation(true: Lens, calibrated: Lens, rays: Floats) -> Rotation:
    """Return the rotation of rays that brings the calibrated lens nearest to the true one."""
    pixels = _pixels(true.height, true.width)
    is_known = np.isfinite(calibrated.pixels(rays)).all(axis=-1)
    step = max(1, int(is_known.sum()) // _FITTED_PIXELS)
    fitted_rays, fitted_pixels = rays[is_known][::step], pixels[is_known][::step]
    if not len(fitted_rays):
        return Rotation.identity()

    def residuals(vector: Floats) -> Floats:
        turned = fitted_rays @ Rotation.from_rotvec(vector).as_matrix().T
        # A ray at the rim may leave the calibrated lens.
        return np.asarray(np.nan_to_num(calibrated.pixels(turned) - fitted_pixels).ravel())

    return Rotation.from_rotvec(least_squares(residuals, np.zeros(3), x_scale=1e-3).x)


def _table(results: Mapping[str, CalibrationError]) -> str:
    """Return the figures as a table for the terminal."""
    lines = [f"{'error in pixels':16} {'median':>9} {'rms':>9} {'max':>9}   without a value"]
    for name, result in results.items():
        figures = result.figures
        numbers = " ".join(f"{figures[key]:9.4f}" for key in ("median", "rms", "max"))
        lines.append(f"{name.replace('_', ' '):16} {numbers}   {figures['without_value']:.1%}")
    angle = float(np.linalg.norm(results["after_rotation"].rotation))
    lines.append(f"the rotation is {angle:.4f}°")
    return "\n".join(lines)


def _draw(stem: Path, results: Mapping[str, CalibrationError]) -> None:
    """Draw the errors side by side, in one logarithmic scale."""
    errors = [result.error for result in results.values()]
    largest = max(float(np.nanmax(error)) for error in errors)
    norm = LogNorm(max(_LEAST, largest / 1000), max(largest, 10 * _LEAST), clip=True)
    with plots.plot(stem, 1, len(results), size=(11, 4.6)) as all_axes:
        for axes, (name, result) in zip(all_axes, results.items(), strict=True):
            picture = axes.imshow(result.error, norm=norm, cmap="viridis", interpolation="nearest")
            axes.set_title(name.replace("_", " "))
            axes.grid(False)
            axes.set_axis_off()
        bar = picture.figure.colorbar(
            picture,
            ax=all_axes,
            orientation="horizontal",
            shrink=0.6,
            format=StrMethodFormatter("{x:g}"),
        )
        bar.set_label("error in pixels; white: no value")
