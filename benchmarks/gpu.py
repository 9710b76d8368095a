"""Measure a GPU in a few minutes: each step of a view, a camera by OSL, a build, and the pictures.

Renders two views of each scene with each kind of GPU, at full size with plain samples, and at equal
error: with few samples and a denoiser. The second view counts, because the first one also loads the
scene. Also renders a view through an OSL shader of its lens, builds a preview by Snakemake, and
compares the GPU's pictures with the processor's.

Writes gpu.md and gpu.json into --output after each step. Begins no step that would take longer than
the time that is left, by the steps of its kind before. Ends a step when the time is over. gpu.md
lists what is missing. Start the program again with the same --output, and it does only that.

On a machine without a GPU: --devices cpu --size 256 --samples 16
"""

import argparse
import datetime
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.configuration.dataset_paths import Paths
from lightfield.configuration.scene_yaml import load_scene
from lightfield.core import gpus, machine, processors, units
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json, write_text
from lightfield.core.names import ROOT, scene_folder
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.measurement import gpu_check
from lightfield.measurement.trials import Trial

SCRIPTS = Path(sys.path[0])
SCENES = ("garden", "lone_monk", "barbershop")
# At equal error, denoised views of barbershop take a 21st of 256 samples.
DENOISED_SAMPLES = 12
# Enough to compare two cameras.
CAMERA_SAMPLES = 64
# The GPU that can render through an OSL camera.
OSL_DEVICE = "optix"
SMALL = 64  # pixels
# The steps of the thread that renders.
RENDERING_STEPS = ("synchronization", "geometry", "colour", "blender", "read")
Row = dict[str, Any]


@dataclass(frozen=True)
class View:
    """The seconds of a view by step.

    ``waited`` is the time in which the driver compiled kernels. It is not in ``start``.
    ``blender`` is what Blender adds to Cycles, such as writing its EXR. ``rest`` is all before
    ``convert`` that has no column. From ``convert`` on, a thread writes the view while the next is
    rendered. ``not_rendering`` is the part of the view without ``geometry`` and ``colour``.
    """

    scene: str
    device: str
    samples: int
    denoiser: str
    depth: bool
    waited: float
    start: float
    first_view: float
    view: float
    synchronization: float
    geometry: float
    colour: float
    blender: float
    read: float
    rest: float
    convert: float
    compress: float
    flush: float
    hash: float
    not_rendering: float


@dataclass(frozen=True)
class Camera:
    """A view through an OSL shader beside the same view through Cycles' own camera.

    ``noises`` is the difference of colour in units of noise, and ``depths`` the part of the depths
    that differ, as in `gpu_check.DeviceComparison`.
    """

    scene: str
    device: str
    samples: int
    seconds_of_cycles: float
    seconds_of_osl: float
    first_view_of_osl: float
    noises: float
    depths: float


@dataclass(frozen=True)
class Build:
    """A build by Snakemake, from the scene to the page."""

    scene: str
    rig: str
    preset: str
    views: int
    cores: int
    seconds: float
    valid: bool


@dataclass(frozen=True)
class Pictures:
    """What `gpu_check` found: see `Camera`. ``cores`` is how many cores are as fast as the GPU."""

    scene: str
    device: str
    same: bool
    noises: float
    depths: float
    light: float
    cores: float


TITLES = {
    View: "Seconds of a view by step",
    Camera: "A camera by OSL beside Cycles' own",
    Build: "A build by Snakemake",
    Pictures: "The GPU's pictures beside the processor's",
}


@dataclass(frozen=True)
class Rendered:
    """The line of history of the start, each view's seconds by step, and each view's file."""

    start: Row
    views: list[dict[str, float]]
    files: list[Path]

    @property
    def pixels(self) -> list[Trial]:
        """The pixels of the views, as `gpu_check.compare` takes them."""
        views = [images.read_image(file) for file in self.files]
        return [Trial(view.colour, view.channels["Z"], 0, 0, "") for view in views]


@dataclass(frozen=True)
class Step:
    """One measurement. ``kind`` names steps that take about as long. ``work`` returns its row."""

    name: str
    kind: str
    work: Callable[[], Any]


