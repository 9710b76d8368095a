"""Measure how plans, runs with nothing to do, and the status grow with views and members.

Writes a scene with one plane of cameras into a folder of its own, and plans it with Snakemake. Then
it writes the files of a finished build, with views of one pixel. It plans and runs that again, and
shows its status. It does the same with a family of many members. After that it renders one shard of
the test room, and compares the memory in the first and the last quarter of its views. With --built
it also builds a dataset of tiny views, from the scene to the page.
"""

import argparse
import contextlib
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import bookkeeping
import simulated
from checkouts import jobs_on

from lightfield.configuration import config_file as configuration
from lightfield.configuration import keys
from lightfield.configuration.dataset import Dataset
from lightfield.core.files import read_json, write_json, write_text
from lightfield.core.names import ROOT
from lightfield.formats.lightfield import LightField
from lightfield.imaging import images
from lightfield.measurement.costs import job_times
from lightfield.planning.loading import chosen_families, load_datasets

SCENE = """
scene: {{builder: room}}
render: {{samples: 1}}
rigs:
  LFPlane:
    type: plane
    cameras: [{columns}, {rows}]
    size: [2, 1, 1]
    center: [0, 0, 1.5]
    camera: {{lens: CAMERA}}
"""
PLANNED_SCENE = SCENE.replace("CAMERA", "rectilinear, fov: 60, resolution: [16, 16]")
# A real build renders fisheye views, reprojects and exports them, as the other scenes do.
BUILT_SCENE = (
    SCENE.replace("CAMERA", "equidistant, fov: 180, resolution: [8, 8]")
    + """
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 90, resolution: [8, 8]}}
    format: png
exports:
  instant_ngp:
    sources: [perspective]
"""
)
SETTINGS = {"scenes": ["scale"], "preset": "full", "rigs": "all", "device": "cpu"}
# The shards of a real build.
BUILT_SHARDS = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--views", type=int, default=100_000, help="views of the simulated build (default: 100000)")
    add("--shards", type=int, default=2000, help="shards of the simulated build (default: 2000)")
    add("--members", type=int, default=10_000, help="members of the family (default: 10000)")
    add("--rendered", type=int, default=500, help="views of the rendered shard (default: 500)")
    add("--built", type=int, default=0, help="views of the real build, of 8² (default: no build)")
    arguments = parser.parse_args()
    print("| what | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |", flush=True)
    for measure, views in (
        (partial(plans, shards=arguments.shards), arguments.views),
        (a_family, arguments.members),
        (a_shard, arguments.rendered),
        (a_build, arguments.built),
    ):
        with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
            if views:
                measure(views)


