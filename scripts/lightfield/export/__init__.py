"""Writes the files with which consumers open a dataset: one module for each format.

Each module has ``export(source, settings, folder)``, which writes the views of a
`source.SourceDataset` into ``folder``. Its settings are in `lightfield.configuration.exports`.
`run` calls the module, and lists its files in the folder's export.json, which validation checks.
instant-ngp's files lie beside the views, and have a program of their own.
"""

import importlib
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lightfield.configuration.exports import SEQUENCE_EXPORTS, Developed, Export, ExportSettings
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.core.names import MESH
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import SourceDataset
from lightfield.formats.export_lists import FOLDER, MANIFEST, files_of
from lightfield.formats.layout import FRAME_FOLDERS
from lightfield.formats.lightfield import NAME
from lightfield.stages.exports import ExportViews

Source = SourceDataset | SourceSequence


def write(job: ExportViews) -> None:
    """Write an export of a dataset's folder."""
    source = source_of(job.format, job.settings, job.dataset)
    files = run(job.format, source, job.settings.options, job.output)
    print(f"{job.output}: {len(source.lightfield.views)} views in {len(files)} files")


def run(name: str, source: Source, settings: Export, folder: Path) -> dict[str, str]:
    """Write an export into ``folder``, and return the SHA-256 of its files by their names.

    Replaces an earlier export. Leaves no files behind if it fails. Raises `UserError` if the folder
    holds other files, or if the consumer cannot take these views.
    """
    reason = settings.refusal(source.lens, source.has_depth)
    if reason:
        raise UserError(f"{source.lightfield.path}: {reason}")
    exporter = importlib.import_module(f"lightfield.export.{name}")
    look = {"look": source.look.to_json()} if source.look else {}
    return replace_folder(
        name,
        {**settings.recorded, **look},
        folder,
        lambda target: exporter.export(source, settings, target),
        is_own=folder.resolve() == (source.dataset / source.name / FOLDER / name).resolve(),
    )


def source_of(name: str, settings: ExportSettings[Any], dataset: Path) -> Source:
    """Return the views for an export of the folder ``dataset``. For a sequence, it is the rig's."""
    options = settings.options
    development: dict[str, Any] = {}
    if isinstance(options, Developed):
        development = {
            "exposure": options.exposure,
            "reinhard": options.reinhard,
            "look_name": options.look,
        }
    test_folders = {rig: Path(folder) for rig, folder in settings.tested_by.items()}
    views = (settings.source, settings.suffix, test_folders)
    if name not in SEQUENCE_EXPORTS:
        return SourceDataset(dataset, *views, **development)
    folders = settings.frames or [path.name for path in dataset.glob(FRAME_FOLDERS)]
    return SourceSequence.of_folders(dataset, folders, *views, **development)


def replace_folder(
    name: str,
    options: Mapping[str, Any],
    folder: Path,
    write: Callable[[Path], None],
    is_own: bool,
) -> dict[str, str]:
    """Let ``write`` fill ``folder``, and list its files in export.json. Return their SHA-256.

    ``name`` and ``options`` are what export.json says of them. Replaces an earlier export. Leaves
    no files behind if it fails. ``is_own`` says whether the folder is one of the workflow's, where
    a killed run may have left an export without its export.json. Raises `UserError` if another
    folder holds other files.
    """
    # If the folder is a link, replace what it leads to, and keep the link.
    folder = folder.resolve()
    if not is_own:
        _check_replaceable(folder)
    is_there = folder.is_dir()
    shutil.rmtree(folder, ignore_errors=True)
    try:
        write(folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        if is_there:
            # Snakemake puts the earlier export.json back. Without a folder, it would end.
            folder.mkdir(parents=True, exist_ok=True)
        raise
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    files = {path.relative_to(folder).as_posix(): sha256(path) for path in paths}
    write_json(folder / MANIFEST, {"format": name, "options": options, "files": files})
    return files


def is_mesh_of_dataset(folder: Path) -> bool:
    """Return whether ``folder`` is the one for the surface of a dataset.

    While lightfield.json is made again, the folder of the views tells.
    """
    has_views = (folder.parent / "exr").is_dir()
    return folder.name == MESH and (has_views or (folder.parent / NAME).is_file())


def _check_replaceable(folder: Path) -> None:
    """Raise `UserError` if a folder holds a file that no earlier export wrote."""
    listing = folder / MANIFEST
    exported = {MANIFEST}
    if listing.is_file():
        exported.update(files_of(listing))
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if name not in exported and not path.is_dir():
            raise UserError(f"{folder}: holds {name}, which no export wrote; give another folder")


def transforms(folder: Path) -> list[Path]:
    """Return the transforms.json that instant-ngp's exports wrote for the dataset in ``folder``.

    nerfstudio's files have the same name, but lie deeper.
    """
    return sorted([*folder.glob("transforms.json"), *folder.glob("*/transforms.json")])
