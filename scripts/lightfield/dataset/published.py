"""Light fields that somebody else has rendered, in the layout in which SILVR publishes its own.

Each is a folder, named for its rig, with lightfield.json and the views in exr/: R, G, B and Z as
half floats, Z along the optical axis in metres. Source: the SILVR paper, section 3.2.
"""

from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.geometry.rigs import Poses


def lightfields(dataset: str) -> dict[str, Path]:
    """Return the lightfield.json of each rig in a folder, which may be such a rig's itself.

    Raises `UserError` where there is none.
    """
    folder = Path(dataset)
    if (folder / NAME).is_file():
        return {folder.resolve().name: folder / NAME}
    # A link has the name that was given to it: two may lead to folders of one name.
    found = {path.parent.name: path for path in sorted(folder.glob(f"*/{NAME}"))}
    if not found:
        raise UserError(f"there is no {NAME} in {dataset}, nor in a folder in it")
    return found


def rigs(dataset: str) -> dict[str, Poses]:
    """Return the rigs of a folder of light fields by their names; raises `UserError`."""
    return {
        name: Poses.model_validate(
            {
                "type": "poses",
                "file": str(path.resolve()),
                "camera": LightField.read(path).lens.settings(),
            }
        )
        for name, path in lightfields(dataset).items()
    }


def depth(rig: Poses) -> str:
    """Return what channel Z of a rig's views holds: z, distance or none."""
    return LightField.read(rig.file).depth or "none"


def fingerprint(dataset: str) -> list[list[str]]:
    """Return what identifies a folder of light fields: the SHA-256 of each lightfield.json."""
    return [[name, sha256(path)] for name, path in lightfields(dataset).items()]
