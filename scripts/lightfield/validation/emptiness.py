"""Finds datasets whose views show nothing, as of a rig that is far from the scene."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.formats import lightfield
from lightfield.formats.layout import File, ImageSet
from lightfield.geometry import framing
from lightfield.validation.pixels import ImageFacts
from lightfield.validation.result import Check

# The name of the check.
NAME = "surfaces"


def checks(
    image_set: ImageSet,
    facts: Mapping[File, ImageFacts],
    clearance: Path | None,
    volumes: Sequence[str],
) -> list[Check]:
    """Return a check if no view of a rendered set shows a surface. Empty if any does, or may.

    It fails unless the views may show what has no depth: lamps, drawings or ``volumes``. Only the
    file ``clearance``, of scripts/check_cameras.py, tells of lamps and drawings.
    """
    missed = [fact.missed for fact in facts.values() if fact.patches is not None]
    if not missed or min(missed) < 1 or volumes:
        return []
    try:
        content = read_json(clearance) if clearance else {}
        where = _place(image_set, content)
        names = [str(name) for name in content["without_depth"]] if clearance else None
    except (LookupError, TypeError, ValueError):
        raise UserError(f"{clearance}: must have box and without_depth") from None
    if names == []:
        problem = f"{lightfield.NAME}: no view shows a surface or a light{where}"
        return [Check(NAME, False, "are in no view", problems=[problem])]
    maybe = f", but maybe {', '.join(names[:8])}" if names else ""
    return [Check(NAME, True, "", warnings=[f"no view shows a surface{maybe}{where}"])]


def _place(image_set: ImageSet, content: Mapping[str, Any]) -> str:
    """Return where the scene and the cameras are, if the ``content`` of a clearance has its box."""
    if "box" not in content:
        return ""
    box = np.array(content["box"], np.float64).reshape(2, 3)
    place = framing.place(image_set.lightfield.world_from_cameras[:, :3, 3], box)
    return f": the scene {place}; move the rig (center), or give the scene another size"
