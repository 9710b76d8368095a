"""Compare renders of a dataset's test views with the truth. Write errors as CSV, and a page.

RENDERS has <view>.png or <view>.exr for each test view of the dataset's split. Without a split,
every eighth view tests. RENDERS may also have normal/<view>.exr. The rig's name may precede each
view's, as in exports: <rig>_<view>.png. See docs/how-to/evaluate-renders.md.
"""

import argparse
import re
from pathlib import Path

from lightfield.core.cli import run, stops, white
from lightfield.core.leftovers import temporary_folder
from lightfield.core.names import VIEWS

NAMED_COLOURS = {"black": "000000", "white": "ffffff"}


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("renders", type=Path, metavar="RENDERS", help="folder of the renders to evaluate")
    add("--dataset", type=Path, required=True, help="the dataset's folder")
    add("--source", default=VIEWS, help=f"name of a reprojection (default: {VIEWS}, as rendered)")
    add(
        "--suffix",
        choices=[".png", ".exr"],
        default=".exr",
        help="suffix of the dataset's views (default: .exr)",
    )
    add(
        "--exposure",
        type=stops,
        default=0.0,
        help="exposure of EXR views in stops, as in the export (default: 0)",
    )
    add(
        "--reinhard",
        type=white,
        default=1.0,
        help="tone mapping of EXR views, as in the export: the value that becomes white (default: "
        "1, no tone mapping)",
    )
    add(
        "--background",
        type=colour,
        default=colour("black"),
        metavar="COLOUR",
        help="colour behind transparent pixels: black, white or rrggbb (default: black)",
    )
    add(
        "--masks",
        type=Path,
        help="folder of masks, <view>.png; pixels that are 0 in them are not compared",
    )
    add("--output", type=Path, required=True, help="folder to write")
    return parser.parse_args()


def main() -> None:
    arguments = parse_arguments()

    # Only now, so that --help need not wait for these.
    import numpy as np

    from lightfield.export.source import SourceDataset
    from lightfield.export.trainer_splits import splits
    from lightfield.report import evaluation_page

    name = "" if arguments.source == VIEWS else arguments.source
    development = {"exposure": arguments.exposure, "reinhard": arguments.reinhard}
    source = SourceDataset(arguments.dataset, name, arguments.suffix, **development)
    views = source.lightfield.views
    tests = [view for view in views if view.split == "test"] or splits(source.lightfield).test
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    # If the evaluation fails, the output stays as it was.
    with temporary_folder(arguments.output.parent) as temporary:
        overall = evaluation_page.write(
            temporary,
            source,
            tests,
            arguments.renders,
            arguments.masks,
            np.array(arguments.background),
        )
        for path in list(temporary.rglob("*")):
            if path.is_file():
                target = arguments.output / path.relative_to(temporary)
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
    views_compared = "1 view" if len(tests) == 1 else f"{len(tests)} views"
    print(
        f"{views_compared}: PSNR {overall['psnr']:.2f} dB, WS-PSNR {overall['ws_psnr']:.2f} dB, "
        f"IV-PSNR {overall['iv_psnr']:.2f} dB, SSIM {overall['ssim']:.4f}, "
        f"FLIP {overall['flip']:.4f}; LPIPS is left out: no installed package has its weights"
    )


def colour(text: str) -> list[float]:
    """Return a colour's three values in sRGB, 0 to 1."""
    code = NAMED_COLOURS.get(text, text.removeprefix("#"))
    if not re.fullmatch("[0-9a-fA-F]{6}", code):
        raise argparse.ArgumentTypeError(
            f"is {text}; must be black, white or rrggbb, two hexadecimal digits for each channel"
        )
    return [value / 255 for value in bytes.fromhex(code)]


if __name__ == "__main__":
    run(main)
