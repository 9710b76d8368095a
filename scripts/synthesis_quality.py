"""Measure how well views that were held out are synthesised from a dataset: CSV and a plot.

The truth are other datasets of the scene, whose cameras are between those of the first, or the
first one's own views to test with. OUTPUT.csv has a row for each variant, view and region of it,
which are told apart if the truth has all parts of its light as passes; OUTPUT.svg and OUTPUT.png
have the quality against number and bytes of the views that it is made of.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, refuse_beside_settings, run
from lightfield.core.files import write_csv
from lightfield.core.progress import Progress
from lightfield.core.settings import read_settings
from lightfield.dataset.job_settings import SynthesisSettings
from lightfield.export.source import SourceDataset
from lightfield.export.trainer_splits import splits
from lightfield.imaging import images, pictures
from lightfield.measurement import summaries, synthesis_quality

# isort: split
import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("dataset", type=Path, help="folder of a dataset with depth")
    add("--settings", type=Path, metavar="JSON", help="settings file with the flags' names as keys")
    add("--output", type=Path, required=True, metavar="STEM", help="stem of the files to write")
    add_settings_flags(parser)
    arguments = parser.parse_args()

    settings = settings_from(arguments)
    source = SourceDataset(arguments.dataset, "", ".exr")
    truths = [
        SourceDataset(Path(folder), "", ".exr") for folder in settings.truth or [arguments.dataset]
    ]
    views = source.lightfield.views
    held_out = [truth.lightfield.views for truth in truths]
    if not settings.truth:
        views, _, tests = splits(source.lightfield)
        held_out = [tests]
    held_out = [some[:: -(-len(some) // settings.views)] for some in held_out]
    pairs = list(zip(truths, held_out, strict=True))
    colours = [images.read_image(t.path(view), "RGB").colour for t, some in pairs for view in some]
    exposure = pictures.exposure_for(np.concatenate([colour.reshape(-1, 3) for colour in colours]))
    variants = list(synthesis_quality.variants(source, views))
    progress = Progress(len(variants), "synthesis", "variants")
    rows = []
    for variant in variants:
        for truth, some in pairs:
            rows += synthesis_quality.compare(variant, views, some, truth, exposure)
        progress.done()
    write_csv(arguments.output.with_name(f"{arguments.output.name}.csv"), rows)
    means = summaries.means(rows)
    synthesis_quality.draw(means, arguments.output)
    for row in means:
        print(
            f"{row['truth']:<24} {row['variant']:>10} {row['value']:<18} PSNR {row['psnr']:5.2f} "
            f"dB, holes black {row['psnr_black']:5.2f}  WS-PSNR {row['ws_psnr']:5.2f}  "
            f"IV-PSNR {row['iv_psnr']:5.2f}  SSIM {row['ssim']:.3f}  FLIP {row['flip']:.3f}, "
            f"black {row['flip_black']:.3f}  holes {row['holes']:.2%}"
        )


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument(
        "--truth", nargs="+", default=[], help="folders of the datasets that were held out"
    )
    flags.add_argument(
        "--views", type=positive, default=12, help="of each that are compared (default: 12)"
    )


def settings_from(arguments: argparse.Namespace) -> SynthesisSettings:
    """Return the settings of --settings, or those of the flags."""
    if arguments.settings:
        refuse_beside_settings(arguments, add_settings_flags)
        return read_settings(SynthesisSettings, arguments.settings)
    return SynthesisSettings(truth=arguments.truth, views=arguments.views)


if __name__ == "__main__":
    run(main)
