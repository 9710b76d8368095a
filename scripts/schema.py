"""Write the JSON schemas in configs/schema/, with which editors complete and check YAML files.

They follow from the models in lightfield/dataset/config.py. Run this after a change there.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.core.files import write_text
from lightfield.dataset.config import ROOT, Configuration, Scene

# isort: split
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

FOLDER = ROOT / "configs" / "schema"
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="default: %(default)s")
    folder: Path = parser.parse_args().folder
    for name in MODELS:
        write_text(folder / f"{name}.schema.json", schema(name))


if __name__ == "__main__":
    run(main)
