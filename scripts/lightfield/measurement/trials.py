"""Windows of a dataset's views, rendered in many ways to learn what each way costs and gives.

Whole views made small would show more detail a pixel than the dataset does, which a denoiser cannot
tell from noise; so a window is a part of a view at the view's own resolution.

Every render is kept in a folder, under a key of all that it follows from, with the time that it
took, so that what is interrupted goes on where it was and what is repeated costs nothing. The key
names the device that rendered, not `auto`: seconds of one device are not those of another.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core import processors
from lightfield.core.cli import positive
from lightfield.core.errors import UserError
from lightfield.dataset import keys, passes
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.lightfield import LightField, View
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.measurement.metrics import Mask, Reference, make_reference
from lightfield.measurement.sampling import PLAIN, WINDOW_SIZE, calibrated, without_target
from lightfield.validation.consistency import Camera

# Seeds of references begin here, and those of trials at 1: no trial is part of its reference.
REFERENCE_SEED = 1000

R2 = (0.7548776662466927, 0.5698402909980532)
# A window has at least this part of its pixels in the image circle, if one of so many places has.
FULL_ENOUGH, MOST_PLACES = 0.75, 64

# What a pilot says of the surface that a pixel sees: whether its material has one of these features
# of the scene's inventory.
SURFACES = {
    "emitting": ("emission",),
    "translucent": ("translucency",),
    "transparent": ("transmission", "transparency"),
}

SECONDS_ATTRIBUTE = "plenoforge:core_seconds"
SAMPLES_ATTRIBUTE = "plenoforge:samples"
DEVICE_ATTRIBUTE = "plenoforge:device"


@dataclass(frozen=True)
class Window:
    """A part of one view at its own resolution: its top left pixel, and its size."""

    view: View
    x: int
    y: int
    width: int
    height: int

    @property
    def name(self) -> str:
        """The view's name and the place in it."""
        return f"{self.view.name}+{self.x}+{self.y}"


@dataclass(frozen=True)
class Trial:
    """One render: colour (h, w, 3) scene-linear; depth (h, w) metres as Cycles gives it, or None.

    ``parts``, of a pilot alone, are those of its light, each (h, w), by their passes' names, and 1
    or 0 for each of `SURFACES`.
    ``samples`` is the mean number that the pixels of the image circle took. ``seconds`` is the time
    from Cycles' first sample to its being finished, denoising included and synchronization not: on
    processors their working time, which other load is not in and in which cores add up, and on a
    GPU Cycles' own render time. ``device`` is what Cycles rendered on, CPU or GPU.
    """

    colour: NDArray[np.float32]
    depth: NDArray[np.float32] | None
    samples: float
    seconds: float
    device: str
    parts: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


