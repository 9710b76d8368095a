"""Check that Cycles can render on a device of this machine."""

import argparse

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "device",
        choices=["auto", "cpu", "gpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="device to look for",
    )
    device = parser.parse_args().device

    # Only now, so that --help need not wait for it.
    from lightfield.rendering.cycles import gpu

    gpu(device)


if __name__ == "__main__":
    run(main)
