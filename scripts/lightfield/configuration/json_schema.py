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
    content = _for_editors(MODELS[name].model_json_schema(schema_generator=Generator))
    if name == "config":
        # A config.yaml beside a user's own scenes has only the keys that differ.
        del content["required"]
    dialect = {"$schema": Generator.schema_dialect}
    return json.dumps(dialect | content, indent=2, ensure_ascii=False) + "\n"


def _for_editors(part: Any) -> Any:
    """Return a part of a schema as editors show it: with short descriptions that have the units."""
    if isinstance(part, list):
        return [_for_editors(item) for item in part]
    if not isinstance(part, dict):
        return part
    shown = {key: _for_editors(value) for key, value in part.items()}
    if isinstance(shown.get("description"), str):
        paragraph = shown["description"].partition("\n\n")[0].replace("``", "`")
        shown["description"] = " ".join(paragraph.split())
        if unit := shown.pop("unit", None):
            shown["description"] += f" Unit: {unit}."
    if isinstance(shown.get("default"), dict):
        default = {key: value for key, value in shown.pop("default").items() if value is not None}
        shown |= {"default": default} if default else {}
    if "patternProperties" in shown:
        shown["additionalProperties"] = False
    if isinstance(shown.get("properties"), dict):
        _name_kind(shown)
    return shown


def _name_kind(model: dict[str, Any]) -> None:
    """Title a model with the value of its type or lens, and describe that key as the model.

    Without one, remove its title, which is the name of a class.
    """
    model.pop("title", None)
    for key in model["properties"].values():
        if "const" in key:
            model["title"] = key["const"]
            key.setdefault("description", model["description"])