class Trials:
    """Renders windows of the dataset of a lightfield.json, or takes them from ``cache``.

    Blender starts only when something has to be rendered, or to see what ``auto`` is here. In a
    process one renders after the other: after another has rendered, this one must not. With
    ``parts`` it is a pilot.
    """

    def __init__(
        self,
        blend: Path,
        inventory: Path,
        lightfield: LightField,
        device: str,
        threads: int,
        cache: Path,
        parts: bool = False,
    ) -> None:
        self.lens = lightfield.lens
        # How many samples are taken, and why, is for each trial to say.
        render = passes.without(without_target(lightfield.render))
        if parts:
            render["passes"] = [*passes.PARTS_OF_LIGHT, "material"]
        self.lightfield = lightfield.changed(render=render)
        self._blend, self._inventory = blend, inventory
        self._device = device
        self._threads = threads
        self._cache = cache
        self._started = False

    @classmethod
    def of(cls, arguments: argparse.Namespace, lightfield: LightField) -> "Trials":
        """Return what the arguments of `add_arguments` ask for."""
        return cls(
            arguments.blend,
            arguments.inventory,
            lightfield,
            arguments.device,
            arguments.threads,
            arguments.cache,
        )

    def on(self, device: str, lens: Lens) -> "Trials":
        """Return what renders the same views on another device and through another lens."""
        there = self.lightfield.changed(lens)
        return Trials(self._blend, self._inventory, there, device, self._threads, self._cache)

    def pilot(self, lens: Lens | None = None) -> "Trials":
        """Return what renders the same views with the parts of their light, through a lens."""
        there = self.lightfield.changed(lens)
        on = (self._device, self._threads, self._cache)
        return Trials(self._blend, self._inventory, there, *on, parts=True)

    @cached_property
    def inventory(self) -> Any:
        """What the scene contains, and how its .blend traces paths."""
        return read_inventory(self._inventory, "left_out", "sampling", "volumes")

    @property
    def has_volumes(self) -> bool:
        """Whether there is fog, smoke or fire in the scene."""
        return bool(self.inventory["volumes"])

    @property
    def whole(self) -> Window:
        """The first view, all of it."""
        return Window(self.lightfield.views[0], 0, 0, self.lens.width, self.lens.height)

    def render(self, window: Window, seed: int, sampling: Mapping[str, Any]) -> Trial:
        """Render a window under the render settings that ``sampling`` changes."""
        settings = {**self.lightfield.render, **PLAIN, **sampling, "seed": seed}
        place = [window.x, window.y, window.width, window.height]
        one = self.lightfield.changed(render=settings, device=self._renders_on, window=place)
        key = keys.render_key(one, window.view)
        path = self._cache / f"{key[:32]}.exr"
        if not images.is_finished(path, key):
            self._render(window, settings, path, key)
        image = images.read_image(path)
        return Trial(
            colour=image.colour,
            depth=image.channels.get("Z"),
            samples=float(image.attributes[SAMPLES_ATTRIBUTE]),
            seconds=float(image.attributes[SECONDS_ATTRIBUTE]),
            device=str(image.attributes[DEVICE_ATTRIBUTE]),
            parts={
                name: image.channels[f"{name}.Y"]
                for name in ((*passes.PARTS_OF_LIGHT, *SURFACES) if "passes" in settings else ())
            },
        )

    def reference(self, window: Window, seeds: int, samples: int) -> Reference:
        """Render a window with ``seeds`` seeds, ``samples`` samples each, and take their mean."""
        renders = [
            self.render(window, REFERENCE_SEED + number, {"samples": samples})
            for number in range(seeds)
        ]
        depths = [render.depth for render in renders if render.depth is not None]
        colours = [render.colour for render in renders]
        return make_reference(colours, depths or None, self.mask(window))

    def mask(self, window: Window) -> Mask:
        """Return which pixels of a window the lens has a ray for, (h, w)."""
        rows, columns = np.mgrid[: window.height, : window.width]
        rays = self.lens.rays(columns + window.x + 0.5, rows + window.y + 0.5)
        inside: Mask = np.isfinite(rays).all(axis=-1)
        return inside

    def camera(self, view: View) -> Camera:
        """Return where a view looks from, as `lightfield.validation.consistency` wants it."""
        return Camera(self.lens, view.matrix, self.lightfield.cycles_depth)

    def windows(self, size: int, count: int) -> list[Window]:
        """Choose ``count`` windows of ``size``², spread evenly over the views and the image.

        A view no larger than that is a window as a whole.
        """
        views = self.lightfield.views
        size = min(size, self.lens.width, self.lens.height)
        found: list[Window] = []
        point = 0
        for number in range(count):
            view = views[int((number + 0.5) * len(views) / count)]
            # In the corners of a fisheye view there is nothing.
            tried: list[tuple[float, Window]] = []
            while not tried or (tried[-1][0] < FULL_ENOUGH and len(tried) < MOST_PLACES):
                # Roberts' R2 sequence, which fills a square evenly.
                point += 1
                across, down = (point * step % 1 for step in R2)
                x = round(across * (self.lens.width - size))
                y = round(down * (self.lens.height - size))
                window = Window(view, x, y, size, size)
                tried.append((float(self.mask(window).mean()), window))
            found.append(max(tried, key=lambda one: one[0])[1])
        return found

    @cached_property
    def _renders_on(self) -> str:
        """What the device is on this machine, where `auto` and `gpu` mean what is there."""
        if self._device == "cpu":
            return "cpu"
        with processors.only(self._threads):
            from lightfield.rendering import cycles
        return cycles.device_name(self._device)

    def _render(self, window: Window, settings: Mapping[str, Any], path: Path, key: str) -> None:
        with processors.only(self._threads):
            from lightfield.rendering import cycles
            from lightfield.rendering.colour_pass import render_colour
            from lightfield.rendering.geometry_pass import render_geometry

        if not self._started:
            self._start(settings)
        # What the trial before this has changed is as the .blend has it again.
        cycles.set_sampling({**self.inventory["sampling"], **settings})
        cycles.set_window(window.x, window.y, window.width, window.height)
        seed = keys.view_seed(settings["seed"], window.view.name)
        raw = render_colour(window.view.matrix, seed, self.lightfield.passes)
        assert raw.samples is not None and raw.worked_seconds is not None
        seconds = raw.worked_seconds if self._on == "CPU" else raw.render_seconds
        channels = {name: raw.pixels[:, :, index] for index, name in enumerate("RGB")}
        channels |= {f"{name}.Y": part.mean(axis=-1) for name, part in raw.passes.items()}
        if raw.passes:
            channels |= self._surfaces(render_geometry(window.view.matrix).materials)
        elif self.lightfield.depth:
            channels["Z"] = render_geometry(window.view.matrix).depth
        images.write_exr(
            path,
            channels,
            {
                images.KEY_ATTRIBUTE: key,
                SAMPLES_ATTRIBUTE: float(raw.samples[self.mask(window)].mean()),
                SECONDS_ATTRIBUTE: seconds,
                DEVICE_ATTRIBUTE: self._on,
            },
        )

    def _surfaces(self, materials: NDArray[np.uint16]) -> dict[str, NDArray[np.float32]]:
        """Return the channels that say of each pixel's material, (h, w), what `SURFACES` has."""
        from lightfield.rendering import ids

        numbers = ids.names("material")
        found = {}
        for surface, features in SURFACES.items():
            named = {name for feature in features for name in self.inventory[feature]}
            members = [number for name, number in numbers.items() if name in named]
            found[f"{surface}.Y"] = np.isin(materials, members).astype(np.float32)
        return found

    def _start(self, settings: Mapping[str, Any]) -> None:
        from lightfield.rendering import colour_pass, cycles

        self._on = cycles.set_up(
            self._blend,
            self.inventory,
            self.lightfield.changed(render=settings),
            self._device,
            self._threads,
        )
        colour_pass.watch_samples()
        # The first render also loads what all others use; it is not timed.
        cycles.set_sampling({**settings, "samples": 1, "denoise": True})
        cycles.set_window(0, 0, min(64, self.lens.width), min(64, self.lens.height))
        colour_pass.render_colour(self.lightfield.views[0].matrix, 0)
        self._started = True


