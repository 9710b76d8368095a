"""Write the JSON schemas in configs/schema/, with which editors complete and check YAML files.

They are generated from the models in lightfield/configuration/. Run this after a change there.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import write_text

FOLDER = Path(__file__).resolve().parents[1] / "configs" / "schema"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--folder", type=Path, default=FOLDER, help="folder to write (default: %(default)s)"
    )
    folder: Path = parser.parse_args().folder

    # Only now, so that --help need not wait for it.
    from lightfield.configuration import json_schema

    for name in json_schema.MODELS:
        write_text(folder / f"{name}.schema.json", json_schema.schema(name))


if __name__ == "__main__":
    run(main)
