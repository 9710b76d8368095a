"""Light fields that somebody else has rendered, in the layout of SILVR's publications.

Each is a folder that has its rig's name. It has lightfield.json, and the views in exr/: R, G, B and
Z as half floats, Z along the optical axis in metres. Source: the SILVR paper, section 3.2.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry.rigs import Poses

# The keys of a lightfield.json that an import uses, beside the poses.
_USED_KEYS = {"camera", "lf_type", "resolution", "sensor_size", "depth"}
_USED_KEYS_OF_RENDER = {"transparent", "depth"}
_USED_KEYS_OF_FRAMES = {"split"}


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
    """Return the rigs of a folder of light fields by their names.

    Raises `UserError` for a file that cannot be read, and for views without a centre.
    """
    rigs = {}
    for name, path in lightfields(dataset).items():
        lightfield = LightField.read(path)
        lightfield.require_centre()
        settings = {
            "type": "poses",
            "file": str(path),
            "camera": lightfield.lens.settings(),
            **_split(lightfield.views),
        }
        rigs[name] = Poses.model_validate(settings)
    return rigs


def _split(views: Sequence[View]) -> dict[str, Any]:
    """Return the key ``split`` of a rig with these views. Empty if all are for one part."""
    names = {
        part: [view.name for view in views if view.split == part] for part in ("validation", "test")
    }
    is_split = 0 < sum(map(len, names.values())) < len(views)
    return {"split": names} if is_split else {}


def render(rig: Poses) -> RenderBlock:
    """Return the ``render`` block of a rig's views: the meaning of their channels Z and A."""
    lightfield = LightField.read(rig.file)
    return RenderBlock.of(
        depth=lightfield.depth or "none", transparent=lightfield.transparent or None
    )


def unused_keys(rig: Poses) -> list[str]:
    """Return the keys of a rig's lightfield.json that an import does not use."""
    lightfield = LightField.read(rig.file)
    keys = lightfield.content.keys() - _USED_KEYS
    if "render" in keys and lightfield.content["render"].keys() <= _USED_KEYS_OF_RENDER:
        keys.remove("render")
    of_frames = {key for view in lightfield.views for key in view.others} - _USED_KEYS_OF_FRAMES
    return sorted(keys) + [f"frames.{key}" for key in sorted(of_frames)]


def fingerprint(dataset: str) -> list[list[str]]:
    """Return the SHA-256 of each lightfield.json, which together identify a folder of them."""
    return [[name, sha256(path)] for name, path in lightfields(dataset).items()]
