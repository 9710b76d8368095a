"""Turn a rendered view into a PNG to look at: exposed for its own light, tone-mapped, in sRGB."""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.imaging import images, pictures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--input", required=True, type=Path, help="EXR to read")
    parser.add_argument("--output", required=True, type=Path, help="PNG to write")
    parser.add_argument("--exposure", type=float, help="in stops (default: what suits the view)")
    arguments = parser.parse_args()
    colour = pictures.read_colour(arguments.input)
    exposure = arguments.exposure
    if exposure is None:
        exposure = pictures.exposure_for(colour)
    images.write_png(arguments.output, pictures.develop(colour, exposure))


if __name__ == "__main__":
    run(main)
