"""Packs the views of a dataset's page, so that a browser can show their light and depth."""

import json
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.export.points import evenly
from lightfield.formats.lightfield import LightField
from lightfield.geometry.depth import converted
from lightfield.geometry.lenses import Lens
from lightfield.geometry.overview import middle_view
from lightfield.geometry.rigs import Rig
from lightfield.imaging import images, pictures
from lightfield.imaging.look import Look
from lightfield.imaging.noise import relative_noise
from lightfield.reading.dataset import OpenDataset, OpenView
from lightfield.report import epipolar, focus, walk
from lightfield.report.packing import (
    DEPTH_STEPS,
    depth_range,
    light_scale,
    light_step,
    pack_depth,
    pack_light,
    pack_look,
    packed_bytes,
    webp,
)
from lightfield.synthesis.view import seeming_farther

Array = NDArray[Any]

# The longer side of an embedded view in pixels: the first of SIDES with which the views have at
# most MOST_BYTES. With more than MANY_VIEWS it is at most SMALLER_SIDE.
SIDES = (448, 384, 320, 256, 192, 128, 96, 64)
SMALLER_SIDE = 192
_MANY_VIEWS = 60
# The rest of a page has up to 2 MB, so that it has at most 10 MB.
MOST_BYTES = 8_000_000
_LIGHT_QUALITY = 95
# The longer side in pixels of the views that epipolar-plane images sample: their columns' number.
_EPIPOLAR_SIDE = 512
_MOST_ROWS = 48
# The page shows POINTS points of the scene, chosen from CANDIDATES.
POINTS = 8_000
_CANDIDATES = 30_000
# The side in pixels of the square in a view's middle where its noise is measured.
_NOISE_SIDE = 512


@dataclass(frozen=True)
class PageView:
    """One view for the page: small linear colour, small depth as stored, and its noise."""

    colour: Array
    depth: Array | None
    noise: float


@dataclass(frozen=True)
class _PackedViews:
    """The views of a page.

    - ``data``: for the page's program.
    - ``embedded``, ``views``: the numbers of views in the page, and of all views.
    - ``parts``: the parts of the split that the dataset has, such as train and test.
    - ``noise``: the noise of the best, the median and the worst view.
    - ``missed``: the part of depths that are inf.
    - ``sensor``: the name of the folder with the views as a sensor sees them. None without one.
    - ``row``, ``row_shown``: the row of the epipolar-plane image, and the number of its views.
    """

    data: dict[str, Any]
    embedded: int
    views: int
    parts: list[str]
    noise: tuple[float, float, float] | None
    missed: float | None
    row: epipolar.Row | None
    row_shown: int
    sensor: str | None = None

    @property
    def light_step(self) -> float:
        """The part by which bright light grows from one packed code to the next."""
        return light_step(self.data["light"])


def collect(
    dataset: OpenDataset,
    rig: Rig,
    unreadable: Collection[str] = (),
    sensor: Path | None = None,
    look: Look | None = None,
) -> _PackedViews:
    """Read the views that the page shows, and pack them.

    ``rig`` has placed the cameras of the ``dataset``'s views. The ``unreadable`` views are black.
    ``sensor`` holds the views as a sensor sees them, if there are any. The page develops them with
    the ``look``, if there is one. Raises `UserError` for any other view that cannot be read.
    """
    lightfield = dataset.lightfield
    names = [view.name for view in lightfield.views]
    lens = dataset.lens

    def load(number: int, small: Lens) -> PageView:
        view = dataset.views[number]
        has_depth = dataset.depth is not None
        if view.name in unreadable:
            return _black(small, has_depth)
        return read(view, small, has_depth)

    embedded, first = shown_views(lightfield, rig)
    for small in _lenses(lens, len(embedded)):
        views = [load(number, small) for number in embedded]
        depths = depths_of(views, small)
        shown = _pictures(views, depths, embedded, first, lightfield, small, look)
        if sensor:
            for entry in shown["embedded"]:
                entry["sensor"] = _sensed(sensor / f"{names[entry['view']]}.png", small)
        if len(json.dumps(shown)) <= MOST_BYTES:
            break
    row = epipolar.find_row(rig, lightfield.world_from_cameras)
    row_views = epipolar.thinned(row.views, _MOST_ROWS) if row else []
    data = {
        "views": _cameras(lightfield),
        "outline": [[_rounded(point) for point in line] for line in rig.outline()],
        "resolution": [lens.width, lens.height],
        "size": [small.width, small.height],
        "white": pictures.WHITE,
        "look": pack_look(look) if look else None,
        "first": first,
        "row": _epipolar_images(load, lightfield, row, row_views, shown["light"]) if row else None,
        **shown,
    }
    if refocused := _refocused(rig, lightfield, small, views, depths, embedded, unreadable, shown):
        data["focus"] = refocused
    noises = [view.noise for view in views if math.isfinite(view.noise)]
    return _PackedViews(
        data=data,
        embedded=len(embedded),
        views=len(names),
        parts=sorted({view.split for view in lightfield.views if view.split}),
        noise=(min(noises), float(np.median(noises)), max(noises)) if noises else None,
        missed=None if depths is None else _missed(depths),
        row=row,
        row_shown=len(row_views),
        sensor=sensor.name if sensor else None,
    )


