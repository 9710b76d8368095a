"""Measure reprojection: its error against its run time, and what whole batches of views cost.

Error: the scene is a band-limited function on the sphere. The source is an equidistant fisheye and
the truth a perspective view; each pixel is the mean of the function over it. So no method takes
part in the truth. Every method resamples the same source to the same views: minified by 8, at
unity, magnified by 3. CPU time a view is reading, resampling and writing, EXR to EXR.

Batches (--batch N): N views of 2048 x 2048 pixels with half R G B and Z are the input. The jobs are
EXR with depth at the same size, and PNG at an eighth. The programs are scripts/reproject.py with
its default filter and with st_warp, a bare read and write of the same files, and --peer. All CPU
time counts, also for the start and the lens map, divided by the views. We compress at zlib's level
4. SILVR's tool has level 9 in its source: most of its time goes into 3 % fewer bytes.

--peer PATH adds a program that takes the flags of SILVR's reprojection tool. Writes
reprojection.csv, reprojection_batches.csv, reprojection.svg and reprojection.png into the output
folder.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.configuration.reprojections import DEFAULT_FILTER
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_csv
from lightfield.geometry.lenses import Array, Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images
from lightfield.imaging.halves import narrow, widen
from lightfield.imaging.plots import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, plot
from lightfield.measurement.metrics import pareto
from lightfield.reprojection import lens_map
from lightfield.reprojection.colour import resample_colour

try:
    import cv2
except ImportError:
    cv2 = None

SCRIPTS = Path(sys.path[0])
SENSOR = 36.0
# Times whose relative difference is smaller are equal: repeats differ by as much.
SAME_TIME = 0.03
CAMERA = ["--rectilinear", "18,36"]
STYLES = {
    "nearest": (GREY, "s"),
    "bilinear": (SKY, "o"),
    "bicubic": (BLUE, "^"),
    "lanczos": (GREEN, "v"),
    "adaptive": (VERMILION, "*"),
    "st_warp": (PURPLE, "D"),
    "OpenCV": (ORANGE, "P"),
    "peer": ("black", "X"),
}


@dataclass(frozen=True)
class Result:
    """One method's row of the table; the CPU times are in seconds a view."""

    scenario: str
    method: str
    samples: int
    width: int
    height: int
    rms_error: float
    largest_error: float
    resample_cpu_s: float | None
    view_cpu_s: float

    @property
    def label(self) -> str:
        """The method with its samples, as the plot names it."""
        return self.method if self.samples == 1 else f"{self.method} {self.samples}×{self.samples}"


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("output", type=Path, help="folder to write to")
    add = parser.add_argument
    add("--size", type=int, default=1024, help="pixels of the source's side (default: 1024)")
    add("--repeats", type=int, default=5, help="timings of each method (default: 5)")
    add("--peer", type=Path, metavar="PATH", help="another program that reprojects")
    add("--batch", type=int, default=0, metavar="N", help="views of a batch (default: no batch)")
    add("--batch-size", type=int, default=2048, help="pixels of its views' side (default: 2048)")
    arguments = parser.parse_args()
    if arguments.size < 64:
        sys.exit(f"error: --size {arguments.size}: must be at least 64")
    arguments.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        results = measure_errors(arguments, Path(folder))
    front = pareto_front(results)
    rows = [{**vars(result), "on_front": result in front} for result in results]
    write_csv(arguments.output / "reprojection.csv", rows)
    draw(arguments.output / "reprojection", results, front)
    default = [row for row in results if row.method == DEFAULT_FILTER]
    on_front = all(row in front for row in default)
    print(f"default filter {DEFAULT_FILTER}: {'on' if on_front else 'NOT on'} the Pareto front")
    if arguments.batch:
        with tempfile.TemporaryDirectory() as folder:
            batches = measure_batches(arguments, Path(folder))
        write_csv(arguments.output / "reprojection_batches.csv", batches)


# The scene


class Waves:
    """A sum of plane waves on the sphere, amplitude 1 / frequency, between 0 and 2."""

    def __init__(self, most: float, count: int = 48) -> None:
        rng = np.random.default_rng(0)
        length = np.exp(rng.uniform(math.log(most / 50), math.log(most), count))
        direction = rng.standard_normal((count, 3))
        self.vectors = direction / np.linalg.norm(direction, axis=1)[:, None] * length[:, None]
        self.amplitudes = 1 / length / (1 / length).sum()
        self.phases = rng.uniform(0, 2 * math.pi, count)

    def means(self, lens: Lens, nodes: int) -> Array:
        """Return the (height, width) means over each pixel, by nodes × nodes quadrature."""
        places, weights = np.polynomial.legendre.leggauss(nodes)
        x, y = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
        total = np.ones((lens.height, lens.width))
        for v, down in zip(places / 2, weights / 2, strict=True):
            for u, across in zip(places / 2, weights / 2, strict=True):
                # A row at a time: all waves of all pixels would not fit into memory.
                for row, rays in zip(total, lens.rays(x + u, y + v), strict=True):
                    waves = np.cos(rays @ self.vectors.T + self.phases)
                    row += across * down * (waves @ self.amplitudes)
        return total