class Measurement:
    """What was measured until now, in gpu.json and gpu.md, and the time that is left."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self.end: float = time.monotonic() + 60 * arguments.minutes
        self.folder: Path = arguments.output.absolute()
        settings = {name: getattr(arguments, name) for name in ("size", "samples", "preset")}
        subject = {"machine": describe_machine(), "settings": settings}
        today = datetime.datetime.now(datetime.UTC).date().isoformat()
        self.content: dict[str, Any] = {"date": today, **subject, "steps": {}}
        if (self.folder / "gpu.json").exists():
            self.content = read_json(self.folder / "gpu.json")
        if subject != {name: self.content.get(name) for name in subject}:
            raise UserError(
                f"--output {arguments.output}: has measurements of another machine, or with other "
                "settings; give another folder"
            )

    @property
    def steps(self) -> dict[str, Row]:
        """The finished steps by name: their kind, seconds, table and row."""
        steps: dict[str, Row] = self.content["steps"]
        return steps

    @property
    def seconds_left(self) -> float:
        return self.end - time.monotonic()

    def do_all(self, steps: Sequence[Step]) -> None:
        """Do the steps that were not done before. Write the results after each."""
        missing = [step for step in steps if step.name not in self.steps]
        self.content["missing"] = {step.name: "was not begun" for step in missing}
        self.write()
        for step in missing:
            began = time.monotonic()
            self.do(step)
            self.write()
            seconds = units.duration(time.monotonic() - began)
            print(f"{step.name}: {self.content['missing'].get(step.name, seconds)}", flush=True)

    def do(self, step: Step) -> None:
        """Do a step, unless it takes too long. Note its row, or why it is missing."""
        began = time.monotonic()
        try:
            self.check_time(step)
            row = step.work()
        except UserError as error:
            self.content["missing"][step.name] = str(error)
            return
        del self.content["missing"][step.name]
        self.steps[step.name] = {
            "kind": step.kind,
            "seconds": time.monotonic() - began,
            "table": TITLES.get(type(row)),
            "row": asdict(row) if row else {},
        }

    def check_time(self, step: Step) -> None:
        """Raise `UserError` if the time is over, or too short by the steps of this kind."""
        if self.seconds_left <= 0:
            raise UserError("was not begun: no time was left")
        seconds = [done["seconds"] for done in self.steps.values() if done["kind"] == step.kind]
        if max(seconds, default=0.0) > self.seconds_left:
            needed, left = map(units.duration, (max(seconds), self.seconds_left))
            raise UserError(f"was not begun: takes about {needed}, and {left} were left")

    def start(self, *command: object) -> None:
        """Run a program until the time is over. Raises `UserError` if it fails."""
        process = subprocess.Popen(
            [*map(str, command)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            start_new_session=True,
        )
        try:
            _, output = process.communicate(timeout=max(0.0, self.seconds_left))
        except subprocess.TimeoutExpired as error:
            raise UserError(f"was ended after {units.duration(error.timeout)}") from None
        finally:
            # Snakemake's jobs are in its session, too.
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
        if process.returncode:
            errors = re.findall("error: (.*)", output)
            raise UserError(errors[-1] if errors else f"exit status {process.returncode}")

    def python(self, program: Path, *arguments: object) -> None:
        self.start(sys.executable, program, *arguments)

    def write(self) -> None:
        """Write gpu.json and gpu.md."""
        write_json(self.folder / "gpu.json", self.content)
        write_text(self.folder / "gpu.md", "\n".join(self.lines()) + "\n")

    def lines(self) -> Iterator[str]:
        """Yield the lines of gpu.md."""
        yield "# A GPU, measured by benchmarks/gpu.py"
        yield from ("", *table([{**self.content["machine"], "date": self.content["date"]}]))
        for title in TITLES.values():
            rows = [step["row"] for step in self.steps.values() if step["table"] == title]
            if rows:
                yield from ("", f"## {title}", "", *table(rows))
        seconds = {name: step["seconds"] for name, step in self.steps.items()}
        results = {**seconds, **self.content["missing"]}
        yield from ("", "## Seconds of the steps", "")
        yield from table([{"step": name, "seconds": text} for name, text in results.items()])


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table in Markdown. All rows have the same columns."""
    for number, row in enumerate(rows):
        if number == 0:
            yield f"| {' | '.join(name.replace('_', ' ') for name in row)} |"
            yield "| --- " * len(row) + "|"
        yield f"| {' | '.join(map(cell, row.values()))} |"


def cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return units.number(value) if isinstance(value, float) else str(value)


def describe_machine() -> Row:
    """Return what the figures depend on. A machine without NVIDIA's driver has no such figures."""
    fields = ("name", "driver_version", "compute_cap")
    rows = gpus.nvidia(*fields) or [["–"] * len(fields)]
    return {
        **{f"gpu_{field}": value for field, value in zip(fields, rows[0], strict=True)},
        "processor": machine.describe(denoise=True),
        "cores": processors.available(),
        "bpy": version("bpy"),
    }


