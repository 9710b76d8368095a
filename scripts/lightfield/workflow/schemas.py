"""Writes the JSON schemas, with which editors complete and check YAML files."""

from lightfield.configuration import json_schema
from lightfield.core.files import write_text
from lightfield.stages.report import WriteSchemas


def write(job: WriteSchemas) -> None:
    """Write the schema of each kind of YAML file."""
    for name in json_schema.MODELS:
        write_text(job.folder / f"{name}.schema.json", json_schema.schema(name))
