"""Try on a scene's probes what could be cheaper at equal error; scripts/advise.py says what was."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.core.files import write_json
from lightfield.dataset.lightfield import LightField
from lightfield.measurement import advice, threads, trials


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    trials.add_arguments(parser, "lightfield.json")
    trials.add_calibration(parser)
    parser.add_argument(
        "--probes", type=positive, default=1, help="windows of each stratum (default: %(default)s)"
    )
    parser.add_argument(
        "--reference",
        type=positive,
        default=512,
        help="samples of a reference (default: %(default)s)",
    )
    parser.add_argument(
        "--cores",
        type=positive,
        default=1,
        help="for threads a process to be tried on (default: 1)",
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    lightfield = lightfield.changed(render=trials.own_settings(arguments, lightfield))
    maker = trials.Trials.of(arguments, lightfield)
    name = arguments.output.stem
    # First, because a process that has started Blender can start no others that do.
    scene = (arguments.blend, arguments.inventory)
    by_threads = threads.tried(lightfield, *scene, arguments.device, arguments.cores, name)
    probes = advice.Probes(maker, arguments.size, arguments.probes, arguments.reference, name)
    found = advice.tried(maker, lightfield.render, maker.inventory, probes)
    write_json(arguments.output, {**found, "threads": by_threads})


if __name__ == "__main__":
    run(main)
