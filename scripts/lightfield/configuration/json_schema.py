"""The JSON schemas of the YAML files, made from the models of settings."""

import json
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from lightfield.configuration.config_file import Configuration
from lightfield.configuration.scene_yaml import Scene

MODELS: dict[str, type[BaseModel]] = {"config": Configuration, "scene": Scene}


class Generator(GenerateJsonSchema):
    """Makes a JSON schema of YAML files. A key may be left out, but not be null."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> dict[str, Any]:
        if schema.get("default", "") is None:
            return self.generate_inner(schema["schema"])
        return super().default_schema(schema)


def schema(name: str) -> str:
    """Return the text of a schema, by its name."""
    content = MODELS[name].model_json_schema(schema_generator=Generator)
    dialect = {"$schema": Generator.schema_dialect}
    return json.dumps(dialect | content, indent=2, ensure_ascii=False) + "\n"
