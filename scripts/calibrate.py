"""Choose the cheapest method that reaches a scene's target error.

Each method (plain, adaptive, denoised, both) renders windows of some views with ever more effort,
until it reaches the target. Its effort is then interpolated to meet the target exactly. The
cheapest method is chosen. Held-out views, the nearest others with another seed, confirm it.
"""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.cli import positive, run
from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_json
from lightfield.measurement import trial_flags
from lightfield.planning.sampling import PROBES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    trial_flags.add_arguments(parser, "lightfield.json with render.target_error")
    trial_flags.add_size(parser)
    parser.add_argument(
        "--probes",
        type=positive,
        default=PROBES,
        help="number of windows of views to render; as many others are held out to check the "
        "choice (default: %(default)s)",
    )
    parser.add_argument(
        "--output",
        required=True,
        type=Path,
        help="JSON to write: the chosen method, and the measurements behind the choice",
    )
    parser.add_argument(
        "--seconds", type=Path, help="JSON to write: the seconds that each method took"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.formats.lightfield import LightField
    from lightfield.measurement import calibration, trials

    lightfield = LightField.read(arguments.lightfield)
    if lightfield.render.target_error is None:
        raise UserError(f"{arguments.lightfield}: render: is missing the key target_error")
    maker = trials.Trials.of(arguments, lightfield)
    record, seconds = calibration.calibrate(
        maker, lightfield.render, arguments.size, arguments.probes
    )
    write_json(arguments.output, record)
    if arguments.seconds:
        write_json(arguments.seconds, seconds)
    print(summary(absolute_path(arguments.lightfield).parent.name, record))
    warning = problem(record, lightfield.render.most_samples)
    if warning:
        print(f"warning: render.target_error: {warning}", file=sys.stderr)


def summary(name: str, record: Mapping[str, Any]) -> str:
    """Return the choice and its errors in one line."""
    reached = (f"{stratum} {part['error']:.2g}" for stratum, part in record["strata"].items())
    return (
        f"note: {name}: {record['way']}, {record['choice']}: "
        f"error {record['probe_error']:.3g} on the probe views and "
        f"{record['held_out_error']:.3g} ± {record['held_out_standard_error']:.1g} on others, "
        f"wanted {record['target_error']:g}; {record['times_fewer_samples']:.1f} times cheaper "
        "than plain path tracing at equal error; the worst thousandth of pixels left out, with "
        f"which it is {record['probe_error_of_all_pixels']:.3g}; by the light that pixels show "
        f"most of: {', '.join(reached)}"
    )


def problem(record: Mapping[str, Any], most_samples: int | None) -> str | None:
    """Return what is wrong with the choice. None if it reaches the target and is confirmed."""
    target = record["target_error"]
    error = record["probe_error"]
    held_out_error = record["held_out_error"]
    if not record["reached"] and error <= target:
        return (
            f"{target:g} is reached, but the error of all pixels is "
            f"{record['probe_error_of_all_pixels']:.3g}: bright ones are missing"
        )
    if not record["reached"]:
        return (
            f"{target:g} is not reached within the preset's {most_samples} samples; "
            f"the best there is has {error:.3g}"
        )
    if not record["confirmed"] and held_out_error > target:
        return f"is {target:g}, but held-out views have the error {held_out_error:.3g}"
    return None


if __name__ == "__main__":
    run(main)
