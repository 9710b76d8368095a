"""Build a scene with one of the builders in scripts/scenes/ and save it as a .blend.

A settings file is JSON: {"builder": "garden", "parameters": {"seed": 0, "detail": 0.5}}.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import check_settings, run
from lightfield.core.names import builders


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument("--output", required=True, type=Path, help=".blend to write")
    add_settings_flags(parser)
    arguments = parser.parse_args()
    check_settings(arguments, add_settings_flags, "builder")

    # Only now, so that --help need not wait for these.
    from pydantic import TypeAdapter

    from lightfield.configuration.job_settings import BuildSettings
    from lightfield.core.settings import checked, read_settings
    from lightfield.rendering import built_scene

    if arguments.settings:
        settings = read_settings(BuildSettings, arguments.settings)
    else:
        parameters = {"seed": arguments.seed, "detail": arguments.detail}
        if arguments.place is not None:
            parameters["place"] = arguments.place
        content = {"builder": arguments.builder, "parameters": parameters}
        settings = checked(TypeAdapter(BuildSettings), content, "flags")
    built_scene.write(settings, arguments.output)


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that stand for a settings file."""
    flags = parser.add_argument_group("Instead of --settings")
    flags.add_argument("--builder", choices=builders(), help="builder that makes the scene")
    flags.add_argument("--seed", type=int, default=0, help="seed of everything random (default: 0)")
    flags.add_argument(
        "--detail",
        type=float,
        default=1.0,
        help="level of detail, above 0 to 1 (default: 1, full detail)",
    )
    flags.add_argument(
        "--place", type=int, help="number of a variant with another layout, materials and light"
    )


if __name__ == "__main__":
    run(main)
