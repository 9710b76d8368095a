"""Windows of a dataset's views, rendered in many ways to learn what each way costs and gives.

Whole views made small would show more detail a pixel than the dataset does, which a denoiser cannot
tell from noise; so a probe is a part of a view at the view's own resolution.

Every render is kept in a folder, under a key of all that it follows from, with the time that it
took, so that what is interrupted goes on where it was and what is repeated costs nothing.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core import processors
from lightfield.core.files import read_json
from lightfield.dataset import keys
from lightfield.dataset.lightfield import LightField, View
from lightfield.imaging import images
from lightfield.measurement.calibration import UNCALIBRATED
from lightfield.measurement.metrics import Mask, Reference, make_reference
from lightfield.validation.consistency import Camera

PLAIN = {"adaptive_threshold": 0, "denoise": False}

# Seeds of references begin here, and those of trials at 1: no trial is part of its reference.
REFERENCE_SEED = 1000

R2 = (0.7548776662466927, 0.5698402909980532)
# A probe has at least this part of its pixels in the image circle.
FULL_ENOUGH = 0.75

SECONDS_ATTRIBUTE = "plenoforge:core_seconds"
SAMPLES_ATTRIBUTE = "plenoforge:samples"
DEVICE_ATTRIBUTE = "plenoforge:device"


@dataclass(frozen=True)
class Probe:
    """A window of one view at its own resolution: its top left pixel, and its size."""

    view: View
    x: int
    y: int
    width: int
    height: int

    @property
    def name(self) -> str:
        """The view's name and the window's place in it."""
        return f"{self.view.name}+{self.x}+{self.y}"


@dataclass(frozen=True)
class Trial:
    """One render: colour (h, w, 3) scene-linear; depth (h, w) metres as Cycles gives it, or None.

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


class Trials:
    """Renders probes of the dataset of a lightfield.json, or takes them from ``cache``.

    Blender starts only when something has to be rendered.
    """

    def __init__(
        self,
        blend: Path,
        inventory: Path,
        lightfield: LightField,
        device: str,
        threads: int,
        cache: Path,
    ) -> None:
        self.lens = lightfield.lens
        # How many samples are taken, and why, is for each trial to say.
        render = {k: v for k, v in lightfield.render.items() if k not in UNCALIBRATED}
        self.lightfield = lightfield.changed(render=render)
        self._blend, self._inventory = blend, inventory
        self._device, self._threads, self._cache = device, threads, cache
        self._started = False

    def render(self, probe: Probe, seed: int, sampling: Mapping[str, Any]) -> Trial:
        """Render a probe under the render settings that ``sampling`` changes."""
        settings = {**self.lightfield.render, **PLAIN, **sampling, "seed": seed}
        window = [probe.x, probe.y, probe.width, probe.height]
        one = self.lightfield.changed(render=settings, device=self._device, window=window)
        key = keys.render_key(one, probe.view)
        path = self._cache / f"{key[:32]}.exr"
        if not images.is_finished(path, key):
            self._render(probe, settings, path, key)
        image = images.read_image(path)
        return Trial(
            colour=image.colour,
            depth=image.channels.get("Z"),
            samples=float(image.attributes[SAMPLES_ATTRIBUTE]),
            seconds=float(image.attributes[SECONDS_ATTRIBUTE]),
            device=str(image.attributes[DEVICE_ATTRIBUTE]),
        )

    def reference(self, probe: Probe, seeds: int, samples: int) -> Reference:
        """Render a probe with ``seeds`` seeds, ``samples`` samples each, and take their mean."""
        renders = [
            self.render(probe, REFERENCE_SEED + number, {"samples": samples})
            for number in range(seeds)
        ]
        depths = [render.depth for render in renders if render.depth is not None]
        colours = [render.colour for render in renders]
        return make_reference(colours, depths or None, self.mask(probe))

    def mask(self, probe: Probe) -> Mask:
        """Return which pixels of a probe the lens has a ray for, (h, w)."""
        rows, columns = np.mgrid[: probe.height, : probe.width]
        rays = self.lens.rays(columns + probe.x + 0.5, rows + probe.y + 0.5)
        inside: Mask = np.isfinite(rays).all(axis=-1)
        return inside

    def camera(self, view: View) -> Camera:
        """Return where a view looks from, as `lightfield.validation.consistency` wants it."""
        return Camera(self.lens, view.matrix, self.lightfield.cycles_depth)

    def probes(self, size: int, count: int) -> list[Probe]:
        """Choose ``count`` windows of ``size``², spread evenly over the views and the image.

        A view no larger than a window is a probe as a whole.
        """
        views = self.lightfield.views
        size = min(size, self.lens.width, self.lens.height)
        found: list[Probe] = []
        point = 0
        while len(found) < count:
            view = views[int((len(found) + 0.5) * len(views) / count)]
            # Roberts' R2 sequence, which fills a square evenly.
            point += 1
            across, down = (point * step % 1 for step in R2)
            x, y = round(across * (self.lens.width - size)), round(down * (self.lens.height - size))
            probe = Probe(view, x, y, size, size)
            # In the corners of a fisheye view there is nothing.
            if self.mask(probe).mean() >= FULL_ENOUGH:
                found.append(probe)
        return found

    def _render(self, probe: Probe, settings: Mapping[str, Any], path: Path, key: str) -> None:
        with processors.only(self._threads):
            from lightfield.rendering import cycles
            from lightfield.rendering.view import render_view

        if not self._started:
            self._start(settings)
        cycles.set_sampling(settings)
        cycles.set_window(probe.x, probe.y, probe.width, probe.height)
        seed = keys.view_seed(settings["seed"], probe.view.name)
        raw = render_view(probe.view.matrix, seed)
        assert raw.samples is not None and raw.worked_seconds is not None
        seconds = raw.worked_seconds if self._on == "CPU" else raw.render_seconds
        channels = {name: raw.colour[:, :, index] for index, name in enumerate("RGB")}
        if raw.depth is not None:
            channels["Z"] = raw.depth
        images.write_exr(
            path,
            channels,
            {
                images.KEY_ATTRIBUTE: key,
                SAMPLES_ATTRIBUTE: float(raw.samples[self.mask(probe)].mean()),
                SECONDS_ATTRIBUTE: seconds,
                DEVICE_ATTRIBUTE: self._on,
            },
        )

    def _start(self, settings: Mapping[str, Any]) -> None:
        from lightfield.rendering import cycles, view

        self._on = cycles.set_up(
            self._blend,
            read_json(self._inventory),
            self.lightfield.changed(render=settings),
            self._device,
            self._threads,
        )
        view.watch_samples()
        # The first render also loads what all others use; it is not timed.
        cycles.set_sampling({**settings, "samples": 1, "denoise": True})
        cycles.set_window(0, 0, min(64, self.lens.width), min(64, self.lens.height))
        view.render_view(self.lightfield.views[0].matrix, 0)
        self._started = True


