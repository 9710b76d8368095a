"""The lists of exports' files in a dataset: which kinds there are, and how to read each."""

from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.names import MESH
from lightfield.formats.layout import Manifest

# The list of an export's files, which is written last.
MANIFEST = "export.json"

# The folder of a dataset that holds its exports.
FOLDER = "exports"

MASK = "dynamic_mask_{view}.png"
"""The mask beside a PNG view. instant-ngp does not train on pixels where it is above 0."""


def files_of(path: Path) -> dict[str, str]:
    """Return the files that an export.json lists, with their SHA-256."""
    try:
        files = read_json(path)["files"]
        return {str(name): str(digest) for name, digest in files.items()}
    except (UserError, LookupError, TypeError, AttributeError):
        raise UserError(f"{path}: is not JSON with files and their sha256") from None


def _pictures(path: Path) -> list[str]:
    return [name for name in files_of(path) if name.endswith(".png")]


def _pictures_of_transforms(path: Path) -> list[str]:
    """Return the images that a transforms.json names: views and depth maps."""
    try:
        frames = read_json(path)["frames"]
        depths = [str(frame["depth_path"]) for frame in frames if "depth_path" in frame]
        return [str(frame["file_path"]) for frame in frames] + depths
    except (UserError, LookupError, TypeError):
        raise UserError(f"{path}: is not JSON with frames, each with a file_path") from None


# The exports with a folder of their own. Exports of a sequence are in the rig's folder.
IN_FOLDERS = Manifest(f"{FOLDER}/*/{MANIFEST}", _pictures, files=files_of)
MANIFESTS = [
    # instant-ngp's files lie beside the views.
    Manifest("transforms*.json", _pictures_of_transforms, (MASK,)),
    IN_FOLDERS,
    Manifest(f"{MESH}/{MANIFEST}", lambda _: [], files=files_of),
]
