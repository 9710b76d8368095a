"""The base classes of exporters, and the settings of one export.

An exporter is a class on `Export` in a file of its own. The fields are its keys in a scene YAML.
`refusal` says what the consumer cannot open, and what to do instead: it is called when a YAML is
read. `export` writes the files. Scene YAMLs are checked with all exporters, so a file imports
packages that load slowly only where it writes.
"""

import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, Literal, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from lightfield.core.names import PARTS, VIEWS
from lightfield.engine.stage import cause
from lightfield.export import cameras
from lightfield.formats.layout import Manifest
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import BlendCamera, Rig
from lightfield.geometry.rigs.plane import Plane
from lightfield.imaging import blender_looks
from lightfield.imaging.blender_looks import LookName
from lightfield.settings.base import FARTHEST, ReaderSettings, Settings
from lightfield.settings.types import REINHARD, Stops, White, unique_names

EXPORTERS: dict[str, "type[Export]"] = {}
"""All exporters by their names."""

PointCount = Annotated[int, Field(ge=1)]
AnimationRate = Annotated[
    float,
    Field(
        gt=0,
        le=1000,
        description="Frames of the animation in a second. If the rig leaves out frames, the export "
        "has fewer in a second.",
        json_schema_extra={"unit": "Hz"},
    ),
]
Metres = Annotated[float, Field(gt=0, le=FARTHEST)]
# Refusals of views without depth. What to do depends on the source, so scene_checks/exports.py
# adds it.
NO_DEPTH = "holds no depth"
NOT_EXR = "is not in EXR"
TO_RECTILINEAR = "reproject to rectilinear"


class Export(Settings, ABC):
    """The options that all exporters share."""

    # Its name in a scene YAML.
    name: ClassVar[str]
    # What it is, and which programs take it.
    summary: ClassVar[str]
    # How to load its files. {} stands for the folder that holds them, {view} for the name of a
    # view, and {frame} for the folder of a sequence's first frame.
    loader: ClassVar[str]
    # Its place in the schema, the reference and plans. Exporters without a place come last.
    rank: ClassVar[int] = 100
    # Whether the export includes other rigs' views, which test the trained models.
    is_for_training: ClassVar[bool] = False
    # Whether the export of views that test takes something from the list of the views that train.
    reads_training_list: ClassVar[bool] = False
    # Whether the export lists test views also if the rig has no split.
    chooses_tests: ClassVar[bool] = False
    # Whether the export is made of all frames of a sequence.
    is_of_sequence: ClassVar[bool] = False
    # Whether the export has the times of a rolling shutter's rows.
    has_row_times: ClassVar[bool] = False
    # Whether the export lifts points from the depth of the rendered views.
    needs_surfaces: ClassVar[bool] = False
    # The lists of an export whose files lie beside the views. A * stands for the part of a split.
    # Other exports have a folder of their own.
    lists_beside_views: ClassVar[Manifest | None] = None

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "name" in vars(cls):
            EXPORTERS[cls.name] = cls

    sources: list[str] = Field(
        min_length=1,
        description=f"What to export: names of reprojections, or `{VIEWS}` for the views as they "
        "were rendered. Each becomes an export of its own.",
    )
    # This changes no file of an export.
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        exclude=True,
        description="Rigs whose views are exported. Without this key, all rigs.",
    )

    @property
    def joined_rigs(self) -> list[str]:
        """The rigs whose views go into one export together, in the first one's folder, if any."""
        return []

    @property
    def chosen_rigs(self) -> list[str] | None:
        """The rigs whose views are exported, alone or together. None for all rigs."""
        return self.joined_rigs or self.rigs

    @property
    def rigs_key(self) -> str:
        """The key of the scene YAML that has the chosen rigs."""
        return "together" if self.joined_rigs else "rigs"

    @property
    def joins_split(self) -> bool:
        """Whether an export of a rig that trains concerns the rigs that test, and vice versa."""
        return self.is_for_training or self.reads_training_list

    @property
    def recorded(self) -> dict[str, Any]:
        """The options that the export's own files record."""
        return self.model_dump(mode="json", exclude={"sources"})

    @property
    def needed_passes(self) -> tuple[str, ...]:
        """The names of the passes that each source must have."""
        return ()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        """Return why the consumer cannot take views of a lens, and what to do. None if it can.

        ``has_depth`` says whether the source holds depth: EXR does, and PNG does not.
        """
        return None

    def joins(self, lens: Lens, other: Lens) -> bool:
        """Return whether one export can have views of both lenses."""
        return lens == other

    def rig_refusal(self, rig: Rig) -> str | None:
        """Return why the consumer cannot take the views of a rig. None if it can."""
        if self.is_of_sequence and isinstance(rig, BlendCamera):
            return (
                "is of type blend_camera, whose frames are views of one still scene, and this "
                "export is for sequences; give it a rig of another type with frames"
            )
        if self.is_of_sequence and (rig.sequence is None or len(rig.sequence.numbers) < 2):
            return (
                "has fewer than two frames, and this export is for sequences; give the rig frames"
            )
        if self.is_for_training and rig.view_count == 1 and rig.split not in PARTS:
            return "has only one view, so no view is left for testing"
        return None

    def picture_sizes(self, source: Any) -> set[tuple[int, int]]:
        """Return the widths and heights of the export's pictures: of its views, by default."""
        return {(lens.width, lens.height) for lens in source.lenses}

    @abstractmethod
    def export(self, source: Any, folder: Path) -> None:
        """Write the views of a `SourceDataset`, or of a `SourceSequence`, into ``folder``.

        For an export beside the views, it is the folder of their lightfield.json.
        """


