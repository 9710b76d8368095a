"""The stages that place a rig's cameras, check them, and write the light field."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer

from lightfield.configuration.capture import LightfieldSettings
from lightfield.core.names import FILE, IMU, INVENTORY
from lightfield.engine.stage import ByHand, PlainStage, Stage, option, reads, writes
from lightfield.geometry.boards import Boards
from lightfield.geometry.rigs import Random, as_written
from lightfield.geometry.rigs.rig import Frame
from lightfield.settings.base import Settings

# The keys of a rig that say what a camera sees and what its view is for.
_CAMERA_KEYS = ("camera", "split")


def _places_as_written(rig: Random) -> dict[str, Any]:
    """Return the keys of a rig in its scene YAML, without the keys that move no camera."""
    return {key: value for key, value in as_written(rig).items() if key not in _CAMERA_KEYS}


class FreePlacesSettings(Settings):
    """The settings of scripts/free_places.py."""

    rig: Annotated[Random, PlainSerializer(_places_as_written)] = Field(
        description="The rig's block in the scene YAML, without camera and split."
    )
    frame: Frame | Literal["file"] = Field(
        1, description=f"Frame to load. {FILE}: the .blend's own."
    )
    scene_name: str | None = Field(None, description="As in the scene YAML.")
    view_layers: Literal["all"] | list[str] | None = Field(
        None, description="As in the scene YAML."
    )
    targets: Boards | None = Field(None, description="As in the scene YAML.")


class FreePlaces(Stage[FreePlacesSettings]):
    """Finds places for the cameras of a random rig that have free space around them."""

    name = "free_places"
    function = "lightfield.rendering.inspection.camera_files:write_places"

    blend: Path = reads("the scene's .blend")
    inventory: Path | None = reads(INVENTORY, None)
    output: Path = writes("JSON to write")


class SceneAndRig(ByHand):
    """The rig of a scene YAML, at full size."""

    scene: str = option("name of a file in configs/scenes/")
    rig: str | None = option(
        "name of a rig in the scene YAML (default: the first rig); for a frame of a sequence, "
        "add its folder, as in rig/f00001",
        None,
    )

    def settings(self, given: Mapping[str, Any]) -> LightfieldSettings:
        from lightfield.planning.loading import rig_dataset

        dataset = rig_dataset(self.scene, self.rig)
        return LightfieldSettings.of_capture(dataset, flow=bool(dataset.flow))


class MakeLightfield(Stage[LightfieldSettings]):
    """Writes a dataset's lightfield.json: its lens, the poses of its views, and its rendering."""

    name = "make_lightfield"
    function = "lightfield.rendering.views.lightfield_file:write"
    by_hand = SceneAndRig

    calibration: Path | None = reads(
        "JSON that scripts/calibrate.py wrote, for a scene with target_error", None
    )
    inventory: Path | None = reads(f"{INVENTORY}, for a user's .blend and for light_groups", None)
    model: Path | None = reads("JSON that scripts/import_model.py wrote, for a model", None)
    places: Path | None = reads("JSON that scripts/free_places.py wrote, for a random rig", None)
    output: Path = writes("lightfield.json to write")

    def made(self) -> Iterator[Path]:
        yield from super().made()
        yield self.output.with_name(IMU)


class FindCorners(PlainStage):
    """Finds the corners of calibration boards in each view."""

    name = "corners"
    function = "lightfield.rendering.inspection.corners:write"

    blend: Path = reads("the scene's .blend")
    lightfield: Path = reads("lightfield.json of the dataset")
    inventory: Path | None = reads(INVENTORY, None)
    output: Path = writes("JSON to write")


class CheckCameras(PlainStage):
    """Finds cameras that are inside geometry, or that would show it wrongly."""

    name = "check_cameras"
    function = "lightfield.rendering.inspection.camera_files:write_clearance"
    version = 2

    blend: Path = reads("the scene's .blend")
    lightfield: Path = reads("lightfield.json of the dataset")
    inventory: Path | None = reads(INVENTORY, None)
    output: Path = writes("JSON to write")
