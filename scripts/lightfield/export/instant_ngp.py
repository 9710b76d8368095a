"""What instant-ngp's loader reads: transforms.json, masks, depth maps, and EXR files it accepts.

The loader's reading (instant-ngp, ``src/nerf_loader.cu`` and ``common_device.cuh``): it negates
the Y and Z axes of each camera, maps a position p to p · ``scale`` + ``offset`` and cycles the
axes (x, y, z) to (y, z, x). World points are given to it in SILVR's orientation: (x, y, z)
becomes (y, −x, z). Training happens in the cube of side ``aabb_scale`` around (½, ½, ½).
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.geometry.depth import distance_from_z, z_from_distance
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import Pose

Floats = NDArray[np.float64]

TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""World to NeRF coordinates, as SILVR's generate_NERF_transforms.py turns its scenes."""

DEPTH_UNIT = 0.001
"""Metres of one step of a 16-bit depth map; what lies beyond 65.535 m has no depth there."""

RIG_SHARE = 0.2
"""Part of the unit cube's side that the rig takes where nothing else is known of the scene."""

_FIT_LIMIT = 0.25  # pixels by which the loader's polynomial may miss a fisheye's ray


def transform_matrix(pose: Pose) -> Floats:
    """Return the (4, 4) camera-to-world matrix of a pose in NeRF coordinates."""
    turn = np.eye(4)
    turn[:3, :3] = TURN
    return turn @ pose.matrix()


def lens_keys(lens: Lens) -> dict[str, Any]:
    """Return the keys by which the loader knows a lens, for every frame alike.

    A fisheye goes as θ = Σ p_i r^i with r in pixels (``ftheta``), which is exact for equidistant
    and polynomial lenses; a panorama as ``latlong``, because the loader's ``equirectangular`` is
    linear in the sine of the latitude. Raises `UserError` for a lens that the loader cannot
    follow to a quarter of a pixel.
    """
    keys: dict[str, Any] = {
        "w": lens.width,
        "h": lens.height,
        "cx": lens.center[0],
        "cy": lens.center[1],
    }
    if isinstance(lens, Rectilinear):
        focal_x, focal_y = _axis_pixels(lens, 1.0)
        return {
            "camera_angle_x": 2 * math.atan(lens.width / (2 * focal_x)),
            "camera_angle_y": 2 * math.atan(lens.height / (2 * focal_y)),
            "fl_x": focal_x,
            "fl_y": focal_y,
            **keys,
        }
    if _is_full_panorama(lens):
        focal = lens.width / (2 * math.pi)
        return {"fl_x": focal, "fl_y": focal, **keys, "latlong": True}
    polynomial = _ftheta(lens)
    focal = 1 / abs(polynomial[1])
    named = {f"ftheta_p{power}": value for power, value in enumerate(polynomial)}
    return {"fl_x": focal, "fl_y": focal, **keys, **named}


def reads_z_depth(lens: Lens) -> bool:
    """Whether the loader takes depth along the axis: it scales it by its ray's length.

    A perspective ray has length 1 along the axis, all other rays have length 1 themselves.
    """
    return isinstance(lens, Rectilinear)


def blind_pixels(lens: Lens) -> NDArray[np.bool_]:
    """Return (height, width) flags of pixels without a ray, in the lens or in the loader.

    The loader trains such a pixel with the ray of the optical axis, so it has to be hidden. Of
    a fisheye the loader drops the exact centre and everything at 90° from the axis or beyond.
    """
    rays = lens.pixel_rays()
    blind: NDArray[np.bool_] = np.isnan(rays).any(axis=-1)
    if not isinstance(lens, Rectilinear) and not _is_full_panorama(lens):
        blind |= ~(rays[..., 2] < -1e-6)
        y, x = np.ogrid[: lens.height, : lens.width]
        blind |= (x + 0.5 == lens.center[0]) & (y + 0.5 == lens.center[1])
    return blind


def depth_map(depth: NDArray[Any], meaning: str, rays: NDArray[Any], as_z: bool) -> Any:
    """Return a (height, width) uint16 depth map in steps of `DEPTH_UNIT`, 0 where there is none.

    ``meaning`` of ``depth`` is "z" or "distance", ``rays`` are the pixels' unit rays. A depth
    of 0 is no depth to the loader; misses, unknown and farther points become that.
    """
    values = depth.astype(np.float64)
    if as_z and meaning == "distance":
        values = z_from_distance(values, rays)
    elif not as_z and meaning == "z":
        values = distance_from_z(values, rays)
    steps = np.round(values / DEPTH_UNIT)
    valid = np.isfinite(steps) & (steps >= 1) & (steps <= np.iinfo(np.uint16).max)
    return np.where(valid, steps, 0).astype(np.uint16)