def shown_views(lightfield: LightField, rig: Rig) -> tuple[list[int], int]:
    """Return the numbers of the views that a page shows, and the place there of a middle view."""
    count = len(lightfield.views)
    shown = list(range(count))[:: math.ceil(count / pictures.MOST_VIEWS)]
    middle = lightfield.world_from_cameras[middle_view(rig)]
    # The view with the pose most similar to the middle view's.
    offsets = np.abs(lightfield.world_from_cameras[shown] - middle).sum(axis=(1, 2))
    return shown, int(np.argmin(offsets))


def _lenses(lens: Lens, view_count: int) -> list[Lens]:
    """Return the lenses that ``view_count`` embedded views can have, from large to small."""
    most = SIDES[0] if view_count <= _MANY_VIEWS else SMALLER_SIDE
    sides = [side for side in SIDES if side <= most]
    # A view has no more pixels than the dataset's own.
    largest = max(lens.width, lens.height)
    smaller = [side for side in sides[1:] if side < largest]
    return [lens.fitted(side) for side in [sides[0], *smaller]]


def _sensed(path: Path, small: Lens) -> str:
    """Return a sensor's picture at the resolution of ``small``, packed. Black if it is damaged.

    Takes single pixels: a mean of several would have less noise.
    """
    try:
        pixels = images.read_image(path, "RGB").srgb
    except UserError:
        pixels = np.zeros((small.height, small.width, 3), np.uint8)
    height, width = pixels.shape[:2]
    return webp(pixels[_picked(height, width, small)], _LIGHT_QUALITY)


def _picked(height: int, width: int, small: Lens) -> tuple[Array, ...]:
    """Return the rows and columns of one pixel of an image for each pixel of ``small``."""
    rows = (np.arange(small.height) + 0.5) * height / small.height
    columns = (np.arange(small.width) + 0.5) * width / small.width
    return np.ix_(rows.astype(int), columns.astype(int))


def _cameras(lightfield: LightField) -> list[dict[str, Any]]:
    """Return the position and the axes of each view's camera."""
    return [
        {
            "name": view.name,
            "part": view.split,
            "at": _rounded(world_from_camera[:3, 3]),
            "right": _rounded(world_from_camera[:3, 0]),
            "up": _rounded(world_from_camera[:3, 1]),
            "ahead": _rounded(-world_from_camera[:3, 2]),
        }
        for view, world_from_camera in zip(
            lightfield.views, lightfield.world_from_cameras, strict=True
        )
    ]


def depths_of(views: list[PageView], small: Lens) -> Array | None:
    """Return the depth of the views, NaN where ``small`` sees nothing. None if they have none."""
    stored = [view.depth for view in views if view.depth is not None]
    if not stored:
        return None
    return np.where(np.isnan(small.pixel_rays()[..., 0]), np.nan, np.stack(stored))


