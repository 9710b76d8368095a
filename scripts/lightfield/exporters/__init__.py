"""All exporters. Each format is a class in a file of its own, which holds everything about it."""

import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from lightfield.exporters.base import EXPORTERS, Export, ExportSettings
from lightfield.formats.export_lists import FOLDER, IN_FOLDERS, MANIFEST, OF_MESH, OF_VIDEO
from lightfield.settings.base import Settings

__all__ = [
    "BESIDE_VIEWS",
    "EXPORTERS",
    "MANIFESTS",
    "SEQUENCE_EXPORTS",
    "Exports",
    "export_settings_of",
    "list_path",
    "lists_beside_views",
]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
_in_order = sorted(EXPORTERS.values(), key=lambda exporter: (exporter.rank, exporter.name))
EXPORTERS.clear()
EXPORTERS.update({exporter.name: exporter for exporter in _in_order})

SEQUENCE_EXPORTS = tuple(name for name, each in EXPORTERS.items() if each.is_of_sequence)
"""The formats that are made of a whole sequence."""

BESIDE_VIEWS = {
    name: each.lists_beside_views for name, each in EXPORTERS.items() if each.lists_beside_views
}
"""The formats whose lists lie beside the views, and the lists."""

MANIFESTS = [*BESIDE_VIEWS.values(), IN_FOLDERS, OF_MESH, OF_VIDEO]
"""The lists of all exports in a dataset."""


class _Selection(Settings):
    """The exports, by format."""

    @property
    def selected(self) -> dict[str, Export]:
        """The exports that the scene YAML selects, by name."""
        return {name: export for name, export in self if export}


if TYPE_CHECKING:
    Exports = _Selection
else:
    Exports = create_model(
        "Exports",
        __base__=_Selection,
        __module__=__name__,
        __doc__=_Selection.__doc__,
        **{
            name: (exporter | None, Field(None, description=exporter.summary))
            for name, exporter in EXPORTERS.items()
        },
    )
"""A scene YAML's ``exports``: the options of each exporter."""


def export_settings_of(name: str) -> type[ExportSettings[Export]]:
    """Return the model of an exporter's settings file."""
    generic: Any = ExportSettings
    model: type[ExportSettings[Export]] = generic[EXPORTERS[name]]
    return model


def list_path(name: str, part: str = "") -> str:
    """Return where the list of an export lies, below the folder of its source.

    ``part`` is a part of a split, which has a list of its own beside the views. A ``name`` that is
    a wildcard stands for all exports with a folder of their own.
    """
    if name in BESIDE_VIEWS:
        return BESIDE_VIEWS[name].lists.replace("*", part and f"_{part}")
    return f"{FOLDER}/{name}/{MANIFEST}"


def lists_beside_views(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield format and path of each export beside the views of the dataset in ``folder``.

    Files with the same names lie deeper in other exports.
    """
    for name in BESIDE_VIEWS:
        path = list_path(name)
        lists = sorted([*folder.glob(path), *folder.glob(f"*/{path}")])
        yield from ((name, each) for each in lists)
