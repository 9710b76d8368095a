# Functions for the rules of benchmark.smk.


def full_sizes(wildcards):
    """Return the views and the resolution of each rig of a scene at full size."""
    return {
        name: {
            "views": dataset.view_count,
            "resolution": dataset.rig.camera.resolution,
        }
        for name, dataset in full_datasets(wildcards.scene).items()
    }


def gpu_check_settings(wildcards):
    """Return the settings file of a scene's GPU check: the full sizes of its rigs."""
    path = f"{WORK}/{wildcards.scene}/settings/gpu_check.json"
    return settings_file(path, {"full": full_sizes(wildcards)})
