"""Tabulate the views, hours and gigabytes of the chosen datasets on this machine.

Reads what scripts/probe.py measured. Hours are those of one processor core, or of the GPU if it
renders. Gigabytes are the size of the rendered views.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import counted, run
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--dataset",
        action="append",
        nargs=3,
        default=[],
        metavar=("NAME", "FRAMES", "PROBE"),
        help="a dataset: scene/rig, its number of frames, and the JSON that scripts/probe.py wrote",
    )
    parser.add_argument(
        "--advice",
        action="append",
        nargs=2,
        default=[],
        metavar=("NAME", "JSON"),
        help="advice for a dataset: scene/rig, and the JSON that scripts/error_vs_time.py wrote "
        "for its scene",
    )
    parser.add_argument(
        "--family", action="append", default=[], metavar="NAME", help="name of a family of scenes"
    )
    parser.add_argument("--output", required=True, type=Path, help="Markdown file to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.measurement import plan

    for name in arguments.family:
        print(f"{name}: its members are not probed; snakemake -n estimates them")
    if arguments.family and not arguments.dataset:
        return
    if not arguments.dataset:
        raise UserError("the views of all chosen datasets exist already: nothing is rendered")
    probes = [
        (name, counted("--dataset", frames), plan.read_probe(probe))
        for name, frames, probe in arguments.dataset
    ]
    advice = {
        name: read_keys(path, "error_vs_time.py", "changes")["changes"]
        for name, path in arguments.advice
    }
    text = plan.table(probes, advice)
    write_text(arguments.output, text)
    print(text, end="")


if __name__ == "__main__":
    run(main)
