# Storage for jobs without a common folder. Snakemake moves the files that rules declare. The other
# files of a job travel in its bundle: see lightfield/core/bundles.py.
import sys
from pathlib import Path

from lightfield.configuration import scene_yaml
from lightfield.core.errors import UserError
from lightfield.workflow.storage import Storage

STORAGE = Storage(STORE)
# Where Snakemake puts its copies of stored files. The provider of a folder is fs.
PROVIDER, _, PLACE = STORE.rpartition("://")
COPIES = f".snakemake/storage/{PROVIDER or 'fs'}/{PLACE.strip('/')}/" if STORE else ""


# The settings of a plan with a storage, by path. A job writes each of them: see rules/settings.smk.
STORED_SETTINGS = {}


def mark_of_settings(wildcards):
    """Return the mark as the input of the job that writes settings, new if they have changed."""
    text = STORED_SETTINGS[wildcards.path]
    is_same = STORAGE.read(wildcards.path) == text.encode()
    return ancient(local(MARK)) if is_same else local(new_mark())


def check_storage():
    """Raise `UserError` for a path that jobs could not find in a storage."""
    for key, path in {"results": RESULTS, "work": WORK}.items():
        if lies_elsewhere(path):
            raise config_mistake(
                f"{key}: is {path}; must lie here, for the storage has its copy"
            )
    for dataset in CHOSEN_DATASETS:
        blend = dataset.source.blend
        if blend and lies_elsewhere(blend):
            raise scene_yaml.mistake(
                dataset.scene_name,
                f"scene.blend: is {blend}; must lie here, for the storage has its copy",
            )


def lies_elsewhere(path):
    """Return whether a path leads out of this folder."""
    return Path(path).is_absolute() or ".." in Path(path).parts


def use_copies(folder):
    """Make ``folder`` a link to Snakemake's copies. Raise `UserError` if it is something else.

    So programs see all files under the paths that rules and settings have. The function `python` of
    rules/shell.smk gives them these paths, too.
    """
    copies = Path(COPIES, folder).absolute()
    copies.mkdir(parents=True, exist_ok=True)
    link = Path(folder)
    if not (link.is_symlink() or link.exists()):
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(copies)
    if link.resolve() != copies.resolve():
        raise UserError(
            f"{folder}: is not a link to {copies}; each run and job with a storage needs a folder of "
            "its own: move the present content away"
        )


def use_copies_of_blends():
    """Make links to the copies of the users' .blend files, on machines that lack the files.

    The files that a .blend reads then lie where its paths lead to.
    """
    for blend in {d.source.blend for d in CHOSEN_DATASETS if d.source.blend}:
        link = Path(blend)
        if not (link.is_symlink() or link.exists()):
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(Path(COPIES, blend).absolute())


if STORE:
    try:
        check_storage()
        use_copies(RESULTS)
        use_copies(WORK)
        if not IS_MAIN_PROCESS:
            use_copies_of_blends()
    except UserError as error:
        sys.exit(f"error: {error}")
