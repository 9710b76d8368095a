"""Reads a light field of Plenoforge with numpy and OpenEXR alone. Copy this file freely.

    from read import open_views
    view = open_views()[0]  # of the folder of this file; open_views("perspective") if it has that
    view.rgb, view.alpha, view.depth, view.normal  # arrays, as float32, if the dataset has them
    origins, directions = view.rays()  # of every pixel, in the world
    pixels, visible = view.project([[0, 0, 0]])  # points (n, 3) in metres to pixels (n, 2)

The world is in metres, with Z up. A camera looks along -Z, with +Y up. Row 0 is at the top. Pixel
coordinates run right and down; the first pixel's centre is (0.5, 0.5). Shards need OpenEXR 3.5.
"""

import json
import re
import tarfile
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

REC_709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)  # x and y of R, G, B and white
BRADFORD = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]


def open_views(reprojection: str = "", folder: Any = Path(__file__).parent) -> "list[PlainView]":
    """Return the views in a folder: of its lightfield.json, of its frames, or of all its shards."""
    folder, views = Path(folder).absolute(), dict[Any, PlainView]()
    frame = "." if (folder / "lightfield.json").is_file() else "f[0-9]*"
    names = {file.parent.name for file in folder.glob(f"{frame}/*/lightfield.json")}
    for file in folder.glob(f"{frame}/{reprojection or '.'}/lightfield.json"):
        content = json.loads(file.read_text("utf-8"))
        for nth, view in enumerate(content["frames"]):
            views[len(str(file)), file, nth] = PlainView(content | view, reprojection, file.parent)
    sums = "".join(file.read_text("utf-8") for file in folder.glob("sha256sums.txt"))
    for shard in [] if views else re.findall(r"\S+-\d+\.tar", sums) or folder.glob("*-[0-9]*.tar"):
        with tarfile.open(folder / shard) as tar:
            members: Any = {member.name: tar.extractfile(member) for member in tar}
            samples = {n[:-5]: json.load(members[n]) for n in members if n.endswith(".json")}
        for key, sample in samples.items():
            files = {Path(p["path"]): f"{key}.{field}" for field, p in sample["pictures"].items()}
            names |= {path.parent.name for path in files}
            for path, picture in zip(files, sample["pictures"].values(), strict=True):
                if path.parent == Path(reprojection or "exr"):
                    content = picture | {"name": path.stem, "split": sample["split"]}
                    views[key, path.stem] = PlainView(content, reprojection, folder / shard, files)
    if not views:
        raise ValueError(f"{folder}: has no views {reprojection!r}; it has {sorted(names)}")
    return [views[place] for place in sorted(views)]


sin, cos, tan = np.sin, np.cos, np.tan
# The lenses of calibrated cameras: r in focal lengths, at an angle t from the axis. k are the
# coefficients.
CALIBRATED: Any = {
    "kannala_brandt": lambda k, t: ratio([1, *k], [1], t),
    "f_theta": lambda k, t: t * np.polynomial.Polynomial([1, *k])(t),
    "division": lambda k, t: 2 * sin(t) / (cos(t) + (cos(t) ** 2 - 4 * k[0] * sin(t) ** 2) ** 0.5),
    "fov_model": lambda k, t: np.arctan(2 * tan(k[0] / 2) * tan(t)) / k[0],
    "unified": lambda k, t: sin(t) / (cos(t) + k[0]),
    "extended_unified": lambda k, t: sin(t) / mixed(k[0], k[1] ** 0.5 * sin(t), cos(t)),
    "double_sphere": lambda k, t: sin(t) / mixed(k[1], sin(t), k[0] + cos(t)),
    "brown_conrady": lambda k, t: ratio([1, *k[:2], k[4]], [1, *k[5:]], tan(t)),
    "thin_prism_fisheye": lambda k, t: ratio([1, *k[:2], *k[4:6]], [1], t),
    "fisheye624": lambda k, t: ratio([1, *k[:6]], [1], t),
}
# What bends a lens whose radial part is r: the radius in the plane of the bend at an angle, and r
# at that radius. Then its tangential, prism and growing prism coefficients, as up + i right.
BENT: Any = {
    "brown_conrady": lambda k, r: (tan, lambda t: r(np.arctan(t)), 1j * k[3] - k[2], 0, 0),
    "thin_prism_fisheye": lambda k, r: (np.abs, r, 1j * k[3] - k[2], 1j * k[6] - k[7], 0),
    "fisheye624": lambda k, r: (
        *(r, np.abs),
        *(1j * k[6] - k[7], 1j * k[8] - k[10], 1j * k[9] - k[11]),
    ),
}


