# Functions for the rules of costs.smk.


@cache
def full_datasets(name):
    """Return a scene YAML's datasets at full size, by rig."""
    return {dataset.rig_folder: dataset for dataset in scene_datasets(name)}


def full_size(dataset):
    """Return the size of a dataset in the scene YAML, without the preset.

    It lacks samples and denoise if the YAML has a target error instead, or no render.
    """
    full = full_datasets(dataset.scene_name)[dataset.rig_folder]
    size = {"views": full.view_count, "resolution": full.rig.camera.resolution}
    if full.render.samples is not None:
        size["samples"] = full.render.samples
    if full.render.given_denoise is not None:
        size["denoise"] = full.render.given_denoise
    return size


def status_arguments():
    """Return the arguments that name each chosen dataset and family to scripts/status.py."""
    arguments = []
    for dataset in CHOSEN:
        reprojections = ",".join(dataset.reprojections)
        arguments += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
    for folder in FAMILY_FOLDERS:
        members = sum(map(len, batches_of(folder).values()))
        arguments += ["--family", folder, str(members)]
    return shlex.join(arguments)
