"""Check that Cycles can render on a device of this machine."""

import argparse

from lightfield.core.cli import run
from lightfield.rendering.cycles import gpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "device",
        choices=["auto", "cpu", "gpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="device to look for",
    )
    gpu(parser.parse_args().device)


if __name__ == "__main__":
    run(main)
