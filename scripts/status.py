"""Say how far the chosen datasets are, also while they are being built: from their files alone.

The time left is that at the rate of the last ten minutes, as the journals of the shards have it: it
assumes that the views that are left take as long as those, and that as many processes go on.
"""

import argparse
import time
from pathlib import Path

from lightfield.core.cli import counted, run
from lightfield.report import status


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument("--work", required=True, type=Path, help="folder of the journals")
    parser.add_argument(
        "--dataset",
        action="append",
        nargs=3,
        required=True,
        metavar=("NAME", "VIEWS", "REPROJECTIONS"),
        help="scene/rig, how many views it has, and its reprojections, with commas between them",
    )
    arguments = parser.parse_args()
    now = time.time()
    renderings = []
    total = 0
    for name, text, reprojections in arguments.dataset:
        folder = arguments.results / name
        views = counted("--dataset", text)
        renderings.append(status.look(folder, arguments.work / name, views, now))
        others = list(filter(None, reprojections.split(",")))
        print("\n".join(status.lines(name, folder, views, others, renderings[-1])))
        total += views
    done = sum(len(rendering.finished) for rendering in renderings)
    recent = sum(rendering.recent for rendering in renderings)
    seconds = max(rendering.seconds for rendering in renderings)
    left = status.outlook(total - done, recent, seconds)
    print(f"all: {done} of {total} views rendered{left}")


if __name__ == "__main__":
    run(main)
