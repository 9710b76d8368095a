"""Compute the optical flow from views of a dataset to their neighbours. Keep finished files.

scripts/make_lightfield.py has chosen the neighbour of each frame in lightfield.json. The output
FOLDER/<view>_to_<other>.exr has channels X and Y, in pixels to the right and down. Channel V is 1
where the other view sees the same point. All three are 0 where the other view has no ray to the
point.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run, view_slice
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.progress import Progress


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--lightfield", required=True, type=Path, help="lightfield.json of the dataset"
    )
    parser.add_argument(
        "--views",
        metavar="FIRST:END",
        default=":",
        help="which frames of lightfield.json, as a slice from 0, END excluded (default: all)",
    )
    parser.add_argument(
        "--output", required=True, type=Path, metavar="FOLDER", help="folder to write"
    )
    parser.add_argument(
        "--record", type=Path, help="JSON to write: the sizes and checksums of the files"
    )
    return parser.parse_args()


def main() -> None:
    arguments = parse_arguments()

    # Only now, so that --help need not wait for these.
    import numpy as np

    from lightfield.configuration import keys
    from lightfield.export.source import SourceDataset
    from lightfield.formats.lightfield import LightField
    from lightfield.formats.passes import FLOW
    from lightfield.geometry.flow import flow
    from lightfield.imaging import images
    from lightfield.workflow.records import ShardRecord

    lightfield = LightField.read(arguments.lightfield)
    source = SourceDataset(lightfield.folder, "", ".exr")
    views = lightfield.views[view_slice(arguments.views, len(lightfield.views))]
    view_of_name = {view.name: view for view in lightfield.views}
    record = ShardRecord(arguments.record, arguments.output)
    progress = Progress(len(views), f"flow {lightfield.folder} {arguments.views}".rstrip(": "))
    paths = []
    for view in views:
        neighbour = view_of_name.get(view.others.get("flow", ""))
        if neighbour is None:
            raise UserError(f"{arguments.lightfield}: frames: {view.name}: flow: must name a view")
        path = arguments.output / f"{view.flow}.exr"
        sums = [sha256(source.path(view)), sha256(source.path(neighbour))]
        key = keys.flow_key(lightfield, view, neighbour, sums)
        if not record.is_finished(path, key):
            neighbour_distance = source.depth(neighbour, "distance")
            neighbour_distance[images.may_hide(source.path(neighbour))] = np.nan
            motion, visible = flow(
                source.lens,
                view.matrix,
                neighbour.matrix,
                source.depth(view, "distance"),
                neighbour_distance,
            )
            planes = [*np.moveaxis(np.nan_to_num(motion), -1, 0), visible]
            channels = {
                name: plane.astype(FLOW.dtype)
                for name, plane in zip(FLOW.channels, planes, strict=True)
            }
            images.write_exr(path, channels, {images.KEY_ATTRIBUTE: key})
            record.add(path, key)
        paths.append(path)
        progress.done()
    record.write(paths)


if __name__ == "__main__":
    run(main)
