"""Converts a lens to other programs' camera models, in pixels."""

import math

import numpy as np

from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rotations import OPENCV_AXES


def focal_pixels(lens: Rectilinear | CalibratedLens | Equidistant) -> tuple[float, float]:
    """Return a lens's focal length in pixels, across and down."""
    if isinstance(lens, Equidistant):
        return lens.width / lens.fov, lens.height / lens.fov
    return (
        lens.focal_length * lens.width / lens.sensor[0],
        lens.focal_length * lens.height / lens.sensor[1],
    )


def opencv_matrix(view: View) -> Array:
    """Return a view's camera-to-world matrix (4, 4), with x right, y down and z forward."""
    return np.asarray(view.world_from_camera @ OPENCV_AXES)


def opencv_pinhole(lens: Rectilinear) -> tuple[float, float, float, float]:
    """Return fx, fy, cx, cy of a lens in pixels. The first pixel's centre is at (0, 0)."""
    cx, cy = (middle - 0.5 for middle in lens.center)
    return *focal_pixels(lens), cx, cy


def opencv_fisheye(lens: Lens) -> tuple[float, ...]:
    """Return fx, fy in pixels and k1 to k4 of OpenCV's fisheye: r = f (θ + k1 θ³ + …).

    Raises TypeError for any other lens: the exporter's `refusal` comes before.
    """
    if isinstance(lens, KannalaBrandt):
        return (*focal_pixels(lens), *lens.coefficients)
    if isinstance(lens, Equidistant):
        return (*focal_pixels(lens), 0.0, 0.0, 0.0, 0.0)
    raise TypeError(f"{type(lens).__name__} is not a fisheye of OpenCV's")


def distortion(lens: BrownConrady) -> dict[str, float]:
    """Return OpenCV's coefficients k1 to k6, p1 and p2 by their names."""
    return dict(zip(lens.coefficient_names, lens.coefficients, strict=True))


def has_denominator(lens: BrownConrady) -> bool:
    """Return whether a lens has OpenCV's k4 to k6, which most programs do not know."""
    named = distortion(lens)
    return any(named[name] for name in ("k4", "k5", "k6"))


def sees_sideways(lens: Lens) -> bool:
    """Return whether the image has a ray at 90° from the optical axis or beyond."""
    azimuth = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    pixels = lens.pixels(np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=-1))
    # An image circle that touches the frame is in it, rounded or not.
    with np.errstate(invalid="ignore"):
        in_frame = (pixels > -1e-6) & (pixels < np.array([lens.width, lens.height]) + 1e-6)
    corners = lens.rays([0, 0, lens.width, lens.width], [0, lens.height, 0, lens.height])
    return bool(in_frame.all(axis=-1).any() or (corners[:, 2] >= 0).any())


def largest_angle(lens: CalibratedLens) -> float:
    """Return the largest angle in radians from the axis that the image of a radial lens shows."""
    corners = lens.rays([0, 0, lens.width, lens.width], [0, lens.height, 0, lens.height])
    angles = np.arctan2(np.hypot(corners[:, 0], corners[:, 1]), -corners[:, 2])
    if np.isfinite(angles).all():
        return float(angles.max())
    # The image shows the lens's rim.
    least, most = 0.0, math.pi
    while least < (middle := (least + most) / 2) < most:
        ray = np.array([math.sin(middle), 0, -math.cos(middle)])
        least, most = (middle, most) if np.isfinite(lens.pixels(ray)[0]) else (least, middle)
    return least


def misreading(lens: Lens) -> str | None:
    """Return how trainers misread a lens in a COLMAP model, or None if they do not.

    The readers of gsplat, 3DGRUT and the original 3D Gaussian splatting stop at a panorama.

    3DGRUT's largest angle θ is the corner's distance from the axis divided by the focal length. It
    projects points up to there. It inverts r(θ) by Newton's method, starting from an angle
    proportional to r. So r(θ) must grow that far, and no pixel may see farther. Source: 3DGRUT's
    dataset_colmap.py and cameraProjections.cuh, and OpenCVFisheyeCameraModel in NCore.
    """
    if isinstance(lens, Equirectangular):
        return (
            "is a panorama, which COLMAP reads since version 4.1, but gsplat, 3DGRUT and the "
            "original 3D Gaussian splatting do not; give them perspective views"
        )
    if not isinstance(lens, Equidistant | KannalaBrandt):
        return None
    fx, fy, *distortion = opencv_fisheye(lens)
    across = max(lens.center[0], lens.width - lens.center[0])
    down = max(lens.center[1], lens.height - lens.center[1])
    largest = math.hypot(across, down) / min(fx, fy)
    # r / f as a polynomial of θ, which has only odd powers.
    coefficients: list[float] = []
    for coefficient in (1.0, *distortion):
        coefficients += [0.0, coefficient]
    corner = math.hypot((across - 0.5) / fx, (down - 0.5) / fy)
    visible = IncreasingPolynomial(coefficients, last=lens.fov / 2, last_value=corner)
    side = max(lens.width / 2 / fx, lens.height / 2 / fy)
    first_guess = visible.value(visible.end) * largest / side
    needed = max(largest, first_guess)
    turning = IncreasingPolynomial(coefficients, last=needed).end
    if turning < needed:
        return (
            f"its radius stops growing at {math.degrees(turning):.1f}°, but 3DGRUT reads it up to "
            f"{math.degrees(needed):.1f}°, and gets rays and points wrong; give it equidistant "
            "views"
        )
    if visible.end > largest:
        return (
            f"it sees up to {math.degrees(visible.end):.1f}°, but 3DGRUT draws nothing beyond "
            f"{math.degrees(largest):.1f}° (corner radius / focal length); give it "
            "equidistant views"
        )
    return None
