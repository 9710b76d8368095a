# Storage for jobs without a common folder. Snakemake's own storage holds declared files. The view
# store, at the same place, holds the views, which are too many to declare.
import sys
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.workflow.view_store import ViewStore

# A shard's views are not among the outputs that Snakemake would bring to and from a job.
if not (STORE or SHARES_FILES):
    sys.exit(
        "error: shared-fs-usage: is without input-output; give --default-storage-provider and "
        "--default-storage-prefix, where views are then put, too, or let all nodes see one folder "
        "of results and work (a volume, NFS), and shared-fs-usage hold input-output"
    )


def taking(lists):
    """Return the command that copies the files that a job's ``lists`` name from the store."""
    if not STORE:
        return ""
    arguments = f"--mend --results {RESULTS} --work {WORK} {{{lists}}}"
    return f"python {SCRIPTS}/take_views.py {arguments} > {{log}} 2>&1; "


def finished_in_store():
    """Return the paths of the chosen datasets and sequences whose checksums are in the storage."""
    homes = [dataset.paths for dataset in CHOSEN]
    homes += [d.sequence_paths for d in CHOSEN if d.sequence_exports]
    store = ViewStore(STORE)
    return [
        paths
        for paths in dict.fromkeys(homes)
        if Path(paths.sums).name in store.names(paths.folder)
    ]


def stored_lists(wildcards):
    """Return the lists of all chosen datasets' files, and their checksums. Empty without a store."""
    if not STORE:
        return []
    files = []
    for dataset in CHOSEN:
        files += [*dataset.all_records, *dataset.published, *dataset.sequence_exports]
    for paths in finished_in_store():
        files += [paths.validation, paths.sums]
    return list(dict.fromkeys(files))


def check_storage():
    """Raise `UserError` for a path that jobs could not find in a storage."""
    if "://" not in STORE and not Path(STORE).is_absolute():
        raise UserError(
            f"default-storage-prefix: {STORE}: must be a URL, or a path from /"
        )
    places = {"results": RESULTS, "work": WORK}
    for dataset in CHOSEN:
        if dataset.source.blend:
            places[f"{dataset.scene_name}: scene.blend"] = dataset.source.blend
    for key, path in places.items():
        if Path(path).is_absolute() or ".." in Path(path).parts:
            raise UserError(
                f"{key}: {path}: must lie here, for the storage has its copy"
            )


def use_copies(folder):
    """Make ``folder`` a link to Snakemake's copies. Raise `UserError` if it is something else."""
    copies = Path(stored(folder)).absolute()
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


def bring_settings():
    """Copy the files here that say what the stored files were made from. A run may have none."""
    for dataset in CHOSEN:
        files = [
            dataset.blend_check,
            dataset.model_record,
            dataset.inventory,
            dataset.calibration,
            dataset.places,
        ]
        for path in (*files, *dataset.published, *dataset.sequence_exports):
            if path is not None:
                ViewStore(STORE).bring(path)


if STORE:
    try:
        check_storage()
        use_copies(RESULTS)
        use_copies(WORK)
        ViewStore(STORE).bring(SHARDS)
        if IS_MAIN_PROCESS:
            bring_settings()
    except UserError as error:
        sys.exit(f"error: {error}")
