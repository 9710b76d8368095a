"""Measure how well views that were held out are synthesised from a dataset: CSV and a plot.

The truth is another dataset of the scene, whose cameras are between those of the first, or the
first one's own views to test with. OUTPUT.csv has a row for each variant and view, OUTPUT.svg and
OUTPUT.png the quality against the size of the views that it is made of.
"""

import argparse
from pathlib import Path

import numpy as np

from lightfield.core.cli import run
from lightfield.core.files import write_csv
from lightfield.core.progress import Progress
from lightfield.export.source import Source
from lightfield.export.splits import splits
from lightfield.imaging import images, pictures
from lightfield.measurement import synthesis_quality


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("dataset", type=Path, help="folder of a dataset with depth")
    add("--truth", type=Path, help="folder of the dataset that was held out")
    add("--views", type=int, default=12, help="that are compared, at most (default: 12)")
    add("--output", type=Path, required=True, metavar="STEM")
    arguments = parser.parse_args()

    source = Source(arguments.dataset, "", ".exr")
    if arguments.truth:
        truth, views = Source(arguments.truth, "", ".exr"), source.lightfield.views
        held_out = truth.lightfield.views
    else:
        truth, parts = source, splits(source.lightfield)
        views, held_out = parts.train, parts.test
    held_out = held_out[:: -(-len(held_out) // arguments.views)]
    targets = truth.lightfield.changed(views=held_out)
    colours = np.stack([images.read_image(truth.path(view), "RGB").colour for view in held_out])
    exposure = pictures.exposure_for(colours)
    variants = list(synthesis_quality.variants(source, views))
    progress = Progress(len(variants), "synthesis", "variants")
    rows = []
    for variant in variants:
        rows += synthesis_quality.compare(variant, targets, truth, exposure)
        progress.done()
    write_csv(arguments.output.with_name(f"{arguments.output.name}.csv"), rows)
    means = synthesis_quality.means(rows)
    synthesis_quality.draw(means, arguments.output)
    for row in means:
        print(
            f"{row['variant']:>10} {row['value']:<20} PSNR {row['psnr']:5.2f} dB  SSIM "
            f"{row['ssim']:.3f}  FLIP {row['flip']:.3f}  holes {row['holes']:.2%}"
        )


if __name__ == "__main__":
    run(main)
