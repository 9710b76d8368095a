"""Try changes of a scene's settings on probe windows, for scripts/advise.py to report."""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.core.files import write_json
from lightfield.measurement import trial_flags


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    trial_flags.add_arguments(parser, "lightfield.json")
    trial_flags.add_size(parser)
    trial_flags.add_calibration(parser)
    parser.add_argument(
        "--probes",
        type=positive,
        default=1,
        help="windows of each stratum of the views (default: %(default)s)",
    )
    parser.add_argument(
        "--reference",
        type=positive,
        default=512,
        help="samples of the reference renders (default: %(default)s)",
    )
    parser.add_argument(
        "--cores",
        type=positive,
        default=1,
        help="cores of the machine, for which different numbers of threads per process are tried "
        "(default: 1)",
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.measurement import advice, threads, trials

    lightfield, maker = trials.read_arguments(arguments)
    name = arguments.output.stem
    # Measure threads first: a process that has started Blender cannot start others that do.
    by_threads = threads.measure(
        lightfield, arguments.blend, arguments.inventory, arguments.device, arguments.cores, name
    )
    experiment = advice.probe_experiment(
        maker, arguments.size, arguments.probes, arguments.reference, name
    )
    content = advice.measure(experiment, lightfield.render, maker.inventory, name)
    write_json(arguments.output, {**content, "threads": by_threads})


if __name__ == "__main__":
    run(main)