def _pictures(
    views: list[PageView],
    depths: Array | None,
    embedded: list[int],
    first: int,
    lightfield: LightField,
    small: Lens,
    look: Look | None,
) -> dict[str, Any]:
    """Return the packed pictures of the ``embedded`` views, through the lens ``small``.

    ``first`` is the place in ``embedded`` of the view in the middle of the rig.
    """
    light = np.stack([view.colour for view in views])
    scale = light_scale(light)
    exposure = round(pictures.exposure_for(light, look), 2)
    packed: list[dict[str, Any]] = [
        {"view": number, "light": webp(pack_light(colour, scale), _LIGHT_QUALITY)}
        for number, colour in zip(embedded, light, strict=True)
    ]
    shown = {"light": scale, "exposure": exposure, "embedded": packed}
    if depths is None:
        return shown | {"points": None, "depth": None, "walk": None}
    rays = small.pixel_rays()
    reach = depth_range(depths)
    world_from_cameras = lightfield.world_from_cameras
    distances = converted(depths, rays, lightfield.depth, "distance")
    farther = seeming_farther(small, light, distances, world_from_cameras[embedded])
    for entry, depth, steps in zip(packed, depths, farther, strict=True):
        entry["depth"] = webp(pack_depth(depth, reach, steps))
    colours = pictures.develop(light, exposure, look)
    return shown | {
        "points": _points(distances, rays, world_from_cameras[embedded], colours),
        "depth": _depth_scale(depths, reach, lightfield.depth),
        "walk": walk.collect(
            small,
            world_from_cameras[:, :3, 3],
            world_from_cameras[embedded],
            distances,
            first,
            fills_holes=not lightfield.transparent,
        ),
    }


def _refocused(
    rig: Rig,
    lightfield: LightField,
    small: Lens,
    views: list[PageView],
    depths: Array | None,
    embedded: list[int],
    unreadable: Collection[str],
    shown: dict[str, Any],
) -> dict[str, Any] | None:
    """Return the pictures of the slider of the focus. None if the rig is no plane with depth."""
    grid = focus.plane_of(rig, lightfield.world_from_cameras)
    if grid is None or depths is None:
        return None
    readable = [
        (number, view.colour)
        for number, view in zip(embedded, views, strict=True)
        if lightfield.views[number].name not in unreadable
    ]
    z = converted(depths, small.pixel_rays(), lightfield.depth, "z")
    numbers, colours = [number for number, _ in readable], [colour for _, colour in readable]
    return focus.collect(grid, small, colours, numbers, z, shown["light"])


def _missed(depths: Array) -> float | None:
    """Return the part of the depths that are inf. None without any depth."""
    defined = depths[~np.isnan(depths)]
    return float(np.isposinf(defined).mean()) if defined.size else None


def read(view: OpenView, small: Lens, has_depth: bool) -> PageView:
    """Read a view at the resolution of ``small``. Averages colour, takes depth from one pixel."""
    image = view.image("RGBZ" if has_depth else "RGB")
    colour = np.nan_to_num(image.colour, posinf=0, neginf=0)
    height, width = colour.shape[:2]
    middle = colour[_middle(height), _middle(width)]
    ratio = relative_noise(pictures.luminance(middle))
    noise = ratio[np.isfinite(ratio)]
    if (width, height) != (small.width, small.height):
        colour = pictures.shrunk(colour, small.width, small.height)
    depth = None
    if has_depth:
        depth = image.channels["Z"][_picked(height, width, small)].astype(np.float32)
    return PageView(colour, depth, float(np.median(noise)) if noise.size else math.nan)


def _black(lens: Lens, has_depth: bool) -> PageView:
    """Return a black view in place of one that cannot be read."""
    shape = (lens.height, lens.width)
    depth = np.full(shape, np.nan, np.float32) if has_depth else None
    return PageView(np.zeros((*shape, 3), np.float32), depth, math.nan)


