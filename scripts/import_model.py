"""Make a scene from a model file in glTF, USD, OBJ, PLY or STL, and save it as a .blend.

A settings file is JSON: {"model": "chair.glb", "unit": "box", "light": "softboxes"}.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import check_settings, run
from lightfield.core.files import keep_apart
from lightfield.core.names import LIGHTS, SOFTBOXES


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument("--output", required=True, type=Path, help=".blend to write")
    parser.add_argument(
        "--record", required=True, type=Path, help="JSON to write: the files that were read"
    )
    add_settings_flags(parser)
    arguments = parser.parse_args()
    check_settings(arguments, add_settings_flags, "model")

    # Only now, so that --help need not wait for these.
    from pydantic import TypeAdapter

    from lightfield.configuration.job_settings import ImportSettings
    from lightfield.core.settings import checked, read_settings
    from lightfield.rendering import model

    if arguments.settings:
        settings = read_settings(ImportSettings, arguments.settings)
    else:
        names = ("model", "unit", "up", "ground", "light", "frame", "allow_missing")
        content = {name: getattr(arguments, name) for name in names}
        if arguments.shared_folder is not None:
            content["shared_folder"] = arguments.shared_folder
        settings = checked(TypeAdapter(ImportSettings), content, "flags")
    keep_apart("--record", arguments.record, Path(settings.model))
    record = model.write(settings, arguments.output, arguments.record)
    print(f"{settings.model}: {model.summary(record)}")


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument("--model", help="model file to import")
    flags.add_argument(
        "--unit",
        choices=("box", "metres"),
        default="box",
        help="size of the model. box (default): its largest side becomes 1 m. metres: it keeps its "
        "size and position",
    )
    flags.add_argument(
        "--up",
        choices=("auto", "y", "z"),
        default="auto",
        help="axis that points up in an OBJ, PLY or STL (default: auto, y for OBJ and z for the "
        "others)",
    )
    flags.add_argument("--ground", action="store_true", help="put a floor under the model")
    flags.add_argument(
        "--light",
        choices=LIGHTS,
        default=SOFTBOXES,
        help="light of the scene (default: softboxes, which are three lamps)",
    )
    flags.add_argument(
        "--frame",
        type=int,
        default=1,
        help="frame of the animation at which the size is measured (default: 1)",
    )
    flags.add_argument(
        "--allow-missing",
        action="store_true",
        help="import the model even if files that it names are missing",
    )
    flags.add_argument(
        "--shared-folder",
        metavar="FOLDER",
        help="folder with files that the model may name, beside its own folder",
    )


if __name__ == "__main__":
    run(main)
