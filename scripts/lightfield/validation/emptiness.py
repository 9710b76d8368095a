"""Finds datasets whose views show nothing, as of a rig that is far from the scene."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.formats import lightfield
from lightfield.formats.layout import File, ImageSet
from lightfield.formats.lightfield import LightField
from lightfield.geometry import framing
from lightfield.validation.pixels import Facts
from lightfield.validation.result import Check

# The name of the check.
NAME = "surfaces"


def checks(
    image_set: ImageSet, facts: Mapping[File, Facts], clearance: Path | None, volumes: Sequence[str]
) -> list[Check]:
    """Return a check of a rendered set if views of it show nothing. Empty if all show something.

    It fails if no view shows a surface, unless the views may show what has no depth: lamps,
    drawings or ``volumes``. Only the file ``clearance``, of scripts/check_cameras.py, tells of
    lamps and drawings. It also fails if all views are transparent, or have one colour.
    """
    if not facts:
        return []
    has_depth = all(fact.patches is not None for fact in facts.values())
    missing = [file for file, fact in facts.items() if _misses(fact, has_depth)]
    if not missing or volumes:
        return []
    scene = _Scene.read(clearance)
    if len(missing) < len(facts):
        numbers = [file.view for file in missing]
        return _partly_empty(image_set.lightfield, numbers, len(facts), scene)
    where = scene.place(image_set.lightfield)
    if has_depth and scene.without_depth == []:
        return [_failed(f"no view shows a surface or a light{where}")]
    if all(fact.empty or (fact.constant and has_depth) for fact in facts.values()):
        return [_failed(f"no view shows anything{where}")]
    maybe = f", but maybe {', '.join(scene.without_depth[:8])}" if scene.without_depth else ""
    return [Check(NAME, True, "", warnings=[f"no view shows a surface{maybe}{where}"])]


def _misses(fact: Facts, has_depth: bool) -> bool:
    """Return whether a view shows no surface. Without depth, only transparent views tell."""
    return fact.missed == 1 if has_depth else fact.empty


def _partly_empty(
    lightfield: LightField, numbers: Sequence[int], count: int, scene: "_Scene"
) -> list[Check]:
    """Return a check with a warning that names the views that show no surface, by ``numbers``.

    Cameras within the scene's box count as right: they may look up, at the sky.
    """
    if scene.box is None:
        return []
    low, high = scene.box
    outside = [
        view.name
        for view in (lightfield.views[number] for number in numbers)
        if ((view.position < low) | (view.position > high)).any()
    ]
    if not outside:
        return []
    listed = f"{', '.join(outside[:8])}{' …' if len(outside) > 8 else ''}"
    warning = f"{len(outside)} of {count} views show no surface: {listed}{scene.place(lightfield)}"
    return [Check(NAME, True, "", warnings=[warning])]


def _failed(problem: str) -> Check:
    return Check(NAME, False, "are in no view", problems=[f"{lightfield.NAME}: {problem}"])


class _Scene(NamedTuple):
    """What scripts/check_cameras.py says of a scene. None where it says nothing.

    - ``box`` (2, 3): around all that has depth, in metres.
    - ``without_depth``: the names of lamps, drawings and volumes that views may show.
    """

    box: NDArray[np.float64] | None
    without_depth: list[str] | None

    @classmethod
    def read(cls, clearance: Path | None) -> Self:
        if clearance is None:
            return cls(None, None)
        try:
            content = read_json(clearance)
            names = [str(name) for name in content["without_depth"]]
            box = np.array(content["box"], np.float64).reshape(2, 3) if "box" in content else None
        except (LookupError, TypeError, ValueError):
            raise UserError(f"{clearance}: must have box and without_depth") from None
        return cls(box, names)

    def place(self, lightfield: LightField) -> str:
        """Return where the scene and the cameras are, if the scene has a box."""
        if self.box is None:
            return ""
        place = framing.place(lightfield.world_from_cameras[:, :3, 3], self.box)
        return f": the scene {place}; move the rig (center), or give the scene another size"
