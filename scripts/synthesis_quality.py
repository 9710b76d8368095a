"""Measure how well held-out views are synthesised from a dataset: a CSV and a plot.

The truth is other datasets of the scene, with cameras between those of the dataset. Without them it
is the test views of the dataset's own split. OUTPUT.csv has a row for each variant, view and
region. If the truth has all parts of its light as passes, each kind of light is a region.
OUTPUT.svg and OUTPUT.png show the quality over the number and the bytes of the views used.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import check_settings, positive, run
from lightfield.core.files import write_csv
from lightfield.core.progress import Progress


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("dataset", type=Path, help="folder of a dataset with depth")
    add(
        "--settings",
        type=Path,
        metavar="JSON",
        help="settings file, whose keys are the names of the flags",
    )
    add(
        "--output",
        type=Path,
        required=True,
        metavar="STEM",
        help="path without suffix of the files to write",
    )
    add_settings_flags(parser)
    arguments = parser.parse_args()
    check_settings(arguments, add_settings_flags)
    return arguments


def main() -> None:
    arguments = parse_arguments()

    # Only now, so that --help need not wait for these.
    import numpy as np

    from lightfield.configuration.job_settings import SynthesisSettings
    from lightfield.core.settings import read_settings
    from lightfield.export.source import SourceDataset
    from lightfield.export.trainer_splits import splits
    from lightfield.imaging import images, pictures
    from lightfield.measurement import summaries, synthesis_quality

    if arguments.settings:
        settings = read_settings(SynthesisSettings, arguments.settings)
    else:
        settings = SynthesisSettings(truth=arguments.truth, views=arguments.views)
    source = SourceDataset(arguments.dataset, "", ".exr")
    truths = [
        SourceDataset(Path(folder), "", ".exr") for folder in settings.truth or [arguments.dataset]
    ]
    views = source.lightfield.views
    held_out = [truth.lightfield.views for truth in truths]
    if not settings.truth:
        views, _, tests = splits(source.lightfield)
        held_out = [tests]
    held_out = [all_views[:: -(-len(all_views) // settings.views)] for all_views in held_out]
    pairs = list(zip(truths, held_out, strict=True))
    colours = [
        images.read_image(truth.path(view), "RGB").colour
        for truth, true_views in pairs
        for view in true_views
    ]
    exposure = pictures.exposure_for(np.concatenate([colour.reshape(-1, 3) for colour in colours]))
    variants = list(synthesis_quality.variants(source, views))
    progress = Progress(len(variants), "synthesis", "variants")
    rows = []
    for variant in variants:
        for truth, true_views in pairs:
            rows += synthesis_quality.compare(variant, views, true_views, truth, exposure)
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
        "--truth",
        nargs="+",
        default=[],
        help="folders of the datasets to compare with (default: the dataset's own test views)",
    )
    flags.add_argument(
        "--views",
        type=positive,
        default=12,
        help="number of views to compare of each of these datasets (default: 12)",
    )


if __name__ == "__main__":
    run(main)
