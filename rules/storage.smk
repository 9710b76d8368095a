# Where jobs see no common folder: Snakemake's own storage has what is declared, and the view store,
# at the same place, views, of which there are too many to declare.

# A shard's views are not among the outputs that Snakemake would bring to and from a job.
if not (STORE or SHARES_FILES):
    sys.exit(
        "error: shared-fs-usage: is without input-output; give --default-storage-provider and "
        "--default-storage-prefix, where views are then put, too, or let all nodes see one folder "
        "of results and work (a volume, NFS), and shared-fs-usage hold input-output"
    )


def taking(lists):
    """Return the command that takes from the store what a job's ``lists`` name."""
    words = f"--mend --results {RESULTS} --work {WORK} {{{lists}}}"
    return f"python {SCRIPTS}/take_views.py {words} > {{log}} 2>&1; " if STORE else ""


def stored_records(wildcards):
    """Return a dataset's records where the job takes its views from the store.

    Else its validation stands for them, and a plan of thousands of shards is shorter.
    """
    return dataset_of(wildcards).all_records if STORE else []


def stored_lists(wildcards):
    """Return what lists the files in the view store, of all chosen datasets; nothing without one."""
    datasets = CHOSEN if STORE else []
    return [file for d in datasets for file in (*d.all_records, *d.published)]


def check_storage():
    """Refuse what jobs could not find in a storage; raises `UserError`."""
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
    """Let ``folder`` be that of Snakemake's copies; raises `UserError` where it is another."""
    copies = Path(stored(folder)).absolute()
    copies.mkdir(parents=True, exist_ok=True)
    link = Path(folder)
    if not (link.is_symlink() or link.exists()):
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(copies)
    if link.resolve() != copies.resolve():
        raise UserError(
            f"{folder}: is no link to {copies}; each run and job with a storage needs a folder of "
            "its own: move what is there away"
        )


def bring_settings():
    """Bring here what says from what the stored files were made: each run may begin with none."""
    for dataset in CHOSEN:
        perhaps = (dataset.blend_check, dataset.inventory, dataset.calibration)
        for path in (*perhaps, dataset.places, *dataset.published):
            if isinstance(path, str):
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
