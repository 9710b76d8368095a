"""The settings files of the smaller jobs.

The plan writes each model as JSON to work/<scene>/<rig>/settings/<stage>.json. A program reads the
file with --settings. The settings of light fields are in `lightfield.configuration.capture`.
Reprojections and exports have modules of their own.
"""

from typing import Any

from pydantic import Field

from lightfield.configuration.config_file import Preset
from lightfield.configuration.family import Draw, Member
from lightfield.core.settings import Settings


class ValidationSettings(Settings):
    """The settings of scripts/validate.py. Paths are those of the working folder."""

    reprojections: list[str] = Field(
        [], description="Names of the folders in the dataset that hold reprojections."
    )
    exports: list[str] | None = Field(
        None,
        description="Paths of the export.json or transforms.json of each export that the dataset "
        "must have. Without this key, any exports are allowed.",
    )
    records: list[str] = Field(
        [],
        description="Paths of records, which hold the sizes and checksums with which images were "
        "written.",
    )


class SequenceValidationSettings(Settings):
    """The settings of scripts/validate_sequence.py. Paths are those of the working folder."""

    frames: list[str] | None = Field(
        None,
        description="Names of the folders of the sequence's frames, in the rig's folder. Without "
        "this key, all of them.",
    )
    exports: list[str] | None = Field(
        None,
        description="Paths of the export.json of each export that the sequence must have. Without "
        "this key, any exports are allowed.",
    )


class BatchSettings(Settings):
    """The settings of scripts/build_members.py."""

    family: str = Field(description="Name of the family's scene YAML.")
    scene: dict[str, Any] = Field(
        description="Content of the family's scene YAML, without the block `family`."
    )
    values: dict[str, Draw] = Field({}, description="As in the block `family`.")
    members: list[Member] = Field(min_length=1, description="Members to build.")
    preset: str = Field(
        "full", description="Name of the preset, which becomes part of the folder's name."
    )
    limits: Preset = Field(Preset(), description="Limits of the preset.")
    results: str = Field("results", description="Folder in which the datasets are built.")
    work: str = Field("work", description="Folder for intermediate files.")
    fingerprint: str | None = Field(
        None,
        description="Hash of the builder's code, or version of the importer of models. If it "
        "changes, the members are built again.",
    )
    bpy: str | None = Field(
        None, description="Version of Blender. If it changes, the job runs again."
    )


class CountSettings(Settings):
    """The settings of scripts/count_members.py."""

    family: str = Field(description="Name of the family's scene YAML.")
    records: list[str] = Field(
        min_length=1, description="Paths of the records of the family's batches."
    )
