"""Compare the pixels of a GPU with those of the processor, for the same samples of one view.

Renders the first view of a dataset on the processor, and twice on the GPU, each time with the same
seed. Prints a Markdown table. Each row compares two renders by the pixels of the image circle:

- equal: the part of the pixels whose colours are equal to the last bit.
- within: the part of the pixels whose colours differ by less than this part of the larger one.
- light: the largest relative difference of a channel's mean.
- depths: the part of the pixels whose depths differ by more than 1e-4 of the depth.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import positive, run
from lightfield.dataset.lightfield import LightField
from lightfield.measurement import trial_flags
from lightfield.measurement.gpu_check import depths_differ
from lightfield.measurement.metrics import Mask
from lightfield.measurement.trials import Trial, Trials

SEED = 1
# The relative differences of colours. The second is half a step of a half float.
BOUNDS = (1e-5, 2.0**-11, 1e-2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    trial_flags.add_arguments(parser, "lightfield.json")
    parser.add_argument(
        "--samples", type=positive, default=16, help="samples per pixel (default: %(default)s)"
    )
    arguments = parser.parse_args()

    lightfield = LightField.read(arguments.lightfield)
    renders = {}
    for name, device, cache in (
        ("processor", "cpu", arguments.cache),
        ("GPU", arguments.device, arguments.cache),
        ("GPU again", arguments.device, arguments.cache / "again"),
    ):
        maker = Trials(
            arguments.blend, arguments.inventory, lightfield, device, arguments.threads, cache
        )
        renders[name] = maker.render(maker.first_view, SEED, {"samples": arguments.samples})
        mask = maker.mask(maker.first_view)
        print(f"{name}: {renders[name].device}, {renders[name].seconds:.3g} s", file=sys.stderr)
    columns = ["equal", *(f"within {bound:.2g}" for bound in BOUNDS), "light", "depths"]
    print(f"| renders | {' | '.join(columns)} |")
    print("| --- |" + " ---: |" * len(columns))
    for first, second in (("processor", "GPU"), ("GPU", "GPU again")):
        print(f"| {first}, {second} | {row(renders[first], renders[second], mask)} |")


def row(first: Trial, second: Trial, mask: Mask) -> str:
    """Return the cells of the table that compare two renders inside the mask (h, w)."""
    colours = first.colour[mask].astype(np.float64)
    others = second.colour[mask].astype(np.float64)
    difference = np.abs(colours - others).max(axis=-1)
    larger = np.maximum(colours, others).max(axis=-1)
    cells = [f"{(difference == 0).mean():.1%}"]
    cells += [f"{(difference <= bound * larger).mean():.1%}" for bound in BOUNDS]
    cells.append(f"{np.abs(others.mean(axis=0) / colours.mean(axis=0) - 1).max():.1e}")
    if first.depth is None or second.depth is None:
        cells.append("–")
    else:
        cells.append(f"{depths_differ(first.depth, second.depth)[mask].mean():.2%}")
    return " | ".join(cells)


if __name__ == "__main__":
    run(main)
