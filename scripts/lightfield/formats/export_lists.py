"""The lists of exports' files in a dataset: which kinds there are, and how to read each."""

from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.names import MESH, VIDEO
from lightfield.formats.layout import Manifest

# The list of an export's files, which is written last.
MANIFEST = "export.json"

# The option of an export.json that lists the sizes of its pictures, if there are several.
SIZES = "sizes"

# The folder of a dataset that holds its exports.
FOLDER = "exports"


def files_of(path: Path) -> dict[str, str]:
    """Return the files that an export.json lists, with their SHA-256."""
    try:
        files = read_json(path)["files"]
        return {str(name): str(digest) for name, digest in files.items()}
    except (UserError, LookupError, TypeError, AttributeError):
        raise UserError(f"{path}: is not JSON with files and their sha256") from None


def _pictures(path: Path) -> list[str]:
    """Return the pictures that have the size of the views: none if there are several sizes."""
    pictures = [name for name in files_of(path) if name.endswith(".png")]
    options = read_json(path).get("options")
    has_sizes = isinstance(options, dict) and SIZES in options
    return [] if has_sizes else pictures


# The exports with a folder of their own. Exports of a sequence are in the rig's folder.
IN_FOLDERS = Manifest(f"{FOLDER}/*/{MANIFEST}", _pictures, files=files_of)
OF_MESH = Manifest(f"{MESH}/{MANIFEST}", lambda _: [], files=files_of)
# Its pictures have a size of their own.
OF_VIDEO = Manifest(f"{VIDEO}/{MANIFEST}", lambda _: [], files=files_of)
