"""Fills a scene with a user's own builder, and names the line of an error in the user's code."""

import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy

from lightfield.configuration import own_builder
from lightfield.core.errors import OutsideError, UserError, is_outside
from lightfield.engine import receipts
from lightfield.rendering.scenes.quiet import quiet

# The package of the builder, so that it can import files beside it with a dot, too.
_PACKAGE = "own_builder"


def fill(builder: Path, parameters: Mapping[str, Any]) -> None:
    """Fill the open scene. Raises `UserError` for any error of the user's code."""
    files = own_builder.files(builder)
    receipts.note_inputs(files)
    try:
        with _importable(builder, files):
            module = importlib.import_module(f"{_PACKAGE}.{builder.stem}")
            model = getattr(module, "Parameters", None)
            module.build(own_builder.typed(model, parameters, builder))
    except (Exception, SystemExit) as error:
        kind = OutsideError if is_outside(error) else UserError
        raise kind(own_builder.problem(files, builder, error)) from None
    _pack(builder, files)


@contextmanager
def _importable(builder: Path, files: Sequence[Path]) -> Iterator[None]:
    """Let the builder import the files in its folder. Forget all of them afterwards.

    So the next member of a family starts with the same state.
    """
    # A folder with the same name beside the builder must not replace the library.
    importlib.import_module("scenes.library")
    folder = str(builder.parent.absolute())
    package = ModuleType(_PACKAGE)
    package.__path__ = [folder]
    own_files = {file.resolve() for file in files}
    writes_no_bytecode = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.modules[_PACKAGE] = package
    sys.path.insert(0, folder)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(folder)
        sys.dont_write_bytecode = writes_no_bytecode
        for name, module in [*sys.modules.items()]:
            file = getattr(module, "__file__", None)
            if module is package or (file and Path(file).resolve() in own_files):
                del sys.modules[name]


def _pack(builder: Path, files: Sequence[Path]) -> None:
    """Pack the files that the scene shows into the .blend.

    Raises `UserError` for a file that the builder does not list: its change would not be seen.
    """
    listed_files = {file.resolve() for file in files}
    for name in sorted(bpy.utils.blend_paths(absolute=True, packed=False)):
        if Path(name).resolve() not in listed_files:
            raise UserError(
                f"{builder}: shows {name}, which is not in its list FILES; add it, with its path "
                "from the builder's folder"
            )
    try:
        with quiet():
            bpy.ops.file.pack_all()
    except RuntimeError as error:
        raise UserError(f"{builder}: {' '.join(str(error).split())}") from None
