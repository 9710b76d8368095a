"""Measure what a rendered view takes on disk with each codec and precision of depth.

Prints a Markdown table: megabytes, and the CPU seconds of writing and of reading one view.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.geometry.depth import with_precision
from lightfield.imaging import images

PRECISIONS = ("float", "rounded", "half")
REPEATS = 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("view", type=Path, help="EXR of a view with depth as float")
    channels = images.read_image(parser.parse_args().view, "RGBZ").channels
    colour = {name: channels[name] for name in "RGB"}
    print("| compression | depth | MB | write, CPU-s | read, CPU-s |")
    print("| --- | --- | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "view.exr")
        for codec in images.CODECS:
            for precision in ("none", *PRECISIONS):
                planes = dict(colour)
                if precision != "none":
                    planes["Z"] = with_precision(channels["Z"], precision)
                write = cpu_seconds(partial(images.write_exr, path, planes, {}, codec))
                read = cpu_seconds(partial(images.read_image, path))
                size = path.stat().st_size / 1e6
                print(f"| {codec} | {precision} | {size:.1f} | {write:.2f} | {read:.2f} |")


def cpu_seconds(work: Callable[[], Any]) -> float:
    """Return the least CPU time, of all threads, that some work took."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return float(np.min(times))


if __name__ == "__main__":
    run(main)