def plans(views: int, shards: int) -> None:
    """Measure plans before and after a simulated build, a run without work, and the status."""
    count = write_settings(views, max(1, views // shards))
    row(f"plan of {count} views in {shards} shards", "--dry-run")
    # A process of its own, so that no later process inherits its memory.
    simulation = multiprocessing.Process(target=simulate)
    simulation.start()
    simulation.join()
    row("plan of a finished build", "--dry-run")
    row("run of a finished build")
    row("status", "--nolock", "status")
    next(Path("results").glob("*/*/exr/*")).unlink()
    row("plan with one view lost", "--dry-run")


def a_family(members: int) -> None:
    """Measure plans before and after a simulated build of a family, and a run without work."""
    scene = PLANNED_SCENE.format(columns=3, rows=1)
    write_text("configs/scenes/scale.yaml", f"{scene}family: {{seeds: 0-{members - 1}}}\n")
    write_json("config.yaml", SETTINGS)
    row(f"plan of {members} members", "--dry-run")
    simulation = multiprocessing.Process(target=simulate_family)
    simulation.start()
    simulation.join()
    row("plan of finished members", "--dry-run")
    row("run of finished members")
    row("status of members", "--nolock", "status")
    next(Path("results").glob("*/*/*/sha256sums.txt")).unlink()
    row("plan with one member lost", "--dry-run")


def a_shard(views: int) -> None:
    """Measure one process that renders ``views`` views."""
    write_settings(views, views)
    (dataset,) = chosen()
    ((first, end),) = dataset.shards
    record = bookkeeping.shard(dataset.name, "render", f"{first}-{end}")
    row(f"a shard of {end} views", record)
    memory = [size / 1e6 for size in bookkeeping.memory_of_views(Path(record))]
    quarter = len(memory) // 4
    print(
        f"its memory: {statistics.median(memory[:quarter]):.0f} MB in the first quarter "
        f"of its views, {statistics.median(memory[-quarter:]):.0f} MB in the last"
    )


def a_build(views: int) -> None:
    """Measure a build from the scene to the page, and a run that finds it finished."""
    count = write_settings(views, max(1, views // BUILT_SHARDS), BUILT_SCENE)
    (dataset,) = chosen()
    seconds = row(f"build of {count} views of 8² in {len(dataset.shards)} shards")
    row("run with nothing to do")
    row("plan with nothing to do", "--dry-run")
    print("| its jobs | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |")
    for kind in read_json(Path(dataset.paths.costs))["stages"]:
        print(
            f"| {kind['stage']}, {kind['jobs']} jobs | {kind['wall_seconds']:.1f} "
            f"| {kind['cpu_seconds']:.1f} | {kind['peak_memory_bytes'] / 1e6:.0f} |"
        )
    wall, cpu, memory = job_times(Path(f"work/benchmarks/{dataset.name}/report/page.tsv"))
    print(f"| page | {wall:.1f} | {cpu:.1f} | {memory / 1e6:.0f} |")
    page = Path(dataset.paths.page)
    print(f"{1000 * seconds / count:.0f} ms a view; the page has {page.stat().st_size} bytes")


def write_settings(views: int, views_per_shard: int, scene: str = PLANNED_SCENE) -> int:
    """Write the scene and the settings of a build into the current folder; return its view count.

    The count is the largest one up to ``views`` that fills the plane.
    """
    columns = round(views**0.5)
    rows = views // columns
    write_text("configs/scenes/scale.yaml", scene.format(columns=columns, rows=rows))
    write_json("config.yaml", SETTINGS | {"views_per_shard": views_per_shard})
    return columns * rows


def chosen() -> list[Dataset]:
    """Return the datasets that the settings choose."""
    return load_datasets(chosen_settings())


def chosen_settings() -> configuration.Configuration:
    """Return the settings of the present folder."""
    repository = configuration.read_config(ROOT / "config.yaml")
    build = configuration.read_config(Path("config.yaml"))
    return configuration.load_config(repository | build)


def row(label: str, *arguments: str) -> float:
    """Run Snakemake in the current folder, print a row of what it took, and return its seconds.

    Memory is Snakemake's own peak, without its jobs.
    """
    snakefile = str(ROOT / "Snakefile")
    command = ["snakemake", "--cores", "1", "--quiet", "all", "--snakefile", snakefile]
    with Path("output.txt").open("wb") as output:
        process = subprocess.Popen([*command, *arguments], stdout=output, stderr=output)
        began = os.times().elapsed
        peak = 0
        ended = 0
        while not ended:
            peak = peak_kib(process.pid) or peak
            time.sleep(0.1)
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
    if status:
        sys.exit(Path("output.txt").read_text(encoding="utf-8"))
    seconds = os.times().elapsed - began
    print(
        f"| {label} | {seconds:.1f} | {usage.ru_utime + usage.ru_stime:.1f} "
        f"| {peak * 1024 / 1e6:.0f} |",
        flush=True,
    )
    return seconds


def peak_kib(process: int) -> int:
    """Return the peak memory of a process so far, in KiB; 0 once it has ended."""
    for line in Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1])
    return 0


def simulate() -> None:
    """Write all files of a finished build: views of one pixel, and correct records."""
    (dataset,) = chosen()
    lightfield = LightField.from_rig(dataset.rig, dataset.rig.camera.make(), **dataset.origin)
    lightfield.write(dataset.paths.lightfield)
    folder = Path(dataset.paths.views)
    folder.mkdir()
    # Views differ by the key in the header alone.
    pattern = "0" * 64
    images.write_exr(
        "view.exr", {"R": np.zeros((1, 1), np.float16)}, {images.KEY_ATTRIBUTE: pattern}
    )
    content = Path("view.exr").read_bytes()
    for first, end in dataset.shards:
        shard_keys = {}
        for view in lightfield.views[first:end]:
            path = folder / f"{view.name}.exr"
            shard_keys[path] = keys.render_key(lightfield, view)
            path.write_bytes(content.replace(pattern.encode(), shard_keys[path].encode()))
        record = bookkeeping.shard(dataset.name, "render", f"{first}-{end}")
        bookkeeping.note_shard(record, shard_keys)
    finish()


def simulate_family() -> None:
    """Write the files of a finished family that a plan looks at: no views, but all receipts."""
    (family,) = chosen_families(chosen_settings()).values()
    for name, members in family.batches().items():
        files = []
        for member in members:
            folder = f"results/scale/{member.name}"
            files += [f"{folder}/member.json", f"{folder}/LFPlane/sha256sums.txt"]
        for file in files:
            write_text(file, "{}")
        bookkeeping.note_batch("scale", name, files)
    finish()


def finish() -> None:
    """Write all other files that a build makes, and note that their jobs are finished."""
    jobs = planned_jobs()
    for name in {name for job in jobs for name in job["output"]}:
        if not Path(name).exists():
            write_text(name, '{"valid": true}')
    simulated.set_times(Path())
    bookkeeping.note_build(".", jobs)
    simulated.set_times(Path())


def planned_jobs() -> list[dict[str, Any]]:
    """Return all jobs of a build, as the tests' logger plugin prints them."""
    command = ["snakemake", "--snakefile", str(ROOT / "Snakefile"), "--dry-run", "--forceall"]
    result = subprocess.run(
        [*command, "--logger", "jobs"],
        env=os.environ | {"PYTHONPATH": str(ROOT / "tests")},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    return jobs_on(result.stderr)


if __name__ == "__main__":
    main()
