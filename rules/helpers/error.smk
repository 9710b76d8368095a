# Functions for the rules of error.smk.

# The probe cameras of the chosen scenes. Target rules name them, so that missing ones are made again.
PROBES = [f"{WORK}/{name}/probes.json" for name in RENDERED_SCENES]


@cache
def first_dataset(folder):
    """Return the dataset of a scene's first rig, whose views are the scene's probes.

    The folder of a scene that is not chosen is its name, and means the scene at full size.
    """
    for dataset in DATASETS.values():
        if dataset.scene_folder == folder:
            name, preset = dataset.scene_name, dataset.preset
            return scene_datasets(name, preset, dataset.limits, SETTINGS)[0]
    return scene_datasets(folder, settings=SETTINGS)[0]


def of_first(attribute):
    """Return an input function: it returns an attribute of that dataset."""
    return lambda wildcards: getattr(first_dataset(wildcards.scene), attribute) or []


def probe_settings(wildcards):
    """Return the settings file of a scene's probe cameras: those of its first rig."""
    dataset = first_dataset(wildcards.scene)
    if dataset.name in DATASETS:
        mark_stale_files(dataset.name)
    path = f"{WORK}/{wildcards.scene}/settings/probes.json"
    return settings_file(path, lightfield_settings(dataset))