def neighbour(views: Sequence[View], view: View) -> View | None:
    """Return the nearest other view that looks the same way to within 70 degrees, if any."""
    alike = math.cos(math.radians(70))
    others = [
        (round(float(np.linalg.norm(other.matrix[:3, 3] - view.matrix[:3, 3])), 6), index)
        for index, other in enumerate(views)
        if other.name != view.name and other.matrix[:3, 2] @ view.matrix[:3, 2] > alike
    ]
    return views[min(others)[1]] if others else None


# Two depths of one surface differ by less than this part: pixels are coarse, and depth is jittered.
SAME_DEPTH = 0.03


def both_see(
    cameras: tuple[Camera, Camera],
    probes: tuple[Probe, Probe],
    references: tuple[Reference, Reference],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find surfaces that two probes see: flat indices (n,) of pixels of the one and of the other.

    The first one's pixels are lifted by depth and looked up in the second; those that its depth
    says are hidden there are left out. Both references need depth.
    """
    first, second = cameras
    window = probes[1]
    depths = references[0].depth, references[1].depth
    assert depths[0] is not None and depths[1] is not None
    rows, columns = np.nonzero(references[0].mask & np.isfinite(depths[0]))
    points = first.lift(depths[0][rows, columns], columns + probes[0].x, rows + probes[0].y)
    x, y = (second.pixels(points) - (window.x, window.y)).T
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < window.width) & (y >= 0) & (y < window.height)
    across, down = (np.where(inside, value, 0).astype(np.int64) for value in (x, y))
    inside &= references[1].mask[down, across]
    there = second.lift(depths[1][down, across], across + window.x, down + window.y)
    with np.errstate(invalid="ignore"):
        expected, found = (np.linalg.norm(p - second.position, axis=1) for p in (points, there))
        same = inside & (np.abs(found / expected - 1) < SAME_DEPTH)
    here = rows * probes[0].width + columns
    return here[same], (down * window.width + across)[same]
