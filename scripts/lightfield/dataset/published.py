"""Light fields that somebody else has rendered, in the layout of SILVR's publications.

Each is a folder that has its rig's name. It has lightfield.json, and the views in exr/: R, G, B and
Z as half floats, Z along the optical axis in metres. Source: the SILVR paper, section 3.2.
"""

from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.geometry.rigs import Poses


def lightfields(dataset: str) -> dict[str, Path]:
    """Return the lightfield.json of each rig in a folder. The folder may also be a rig's own.

    Raises `UserError` if there is none.
    """
    folder = Path(dataset)
    if (folder / NAME).is_file():
        return {folder.resolve().name: folder / NAME}
    # Use the names of links: two links may lead to folders of equal names.
    file_of_rig = {path.parent.name: path for path in sorted(folder.glob(f"*/{NAME}"))}
    if not file_of_rig:
        raise UserError(f"there is no {NAME} in {dataset}, nor in a folder in it")
    return file_of_rig


def rigs(dataset: str) -> dict[str, Poses]:
    """Return the rigs of a folder of light fields by their names. Raises `UserError`."""
    rigs = {}
    for name, path in lightfields(dataset).items():
        camera = LightField.read(path).lens.settings()
        settings = {"type": "poses", "file": str(path.resolve()), "camera": camera}
        rigs[name] = Poses.model_validate(settings)
    return rigs


def depth(rig: Poses) -> str:
    """Return what channel Z of a rig's views holds: "z", "distance" or "none"."""
    return LightField.read(rig.file).depth or "none"


def fingerprint(dataset: str) -> list[list[str]]:
    """Return the SHA-256 of each lightfield.json, which together identify a folder of them."""
    return [[name, sha256(path)] for name, path in lightfields(dataset).items()]