# Error against run time


def scenarios(size: int) -> dict[str, Rectilinear]:
    """Return the views by name: at the centre, a pixel spans 8, 1 or 1/3 pixels of the source."""
    unity = size / math.pi  # the source's pixels a radian
    return {
        name: Rectilinear(
            width=width,
            height=width,
            focal_length=unity * scale / width * SENSOR,
            sensor_size=(SENSOR, SENSOR),
        )
        for name, scale, width in (
            ("minify by 8", 1 / 8, round(unity / 4)),
            ("unity", 1.0, round(unity * 2)),
            ("magnify by 3", 3.0, size // 2),
        )
    }


def measure_errors(arguments: argparse.Namespace, folder: Path) -> list[Result]:
    """Return a row for every method and scenario."""
    size = arguments.size
    source = Equidistant(width=size, height=size, fov=math.pi)
    # Up to half of the source's Nyquist frequency.
    scene = Waves(math.pi / 2 * size / math.pi)
    gray = scene.means(source, 3).astype(np.float32)
    gray = np.where(np.isnan(gray), np.float32(0), gray)
    pixels = np.repeat(gray[:, :, None], 4, axis=2)
    view = folder / "views" / "view.exr"
    # The file holds floats, so that rounding to halves adds no error. Reading is timed on halves,
    # for views hold halves.
    images.write_exr(view, dict.fromkeys("RGB", gray))
    half = folder / "half.exr"
    images.write_exr(half, dict.fromkeys("RGB", gray.astype(np.float16)))
    (folder / "lightfield.json").write_text(json.dumps(source.to_lightfield()), encoding="utf-8")
    results = []
    for name, lens in scenarios(size).items():
        print(f"{name}: {lens.width} × {lens.height}", flush=True)
        spans = source.width / math.pi / lens.focal_length * SENSOR / lens.width
        truth = scene.means(lens, max(3, math.ceil(1.2 * spans) + 4))
        io_cpu = best_cpu(partial(read_and_write, half, folder / "out.exr", lens), arguments)
        for method, samples, resample in methods(source, lens, pixels):
            error = resample() - truth
            cpu = best_cpu(resample, arguments)
            results.append(row(name, lens, method, samples, error, cpu, cpu + io_cpu))
        if arguments.peer:
            results += peer_rows(arguments, folder, name, lens, truth)
    return results


def row(
    name: str,
    lens: Lens,
    method: str,
    samples: int,
    error: Array,
    resample_cpu: float | None,
    view_cpu: float,
) -> Result:
    """Return a result, and print it."""
    result = Result(
        name,
        method,
        samples,
        lens.width,
        lens.height,
        float(np.sqrt(np.mean(error**2))),
        float(np.abs(error).max()),
        resample_cpu,
        view_cpu,
    )
    print(f"  {result.label:16s} rms error {result.rms_error:.2e}, {view_cpu:.4f} CPU-s a view")
    return result


def methods(
    source: Lens, target: Lens, pixels: Array
) -> list[tuple[str, int, Callable[[], Array]]]:
    """Return (name, samples, function) of every method that resamples in this process."""
    chosen = [(name, 1) for name in STYLES if name not in ("OpenCV", "peer")]
    chosen += [(name, n) for name in ("bilinear", "bicubic") for n in (2, 4, 8)]
    functions: list[tuple[str, int, Callable[[], Array]]] = []
    for name, samples in chosen:
        mapping = lens_map.compute(source, target, np.eye(3), name, samples)
        row, end_row, column, end_column = mapping.window
        window = np.ascontiguousarray(pixels[row:end_row, column:end_column])
        functions.append((name, samples, partial(ours, window, mapping)))
    if cv2 is not None:
        cv2.setNumThreads(1)
        mapping = lens_map.compute(source, target, np.eye(3), "bicubic")
        x = mapping.centers[..., 0] + np.float32(mapping.window[2] - 0.5)
        y = mapping.centers[..., 1] + np.float32(mapping.window[0] - 0.5)
        for flag in (cv2.INTER_LINEAR, cv2.INTER_CUBIC, cv2.INTER_LANCZOS4):
            functions.append(("OpenCV", 1, partial(opencv, pixels, x, y, flag)))
    return functions


def ours(window: Array, mapping: lens_map.LensMap) -> Array:
    return np.asarray(resample_colour(window, mapping)[:, :, 0])


def opencv(pixels: Array, x: Array, y: Array, flag: int) -> Array:
    return np.asarray(cv2.remap(pixels, x, y, flag)[:, :, 0])


def read_and_write(source: Path, target: Path, lens: Lens) -> None:
    """Do the steps of every method: read a view, and write one of the target's size."""
    read = images.read_image(source, ["R", "G", "B"]).channels
    wide = widen(*(read[name] for name in "RGB"))
    rows = np.arange(lens.height) % len(wide)
    columns = np.arange(lens.width) % wide.shape[1]
    half = np.empty((3, lens.height, lens.width), np.float16)
    narrow(np.ascontiguousarray(wide[rows][:, columns]), half)
    images.write_exr(target, dict(zip("RGB", half, strict=True)))


def best_cpu(function: Callable[[], Any], arguments: argparse.Namespace) -> float:
    """Return the least CPU time of ``function`` among the repeats, after a warm-up call."""
    function()
    times = []
    for _ in range(arguments.repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def peer_rows(
    arguments: argparse.Namespace, folder: Path, name: str, lens: Rectilinear, truth: Array
) -> list[Result]:
    """Return the other program's rows, with the least CPU time of its process."""
    rows = []
    for flag, samples in (("nn", 1), ("bl", 1), ("bc", 1), ("bc", 2), ("bc", 4), ("bc", 8)):
        command = [
            str(arguments.peer), "--rectilinear", f"{lens.focal_length},{SENSOR}",
            "--output-resolution", f"{lens.width},{lens.height}", f"--{flag}",
            "--samples", str(samples), "--exr", "--input-dir", str(folder / "views"),
            "--input-cfg", str(folder / "lightfield.json"),
            "--output-dir", str(folder / "peer"), "--output-cfg", str(folder / "peer.json"),
        ]  # fmt: skip
        cpu = min(cpu_of(command) for _ in range(arguments.repeats))
        out = images.read_image(folder / "peer" / "view.exr", ["R"]).channels["R"]
        rows.append(row(name, lens, "peer", samples, out.astype(np.float64) - truth, None, cpu))
    return rows


def cpu_of(command: Sequence[str]) -> float:
    """Return the CPU time, user and system, of a command that succeeds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if result.returncode:
        raise UserError(f"{command[0]}: failed: {result.stderr or result.stdout}")
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def pareto_front(results: Sequence[Result]) -> list[Result]:
    """Return the rows that no row of their scenario beats in error at the same or less time."""
    front = []
    for name in dict.fromkeys(result.scenario for result in results):
        rows = [result for result in results if result.scenario == name]
        costs = [row.view_cpu_s for row in rows]
        errors = [row.rms_error for row in rows]
        front += [rows[index] for index in pareto(costs, errors, SAME_TIME)]
    return front


def draw(stem: Path, results: Sequence[Result], front: Sequence[Result]) -> None:
    """Draw error over time, a panel for each scenario, as SVG and PNG."""
    names = list(dict.fromkeys(result.scenario for result in results))
    with plot(stem, columns=len(names), size=(15, 5.5)) as panels:
        for panel, name in zip(panels, names, strict=True):
            draw_scenario(panel, [r for r in results if r.scenario == name], front)
        panels[0].set_ylabel("root mean square error (scene mean is 1)")
        panels[-1].legend(loc="upper right")


def draw_scenario(panel: Any, rows: Sequence[Result], front: Sequence[Result]) -> None:
    """Draw the results of one scenario, and their Pareto front."""
    best = [r for r in front if r in rows]
    times = [r.view_cpu_s for r in best]
    errors = [r.rms_error for r in best]
    panel.plot(times, errors, color="black", linewidth=1, linestyle=":", label="Pareto front")
    for method, (color, marker) in STYLES.items():
        points = [r for r in rows if r.method == method]
        if not points:
            continue
        panel.scatter(
            [r.view_cpu_s for r in points],
            [r.rms_error for r in points],
            color=color,
            marker=marker,
            s=150 if method == DEFAULT_FILTER else 45,
            zorder=3,
            label=f"{method} (default)" if method == DEFAULT_FILTER else method,
        )
        for r in points:
            if r.samples > 1:
                panel.annotate(
                    f"{r.samples}²",
                    (r.view_cpu_s, r.rms_error),
                    xytext=(5, 4),
                    textcoords="offset points",
                    fontsize=8,
                    color=color,
                )
    panel.set(
        xscale="log",
        yscale="log",
        xlabel="CPU time a view, EXR to EXR (s)",
        title=f"{rows[0].scenario} ({rows[0].width} × {rows[0].height} pixels)",
    )
    # A wide axis: times that hardly differ must look so.
    low, high = panel.get_xlim()
    middle = math.sqrt(low * high)
    panel.set_xlim(min(low, middle / 2.5), max(high, middle * 2.5))


# Batches


def measure_batches(arguments: argparse.Namespace, folder: Path) -> list[dict[str, Any]]:
    """Return rows of job, program, views, and CPU seconds a view."""
    size = arguments.batch_size
    count = arguments.batch
    write_batch(folder, size, count)
    jobs = {
        "EXR with depth, same size": [*CAMERA, "--exr"],
        "PNG, an eighth": [*CAMERA, "--scale", "0.125", "--png", "--exposure", "-1",
                           "--reinhard", "5"],
    }  # fmt: skip
    rows: list[dict[str, Any]] = []
    for job, flags in jobs.items():
        program = [sys.executable, str(SCRIPTS / "reproject.py"), "--filter"]
        programs = {
            f"ours, {name}": partial(run_batch, [*program, name], folder, flags)
            for name in (DEFAULT_FILTER, "st_warp")
        }
        programs["bare read and write"] = partial(bare, folder, "0.125" in flags)
        if arguments.peer:
            programs["peer"] = partial(run_batch, [str(arguments.peer)], folder, flags)
        for program, measure in programs.items():
            cpu = min(measure() for _ in range(2)) / count
            row = {"job": job, "program": program, "views": count}
            rows.append({**row, "cpu_s_a_view": round(cpu, 4)})
            print(f"{job}: {program}: {cpu:.3f} CPU-s a view", flush=True)
    return rows


def write_batch(folder: Path, size: int, count: int) -> None:
    """Write ``count`` views, half R G B and Z, with a scene's detail and a render's noise.

    Each has a key of its settings, as rendered views have, so that it needs no checksum.
    """
    lens = Equidistant(width=size, height=size, fov=math.pi)
    rng = np.random.default_rng(0)
    gray = Waves(size / 4).means(lens, 1)
    rays = lens.pixel_rays()
    outside = np.isnan(rays[..., 0])
    # A room of 4 × 3 × 6 m.
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.array([2, 1.5, 3]) / np.abs(rays)).min(axis=-1)
    z = np.where(outside, np.inf, distance * -rays[..., 2]).astype(np.float16)
    (folder / "lightfield.json").write_text(
        json.dumps(lens.to_lightfield() | {"depth": "z"}), encoding="utf-8"
    )
    for index in range(count):
        channels = {}
        for name, tint in zip("RGB", (0.9, 0.7, 0.5), strict=True):
            noisy = tint * gray * (1 + 0.02 * rng.standard_normal(gray.shape))
            channels[name] = np.where(outside, 0, noisy).astype(np.float16)
        attributes = {images.DEPTH_ATTRIBUTE: "z", images.KEY_ATTRIBUTE: f"{index:064x}"}
        images.write_exr(folder / "exr" / f"view_{index:04d}f.exr", channels | {"Z": z}, attributes)


def run_batch(program: list[str], folder: Path, flags: list[str]) -> float:
    """Return the CPU time of a program that writes the batch into an empty folder."""
    with tempfile.TemporaryDirectory(dir=folder) as out:
        return cpu_of(
            [
                *program, *flags, "--input-dir", str(folder / "exr"),
                "--input-cfg", str(folder / "lightfield.json"),
                "--output-dir", out, "--output-cfg", str(Path(out) / "lightfield.json"),
            ]
        )  # fmt: skip


def bare(folder: Path, small: bool) -> float:
    """Return the CPU time of reading the batch and writing as many pixels as the job does."""
    start = time.process_time()
    for path in sorted((folder / "exr").iterdir()):
        channels = images.read_image(path, None if not small else ["R", "G", "B"]).channels
        if small:
            side = len(channels["R"]) // 8
            pixels = np.dstack([array[:side, :side] for array in channels.values()])
            images.write_png(folder / "bare.png", (pixels * 100).astype(np.uint8))
        else:
            images.write_exr(folder / "bare.exr", channels)
    return time.process_time() - start


if __name__ == "__main__":
    run(main)
