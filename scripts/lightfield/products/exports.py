"""Writes exports: files with which consumers open a dataset.

`lightfield.exporters` has a file for each format. `run` lets one of them write its files, and lists
them in the folder's export.json, which validation checks. The files of some exports lie beside the
views, and have a list of their own.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.export.sequence import SourceSequence
from lightfield.export.source import SourceDataset
from lightfield.exporters import list_path
from lightfield.exporters.base import Developed, Export, ExportSettings
from lightfield.formats.export_lists import MANIFEST, SIZES, files_of
from lightfield.formats.layout import FRAME_FOLDERS
from lightfield.formats.lightfield import NAME
from lightfield.stages.exports import ExportViews

Source = SourceDataset | SourceSequence


def write(job: ExportViews) -> None:
    """Write an export of a dataset's folder."""
    source = source_of(job.settings, job.dataset)
    run(source, job.settings.options, job.output)
    print(f"{job.output}: {units.count(len(source.lightfield.views), 'view')} for {job.format}")


def run(source: Source, options: Export, folder: Path) -> None:
    """Write an export into ``folder``.

    Replaces an earlier export in a folder of its own, and leaves no files there if it fails. Raises
    `UserError` if such a folder holds other files, or if the consumer cannot take these views.
    """
    for lens, path in source.lenses.items():
        if not options.joins(source.lens, lens):
            raise UserError(f"{path}: camera: must be the same as in {source.lightfield.path}")
        if reason := options.refusal(lens, source.has_depth):
            raise UserError(f"{path}: {reason}")
    if options.lists_beside_views:
        options.export(source, folder)
        return
    facts: dict[str, Any] = {"look": source.look.to_json()} if source.look else {}
    sizes = options.picture_sizes(source)
    if sizes != {(source.lens.width, source.lens.height)}:
        facts[SIZES] = sorted(sizes)
    place = source.dataset / source.name / list_path(options.name)
    replace_folder(
        options.name,
        {**options.recorded, **facts},
        folder,
        lambda target: options.export(source, target),
        is_own=folder.resolve() == place.parent.resolve(),
    )


def source_of(settings: ExportSettings[Any], dataset: Path) -> Source:
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
    if not options.is_of_sequence:
        training_list = Path(settings.trained_by) if settings.trained_by else None
        return SourceDataset(dataset, *views, **development, training_list=training_list)
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


def is_of_dataset(folder: Path, name: str) -> bool:
    """Return whether ``folder`` is the one of this ``name`` in a dataset.

    While lightfield.json is made again, the folder of the views tells.
    """
    has_views = (folder.parent / "exr").is_dir()
    return folder.name == name and (has_views or (folder.parent / NAME).is_file())


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
