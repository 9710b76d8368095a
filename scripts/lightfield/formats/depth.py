"""What channel Z of a view means: depth along the optical axis, or distance from the camera."""

from collections.abc import Mapping

from lightfield.formats.lightfield import LightField
from lightfield.imaging.images import DEPTH_ATTRIBUTE, Attribute


def depth_meaning(header: Mapping[str, Attribute], lightfield: LightField) -> str | None:
    """Return what channel Z of a view means: "z", "distance", or None if nothing says so.

    The ``header`` of the view takes precedence over its lightfield.json, which another program may
    have written.
    """
    meaning = header.get(DEPTH_ATTRIBUTE, lightfield.depth)
    return None if meaning is None else str(meaning)
