"""Measure how planning, a run with nothing to do, and the status grow with the number of views.

Writes a scene with one plane of cameras into a folder of its own, and plans it with Snakemake. Then
it writes the files of a finished build, with views of one pixel. It plans and runs that again, and
shows its status. After that it renders one shard of the test room, and compares the memory in the
first and the last quarter of its views. With --built it also builds a dataset of tiny views, from
the scene to the page.
"""

import argparse
import contextlib
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.files import read_json, sha256, write_json, write_text
from lightfield.dataset import configuration, keys, ledger
from lightfield.dataset.dataset import Dataset
from lightfield.dataset.lightfield import LightField
from lightfield.dataset.loading import load_datasets
from lightfield.dataset.names import ROOT
from lightfield.dataset.shard_files import JOURNAL_SUFFIX, LOG_SUFFIX
from lightfield.imaging import images
from lightfield.measurement.costs import job_times

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
# The shards of a real build.
BUILT_SHARDS = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--views", type=int, default=100_000, help="views of the simulated build (default: 100000)")
    add("--shards", type=int, default=2000, help="shards of the simulated build (default: 2000)")
    add("--rendered", type=int, default=500, help="views of the rendered shard (default: 500)")
    add("--built", type=int, default=0, help="views of the real build, of 8² (default: no build)")
    arguments = parser.parse_args()
    print("| what | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |", flush=True)
    for measure, views in (
        (partial(plans, shards=arguments.shards), arguments.views),
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


def a_shard(views: int) -> None:
    """Measure one process that renders ``views`` views."""
    write_settings(views, views)
    (dataset,) = chosen()
    ((first, end),) = dataset.shards
    record = Path(dataset.record("render", first, end))
    row(f"a shard of {end} views", str(record))
    lines = record.with_name(f"{record.stem}{JOURNAL_SUFFIX}").read_text().splitlines()
    entries = [json.loads(line) for line in lines]
    memory = [entry["memory_bytes"] / 1e6 for entry in entries if entry.get("memory_bytes")]
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
    print("| its stage | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |")
    for stage in read_json(Path(dataset.folder, "report", "costs.json"))["stages"]:
        print(
            f"| {stage['stage']}, {stage['jobs']} jobs | {stage['wall_seconds']:.1f} "
            f"| {stage['cpu_seconds']:.1f} | {stage['peak_memory_bytes'] / 1e6:.0f} |"
        )
    wall, cpu, memory = job_times(Path(f"work/benchmarks/{dataset.name}/report/page.tsv"))
    print(f"| page | {wall:.1f} | {cpu:.1f} | {memory / 1e6:.0f} |")
    page = Path(dataset.page)
    print(f"{1000 * seconds / count:.0f} ms a view; the page has {page.stat().st_size} bytes")


def write_settings(views: int, views_per_shard: int, scene: str = PLANNED_SCENE) -> int:
    """Write the scene and the settings of a build into the current folder; return its view count.

    The count is the largest one up to ``views`` that fills the plane.
    """
    columns = round(views**0.5)
    rows = views // columns
    write_text("configs/scenes/scale.yaml", scene.format(columns=columns, rows=rows))
    settings = {"scenes": ["scale"], "preset": "full", "views_per_shard": views_per_shard}
    write_json("config.yaml", settings | {"rigs": "all", "device": "cpu"})
    return columns * rows


def chosen() -> list[Dataset]:
    """Return the datasets that the settings choose."""
    repository = configuration.read_config(ROOT / "config.yaml")
    build = configuration.read_config(Path("config.yaml"))
    return load_datasets(configuration.load_config(repository | build))


def row(label: str, *arguments: str) -> float:
    """Run Snakemake in the current folder, print a row of what it took, and return its seconds.

    Memory is Snakemake's own peak, without that of its jobs.
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
        sys.exit(Path("output.txt").read_text())
    seconds = os.times().elapsed - began
    print(
        f"| {label} | {seconds:.1f} | {usage.ru_utime + usage.ru_stime:.1f} "
        f"| {peak * 1024 / 1e6:.0f} |",
        flush=True,
    )
    return seconds


def peak_kib(process: int) -> int:
    """Return the peak memory of a process so far, in KiB; 0 once it has ended."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1])
    return 0


def simulate() -> None:
    """Write all files of a finished build: views of one pixel, and correct records."""
    (dataset,) = chosen()
    lightfield = LightField.from_rig(
        dataset.rig, dataset.rig.camera.make(), **dataset.origin(dataset.render)
    )
    lightfield.write(f"{dataset.folder}/lightfield.json")
    folder = Path(dataset.folder, "exr")
    folder.mkdir()
    # Views differ by the key in the header alone.
    pattern = "0" * 64
    images.write_exr(
        "view.exr", {"R": np.zeros((1, 1), np.float16)}, {images.KEY_ATTRIBUTE: pattern}
    )
    content = Path("view.exr").read_bytes()
    for first, end in dataset.shards:
        lines = []
        files = {}
        for view in lightfield.views[first:end]:
            path = folder / f"{view.name}.exr"
            key = keys.render_key(lightfield, view)
            path.write_bytes(content.replace(pattern.encode(), key.encode()))
            sums = {"bytes": len(content), "sha256": sha256(path)}
            files[f"exr/{path.name}"] = sums
            lines.append(json.dumps({"file": f"exr/{path.name}", "key": key, **sums}) + "\n")
        record = Path(dataset.record("render", first, end))
        record.parent.mkdir(parents=True, exist_ok=True)
        record.with_suffix(LOG_SUFFIX).write_text("".join(lines))
        record.write_text(json.dumps({"files": files}))
    published = [*dataset.files, *dataset.intermediates]
    for name in [*published, "results/index.html"]:
        if not Path(name).exists():
            write_text(name, '{"valid": true}')
    timestamp = 1_700_000_000
    for root in ("results", "work"):
        for path in Path(root).rglob("*"):
            os.utime(path, (timestamp, timestamp))
    note_jobs(dataset)


def note_jobs(dataset: Dataset) -> None:
    """Write the ledger of the finished build: one job for each shard and for each other file."""
    job_ledger = ledger.Ledger(Path("work", ledger.NAME))
    records = dataset.all_records
    other_files = sorted({*dataset.files, *dataset.intermediates} - {*records})
    from_scene = {name: ledger.Stamp.of(name) for name in other_files if name.startswith("work/")}
    for name in records:
        log = f"{name.removesuffix('.json')}{LOG_SUFFIX}"
        files = {name: ledger.Stamp.of(name)}
        for view, entry in json.loads(Path(name).read_bytes())["files"].items():
            path = f"{dataset.folder}/{view}"
            files[path] = ledger.Stamp.of(path, entry["sha256"])
        job_ledger.note(ledger.Job([name], files, {log: ledger.Stamp.of(log)}, from_scene))
    # The validation reads all views.
    from_views = {name: ledger.Stamp.of(name) for name in records}
    for name in [*other_files, "results/index.html"]:
        read = from_views if name.endswith("/validation.json") else {}
        job_ledger.note(ledger.Job([name], {name: ledger.Stamp.of(name)}, {}, read))


if __name__ == "__main__":
    main()
