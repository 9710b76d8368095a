"""Checks that the files exist that a dataset is made from, and counts the views that exist."""

import json
import os
import shlex
import time
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.family import Family
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, read_bytes, read_text, size_and_time
from lightfield.core.names import LIGHTS
from lightfield.core.paths import case_hint, files_below, lies_below
from lightfield.engine.receipts import name_of
from lightfield.workflow.failures import CLOCKS_DIFFER


def missing_views(dataset: Dataset) -> int:
    """Return how many views do not exist yet."""
    try:
        names = os.listdir(dataset.paths.views)  # noqa: PTH208, a `Path` is slow for many files
    except OSError:
        names = []
    existing = sum(name.endswith(".exr") for name in names)
    return max(0, dataset.view_count - existing)


def check_presence(dataset: Dataset) -> None:
    """Check that the user's .blend exists or can be downloaded, and the model and its light exist.

    Raises `UserError`.

    On machines without a common folder, only the user's machine has the file.
    """
    source = dataset.source
    hint = case_hint(Path(source.model or source.blend or "."))
    if source.model and not Path(source.model).is_file():
        raise scene_yaml.mistake(
            dataset.scene_name,
            f"scene.model: there is no file {source.model}{hint}; put it there",
        )
    if source.light_file:
        check_light(dataset.scene_name, source.light_file)
    if source.blend and not source.url and not Path(source.blend).is_file():
        page = f"get it from {source.page} and " if source.page else ""
        raise scene_yaml.mistake(
            dataset.scene_name,
            f"scene.blend: there is no file {source.blend}{hint}; {page}put it there",
        )


def check_lights(scene: str, family: Family) -> None:
    """Check the pictures that light the members of a family. Raises `UserError`."""
    light = family.values.get("scene.light")
    lights = (light.choice or []) if light else [scene_yaml.load_scene(scene).scene.light]
    for light_file in lights:
        if isinstance(light_file, str) and light_file not in LIGHTS:
            check_light(scene, light_file)


def check_light(scene: str, light_file: str) -> None:
    """Check that a picture can light a scene's model. Raises `UserError`. Reads its header."""
    # Only now, because other plans read no pictures.
    from lightfield.imaging import environment

    try:
        environment.check_header(Path(light_file))
    except UserError as error:
        raise scene_yaml.mistake(scene, f"scene.light: {error}") from None


def check_external_files(dataset: Dataset) -> None:
    """Check that the files in the inventory of the user's .blend exist. Raises `UserError`.

    Without an inventory, nothing is checked.
    """
    source = dataset.source
    if not source.blend or source.allow_missing:
        return
    try:
        inventory = json.loads(read_bytes(dataset.paths.inventory))
        home = Path(source.blend).parent
        paths = [
            Path(os.path.normpath(home / file["path"]))
            for file in inventory["external_files"]
            if file["bytes"] is not None
        ]
    except (OSError, *DAMAGE):
        return
    # Path.exists() raises for a path that is too long. os.path.exists() does not.
    missing_files = [
        f"{path}{case_hint(path)}"
        for path in paths
        if not os.path.exists(path)  # noqa: PTH110
    ]
    if missing_files:
        raise UserError(
            f"{source.blend}: files that it shows are missing: {_first_names(missing_files)}; put "
            "them back, or render without them: scene: {allow_missing: true}"
        )


def check_times(paths: Iterable[str], built: Sequence[str] = ()) -> None:
    """Raise `UserError` for a file whose time is in the future.

    ``built`` are the folders in which jobs made files, maybe on a node whose clock was ahead.
    """
    for path in paths:
        moment = time_of(path)
        if moment > time.time() + CLOCKS_DIFFER:
            shown = datetime.fromtimestamp(moment).isoformat(" ", "minutes")
            problem = f"{path}: its time is in the future ({shown}), so"
            if lies_below(path, map(name_of, built)):
                raise UserError(
                    f"{problem} no run sees what must be made again: set the clock of the machine "
                    "that made it, and give all such files the present time: find -L "
                    f"{shlex.join(built)} -newermt now -exec touch {{}} +"
                )
            raise UserError(
                f"{problem} all that is made from it would look outdated; give it the present "
                f"time: touch {shlex.quote(path)}"
            )


def time_of(path: str) -> float:
    """Return when a file was changed, in seconds since 1970. 0 without a file."""
    stamp = size_and_time(path)
    return stamp[1] / 1e9 if stamp else 0.0


def check_notes(folder: Path) -> None:
    """Raise `UserError` for a file that is no note of Snakemake, at which Snakemake would crash."""
    for path in files_below(folder, strict=False):
        try:
            if not _may_be_note(read_text(path)):
                raise UserError(f"{path}: is no note of Snakemake, but other JSON")
        except UserError as error:
            raise UserError(
                f"{error}; remove the folder: rm -r {folder}; no plan needs it"
            ) from None


def _may_be_note(text: str) -> bool:
    """Return whether Snakemake can read a note. It passes over a note that is not JSON."""
    try:
        return isinstance(json.loads(text), dict)
    except RecursionError:
        return False
    except ValueError:
        return True


def check_imported(dataset: Dataset) -> None:
    """Check that the views of a dataset to import exist. Raises `UserError`."""
    folder = Path(str(dataset.imported), "exr")
    files = [f"{pose.name}.exr" for pose in dataset.rig.poses()]
    missing_files = [file for file in files if not (folder / file).is_file()]
    if missing_files:
        raise UserError(
            f"{folder}: {_first_names(missing_files)}: no such file, but the dataset's "
            "lightfield.json has the view"
        )


def _first_names(names: list[str]) -> str:
    """Return the first eight names, and the number of the others."""
    text = ", ".join(names[:8])
    return text if len(names) <= 8 else f"{text} and {len(names) - 8} more"