class Joined(Export):
    """Exports that may have the views of several rigs."""

    # Settings name the folders of these rigs, so this changes no file of an export either.
    together: Annotated[list[str], AfterValidator(unique_names)] | None = Field(
        None,
        min_length=2,
        exclude=True,
        description="In place of rigs: rigs whose views go into one export, in the folder of the "
        "first. Names of the other rigs' views begin with the name of their rig.",
    )

    @model_validator(mode="after")
    def _alone_or_together(self) -> Self:
        if self.rigs and self.together:
            raise ValueError("must have rigs or together, not both")
        return self

    @property
    def joined_rigs(self) -> list[str]:
        return self.together or []


class Developed(Export):
    """Exports of 8-bit images. ``exposure``, ``reinhard``, ``look`` apply only to EXR sources."""

    exposure: Stops = Field(
        0.0,
        description="Exposure that is applied to EXR sources.",
        json_schema_extra={"unit": "stops"},
    )
    reinhard: White = Field(
        1.0,
        description=f"Tone mapping of EXR sources: the {REINHARD}",
        json_schema_extra={"unit": "light"},
    )
    look: LookName = None

    @model_validator(mode="after")
    def _one_tone_curve(self) -> Self:
        blender_looks.check_beside(self.look, self.reinhard)
        return self

    @property
    def recorded(self) -> dict[str, Any]:
        # An export records what the look is, and only if it is used.
        return {key: value for key, value in super().recorded.items() if key != "look"}


class ForTraining(Joined, Developed):
    """Exports to train with, which may have the views of several rigs."""

    is_for_training = True


def angle(lens: Equidistant) -> str:
    return f"sees {math.degrees(lens.fov):g} degrees"


def tracked_points() -> Any:
    """Return the field `points` of an export in which each image has points that it sees."""
    return Field(
        50000,
        description="Largest number of points, which are computed from depth. An image in which "
        "none of them lies gets one more.",
    )


def sideways_refusal(lens: Lens, program: str) -> str | None:
    """Return why a program whose lenses end below 180° cannot take a lens. None if it can."""
    if isinstance(lens, Equidistant) and lens.fov >= math.pi:
        return f"{angle(lens)}, but {program} fisheye ends below 180; give it a smaller fov"
    if not isinstance(lens, Rectilinear | Equidistant) and cameras.sees_sideways(lens):
        return f"sees 90 degrees from its axis, where {program} lenses end; give it a fov below 180"
    return None


def odd_size_refusal(lens: Lens) -> str | None:
    """Return why YUV 4:2:0, where 2 × 2 pixels share a colour, cannot hold an image. Or None."""
    if lens.width % 2 or lens.height % 2:
        return "has an odd width or height, which YUV 4:2:0 cannot have; use even sizes"
    return None


def centred_pinhole(lens: Lens) -> str | None:
    """Return why a lens is not a pinhole with a centred axis and square pixels. None if it is."""
    if not isinstance(lens, Rectilinear):
        return f"is not a pinhole camera, the only one that this layout has; {TO_RECTILINEAR}"
    if lens.center != (lens.width / 2, lens.height / 2) or not lens.has_square_pixels:
        return "has its axis off centre or oblong pixels, which this layout cannot describe"
    return None


def plane_refusal(rig: Rig) -> str | None:
    """Return why a rig is no plane of several cameras that look in parallel. None if it is."""
    is_turned = rig.mount is not None and bool(np.any(rig.mount.rotation))
    is_parallel = not (rig.cube_map or rig.stereo or rig.look_at is not None or is_turned)
    if not isinstance(rig, Plane) or not is_parallel:
        return "is not a rig of type plane with parallel cameras, which this export needs"
    return "has only one view" if rig.view_count == 1 else None


Options = TypeVar("Options", bound=Export)


class ExportSettings(ReaderSettings, Generic[Options]):
    """The settings of one job, which exports the views of one source."""

    options: Options = Field(
        description="Keys of the export in the scene YAML, with exactly one source."
    )
    suffix: Literal[".png", ".exr"] = Field(".exr", description="Suffix of the source's images.")
    tested_by: dict[str, str] = Field(
        {},
        description="Datasets whose views go into this export, too, to test or to train: their "
        "folders, by the names of their rigs.",
    )
    frames: list[str] | None = Field(
        None,
        min_length=2,
        description="Names of the folders of a sequence's frames, in the rig's folder.",
    )
    trained_by: str | None = Field(
        None,
        description="Path of the list of the views that train, from which this export of views "
        "that test takes scale and offset.",
    )
    spread_version: int | None = cause(
        "Version of the choice of test views, if the rig has no split."
    )
    points_version: int | None = cause(
        "Version of the choice of points, if the export has a number of them."
    )
    look_source: str | None = cause(
        "Version of bpy and SHA-256 of its config.ocio, if there is a look."
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if len(self.options.sources) != 1:
            raise ValueError("options.sources: must name one source")
        return self

    @property
    def source(self) -> str:
        """The source's folder within the dataset's folder. Empty for the rendered views."""
        (name,) = self.options.sources
        return "" if name == VIEWS else name
