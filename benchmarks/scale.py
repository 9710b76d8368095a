"""Measure how planning, a run with nothing to do, and the status grow with the number of views.

Writes into a folder of its own a scene of one plane of cameras, plans it with Snakemake, then
simulates all that a finished build of it has, of views of one pixel, and runs Snakemake, dry and
not, and the status again. Then it renders one shard of the test room and compares the memory of
the first and the last quarter of its views. With --built it also builds a dataset of tiny views,
from the scene to the page.
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
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.files import read_json, sha256, write_json, write_text
from lightfield.dataset import config, keys, ledger
from lightfield.dataset.dataset import Dataset
from lightfield.dataset.lightfield import LightField
from lightfield.dataset.loading import load_datasets
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
# Of a whole build: fisheye views, which are reprojected and exported as those of the other scenes.
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
# Of a dataset that is built: its shards.
BUILT_SHARDS = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=100_000, help="default: 100000")
    parser.add_argument("--shards", type=int, default=2000, help="default: 2000")
    parser.add_argument("--rendered", type=int, default=500, help="views of a real shard")
    parser.add_argument("--built", type=int, default=0, help="views of 8² of a whole build")
    arguments = parser.parse_args()
    print("| what | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |", flush=True)
    for measure, views in (
        (lambda views: plans(views, arguments.shards), arguments.views),
        (a_shard, arguments.rendered),
        (a_build, arguments.built),
    ):
        with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
            if views:
                measure(views)


def plans(views: int, shards: int) -> None:
    """Measure plans, of nothing and of a simulated build, a run, and the status."""
    count = write_settings(views, max(1, views // shards))
    row(f"plan of {count} views in {shards} shards", "--dry-run")
    # In a process of its own, whose memory no other one takes over.
    simulation = multiprocessing.Process(target=simulate)
    simulation.start()
    simulation.join()
    row("plan of a finished build", "--dry-run")
    row("run of a finished build")
    row("status", "--nolock", "status")
    next(Path("results").glob("*/*/exr/*")).unlink()
    row("plan with one view lost", "--dry-run")


def a_shard(views: int) -> None:
    """Measure one process that renders so many views."""
    write_settings(views, views)
    (dataset,) = chosen()
    ((first, end),) = dataset.shards
    record = Path(dataset.record("render", first, end))
    row(f"a shard of {end} views", str(record))
    lines = record.with_name(f"{record.stem}{JOURNAL_SUFFIX}").read_text().splitlines()
    memory = [json.loads(line).get("memory_bytes") for line in lines]
    memory = [entry / 1e6 for entry in memory if entry]
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
    """Write the scene and the settings of a build into the present folder; return its views.

    These are the ``views`` that fill a plane.
    """
    columns = round(views**0.5)
    rows = views // columns
    write_text("configs/scenes/scale.yaml", scene.format(columns=columns, rows=rows))
    settings = {"scenes": ["scale"], "preset": "full", "views_per_shard": views_per_shard}
    write_json("config.yaml", settings | {"rigs": "all", "device": "cpu"})
    return columns * rows


def chosen() -> list[Dataset]:
    """Return the datasets that the settings choose."""
    repository = config.read_config(config.ROOT / "config.yaml")
    own = config.read_config(Path("config.yaml"))
    return load_datasets(config.load_config(repository | own))


def row(what: str, *words: str) -> float:
    """Run Snakemake in the present folder, print what it took, and return its seconds.

    Memory is Snakemake's own peak, without that of its jobs.
    """
    snakefile = str(config.ROOT / "Snakefile")
    command = ["snakemake", "--cores", "1", "--quiet", "all", "--snakefile", snakefile]
    with Path("output.txt").open("wb") as output:
        process = subprocess.Popen([*command, *words], stdout=output, stderr=output)
        began, peak, ended = os.times().elapsed, 0, 0
        while not ended:
            peak = peak_kib(process.pid) or peak
            time.sleep(0.1)
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
    if status:
        sys.exit(Path("output.txt").read_text())
    seconds = os.times().elapsed - began
    print(
        f"| {what} | {seconds:.1f} | {usage.ru_utime + usage.ru_stime:.1f} "
        f"| {peak * 1024 / 1e6:.0f} |",
        flush=True,
    )
    return seconds


def peak_kib(process: int) -> int:
    """Return the most memory that a process had so far; 0 once it has ended."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1])
    return 0


def simulate() -> None:
    """Write all files of a finished build: views of one pixel, and records that are right."""
    (dataset,) = chosen()
    lightfield = LightField.from_rig(
        dataset.rig, dataset.rig.camera.make(), **dataset.origin(dataset.render)
    )
    lightfield.write(f"{dataset.folder}/lightfield.json")
    folder = Path(dataset.folder, "exr")
    folder.mkdir()
    # One view, of which the others differ by the key in the header alone.
    pattern = "0" * 64
    images.write_exr(
        "view.exr", {"R": np.zeros((1, 1), np.float16)}, {images.KEY_ATTRIBUTE: pattern}
    )
    content = Path("view.exr").read_bytes()
    for first, end in dataset.shards:
        lines, files = [], {}
        for view in lightfield.views[first:end]:
            path, key = folder / f"{view.name}.exr", keys.render_key(lightfield, view)
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
    when = 1_700_000_000
    for root in ("results", "work"):
        for path in Path(root).rglob("*"):
            os.utime(path, (when, when))
    note_jobs(dataset)


def note_jobs(dataset: Dataset) -> None:
    """Write the ledger of the finished build: one job for each shard, and for each other file."""
    noted = ledger.Ledger(Path("work", ledger.NAME))
    records = dataset.all_records
    others = sorted({*dataset.files, *dataset.intermediates} - {*records})
    from_scene = {name: ledger.Stamp.of(name) for name in others if name.startswith("work/")}
    for name in records:
        log = f"{name.removesuffix('.json')}{LOG_SUFFIX}"
        files = {name: ledger.Stamp.of(name)}
        for view, entry in json.loads(Path(name).read_bytes())["files"].items():
            path = f"{dataset.folder}/{view}"
            files[path] = ledger.Stamp.of(path, entry["sha256"])
        noted.note(ledger.Job([name], files, {log: ledger.Stamp.of(log)}, from_scene))
    # Of what reads all views, such as the validation.
    from_views = {name: ledger.Stamp.of(name) for name in records}
    for name in [*others, "results/index.html"]:
        read = from_views if name.endswith("/validation.json") else {}
        noted.note(ledger.Job([name], {name: ledger.Stamp.of(name)}, {}, read))


if __name__ == "__main__":
    main()
