"""Names the shadow catchers of a scene, of which a picture shows only the shadows."""

import bpy


def names() -> list[str]:
    """Return the full names of the open scene's shadow catchers."""
    # Lamps have this property, too, with another meaning.
    surfaces = [obj for obj in bpy.data.objects if obj.type != "LIGHT"]
    return sorted(str(obj.name_full) for obj in surfaces if obj.is_shadow_catcher)
