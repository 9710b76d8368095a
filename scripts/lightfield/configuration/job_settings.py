"""The settings files of the smaller jobs.

The plan writes each model as JSON to work/<scene>/<rig>/settings/<stage>.json. A program reads the
file with --settings. The settings of light fields are in `lightfield.configuration.capture`.
Reprojections and exports have modules of their own.
"""

from pydantic import Field

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
