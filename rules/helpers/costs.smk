# What the rules of costs.smk ask of the configuration.


@cache
def full_datasets(name):
    """Return a scene YAML's datasets at full size, by rig."""
    return {dataset.rig_folder: dataset for dataset in scene_datasets(name)}


def full_size(dataset):
    """Return what the scene YAML says of a dataset's size, whatever the preset.

    Without samples and denoise where the YAML has a target error instead, or there is no render.
    """
    full = full_datasets(dataset.scene_name)[dataset.rig_folder]
    settings = {key: full.render.get(key) for key in ("samples", "denoise")}
    return {
        "views": full.view_count,
        "resolution": full.rig.camera.resolution,
        **{key: value for key, value in settings.items() if value is not None},
    }


def status_words():
    """Return the words that name each chosen dataset to scripts/status.py."""
    words = []
    for dataset in CHOSEN:
        reprojections = ",".join(dataset.reprojections)
        words += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
    return shlex.join(words)
