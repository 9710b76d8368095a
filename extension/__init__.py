"""Plenoforge Rigs: see and edit the camera rigs of a scene YAML in Blender's viewport."""

import importlib
import sys

# Installing a later version reloads this file alone, so the other files are imported anew here.
for name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
    del sys.modules[name]
panel = importlib.import_module(".panel", __name__)


def register() -> None:
    panel.register()


def unregister() -> None:
    panel.unregister()
