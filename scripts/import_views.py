"""Import views that somebody else has rendered: link or copy them, and record them."""

import argparse
from pathlib import Path

from lightfield.core.cli import run, view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import link_or_copy
from lightfield.core.progress import Progress


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--dataset",
        required=True,
        type=Path,
        help="folder of the existing dataset, with views in exr/",
    )
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json of the dataset to write"
    )
    parser.add_argument(
        "--views",
        default=":",
        metavar="FIRST:END",
        help="which frames of lightfield.json, as a slice from 0, END excluded (default: all)",
    )
    parser.add_argument("--output", required=True, type=Path, help="folder to write the views to")
    parser.add_argument(
        "--record", type=Path, help="JSON to write: the sizes and checksums of the views"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.formats.lightfield import LightField
    from lightfield.workflow.records import ShardRecord

    views = LightField.read(arguments.lightfield).views
    names = [f"{view.name}.exr" for view in views[view_slice(arguments.views, len(views))]]
    record = ShardRecord(arguments.record, arguments.output)
    progress = Progress(len(names), "import", "views")
    for name in names:
        path = arguments.dataset / "exr" / name
        if not path.is_file():
            raise UserError(f"{path}: no such file, but its lightfield.json has the view")
        imported = arguments.output / name
        link_or_copy(path, imported)
        # A view that its owner renders again is another file. So a change of this file is damage.
        key = f"inode-{path.stat().st_ino}"
        if imported.samefile(path):
            record.refuse_changed(imported, key)
        record.add(imported, key)
        progress.done()
    record.write(arguments.output / name for name in names)


if __name__ == "__main__":
    run(main)