def world_points(depth: NDArray[Any], meaning: str, rays: NDArray[Any], pose: Pose) -> Floats:
    """Return the (n, 3) world points, in metres, that the pixels of one view have seen."""
    distance = depth.astype(np.float64)
    if meaning == "z":
        distance = distance_from_z(distance, rays)
    points = (rays * distance[..., None])[np.isfinite(distance)]
    matrix = pose.matrix()
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def scene_bounds(cameras: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the corners of a box (in metres) for the unit cube, from cameras and seen points.

    It holds every camera and, along each axis, the middle nine tenths of the points: sky, hills
    and other far things are left to ``aabb_scale``.
    """
    low, high = np.percentile(points, [5, 95], axis=0)
    return np.minimum(low, cameras.min(axis=0)), np.maximum(high, cameras.max(axis=0))


def fitted(low: Floats, high: Floats) -> tuple[float, list[float]]:
    """Return the scale and offset that fit a box of the world into the unit cube, centred."""
    side = float(np.max(high - low))
    if not side > 0:
        raise UserError("the scene's extent is zero, so no scale fits it; give a scale")
    scale = 1 / side
    return scale, (0.5 - scale * TURN @ ((low + high) / 2)).tolist()


def fitted_to_rig(cameras: Floats) -> tuple[float, list[float]]:
    """Return the scale and offset that put the rig in the cube's middle, `RIG_SHARE` wide."""
    center = (cameras.min(axis=0) + cameras.max(axis=0)) / 2
    half = (cameras.max(axis=0) - cameras.min(axis=0)) / 2 / RIG_SHARE
    return fitted(center - half, center + half)


def placed(cameras: Floats, scale: float, offset: Sequence[float]) -> list[float]:
    """Return the offset with which the mean camera lies at ``offset``, as SILVR's script does."""
    mean = TURN @ cameras.mean(axis=0)
    return [float(value) for value in np.asarray(offset) - scale * mean]


def _axis_pixels(lens: Lens, tangent: float) -> tuple[float, float]:
    """Return how far from the centre a ray right and a ray down at this tangent appear."""
    right, down = lens.pixels(np.array([[tangent, 0.0, -1.0], [0.0, -tangent, -1.0]]))
    return float(right[0] - lens.center[0]), float(down[1] - lens.center[1])


def _is_full_panorama(lens: Lens) -> bool:
    """Whether the lens's rays are those of the loader's ``latlong``."""
    u, v = np.meshgrid(np.linspace(0.05, 0.95, 7), np.linspace(0.05, 0.95, 7))
    longitude, latitude = (u - 0.5) * 2 * math.pi, (0.5 - v) * math.pi
    expected = np.stack(
        [
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
            -np.cos(latitude) * np.cos(longitude),
        ],
        axis=-1,
    )
    rays = lens.rays(u * lens.width, v * lens.height)
    return bool(np.all(np.abs(rays - expected) < 1e-5))


def _ftheta(lens: Lens) -> list[float]:
    """Return p0 to p4 of θ = Σ p_i r^i, r in pixels, fitted to the lens up to 90° or its rim."""
    corners = np.array([[0, 0], [lens.width, 0], [0, lens.height], [lens.width, lens.height]])
    reach = float(np.hypot(*(corners - lens.center).T).max())
    radius = np.linspace(0, reach, 4001)
    seen = radius[np.abs(_angles(lens, radius)[0]) <= math.pi / 2]
    if len(seen) < 5:
        raise UserError(_not_followed("its view is no fisheye's"))
    # Chebyshev's nodes keep the largest error of a polynomial fit near its minimum.
    nodes = seen[-1] * (0.5 - 0.5 * np.cos(np.linspace(0, math.pi, 1001)))
    across, down = _angles(lens, nodes)
    known = np.isfinite(across)
    nodes, across, down = nodes[known], across[known], down[known]
    for degree in (1, 4):
        fit = Polynomial.fit(  # type: ignore[no-untyped-call]
            nodes, across, degree, domain=[0, seen[-1]], window=[0, 1]
        )
        if np.abs(fit(nodes) - across).max() < 1e-9:
            break
    pixel = np.abs(np.gradient(across, nodes))
    miss = np.abs(fit(nodes) - np.stack([across, down])) / pixel
    error = float(np.nanmax(miss))
    if not error <= _FIT_LIMIT:
        raise UserError(_not_followed(f"its polynomial misses it by {error:.2g} pixels"))
    powers = np.zeros(5)
    powers[: degree + 1] = fit.convert().coef
    if degree == 1:
        powers[0] = 0.0  # rounding noise: what is linear passes through the centre
    return [float(power) for power in powers]


def _angles(lens: Lens, radius: Floats) -> tuple[Floats, Floats]:
    """Return the signed angles from the axis to the right of the centre and below it."""
    x, y = lens.center
    right = lens.rays(x + radius, np.full_like(radius, y))
    below = lens.rays(np.full_like(radius, x), y + radius)
    return np.arctan2(right[:, 0], -right[:, 2]), np.arctan2(-below[:, 1], -below[:, 2])


def _not_followed(reason: str) -> str:
    return f"camera: instant-ngp cannot follow this lens ({reason}); reproject it to rectilinear"
