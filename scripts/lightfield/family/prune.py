"""Removes members and datasets that a family no longer has, with their files and receipts."""

import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

from lightfield.configuration.scene_yaml import load_scene
from lightfield.core.errors import UserError
from lightfield.core.files import writing
from lightfield.core.units import count
from lightfield.engine.receipts import FOLDER
from lightfield.stages.family import Prune
from lightfield.workflow.member_record import former_places


def prune(job: Prune) -> None:
    """Remove the former members and datasets of a job's families, and print the folder of each.

    Raises `UserError` for a scene without a family, and for a folder that cannot be removed.
    """
    for folder, scene in job.family:
        print(_pruned(job, folder, scene), flush=True)


def _pruned(job: Prune, folder: str, scene: str) -> str:
    """Remove what a family no longer has. Return in one line how many folders that were."""
    written = load_scene(scene)
    if written.family is None:
        raise UserError(f"--family: {scene} has no block family")
    results, receipts = job.results / folder, job.work / FOLDER / folder
    batches = written.family.batches()
    names = {member.name for members in batches.values() for member in members}
    places = former_places(results, receipts, names, written.rigs)
    # Old batches list the files of former members.
    for receipt in _former_batches(receipts, batches) if places else ():
        _remove(receipt)
    for name in places:
        # The receipt goes last: after a kill, it tells of the rest.
        for place in (results / name, job.work / folder / name, receipts / name):
            _remove(place)
        print(f"{results / name}: removed", flush=True)
    return f"{folder}: {count(len(places), 'former folder')} removed"


def _former_batches(receipts: Path, batches: Collection[str]) -> Iterator[Path]:
    """Yield the receipts of the batches that a family no longer has."""
    for path in sorted(receipts.glob("batches/*")):
        if path.stem not in batches:
            yield path


def _remove(place: Path) -> None:
    """Remove a file or folder, if it is there. Of a link, only the link is removed."""
    with writing(place):
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place)
        else:
            place.unlink(missing_ok=True)