class Scene:
    """The measurements of a scene, with one of its rigs: its first sphere, or its first rig."""

    def __init__(self, measurement: Measurement, name: str) -> None:
        self.measurement = measurement
        self.arguments = measurement.arguments
        self.name = name
        rigs = load_scene(name).rigs
        spheres = [rig for rig, settings in rigs.items() if settings.type == "sphere"]
        self.rig = (spheres or list(rigs))[0]
        self.paths = self.paths_in("scenes", "full")

    def paths_in(self, name: str, preset: str) -> Paths:
        """Return where Snakemake builds this scene in a folder of the output."""
        folder = self.measurement.folder / name
        return Paths(
            results_root=str(folder / "results"),
            work_root=str(folder / "work"),
            scene=scene_folder(self.name, preset),
            rig=self.rig,
            name=self.name,
        )

    def snakemake(self, paths: Paths, preset: str, *arguments: object) -> None:
        """Start Snakemake for this scene."""
        self.measurement.start(
            *(Path(sys.executable).with_name("snakemake"), "--snakefile", ROOT / "Snakefile"),
            *("--cores", processors.available(), "--config", f"scenes=[{self.name}]"),
            *(f"rigs=[{self.rig}]", f"preset={preset}", f"results={paths.results_root}"),
            *(f"work={paths.work_root}", *arguments),
        )

    def prepare(self) -> None:
        """Build the .blend, and write its inventory and the rig's lightfield.json."""
        targets = (self.paths.lightfield, self.paths.inventory)
        self.snakemake(self.paths, "full", "--", *targets)

    def render(self, device: str, views: LightField, *flags: str) -> Rendered:
        """Render views, and measure their steps."""
        folder = self.measurement.folder / "renders"
        shutil.rmtree(folder, ignore_errors=True)
        views.write(folder / "lightfield.json")
        self.measurement.python(
            Path(__file__).with_name("timed_shard.py"),
            *("--blend", self.paths.built_blend, "--inventory", self.paths.inventory),
            *("--lightfield", folder / "lightfield.json", "--output", folder / "exr"),
            *("--receipt", folder / "receipts/views.jsonl", "--device", device),
            *("--times", folder / "times.json", *flags),
        )
        start, *lines = read_json(folder / "times.json")
        return Rendered(
            start,
            [line["steps"] for line in lines],
            [folder / "exr" / f"{line['view']}.exr" for line in lines],
        )

    def views(self, size: int, samples: int, denoise: bool = False) -> LightField:
        """Return the first two views, with other sizes and samples."""
        whole = LightField.read(self.paths.lightfield)
        render = whole.render.changed(samples=samples, denoise=denoise)
        lens = whole.lens.fitted(size)
        return whole.changed(lens, views=whole.views[:2], render=render.to_json())

    def compile(self, device: str) -> View:
        """Time a small view. It is the first one, for which a driver may compile kernels."""
        return self.time(device, self.views(min(SMALL, self.arguments.size), 1))

    def plain(self, device: str) -> View:
        """Time a view of full size with all samples."""
        return self.time(device, self.views(self.arguments.size, self.arguments.samples))

    def denoised(self, device: str, on_gpu: bool = False, depth: bool = True) -> View:
        """Time a view of full size with few samples and a denoiser."""
        samples = min(DENOISED_SAMPLES, self.arguments.samples)
        views = self.views(self.arguments.size, samples, denoise=True)
        if not depth:
            views = views.changed(depth=None)
        row = self.time(device, views, *(["--denoise-on-gpu"] if on_gpu else []))
        return replace(row, denoiser="GPU" if on_gpu else "processor")

    def time(self, device: str, views: LightField, *flags: str) -> View:
        """Render two views, and return the times of the second one."""
        rendered = self.render(device, views, *flags)
        first, second = rendered.views
        assert isinstance(views.render.samples, int)
        steps = {"geometry": 0.0, **second}
        view = steps.pop("whole")
        before_writing = (steps[name] for name in RENDERING_STEPS)
        return View(
            scene=self.name,
            device=device,
            samples=views.render.samples,
            denoiser="none",
            depth=views.depth is not None,
            waited=rendered.start.get("waited_seconds", 0.0),
            start=rendered.start["start_up_seconds"],
            first_view=first["whole"],
            view=view,
            rest=view - sum(before_writing),
            not_rendering=1 - (steps["colour"] + steps["geometry"]) / view,
            **steps,
        )

    def camera(self, device: str) -> Camera:
        """Compare renders of two seeds through Cycles' camera, and through an OSL shader."""
        samples = min(CAMERA_SAMPLES, self.arguments.samples)
        views = self.views(self.arguments.size, samples)
        first, second = views.views
        # A view's name chooses its seed.
        views = views.changed(views=[first, replace(first, name=second.name)])
        own = self.render(device, views)
        own_pixels = own.pixels
        osl = self.render(device, views, "--osl")
        mask = np.isfinite(views.lens.pixel_rays()).all(axis=-1)
        compared = gpu_check.compare(own_pixels, osl.pixels, mask)
        return Camera(
            scene=self.name,
            device=device,
            samples=samples,
            seconds_of_cycles=own.views[1]["whole"],
            seconds_of_osl=osl.views[1]["whole"],
            first_view_of_osl=osl.views[0]["whole"],
            noises=compared.colour,
            depths=compared.depth,
        )

    def build(self, device: str) -> Build:
        """Build the preview from the scene to the page."""
        shutil.rmtree(self.measurement.folder / "build", ignore_errors=True)
        preset = self.arguments.preset
        paths = self.paths_in("build", preset)
        began = time.monotonic()
        self.snakemake(paths, preset, f"device={device}")
        seconds = time.monotonic() - began
        return Build(
            scene=self.name,
            rig=self.rig,
            preset=preset,
            views=len(LightField.read(paths.lightfield).views),
            cores=processors.available(),
            seconds=seconds,
            valid=read_json(paths.validation)["valid"],
        )

    def pictures(self, device: str) -> Pictures:
        """Compare the GPU's pictures with the processor's."""
        output = self.measurement.folder / "pictures" / self.name
        self.measurement.python(
            SCRIPTS / "gpu_check.py",
            *("--blend", self.paths.built_blend, "--inventory", self.paths.inventory),
            *("--lightfield", self.paths.lightfield, "--device", device, "--output", output),
            *("--threads", processors.available(), "--cache", output.parent / "trials"),
        )
        found = read_json(output.with_suffix(".json"))
        return Pictures(
            scene=self.name,
            device=device,
            same=found["same"],
            noises=found["colour"],
            depths=found["depth"],
            light=found["light"],
            cores=found["core_seconds"] / found["gpu_seconds"],
        )


