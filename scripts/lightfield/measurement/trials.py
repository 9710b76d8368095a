"""Renders windows of a dataset's views under changed settings, and measures the time.

A window is a part of a view at the view's own resolution. A smaller full view would show more
detail in a pixel than the dataset does, and a denoiser cannot tell detail from noise.

A cache folder keeps every render with its time, under a key of all its inputs. An interrupted
measurement continues where it stopped, and a repeated one renders nothing. The key names the actual
device, not `auto`, because devices differ in speed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lightfield.configuration import keys
from lightfield.core import processors
from lightfield.core.errors import UserError
from lightfield.formats import passes
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry.depth import conventional_depth
from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import lies_on
from lightfield.imaging import images
from lightfield.measurement.metrics import Mask, Reference, make_reference
from lightfield.planning.sampling import PLAIN, calibrated
from lightfield.stages.measurement import CalibratedTrialStage, TrialStage
from lightfield.validation.consistency import Camera

if TYPE_CHECKING:
    from lightfield.rendering.scenes.open_scene import OpenScene

# Seeds of references begin here, and seeds of trials at 1. So no trial is part of its reference.
_REFERENCE_SEED = 1000

# The steps of Roberts' R2 sequence, which fills a square evenly.
_R2 = (0.7548776662466927, 0.5698402909980532)
# A window has at least this part of its pixels in the image circle, if possible.
FULL_ENOUGH = 0.75
# Tries at most this many places for a window.
_MOST_PLACES = 64

# The kinds of surfaces that a pilot finds, and the features by which the inventory lists their
# materials.
SURFACES = {
    "emitting": ("emission",),
    "translucent": ("translucency",),
    "transparent": ("transmission", "transparency"),
}

_SECONDS_ATTRIBUTE = "plenoforge:core_seconds"
_SAMPLES_ATTRIBUTE = "plenoforge:samples"
_DEVICE_ATTRIBUTE = "plenoforge:device"


@dataclass(frozen=True)
class ViewWindow:
    """A part of one view at the view's resolution: its top left pixel, and its size in pixels."""

    view: View
    x: int
    y: int
    width: int
    height: int

    @property
    def name(self) -> str:
        """The view's name and the window's place in it."""
        return f"{self.view.name}+{self.x}+{self.y}"

    @property
    def megapixels(self) -> float:
        """The size of the window."""
        return self.width * self.height / 1e6

    def grown(self, side: int, lens: Lens) -> "ViewWindow":
        """Return a window of ``side``² pixels around this one, within the view.

        A smaller view is one window.
        """
        width = min(side, lens.width)
        height = min(side, lens.height)
        x = self.x + (self.width - width) // 2
        y = self.y + (self.height - height) // 2
        x = min(max(x, 0), lens.width - width)
        y = min(max(y, 0), lens.height - height)
        return ViewWindow(self.view, x, y, width, height)


@dataclass(frozen=True)
class Trial:
    """One render.

    - ``colour`` (h, w, 3): scene-linear.
    - ``depth`` (h, w): in metres, of Cycles' kind, or None.
    - ``samples``: the mean number of samples that the pixels of the image circle took.
    - ``seconds``: from Cycles' first sample to the end, with denoising, without synchronization. On
      a CPU it is processor time: cores add up, and other load does not count. On a GPU it is
      Cycles' own render time.
    - ``device``: CPU or GPU.
    - ``parts``: only of a pilot. The parts of its light (h, w) by their passes' names, and 1 or 0
      for each of `SURFACES`.
    """

    colour: NDArray[np.float32]
    depth: NDArray[np.float32] | None
    samples: float
    seconds: float
    device: str
    parts: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


