"""Build a batch of a family's members: all their datasets, one member after the other.

Each member starts from a clean Blender file. A member that fails is recorded with its cause, and
the others are built. A finished member whose files are intact is kept.

A settings file is JSON: {"family": "chairs", "scene": {…}, "members": [{"name": "0007", "seed":
7}]}. `scene` and `values` come from the family's scene YAML.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import positive, run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--device",
        default="auto",
        choices=["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"],
        help="device on which Cycles renders (default: auto)",
    )
    parser.add_argument("--threads", type=positive, default=1, help="CPU threads (default: 1)")
    parser.add_argument(
        "--record", required=True, type=Path, help="JSON to write: the state of each member"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration.job_settings import BatchSettings
    from lightfield.core.settings import read_settings
    from lightfield.family import batch

    settings = read_settings(BatchSettings, arguments.settings)
    batch.run(settings, arguments.record, arguments.device, arguments.threads)


if __name__ == "__main__":
    run(main)