class PlainView:
    """A view. ``content`` has its keys in lightfield.json. Only views in EXR files have pixels."""

    def __init__(self, content: Any, reprojection: str, home: Path, members: Any = None) -> None:
        self.content, self.lens = content, PlainLens(content)
        self.reprojection, self.home, self.members = reprojection, home, members
        self.name, self.split = content["name"], content.get("split")
        self.world_from_camera = pose = np.array(content["world_matrix"])
        # NaN for omnidirectional stereo, whose rays have no common origin.
        self.position = np.where("omnidirectional_stereo" in content, np.nan, pose[:3, 3])

    # Light in Rec. 709, coverage, world normals, and metres: as stored, along the axis, or the ray.
    rgb = property(lambda self: to_rec_709(*self.read()))
    alpha = property(lambda self: np.single(self.read()[0].get("A", np.ones(self.lens.size[::-1]))))
    normal = property(lambda self: np.stack([*map(self.read("normal")[0].get, "RGB")], axis=-1))
    depth = property(lambda self: self.depth_as(self.content["depth"]))
    z = property(lambda self: self.depth_as("z"))
    distance = property(lambda self: self.depth_as("distance"))

    def depth_as(self, meaning: str) -> Any:
        """Return the depth as "z" or "distance". inf for a miss, and NaN without a ray."""
        channels, header = self.read()
        depth, cosine = channels["Z"].astype(float), -self.lens.pixel_rays()[..., 2]
        if header.get("plenoforge:depth", self.content["depth"]) != meaning:
            scale = cosine if meaning == "z" else 1 / np.where(cosine > 0, cosine, np.nan)
            depth = np.where(np.isinf(depth), depth, depth * scale)
        return np.where(np.isnan(cosine), np.nan, depth).astype(np.float32)

    def read(self, folder: str = "") -> Any:
        """Return all channels of the view, or of its pass in a folder, and the file's header."""
        path = Path(folder or ("" if self.reprojection else "exr"), f"{self.name}.exr")
        with tarfile.open(self.home) if self.members else nullcontext() as tar:
            inside = tar and tar.extractfile(self.members[Path(self.reprojection, path)])
            part = OpenEXR.File(inside or str(self.home / path), separate_channels=True).parts[0]
        # A file may store only a part of the picture. What is beside it is black, or a miss.
        first = part.header["displayWindow"][0] - part.header["dataWindow"][0] + 1
        columns, rows = [np.arange(self.lens.size[axis]) + first[axis] for axis in (0, 1)]
        channels = {}
        for name, channel in part.channels.items():
            plane = np.pad(channel.pixels, 1, constant_values=np.inf if name == "Z" else 0)
            channels[name] = plane.take(rows, 0, mode="clip").take(columns, 1, mode="clip")
        return channels, part.header

    def rays(self) -> Any:
        """Return origins and unit directions (height, width, 3). NaN where the lens has no ray."""
        directions = self.lens.pixel_rays() @ self.world_from_camera[:3, :3].T
        return np.broadcast_to(self.position, directions.shape), directions

    def project(self, points: Any) -> Any:
        """Return the pixels (n, 2) of points (n, 3), and which are in the frame, maybe hidden."""
        pixels = self.lens.pixels((points - self.position) @ self.world_from_camera[:3, :3])
        return pixels, ((pixels >= 0) & (pixels < self.lens.size)).all(axis=-1)


