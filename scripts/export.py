"""Export a dataset's views for other programs: COLMAP, nerfstudio, NeRF-synthetic, and others.

A settings file is JSON: {"options": {"sources": ["perspective"], "points": 50000}, "suffix":
".png"}. `options` has the keys of the scene YAML's `exports`, with one source. `suffix` is the
suffix of the source's views, by default .exr. `tested_by` maps rigs to the folders of datasets
whose views test what is trained on these. An export of a sequence reads the folder of a rig, and
`frames` lists the folders of the frames in it. An earlier export in the same folder is replaced.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import check_settings, run
from lightfield.core.names import EXPORTS, VIEWS


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("format", choices=EXPORTS, help="format of the export")
    parser.add_argument(
        "--dataset",
        type=Path,
        required=True,
        help="folder of the dataset; for a sequence, folder of the rig",
    )
    parser.add_argument("--settings", type=Path, metavar="JSON", help="settings file")
    parser.add_argument("--output", type=Path, required=True, help="folder to write")
    add_settings_flags(parser)
    arguments = parser.parse_args()
    check_settings(arguments, add_settings_flags)

    # Only now, so that --help need not wait for these.
    from pydantic import TypeAdapter

    from lightfield import export
    from lightfield.configuration.exports import export_settings_of
    from lightfield.core.settings import checked, read_settings

    model = export_settings_of(arguments.format)
    if arguments.settings:
        settings = read_settings(model, arguments.settings)
    else:
        content = {"options": {"sources": [arguments.source]}, "suffix": arguments.suffix}
        settings = checked(TypeAdapter(model), content, "flags")
    source = export.source_of(arguments.format, settings, arguments.dataset)
    files = export.run(arguments.format, source, settings.options, arguments.output)
    print(f"{arguments.output}: {len(source.lightfield.views)} views in {len(files)} files")


def add_settings_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags that can replace a settings file with default options."""
    flags = parser.add_argument_group("Instead of --settings, with default options")
    flags.add_argument("--source", default=VIEWS, help=f"name of a reprojection (default: {VIEWS})")
    flags.add_argument(
        "--suffix",
        choices=[".png", ".exr"],
        default=".exr",
        help="suffix of the source's images (default: .exr)",
    )


if __name__ == "__main__":
    run(main)
