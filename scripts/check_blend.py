"""Check that a .blend is the one that a scene YAML means, by its SHA-256."""

import argparse
from pathlib import Path

from lightfield.cli import run
from lightfield.errors import UserError
from lightfield.files import atomic_path, sha256


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="file to check")
    parser.add_argument("--sha256", required=True, help="what the scene YAML says")
    parser.add_argument("--output", required=True, type=Path, help="written if it is right")
    arguments = parser.parse_args()
    found = sha256(arguments.blend)
    if found != arguments.sha256:
        raise UserError(
            f"{arguments.blend}: its sha256 is {found}, but the scene YAML says {arguments.sha256}"
        )
    with atomic_path(arguments.output) as temporary:
        temporary.write_text(f"{found}  {arguments.blend}\n")


if __name__ == "__main__":
    run(main)