class PlainLens:
    """A lens. u is right and v up in its image: in a panorama, longitude and latitude."""

    def __init__(self, content: Any) -> None:
        camera, self.size = content["camera"], np.array(content["resolution"])
        self.kind = camera.get("panorama_type", "PERSP").removeprefix("FISHEYE_")
        self.center = camera.get("principal_point", self.size / 2)
        pixel = content["sensor_size"] / self.size  # mm
        length = camera.get("focal_length", camera.get("fisheye_lens"))
        self.bend: Any = None
        self.unit = pixel / length if length else 2 / self.size  # The image circle has radius 1.
        # The largest angle θ from the axis. Then θ of r = |(u, v)|, and r of θ, for each lens.
        self.end = end = min(camera.get("fisheye_fov", np.pi) / 2, np.pi)
        side, half = sin(end), tan(end / 2)
        curves: Any = {
            "EQUIRECTANGULAR": (None, None),
            "PERSP": (np.arctan, tan),
            "EQUIDISTANT": (lambda r: r * end, lambda t: t / end),
            "EQUISOLID": (lambda r: 2 * np.arcsin(r / 2), lambda t: 2 * sin(t / 2)),
            "ORTHOGRAPHIC": (lambda r: np.arcsin(r * side), lambda t: sin(t) / side),
            "STEREOGRAPHIC": (lambda r: 2 * np.arctan(r * half), lambda t: tan(t / 2) / half),
        }
        if self.kind == "EQUIRECTANGULAR":
            west, north = camera["longitude_min"], camera["latitude_max"]
            self.unit = (camera["longitude_max"] - west, north - camera["latitude_min"]) / self.size
            self.center = (-west, north) / self.unit
        elif name := next((name for name in CALIBRATED if name in camera), None):
            # r in focal lengths, up to where it stops growing with θ.
            curve = partial(CALIBRATED[name], camera[name])
            self.end = end = rim(curve, end)
            curves[self.kind] = lambda r: inverse(curve, end, 0, r), curve
            if name in BENT:
                self.bend = PlainBend(end, *BENT[name](camera[name], curve))
        elif self.kind == "LENS_POLYNOMIAL":
            k = np.array([camera[f"fisheye_polynomial_k{i}"] for i in range(5)])
            sign = -np.sign(k[1:][k[1:] != 0][0])
            p = np.polynomial.Polynomial(-sign * k)
            last = min(first_root(p.deriv()), first_root(p - end))
            hole = 0 if 2 * p(0.0) < p(max(pixel)) else p(0.0)
            self.unit, self.end = pixel, p(last)
            curves[self.kind] = lambda r: sign * p(r), lambda t: sign * inverse(p, last, hole, t)
        self.theta, self.radius = curves[self.kind]
        if self.bend:
            self.end = float(self.theta(np.array([self.bend.radius(self.bend.last)]))[0])

    def pixel_rays(self) -> Any:
        """Return the unit rays (height, width, 3) of all pixels' centres."""
        return self.rays(*np.meshgrid(*(np.arange(side) + 0.5 for side in self.size)))

    @np.errstate(divide="ignore", invalid="ignore")
    def rays(self, x: Any, y: Any) -> Any:
        """Return the unit rays (..., 3) of pixel coordinates. NaN where the lens has none."""
        u, v = (x - self.center[0]) * self.unit[0], (self.center[1] - y) * self.unit[1]
        if self.kind == "EQUIRECTANGULAR":
            v = np.where(np.abs(v) <= np.pi / 2 + 1e-6, v, np.nan)
            return np.stack([cos(v) * sin(u), sin(v), -cos(v) * cos(u)], axis=-1)
        point, last = v + 1j * u, np.abs(self.radius(self.end))
        if self.bend:
            point = self.bend.unbent(point, self.theta(np.minimum(np.abs(point), last)))
        r, azimuth = np.abs(point), np.angle(point)
        theta = np.where(r <= last * (1 + 1e-14), self.theta(np.minimum(r, last)), np.nan)
        right, up = sin(theta) * [sin(azimuth), cos(azimuth)]
        return np.stack([right, up, -cos(theta)], axis=-1)

    @np.errstate(divide="ignore", invalid="ignore")
    def pixels(self, rays: Any) -> Any:
        """Return the pixel coordinates (..., 2) of rays (..., 3). NaN if the lens sees none."""
        x, y, z = np.moveaxis(rays, -1, 0)
        if self.kind == "EQUIRECTANGULAR":
            u, v = np.arctan2(x, 0 - z), np.arctan2(y, np.hypot(x, z))
            middle = (self.size[0] / 2 - self.center[0]) * self.unit[0]
            u -= 2 * np.pi * np.round((u - middle) / (2 * np.pi))
        else:
            theta, direction = np.arctan2(np.hypot(x, y), -z), np.exp(1j * np.arctan2(x, y))
            theta = np.where(theta <= self.end * (1 + 1e-14), theta, np.nan)
            point = direction * self.radius(theta)
            if self.bend:
                point = self.bend.image(direction * self.bend.plane(theta))
            u, v = point.imag, point.real
        return self.center + np.stack([u, -v], axis=-1) / self.unit


