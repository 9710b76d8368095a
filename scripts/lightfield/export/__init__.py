"""The files with which each consumer opens a dataset: one module a format.

An exporter has ``export(source, settings, folder)``: it writes the views of a `source.Source` into
a folder of its own, as its settings in `lightfield.dataset.exports` ask. `run` finds it by its
name and lists what it wrote in the folder's export.json, which validation checks. instant-ngp's
files lie beside the views, with a program of their own.
"""

import importlib
import shutil
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_json
from lightfield.dataset.exports import MANIFEST, Export
from lightfield.dataset.view_store import ViewStore
from lightfield.export import instant_ngp
from lightfield.export.source import Source
from lightfield.validation.files import Manifest

# In a dataset, where exports are.
FOLDER = "exports"


def run(name: str, source: Source, settings: Export, folder: Path) -> dict[str, str]:
    """Write an export into ``folder``, in place of an earlier one; return its files' SHA-256.

    Nothing is left of an export that fails. Raises `UserError` where anything else is there, and
    for views that its consumer cannot take.
    """
    if wrong := settings.refusal(source.lens, source.has_depth):
        raise UserError(f"{source.lightfield.path}: {wrong}")
    # A link stays one.
    folder = folder.resolve()
    # There a killed run may have left an export without its list.
    if folder != (source.dataset / source.name / FOLDER / name).resolve():
        _check_replaceable(folder)
    shutil.rmtree(folder, ignore_errors=True)
    try:
        importlib.import_module(f"lightfield.export.{name}").export(source, settings, folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    files = {path.relative_to(folder).as_posix(): sha256(path) for path in paths}
    write_json(folder / MANIFEST, {"format": name, "options": settings.recorded, "files": files})
    if store := ViewStore.configured():
        store.put_list(folder / MANIFEST, paths)
    return files


def _check_replaceable(folder: Path) -> None:
    """Raise `UserError` where a folder holds what no earlier export has put there."""
    listing = folder / MANIFEST
    own = {MANIFEST, *(_files(listing) if listing.is_file() else ())}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if name not in own and not path.is_dir():
            raise UserError(f"{folder}: holds {name}, which is of no export; give another folder")


def transforms(folder: Path) -> list[Path]:
    """Return instant-ngp's files of the dataset in a folder; nerfstudio's have the same name."""
    return sorted([*folder.glob("transforms.json"), *folder.glob("*/transforms.json")])


def _files(path: Path) -> dict[str, str]:
    """Return the files that an export.json lists, with their SHA-256."""
    try:
        files = read_json(path)["files"]
        return {str(name): str(digest) for name, digest in files.items()}
    except (UserError, LookupError, TypeError, AttributeError):
        raise UserError(f"{path}: is no JSON with files and their sha256") from None


def _pictures(path: Path) -> list[str]:
    return [name for name in _files(path) if name.endswith(".png")]


MANIFESTS = [
    instant_ngp.MANIFEST,
    Manifest(f"{FOLDER}/*/{MANIFEST}", _pictures, files=_files),
]