def _middle(length: int) -> slice:
    start = max(0, (length - _NOISE_SIDE) // 2)
    return slice(start, start + _NOISE_SIDE)


def _points(
    distances: Array, rays: Array, world_from_cameras: Array, colours: Array
) -> dict[str, Any] | None:
    """Return some of the points that the views see: places and sRGB colours, packed.

    ``distances`` (views, height, width) are along ``rays`` (height, width, 3). ``colours`` are
    (views, height, width, 3). Points far from the cameras are farther apart. Places are 16 bits
    between the corners of the box around all points.
    """
    view, row, column = np.nonzero(np.isfinite(distances) & (distances > 0))
    if not len(view):
        return None
    picked = np.linspace(0, len(view) - 1, min(len(view), _CANDIDATES)).astype(int)
    at = view[picked], row[picked], column[picked]
    turned = np.einsum("nij,nj->ni", world_from_cameras[at[0], :3, :3], rays[at[1:]])
    places = world_from_cameras[at[0], :3, 3] + distances[at][:, None] * turned
    # Drop the farthest points: they would cost all others their precision.
    way = places - world_from_cameras[:, :3, 3].mean(axis=0)
    away = np.linalg.norm(way, axis=1)
    near = np.flatnonzero(away <= np.percentile(away, 98))
    scale = np.log1p(away[near] / (0.2 * np.median(away))) / np.maximum(away[near], 1e-9)
    kept = near[evenly(way[near] * scale[:, None], POINTS)]
    low = places[kept].min(axis=0)
    side = max(float((places[kept] - low).max()), 1e-6)
    steps = np.round((places[kept] - low) / side * 65535).astype("<u2")
    return {
        "low": _rounded(low),
        "side": side,
        "places": packed_bytes(steps.tobytes()),
        "colours": packed_bytes(colours[at][kept].tobytes()),
    }


def _rounded(values: Array) -> list[float]:
    return [round(value, 5) + 0.0 for value in values.tolist()]


def _depth_scale(depths: Array, reach: tuple[float, float], meaning: str | None) -> dict[str, Any]:
    """Return the meaning of depth codes, and the colours of depths from near to far."""
    hit = depths[np.isfinite(depths) & (depths > 0)]
    near, far = np.log2(np.percentile(hit, [5, 98])).tolist() if hit.size else reach
    palette = matplotlib.colormaps["viridis_r"](np.arange(256), bytes=True)[:, :3]
    return {
        "range": reach,
        "steps": DEPTH_STEPS,
        "shown": [near, max(far, near + 0.1)],
        "meaning": meaning,
        "colours": packed_bytes(palette.tobytes()),
    }


def _epipolar_images(
    load: Callable[[int, Lens], PageView],
    lightfield: LightField,
    row: epipolar.Row,
    kept: list[int],
    scale: tuple[float, float],
) -> dict[str, Any]:
    """Return a row's epipolar-plane images: one picture, with all tilts beneath each other.

    ``kept`` are the positions of the shown views in the row.
    """
    world_from_cameras = lightfield.world_from_cameras
    fitted = lightfield.lens.fitted(_EPIPOLAR_SIDE)
    columns = epipolar.COLUMNS[row.kind]
    count = len(kept)
    light = np.zeros((len(epipolar.TILTS), count, columns, 3), np.float32)
    depth = np.full((len(epipolar.TILTS), count, columns), np.nan)
    for place, position in enumerate(kept):
        number = row.views[position]
        view = load(number, fitted)
        for tilted, tilt in enumerate(epipolar.TILTS):
            rays = epipolar.directions(row, tilt, columns)
            light[tilted, place], depth[tilted, place] = epipolar.sample(
                fitted, world_from_cameras[number], view.colour, view.depth, lightfield.depth, rays
            )
    reach = depth_range(depth)
    sight = np.isfinite(depth) | np.isposinf(depth)
    used = np.flatnonzero(sight.any(axis=(0, 1)))
    first, last = (int(used[0]), int(used[-1]) + 1) if used.size else (0, columns)
    light = light[:, :, first:last]
    depth = depth[:, :, first:last]
    centers = world_from_cameras[[row.views[i] for i in kept], :3, 3] @ row.axes.T
    return {
        "kind": row.kind,
        "views": row.views,
        "rows": [row.views[i] for i in kept],
        "places": _rounded(row.places[kept]),
        "centers": [_rounded(center[:2]) for center in centers],
        "tilts": epipolar.TILTS,
        "first": first,
        "columns": columns,
        "widest": math.tan(epipolar.WIDEST),
        "shape": [count, last - first],
        "light": webp(_stacked(pack_light(light, scale))),
        "depth": webp(_stacked(pack_depth(depth, reach))),
        "range": reach,
    }


def _stacked(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return (tilts, rows, columns, 3) as one picture, with the tilts beneath each other."""
    return values.reshape(-1, *values.shape[2:])
