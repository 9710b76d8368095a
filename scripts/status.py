"""Print the progress of the chosen datasets, also while a build runs.

Only the datasets' files are read. The time left assumes that rendering continues as in the last ten
minutes: with as many processes, and as many seconds for each view. The journals of the shards
record both.
"""

import argparse
import time
from pathlib import Path

from lightfield.core.cli import counted, run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--results", required=True, type=Path, help="folder of the datasets")
    parser.add_argument(
        "--work",
        required=True,
        type=Path,
        help="folder of intermediate files, with the journals of the shards",
    )
    parser.add_argument(
        "--dataset",
        action="append",
        nargs=3,
        default=[],
        metavar=("NAME", "VIEWS", "REPROJECTIONS"),
        help="a dataset: scene/rig, its number of views, and the names of its reprojections, "
        "separated by commas",
    )
    parser.add_argument(
        "--family",
        action="append",
        nargs=2,
        default=[],
        metavar=("NAME", "MEMBERS"),
        help="a family: its folder, and its number of members",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.report import status

    for name, count in arguments.family:
        members = counted("--family", count)
        print(status.of_family(name, arguments.results / name, members))
    if arguments.dataset:
        print_datasets(arguments)


def print_datasets(arguments: argparse.Namespace) -> None:
    """Print the progress of each dataset and of all together."""
    from lightfield.report import status

    now = time.time()
    renderings = []
    total = 0
    for name, count, reprojection_list in arguments.dataset:
        folder = arguments.results / name
        views = counted("--dataset", count)
        rendering = status.look(folder, arguments.work / name, views, now)
        reprojections = reprojection_list.split(",") if reprojection_list else []
        print("\n".join(status.lines(name, folder, views, reprojections, rendering)))
        renderings.append(rendering)
        total += views
    done = sum(len(rendering.finished) for rendering in renderings)
    recent = sum(rendering.recent for rendering in renderings)
    seconds = max(rendering.seconds for rendering in renderings)
    outlook = status.outlook(total - done, recent, seconds)
    print(f"all: {done} of {total} views rendered{outlook}")


if __name__ == "__main__":
    run(main)
