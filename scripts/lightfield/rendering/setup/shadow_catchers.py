"""Names the shadow catchers of a scene, of which a picture shows only the shadows."""

from collections.abc import Iterable

import bpy

from lightfield.core.errors import UserError
from lightfield.formats.passes import VARIANCE, Pass


def names() -> list[str]:
    """Return the full names of the open scene's shadow catchers."""
    # Lamps have this property, too, with another meaning.
    surfaces = [obj for obj in bpy.data.objects if obj.type != "LIGHT"]
    return sorted(str(obj.name_full) for obj in surfaces if obj.is_shadow_catcher)


def check(passes: Iterable[Pass]) -> None:
    """Raise `UserError` if the scene has shadow catchers, and the ``passes`` have the variance.

    Cycles divides means of samples to get their shadows. So the mean of parts has other shadows.
    """
    catchers = names()
    if catchers and any(each.name == VARIANCE for each in passes):
        raise UserError(
            f"render.passes: {catchers[0]} is a shadow catcher, whose shadows are no means of "
            f"samples, as {VARIANCE} needs; make it an ordinary object, or leave {VARIANCE} out"
        )