class PlainBend:
    """What moves the points of a lens that is not radial. A point is a number: up + i right.

    It depends on the place in a plane. ``plane`` is a place's radius t at an angle, and ``radius``
    is r at t.
    """

    def __init__(self, end: Any, plane: Any, radius: Any, tangential: Any, prism: Any, growth: Any):
        self.plane, self.radius, self.tangential = plane, radius, tangential
        self.prism, self.growth = prism, growth
        self.last = last = float(plane(end))
        t = np.sinh(np.linspace(0, np.arcsinh(last), 4097))
        folds = np.flatnonzero(self.spread(t[1:]) <= 0)
        if folds.size and (tangential or prism or growth):
            self.last, last = t[folds[0]], t[folds[0] + 1]
        while self.last < (middle := (self.last + last) / 2) < last:
            self.last, last = (middle, last) if self.spread(middle) > 0 else (self.last, middle)

    def spread(self, t: Any) -> Any:
        """Return a lower bound of how far neighbours at t stay apart. At 0, they may meet."""
        slope = (self.radius(t * (1 + 1e-6)) - self.radius(t * (1 - 1e-6))) / (2e-6 * t)
        prism = np.abs(self.prism + 2 * self.growth * t * t)
        moves = 2 * t * (3 * np.abs(self.tangential) + prism)
        return np.minimum(slope, self.radius(t) / t) - moves

    def image(self, places: Any) -> Any:
        """Return the points at which the lens shows places of the plane."""
        q = np.abs(places) ** 2
        along = 2 * (np.conj(self.tangential) * places).real
        sideways = self.tangential + self.prism + self.growth * q
        return self.radial(places) + along * places + sideways * q

    def radial(self, places: Any) -> Any:
        """Return the points at which a radial lens shows places of the plane."""
        t = np.maximum(np.abs(places), 1e-300)
        return places / t * self.radius(t)

    def unbent(self, points: Any, angles: Any) -> Any:
        """Return the points of the radial lens, by Newton's method. ``angles`` are about right."""
        places, h = self.plane(angles) * np.exp(1j * np.angle(points)), 1e-7
        for _ in range(20):
            error = points - self.image(places)
            by_up = (self.image(places + h) - points + error) / h
            by_right = (self.image(places + 1j * h) - points + error) / h
            step = (np.conj(error) * by_right).imag + 1j * (np.conj(by_up) * error).imag
            places = places + step / (np.conj(by_up) * by_right).imag
            places = places * np.minimum(1, self.last / np.abs(places))
        is_solved = np.abs(error) <= 1e-12 * (1 + np.abs(points))
        return np.where(is_solved, self.radial(places), np.nan)


def first_root(polynomial: Any) -> Any:
    """Return the smallest positive root, or inf."""
    roots = [r for r in np.roots(polynomial.coef[::-1]) if abs(r.imag) <= 1e-12 * abs(r)]
    return min([root.real for root in roots if root.real > 0], default=np.inf)


def ratio(above: Any, below: Any, t: Any) -> Any:
    """Return t times the ratio of two polynomials in t²."""
    top, bottom = np.polynomial.Polynomial(above), np.polynomial.Polynomial(below)
    return t * (top(t * t) / bottom(t * t))


def mixed(alpha: float, across: Any, along: Any) -> Any:
    """Return the divisor of a projection between the one from a sphere and the perspective one."""
    return alpha * np.hypot(across, along) + (1 - alpha) * along


@np.errstate(divide="ignore", invalid="ignore")
def rim(curve: Any, last: float) -> float:
    """Return the angle, up to ``last``, at which a lens's r stops growing, or becomes infinite."""
    t = np.linspace(0, last, 4097)
    falls = np.flatnonzero(~(np.diff(curve(t)) > 0) | (curve(t[1:]) < 0))
    low, high = (t[max(falls[0] - 1, 0)], t[falls[0] + 1]) if falls.size else (last, last)
    for _ in range(100):
        near, far = low + (high - low) / 3, high - (high - low) / 3
        low, high = (near, high) if 0 < curve(near) < curve(far) else (low, far)
    return float(low)


@np.errstate(divide="ignore", invalid="ignore")
def inverse(curve: Any, last: float, least: float, values: Any) -> Any:
    """Return t from 0 to ``last`` with the values of a curve that grows. The Illinois method."""
    goal, t = np.arctan(values), np.linspace(0, last, 4097)  # The angle is finite for infinite r.
    known = np.arctan(curve(t))
    upper = np.clip(np.searchsorted(known, goal), 1, 4096)
    low, high, below, above = t[upper - 1], t[upper], known[upper - 1] - goal, known[upper] - goal
    sides: Any = (False, False)
    for _ in range(16):
        t = np.clip(high - (high - low) * (above / np.maximum(above - below, 1e-300)), low, high)
        error = np.arctan(curve(t)) - goal
        sides = error < 0, error >= 0, *sides[:2]
        # An end that stays a second time counts half.
        below = np.where(sides[0], error, np.where(sides[-1], below / 2, below))
        above = np.where(sides[1], error, np.where(sides[-2], above / 2, above))
        low, high = np.where(sides[0], t, low), np.where(sides[1], t, high)
    return np.where(values >= least, t, np.nan)


def to_rec_709(channels: Any, header: Any) -> Any:
    """Return linear colour (height, width, 3). White stays white, by Bradford."""
    colour = np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float32)
    chromaticities, spaces = header.get("chromaticities", REC_709), []
    for x, y in np.reshape([chromaticities, REC_709], (2, 4, 2)).swapaxes(1, 2):
        cones = BRADFORD @ np.stack([x / y, np.ones(4), (1 - x - y) / y])
        spaces.append(cones[:, :3] * np.linalg.solve(cones[:, :3], cones[:, 3]) / cones[:, 3:])
    is_rec_709 = np.allclose(chromaticities, REC_709, rtol=0, atol=1e-4)
    return colour if is_rec_709 else np.float32(colour @ np.linalg.solve(spaces[1], spaces[0]).T)
