"""The look of a scene's pictures, which its page, its thumbnails and its drawings have, too."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pydantic import Field

from lightfield.engine.stage import cause
from lightfield.imaging import blender_looks
from lightfield.imaging.blender_looks import FILE_LOOK, LookName
from lightfield.settings.base import Settings
from lightfield.settings.types import Stops

if TYPE_CHECKING:
    from lightfield.formats.lightfield import LightField
    from lightfield.imaging.look import Look


class ShownLook(Settings):
    """The look of the first reprojection or export that has one."""

    name: LookName = None
    exposure: Stops = Field(
        0.0, description="Exposure of these pictures.", json_schema_extra={"unit": "stops"}
    )
    source: str | None = cause("Version of bpy and SHA-256 of its config.ocio.")

    def resolved(self, lightfield: "LightField") -> "Look | None":
        """Return the look of the views of a dataset."""
        # Only here, because it imports numpy, which the --help of stages with a look does not need.
        from lightfield.imaging.look import Look

        return Look.of(self.name, self.exposure, lightfield.content.get(FILE_LOOK))


def shown_look(reprojections: Iterable[Any], exports: Iterable[Any]) -> ShownLook | None:
    """Return the look that the pictures of a scene have: of its reprojections, or its exports.

    A sensor counts last, because its exposure is its own. None if no picture has a look.
    """
    made = [*reprojections, *exports]
    with_look = [each for each in made if getattr(each, "look", None)]
    if not with_look:
        return None
    first = min(with_look, key=_has_sensor)
    return ShownLook(
        name=first.look,
        exposure=0.0 if _has_sensor(first) else first.exposure,
        source=blender_looks.source_of(first.look),
    )


def _has_sensor(options: Any) -> bool:
    return getattr(options, "sensor", None) is not None
