"""List what a scene contains, and what its rendering can leave out.

Missing or unreadable files are reported as an error, before they turn views pink. For a user's
.blend, it prints which settings the dataset uses and which it ignores.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", help="name of the file in configs/scenes/ that uses this .blend")
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for it.
    from lightfield.rendering import inventory_file

    inventory_file.write(arguments.blend, arguments.scene, arguments.output)


if __name__ == "__main__":
    run(main)
