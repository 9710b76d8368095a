# What the rules of benchmark.smk ask of the configuration.


def full_sizes(wildcards):
    """Return the views and the resolution of each rig of a scene at full size, as JSON."""
    return json.dumps(
        {
            name: {
                "views": dataset.view_count,
                "resolution": dataset.rig.camera.resolution,
            }
            for name, dataset in full_datasets(wildcards.scene).items()
        }
    )
