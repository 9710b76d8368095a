# Functions for the rules of package.smk.


def documents_to_publish():
    """Return the descriptions of the chosen datasets whose scene YAML says how to publish them."""
    files = []
    for dataset in CHOSEN:
        if load_scene(dataset.scene_name).publish:
            files += dataset.sequence_paths.documents
    return files


def packed(wildcards):
    """Return the datasets in an archive: that of a rig, or those of all its frames."""
    rigs = {}
    for dataset in DATASETS.values():
        name = f"{dataset.scene_folder}/{dataset.rig_name}"
        rigs.setdefault(name, []).append(dataset)
    name = f"{wildcards.scene}/{wildcards.rig}"
    return one_of(rigs, name, RESULTS, "dataset of the chosen scenes")


def packed_sums(wildcards):
    """Return the checksums that exist when everything in an archive is finished.

    With a store, also return its files and their lists.
    """
    datasets = packed(wildcards)
    files = [dataset.paths.sums for dataset in datasets]
    if datasets[0].sequence_exports:
        files.append(datasets[0].sequence_sums)
    if STORE:
        if datasets[0].sequence_exports:
            files.append(datasets[0].sequence_paths.validation)
            files += datasets[0].sequence_exports
        for dataset in datasets:
            files += [dataset.paths.validation, *dataset.published]
            files += dataset.all_records
    return files


def pack_settings(wildcards):
    """Return the settings file of an archive: its datasets, its size, and its card's content."""
    datasets = packed(wildcards)
    settings = PackSettings.of(
        datasets=[dataset.name for dataset in datasets],
        gigabytes=SETTINGS.package_gigabytes,
        scene=load_scene(datasets[0].scene_name),
    )
    path = f"{WORK}/{wildcards.scene}/{wildcards.rig}/settings/pack.json"
    return settings_file(path, settings.as_json())
