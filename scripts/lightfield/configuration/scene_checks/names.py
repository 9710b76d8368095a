"""Checks names of folders, and names of rigs and sources that a block chooses."""

import re
from collections.abc import Iterable, Set

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.core.names import VIEWS
from lightfield.settings.base import suggestion

# Names of files, and of a sequence's frames, beside the folders of rigs and reprojections.
_OTHER_NEIGHBOURS = re.compile(r"f\d{5,7}|.*\.(blend|html|jsonl?|lock|log|part|tar|tsv|txt)")


def check_folder(key: str, name: str, neighbours: Set[str]) -> None:
    """Check that a folder can have this name beside its ``neighbours``."""
    if name in neighbours or _OTHER_NEIGHBOURS.fullmatch(name):
        raise ValueError(f"{key}: the name {name} is taken; choose another")


def check_rigs(blocks: SceneBlocks, key: str, names: Iterable[str]) -> None:
    """Check that there are rigs of these names."""
    for name in names:
        if name not in blocks.rigs:
            cameras = [
                rig
                for rig, settings in blocks.rigs.items()
                if settings.mount and settings.mount.head == name
            ]
            hint = suggestion(name, blocks.rigs)
            if cameras:
                hint = f"; it is a head, whose rigs are {', '.join(cameras)}"
            raise ValueError(f"{key}: there is no rig {name!r}{hint}")


def check_sources(key: str, sources: Iterable[str], folders: Iterable[str]) -> None:
    """Check that sources are the views, or of the ``folders`` that hold other versions of them."""
    allowed_sources = [VIEWS, *folders]
    for source in sources:
        if source not in allowed_sources:
            hint = suggestion(source, allowed_sources)
            raise ValueError(f"{key}: is {source!r}; must be of {', '.join(allowed_sources)}{hint}")