def add_arguments(parser: argparse.ArgumentParser, lightfield: str) -> None:
    """Add what a program that renders windows is asked for; ``lightfield`` says of which file."""
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--inventory", required=True, type=Path, help="what the scene contains")
    parser.add_argument("--lightfield", required=True, type=Path, help=lightfield)
    parser.add_argument(
        "--size",
        type=positive,
        default=WINDOW_SIZE,
        help="of a window's sides (default: %(default)s)",
    )
    parser.add_argument("--device", default="auto", help="what Cycles renders on (default: auto)")
    parser.add_argument("--threads", type=positive, default=1, help="CPU threads (default: 1)")
    parser.add_argument("--cache", required=True, type=Path, help="folder of what was rendered")


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """Add the argument that `read_arguments` reads beside those of `add_arguments`."""
    parser.add_argument(
        "--calibration", type=Path, help="what scripts/calibrate.py chose for a target error"
    )


def read_arguments(arguments: argparse.Namespace) -> tuple[LightField, Trials]:
    """Return the dataset, with the ``render`` settings that its views get, and its trials.

    Settings that calibrate.py chose replace a target error. Raises `UserError` if the dataset has a
    target error, and ``arguments`` name no calibration.
    """
    lightfield = LightField.read(arguments.lightfield)
    if arguments.calibration:
        render = calibrated(lightfield.render, arguments.calibration)
        lightfield = lightfield.changed(render=render)
    elif "samples" not in lightfield.render:
        raise UserError(
            f"{arguments.lightfield}: render has a target error and no samples; "
            "give --calibration, what scripts/calibrate.py chose for it"
        )
    return lightfield, Trials.of(arguments, lightfield)


def nearest_view(views: Sequence[View], view: View) -> View | None:
    """Return the nearest other view that looks the same way to within 70 degrees, if any."""
    alike = math.cos(math.radians(70))
    others = [
        (round(float(np.linalg.norm(other.matrix[:3, 3] - view.matrix[:3, 3])), 6), index)
        for index, other in enumerate(views)
        if other.name != view.name and other.matrix[:3, 2] @ view.matrix[:3, 2] > alike
    ]
    return views[min(others)[1]] if others else None


# Two depths of one surface differ by less than this part: pixels are coarse.
SAME_DEPTH = 0.03


def both_see(
    cameras: tuple[Camera, Camera],
    windows: tuple[Window, Window],
    references: tuple[Reference, Reference],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find surfaces that two windows see: flat indices (n,) of pixels of the one and of the other.

    The first one's pixels are lifted by depth and looked up in the second; those that its depth
    says are hidden there are left out. Both references need depth.
    """
    first, second = cameras
    here, there = windows
    depths = references[0].depth, references[1].depth
    assert depths[0] is not None and depths[1] is not None
    rows, columns = np.nonzero(references[0].mask & np.isfinite(depths[0]))
    points = first.lift(depths[0][rows, columns], columns + here.x, rows + here.y)
    x, y = (second.pixels(points) - (there.x, there.y)).T
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < there.width) & (y >= 0) & (y < there.height)
    across, down = (np.where(inside, value, 0).astype(np.int64) for value in (x, y))
    inside &= references[1].mask[down, across]
    seen = second.lift(depths[1][down, across], across + there.x, down + there.y)
    with np.errstate(invalid="ignore"):
        expected, found = (np.linalg.norm(p - second.position, axis=1) for p in (points, seen))
        same = inside & (np.abs(found / expected - 1) < SAME_DEPTH)
    return (rows * here.width + columns)[same], (down * there.width + across)[same]
