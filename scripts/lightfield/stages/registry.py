"""All stages, as the modules of this package define them."""

import importlib
import pkgutil
from collections.abc import Iterator
from typing import Any

from lightfield import stages
from lightfield.engine.stage import Stage


def _stages() -> Iterator[type[Stage[Any]]]:
    """Yield the classes of all stages. Classes that only help to make stages have no name."""
    for found in pkgutil.iter_modules(stages.__path__, f"{stages.__name__}."):
        if found.name != __name__:
            for value in vars(importlib.import_module(found.name)).values():
                is_stage = isinstance(value, type) and issubclass(value, Stage)
                if is_stage and value.__module__ == found.name and hasattr(value, "name"):
                    yield value


STAGES = [*_stages()]
BY_NAME = {stage.name: stage for stage in STAGES}
VERSIONS = {stage.name: getattr(stage, "version", None) for stage in STAGES}
