"""Check that a GPU renders the same as the processor, and estimate the hours of full datasets.

A settings file is JSON: {"full": {"LFSphere": {"views": 642, "resolution": [2048, 2048]}}}. `full`
has the size of each dataset whose hours are estimated. Without this file, no hours are estimated.
"""

import argparse
from pathlib import Path

from lightfield.core import units
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json, write_text
from lightfield.measurement import trial_flags


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    trial_flags.add_arguments(parser, "lightfield.json")
    trial_flags.add_calibration(parser)
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument(
        "--output",
        required=True,
        type=Path,
        help="path without suffix of the .json and .md to write",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.core import processors
    from lightfield.core.settings import read_settings
    from lightfield.measurement import gpu_check, trials

    settings = gpu_check.GpuCheckSettings()
    if arguments.settings:
        settings = read_settings(gpu_check.GpuCheckSettings, arguments.settings)
    sizes = {name: size.model_dump() for name, size in settings.full.items()}
    # Without a GPU, nothing is rendered.
    with processors.only(arguments.threads):
        from lightfield.rendering import cycles

    device = {"auto": "gpu"}.get(arguments.device, arguments.device)
    if not cycles.gpu(device):
        raise UserError("device: is cpu; gpu_check wants auto, or the name of a GPU's kind")
    lightfield, maker = trials.read_arguments(arguments)
    content = gpu_check.check(maker, device, lightfield.render, sizes)
    name = arguments.output.name
    text = gpu_check.table(name, content)
    print(text)
    if not content["same"]:
        raise UserError(
            f"{name}: the GPU renders another picture than the processor: colours differ "
            f"{content['colour']:.2f} times as much as noise explains, all light by "
            f"{content['light']:.1f} standard errors, and {content['depth']:.2%} of the depths "
            "differ; try another driver, or render with device=cpu"
        )
    write_text(arguments.output.with_suffix(".md"), text)
    write_json(arguments.output.with_suffix(".json"), content)
    print(
        f"note: {name}: the GPU renders the same picture; it takes "
        f"{units.duration(3600 * sum(content['hours'].values()))} for all datasets at full size"
    )


if __name__ == "__main__":
    run(main)