class Trials:
    """Renders windows of the views of a lightfield.json, or takes them from the folder ``cache``.

    Blender starts only to render, or to resolve the device ``auto``. In a process, `Trials` must
    render one after the other: once another one has rendered, this one must not. With ``parts`` it
    is a pilot, which also renders the parts of the light and the materials.
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
        # Each trial sets its own samples, so a target error does not matter.
        render = lightfield.render.uncalibrated.without_passes
        if parts:
            render = render.changed(passes=[*passes.PARTS_OF_LIGHT, "material"])
        self.lightfield = lightfield.changed(render=render.to_json())
        self._blend = blend
        self._inventory = inventory
        self._device = device
        self._threads = threads
        self._cache = cache
        self._opened: OpenScene | None = None

    @classmethod
    def of(cls, job: TrialStage[Any], lightfield: LightField) -> "Trials":
        """Return the trials of a stage, on the views of a light field."""
        return cls(job.blend, job.inventory, lightfield, job.device, job.threads, job.cache)

    def on(self, device: str, lens: Lens) -> "Trials":
        """Return trials of the same views on another device and through another lens."""
        lightfield = self.lightfield.changed(lens)
        return Trials(self._blend, self._inventory, lightfield, device, self._threads, self._cache)

    def pilot(self, lens: Lens | None = None) -> "Trials":
        """Return trials that render the parts of the light of the same views, through a lens."""
        return Trials(
            self._blend,
            self._inventory,
            self.lightfield.changed(lens),
            self._device,
            self._threads,
            self._cache,
            parts=True,
        )

    @cached_property
    def inventory(self) -> Any:
        """The content of the scene, and the sampling of its .blend."""
        return read_inventory(self._inventory, "left_out", "sampling", "volumes")

    @property
    def has_volumes(self) -> bool:
        """Whether the scene has fog, smoke or fire."""
        return bool(self.inventory["volumes"])

    @property
    def first_view(self) -> ViewWindow:
        """The whole first view."""
        return ViewWindow(self.lightfield.views[0], 0, 0, self.lens.width, self.lens.height)

    def render(self, window: ViewWindow, seed: int, sampling: Mapping[str, Any]) -> Trial:
        """Render a window with the render settings changed by ``sampling``."""
        settings = self.lightfield.render.changed(**{**PLAIN, **sampling, "seed": seed})
        place = [window.x, window.y, window.width, window.height]
        keyed = self.lightfield.changed(
            render=settings.to_json(), device=self._renders_on, window=place
        )
        key = keys.render_key(keyed, window.view)
        path = self._cache / f"{key[:32]}.exr"
        if not images.is_finished(path, key):
            self._render(window, settings, path, key)
        image = images.read_image(path)
        part_names = (*passes.PARTS_OF_LIGHT, *SURFACES) if settings.passes else ()
        return Trial(
            colour=image.colour,
            depth=image.channels.get("Z"),
            samples=float(image.attributes[_SAMPLES_ATTRIBUTE]),
            seconds=float(image.attributes[_SECONDS_ATTRIBUTE]),
            device=str(image.attributes[_DEVICE_ATTRIBUTE]),
            parts={name: image.channels[f"{name}.Y"] for name in part_names},
        )

    def reference(self, window: ViewWindow, seeds: int, samples: int) -> Reference:
        """Return the mean of renders of a window with ``seeds`` seeds, ``samples`` samples each."""
        renders = [
            self.render(window, _REFERENCE_SEED + number, {"samples": samples})
            for number in range(seeds)
        ]
        depths = [render.depth for render in renders if render.depth is not None]
        colours = [render.colour for render in renders]
        return make_reference(colours, depths or None, self.mask(window))

    def mask(self, window: ViewWindow) -> Mask:
        """Return which pixels (h, w) of a window the lens has a ray for."""
        rows, columns = np.mgrid[: window.height, : window.width]
        rays = self.lens.rays(columns + window.x + 0.5, rows + window.y + 0.5)
        inside: Mask = np.isfinite(rays).all(axis=-1)
        return inside

    def camera(self, view: View) -> Camera:
        """Return the camera of a view for `lightfield.validation.consistency`."""
        return Camera(self.lens, view.world_from_camera, conventional_depth(self.lens))

    def windows(self, size: int, count: int) -> list[ViewWindow]:
        """Choose ``count`` windows of ``size``² pixels, spread evenly over the views and the image.

        A smaller view is one window.
        """
        views = self.lightfield.views
        size = min(size, self.lens.width, self.lens.height)
        chosen: list[ViewWindow] = []
        point = 0
        for number in range(count):
            view = views[int((number + 0.5) * len(views) / count)]
            # The corners of a fisheye view have no pixels in the image circle.
            places: list[tuple[float, ViewWindow]] = []
            while not places or (places[-1][0] < FULL_ENOUGH and len(places) < _MOST_PLACES):
                point += 1
                across, down = (point * step % 1 for step in _R2)
                x = round(across * (self.lens.width - size))
                y = round(down * (self.lens.height - size))
                window = ViewWindow(view, x, y, size, size)
                places.append((float(self.mask(window).mean()), window))
            chosen.append(max(places, key=lambda place: place[0])[1])
        return chosen

    @cached_property
    def _renders_on(self) -> str:
        """The device on this machine, with its name for `auto` and `gpu`."""
        if self._device == "cpu":
            return "cpu"
        with processors.only(self._threads):
            from lightfield.rendering.setup import cycles
        return cycles.device_name(self._device)

    def _render(self, window: ViewWindow, settings: RenderBlock, path: Path, key: str) -> None:
        with processors.only(self._threads):
            from lightfield.rendering.setup import cycles
            from lightfield.rendering.views.colour_pass import render_colour
            from lightfield.rendering.views.geometry_pass import render_geometry

        opened = self._opened = self._opened or self._open(settings)
        # Restore the .blend's settings that an earlier trial changed.
        cycles.set_sampling(RenderBlock(**{**self.inventory["sampling"], **settings.to_json()}))
        cycles.set_window(window.x, window.y, window.width, window.height)
        seed = keys.view_seed(settings.seed, window.view.name)
        pose = window.view.world_from_camera
        raw = render_colour(opened, pose, seed, self.lightfield.passes)
        assert raw.samples is not None and raw.worked_seconds is not None
        seconds = raw.worked_seconds if opened.device == "CPU" else raw.render_seconds
        channels = {name: raw.pixels[:, :, index] for index, name in enumerate("RGB")}
        channels |= {f"{name}.Y": part.mean(axis=-1) for name, part in raw.passes.items()}
        if raw.passes:
            geometry = render_geometry(opened, pose, ["material"])
            numbers = opened.names("material")
            channels |= self._surfaces(numbers, geometry.passes["material"])
        elif self.lightfield.depth:
            channels["Z"] = render_geometry(opened, pose).depth
        images.write_exr(
            path,
            channels,
            {
                images.KEY_ATTRIBUTE: key,
                _SAMPLES_ATTRIBUTE: float(raw.samples[self.mask(window)].mean()),
                _SECONDS_ATTRIBUTE: seconds,
                _DEVICE_ATTRIBUTE: opened.device,
            },
        )

    def _surfaces(
        self, numbers: Mapping[str, int], materials: NDArray[np.uint16]
    ) -> dict[str, NDArray[np.float32]]:
        """Return a channel for each of `SURFACES`, 1 or 0, from the materials (h, w) of a window.

        ``numbers`` are the materials' numbers by their names.
        """
        channels = {}
        for surface, features in SURFACES.items():
            names = {name for feature in features for name in self.inventory[feature]}
            members = [number for name, number in numbers.items() if name in names]
            channels[f"{surface}.Y"] = np.isin(materials, members).astype(np.float32)
        return channels

    def _open(self, settings: RenderBlock) -> "OpenScene":
        """Open the scene, and set Cycles up for the trials."""
        from lightfield.rendering.setup import cycles
        from lightfield.rendering.views import colour_pass, gpu_kernels

        opened = cycles.set_up(
            self._blend,
            self.inventory,
            self.lightfield.changed(render=settings.to_json()),
            self._device,
            self._threads,
        )
        gpu_kernels.compile_first(opened, self.lightfield.views[0].world_from_camera)
        colour_pass.watch_samples()
        # The first render also loads shared data, so it does not count.
        cycles.set_sampling(settings.changed(samples=1, denoise=True))
        cycles.set_window(0, 0, min(64, self.lens.width), min(64, self.lens.height))
        colour_pass.render_colour(opened, self.lightfield.views[0].world_from_camera, 0)
        return opened


def of_calibrated(job: CalibratedTrialStage[Any]) -> tuple[LightField, Trials]:
    """Return the dataset of a stage with its final ``render`` settings, and its trials.

    The choice of calibrate.py replaces a target error. Raises `UserError` if the dataset has a
    target error, and the stage has no calibration.
    """
    lightfield = LightField.read(job.lightfield)
    if job.calibration:
        render = calibrated(lightfield.render, job.calibration)
        lightfield = lightfield.changed(render=render.to_json())
    elif lightfield.render.samples is None:
        raise UserError(
            f"{job.lightfield}: render has a target error and no samples; "
            "give --calibration, the file that scripts/calibrate.py wrote for it"
        )
    return lightfield, Trials.of(job, lightfield)


def nearest_view(views: Sequence[View], view: View) -> View | None:
    """Return the nearest other view whose direction differs by less than 70 degrees, if any."""
    least_cosine = math.cos(math.radians(70))
    distances = []
    for index, other in enumerate(views):
        looks_alike = other.world_from_camera[:3, 2] @ view.world_from_camera[:3, 2] > least_cosine
        if other.name != view.name and looks_alike:
            distance = float(
                np.linalg.norm(other.world_from_camera[:3, 3] - view.world_from_camera[:3, 3])
            )
            distances.append((round(distance, 6), index))
    return views[min(distances)[1]] if distances else None


# A window sees a point that lies on its surface within this part of the distance. Exports allow
# less: they drop points in doubt, but a comparison of noise needs many pixels.
_ON_SURFACE = 0.03


def both_see(
    cameras: tuple[Camera, Camera],
    windows: tuple[ViewWindow, ViewWindow],
    references: tuple[Reference, Reference],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pixels of surfaces that two windows see, as flat indices (n,) into each window.

    Lifts the first window's pixels by their depth, and looks them up in the second window. Leaves
    out pixels that the second window's depth hides. Both references need depth.
    """
    first, second = cameras
    window, other_window = windows
    depths = references[0].depth, references[1].depth
    assert depths[0] is not None and depths[1] is not None
    rows, columns = np.nonzero(references[0].mask & np.isfinite(depths[0]))
    points = first.lift(depths[0][rows, columns], columns + window.x, rows + window.y)
    x, y = (second.pixels(points) - (other_window.x, other_window.y)).T
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (x < other_window.width) & (y >= 0) & (y < other_window.height)
    across, down = (np.where(inside, value, 0).astype(np.int64) for value in (x, y))
    inside &= references[1].mask[down, across]
    surface = second.lift(depths[1][down, across], across + other_window.x, down + other_window.y)
    with np.errstate(invalid="ignore"):
        distance = np.linalg.norm(points - second.position, axis=1)
        surface_distance = np.linalg.norm(surface - second.position, axis=1)
    same = inside & lies_on(surface_distance, distance, part=_ON_SURFACE)
    return (rows * window.width + columns)[same], (down * other_window.width + across)[same]
