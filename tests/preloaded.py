"""Lets forks share the project's own modules, which their server has imported.

A fork takes them only if the checkout in which it runs has the same programs as this repository.
Otherwise, as after a test has changed a program, it imports the checkout's own files.
"""

import importlib
import importlib.abc
import importlib.util
import os
import pkgutil
import sys
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAME = "lightfield"


class Preloaded(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds and loads the modules of the project that were imported before."""

    def __init__(self):
        self.modules = imported_modules()
        self.programs = listing(ROOT / "scripts")
        self.paths = [
            (module, name, value.relative_to(ROOT))
            for module in self.modules.values()
            for name, value in vars(module).items()
            if isinstance(value, Path) and value.is_relative_to(ROOT)
        ]

    def find_spec(self, name, path, target=None):
        """Return a spec that loads the module, or None if the checkout's own file must be read."""
        if name == NAME:
            self.choose()
        if name not in self.modules:
            return None
        return importlib.util.spec_from_loader(name, self)

    def choose(self):
        """Keep the modules if the checkout has the same programs, and else forget them all."""
        folder = next(path for path in map(Path, sys.path) if (path / NAME).is_dir()).resolve()
        if listing(folder) != self.programs:
            self.modules = {}
        elif folder != ROOT / "scripts":
            self.move(folder.parent)

    def move(self, checkout):
        """Let all paths in the modules lead to the checkout."""
        for module, name, value in self.paths:
            setattr(module, name, checkout / value)
        for module in self.modules.values():
            module.__file__ = module.__file__.replace(str(ROOT), str(checkout), 1)
            if hasattr(module, "__path__"):
                module.__path__ = [module.__file__.removesuffix("/__init__.py")]

    def create_module(self, spec):
        return self.modules[spec.name]

    def exec_module(self, module):
        """Do nothing, because the module has been executed."""


def listing(folder):
    """Return the size and time of each file on which the modules of a scripts/ folder depend.

    Of the builders of scenes, the modules only read the names.
    """
    status = dict.fromkeys(path.name for path in (folder / "scenes").iterdir())
    folders = [str(folder / NAME)]
    for parent in folders:
        with os.scandir(parent) as entries:
            for entry in entries:
                if entry.name.endswith(".py"):
                    stat = entry.stat()
                    status[entry.path[len(str(folder)) :]] = (stat.st_size, stat.st_mtime_ns)
                elif "." not in entry.name and entry.name not in {"__pycache__", "templates"}:
                    folders.append(entry.path)
    return status


def imported_modules():
    """Import the project's modules, and return them by name. Leaves none of them loaded.

    A module that imports Blender is left out, because that would start threads.
    """
    folder = str(ROOT / "scripts")
    sys.path.insert(0, folder)
    sys.modules["bpy"] = None
    for module in pkgutil.walk_packages([f"{folder}/{NAME}"], f"{NAME}."):
        with suppress(ModuleNotFoundError):
            importlib.import_module(module.name)
    del sys.modules["bpy"]
    sys.path.remove(folder)
    names = [name for name in sys.modules if name.partition(".")[0] == NAME]
    modules = {name: sys.modules.pop(name) for name in names}
    for settings in all_subclasses(modules[f"{NAME}.core.settings"].Settings):
        settings.model_rebuild()
    return modules


def all_subclasses(parent):
    """Return the subclasses of a class, and theirs."""
    return [
        one for subclass in parent.__subclasses__() for one in (subclass, *all_subclasses(subclass))
    ]
