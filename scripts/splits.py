"""List which views of a scene's rigs are for training, validation and testing."""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, write_json


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lightfields", type=Path, nargs="+", help="the rigs' lightfield.json files")
    parser.add_argument("--output", type=Path, required=True, help="splits.json to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.formats.lightfield import LightField
    from lightfield.formats.splits_file import splits_content

    scene = absolute_path(arguments.output).parent
    lightfields: dict[str, LightField] = {}
    for path in arguments.lightfields:
        lightfield = LightField.read(path)
        folder = absolute_path(path).parent
        if not folder.is_relative_to(scene):
            raise UserError(f"{lightfield.path}: must be in {scene}, where --output is")
        lightfields[folder.relative_to(scene).as_posix()] = lightfield
    content = splits_content(lightfields)
    write_json(arguments.output, content)
    print(", ".join(f"{len(views)} views for {part}" for part, views in content.items()))


if __name__ == "__main__":
    run(main)
