"""Measure how planning, a run with nothing to do, and the status grow with the number of views.

Writes into a folder of its own a scene of one plane of cameras, plans it with Snakemake, then
simulates all that a finished build of it has, of views of one pixel, and runs Snakemake, dry and
not, and the status again. Last, it renders one shard of the test room and compares the memory of
the first and the last quarter of its views.
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
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.files import sha256, write_json, write_text
from lightfield.dataset import config, keys, ledger
from lightfield.dataset.dataset import Dataset, load_datasets
from lightfield.dataset.lightfield import LightField
from lightfield.imaging import images

SCENE = """
scene: {{builder: room}}
render: {{samples: 1}}
rigs:
  LFPlane:
    type: plane
    cameras: [{columns}, {rows}]
    size: [2, 1, 1]
    center: [0, 0, 1.5]
    camera: {{lens: rectilinear, fov: 60, resolution: [16, 16]}}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=100_000, help="default: 100000")
    parser.add_argument("--shards", type=int, default=2000, help="default: 2000")
    parser.add_argument("--rendered", type=int, default=500, help="views of a real shard")
    arguments = parser.parse_args()
    columns = round(arguments.views**0.5)
    rows = arguments.views // columns
    print("| what | s | CPU-s | MB |\n| --- | ---: | ---: | ---: |", flush=True)
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        length = columns * rows // arguments.shards
        build(SCENE.format(columns=columns, rows=rows), length)
        row(f"plan of {columns * rows} views in {arguments.shards} shards", "--dry-run")
        # In a process of its own, whose memory no other one takes over.
        simulation = multiprocessing.Process(target=simulate)
        simulation.start()
        simulation.join()
        row("plan of a finished build", "--dry-run")
        row("run of a finished build")
        row("status", "--nolock", "status")
        next(Path("results").glob("*/*/exr/*")).unlink()
        row("plan with one view lost", "--dry-run")
    if arguments.rendered:
        with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
            build(SCENE.format(columns=arguments.rendered, rows=1), arguments.rendered)
            (dataset,) = chosen()
            ((first, end),) = dataset.shards
            record = Path(dataset.record("render", first, end))
            row(f"a shard of {arguments.rendered} views", str(record))
            lines = record.with_name(f"{record.stem}.journal.jsonl").read_text().splitlines()
            memory = [json.loads(line).get("memory_bytes") for line in lines]
            memory = [entry / 1e6 for entry in memory if entry]
            quarter = len(memory) // 4
            print(
                f"its memory: {statistics.median(memory[:quarter]):.0f} MB in the first quarter "
                f"of its views, {statistics.median(memory[-quarter:]):.0f} MB in the last"
            )


def build(scene: str, views_per_shard: int) -> None:
    """Write the scene and the settings of a build into the present folder."""
    write_text("configs/scenes/scale.yaml", scene)
    settings = {"scenes": ["scale"], "preset": "full", "views_per_shard": views_per_shard}
    write_json("config.yaml", settings | {"rigs": "all", "device": "cpu"})


def chosen() -> list[Dataset]:
    """Return the datasets that the settings choose."""
    repository = config.read_config(config.ROOT / "config.yaml")
    own = config.read_config(Path("config.yaml"))
    return load_datasets(config.load_config(repository | own))


def row(what: str, *words: str) -> None:
    """Run Snakemake in the present folder, and print what it took."""
    snakefile = str(config.ROOT / "Snakefile")
    command = ["snakemake", "--cores", "1", "--quiet", "all", "--snakefile", snakefile]
    with Path("output.txt").open("wb") as output:
        process = subprocess.Popen([*command, *words], stdout=output, stderr=output)
        began = os.times().elapsed
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(Path("output.txt").read_text())
    print(
        f"| {what} | {os.times().elapsed - began:.1f} | {usage.ru_utime + usage.ru_stime:.1f} "
        f"| {usage.ru_maxrss * 1024 / 1e6:.0f} |",
        flush=True,
    )


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
        record.with_suffix(".sums.jsonl").write_text("".join(lines))
        record.write_text(json.dumps({"files": files}))
    published = [*dataset.files, *dataset.intermediates]
    for name in [*published, "results/index.html"]:
        if not Path(name).exists():
            write_text(name, '{"valid": true}')
    when = 1_700_000_000
    for root in ("results", "work"):
        for path in Path(root).rglob("*"):
            os.utime(path, (when, when))
    ledger.note(
        Path("work", ledger.NAME), [*dataset.files, *dataset.intermediates], (), lambda _: False
    )


if __name__ == "__main__":
    main()