def steps_of(scenes: Sequence[Scene], devices: Sequence[str]) -> Iterator[Step]:
    """Yield all steps, the most important ones first."""
    main, *others = scenes
    best = devices[-1]
    yield Step(f"{main.name} scene", "scene", main.prepare)
    for device in devices:
        # Nobody knows for how long a driver compiles.
        compile_step = partial(main.compile, device)
        yield Step(f"{main.name} first small view, {device}", device, compile_step)
        yield Step(f"{main.name} plain, {device}", "plain", partial(main.plain, device))
    yield from denoised_steps(main, best)
    if best in (OSL_DEVICE, "cpu"):
        yield Step(f"{main.name} camera by OSL, {best}", "camera", partial(main.camera, best))
    yield Step(f"{main.name} build, {best}", "build", partial(main.build, best))
    for scene in others:
        yield Step(f"{scene.name} scene", "scene", scene.prepare)
        for device in devices:
            yield Step(f"{scene.name} plain, {device}", "plain", partial(scene.plain, device))
        yield from denoised_steps(scene, best)
    for scene in scenes if best != "cpu" else ():
        yield Step(f"{scene.name} pictures, {best}", "pictures", partial(scene.pictures, best))


def denoised_steps(scene: Scene, device: str) -> Iterator[Step]:
    """Yield the steps with views at equal error."""
    name = f"{scene.name} denoised, {device}"
    yield Step(name, "denoised", partial(scene.denoised, device))
    if device != "cpu":
        on_gpu = partial(scene.denoised, device, on_gpu=True)
        yield Step(f"{name}, by the GPU", "denoised", on_gpu)
    no_depth = partial(scene.denoised, device, depth=False)
    yield Step(f"{name}, without depth", "denoised", no_depth)


def present(devices: Sequence[str]) -> list[str]:
    """Return the devices that this machine has. Raises `UserError` if it has none of them."""
    program = [sys.executable, str(SCRIPTS / "check_device.py")]
    found = [
        device
        for device in devices
        if subprocess.run([*program, device], capture_output=True, check=False).returncode == 0
    ]
    if not found:
        raise UserError(
            f"--devices: this machine has no {' and no '.join(devices)} device that Cycles can "
            "use; without a GPU give --devices cpu --size 256 --samples 16"
        )
    return found


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--output", type=Path, required=True, metavar="FOLDER", help="folder to write to")
    add("--minutes", type=float, default=9.5, help="time for all steps (default: 9.5)")
    add("--scenes", nargs="+", default=SCENES, help="most important first (default: SILVR's)")
    add("--devices", nargs="+", default=["cuda", "optix"], help="default: cuda optix")
    add("--size", type=int, default=2048, help="pixels of a view's side (default: 2048)")
    add("--samples", type=int, default=256, help="samples of a plain view (default: 256)")
    add("--preset", default="preview", help="preset of the build (default: preview)")
    arguments = parser.parse_args()
    devices = present(arguments.devices)
    arguments.output.mkdir(parents=True, exist_ok=True)
    measurement = Measurement(arguments)
    scenes = [Scene(measurement, name) for name in arguments.scenes]
    measurement.do_all([*steps_of(scenes, devices)])
    print(f"{arguments.output / 'gpu.md'}: {len(measurement.content['missing'])} steps are missing")


if __name__ == "__main__":
    run(main)
