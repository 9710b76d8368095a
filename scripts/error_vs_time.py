"""Measure the error of renders against their time: plain, adaptive, guided and denoised.

Also try changes of the scene's settings, such as fewer bounces. The .md and the .json say which of
them reach the same error in less time.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.core.errors import UserError
from lightfield.measurement import trial_flags


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    trial_flags.add_arguments(parser, "lightfield.json")
    trial_flags.add_size(parser)
    trial_flags.add_calibration(parser)
    parser.add_argument(
        "--probes",
        type=positive,
        default=1,
        help="windows of each stratum of the views; the first is also rendered in a neighbouring "
        "view (default: 1)",
    )
    parser.add_argument(
        "--octaves",
        type=positive,
        default=8,
        help="how often to double the samples, starting from 1 (default: 8)",
    )
    parser.add_argument(
        "--reference",
        type=positive,
        default=2048,
        help="samples of the reference renders (default: 2048)",
    )
    parser.add_argument(
        "--seeds",
        type=int,
        default=2,
        help="renders of each method with different seeds, 2 or more; more of them separate bias "
        "from variance better (default: 2)",
    )
    parser.add_argument(
        "--output",
        required=True,
        type=Path,
        help="path without suffix of the .csv, .json, .svg and .png to write",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.measurement import error_vs_time, trials

    if arguments.seeds < 2:
        raise UserError(f"--seeds {arguments.seeds}: must be at least 2")

    lightfield, maker = trials.read_arguments(arguments)
    content = error_vs_time.measure(
        maker,
        lightfield.render,
        size=arguments.size,
        windows=arguments.probes,
        octaves=arguments.octaves,
        reference_samples=arguments.reference,
        seeds=arguments.seeds,
        name=arguments.output.name,
    )
    error_vs_time.write(arguments.output, content)


if __name__ == "__main__":
    run(main)
