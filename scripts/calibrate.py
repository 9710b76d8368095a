"""Choose the cheapest way to render that reaches a scene's target error.

Each way (plain, adaptive, denoised, both) is tried on windows of some views with ever more effort
until it reaches the target, and its effort is then interpolated to meet the target, not to surpass
it. The cheapest is chosen, and held-out views, the nearest others under other seeds, confirm it.
"""

import argparse
import sys
from pathlib import Path

from lightfield.core.cli import positive, run
from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_json
from lightfield.dataset.lightfield import LightField
from lightfield.measurement import calibration, sampling, trials


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    trials.add_arguments(parser, "lightfield.json with render.target_error")
    parser.add_argument(
        "--probes",
        type=positive,
        default=sampling.PROBES,
        help="windows of views, as many held out (default: %(default)s)",
    )
    parser.add_argument("--output", required=True, type=Path, help="JSON of choice and evidence")
    parser.add_argument("--seconds", type=Path, help="JSON of the seconds that each way took")
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    if "target_error" not in lightfield.render:
        raise UserError(f"{arguments.lightfield}: render: is missing the key target_error")
    maker = trials.Trials.of(arguments, lightfield)
    record, seconds = calibration.calibrate(
        maker, lightfield.render, arguments.size, arguments.probes
    )
    write_json(arguments.output, record)
    if arguments.seconds:
        write_json(arguments.seconds, seconds)
    reached = (f"{name} {found['error']:.2g}" for name, found in record["strata"].items())
    target, error, held_out_error = (
        record[k] for k in ("target_error", "probe_error", "held_out_error")
    )
    dataset_name = absolute_path(arguments.lightfield).parent.name
    print(
        f"note: {dataset_name}: {record['way']}, {record['choice']}: "
        f"error {error:.3g} on the probe views and "
        f"{held_out_error:.3g} ± {record['held_out_standard_error']:.1g} on others, "
        f"wanted {target:g}; {record['times_fewer_samples']:.1f} times cheaper than plain path "
        "tracing at equal error; the worst thousandth of pixels left out, with which it is "
        f"{record['probe_error_of_all_pixels']:.3g}; by the light that pixels show most of: "
        f"{', '.join(reached)}"
    )
    wrong = None
    if not record["reached"] and error <= target:
        wrong = (
            f"{target:g} is reached, but the error of all pixels is "
            f"{record['probe_error_of_all_pixels']:.3g}: bright ones are missing"
        )
    elif not record["reached"]:
        most = lightfield.render.get("most_samples")
        wrong = (
            f"{target:g} is not reached within the preset's {most} samples; "
            f"the best there is has {error:.3g}"
        )
    elif not record["confirmed"] and held_out_error > target:
        wrong = f"is {target:g}, and views that the choice does not know have {held_out_error:.3g}"
    if wrong:
        print(f"warning: render.target_error: {wrong}", file=sys.stderr)


if __name__ == "__main__":
    run(main)
