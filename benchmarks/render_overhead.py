"""Measure what the workflow adds to Cycles' own render time, and whether memory stays flat.

Renders the test room through scripts/render_shard.py: 200 views of 256 x 256 pixels at one sample,
and a few views of about 2 s each. At one sample, most of a view's time is overhead. Times are wall
time, so nothing else should run on the machine. Cycles' own time comes from the header of its EXR
files.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.engine import receipts
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses

SCRIPTS = Path(sys.path[0])
RESOLUTION = 256
SECONDS = 2.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=200, help="small views (default: 200)")
    parser.add_argument("--slow-views", type=int, default=8, help="views at 2 s (default: 8)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        blend = folder / "room.blend"
        run("build_scene.py", "--builder", "room", "--output", blend)
        small = measure(folder, blend, arguments.views, samples=1)
        one_sample = statistics.median(view["render_seconds"] for view in small)
        samples = max(1, round(SECONDS / max(one_sample, 0.01)))
        slow = measure(folder, blend, arguments.slow_views, samples)
    print("| views | size | samples | s a view | Cycles' own | overhead | share |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for views, count in ((small, 1), (slow, samples)):
        wall = statistics.median(view["wall_seconds"] for view in views)
        render = statistics.median(view["render_seconds"] for view in views)
        overhead = statistics.median(v["wall_seconds"] - v["render_seconds"] for v in views)
        print(
            f"| {len(views)} | {RESOLUTION}² | {count} | {wall:.3f} | {render:.3f} "
            f"| {overhead * 1000:.0f} ms | {overhead / wall:.1%} |"
        )
    memory = [view["memory_bytes"] / 2**20 for view in small]
    quarter = max(1, len(memory) // 4)
    print(
        f"memory over {len(memory)} views: {statistics.median(memory[:quarter]):.0f} MiB in the "
        f"first quarter, {statistics.median(memory[-quarter:]):.0f} MiB in the last"
    )


def measure(folder: Path, blend: Path, count: int, samples: int) -> list[dict[str, Any]]:
    """Render ``count`` views in one process, after one more view; return their lines of history."""
    lens = lenses.from_camera(
        {"lens": "equidistant", "fov": 180, "resolution": [RESOLUTION, RESOLUTION]}
    )
    rig = {"type": "plane", "cameras": [count + 1, 1], "center": [0, 0, 1.5], "size": 1}
    render = {"samples": samples, "adaptive_threshold": 0, "denoise": False, "seed": 0}
    render |= {"depth_precision": "float"}
    lightfield = folder / f"{samples}.json"
    receipt = folder / receipts.FOLDER / f"{samples}.jsonl"
    LightField.from_rig(rig, lens, depth="z", frame=1, render=render).write(lightfield)
    run(
        "render_shard.py",
        "--blend",
        blend,
        "--lightfield",
        lightfield,
        "--output",
        folder / str(samples),
        "--receipt",
        receipt,
        "--device",
        "cpu",
        "--threads",
        "1",
    )
    # The first view pays for the scene's acceleration structures.
    return [line for line in receipts.history(receipt) if "view" in line][1:]


def run(program: str, *arguments: object) -> None:
    subprocess.run([sys.executable, SCRIPTS / program, *map(str, arguments)], check=True)


if __name__ == "__main__":
    main()
