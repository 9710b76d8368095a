"""Measure what a dataset's views will cost: a few of them, small, with all their samples.

The time of a sample hardly depends on the resolution, so the time of a full view follows from the
number of pixels. So does the size of its file, as an upper estimate: smaller views show more
detail a pixel, and compress worse.
"""

import argparse
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.dataset import journal
from lightfield.dataset.lightfield import LightField


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--inventory", required=True, type=Path, help="what the scene contains")
    parser.add_argument("--lightfield", required=True, type=Path, help="lightfield.json")
    parser.add_argument("--views", type=int, default=3, help="views to render (default: 3)")
    parser.add_argument("--size", type=int, default=48, help="of their longer side (default: 48)")
    parser.add_argument("--device", default="auto", help="what Cycles renders on (default: auto)")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    views, lens = lightfield.views, lightfield.lens
    scale = min(1.0, arguments.size / max(lens.width, lens.height))
    small = [max(1, round(side * scale)) for side in (lens.width, lens.height)]
    # The first view's time holds some of the start-up, so it is rendered and not counted.
    step = max(1, len(views) // (arguments.views + 1))
    chosen = views[::step][: arguments.views + 1]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        probe = lightfield.changed(lens=lens.resized(*small), views=chosen)
        probe.write(folder / "lightfield.json")
        result = subprocess.run(
            [
                *(sys.executable, Path(__file__).with_name("render_shard.py")),
                *("--blend", arguments.blend, "--inventory", arguments.inventory),
                *("--lightfield", folder / "lightfield.json", "--output", folder / "exr"),
                *("--journal", folder / "journal.jsonl", "--device", arguments.device),
                *("--threads", "1"),
            ],
            check=False,
        )
        if result.returncode:
            raise UserError(f"{arguments.lightfield}: its probe could not be rendered")
        run = journal.read(folder / "journal.jsonl")[0]
        rendered = run.views[1:]
        sizes = [(folder / "exr" / f"{view['view']}.exr").stat().st_size for view in rendered]
    # On a processor the time that it worked, whatever else it did meanwhile.
    busy = "cpu_seconds" if run.start["device"] == "CPU" else "render_seconds"
    factor = lens.width * lens.height / math.prod(small)
    write_json(
        arguments.output,
        {
            "views": len(views),
            "resolution": [lens.width, lens.height],
            "samples": lightfield.render["samples"],
            "device": run.start["device"],
            "view_seconds": [view[busy] * factor for view in rendered],
            "view_bytes": [size * factor for size in sizes],
        },
    )


if __name__ == "__main__":
    run(main)
