"""Export a dataset's views for a consumer: COLMAP, nerfstudio, NeRF-synthetic, and others.

The options are those of the scene YAML's `exports`, as JSON; configs/schema/scene.schema.json
describes them. An earlier export in the same folder is replaced.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from lightfield import export
from lightfield.core.cli import run
from lightfield.core.settings import checked
from lightfield.dataset.exports import VIEWS, Exports, settings_of
from lightfield.export.source import SourceDataset

# isort: split
from pydantic import TypeAdapter


def main() -> None:
    formats = [name for name in Exports.model_fields if name != "instant_ngp"]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("format", choices=formats)
    parser.add_argument("--dataset", type=Path, required=True, help="the dataset's folder")
    parser.add_argument("--source", default=VIEWS, help=f"a reprojection's name (default: {VIEWS})")
    parser.add_argument(
        "--tested-by",
        nargs=2,
        action="append",
        default=[],
        metavar=("RIG", "FOLDER"),
        help="a rig whose views test what is trained on these, and its dataset's folder",
    )
    parser.add_argument("--suffix", choices=[".png", ".exr"], default=".exr", help="of the views")
    parser.add_argument(
        "--options", type=json.loads, default={}, help="JSON of the export's options"
    )
    parser.add_argument("--output", type=Path, required=True, help="folder to write")
    arguments = parser.parse_args()

    options = checked(TypeAdapter(dict[str, Any]), arguments.options, "--options")
    options = {"sources": [arguments.source], **options}
    settings = checked(TypeAdapter(settings_of(arguments.format)), options, "--options")
    name = "" if arguments.source == VIEWS else arguments.source
    development = {
        key: getattr(settings, key) for key in ("exposure", "reinhard") if hasattr(settings, key)
    }
    beside = {rig: Path(folder) for rig, folder in arguments.tested_by}
    source = SourceDataset(arguments.dataset, name, arguments.suffix, beside, **development)
    files = export.run(arguments.format, source, settings, arguments.output)
    print(f"{arguments.output}: {len(source.lightfield.views)} views in {len(files)} files")


if __name__ == "__main__":
    run(main)
