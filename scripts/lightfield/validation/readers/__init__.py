"""Reads exports back as their consumers do: one module for each format.

A reader shares no code with the writer of its format in `lightfield.export`. It has
``read(path, size, options)``:

- ``path``: the file that lists the export (transforms.json or export.json).
- ``size``: the views' width and height in pixels.
- ``options``: the options that the export says it was made with.

It returns `contents.Exported`, in the axes and metres of lightfield.json. It raises `UserError` for
a file that its consumer could not open.
"""

from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, reading
from lightfield.dataset.exports import MANIFEST
from lightfield.validation.readers import (
    coco,
    colmap,
    hci,
    instant_ngp,
    lichtfeld,
    mesh,
    miv,
    ncore,
    nerf_synthetic,
    nerfstudio,
    opendibr,
    point_cloud,
    poses_csv,
    scannetpp,
)
from lightfield.validation.readers.contents import Exported

READERS = {
    "coco": coco.read,
    "colmap": colmap.read,
    "hci": hci.read,
    "lichtfeld": lichtfeld.read,
    "mesh": mesh.read,
    "miv": miv.read,
    "ncore": ncore.read,
    "nerf_synthetic": nerf_synthetic.read,
    "nerfstudio": nerfstudio.read,
    "opendibr": opendibr.read,
    "point_cloud": point_cloud.read,
    "poses_csv": poses_csv.read,
    "scannetpp": scannetpp.read,
}


def read(path: Path, size: tuple[int, int]) -> Exported:
    """Read the export that a transforms.json or an export.json lists.

    ``size`` is the views' width and height in pixels. Raises `UserError` for an export that its
    consumer could not open.
    """
    if path.name != MANIFEST:
        return instant_ngp.read(path)
    with reading(path, "list of an export"):
        content = read_json(path)
        name = str(content["format"])
        options = dict(content["options"])
    if name not in READERS:
        raise UserError(f"{path}: format: is {name!r}; must be of {', '.join(READERS)}")
    with reading(path, f"list of an export for {name}"):
        return READERS[name](path, size, options)
